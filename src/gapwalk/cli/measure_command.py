"""``gapwalk measure``: comparison of a record with the motion of a model, with picture and tables."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from gapwalk.cli.output import DONE, FAILED, console, print_json, show, show_files, show_title
from gapwalk.errors import ModelError
from gapwalk.studies.export import save_tables
from gapwalk.studies.measure import measure, read_measured_model
from gapwalk.studies.set_values import parse_changes
from gapwalk.summary import printable

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
    if output is not None and output.suffix not in _PICTURES:
        raise ModelError(f"{output} is not a name for a picture; give it the ending .png or .svg")
    found = measure(model, model.read(record))
    from gapwalk.plot import save  # imported late: only pictures need matplotlib

    base = output or record.with_name(f"{record.stem}-measured.png")
    pictures = [base.with_suffix(ending) for ending in _PICTURES]
    save(found.alignment, *pictures, title=found.model.title or None)
    files = [str(path) for path in (*pictures, *save_tables(found, base.with_suffix("")))]
    if json:
        print_json({**found.document(), "files": files})
    else:
        screen = console()
        show_title(found.model.title, screen)
        show(found.summary(), screen)
        show_files(files, screen)
    for text in found.failures:
        print(f"gapwalk: {printable(text)}", file=sys.stderr)
    return FAILED if found.failures else DONE
