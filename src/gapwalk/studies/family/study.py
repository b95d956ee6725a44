"""The job of a family: its parts are the members, then what becomes of special points between them."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.results.result_file import Parts
from gapwalk.studies.family.call import stored_parts
from gapwalk.studies.family.family import family
from gapwalk.studies.family.finding import FamilyFinding
from gapwalk.studies.family.job import FamilyJob, Walk
from gapwalk.studies.family.record import Family
from gapwalk.studies.family.study_options import FamilyStudyOptions
from gapwalk.studies.file import Study
from gapwalk.studies.interruption import found_by
from gapwalk.studies.request import Keeper


def work_family(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> FamilyFinding:
    """Walk the members and join their special points; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, FamilyStudyOptions)
    found = found_by(
        family,
        study.system,
        options.parameter,
        (options.begin, options.end),
        options.over,
        start=options.start,
        period=options.period,
        options=options.limits,
        walk=options.walk,
        method=options.method,
        report=report,
        output=file,
    )
    return FamilyFinding(options, found)


def read_family(study: Study, parts: Parts) -> FamilyFinding:
    """What has been found; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, FamilyStudyOptions)
    low, high = sorted((options.begin, options.end))
    how = Walk(options.begin, options.end, options.start, options.period, options.walk, options.method)
    job = FamilyJob(Family(study.system, options.parameter, (low, high), options.over), how, options.limits)
    job.take(*stored_parts(parts.all, job))
    return FamilyFinding(options, job.family)
