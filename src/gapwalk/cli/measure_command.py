"""``gapwalk measure``: comparison of a record with the motion of a model, with picture and tables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gapwalk.answers.measured_points import read_points
from gapwalk.cli.output import DONE, FAILED, console, print_json, show, show_files, show_title
from gapwalk.errors import ModelError
from gapwalk.studies.export import save_tables
from gapwalk.studies.measure import SweptModel, document_of, measure, measure_points, read_measured_model
from gapwalk.studies.set_values import parse_changes
from gapwalk.summary import SummaryParts, printable

_PICTURES = (".png", ".svg")


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
