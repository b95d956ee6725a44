"""Executors of the pieces of work of a search: this process alone, or others that the caller provides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol


class PieceRunner(Protocol):
    """Executor of independent pieces of work in any processes; see `gapwalk.parallel.workers` for several cores."""

    def run(
        self,
        function: Callable[[Any], Any],
        pieces: Sequence[Any],
        accept: Callable[[int, Any], None],
        is_needed: Callable[[int], bool],
    ) -> None:
        """Apply a function, importable by its name, to each piece that is still needed when its turn comes.

        `accept` takes the number of each piece and its result, in this process.
        """
        ...


class SerialRunner:
    """Executor that processes the pieces one after another in this process."""

    def run(
        self,
        function: Callable[[Any], Any],
        pieces: Sequence[Any],
        accept: Callable[[int, Any], None],
        is_needed: Callable[[int], bool],
    ) -> None:
        """See `PieceRunner.run`."""
        for number, piece in enumerate(pieces):
            if is_needed(number):
                accept(number, function(piece))
