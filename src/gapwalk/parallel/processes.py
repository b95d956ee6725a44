"""Processes on this machine that do pieces of work: if one dies, only the piece it was working on is lost."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType
from typing import Any

from gapwalk import pieces
from gapwalk.parallel.shared import Shared, do_shared
from gapwalk.parallel.threads import THREAD_VARIABLES, children_in_one_thread

METHOD = "forkserver" if sys.platform == "linux" else "spawn"
"""How processes start."""

_starting = threading.Lock()  # what a process inherits is changed for this process as a whole


def local_cores() -> int:
    """Return the number of cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Processes:
    """Some processes on this machine; a `Executor`.

    Each is a separate pool, because in a larger pool the death of one process ends all the others. They are not forked
    from this process, because the compiled flows of a forked process are not its own. On Linux they are forked from a
    server that has only loaded what this process has loaded of gapwalk, so that each takes some hundredths of a second
    instead of seconds to start; the server ends with this process. They die with this one, however it dies.
    """

    tries = 3
    """How often a process may die over one piece of work before the piece is to blame."""

    patience = None
    """There is nothing to look after while waiting for a result."""

    def __init__(self, count: int) -> None:
        self.size = count
        self._context = get_context(METHOD)
        self._held, self._control = self._context.Pipe(duplex=False)
        self._shares = self._context.RawArray("d", count)
        self._pools = [self._pool(place) for place in range(count)]
        self._last: list[Future[Any] | None] = [None] * count
        self._has = [b""] * count  # the function that each process was sent last

    def prepare(self) -> None:
        """Start the server, unless there is one; it loads gapwalk while this process prepares the first piece."""
        # Once there is a server it stays as it is, with what it has loaded. So it starts as late as possible: when work
        # begins, and the modules of that work are loaded here; or earlier, where the work is foreseen (`start_server`).
        start_server(sorted(name for name in sys.modules if name.startswith("gapwalk.")))

    def begin(self, function: Shared, piece: Any) -> Future[Any]:
        """Give a piece to an idle process; if none is idle, all are busy only with abandoned pieces."""
        self.prepare()
        places = range(self.size)
        place = next((i for i in places if (last := self._last[i]) is None or last.done()), 0)
        try:
            future = self._submit(place, function, piece)
        except BrokenProcessPool:  # it has died: with its last piece, or while it had none
            self._pools[place].shutdown(wait=False)
            self._pools[place], self._has[place] = self._pool(place), b""
            future = self._submit(place, function, piece)
        self._last[place] = future
        return future

    def is_loss(self, error: BaseException) -> bool:
        """Return True if an error reports the death of a process, and not a failure of its piece of work."""
        return isinstance(error, BrokenProcessPool)

    def check(self) -> None:
        """Do nothing, because processes that have died are replaced when needed."""

    def close(self, *, at_once: bool) -> None:
        """End the processes; with `at_once`, without waiting for pieces in progress."""
        if at_once:
            self._control.close()
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)
        self._control.close()
        self._held.close()

    @property
    def in_progress(self) -> float:
        """Number of pieces of which the shares that are done would make up."""
        return sum(self._shares)

    def _pool(self, place: int) -> ProcessPoolExecutor:
        about = self._held, dict(os.environ), self._shares, place
        return ProcessPoolExecutor(1, self._context, initializer=_begin, initargs=about)

    def _submit(self, place: int, function: Shared, piece: Any) -> Future[Any]:
        packed = None if self._has[place] == function.key else function.packed
        with undisturbed():
            future = self._pools[place].submit(do_shared, function.key, packed, piece)
        self._has[place] = function.key
        return future


def start_server(modules: Sequence[str]) -> None:
    """Begin to start the server from which processes are forked, unless there is one; on Linux."""
    if METHOD == "forkserver":
        from multiprocessing import forkserver, resource_tracker

        resource_tracker.ensure_running()  # where it is started first, it lets Ctrl-C through to what starts next
        get_context("forkserver").set_forkserver_preload([*modules, "gapwalk.parallel.in_use"])
        with undisturbed():
            forkserver.ensure_running()


def _begin(held: Any, environment: Mapping[str, str], shares: Any, place: int) -> None:
    """Begin a process: with the environment of its holder, whose server may have an older one; it ends with it."""
    pieces.shares, pieces.place = shares, place
    kept = {name: value for name, value in os.environ.items() if name in THREAD_VARIABLES}
    os.environ.clear()
    os.environ.update({**kept, **environment})
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the holder, which says what is to end
    end_with_holder(held)


def end_with_holder(held: Any) -> None:
    """End this process when the process that started it closes the connection, or dies."""

    def wait_for_the_end() -> None:
        held.poll(None)
        os._exit(1)

    threading.Thread(target=wait_for_the_end, daemon=True).start()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Start processes inside this block so that they ignore Ctrl-C and do not run the user's script."""
    # Spawned processes import the main script, so it would have to guard its last lines by ``if __name__ == ...``. The
    # pieces of work need nothing of it.
    before = set() if sys.platform == "win32" else signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _starting:
            main = sys.modules["__main__"]
            sys.modules["__main__"] = ModuleType("__main__")
            try:
                with children_in_one_thread():
                    yield
            finally:
                sys.modules["__main__"] = main
    finally:
        if sys.platform != "win32":
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
