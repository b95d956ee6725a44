"""Progress of a run, as one line on stderr."""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Self

from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.loci import Locus
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.cli import output
from gapwalk.cli.output import console
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.model.words import parameter_symbol
from gapwalk.parallel.workers import Pace, duration
from gapwalk.studies.bifurcation_map import Map, MapSection
from gapwalk.studies.study_kind import StudyKind
from gapwalk.summary import printable

_NEARLY = 1.0 - 1e-9
_FIRST, _AGAIN = 1.0, 10.0  # without a terminal: seconds until the first line, and between the following lines

Words = Callable[..., tuple[Any, ...]]
"""Function that returns the arguments of `ProgressLine.update` for what is reported."""


class ProgressLine:
    """One line with the elapsed time, removed at the end; it is called with each report.

    If stderr is not a terminal (a log, say), a line is written at regular intervals, even without any change.
    """

    def __init__(
        self, first: str, words: Words, *, bar: bool = True, total: float | None = None, show: bool = True
    ) -> None:
        screen, show = console(stderr=True), show and not output.is_quiet
        self._words, self._text = words, (first, "")
        self.begin: Callable[[Pace, Callable[[], float]], None] | None = None  # of a job: called before its first part
        self._is_logged = show and not screen.is_terminal
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}", table_column=Column(no_wrap=True)),
            *([BarColumn(bar_width=12, table_column=Column(no_wrap=True, min_width=12))] if bar else []),
            TextColumn("{task.fields[reached]}", table_column=Column()),  # in two lines rather than cut
            TimeElapsedColumn(table_column=Column(no_wrap=True, min_width=7)),
            console=screen,
            transient=True,
            disable=not (show and screen.is_terminal),
        )
        self._task = self._progress.add_task(first, total=total, reached="")
        self._done = threading.Event()
        self._writer = threading.Thread(target=self._write, name="gapwalk progress", daemon=True)

    def __call__(self, *news: Any) -> None:
        """Show one report."""
        self.update(*self._words(*news))

    def update(
        self, description: str, reached: object, completed: float | None = None, total: float | None = None
    ) -> None:
        """Show a description, and the progress in words and as a number out of a total."""
        self._text = description, reached
        self._progress.update(self._task, description=description, completed=completed, total=total, reached=reached)

    def complete(self, share: float) -> None:
        """Draw the bar up to a share."""
        self._progress.update(self._task, completed=min(share, _NEARLY))  # the clock of a full bar stands still

    def __enter__(self) -> Self:
        self._progress.start()
        if self._is_logged:
            self._writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
        if self._is_logged:
            self._done.set()
            self._writer.join()

    def _write(self) -> None:
        begun, pause = time.monotonic(), _FIRST
        while not self._done.wait(pause):
            pause = _AGAIN
            with suppress(OSError, ValueError):  # nobody reads it
                text = "  ".join(map(str, self._text)).strip()
                print(f"{text}  {time.monotonic() - begun:.0f} s", file=sys.stderr, flush=True)


def progress_of(options: Any, title: str = "", *, show: bool = True) -> ProgressLine:
    """Return the line for a study with these options; `title` is its name."""
    return _LINES[options.reports](options, printable(title), show)


def _branch_line(options: Any, title: str, show: bool) -> ProgressLine:
    symbol, special, most = parameter_symbol(options.parameter), 0, 0.0

    def words(point: BranchPoint, special_points: list[SpecialPoint]) -> tuple[str, _Reached]:
        nonlocal most, special
        special += sum(each.kind is not Kind.GRAZING for each in special_points)
        most = max(most, min((point.value - options.begin) / (options.end - options.begin), 1.0))
        reached.place = f"{symbol} = {point.value:.7g}  {special} special  "
        return f"{title} walking".strip(), reached

    line = ProgressLine(f"{title} first orbit".strip(), words, total=1.0, show=show)
    line.begin, reached = lambda *_: reached.begin(Pace(0, 1, most), lambda: most), _Reached(line, "")
    return line


