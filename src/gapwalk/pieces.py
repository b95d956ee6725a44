"""Independent pieces of work: done by the workers around (`gapwalk.parallel`), or in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableSequence, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

Piece = TypeVar("Piece")
Result = TypeVar("Result")


shares: MutableSequence[float] = [0.0]
"""Shares of the pieces in progress that are done; a worker has the array of the process that has hired it."""
place = 0
"""Place of this process among them."""


def tell(share: float) -> None:
    """Note which share of a long piece of work is done in this process, for who watches the progress."""
    shares[place] = min(max(share, 0.0), 1.0)


_stage: ContextVar[tuple[float, float] | None] = ContextVar("stage", default=None)


@contextmanager
def stage(low: float, high: float) -> Iterator[None]:
    """Let `tell_stage` tell within two shares of a long piece of work."""
    token = _stage.set((low, high))
    try:
        yield
        tell(high)
    finally:
        _stage.reset(token)


def tell_stage(share: float) -> None:
    """Note which share of the stage around is done; of work without stages others tell."""
    if (ends := _stage.get()) is not None:
        tell(ends[0] + (ends[1] - ends[0]) * share)


class Here:
    """Executor of pieces of work in this process."""

    def each(
        self,
        function: Callable[[Piece], Result],
        pieces: Sequence[Piece],
        is_needed: Callable[[int], bool] = lambda index: True,
        *,
        in_order: bool = True,
    ) -> Iterator[tuple[int, Result]]:
        """Do the pieces that are needed: the index of each piece with its result; see `gapwalk.parallel.Workers`."""
        index = 0
        while index < len(pieces):
            if is_needed(index):
                yield index, function(pieces[index])
            index += 1

    def run(
        self,
        function: Callable[[Piece], Result],
        pieces: Sequence[Piece],
        accept: Callable[[int, Result], None],
        is_needed: Callable[[int], bool] = lambda index: True,
        *,
        in_order: bool = True,
    ) -> None:
        """Do the pieces that are needed, and hand the index and the result of each to `accept`; otherwise as `each`.

        Parameters
        ----------
        function, pieces, is_needed, in_order
            As in `each`.
        accept
            Called with the index and the result of each piece.
        """
        for index, result in self.each(function, pieces, is_needed, in_order=in_order):
            accept(index, result)


around: ContextVar[Here | None] = ContextVar("workers", default=None)
"""The workers that a study or a `with` block has hired for all work inside."""


def workers_around() -> Here:
    """Return the workers around; this process if there are none."""
    return around.get() or Here()


def done(function: Callable[[Piece], Result], pieces: Sequence[Piece]) -> list[Result]:
    """Return the results of pieces in their order: the workers around do them, several at a time."""
    # The function is importable by its name, or a `partial` of one, so that other processes find it; it holds what all
    # pieces share, which travels once to each worker.
    found: list[Any] = [result for _, result in workers_around().each(function, pieces)]
    return found
