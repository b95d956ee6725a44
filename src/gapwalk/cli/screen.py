"""What is printed for people: progress while a branch is walked, and tables of what was found."""

from __future__ import annotations

import sys
from collections import Counter
from types import TracebackType

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from gapwalk.cli.outcome import printable
from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.plot.words import full_measure, parameter_symbol
from gapwalk.study.options import ResponseOptions
from gapwalk.study.result import Result

_WIDTH = 120  # of what is written to a file or a pipe


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Let the command end as it does when anything else is printed to a reader that has gone."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """Where to print; texts are printed as they are, without markup."""
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _WIDTH
    return _Screen(stderr=stderr, markup=False, emoji=False, highlight=False, width=width)


class WalkProgress:
    """A line on stderr that shows how far a walk has come; nothing where stderr is no terminal.

    Parameters
    ----------
    options
        The study.
    title
        What to call it.
    show
        Whether to show anything.
    """

    def __init__(self, options: ResponseOptions, title: str = "", *, show: bool = True) -> None:
        self._options, self._points = options, 0
        self._found: Counter[Kind] = Counter()
        screen = console(stderr=True)
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[reached]}"),
            TimeElapsedColumn(),
            console=screen,
            transient=True,
            disable=not (show and screen.is_terminal),
        )
        self._name = printable(title)
        self._task = self._progress.add_task(
            f"{self._name} first orbit".strip(), total=abs(options.end - options.begin), reached=""
        )

    def __call__(self, point: BranchPoint, special_points: list[SpecialPoint]) -> None:
        """Show a new point."""
        self._points += 1
        self._found.update(special.kind for special in special_points)
        found = sum(count for kind, count in self._found.items() if kind is not Kind.GRAZING)
        symbol = parameter_symbol(self._options.parameter)
        self._progress.update(
            self._task,
            description=f"{self._name} walking".strip(),
            completed=abs(point.value - self._options.begin),
            reached=f"{symbol} = {point.value:.6f}  {self._points} points  {found} special",
        )

    def __enter__(self) -> WalkProgress:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()


def print_result(screen: Console, result: Result) -> None:
    """Print the branches with their ends, and the table of special points."""
    for number, branch in enumerate(result.branches, start=1):
        name = f"branch {number}: " if len(result.branches) > 1 else ""
        screen.print(f"{name}{_sentence(branch)}", soft_wrap=True)
        symbol = parameter_symbol(branch.parameter)
        for end in branch.ends:
            detail = f" ({end.detail})" if end.detail else ""
            screen.print(f"  {symbol} = {end.value:.10g}: {end.reason.value}{printable(detail)}", soft_wrap=True)
    if any(branch.special_points for branch in result.branches):
        screen.print(special_point_table(result))
    else:
        screen.print("no special points")


def special_point_table(result: Result) -> Table:
    """The table of special points."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    coordinate = full_measure(result.options.measure, result.system.coordinates).partition(".")[2]
    coordinate = coordinate if coordinate in result.system.coordinates else result.system.coordinates[0]
    many = len(result.branches) > 1
    for heading in ["branch"] * many + ["kind"]:
        table.add_column(heading)
    table.add_column(parameter_symbol(result.options.parameter), justify="right")
    table.add_column(f"half {coordinate}", justify="right")
    table.add_column("multiplier", justify="right")
    table.add_column("stability")
    table.add_column("nature or contact")
    for number, branch in enumerate(result.branches, start=1):
        for special in branch.special_points:
            table.add_row(
                *[str(number)] * many,
                special.kind.value,
                f"{special.value:#.10g}",
                f"{special.point.measure(f'half.{coordinate}'):#.8g}",
                multiplier_text(special.multiplier),
                special.change,
                printable(special.nature or special.contact),
            )
    return table


def multiplier_text(multiplier: complex) -> str:
    """A multiplier with six digits; a complex one stands for its pair."""
    if np.isnan(multiplier):
        return ""
    if abs(multiplier.imag) <= 1e-9 * abs(multiplier):
        return f"{multiplier.real:+.6f}"
    return f"{multiplier.real:+.6f} ± {abs(multiplier.imag):.6f}i"


def _sentence(branch: Branch) -> str:
    stable = sum(point.stable for point in branch.points)
    values = branch.values
    counts = [f"{len(branch.special(kind))} {kind.value}" for kind in Kind if branch.special(kind)]
    found = ", ".join(counts) or "no special points"
    return (
        f"period-{branch.period} motions over {parameter_symbol(branch.parameter)} from {values[0]:.10g} to "
        f"{values[-1]:.10g}: {len(branch.points)} points, {stable} of them stable; {found}"
    )
