"""A bifurcation map in the terminal: its loci with their ends, and the points of codimension two."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.bifurcation.loci import Codim2, Locus, LocusEnd
from gapwalk.cli.outcome import printable
from gapwalk.model.units import Units
from gapwalk.plot.words import full_measure, parameter_symbol
from gapwalk.studies.map import KINDS, Map


def print_map(screen: Console, chart: Map, measure: str, *, points: bool) -> None:
    """Print the loci of a map, the points of codimension two if requested, and failures."""
    screen.print(_summary(chart), soft_wrap=True)
    for name, locus in zip(chart.names, chart.loci, strict=True):
        screen.print(_describe(chart, name, locus), soft_wrap=True)
    if points and any(locus.codim2_points for locus in chart.loci):
        screen.print(codim2_table(chart, measure))
    for text in chart.notes:
        screen.print(f"note: {printable(text)}", soft_wrap=True)
    for text in chart.failures:
        screen.print(f"failed: {printable(text)}", soft_wrap=True)


def codim2_table(chart: Map, measure: str) -> Table:
    """Build the table of the points of codimension two, by loci."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    measure = full_measure(measure, chart.loci[0].points[0].orbit.system.coordinates)
    for heading in ("locus", "point"):
        table.add_column(heading)
    symbols = [parameter_symbol(name, _units(chart)) for name in (chart.first, chart.second)]
    for heading in (*symbols, "angle", measure):
        table.add_column(heading, justify="right")
    table.add_column("contact")
    for name, locus in zip(chart.names, chart.loci, strict=True):
        for index, codim2 in enumerate(locus.codim2_points):
            table.add_row(
                name if index == 0 else "",
                codim2.kind.value,
                *(f"{value:#.10g}" for value in codim2.values),
                f"{codim2.point.angle:.6f}",
                f"{codim2.point.measure(measure):#.8g}",
                printable(codim2.contact),
            )
        if locus.codim2_points:
            table.add_section()
    return table


def _summary(chart: Map) -> str:
    ranges = ", ".join(
        f"{parameter_symbol(name, _units(chart))} from {low:.10g} to {high:.10g}"
        for name, (low, high) in zip((chart.first, chart.second), chart.within, strict=True)
    )
    counts = ", ".join(f"{len(chart.of_kind(kind))} of {kind.value}" for kind in KINDS if chart.of_kind(kind))
    values = ", ".join(f"{section.value:.6g}" for section in chart.sections)
    branches = len(chart.branches)
    special = sum(len(branch.special_points) for branch in chart.branches)
    return (
        f"{ranges}: {len(chart.loci)} loci{counts and f', {counts}'}\n"
        f"started from {special} special points of {branches} branches, on sections at "
        f"{parameter_symbol(chart.second, _units(chart))} = {values}"
    )


def _describe(chart: Map, name: str, locus: Locus) -> str:
    counts = [f"{len(locus.codim2(kind))} {kind.value}" for kind in Codim2 if locus.codim2(kind)]
    low, high = locus.values.min(axis=0), locus.values.max(axis=0)
    ranges = ", ".join(
        f"{parameter_symbol(parameter, _units(chart))} {a:.8g} to {b:.8g}"
        for parameter, a, b in zip((chart.first, chart.second), low, high, strict=True)
    )
    contact = f" of {locus.contact}" if locus.contact else ""
    parts = [f"{ranges}; {len(locus.points)} points", *([", ".join(counts)] if counts else [])]
    ends = [f"    {end.reason.value}" if locus.is_closed else f"    {_end(end)}" for end in locus.ends]
    return f"  {name}  period {locus.period}{printable(contact)}; {'; '.join(parts)}\n" + "\n".join(dict.fromkeys(ends))


def _units(chart: Map) -> Units | None:
    return chart.branches[0].system.units if chart.branches else None


def _end(end: LocusEnd) -> str:
    place = ", ".join(f"{value:.8g}" for value in end.values)
    return f"({place}): {end.reason.value}" + (f" ({printable(end.detail)})" if end.detail else "")
