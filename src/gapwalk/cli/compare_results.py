"""``gapwalk compare``: the differences of two results, and their agreement within a tolerance."""

from __future__ import annotations

import os
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.cli.console import console
from gapwalk.cli.outcome import DIFFERENT, DONE, print_json, printable
from gapwalk.cli.progress import progress_of
from gapwalk.errors import ModelError
from gapwalk.plot.words import parameter_symbol
from gapwalk.studies.changes import parse_changes
from gapwalk.studies.compare import compare_results
from gapwalk.studies.comparison import Pair, ResultComparison, place_words
from gapwalk.studies.comparison_document import comparison_document
from gapwalk.studies.file import read_study
from gapwalk.studies.load import load_result
from gapwalk.studies.result import Result
from gapwalk.studies.run import run

_PICTURES = (".png", ".svg")
_WORDS = ("first", "second")
_SPARSE = 10.0  # distance, in interpolation errors, below which interpolation alone may explain it


def compare_files(
    first: str,
    second: str,
    tolerance: float,
    *,
    output: Path | None,
    measure: str | None,
    changes: list[str],
    json: bool,
) -> int:
    """Compare two result files, or the studies of model files; return the exit code."""
    if not tolerance > 0.0:
        raise ModelError(f"tolerance is {tolerance:g}; it must be > 0, relative to the ranges, as in --tolerance 1e-3")
    if output is not None and output.suffix not in _PICTURES:
        raise ModelError(f"{output} is not a name for a picture; give it the ending .png or .svg")
    found = compare_results(_result_of(first, changes), _result_of(second, changes))
    agree = found.within(tolerance)
    if output is not None:
        from gapwalk.plot import save  # imported late: only pictures need matplotlib

        save(found, output, measure=measure, tolerance=tolerance, names=(first, second))
    if json:
        print_json(comparison_document(found, tolerance) | {"files": [first, second]})
    else:
        _print(console(), found, (first, second), tolerance)
        if output is not None:
            console().print(f"written: {printable(str(output))}", soft_wrap=True)
    return DONE if agree else DIFFERENT


def _result_of(text: str, changes: list[str]) -> Result:
    """Load the result from a file; for a model file, compute that of its study without storing it."""
    file, _, name = (text, "", "") if os.path.exists(text) else text.rpartition(":")
    file = file or text
    if not file.endswith(".toml"):
        return load_result(text)
    study = read_study(file, parse_changes(changes), name)
    with progress_of(study.options, study.name or file) as progress:
        result = run(study, report=progress)
    return result


def _print(screen: Console, found: ResultComparison, files: tuple[str, str], tolerance: float) -> None:
    """Print the common parts and the differences of two results."""
    for which, file, result in zip(_WORDS, files, found.results, strict=True):
        title = f", {result.title}" if result.title else ""
        screen.print(printable(f"{which}: {file}{title} (by {result.walked.method.name})"), soft_wrap=True)
    for note in found.notes:
        screen.print(f"note: {printable(note)}", soft_wrap=True)
    symbols = [parameter_symbol(name, found.results[0].system.units) for name in found.parameters]
    ranges = ", ".join(f"{symbol}: {width:.6g}" for symbol, width in zip(symbols, found.ranges, strict=True))
    what = f"curves over {symbols[0]} in the space of {', '.join(found.measures)}"
    screen.print(f"compared: {what}; lengths are relative to the ranges ({ranges})", soft_wrap=True)
    for pair in found.pairs:
        _print_pair(screen, pair, found)
    for which, names in zip(_WORDS, found.only, strict=True):
        for name in names:
            screen.print(f"only in the {which}: {name}", soft_wrap=True)
    worst = f"distance {found.largest:.2g}, location of a special point {found.largest_shift:.2g}"
    verdict = "they agree within" if found.within(tolerance) else "they differ by more than"
    screen.print(f"largest {worst}: {verdict} {tolerance:g}", style="bold", soft_wrap=True)
    if any(tolerance < pair.largest <= _SPARSE * pair.resolution for pair in found.pairs):
        text = "points may be too far apart to decide; use smaller steps, as in --set study.walk.largest_step=0.005"
        screen.print(text, soft_wrap=True)


def _print_pair(screen: Console, pair: Pair, found: ResultComparison) -> None:
    symbols = [parameter_symbol(name, found.results[0].system.units) for name in found.parameters]
    name = pair.names[0] if pair.names[0] == pair.names[1] else " and ".join(pair.names)
    screen.print(
        f"{name}: largest distance {pair.largest:.2g}, at {place_words(symbols, pair.worst)} "
        f"(interpolation may add {pair.resolution:.1g})",
        soft_wrap=True,
    )
    if pair.missing > 1e-12:
        (a, b), (c, d) = pair.covered
        text = f"  the first covers {symbols[0]} from {a:.10g} to {b:.10g}, the second from {c:.10g} to {d:.10g}"
        screen.print(f"{text}: {pair.missing:.2g} is missing", soft_wrap=True)
    if pair.shifts or any(pair.only):
        walked = found.results[0].walked
        screen.print(_table(pair, symbols[: len(pair.worst) or 1], downwards=walked.begin > walked.end))


def _table(pair: Pair, symbols: list[str], *, downwards: bool) -> Table:
    """Build the table of the special points of a branch or a locus in both results."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("special point")
    for symbol in symbols:
        for heading in (f"{symbol} first", f"{symbol} second", "difference"):
            table.add_column(heading, justify="right")
    table.add_column("relative", justify="right")
    rows: list[tuple[tuple[float, ...], list[str]]] = []
    for shift in pair.shifts:
        cells = [
            text
            for a, b, difference in zip(shift.first, shift.second, shift.differences, strict=True)
            for text in (f"{a:#.10g}", f"{b:#.10g}", f"{difference:+.2g}")
        ]
        rows.append((shift.first, [printable(shift.label), *cells, f"{shift.share:.2g}"]))
    for place, alone in enumerate(pair.only):
        for each in alone:
            cells = [text for v in each.values for text in (*[""] * place, f"{v:#.10g}", *[""] * (1 - place), "")]
            rows.append((each.values, [printable(each.label), *cells, f"only in the {_WORDS[place]}"]))
    for _, cells in sorted(rows, key=lambda row: row[0], reverse=downwards):
        table.add_row(*cells)
    return table
