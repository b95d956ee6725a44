"""``gapwalk compare``: the differences of two results, and their agreement within a tolerance."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gapwalk.answers.point_fit import read_points
from gapwalk.cli.output import DIFFERENT, DONE, FAILED, console, print_json, show, show_files, show_title
from gapwalk.cli.progress import progress_of
from gapwalk.errors import ModelError
from gapwalk.model.words import parameter_symbol
from gapwalk.studies.compare import (
    CellComparison,
    Pair,
    ResultComparison,
    compare_results,
    comparison_document,
    place_words,
)
from gapwalk.studies.export import save_tables
from gapwalk.studies.measurement_fit import SweptModel, document_of, measure, measure_points, read_measured_model
from gapwalk.studies.result import Result, load_result
from gapwalk.studies.runner import run
from gapwalk.studies.set_values import parse_changes
from gapwalk.studies.study_file import read_study
from gapwalk.summary import SummaryParts, Table, printable, remarks

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
    if isinstance(found, CellComparison):
        return _show_cells(found, (first, second), tolerance, output, json=json)
    agree = found.within(tolerance)
    if output is not None:
        from gapwalk.plot import save  # imported late: only pictures need matplotlib

        save(found, output, measure=measure, tolerance=tolerance, names=(first, second))
    if json:
        print_json(comparison_document(found, tolerance) | {"files": [first, second]})
    else:
        show(_lines(found, (first, second)))
        worst = f"distance {found.largest:.2g}, location of a special point {found.largest_shift:.2g}"
        verdict = "they agree within" if agree else "they differ by more than"
        show_title(f"largest {worst}: {verdict} {tolerance:g}", console())
        if any(tolerance < pair.largest <= _SPARSE * pair.resolution for pair in found.pairs):
            advice = "use smaller steps, as in --set study.walk.largest_step=0.005"
            show([f"points may be too far apart to decide; {advice}"])
        if output is not None:
            show_files([output])
    return DONE if agree else DIFFERENT


def _show_cells(
    found: CellComparison, files: tuple[str, str], tolerance: float, output: Path | None, *, json: bool
) -> int:
    """Print which cells differ; return the exit code."""
    if output is not None:
        raise ModelError("the differences of cells are not drawn; leave --output out, --json lists all of them")
    agree = found.within_share(tolerance)
    if json:
        print_json(found.document(tolerance) | {"files": list(files)})
        return DONE if agree else DIFFERENT
    for which, file, result in zip(_WORDS, files, found.results, strict=True):
        show([f"{which}: {file}{f', {result.title}' if result.title else ''}"])
    show(found.lines())
    worst = max(found.counts.values(), default=0)
    verdict = "they agree within" if agree else "they differ by more than"
    share = f"{worst} of {found.cells} cells differ: {verdict} a share of {tolerance:g}"
    show_title(share if not any(found.only) else f"{share}; other gaps", console())
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


def _lines(found: ResultComparison, files: tuple[str, str]) -> SummaryParts:
    """Return the common parts and the differences of two results."""
    for which, file, result in zip(_WORDS, files, found.results, strict=True):
        title = f", {result.title}" if result.title else ""
        yield f"{which}: {file}{title} (by {result.walked.method.name})"
    yield from remarks(found.notes, ())
    symbols = [parameter_symbol(name, found.results[0].system.units) for name in found.parameters]
    ranges = ", ".join(f"{symbol}: {width:.6g}" for symbol, width in zip(symbols, found.ranges, strict=True))
    what = f"curves over {symbols[0]} in the space of {', '.join(found.measures)}"
    yield f"compared: {what}; lengths are relative to the ranges ({ranges})"
    walked = found.results[0].walked
    for pair in found.pairs:
        yield from _pair_lines(pair, symbols, downwards=walked.begin > walked.end)
    for which, names in zip(_WORDS, found.only, strict=True):
        yield from (f"only in the {which}: {name}" for name in names)


def _pair_lines(pair: Pair, symbols: list[str], *, downwards: bool) -> SummaryParts:
    """Return the distance of a branch or a locus in both results, and the table of its special points."""
    name = pair.names[0] if pair.names[0] == pair.names[1] else " and ".join(pair.names)
    place = place_words(symbols, pair.worst)
    yield f"{name}: largest distance {pair.largest:.2g}, at {place} (interpolation may add {pair.resolution:.1g})"
    if pair.missing > 1e-12:
        (a, b), (c, d) = pair.covered
        text = f"  the first covers {symbols[0]} from {a:.10g} to {b:.10g}, the second from {c:.10g} to {d:.10g}"
        yield f"{text}: {pair.missing:.2g} is missing"
    rows: list[tuple[tuple[float, ...], list[str]]] = []
    for shift in pair.shifts:
        values = zip(shift.first, shift.second, shift.differences, strict=True)
        cells = [text for a, b, change in values for text in (f"{a:#.10g}", f"{b:#.10g}", f"{change:+.2g}")]
        rows.append((shift.first, [shift.label, *cells, f"{shift.share:.2g}"]))
    for place, alone in enumerate(pair.only):
        for each in alone:
            cells = [text for v in each.values for text in (*[""] * place, f"{v:#.10g}", *[""] * (1 - place), "")]
            rows.append((each.values, [each.label, *cells, f"only in the {_WORDS[place]}"]))
    if rows:
        shown = symbols[: len(pair.worst) or 1]
        columns = [f">{each}" for symbol in shown for each in (f"{symbol} first", f"{symbol} second", "difference")]
        rows.sort(key=lambda row: row[0], reverse=downwards)
        yield Table(["special point", *columns, ">relative"], [cells for _, cells in rows])


# ``gapwalk measure``: comparison of a record with the motion of a model, with picture and tables.


def measure_file(
    file: Path, record: Path | None, names: list[str], changes: list[str], output: Path | None, *, json: bool
) -> int:
    """Compare a record with the motion of a model file, or fit it to special points; return the exit code."""
    model = read_measured_model(file, parse_changes(changes))
    if names:
        model = replace(
            model, fit=tuple(names), bounds={name: model.bounds[name] for name in names if name in model.bounds}
        )
    if output is not None and output.suffix not in _PICTURES:
        raise ModelError(f"{output} is not a name for a picture; give it the ending .png or .svg")
    if isinstance(model, SweptModel):
        return _fit_points(model, file, record, output, json=json)
    if record is None:
        raise ModelError(
            "no record was named; write its file after the model file, as in gapwalk measure model.toml record.csv"
        )
    found = measure(model, model.read(record))
    from gapwalk.plot import save  # imported late: only pictures need matplotlib

    base = output or _base(record)
    pictures = [base.with_suffix(ending) for ending in _PICTURES]
    save(found.alignment, *pictures, title=found.model.title or None)
    files = [str(path) for path in (*pictures, *save_tables(found, base.with_suffix("")))]
    return _shown(found.document(), found.summary, found.failures, found.model.title, files, json=json)


def _fit_points(model: SweptModel, file: Path, record: Path | None, output: Path | None, *, json: bool) -> int:
    found = measure_points(model, () if record is None else read_points(record))
    base = output or _base(record or file)
    files = [str(path) for path in save_tables(found, base.with_suffix(""))]
    return _shown(
        document_of(found, model.title),
        lambda: found.summary(failures=False),
        found.failures,
        model.title,
        files,
        json=json,
    )


def _base(file: Path) -> Path:
    """Return the picture after which tables are named too."""
    return file.with_name(f"{file.stem}-measured.png")


def _shown(
    document: Mapping[str, Any],
    summary: Callable[[], SummaryParts],
    failures: Sequence[str],
    title: str,
    files: list[str],
    *,
    json: bool,
) -> int:
    if json:
        print_json({**document, "files": files})
    else:
        screen = console()
        show_title(title, screen)
        show(summary(), screen)
        show_files(files, screen)
    for text in failures:
        print(f"gapwalk: {printable(text)}", file=sys.stderr)
    return FAILED if failures else DONE
