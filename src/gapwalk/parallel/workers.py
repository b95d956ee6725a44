"""Execution of independent pieces of work: in this process, on all local cores, or on a cluster.

Method: docs/numerics/notes/results.md
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, NamedTuple, Protocol, TypeVar
from warnings import warn

from gapwalk import pieces as pieces_of_work
from gapwalk.errors import WorkError
from gapwalk.model.registry import extensions
from gapwalk.parallel.processes import Processes, local_cores
from gapwalk.parallel.shared import Shared
from gapwalk.pieces import Here, around

# The progress of a job, and the time until it is done.


@dataclass(frozen=True, slots=True)
class Pace:
    """The progress of a job."""

    #: done, total: Parts of the job that are done, and all of them.
    done: int
    total: int
    before: float = 0  #: Parts that an earlier run had done; `done` includes them.
    seconds: float = 0.0  #: Time since this run began.
    within: float = 0.0  #: Sum of the shares that are done of the parts in progress.

    @property
    def share(self) -> float:
        """Share of the work that is done, from 0 to 1."""
        return min((self.done + self.within) / self.total, 1.0) if self.total else 0.0

    @property
    def rate(self) -> float | None:
        """Parts that are done in a second; None before the first."""
        new = self.done + self.within - self.before
        return new / self.seconds if new > 0 and self.seconds > 0.0 else None

    @property
    def left(self) -> float | None:
        """Seconds until the end at the present rate; None while the rate is not known."""
        rate = self.rate
        return None if rate is None else max(self.total - self.done - self.within, 0.0) / rate

    def __str__(self) -> str:
        text = f"{self.done} of {self.total}"
        if self.rate is None or self.left is None:
            return text
        speed = f"{self.rate:.3g} a second" if self.rate >= 1.0 else f"{1.0 / self.rate:.3g} s each"
        return f"{text}, {speed}, {duration(self.left)} left"


def duration(seconds: float) -> str:
    """Return a time in words."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, hours = whole // 60 % 60, whole // 3600
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {whole % 60} s"


Work = TypeVar("Work")
Result = TypeVar("Result")


class Executor(Protocol):
    """Other processes that do pieces of work, here or elsewhere; each may die while it does one."""

    @property
    def tries(self) -> int:
        """Number of times that a process may die with a piece before the piece counts as the cause."""
        ...

    @property
    def patience(self) -> float | None:
        """Seconds after which `check` is called while no result comes; None for never."""
        ...

    @property
    def size(self) -> int:
        """Number of pieces that should be in progress at the same time; 0 while there is nobody to do them."""
        ...

    def prepare(self) -> None:
        """Begin to start the processes, without waiting for them; called again for each job."""
        ...

    def begin(self, function: Shared, piece: Any) -> Future[Any]:
        """Have a piece of work done; its result, or its error, comes in the future."""
        ...

    def is_loss(self, error: BaseException) -> bool:
        """Return True if an error reports the death of the process, and not a failure of the piece of work."""
        ...

    def check(self) -> None:
        """Raise a WorkError if no further result can arrive."""
        ...

    def close(self, *, at_once: bool) -> None:
        """Disconnect from the processes; with `at_once`, without waiting for pieces in progress."""
        ...


