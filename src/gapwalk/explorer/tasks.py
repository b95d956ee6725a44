"""Tasks of the process that computes: studies, and work that starts from an orbit (switch, search, locus).

Work that starts from an orbit is stored as a result of an existing kind: a switch and a search as a diagram, a locus as
a map. After Ctrl-C, what was found is stored. A resumed search keeps its branches; a switch and a locus are followed
again, which takes seconds and gives the same result as without the interruption.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.loci.follow_locus import trace_locus, traced_locus
from gapwalk.bifurcation.loci.locus_start import start_locus
from gapwalk.explorer.events import News, Progress
from gapwalk.results.result_file import lock
from gapwalk.studies.diagram_study import DiagramStudyOptions, OthersWork, whole_diagram
from gapwalk.studies.kind import found_by
from gapwalk.studies.map import Map
from gapwalk.studies.map_study import MapStudyOptions, whole_map
from gapwalk.studies.request import request_file
from gapwalk.studies.runner import run, run_study
from gapwalk.studies.study_file import Study
from gapwalk.studies.whole_diagram import empty_diagram


class FollowUp(Protocol):
    """Work that starts from an orbit and is not a study of a model file; see `gapwalk.explorer.tasks`."""

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Do the work and write the result file; return True if it was completed, False after Ctrl-C."""
        ...


@dataclass(frozen=True)
class Task:
    """One task.

    Parameters
    ----------
    study
        The study; with a follow-up, the study under which its result is stored.
    output
        The result file.
    follow_up
        Work to do in place of the study.
    resume
        True to continue an interrupted run, or to begin it if it has left no result file.
    """

    study: Study
    output: Path
    follow_up: FollowUp | None = None
    resume: bool = False


def do(task: Task, report: Callable[[Progress], object]) -> bool:
    """Do a task and report its progress, at most four times a second; return True if it was completed.

    Ctrl-C stops it; what has been found is stored. Errors as `gapwalk.run`, `gapwalk.follow`, `gapwalk.find_others` and
    `gapwalk.follow_locus`.
    """
    news = News(report)
    try:
        if task.follow_up is None:
            return _run(task, news)
        return task.follow_up.do(task.study, task.output, news, resume=task.resume)
    finally:
        with suppress(OSError):  # the server has ended
            news.report()


def _run(task: Task, news: News) -> bool:
    reports = {"points": news.point, "branches": news.member, "sections and loci": news.chart, "parts": news.part}
    report = reports[task.study.options.reports]
    resume = task.resume and task.output.exists()
    return found_by(run, task.study, task.output, resume=resume, report=report).complete


S = TypeVar("S")


@dataclass(frozen=True)
class SwitchFollowUp:
    """Follow the branch that begins or crosses at a special point.

    Parameters
    ----------
    special
        The special point.
    """

    special: SpecialPoint

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Follow the branch from the special point, also after an interruption."""
        del resume
        options = study.options
        assert isinstance(options, DiagramStudyOptions)
        within = (options.begin, options.end)
        steps = walk(self.special, options.parameter, within, walk=options.walk, method=options.method)
        complete = _to_end(steps, lambda point: news.point(point, list(steps.special_points)))
        member = DiagramBranch(f"P{steps.branch.period}-1", steps.branch)
        known = empty_diagram(options.parameter, within)
        tree = Diagram(options.parameter, known.within, (member,), complete=complete)
        with lock(output), request_file(study, output) as file:
            file.write(*whole_diagram(tree, finished=complete))
        return complete


@dataclass(frozen=True)
class SearchFollowUp:
    """Search for isolated branches, and follow those that are found.

    Parameters
    ----------
    known
        The known branches along the parameter.
    """

    known: tuple[Branch, ...]

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Search and follow; an interrupted search begins again, but after a completed one its branches are kept."""
        options = study.options
        assert isinstance(options, DiagramStudyOptions)
        work = OthersWork(study.system, options, self.known, news.part)
        found = found_by(run_study, study, output, resume=resume, force=not resume, report=news.member, work=work)
        return found.complete


@dataclass(frozen=True)
class LocusFollowUp:
    """Follow a special point in the plane of two parameters.

    Parameters
    ----------
    special
        The special point.
    """

    special: SpecialPoint

    def do(self, study: Study, output: Path, news: News, *, resume: bool) -> bool:
        """Follow the locus from the special point, also after an interruption."""
        del resume
        options = study.options
        assert isinstance(options, MapStudyOptions)
        first, second = options.parameter, options.second.parameter
        news.locus(self.special.kind, second)
        beginnings = start_locus(self.special, first, second, options.within, options.method)
        steps = trace_locus(beginnings, options.walk)
        complete = _to_end(steps, lambda step: news.point(*step))
        locus = traced_locus(steps)
        chart = Map(first, second, options.within, (locus,), complete=complete)
        with lock(output), request_file(study, output) as file:
            file.write(*whole_map(chart))
        return complete


def _to_end(steps: Iterator[S], report: Callable[[S], None]) -> bool:
    """Take all steps, or those until Ctrl-C, and report each one; return True if they were completed.

    Raises
    ------
    KeyboardInterrupt
        After Ctrl-C before the first step.
    """
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
