"""``gapwalk verify``: independent checks of a result."""

from __future__ import annotations

from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.cli.console import console
from gapwalk.cli.outcome import BROKEN, DONE, print_json, printable
from gapwalk.cli.progress import VerifyProgress
from gapwalk.studies.verify import verified_result
from gapwalk.verification import Verification

_SHOWN = 20  # failed checks that are listed


def verify_file(path: Path, *, json: bool) -> int:
    """Verify a result file; return the exit code."""
    with VerifyProgress(str(path)) as progress:
        result, found = verified_result(path, progress)
    if json:
        print_json({"file": str(path), "complete": result.complete, **found.document()})
    else:
        screen = console()
        if not result.complete:
            screen.print(f"{path} is not complete; its stored part was verified", soft_wrap=True)
        print_verification(screen, found)
    return DONE if found.ok else BROKEN


def print_verification(screen: Console, found: Verification) -> None:
    """Print each check with its worst figure, and the failed ones."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("check")
    table.add_column("places", justify="right")
    table.add_column("worst", justify="right")
    table.add_column("allowed", justify="right")
    table.add_column("where")
    for summary in found.summaries:
        worst = summary.worst
        where = str(worst.spot) if worst.size > 0.0 else ""
        size = f"{worst.size:.1e}" if worst.size else "0"
        bound = f"{summary.check.bound:g}"
        table.add_row(summary.check.word, str(summary.count), size, bound, printable(where))
    screen.print(table)
    for figure in found.breaches[:_SHOWN]:
        screen.print(printable(f"failed: {figure.check.sentence}\n  {figure}"), soft_wrap=True)
    if len(found.breaches) > _SHOWN:
        screen.print(f"and {len(found.breaches) - _SHOWN} more; --json lists them all")
    for note in found.notes:
        screen.print(printable(f"note: {note}"), soft_wrap=True)
    screen.print(printable(found.words), style="bold", soft_wrap=True)
