"""Pieces of work of which one may make others of its group superfluous: several at a time, each of another group.

Pieces are accepted in their order, each only if it is needed then. Where those that are in progress at the same time
make one another superfluous, two processes take as long as one: so whoever is free begins with another group.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

from gapwalk.errors import WorkError
from gapwalk.parallel.workers import Workers

# Items of work that leave further work to be done, whose costs differ much: all of it in small pieces.

Item = TypeVar("Item")
Result = TypeVar("Result")
Further = TypeVar("Further")
Part = TypeVar("Part")


def do_in_stages(
    first: Callable[[Item], Result],
    items: Sequence[Item],
    further: Callable[[Item, Result], Sequence[Further]],
    second: Callable[[Further], Part],
    workers: Workers,
) -> Iterator[tuple[int, Result, list[Part]]]:
    """Do items of work, and what each of them leaves to be done: items whose costs differ much end in small pieces.

    What an item leaves is done before further items are begun, by whoever is free.
    """
    queue: _StageQueue = _StageQueue(items)
    results: dict[int, Result] = {}
    parts: dict[int, dict[int, Part]] = {}
    counts: dict[int, int] = {}
    for number, found in workers.each(partial(_do_stage, first, second), queue, in_order=False):
        index, place = queue.origin(number)
        if place is None:
            left = further(items[index], found)
            results[index], parts[index], counts[index] = found, {}, len(left)
            queue.add(index, left)
        else:
            parts[index][place] = found
        if len(parts[index]) == counts[index]:
            own = parts.pop(index)
            yield index, results.pop(index), [own[k] for k in range(len(own))]


def _do_stage(first: Callable[[Any], Any], second: Callable[[Any], Any], piece: tuple[bool, Any]) -> Any:
    is_first, item = piece
    return first(item) if is_first else second(item)


class _StageQueue(Sequence[tuple[bool, Any]]):
    """Pieces whose order is decided when each begins: what earlier items have left, then the next item."""

    def __init__(self, items: Sequence[Any]) -> None:
        self._items, self._next = items, 0
        self._left: deque[tuple[int, int, Any]] = deque()
        self._begun: list[tuple[int, int | None, Any]] = []

    def add(self, index: int, pieces: Sequence[Any]) -> None:
        """Add the pieces that an item has left."""
        self._left += [(index, place, piece) for place, piece in enumerate(pieces)]

    def origin(self, number: int) -> tuple[int, int | None]:
        """Return the index of the item of a piece, and its place among those that the item has left; else None."""
        return self._begun[number][:2]

    def __len__(self) -> int:
        return len(self._begun) + len(self._left) + len(self._items) - self._next

    def __getitem__(self, number: Any) -> Any:
        if number == len(self._begun):
            if self._left:
                self._begun.append(self._left.popleft())
            else:
                self._begun.append((self._next, None, self._items[self._next]))
                self._next += 1
        _, place, piece = self._begun[number]
        return place is None, piece


Piece = TypeVar("Piece")

_AHEAD = 64  # pieces after the one whose turn it is, among which the next one to begin is chosen


def do_by_groups(
    function: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    groups: Sequence[Hashable],
    is_needed: Callable[[int], bool],
    workers: Workers,
) -> Iterator[tuple[int, Result]]:
    """Do the pieces that are needed, in their order; those in progress are of different groups, if possible."""
    queue = _GroupQueue(pieces, groups, is_needed)
    for number, outcome in outcomes(function, queue, workers):
        queue.take(number, outcome)
        yield from queue.in_turn()


class Outcome(NamedTuple):
    """What a function returned for a piece, or the error that it raised."""

    result: Any
    error: Exception | None = None

    def value(self) -> Any:
        """Return the result, or raise the error."""
        if self.error is not None:
            raise self.error
        return self.result


def outcomes(function: Callable[[Any], Any], pieces: Sequence[Any], workers: Workers) -> Iterator[tuple[int, Outcome]]:
    """Do pieces of which some may prove superfluous: an error counts only if its piece is needed."""
    try:
        yield from workers.each(partial(_attempt, function), pieces, in_order=False)
    except WorkError as error:
        if not error.pieces:
            raise
        yield from ((number, Outcome(None, error)) for number in error.pieces)


def _attempt(function: Callable[[Any], Any], piece: Any) -> Outcome:
    try:
        return Outcome(function(piece))
    except Exception as error:
        return Outcome(None, error)


class _GroupQueue(Sequence[Any]):
    """Pieces whose order is decided when each begins."""

    def __init__(self, pieces: Sequence[Any], groups: Sequence[Hashable], is_needed: Callable[[int], bool]) -> None:
        self._pieces, self._groups, self._is_needed = pieces, groups, is_needed
        self._begun: list[int] = []
        self._outcomes: dict[int, Outcome] = {}
        self._turn = 0
        self._superfluous: set[int] = set()

    def take(self, number: int, outcome: Outcome) -> None:
        """Take the outcome of a piece."""
        self._outcomes[self._begun[number]] = outcome

    def in_turn(self) -> Iterator[tuple[int, Any]]:
        """Yield the next pieces that are done and needed; raise the error of one of them."""
        while self._turn < len(self._pieces):
            if self._is_left_out(self._turn):
                self._outcomes.pop(self._turn, None)
            elif self._turn in self._outcomes:
                yield self._turn, self._outcomes.pop(self._turn).value()
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
        """Return the piece to begin: the first of a group in which nothing is undecided before it.

        If there is none, one whose neighbour in its group is not in progress either; else the first.
        """
        begun, undecided = set(self._begun), dict[Hashable, int]()
        others: list[tuple[bool, int]] = []
        for k in range(self._turn, min(self._turn + _AHEAD, len(self._pieces))):
            if k not in begun and self._is_left_out(k):
                continue
            before = undecided.get(self._groups[k])
            undecided[self._groups[k]] = k
            if k in begun:
                continue
            if before is None:
                return k
            others.append((before in begun and before not in self._outcomes, k))
        return min(others)[1] if others else None

    def _is_left_out(self, index: int) -> bool:
        if index not in self._superfluous and not self._is_needed(index):
            self._superfluous.add(index)
        return index in self._superfluous
