"""Where the command line begins: words in, exit code out."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper

from cyclopts import CycloptsError

from gapwalk.cli.commands import app
from gapwalk.cli.outcome import BAD_INPUT, report_error
from gapwalk.study.work.threads import work_in_one_thread


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command of these arguments (by default those of the process), and return its exit code.

    The codes are 0: done; 1: a bug; 2: bad input; 3: the numerics failed; 4: what was
    compared differs; 5: what was verified is wrong; 130: interrupted.
    """
    work_in_one_thread()
    words = sys.argv[1:] if arguments is None else list(arguments)
    sys.stdout, sys.stderr = (stream or open(os.devnull, "w") for stream in (sys.stdout, sys.stderr))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without the letter Omega is no reason to fail
    try:
        code = app(words, exit_on_error=False, print_error="--json" not in words, result_action="return_value")
    except CycloptsError as error:
        if "--json" in words:
            report_error(error, json=True)
        return BAD_INPUT
    return code if isinstance(code, int) else 0
