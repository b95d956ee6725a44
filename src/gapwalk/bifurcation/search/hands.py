"""Who does the pieces of work of a search: this process alone, or others too if the caller has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol


class Hands(Protocol):
    """Whoever does independent pieces of work, in whatever processes; `gapwalk.study.work.workers` has such hands."""

    def run(
        self,
        function: Callable[[Any], Any],
        pieces: Sequence[Any],
        accept: Callable[[int, Any], None],
        is_needed: Callable[[int], bool],
    ) -> None:
        """Apply a function, importable by its name, to each piece that is needed when its turn comes.

        `accept` takes the number of each piece and its result, in this process.
        """
        ...


class Alone:
    """Does one piece after the other in this process."""

    def run(
        self,
        function: Callable[[Any], Any],
        pieces: Sequence[Any],
        accept: Callable[[int, Any], None],
        is_needed: Callable[[int], bool],
    ) -> None:
        """See `Hands.run`."""
        for number, piece in enumerate(pieces):
            if is_needed(number):
                accept(number, function(piece))
