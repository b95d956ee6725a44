"""Tasks of the process that computes: studies, and work that starts from an orbit (switch, search, locus).

Work that starts from an orbit is stored as a result of an existing kind: a switch and a search as a diagram, a locus as
a map. After Ctrl-C, the results so far are stored. A resumed search keeps its branches; a switch and a locus are
followed again, which takes seconds and gives the same result as without the interruption.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.loci.follow_locus import start_locus, trace_locus, traced_locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.explorer.progress_stream import News, Progress
from gapwalk.results.result_file import lock
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.diagram_study import DiagramStudyOptions, empty_diagram, whole_diagram
from gapwalk.studies.map_study import MapStudyOptions, whole_map
from gapwalk.studies.result import request_file
from gapwalk.studies.runner import run, run_study
from gapwalk.studies.study_file import Study
from gapwalk.studies.study_kind import found_by

FollowUp = Callable[..., bool]
"""Work that starts from an orbit: a function of a study, its result file and a `News`; `resume` is True to continue an
earlier result. It returns True if it was completed, False after Ctrl-C."""


@dataclass(frozen=True)
class Task:
    """One task."""

    study: Study  #: The study; with a follow-up, the study under which its result is stored.
    output: Path  #: The result file.
    follow_up: FollowUp | None = None  #: Work to do in place of the study.
    resume: bool = False  #: True to continue an interrupted run, or to begin it if it has left no result file.


def do(task: Task, report: Callable[[Progress], object]) -> bool:
    """Do a task and report its progress, at most four times a second; return True if it was completed."""
    # Ctrl-C stops it; the results so far are stored. Errors as `gapwalk.run`, `gapwalk.follow`, `gapwalk.find_others`
    # and `gapwalk.follow_locus`.
    news = News(report, task.study.options)
    try:
        if task.follow_up is None:
            return _run(task, news)
        return task.follow_up(task.study, task.output, news, resume=task.resume)
    finally:
        with suppress(OSError):  # the server has ended
            news.close()


def _run(task: Task, news: News) -> bool:
    reports = {"points": news.point, "branches": news.member, "sections and loci": news.chart}
    report = reports.get(task.study.options.reports, news)
    resume = task.resume and task.output.exists()
    return found_by(run, task.study, task.output, resume=resume, report=report).complete


S = TypeVar("S")


def follow_switch(special: SpecialPoint, study: Study, output: Path, news: News, *, resume: bool) -> bool:
    """Follow the branch that begins or crosses at a special point, from there also after an interruption."""
    del resume
    options = study.options
    assert isinstance(options, DiagramStudyOptions)
    within = (options.begin, options.end)
    steps = walk(special, options.parameter, within, walk=options.walk, method=options.method)
    complete = _to_end(steps, lambda point: news.point(point, list(steps.special_points)))
    member = DiagramBranch(f"P{steps.branch.period}-1", steps.branch)
    known = empty_diagram(options.parameter, within)
    tree = Diagram(options.parameter, known.within, (member,), complete=complete)
    with lock(output), request_file(study, output) as file:
        file.write(*whole_diagram(tree, finished=complete))
    return complete


def follow_others(known: tuple[Branch, ...], study: Study, output: Path, news: News, *, resume: bool) -> bool:
    """Search for isolated branches other than the known ones along the parameter, and follow those that are found."""
    # An interrupted search begins again, but after a completed one its branches are kept.
    options = study.options
    assert isinstance(options, DiagramStudyOptions)
    work = options.search_work(study.system, known, news)
    return found_by(run_study, study, output, resume=resume, force=not resume, report=news.member, work=work).complete


def follow_special_point(special: SpecialPoint, study: Study, output: Path, news: News, *, resume: bool) -> bool:
    """Follow a special point in the plane of two parameters, from its beginning also after an interruption."""
    del resume
    options = study.options
    assert isinstance(options, MapStudyOptions)
    first, second = options.parameter, options.second.parameter
    news.locus(special.kind, second)
    beginnings = start_locus(special, first, second, options.within, options.method)
    steps = trace_locus(beginnings, options.walk)
    complete = _to_end(steps, lambda step: news.point(*step))
    chart = Map(first, second, options.within, (traced_locus(steps),), complete=complete)
    with lock(output), request_file(study, output) as file:
        file.write(*whole_map(chart))
    return complete


def _to_end(steps: Iterator[S], report: Callable[[S], None]) -> bool:
    """Take all steps, or those until Ctrl-C, and report each one; return True if they were completed."""
    walked = False
    try:
        for step in steps:
            walked = True
            report(step)
    except KeyboardInterrupt:
        if not walked:
            raise
        return False
    return True
