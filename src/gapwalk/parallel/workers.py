"""Execution of independent pieces of work: in this process, on all local cores, or on a cluster.

Method: docs/numerics/results.md
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Protocol, TypeVar
from warnings import warn

from gapwalk.errors import WorkError
from gapwalk.model.registry import extensions
from gapwalk.parallel.processes import Processes, local_cores

# The progress of a job, and the time until it is done.


@dataclass(frozen=True, slots=True)
class Pace:
    """The progress of a job."""

    #: done, total: Parts of the job that are done, and all of them.
    done: int
    total: int
    before: int = 0  #: Parts that an earlier run had done; `done` includes them.
    seconds: float = 0.0  #: Time since this run began.

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

    def begin(self, function: Callable[[Any], Any], piece: Any) -> Future[Any]:
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


class Workers:
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

        A piece whose process dies is done again. The pieces may become more while they are done.

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
        index = 0
        while index < len(pieces):
            if is_needed(index):
                yield index, function(pieces[index])
            index += 1

    def run(
        self,
        function: Callable[[Work], Result],
        pieces: Sequence[Work],
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


def _do_with(modules: Sequence[str], function: Callable[[Any], Any], piece: Any) -> Any:
    """Do a piece in a process that knows all kinds (force laws, special points, studies) that were registered here."""
    for module in modules:
        try:
            import_module(module)
        except ImportError as error:
            raise WorkError(
                f"a worker cannot import {module}, which registers a kind ({error}): install it there, or "
                "write workers=1"
            ) from None
    return function(piece)


class _Run:
    """One call of `Workers.each` by other processes."""

    def __init__(self, executor: Executor, function, pieces, is_needed, in_order: bool) -> None:
        self._executor, self._function, self._pieces = executor, function, pieces
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


_around: ContextVar[Workers | None] = ContextVar("workers", default=None)


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
    around = _around.get()
    if around is not None:
        yield around
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
    with local_workers(count) as workers, _for_all(workers):
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

    with _hired(Cluster(scheduler)) as workers, _for_all(workers):
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
def _for_all(workers: Workers) -> Iterator[None]:
    """Use these workers for all work inside the `with` block."""
    token = _around.set(workers)
    try:
        yield
    finally:
        _around.reset(token)
