"""The console on which text for users is printed."""

from __future__ import annotations

import sys

from rich.console import Console

_WIDTH = 1000  # of text to a file or a pipe, where tables are not folded


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Let the command end like any other output to a reader that has closed the pipe."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """Create a console that prints text unchanged, without markup."""
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _WIDTH
    return _Screen(stderr=stderr, markup=False, emoji=False, highlight=False, width=width)
