"""Where text for people is printed."""

from __future__ import annotations

import sys

from rich.console import Console

_WIDTH = 1000  # of what is written to a file or a pipe: there no table is folded


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Let the command end as it does when anything else is printed to a reader that has gone."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """Where to print; texts are printed as they are, without markup."""
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _WIDTH
    return _Screen(stderr=stderr, markup=False, emoji=False, highlight=False, width=width)
