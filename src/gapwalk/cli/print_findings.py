"""Results of studies without branches in the terminal, by the kind of study."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.cli.outcome import printable
from gapwalk.cli.print_family import print_family
from gapwalk.plot.words import coordinate_words, line_words, pace_words, parameter_symbol, signal_words
from gapwalk.studies.basins.finding import BasinFinding
from gapwalk.studies.family.finding import FamilyFinding
from gapwalk.studies.finding import Finding
from gapwalk.studies.regimes.finding import RegimeFinding
from gapwalk.studies.settle.finding import SettleFinding
from gapwalk.studies.sweep.finding import SweepFinding

_LINES = 8  # lines of a spectrum that are printed
_PERIODS = 12  # longest period that is listed separately
_BANDS = 40  # bands of a sweep that are printed


def print_finding(screen: Console, finding: Finding) -> None:
    """Print the result of a study, with notes and failures."""
    if not finding.complete:
        screen.print(finding.stored, soft_wrap=True)
    if finding.record is not None:
        _PRINTERS[type(finding)](screen, finding)
    for text in finding.notes:
        screen.print(f"note: {printable(text)}", soft_wrap=True)
    for text in finding.failures:
        screen.print(f"failed: {printable(text)}", soft_wrap=True)


def _print_settled(screen: Console, finding: SettleFinding) -> None:
    attractor, settled = finding.attractor, finding.settled
    units, turns = attractor.system.units, attractor.system.turns
    where = pace_words(attractor.system)
    screen.print(f"{attractor.label}: {attractor.kind.value} motion at {where}", soft_wrap=True)
    screen.print(f"  followed for {settled.periods} forcing periods", soft_wrap=True)
    for sentence in attractor.evidence:
        screen.print(f"  {printable(sentence)}", soft_wrap=True)
    heading = "multiple of Ω" if turns is None else "order"
    screen.print(f"\nlines of {printable(signal_words(finding.options.signal, units))}", soft_wrap=True)
    table = _table("line", right=(heading, "amplitude"))
    for line in finding.lines[:_LINES]:
        table.add_row(line_words(line.name), f"{line.order:.6g}", f"{line.amplitude:.6g}")
    screen.print(table)
    screen.print(f"\nrattle: index {finding.rattle.index:.4g} (kurtosis of the acceleration)\n", soft_wrap=True)
    screen.print(repr(finding.rattle), soft_wrap=True)


def _print_sweep(screen: Console, finding: SweepFinding) -> None:
    sweep = finding.sweep
    low, high = sweep.values[0], sweep.values[-1]
    symbol = parameter_symbol(sweep.parameter, sweep.system.units)
    screen.print(f"{symbol} from {low:.10g} to {high:.10g}: {len(sweep.values)} values", soft_wrap=True)
    for number, lane in enumerate(sweep.lanes):
        bands = sweep.bands(number)
        unsettled = int((~sweep.settled[number] & (sweep.regimes[number] != "")).sum())
        text = f"{lane.way.value}, start {lane.start}: {len(bands)} bands of equal motions"
        if unsettled:
            text += f"; at {unsettled} values the transient had not settled within the allowed time"
        screen.print(text, soft_wrap=True)
        for band in bands[:_BANDS]:
            screen.print(f"  {band.low:.8g} to {band.high:.8g}: {band.regime}, {band.count} values", soft_wrap=True)
        if len(bands) > _BANDS:
            screen.print(f"  and {len(bands) - _BANDS} more: see the table of regimes", soft_wrap=True)


def _print_basins(screen: Console, finding: BasinFinding) -> None:
    found = finding.basins
    assert found is not None
    (columns, rows), total = found.resolution, found.labels.size
    axes = ", ".join(coordinate_words(name, found.system.units) for name in (found.window.across, found.window.up))
    screen.print(f"{axes}: {columns} x {rows} cells", soft_wrap=True)
    table = _table("leads to", right=("cells", "share", "largest exponent"))
    for name, attractor in zip(found.names, found.attractors, strict=True):
        exponents = attractor.lyapunov
        largest = "" if exponents is None else f"{exponents.exponents[0]:.4g}"
        table.add_row(name, str(found.cells[name]), f"{found.cells[name] / total:.2%}", largest)
    for name, count in (("runs away", found.runaway), ("unresolved", found.unresolved)):
        if count:
            table.add_row(name, str(count), f"{count / total:.2%}", "")
    screen.print(table)
    screen.print(found.check.text, soft_wrap=True)


def _print_regimes(screen: Console, finding: RegimeFinding) -> None:
    found = finding.regimes
    assert found is not None
    (columns, rows), total = found.resolution, found.regimes.size
    first, second = (parameter_symbol(name, found.system.units) for name in (found.first, found.second))
    screen.print(f"{first}, {second}: {columns} x {rows} cells", soft_wrap=True)
    table = _table("motion", right=("cells", "share"))
    for word, count in _in_few_words(found.cells).items():
        table.add_row(word, str(count), f"{count / total:.2%}")
    screen.print(table)
    check = found.check
    screen.print(f"{check.checked} cells classified again, {len(check.different)} differently", soft_wrap=True)
    for text in check.different:
        screen.print(f"  {printable(text)}", soft_wrap=True)


def _in_few_words(cells: dict[str, int]) -> dict[str, int]:
    """Count cells by regime, with all long periods in one group."""
    few: dict[str, int] = {}
    for word, count in cells.items():
        kind, _, period = word.partition(" ")
        is_long = kind == "period" and int(period) > _PERIODS
        key = f"longer periods than {_PERIODS}" if is_long else word
        few[key] = few.get(key, 0) + count
    return few


def _table(first: str, right: tuple[str, ...]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column(first)
    for heading in right:
        table.add_column(heading, justify="right")
    return table


_PRINTERS: dict[type[Finding], Callable[[Console, Any], None]] = {
    FamilyFinding: print_family,
    SettleFinding: _print_settled,
    SweepFinding: _print_sweep,
    BasinFinding: _print_basins,
    RegimeFinding: _print_regimes,
}
