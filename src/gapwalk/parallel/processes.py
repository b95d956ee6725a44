"""Processes on this machine that do pieces of work: if one dies, only the piece it was working on is lost."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType
from typing import Any

from gapwalk.parallel.threads import children_in_one_thread

_starting = threading.Lock()  # what a process inherits is changed for this process as a whole


def local_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Processes:
    """Some processes on this machine; a `Executor`.

    Each is a pool of its own: in a larger pool the death of one process ends all the others. They are spawned
    (not forked), because the compiled flows of a forked process are not its own. They die with this one, however it
    dies.

    Parameters
    ----------
    count
        How many; each is started when it is first needed.
    """

    tries = 3
    """How often a process may die over one piece of work before the piece is to blame."""

    patience = None
    """There is nothing to look after while waiting for a result."""

    def __init__(self, count: int) -> None:
        self.size = count
        self._context = get_context("spawn")
        self._held, self._control = self._context.Pipe(duplex=False)
        self._pools = [self._pool() for _ in range(count)]
        self._last: list[Future[Any] | None] = [None] * count

    def begin(self, function: Callable[[Any], Any], piece: Any) -> Future[Any]:
        """Give a piece to an idle process; all are busy only with what was given up before."""
        places = range(self.size)
        place = next((i for i in places if (last := self._last[i]) is None or last.done()), 0)
        try:
            future = self._submit(place, function, piece)
        except BrokenProcessPool:  # it has died: with its last piece, or while it had none
            self._pools[place].shutdown(wait=False)
            self._pools[place] = self._pool()
            future = self._submit(place, function, piece)
        self._last[place] = future
        return future

    def is_loss(self, error: BaseException) -> bool:
        """Return True if an error says that a process died, and nothing of its piece of work."""
        return isinstance(error, BrokenProcessPool)

    def check(self) -> None:
        """Processes that have died are replaced when they are needed."""

    def close(self, *, at_once: bool) -> None:
        """End the processes; `at_once` what is being worked on is not waited for."""
        if at_once:
            self._control.close()
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)
        self._control.close()
        self._held.close()

    def _pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, self._context, initializer=end_with_holder, initargs=(self._held,))

    def _submit(self, place: int, function: Callable[[Any], Any], piece: Any) -> Future[Any]:
        with undisturbed():
            return self._pools[place].submit(function, piece)


def end_with_holder(held: Any) -> None:
    """End this process when the other end of the control is closed, which the death of its holder does too."""

    def wait_for_the_end() -> None:
        held.poll(None)
        os._exit(1)

    threading.Thread(target=wait_for_the_end, daemon=True).start()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Processes that are started inside do not see Ctrl-C, which is for this one; nor do they run the user's script.

    Spawned processes import the main script, so it would have to guard its last lines by ``if __name__ == ...``. The
    pieces of work need nothing of it.
    """
    blocks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if blocks else set()
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
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
