"""A job as the process that does it sees it: a study, or branches to switch to, and the result file to write."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gapwalk.bifurcation import switch, walk_out
from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.continuation.branch import SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.study.diagram.store import DiagramStore
from gapwalk.study.file import Study
from gapwalk.study.options import BranchOptions
from gapwalk.study.run import run
from gapwalk.study.store.database import lock
from gapwalk.study.store.result_file import ResultFile
from gapwalk.study.store.versions import versions

SECONDS = 0.25
"""Between two reports of progress: a page that is told more often only works more."""


@dataclass(frozen=True)
class Task:
    """What is to be done.

    Parameters
    ----------
    study
        The study; of a switch, a diagram whose branches are those that begin at the special point.
    output
        The result file.
    special
        The special point to switch at, if any.
    resume
        Whether to go on with the result file of an interrupted run.
    """

    study: Study
    output: Path
    special: SpecialPoint | None = None
    resume: bool = False


@dataclass
class Progress:
    """What is new since the last report.

    Attributes
    ----------
    points, special_points
        Of the branch that is being walked.
    limbs
        Branches that were finished.
    done, total
        Parts of a job that has no branches.
    """

    points: list[BranchPoint] = field(default_factory=list)
    special_points: list[SpecialPoint] = field(default_factory=list)
    limbs: list[Limb] = field(default_factory=list)
    done: int = 0
    total: int = 0


def do(task: Task, tell: Callable[[Progress], object]) -> bool:
    """Do a task, and tell what is new, four times a second at most; whether it was done to its end.

    Ctrl-C stops it with what there is stored. Errors as `gapwalk.run` and `gapwalk.switch`.
    """
    news = _News(tell)
    try:
        complete = _run(task, news) if task.special is None else _switch(task, task.special, news)
    finally:
        with suppress(OSError):  # nobody listens any more
            news.tell()
    return complete


class _News:
    """Gathers what is new."""

    def __init__(self, tell: Callable[[Progress], object]) -> None:
        self._tell, self._progress, self._told = tell, Progress(), 0.0

    def point(self, point: BranchPoint, special_points: list[SpecialPoint]) -> None:
        self._progress.points.append(point)
        self._progress.special_points += special_points
        self._now_and_then()

    def limb(self, diagram: Diagram, limb: Limb) -> None:
        self._progress.limbs.append(limb)
        self._now_and_then()

    def part(self, *about: Any) -> None:
        pace = about[-1]
        self._progress.done, self._progress.total = getattr(pace, "done", 0), getattr(pace, "total", 0)
        self._now_and_then()

    def tell(self) -> None:
        progress, self._progress, self._told = self._progress, Progress(), time.monotonic()
        self._tell(progress)

    def _now_and_then(self) -> None:
        if time.monotonic() - self._told >= SECONDS:
            self.tell()


def _run(task: Task, news: _News) -> bool:
    reports = {"response": news.point, "diagram": news.limb}
    report = reports.get(task.study.options.kind, news.part)
    return run(task.study, task.output, resume=task.resume and task.output.exists(), report=report).complete


def _switch(task: Task, special: SpecialPoint, news: _News) -> bool:
    """Walk the branches that leave a special point, and store them as a diagram of their own."""
    options = task.study.options
    assert isinstance(options, BranchOptions)
    departures = switch(special, options.parameter, (options.begin, options.end), options.method)
    # of two directions, the points of the first come in reverse
    branch = walk_out(departures, options.walk, news.point if len(departures) == 1 else None)
    limb = Limb(f"P{branch.period}-1", branch)
    within = (min(options.begin, options.end), max(options.begin, options.end))
    tree = Diagram(options.parameter, within, (limb,), complete=True)
    with lock(task.output), ResultFile(task.output, task.study, versions(), exists=False) as file:
        store = DiagramStore(file)
        store.add(tree, limb)
        store.finish(tree, finished=True)
    return True
