"""Items of work that leave further work to be done, whose costs differ much: all of it in small pieces."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, TypeVar

from gapwalk.parallel.workers import Workers

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
