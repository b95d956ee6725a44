"""Pieces of work of which one may make others of its family superfluous: several at a time, each of another family.

Pieces are accepted in their order, each only if it is needed then. Where those that are in progress at the same time
make one another superfluous, two processes take as long as one: so whoever is free begins with another family.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, TypeVar

from gapwalk.parallel.workers import Workers

Piece = TypeVar("Piece")
Result = TypeVar("Result")


def do_by_families(
    function: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    families: Sequence[Hashable],
    is_needed: Callable[[int], bool],
    workers: Workers,
) -> Iterator[tuple[int, Result]]:
    """Do the pieces that are needed, in their order; those in progress are of different families, if possible.

    Parameters
    ----------
    function
        Function of a piece; importable by name.
    pieces, families
        The pieces, and the family of each.
    is_needed
        Called before a piece begins and when it is its turn; False to leave it out, because earlier results have made
        it superfluous. Then it stays so.
    workers
        Executor of the work.

    Yields
    ------
    index, result
        The index of a piece, and what the function returned; the same for any number of workers.

    Raises
    ------
    WorkError
        If the processes die over a piece.
    """
    queue: _FamilyQueue = _FamilyQueue(pieces, families, is_needed)
    for number, result in workers.each(function, queue, in_order=False):
        queue.take(number, result)
        yield from queue.in_turn()


class _FamilyQueue(Sequence[Any]):
    """Pieces whose order is decided when each begins."""

    def __init__(self, pieces: Sequence[Any], families: Sequence[Hashable], is_needed: Callable[[int], bool]) -> None:
        self._pieces, self._families, self._is_needed = pieces, families, is_needed
        self._begun: list[int] = []
        self._results: dict[int, Any] = {}
        self._turn = 0
        self._superfluous: set[int] = set()

    def take(self, number: int, result: Any) -> None:
        """Take the result of a piece."""
        self._results[self._begun[number]] = result

    def in_turn(self) -> Iterator[tuple[int, Any]]:
        """Yield the next pieces that are done and needed."""
        while self._turn < len(self._pieces):
            if self._is_left_out(self._turn):
                self._results.pop(self._turn, None)
            elif self._turn in self._results:
                yield self._turn, self._results.pop(self._turn)
            else:
                return
            self._turn += 1

    def __len__(self) -> int:
        """Number of pieces that were begun, and one more if one can begin."""
        return len(self._begun) + (self._next() is not None)

    def __getitem__(self, number: Any) -> Any:
        if number == len(self._begun):
            index = self._next()
            if index is None:
                raise IndexError(number)
            self._begun.append(index)
        return self._pieces[self._begun[number]]

    def _next(self) -> int | None:
        """Return the piece to begin: the first of a family in which nothing is undecided before it.

        If there is none, one whose neighbour in its family is not in progress either; else the first.
        """
        begun = set(self._begun)
        left = [k for k in range(self._turn, len(self._pieces)) if k in begun or not self._is_left_out(k)]
        undecided: dict[Hashable, int] = {}
        others: list[tuple[bool, int]] = []
        for k in left:
            before = undecided.get(self._families[k])
            undecided[self._families[k]] = k
            if k in begun:
                continue
            if before is None:
                return k
            others.append((before in begun and before not in self._results, k))
        return min(others)[1] if others else None

    def _is_left_out(self, index: int) -> bool:
        if index not in self._superfluous and not self._is_needed(index):
            self._superfluous.add(index)
        return index in self._superfluous
