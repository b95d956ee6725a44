"""The job of a sweep: its parts are the segments."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.results.result_file import Parts
from gapwalk.studies.file import Study
from gapwalk.studies.interruption import found_by
from gapwalk.studies.request import Keeper
from gapwalk.studies.sweep.call import STRETCH, segments
from gapwalk.studies.sweep.driver import Driver
from gapwalk.studies.sweep.finding import SweepFinding
from gapwalk.studies.sweep.study_options import SweepStudyOptions
from gapwalk.studies.sweep.sweeping import sweep


def work_sweep(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> SweepFinding:
    """Drive the sweep; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, SweepStudyOptions)
    to = (options.begin, options.end)
    found = found_by(sweep, study.system, options.parameter, to, options=options.limits, report=report, output=file)
    return SweepFinding(found)


def read_sweep(study: Study, parts: Parts) -> SweepFinding:
    """What has been driven; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, SweepStudyOptions)
    driver = Driver(study.system, options.parameter, (options.begin, options.end), options.limits)
    driver.take(segments(parts.all(STRETCH), driver))
    return SweepFinding(driver.sweep())
