"""``gapwalk measure``: comparison of a record with the motion of a model, with picture and tables."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.cli.console import console
from gapwalk.cli.outcome import DONE, FAILED, print_json, printable
from gapwalk.cli.run_command import print_files
from gapwalk.errors import ModelError
from gapwalk.measurement.alignment import Alignment
from gapwalk.measurement.fit import Fit
from gapwalk.plot.words import pace_words
from gapwalk.studies.changes import parse_changes
from gapwalk.studies.export import table_csv, write_whole
from gapwalk.studies.measure.measure import Measured, measure
from gapwalk.studies.measure.table import read_measured_model

_LINES = 12  # spectral lines that are printed
_PICTURES = (".png", ".svg")


def measure_file(
    file: Path, record: Path, names: list[str], changes: list[str], output: Path | None, *, json: bool
) -> int:
    """Compare a record with the motion of a model file; return the exit code."""
    model = read_measured_model(file, parse_changes(changes))
    if names:
        model = replace(
            model, fit=tuple(names), bounds={name: model.bounds[name] for name in names if name in model.bounds}
        )
    paths = _paths(record, output, fitted=bool(model.fit))
    found = measure(model, model.read(record))
    _write(found, paths)
    files = [str(path) for path in paths]
    if json:
        print_json({**found.document(), "files": files})
    else:
        screen = console()
        _print(screen, found)
        print_files(screen, files)
    for text in found.failures:
        print(f"gapwalk: {printable(text)}", file=sys.stderr)
    return FAILED if found.failures else DONE


def _paths(record: Path, output: Path | None, *, fitted: bool) -> list[Path]:
    """Return the names of the pictures, then of the tables."""
    if output is not None and output.suffix not in _PICTURES:
        raise ModelError(f"{output} is not a name for a picture; give it the ending .png or .svg")
    base = output or record.with_name(f"{record.stem}-measured.png")
    tables = [*(["parameters"] if fitted else []), "history", "lines"]
    return [
        *(base.with_suffix(ending) for ending in _PICTURES),
        *(base.with_name(f"{base.stem}-{name}.csv") for name in tables),
    ]


def _write(found: Measured, paths: list[Path]) -> None:
    from gapwalk.plot import save  # imported late: only pictures need matplotlib

    save(found.alignment, *paths[: len(_PICTURES)], title=found.model.title or None)
    for path, rows in zip(paths[len(_PICTURES) :], found.tables().values(), strict=True):
        header, *rest = rows()
        write_whole(path, table_csv(header, rest).encode())


def _print(screen: Console, found: Measured) -> None:
    if found.model.title:
        screen.print(printable(found.model.title), style="bold", soft_wrap=True)
    aligned, orbit = found.alignment, found.alignment.orbit
    stability = "stable" if orbit.stable else "unstable"
    screen.print(
        f"{printable(aligned.record.name)}: {len(aligned.theta)} samples, {aligned.periods} periods, as "
        f"{printable(aligned.signal.name)}\nmotion of period {orbit.period} at {pace_words(orbit.system)}, "
        f"{stability}, contacts {printable(orbit.pattern)}",
        soft_wrap=True,
    )
    if found.fit is not None:
        screen.print(f"before the fit: {_words(found.fit.before)}", soft_wrap=True)
        screen.print(_parameters(found.fit))
    screen.print(f"{'after the fit: ' if found.fit else ''}{_words(aligned)}", soft_wrap=True)
    screen.print(_lines(aligned))
    for text in found.notes:
        screen.print(f"note: {printable(text)}", soft_wrap=True)


def _words(found: Alignment) -> str:
    agreed = found.agreement
    return (
        f"rms error {agreed.rms:.6g} ({agreed.relative:.2%} of the record's), correlation {agreed.correlation:.6f}, "
        f"phase of the first sample {found.phase:.6g} rad"
    )


def _parameters(found: Fit) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("parameter")
    for heading in ("start", "fitted", "standard error"):
        table.add_column(heading, justify="right")
    for each in (*found.estimates, found.phase):
        _, sign, error = str(each).partition("±")
        note = error.strip() if sign else str(each).partition("(")[2].rstrip(")")
        table.add_row(printable(each.name), f"{each.start:.6g}", f"{each.value:.6g}", note)
    return table


def _lines(found: Alignment) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for heading in ("line", "measured", "computed", "difference", "phase shift"):
        table.add_column(heading, justify="right")
    highest = sorted(found.agreement.lines, key=lambda line: -max(line.first, line.second))[:_LINES]
    for line in sorted(highest):
        table.add_row(
            f"{line.order:g} Ω" if found.orbit.system.turns is None else f"order {line.order:g}",
            f"{line.first:.6g}",
            f"{line.second:.6g}",
            f"{line.difference:+.3g}",
            f"{line.shift:+.3f} rad",
        )
    return table
