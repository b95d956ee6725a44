"""``gapwalk paper``: frequency responses of the paper."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gapwalk.cli.outcome import BAD_INPUT, DONE, FAILED, INTERRUPTED, print_json, printable
from gapwalk.cli.progress import WalkProgress
from gapwalk.cli.run import exit_code, print_files, print_heading, say_why_it_failed, write_products
from gapwalk.cli.screen import console, print_result
from gapwalk.errors import ModelError, StoreError
from gapwalk.paper import describe, frequency_responses, names
from gapwalk.paper.figure import figure_document, figure_names, figure_study, walk_figure

_FOLDER = Path("paper")


def list_figures(*, json: bool) -> int:
    """List the figures that have a parameter set."""
    drawn = frequency_responses()
    if json:
        print_json([{"figure": name, "frequency_response": name in drawn, "note": describe(name)} for name in names()])
        return DONE
    screen = console()
    for name in names():
        kind = "frequency response" if name in drawn else "not drawn yet"
        screen.print(f"{name:16} {kind:20} {printable(describe(name))}".rstrip(), soft_wrap=True)
    return DONE


def run_figures(figures: Sequence[str], slope: str, damping: str, output: Path | None, *, json: bool) -> int:
    """Compute figures, and return the exit code: that of the worst of them."""
    if not figures:
        raise ModelError("name a figure, as in `gapwalk paper 13`; `gapwalk paper --list` lists them")
    asked = [_responses(figure) for figure in figures]  # refuses an unknown one before anything is computed
    folder = output if json else output or _FOLDER
    if folder is not None:
        _make(folder)
    codes, documents = [], []
    for figure, responses in zip(figures, asked, strict=True):
        if not responses:
            text = f"figure {figure} is no frequency response over W, and is not drawn yet"
            print(f"gapwalk: {printable(text)}", file=sys.stderr)
            documents.append({"figure": figure, "error": {"type": "ModelError", "message": text}})
            codes.append(BAD_INPUT)
        for name in responses:
            code, document = _run_figure(name, slope, damping, folder, json=json)
            codes.append(code)
            documents.append(document)
            if code == INTERRUPTED:
                break
        if INTERRUPTED in codes:
            break
    if json:
        print_json(documents[0] if len(documents) == len(figures) == 1 else documents)
    return max(codes)


def _responses(figure: str) -> list[str]:
    return [name for name in figure_names(figure) if name in frequency_responses()]


def _run_figure(name: str, slope: str, damping: str, folder: Path | None, *, json: bool) -> tuple[int, dict[str, Any]]:
    study = figure_study(name, slope=slope, damping=damping)
    path = None if folder is None else folder / f"{file_name(name, slope, damping)}.gapwalk"
    with WalkProgress(study.walked, f"figure {name}") as progress:
        result = walk_figure(name, slope=slope, damping=damping, output=path, report=progress)
    code = exit_code(result)
    files = [] if path is None else [path]
    if path is not None and code != INTERRUPTED:
        files += write_products(result, path)
    if not json:
        screen = console()
        print_heading(screen, study)
        if describe(name):
            screen.print(f"note: {printable(describe(name))}", soft_wrap=True)
        print_result(screen, result)
        print_files(screen, files)
    if code == FAILED:
        say_why_it_failed(result)
    return code, figure_document(name, result, slope=slope, damping=damping)


def file_name(name: str, slope: str, damping: str) -> str:
    """The name of the files of a figure; it tells a reading that is not the default."""
    readings = [reading for reading in (slope, damping) if reading not in ("reduced", "dissipative")]
    return "-".join([f"figure-{re.sub('[^0-9a-z]+', '-', name)}", *readings])


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"the folder {folder} cannot be made: {error.strerror or error}") from None
