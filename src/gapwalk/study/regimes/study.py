"""The job of a regime map: its parts are chunks of cells, and the result after them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping

from gapwalk.orbit.find import initial_state
from gapwalk.study.file import Study
from gapwalk.study.interruption import found_by
from gapwalk.study.regimes.finding import RegimeFinding
from gapwalk.study.regimes.job import Plan, RegimeChunk, RegimeJob
from gapwalk.study.regimes.mapping import places_of, regimes
from gapwalk.study.regimes.store import regimes_of
from gapwalk.study.regimes.study_options import RegimeStudyOptions
from gapwalk.study.store.cell_store import parted


def work_regimes(
    study: Study, shelf: os.PathLike[str] | None, report: Callable[..., object] | None = None
) -> RegimeFinding:
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
        output=shelf,
    )
    total = len(_job(study, options).places)
    return RegimeFinding(found, total if found.complete else 0, total)


def read_regimes(study: Study, parts: Mapping[int, bytes]) -> RegimeFinding:
    """What has been found; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, RegimeStudyOptions)
    job = _job(study, options)
    done, result = parted("the result", parts, len(job.places))
    if result is None:
        job.take([RegimeChunk.of(number, arrays) for number, arrays in done.items()])
        return RegimeFinding(job.record(), len(done), len(job.places))
    found = regimes_of(study.system, options.names, options.within, result)
    if found.resolution != options.resolution:
        raise ValueError(f"its resolution is {found.resolution}")
    return RegimeFinding(found, len(done), len(job.places))


def _job(study: Study, options: RegimeStudyOptions) -> RegimeJob:
    start, judging = initial_state(study.system, options.start), options.limits.judging
    plan = Plan(study.system, options.names, options.within, options.resolution, start, judging)
    return RegimeJob(plan, places_of(plan, options.carry))