class Workers(Here):
    """Executor of independent pieces of work, several at a time; see `local_workers`.

    Parameters
    ----------
    executor
        Executor of the pieces; None for this process.

    Examples
    --------
    >>> list(gw.parallel.Workers(None).each(abs, [-1.0, 2.0]))
    [(0, 1.0), (1, 2.0)]
    """

    def __init__(self, executor: Executor | None = None) -> None:
        self.executor = executor

    @property
    def count(self) -> int:
        """Number of pieces that are worked on at the same time."""
        return 1 if self.executor is None else max(1, self.executor.size)

    @property
    def in_progress(self) -> float:
        """Sum, over the pieces in progress, of the share that is done, as far as the pieces report it."""
        return sum(pieces_of_work.shares) + getattr(self.executor, "in_progress", 0.0)

    def prepare(self) -> None:
        """Begin to start other processes while this one prepares the pieces; `each` does so too, but later."""
        if self.executor is not None:
            self.executor.prepare()

    def each(
        self,
        function: Callable[[Work], Result],
        pieces: Sequence[Work],
        is_needed: Callable[[int], bool] = lambda index: True,
        *,
        in_order: bool = True,
    ) -> Iterator[tuple[int, Result]]:
        """Do the pieces that are needed: the index of each piece with its result.

        A piece whose process dies is done again. The caller may add pieces to the list while it reads the results.

        Parameters
        ----------
        function
            Function of a piece; importable by name, so that other processes find it.
        pieces
            The work.
        is_needed
            Called before a piece begins; False to skip it, because earlier results have made it superfluous.
        in_order
            True for results in the order of the pieces, so that nothing depends on the number of workers; otherwise
            in the order of completion.

        Yields
        ------
        index, result
            The index of a piece, and what the function returned.
        """
        modules = extensions()
        if self.executor is not None and "__main__" in modules:  # no other process runs the user's script
            kind = modules["__main__"]
            warn(
                f"only this process works: the {kind} is defined in the script or notebook itself. Define it in a file "
                "that the script imports, and other processes work too",
                stacklevel=2,
            )
        elif self.executor is not None:
            known = partial(_do_with, tuple(modules), function) if modules else function
            yield from _Run(self.executor, known, pieces, is_needed, in_order).go()
            return
        yield from super().each(function, pieces, is_needed)

    def several(self, function: Callable[[Work], Result], pieces: Sequence[Work]) -> Iterator[tuple[int, Result]]:
        """Do all pieces, in the order of completion; short ones are sent several at a time, to take a second.

        The results do not depend on that.

        Parameters
        ----------
        function, pieces
            As in `each`.

        Yields
        ------
        index, result
            The index of a piece, and what the function returned.
        """
        if self.executor is None:
            yield from self.each(function, pieces)
            return
        tasks = _Tasks(pieces, self)
        for number, (seconds, outcomes) in self.each(partial(_do_several, function), tasks, in_order=False):
            tasks.note(seconds, len(outcomes))
            for index, outcome in zip(tasks.indices[number], outcomes, strict=False):
                yield index, outcome.value()


def _do_with(modules: Sequence[str], function: Callable[[Any], Any], piece: Any) -> Any:
    """Do a piece in a process that knows all kinds (force laws, special points, studies) that were registered here."""
    for module in modules:
        try:
            import_module(module)
        except ImportError as error:
            raise WorkError(
                f"a worker cannot import {module}, which extends gapwalk ({error}): install it there, or "
                "write workers=1"
            ) from None
    return function(piece)


