"""The command: draws figures of the paper, and checks what it says of them."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: the matrices are small, and processes fill the cores

import argparse
import json
import math
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims import CLAIMS, claims_about, counts
from reproductions.padmanabhan_singh_1995.figures import FIGURES, find_figure
from reproductions.padmanabhan_singh_1995.jobs import USUAL, Reading
from reproductions.padmanabhan_singh_1995.page import claims_page, document, html_page, with_counts
from reproductions.padmanabhan_singh_1995.report import Report, reproduce
from reproductions.padmanabhan_singh_1995.today import TODAY

DONE, BAD_INPUT, FAILED, INTERRUPTED = 0, 2, 3, 130
_FOLDER = Path("out/paper")
_ROOT = Path(__file__).resolve().parents[2]
_COUNTED = ("README.md", "docs/explanation/validation.md")


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the arguments say (by default those of the process), and return the exit code.

    It is 0: done; 2: bad input; 3: the numerics failed; 130: interrupted.
    """
    asked = _parser().parse_args(arguments)
    try:
        if asked.list:
            return _list(asked.json)
        return _draw(asked)
    except gw.errors.GapwalkError as error:
        if asked.debug:
            raise
        print(f"error: {error}", file=sys.stderr)
        if asked.json:
            print(json.dumps({"error": {"type": type(error).__name__, "message": str(error)}}))
        return FAILED if isinstance(error, gw.errors.NumericalError) else BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted; what is done is kept, and the same command resumes", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reproductions.padmanabhan_singh_1995",
        description="Draw the figures of Padmanabhan and Singh (1995), and check what the paper says of them. What is "
        "computed is kept: the same command resumes, and computes nothing twice.",
    )
    add = parser.add_argument
    add("figures", nargs="*", help="figures, or parts of them, such as 13 or 20a; by default all")
    add("--list", action="store_true", help="list the figures")
    add("--slope", choices=list(gw.paper.SlopeReading), default=USUAL.slope, help="how the second slope is read")
    add("--damping", choices=list(gw.paper.DampingReading), default=USUAL.damping, help="how impact damping is read")
    add("--output", type=Path, help=f"folder of pictures, results and tables; by default {_FOLDER}, none with --json")
    add("--docs", action="store_true", help="write the page, its summary and the counts into the documentation as well")
    add("--workers", type=int, help="number of processes; by default one for each core")
    add("--force", action="store_true", help="compute everything again")
    add("--json", action="store_true", help="print one JSON document; of several figures, a list")
    add("--debug", action="store_true", help="show the traceback of an error")
    return parser


def _list(as_json: bool) -> int:
    if as_json:
        each = ({"figure": f.name, "kind": f.kind, "caption": f.caption, "notes": f.notes} for f in FIGURES)
        print(json.dumps(list(each)))
    else:
        for figure in FIGURES:
            print(f"{figure.name:3} {figure.kind:27} {figure.caption}")
    return DONE


def _draw(asked: argparse.Namespace) -> int:
    """Draw the figures that are asked for; an unknown one is refused before anything is computed."""
    reading = Reading(gw.paper.SlopeReading(asked.slope), gw.paper.DampingReading(asked.damping))
    if asked.docs and (asked.figures or asked.json or reading != USUAL):
        raise gw.errors.ModelError(
            "the documentation has all figures at the printed numbers: write --docs without figures, --slope, "
            "--damping and --json"
        )
    figures = [find_figure(name) for name in asked.figures] or [*FIGURES, *TODAY]
    numbers = dict.fromkeys(figure.number for figure in figures)
    claims = tuple(claim for number in numbers for claim in claims_about(number)) if asked.figures else CLAIMS
    if reading != USUAL:  # claims name their own readings: they belong to the report of the default one
        claims = ()
    folder = asked.output or (None if asked.json else _FOLDER)
    with TemporaryDirectory() as scratch:
        report = reproduce(
            figures,
            claims,
            reading,
            folder or Path(scratch),
            draw=folder is not None,
            force=asked.force,
            cores=asked.workers,
            progress=None if asked.json else _show,
        )
    if asked.json:
        print(json.dumps(document(report, whole=not asked.figures), allow_nan=False))
    elif asked.figures:
        _print(report, folder)
    else:
        found = counts([outcome for _, outcome in report.checked])
        classes = (f"{count} {each}" for each, count in found.classes.items() if count)
        print(f"{found.statements} statements of the paper: {'; '.join(classes)}")
    if folder is not None:
        name = f"figure-{'-'.join(figure.name for figure in figures)}" if asked.figures else "index"
        page = folder / f"{name}{reading.suffix}.html"
        _write(page, html_page(report, folder))
        if asked.docs:
            _write_docs(report, page)
        if not asked.json:
            print(f"all of it is on one page: {page}" if not asked.figures else f"the page: {page}")
    return _code(report)


def _write_docs(report: Report, page: Path) -> None:
    """Write what the documentation has of a whole report: the page, its summary, and the counts of verdicts."""
    _write(_ROOT / "docs/_static/padmanabhan_singh_1995.html", page.read_text(encoding="utf-8"))
    _write(_ROOT / "docs/explanation/paper.md", claims_page(report.checked))
    for name in _COUNTED:
        text = (_ROOT / name).read_text(encoding="utf-8")
        _write(_ROOT / name, with_counts(text, [outcome for _, outcome in report.checked]))


def _print(report: Report, folder: Path | None) -> None:
    for figure in report.figures:
        print(f"Figure {figure.name}. {figure.caption}")
        for name, note in figure.notes.items():
            print(f"  note on the set of figure {name}: {note}")
        for job in figure.jobs:
            if job.key in report.results:
                result = report.results[job.key]
                print(f"  {job.key}: {result if result.diagram is None else result.diagram!r}")
        for claim, outcome in report.about(figure):
            print(f"  {claim.name}: {outcome}: {claim.says} ({outcome.line})")
        if folder is not None and figure.name in report.pictures:
            print(f"  written: {', '.join(str(folder / name) for name in report.pictures[figure.name])}")


def _show(what: str, name: str, done: int, total: int, left: float) -> None:
    """Print a line on what goes on; the first line of each kind comes before anything is done."""
    if not name:
        line = f"{total} {what}" + ("; Ctrl-C stops, and the same command resumes" if what == "studies" else "")
    else:
        line = f"{what} {done} of {total}: {name}" + ("" if math.isnan(left) else f", about {_words(left)} left")
    print(line, file=sys.stderr, flush=True)


def _words(seconds: float) -> str:
    return f"{round(seconds / 60)} min" if seconds > 90 else f"{max(10, 10 * round(seconds / 10))} s"


def _write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise gw.errors.StoreError(f"{path} cannot be written: {error.strerror or error}") from None


def _code(report: Report) -> int:
    for key, text in report.faults.items():
        print(f"error: {key}: {text}", file=sys.stderr)
    return FAILED if report.faults else DONE


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ended from outside, it stops as by Ctrl-C
    sys.exit(main())
