"""Lines on stderr that show how far a run has come."""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from contextlib import suppress
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn, TimeElapsedColumn

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.bifurcation.locus import Locus
from gapwalk.cli.console import console
from gapwalk.cli.outcome import printable
from gapwalk.continuation.point import BranchPoint
from gapwalk.plot.words import parameter_symbol
from gapwalk.study.jobs import JOBS
from gapwalk.study.map import Map, Section
from gapwalk.study.options import BranchOptions, DiagramStudyOptions, MapStudyOptions, StudyOptions
from gapwalk.study.work.pace import Pace


def progress_of(
    options: StudyOptions, title: str = "", *, show: bool = True
) -> BranchProgress | DiagramProgress | MapProgress | JobProgress:
    """The progress of a study of these options; `title` is what to call it."""
    if options.kind in JOBS:
        return JobProgress(options, title, show=show)
    if isinstance(options, DiagramStudyOptions):
        return DiagramProgress(title, show=show)
    if isinstance(options, MapStudyOptions):
        return MapProgress(options, title, show=show)
    assert isinstance(options, BranchOptions)
    return BranchProgress(options, title, show=show)


_FIRST, _AGAIN = 10.0, 30.0  # seconds until a line is written where there is no terminal, and between two such lines


class _Line:
    """One line, with a time, that vanishes at the end; nothing where `show` is false.

    Where stderr is no terminal, as in a log, a line is written now and then, whether anything is new or not.
    """

    def __init__(self, description: str, columns: list[ProgressColumn], total: float | None, *, show: bool) -> None:
        screen = console(stderr=True)
        self._log = _Log(description) if show and not screen.is_terminal else None
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            *columns,
            TextColumn("{task.fields[reached]}"),
            TimeElapsedColumn(),
            console=screen,
            transient=True,
            disable=not (show and screen.is_terminal),
        )
        self._task = self._progress.add_task(description, total=total, reached="")

    def update(
        self, description: str, reached: str, completed: float | None = None, total: float | None = None
    ) -> None:
        if self._log is not None:
            self._log.words = f"{description}  {reached}"
        self._progress.update(self._task, description=description, completed=completed, total=total, reached=reached)

    def __enter__(self) -> None:
        self._progress.start()
        if self._log is not None:
            self._log.start()

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
        if self._log is not None:
            self._log.stop()


class _Log:
    """Writes now and then how far a long job has come.

    Parameters
    ----------
    words
        How far it has come at its beginning.
    """

    def __init__(self, words: str) -> None:
        self.words = words
        self._begun = time.monotonic()
        self._done = threading.Event()
        self._writer = threading.Thread(target=self._write, name="gapwalk progress", daemon=True)

    def start(self) -> None:
        """Write from now on."""
        self._begun = time.monotonic()
        self._writer.start()

    def stop(self) -> None:
        """Write no more."""
        self._done.set()
        self._writer.join()

    def _write(self) -> None:
        pause = _FIRST
        while not self._done.wait(pause):
            pause = _AGAIN
            with suppress(OSError, ValueError):  # nobody reads it
                print(f"{self.words.strip()}  {time.monotonic() - self._begun:.0f} s", file=sys.stderr, flush=True)


class StudyProgress:
    """How far a study has come; subclasses have the line, and are called with what is new."""

    _line: _Line

    def __enter__(self) -> Self:
        self._line.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._line.__exit__()


class BranchProgress(StudyProgress):
    """How far a walk has come.

    Parameters
    ----------
    options
        The study.
    title
        What to call it.
    show
        Whether to show anything.
    """

    def __init__(self, options: BranchOptions, title: str = "", *, show: bool = True) -> None:
        self._options, self._points = options, 0
        self._found: Counter[Kind] = Counter()
        self._name = printable(title)
        total = abs(options.end - options.begin)
        self._line = _Line(f"{self._name} first orbit".strip(), [BarColumn(bar_width=24)], total, show=show)

    def __call__(self, point: BranchPoint, special_points: list[SpecialPoint]) -> None:
        """Show a new point."""
        self._points += 1
        self._found.update(special.kind for special in special_points)
        found = sum(count for kind, count in self._found.items() if kind is not Kind.GRAZING)
        symbol = parameter_symbol(self._options.parameter)
        self._line.update(
            f"{self._name} walking".strip(),
            f"{symbol} = {point.value:.6f}  {self._points} points  {found} special",
            abs(point.value - self._options.begin),
        )


class DiagramProgress(StudyProgress):
    """How many branches a diagram has; parameters as `BranchProgress`."""

    def __init__(self, title: str = "", *, show: bool = True) -> None:
        self._name = printable(title)
        self._points, self._special = 0, 0
        self._line = _Line(f"{self._name} first branch".strip(), [], None, show=show)

    def __call__(self, diagram: Diagram, limb: Limb) -> None:
        """Show a new branch."""
        self._points += len(limb.branch.points)
        self._special += sum(special.kind is not Kind.GRAZING for special in limb.branch.special_points)
        counts = f"branches {len(diagram.limbs)}  points {self._points}  special {self._special}"
        self._line.update(self._name or "diagram", f"{counts}  last {limb.name}")


class MapProgress(StudyProgress):
    """How many sections and loci a map has; parameters as `BranchProgress`."""

    def __init__(self, options: MapStudyOptions, title: str = "", *, show: bool = True) -> None:
        self._name = printable(title)
        self._sections = len(options.limits.values(*options.within[1]))
        self._line = _Line(f"{self._name} first section".strip(), [], None, show=show)

    def __call__(self, chart: Map, addition: Section | Locus) -> None:
        """Show a new section or locus."""
        points = sum(len(locus.points) for locus in chart.loci)
        last = f"  last {chart.names[-1]}" if chart.loci else ""
        sections = f"sections {len(chart.sections)} of {self._sections}"
        self._line.update(self._name or "map", f"{sections}  loci {len(chart.loci)}  points {points}{last}")


class JobProgress(StudyProgress):
    """How many parts of a job are done, and how long the others may take; parameters as `BranchProgress`."""

    def __init__(self, options: StudyOptions, title: str = "", *, show: bool = True) -> None:
        self._name = printable(title) or options.kind
        self._line = _Line(self._name, [BarColumn(bar_width=24)], None, show=show)

    def __call__(self, part: object, pace: Pace) -> None:
        """Show that a part is done."""
        left = "" if pace.left is None else f"  about {pace.left:.0f} s left"
        self._line.update(self._name, f"{pace.done} of {pace.total}{left}", pace.done, pace.total)


class VerifyProgress(StudyProgress):
    """How much has been verified; parameters as `BranchProgress`."""

    def __init__(self, title: str, *, show: bool = True) -> None:
        self._line = _Line(printable(title), [BarColumn(bar_width=24)], None, show=show)

    def __call__(self, what: str, done: int, total: int) -> None:
        """Show how many of some pieces are done."""
        self._line.update(f"verifying {what}", f"{done} of {total}", done, total)


class CountProgress(StudyProgress):
    """How many of some things are done; parameters as `BranchProgress`, and how many there are."""

    def __init__(self, title: str, total: int, *, show: bool = True) -> None:
        self._name = title
        self._line = _Line(title, [BarColumn(bar_width=24)], total, show=show)

    def __call__(self, last: str, done: int, total: int) -> None:
        """Show that one more is done."""
        self._line.update(self._name, f"{done} of {total}  last {printable(last)}", done, total)