class _Run:
    """One call of `Workers.each` by other processes."""

    def __init__(self, executor: Executor, function, pieces, is_needed, in_order: bool) -> None:
        self._executor, self._function, self._pieces = executor, Shared(function), pieces
        self._is_needed, self._in_order = is_needed, in_order
        self._begun = self._accepted = 0
        self._again: deque[int] = deque()
        self._alone: deque[int] = deque()  # lost so often that the next try is the last one
        self._running: dict[Future[Any], int] = {}
        self._waiting: dict[int, Future[Any] | None] = {}  # for their turn; None for a piece that was not needed
        self._losses: Counter[int] = Counter()
        self._given_up: list[int] = []

    def go(self) -> Iterator[tuple[int, Any]]:
        try:
            while True:
                yield from self._begin()
                if not self._running and not self._alone and not self._is_left():
                    break
                done = wait(self._running, timeout=self._executor.patience, return_when=FIRST_COMPLETED).done
                if not self._running:  # nobody is there to do what is left
                    time.sleep(self._executor.patience or 0.0)
                if not done:
                    self._executor.check()
                for future in sorted(done, key=self._running.__getitem__):
                    yield from self._end(self._running.pop(future), future)
        finally:
            for future in self._running:
                future.cancel()
        if self._given_up and not self._in_order:
            raise self._blame(self._given_up)

    def _begin(self) -> Iterator[tuple[int, Any]]:
        """Begin as many pieces as can be in progress."""
        while len(self._running) < self._executor.size and not self._has_last_try() and self._is_left():
            if self._again:
                yield from self._begin_one(self._again.popleft())
            else:
                self._begun += 1
                yield from self._begin_one(self._begun - 1)
        while self._alone and not self._running and self._executor.size:
            yield from self._begin_one(self._alone.popleft())

    def _begin_one(self, index: int) -> Iterator[tuple[int, Any]]:
        if self._is_needed(index):
            self._running[self._executor.begin(self._function, self._pieces[index])] = index
        elif self._in_order:
            yield from self._take_in_turn(index, None)

    def _is_left(self) -> bool:
        return bool(self._again) or (self._begun < len(self._pieces) and not self._has_failed())

    def _has_failed(self) -> bool:
        """Return True if a piece waits for its turn to raise an error: nothing after it will be accepted."""
        return any(future is not None and future.exception() is not None for future in self._waiting.values())

    def _has_last_try(self) -> bool:
        """Return True if a piece is on its last try. It then runs alone, so that no other piece is to blame."""
        return any(self._losses[index] == self._executor.tries - 1 for index in self._running.values())

    def _end(self, index: int, future: Future[Any]) -> Iterator[tuple[int, Any]]:
        if future.cancelled():
            self._executor.check()
        error = None if future.cancelled() else future.exception()
        if future.cancelled() or (error is not None and self._executor.is_loss(error)):
            self._losses[index] += 1
            if self._losses[index] < self._executor.tries:
                last = self._losses[index] == self._executor.tries - 1
                (self._alone if last else self._again).append(index)
                return
            self._given_up.append(index)
            future = _failed(self._blame([index]))
        if self._in_order:
            yield from self._take_in_turn(index, future)
        elif index not in self._given_up:
            yield index, future.result()

    def _take_in_turn(self, index: int, future: Future[Any] | None) -> Iterator[tuple[int, Any]]:
        self._waiting[index] = future
        while self._accepted in self._waiting:
            future, index = self._waiting.pop(self._accepted), self._accepted
            # needed when it was begun, but perhaps no longer: the same is left out however many work at a time
            if future is not None and self._is_needed(index):
                yield index, future.result()
            self._accepted += 1

    def _blame(self, lost: list[int]) -> WorkError:
        lost = sorted(lost)
        places = ", ".join(str(index + 1) for index in lost[:5]) + (", ..." if len(lost) > 5 else "")
        return WorkError(
            f"a worker process died over piece {places} of {len(self._pieces)} at each of {self._executor.tries} "
            "tries: it was killed, or there was not enough memory; try fewer workers",
            tuple(lost),
        )


def _failed(error: Exception) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_exception(error)
    return future


@contextmanager
def local_workers(count: int | Workers | None = None) -> Iterator[Workers]:
    """Start workers for a while: local processes, or inside of `on_cluster` those of the cluster.

    Pieces in progress are abandoned at once if the block ends with an error or by Ctrl-C.

    Parameters
    ----------
    count
        Number of local processes; by default one for each local core. 1 works in this process. Workers that were
        started before are used as they are.

    Yields
    ------
    Workers
        The workers.

    Examples
    --------
    >>> with gw.parallel.local_workers(1) as workers:
    ...     options = gw.SearchOptions(starts=2, newton_starts=0)
    ...     found = gw.search(system, "frequency", [0.6], options=options, workers=workers)
    >>> len(found.found)
    1
    """
    if isinstance(count, Workers):
        yield count
        return
    if isinstance(hired := around.get(), Workers):
        yield hired
        return
    count = local_cores() if count is None else max(1, count)
    if count == 1:
        yield Workers()
        return
    with _hired(Processes(count)) as workers:
        yield workers


@contextmanager
def on_cores(count: int | None = None) -> Iterator[Workers]:
    """Use the same local processes for all work inside the `with` block, so that each starts only once.

    Parameters
    ----------
    count
        Number of local processes; by default one for each local core.

    Yields
    ------
    Workers
        The processes.

    Examples
    --------
    >>> with gw.parallel.on_cores(1):
    ...     found = gw.family(system, "frequency", (1.5, 1.6), over={"stop.clearance": [0.9, 1.0]})
    >>> len(found.members)
    2
    """
    with local_workers(count) as workers, for_all(workers):
        yield workers


