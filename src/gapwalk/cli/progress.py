"""Progress of a run, as lines on stderr."""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn, TimeElapsedColumn

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.loci import Locus
from gapwalk.cli.output import console, printable
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.model.words import parameter_symbol
from gapwalk.parallel.work_chunks import Pace
from gapwalk.studies.kind import StudyKind
from gapwalk.studies.map import Map, MapSection
from gapwalk.studies.map_study import MapStudyOptions
from gapwalk.studies.options import BranchOptions


def progress_of(
    options: StudyKind, title: str = "", *, show: bool = True
) -> BranchProgress | DiagramProgress | MapProgress | JobProgress:
    """Create the progress display of a study with these options; `title` is its name."""
    return _PROGRESS[options.reports](options, title, show=show)


_FIRST, _AGAIN = 10.0, 30.0  # without a terminal: seconds until the first line, and between the following lines


class _Line:
    """One line with the elapsed time, removed at the end; nothing is shown if `show` is false.

    If stderr is not a terminal (a log, say), a line is written at regular intervals, even without any change.
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
    """Writes the progress of a long job at regular intervals.

    Parameters
    ----------
    words
        The progress at the beginning.
    """

    def __init__(self, words: str) -> None:
        self.words = words
        self._begun = time.monotonic()
        self._done = threading.Event()
        self._writer = threading.Thread(target=self._write, name="gapwalk progress", daemon=True)

    def start(self) -> None:
        """Start writing."""
        self._begun = time.monotonic()
        self._writer.start()

    def stop(self) -> None:
        """Stop writing."""
        self._done.set()
        self._writer.join()

    def _write(self) -> None:
        pause = _FIRST
        while not self._done.wait(pause):
            pause = _AGAIN
            with suppress(OSError, ValueError):  # nobody reads it
                print(f"{self.words.strip()}  {time.monotonic() - self._begun:.0f} s", file=sys.stderr, flush=True)


class StudyProgress:
    """The progress of a study; subclasses own the line, and are called with each new part."""

    _line: _Line

    def __enter__(self) -> Self:
        self._line.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._line.__exit__()


class BranchProgress(StudyProgress):
    """The progress along a branch.

    Parameters
    ----------
    options
        The study.
    title
        The name to show.
    show
        False to show nothing.
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
    """The number of branches of a diagram so far; parameters as in `BranchProgress`."""

    def __init__(self, options: StudyKind, title: str = "", *, show: bool = True) -> None:
        self._name = printable(title) or options.kind
        self._points, self._special = 0, 0
        self._line = _Line(f"{printable(title)} first branch".strip(), [], None, show=show)

    def __call__(self, diagram: Diagram, member: DiagramBranch) -> None:
        """Show a new branch."""
        self._points += len(member.branch.points)
        self._special += sum(special.kind is not Kind.GRAZING for special in member.branch.special_points)
        counts = f"branches {len(diagram.members)}  points {self._points}  special {self._special}"
        self._line.update(self._name, f"{counts}  last {member.name}")


class MapProgress(StudyProgress):
    """The number of sections and loci of a map so far; parameters as in `BranchProgress`."""

    def __init__(self, options: MapStudyOptions, title: str = "", *, show: bool = True) -> None:
        self._name = printable(title)
        self._sections = len(options.limits.values(*options.within[1]))
        self._line = _Line(f"{self._name} first section".strip(), [], None, show=show)

    def __call__(self, chart: Map, addition: MapSection | Locus) -> None:
        """Show a new section or locus."""
        points = sum(len(locus.points) for locus in chart.loci)
        last = f"  last {chart.names[-1]}" if chart.loci else ""
        sections = f"sections {len(chart.sections)} of {self._sections}"
        self._line.update(self._name or "map", f"{sections}  loci {len(chart.loci)}  points {points}{last}")


class JobProgress(StudyProgress):
    """The number of finished parts of a job, and the estimated time left; parameters as in `BranchProgress`."""

    def __init__(self, options: StudyKind, title: str = "", *, show: bool = True) -> None:
        self._name = printable(title) or options.kind
        self._line = _Line(self._name, [BarColumn(bar_width=24)], None, show=show)

    def __call__(self, part: object, pace: Pace) -> None:
        """Show that one more part is done."""
        left = "" if pace.left is None else f"  about {pace.left:.0f} s left"
        self._line.update(self._name, f"{pace.done} of {pace.total}{left}", pace.done, pace.total)


_PROGRESS: dict[str, Callable[..., BranchProgress | DiagramProgress | MapProgress | JobProgress]] = {
    "points": BranchProgress,
    "branches": DiagramProgress,
    "sections and loci": MapProgress,
    "parts": JobProgress,
}
"""Progress displays, by what a study reports."""


class VerifyProgress(StudyProgress):
    """The progress of a verification; parameters as in `BranchProgress`."""

    def __init__(self, title: str, *, show: bool = True) -> None:
        self._line = _Line(printable(title), [BarColumn(bar_width=24)], None, show=show)

    def __call__(self, what: str, done: int, total: int) -> None:
        """Show the number of checked items of one kind."""
        self._line.update(f"verifying {what}", f"{done} of {total}", done, total)


class CountProgress(StudyProgress):
    """The number of finished items of a known total; other parameters as in `BranchProgress`."""

    def __init__(self, title: str, total: int, *, show: bool = True) -> None:
        self._name = title
        self._line = _Line(title, [BarColumn(bar_width=24)], total, show=show)

    def __call__(self, last: str, done: int, total: int) -> None:
        """Show that one more item is done."""
        self._line.update(self._name, f"{done} of {total}  last {printable(last)}", done, total)
