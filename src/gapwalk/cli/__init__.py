"""The command line: from arguments to an exit code."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Sequence
from io import TextIOWrapper
from types import FrameType

from cyclopts import CycloptsError

from gapwalk.cli.commands import app
from gapwalk.cli.output import BAD_INPUT, INTERRUPTED, TERMINATED, report_error
from gapwalk.interrupts import end_gently
from gapwalk.parallel.threads import work_in_one_thread

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command of these arguments (by default those of the process); return its exit code."""
    # The codes are 0: done; 1: a bug; 2: bad input; 3: the numerics failed; 4: the compared results differ; 5: the
    # verification failed; 130: interrupted; 143: ended by SIGTERM.
    work_in_one_thread()
    ended = _end_like_ctrl_c() if arguments is None else []
    if arguments is None:
        warnings.formatwarning = lambda message, *_, **__: f"gapwalk: warning: {message}\n"
    words = sys.argv[1:] if arguments is None else list(arguments)
    words = [*words[1:], "--help"] if words[:1] == ["help"] else words
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
    if ended and code == INTERRUPTED:
        return TERMINATED
    return code if isinstance(code, int) else 0


def _end_like_ctrl_c() -> list[int]:
    """Treat SIGTERM like Ctrl-C: store results, end other processes, print how to resume. Return a list of signals."""
    # Otherwise the process would die at once, and its workers' semaphores would be reported as leaked.
    heard: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        heard.append(number)
        end_gently(number, frame)

    signal.signal(signal.SIGTERM, interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, end_gently)
    return heard
