"""Results in the terminal: branches with their ends, and the table of special points."""

from __future__ import annotations

import math

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.cli.outcome import printable
from gapwalk.cli.print_diagram import print_diagram
from gapwalk.cli.print_map import print_map
from gapwalk.plot.words import full_measure, parameter_symbol, signal_words
from gapwalk.studies.result import Result


def print_result(screen: Console, result: Result, *, points: bool = True) -> None:
    """Print the branches with their ends, and the table of special points; for a diagram or map only if requested.

    The results of studies without branches are printed in the form of their kind.
    """
    if result.study.reduced is not None:
        screen.print(result.study.reduced.words, soft_wrap=True)
    for check in result.checks:
        screen.print(printable(check.words), soft_wrap=True)
    if result.verification is not None:
        screen.print(printable(result.verification.words), soft_wrap=True)
    if result.finding is not None:
        from gapwalk.cli.print_findings import print_finding  # imported late: it needs the code of all kinds

        print_finding(screen, result.finding)
        return
    if words := _method_words(result):
        screen.print(words, soft_wrap=True)
    if result.map is not None:
        _print_unexplained(screen, result)
        print_map(screen, result.map, result.walked.measure, points=points)
        return
    if result.diagram is not None:
        print_diagram(screen, result.diagram)
        if not points:
            return
    else:
        _print_branch(screen, result.branches[0])
    _print_unexplained(screen, result)
    if any(branch.special_points for branch in result.branches):
        screen.print(special_point_table(result))
    else:
        screen.print("no special points")


def _method_words(result: Result) -> str:
    """Describe how finely the orbits of branches and loci are resolved; empty for exact orbits."""
    curves = [*result.branches, *(result.map.loci if result.map is not None else ())]
    return result.walked.method.words([point.orbit for curve in curves for point in curve.points])


def special_point_table(result: Result) -> Table:
    """Build the table of special points; for a diagram, by branches."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    coordinate = full_measure(result.walked.measure, result.system.coordinates).partition(".")[2]
    coordinate = coordinate if coordinate in result.system.coordinates else result.system.coordinates[0]
    diagram, units = result.diagram, result.system.units
    for heading in ["branch"] * bool(diagram) + ["kind"]:
        table.add_column(heading)
    table.add_column(parameter_symbol(result.walked.parameter, units), justify="right")
    table.add_column("±", justify="right")
    table.add_column(signal_words(f"half {coordinate}", units), justify="right")
    table.add_column("multiplier", justify="right")
    table.add_column("unstable" if diagram else "stability")  # the table of a diagram is wide enough as it is
    table.add_column("criticality or contact")
    if diagram:
        table.add_column("leads to")
    for name, branch in zip(result.names, result.branches, strict=True):
        for index, special in enumerate(branch.special_points):
            table.add_row(
                *[name if index == 0 else ""] * bool(diagram),
                special.kind.value,
                f"{special.value:#.10g}",
                f"{special.uncertainty:.0e}" if math.isfinite(special.uncertainty) else "",
                f"{special.point.measure(f'half.{coordinate}'):#.8g}",
                multiplier_text(special.multiplier),
                _unstable(special) if diagram else special.change,
                printable(special.nature_words.removesuffix(" values") or special.contact),
                *([" ".join(member.name for member in diagram.attached(name, index))] if diagram else []),
            )
        table.add_section()
    return table


def _unstable(special: SpecialPoint) -> str:
    """Return the numbers of multipliers outside the unit circle on both sides."""
    before, after = special.before.total, special.after.total
    return str(before) if before == after else f"{before} → {after}"


def multiplier_text(multiplier: complex) -> str:
    """Format a multiplier with six digits; a complex one represents its pair."""
    if np.isnan(multiplier):
        return ""
    if abs(multiplier.imag) <= 1e-9 * abs(multiplier):
        return f"{multiplier.real:+.6f}"
    return f"{multiplier.real:+.6f} ± {abs(multiplier.imag):.6f}i"


def _print_branch(screen: Console, branch: Branch) -> None:
    screen.print(_sentence(branch), soft_wrap=True)
    symbol = parameter_symbol(branch.parameter, branch.system.units)
    for end in branch.ends:
        detail = f" ({end.detail})" if end.detail else ""
        screen.print(f"  {symbol} = {end.value:.10g}: {end.reason.value}{printable(detail)}", soft_wrap=True)


def _print_unexplained(screen: Console, result: Result) -> None:
    """Print the steps in which a special point was missed."""
    for name, branch in zip(result.names, result.branches, strict=True):
        symbol = parameter_symbol(branch.parameter, branch.system.units)
        for each in branch.unexplained:
            screen.print(f"not explained: {name}, {symbol} {printable(str(each))}", soft_wrap=True)


def _sentence(branch: Branch) -> str:
    stable = sum(point.stable for point in branch.points)
    values = branch.values
    counts = [f"{len(branch.special(kind))} {kind.value}" for kind in Kind.known() if branch.special(kind)]
    found = ", ".join(counts) or "no special points"
    symbol = parameter_symbol(branch.parameter, branch.system.units)
    return (
        f"period-{branch.period} motions over {symbol} from {values[0]:.10g} to "
        f"{values[-1]:.10g}: {len(branch.points)} points, {stable} of them stable; {found}"
    )
