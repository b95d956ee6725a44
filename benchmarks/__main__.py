"""``python -m benchmarks``: measure, print one table, and write it as JSON on request."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: CPU time of one core on both sides

_WIDTH = 140  # columns, if the output is not a terminal


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the requested benchmarks."""
    parser = _parser()
    options = parser.parse_args(arguments)
    for name in options.only:
        if name not in _groups():
            parser.error(f"there is nothing called {name!r} to measure; write one of {', '.join(_groups())}")

    from rich.console import Console

    from benchmarks import history
    from benchmarks.effort import FULL, QUICK
    from benchmarks.table import as_json, as_table, notes

    effort = QUICK if options.quick else FULL
    console, rows = Console(), []
    if not console.is_terminal:
        console = Console(width=_WIDTH)
    for name, measure in _groups().items():
        if name in options.only:
            print(f"measuring: {name}", file=sys.stderr)  # no spinner: its thread would be measured too
            rows += measure(effort)
    entry = history.entry_of(rows, "quick" if options.quick else "full")
    last = history.last_like(entry, history.read(options.history))
    console.print(as_table(rows, [entry.change(row, last) for row in rows]))
    for note in notes(rows):
        console.print(note, style="dim", highlight=False)
    for text in history.regressions(entry, rows, last):
        console.print(text, style="red", highlight=False)
    if options.record:
        history.append(entry, options.history)
    if options.json is not None:
        options.json.write_text(as_json(rows), encoding="utf-8")


def _parser() -> argparse.ArgumentParser:
    from benchmarks.history import FILE

    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    names = list(_groups())
    parser.add_argument("only", nargs="*", default=names, help=f"what to measure: {', '.join(names)} (default: all)")
    parser.add_argument("--quick", action="store_true", help="fewer repeats and smaller systems")
    parser.add_argument("--record", action="store_true", help="add what was measured to the history")
    parser.add_argument("--history", type=Path, metavar="FILE", default=FILE, help="the history (default: %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows to this file, too")
    return parser


def _groups() -> dict[str, Callable]:
    from benchmarks import (
        balance,
        branch,
        compiling,
        diagram,
        growth,
        jobs,
        mass,
        paper,
        period,
        reducer,
        start,
        suite,
        tori,
    )

    return {
        "period": period.rows,
        "branch": branch.rows,
        "diagram": diagram.rows,
        "compiling": compiling.rows,
        "start": start.rows,
        "growth": growth.rows,
        "mass": mass.rows,
        "balance": balance.rows,
        "reducer": reducer.rows,
        "tori": tori.rows,
        "jobs": jobs.rows,
        "paper": paper.rows,
        "suite": suite.rows,
    }


if __name__ == "__main__":
    main()
