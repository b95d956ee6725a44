"""The job of a regime map: its parts are chunks of cells, and the result after them."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.orbit.find import initial_state
from gapwalk.results.result_file import Parts
from gapwalk.studies.file import Study
from gapwalk.studies.interruption import found_by
from gapwalk.studies.regimes.call import CELLS, RegimesCall, job_of, stored_regimes
from gapwalk.studies.regimes.finding import RegimeFinding
from gapwalk.studies.regimes.job import RegimeJob
from gapwalk.studies.regimes.mapping import regimes
from gapwalk.studies.regimes.study_options import RegimeStudyOptions
from gapwalk.studies.request import Keeper


def work_regimes(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> RegimeFinding:
    """Make the map; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, RegimeStudyOptions)
    found = found_by(
        regimes,
        study.system,
        dict(zip(options.names, options.within, strict=True)),
        options.resolution,
        start=options.start,
        options=options.limits,
        report=report,
        output=file,
    )
    total = len(_job(study, options).places)
    return RegimeFinding(found, total if found.complete else 0, total)


def read_regimes(study: Study, parts: Parts) -> RegimeFinding:
    """What has been found; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, RegimeStudyOptions)
    job, done = _job(study, options), len(list(parts.all(CELLS)))
    return RegimeFinding(stored_regimes(parts, job), done, len(job.places))


def _job(study: Study, options: RegimeStudyOptions) -> RegimeJob:
    start = tuple(initial_state(study.system, options.start).tolist())
    return job_of(RegimesCall(study.system, options.names, options.within, options.resolution, start, options.limits))
