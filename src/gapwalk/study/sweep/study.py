"""The job of a sweep: its parts are the stretches."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.results.file import Parts
from gapwalk.study.file import Study
from gapwalk.study.interruption import found_by
from gapwalk.study.request import Keeper
from gapwalk.study.sweep.call import STRETCH, stretches
from gapwalk.study.sweep.driver import Driver
from gapwalk.study.sweep.finding import SweepFinding
from gapwalk.study.sweep.study_options import SweepStudyOptions
from gapwalk.study.sweep.sweeping import sweep


def work_sweep(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> SweepFinding:
    """Drive the sweep; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, SweepStudyOptions)
    to = (options.begin, options.end)
    found = found_by(sweep, study.system, options.parameter, to, options=options.limits, report=report, output=file)
    return SweepFinding(found)


def read_sweep(study: Study, parts: Parts) -> SweepFinding:
    """What has been driven; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, SweepStudyOptions)
    driver = Driver(study.system, options.parameter, (options.begin, options.end), options.limits)
    driver.take(stretches(parts.all(STRETCH), driver))
    return SweepFinding(driver.sweep())
