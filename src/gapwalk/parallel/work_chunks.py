"""Do many small independent items of work in chunks, and estimate the time until a job is done."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.parallel.workers import Workers


@dataclass(frozen=True, slots=True)
class Pace:
    """The progress of a job.

    Attributes
    ----------
    done, total
        Parts of the job that are done, and all of them.
    before
        Parts that an earlier run had done; `done` includes them.
    seconds
        Time since this run began.

    Examples
    --------
    >>> gw.parallel.Pace(done=30, total=100, before=10, seconds=5.0).rate
    4.0
    """

    done: int
    total: int
    before: int = 0
    seconds: float = 0.0

    @property
    def rate(self) -> float | None:
        """Parts that are done in a second; None before the first."""
        new = self.done - self.before
        return new / self.seconds if new > 0 and self.seconds > 0.0 else None

    @property
    def left(self) -> float | None:
        """Seconds until the end at the present rate; None while the rate is not known."""
        rate = self.rate
        return None if rate is None else (self.total - self.done) / rate

    def __str__(self) -> str:
        text = f"{self.done} of {self.total}"
        if self.rate is None or self.left is None:
            return text
        speed = f"{self.rate:.3g} a second" if self.rate >= 1.0 else f"{1.0 / self.rate:.3g} s each"
        return f"{text}, {speed}, {_duration(self.left)} left"


def _duration(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, hours = whole // 60 % 60, whole // 3600
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {whole % 60} s"


Item = TypeVar("Item")
Result = TypeVar("Result")
Further = TypeVar("Further")
Part = TypeVar("Part")

Function = Callable[[Sequence[Item], Sequence[np.random.SeedSequence]], Sequence[Result]]
"""Does some items, each with a seed of its own, and returns a result for each; importable by name."""

_LEAST, _AIM = 0.1, 0.5  # seconds of work in a chunk: at least, and what is aimed at
_GROWTH = 16  # at most, from one chunk to the next: the first one may have waited for a compiler


def _do_chunk(
    function: Function[Item, Result], seed: int, chunk: tuple[int, Sequence[Item]]
) -> tuple[list[Result], float]:
    """Do some items in a row, given with the number of the first; their results, and the seconds that it took."""
    begun, (first, items) = time.perf_counter(), chunk
    # the seed of an item is always the same, in whatever chunk and by whomever it is done
    seeds = [np.random.SeedSequence(seed, spawn_key=(number,)) for number in range(first, first + len(items))]
    results = list(function(items, seeds))
    if len(results) != len(items):
        raise ValueError(f"{len(items)} items have {len(results)} results")
    return results, time.perf_counter() - begun


def do_in_chunks(
    function: Function[Item, Result],
    items: Sequence[Item],
    workers: Workers,
    *,
    seed: int = 0,
    size: int | None = None,
    known: Mapping[int, Result] | None = None,
    keep: Callable[[int, Sequence[Result]], object] | None = None,
    report: Callable[[Pace], object] | None = None,
) -> dict[int, Result]:
    """Do many small items of work; the results do not depend on the workers nor on the chunks.

    Ctrl-C ends the work; finished chunks are kept.

    Parameters
    ----------
    function
        Function of the items of a chunk.
    items
        The items.
    workers
        Executor of the work.
    seed
        Seed from which the seed of each item is derived.
    size
        Items in a chunk; by default as many as take about half a second, estimated from earlier chunks.
    known
        Results that exist already, by the number of their item; these are not computed again.
    keep
        Called with the number of the first item of a chunk and the results when they come: a store writes them here.
    report
        Called after each chunk.

    Returns
    -------
    dict
        The results by the number of their item, in order; all of them unless the work was stopped.

    Raises
    ------
    ModelError
        If the size is none.
    WorkError
        If the processes die over a chunk. All others have been kept by then.
    """
    if size is not None and (isinstance(size, bool) or not isinstance(size, int) or size < 1):
        raise ModelError(f"size is {size!r}; it must be an integer >= 1 (items in a chunk), or None")
    results = dict(known or {})
    before, begun = len(results), time.monotonic()
    cutter = _Cutter(items, set(results), size, workers)
    chunks = cutter.chunks

    def is_needed(number: int) -> bool:
        if number == len(chunks) - 1:
            cutter.cut()  # there is always one more, of a size that is up to date
        return True

    try:
        cutter.cut()
        done = workers.each(partial(_do_chunk, function, seed), chunks, is_needed, in_order=False)
        for number, (found, seconds) in done:
            first, _ = chunks[number]
            cutter.learn(len(found), seconds)
            if keep is not None:
                keep(first, found)
            results.update(enumerate(found, start=first))
            if report is not None:
                report(Pace(len(results), len(items), before, time.monotonic() - begun))
    except KeyboardInterrupt:
        pass
    return dict(sorted(results.items()))


class _Cutter:
    """Cuts items into chunks, one at a time: the number of the first item, and the items."""

    def __init__(self, items: Sequence[Any], known: set[int], size: int | None, workers: Workers) -> None:
        self.chunks: list[tuple[int, Sequence[Any]]] = []
        self._items, self._known, self._size, self._workers = items, known, size, workers
        self._next, self._left = 0, len(items) - len(known)
        self._wanted, self._least = 1, 1

    def learn(self, count: int, seconds: float) -> None:
        """Update the estimate of the time per item by the time of a chunk."""
        each = max(seconds, 1e-9) / count
        self._least = min(_GROWTH * count, math.ceil(_LEAST / each))
        self._wanted = min(_GROWTH * count, math.ceil(_AIM / each))

    def cut(self) -> None:
        """Add the next chunk, if there is any: items in a row that are not known.

        Towards the end a chunk has only a share of the rest, so that all workers end at the same time.
        """
        while self._next in self._known:
            self._next += 1
        share = math.ceil(self._left / (2 * self._workers.count))
        size, stop = self._size or max(1, self._least, min(self._wanted, share)), self._next
        while stop < min(self._next + size, len(self._items)) and stop not in self._known:
            stop += 1
        if stop > self._next:
            self.chunks.append((self._next, tuple(self._items[self._next : stop])))
            self._left -= stop - self._next
            self._next = stop


def do_in_stages(
    first: Callable[[Item], Result],
    items: Sequence[Item],
    further: Callable[[Item, Result], Sequence[Further]],
    second: Callable[[Further], Part],
    workers: Workers,
) -> Iterator[tuple[int, Result, list[Part]]]:
    """Do items of work, and what each of them leaves to be done: items whose costs differ much end in small pieces.

    What an item leaves is done before further items are begun, by whoever is free.

    Parameters
    ----------
    first, second
        Functions of an item, and of a piece of what it leaves; importable by name.
    items
        The items.
    further
        Returns the pieces that an item leaves, given its result; called in this process.
    workers
        Executor of the work.

    Yields
    ------
    index, result, parts
        The index of an item, what `first` returned, and what `second` returned for each of its pieces; in the order of
        completion.

    Raises
    ------
    WorkError
        If the processes die over an item. All others have been yielded by then.
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
