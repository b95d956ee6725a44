"""The job of a regime map: its parts are chunks of cells, and the result after them."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.orbit.find import initial_state
from gapwalk.results.file import Parts
from gapwalk.study.file import Study
from gapwalk.study.interruption import found_by
from gapwalk.study.regimes.call import CELLS, RegimesCall, job_of, stored_regimes
from gapwalk.study.regimes.finding import RegimeFinding
from gapwalk.study.regimes.job import RegimeJob
from gapwalk.study.regimes.mapping import regimes
from gapwalk.study.regimes.study_options import RegimeStudyOptions
from gapwalk.study.request import Keeper


def work_regimes(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> RegimeFinding:
    """Make the map; see `gapwalk.study.jobs.Job`."""
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
    """What has been found; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, RegimeStudyOptions)
    job, done = _job(study, options), len(list(parts.all(CELLS)))
    return RegimeFinding(stored_regimes(parts, job), done, len(job.places))


def _job(study: Study, options: RegimeStudyOptions) -> RegimeJob:
    start = tuple(initial_state(study.system, options.start).tolist())
    return job_of(RegimesCall(study.system, options.names, options.within, options.resolution, start, options.limits))
