"""The rows as a table of text, and as JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from itertools import groupby, zip_longest
from typing import Any

from rich.table import Table

from benchmarks.row import Row, Target

_HEADINGS = ("what", "gapwalk", "baseline", "ratio", "target", "reached", "since last")


def as_table(rows: Sequence[Row], changes: Sequence[float | None] = ()) -> Table:
    """Return all rows under the headings of their groups; for each, how many times as fast it is as in the last run."""
    table = Table(title="CPU time, the least of several repeats", title_justify="left")
    for heading in _HEADINGS:
        is_text = heading == "what"
        table.add_column(heading, justify="left" if is_text else "right", no_wrap=is_text)
    pairs = zip_longest(rows, changes)
    for group, members in groupby(pairs, key=lambda pair: pair[0].group):
        table.add_section()
        table.add_row(f"[bold]{group}[/bold]")
        for row, change in members:
            table.add_row(*cells(row, change))
    return table


def notes(rows: Sequence[Row]) -> list[str]:
    """Return the remarks, each with its row."""
    return [f"{row.group}, {row.what}: {row.note}." for row in rows if row.note]


def cells(row: Row, change: float | None = None) -> tuple[str, ...]:
    """Return the texts of one row."""
    baseline = "" if row.baseline is None else f"{duration(row.baseline)} [dim]({row.against})[/dim]"
    ratio = "" if row.ratio is None else f"{row.ratio:.3g}"
    targets = ", ".join(_wanted(target) for target in row.targets)
    reached = ", ".join("[green]yes[/green]" if each else "[red]no[/red]" for each in row.reached)
    since = "" if change is None else f"{change - 1.0:+.0%}"
    return f"  {row.what}", duration(row.seconds), baseline, ratio, targets, reached, since


def duration(seconds: float) -> str:
    """Return a time in a suitable unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def as_json(rows: Sequence[Row]) -> str:
    """Return all rows, and the machine in general terms."""
    machine: dict[str, Any] = {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy", "llvmlite", "numba")},
    }
    return json.dumps({"machine": machine, "rows": [row.as_dict() for row in rows]}, indent=2) + "\n"


def _wanted(target: Target) -> str:
    match target.kind:
        case "seconds":
            return f"<= {duration(target.limit)}"
        case "ratio":
            return f">= {target.limit:g} x"
        case _:
            return f"{target.limit:g} points"