@contextmanager
def on_cluster(scheduler: str) -> Iterator[Workers]:
    """Use the workers of a Dask cluster for all work inside the `with` block; see `docs/howto/cluster.md`.

    Parameters
    ----------
    scheduler
        Address of its scheduler, such as ``tcp://node7:8786``, or the name of its scheduler file, which ends with
        ``.json``.

    Yields
    ------
    Workers
        The workers of the cluster.

    Raises
    ------
    ModelError
        If Dask is not installed, no scheduler answers, or its workers cannot do the work of this version.

    Examples
    --------
    >>> try:
    ...     with gw.parallel.on_cluster("nowhere.json"):
    ...         gw.diagram(system, "frequency", (0.6, 1.0))
    ... except gw.errors.ModelError as error:
    ...     print("no cluster")
    no cluster
    """
    from gapwalk.parallel.cluster import Cluster  # it needs Dask, which is an extra

    with _hired(Cluster(scheduler)) as workers, for_all(workers):
        yield workers


@contextmanager
def _hired(executor: Executor) -> Iterator[Workers]:
    try:
        yield Workers(executor)
    except BaseException:
        executor.close(at_once=True)
        raise
    executor.close(at_once=False)


@contextmanager
def for_all(workers: Workers) -> Iterator[None]:
    """Use these workers for all work inside the `with` block."""
    token = around.set(workers)
    try:
        yield
    finally:
        around.reset(token)


# Pieces of work of which one may make others of its group superfluous: several at a time, each of another group.
#
# Pieces are accepted in their order, each only if it is needed then. Where those that are in progress at the same time
# make one another superfluous, two processes take as long as one: so whoever is free begins with another group.

# Items of work that leave further work to be done, whose costs differ much: all of it in small pieces.

Item = TypeVar("Item")
Further = TypeVar("Further")
Part = TypeVar("Part")


def do_in_stages(
    first: Callable[[Item], Result],
    items: Sequence[Item],
    further: Callable[[Item, Result], Sequence[Further]],
    second: Callable[[Further], Part],
    workers: Workers,
) -> Iterator[tuple[int, Result, list[Part]]]:
    """Do items of work, and what each of them leaves to be done: items whose costs differ much end in small pieces."""
    # What an item leaves is done before further items are begun, by whoever is free.
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


_TASK = 1.0  # seconds that a task of several pieces takes at least, if there are enough of them


def _do_several(function: Callable[[Any], Any], pieces: Sequence[Any]) -> tuple[float, list[Outcome]]:
    """Return the time of some pieces, with their outcomes up to the first error."""
    begun, found = time.perf_counter(), list[Outcome]()
    for piece in pieces:
        found.append(_attempt(function, piece))
        if found[-1].error is not None:
            break
    return time.perf_counter() - begun, found


class _Tasks(Sequence[Sequence[Any]]):
    """Pieces in their order, of which each task takes as many as the time of those before suggests."""

    def __init__(self, pieces: Sequence[Any], workers: Workers) -> None:
        self._pieces, self._workers = pieces, workers
        self.indices: list[range] = []
        self._next, self._done, self._seconds = 0, 0, 0.0

    def note(self, seconds: float, count: int) -> None:
        """Note the time of a task."""
        self._done, self._seconds = self._done + count, self._seconds + seconds

    def __len__(self) -> int:
        return len(self.indices) + (self._next < len(self._pieces))

    def __getitem__(self, number: Any) -> Any:
        if number == len(self.indices):
            left = len(self._pieces) - self._next
            # the last tasks are short, so that all workers end together
            enough = math.ceil(_TASK * self._done / self._seconds) if self._seconds > 0.0 else 1
            count = max(1, min(enough, left // (2 * self._workers.count)))
            self.indices.append(range(self._next, self._next + count))
            self._next += count
        return [self._pieces[index] for index in self.indices[number]]


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
        """Return the piece to begin: the first of a group in which nothing is undecided before it."""
        # If there is none, one whose neighbour in its group is not in progress either; else the first.
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