def _diagram_line(options: StudyKind, title: str, show: bool) -> ProgressLine:
    count = Counter[str]()

    def words(diagram: Diagram, member: DiagramBranch) -> tuple[str, str]:
        count["points"] += len(member.branch.points)
        count["special"] += sum(special.kind is not Kind.GRAZING for special in member.branch.special_points)
        counts = f"branches {len(diagram.members)}  points {count['points']}  special {count['special']}"
        return title or options.kind, f"{counts}  last {member.name}"

    return ProgressLine(f"{title} first branch".strip(), words, bar=False, show=show)


def _map_line(options: Any, title: str, show: bool) -> ProgressLine:
    total = len(options.values(*options.within[1]))

    def words(chart: Map, addition: MapSection | Locus) -> tuple[str, str]:
        points = sum(len(locus.points) for locus in chart.loci)
        last = f"  last {chart.names[-1]}" if chart.loci else ""
        return (
            title or "map",
            f"sections {len(chart.sections)} of {total}  loci {len(chart.loci)}  points {points}{last}",
        )

    return ProgressLine(f"{title} first section".strip(), words, bar=False, show=show)


class _Reached:
    """The share of a job that is done, by its parts and by what those in progress tell, and the time left.

    Where they tell nothing, no time is shown once the time that was expected has passed.
    """

    def __init__(self, line: ProgressLine, plan: str) -> None:
        self._line, self._plan, self._pace, self._within = line, plan, Pace(0, 0), float
        self.place = self.best = ""
        self._begun = self._most = self._since = self._left = 0.0

    def begin(self, pace: Pace, within: Callable[[], float]) -> None:
        """Note what is done before this run, and where the shares of parts in progress are read."""
        self._begun, self._within = time.monotonic(), within
        self.note(pace)

    def note(self, pace: Pace) -> None:
        """Note the progress after a part."""
        self._pace = pace

    def __str__(self) -> str:
        now, within = time.monotonic(), self._within()
        pace = replace(self._pace, within=within, seconds=now - self._begun) if within else self._pace
        if pace.share > self._most:  # while nothing more is done, the time that was expected passes
            self._most, self._since, self._left = pace.share, now, pace.left or 0.0
        self._line.complete(self._most)
        left = self._left - (now - self._since)
        if not self._most:
            return self.place or (f"{self._plan}  0 %" if self._begun else self._plan)
        if pace.done == pace.total:
            told = f": {100 * min(within, 1.0):.0f} %" if within else ""
            return f"{pace.total} of {pace.total}  100 %  the result is put together and checked{told}"
        parts, digits = f"{pace.done} of {pace.total}  " * (pace.total > 1), int(self._most < 0.01)
        told = f"{self.place or parts}{100 * self._most:.{digits}f} %"
        told += f"  about {duration(left)} left" * (left >= 0.5 and (self._most >= 0.01 or now - self._begun > _AGAIN))
        return f"{told}  {self.best}".rstrip()


def _job_line(options: StudyKind, title: str, show: bool) -> ProgressLine:
    name = title or options.kind

    def words(part: object, pace: Pace) -> tuple[str, _Reached]:
        parts.append(part)
        reached.best = options.words_so_far(parts, pace.total)
        reached.note(pace)
        return name, reached

    def begin(pace: Pace, within: Callable[[], float]) -> None:
        reached.begin(pace, within)
        line.update(name, reached)

    parts = list[object]()
    line = ProgressLine(name, words, total=1.0, show=show)
    plan = options.plan if title else options.plan.removeprefix(f"{name} ")
    line.begin, reached = begin, _Reached(line, plan)
    line.update(name, plan)
    return line


def _family_line(options: StudyKind, title: str, show: bool) -> ProgressLine:
    """Return a line without an end: how many branches and families there are is known only at the end."""

    def words(part: object, pace: Pace) -> tuple[str, str]:
        return title or options.kind, f"{pace.done} branches and families of tori"

    return ProgressLine(f"{title} first branch".strip(), words, bar=False, show=show)


_LINES = {
    "points": _branch_line,
    "branches": _diagram_line,
    "sections and loci": _map_line,
    "branches and families": _family_line,
    "parts": _job_line,
}
"""Lines of progress, by what a study reports."""


def verify_line(title: str) -> ProgressLine:
    """Return the line for a verification, which reports the number of checked items of one kind."""
    return ProgressLine(
        printable(title), lambda what, done, total: (f"verifying {what}", f"{done} of {total}", done, total)
    )
