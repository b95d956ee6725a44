"""``gapwalk verify``: independent checks of a result."""

from __future__ import annotations

from pathlib import Path

from gapwalk.cli.output import BROKEN, DONE, console, print_json, show, show_title
from gapwalk.cli.progress import VerifyProgress
from gapwalk.studies.verify import verified_result


def verify_file(path: Path, *, json: bool) -> int:
    """Verify a result file; return the exit code."""
    with VerifyProgress(str(path)) as progress:
        result, found = verified_result(path, progress)
    if json:
        print_json({"file": str(path), "complete": result.complete, **found.document()})
    else:
        screen = console()
        if not result.complete:
            show([f"{path} is not complete; its stored part was verified"], screen)
        show(found.summary(), screen)
        show_title(found.words, screen)
    return DONE if found.ok else BROKEN
