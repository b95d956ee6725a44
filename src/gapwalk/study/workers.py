"""Where independent pieces of work run: in this process, or on all local cores."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType
from typing import Any, TypeVar

from gapwalk.errors import NumericalError

Work = TypeVar("Work")
Result = TypeVar("Result")

_SUPERFLUOUS = object()


def local_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Workers:
    """Does independent pieces of work in order, several at a time; see `workers`."""

    def __init__(self, pool: ProcessPoolExecutor | None, count: int) -> None:
        self.pool, self.count = pool, count

    def run(
        self,
        function: Callable[[Work], Result],
        pieces: Sequence[Work],
        accept: Callable[[int, Result], None],
        is_needed: Callable[[int], bool] = lambda index: True,
    ) -> None:
        """Do the pieces that are needed, and hand each result to `accept` in the order of the pieces.

        Parameters
        ----------
        function
            What to do with a piece; importable by name, so that other processes find it.
        pieces
            The work.
        accept
            Takes the index of a piece and its result; called in the order of the indices, in this process.
        is_needed
            Asked before a piece is begun: what has been accepted by then may have made it superfluous.

        Raises
        ------
        NumericalError
            If one of the other processes dies.
        """
        if self.pool is None:
            for index, piece in enumerate(pieces):
                if is_needed(index):
                    accept(index, function(piece))
            return
        try:
            self._run_in_pool(self.pool, function, pieces, accept, is_needed)
        except BrokenProcessPool:
            raise NumericalError(
                "a worker process died: it was killed, or there was not enough memory; try fewer workers"
            ) from None

    def _run_in_pool(self, pool: ProcessPoolExecutor, function, pieces, accept, is_needed) -> None:
        running: dict[Future[Any], int] = {}
        done: dict[int, Any] = {}
        begun, accepted = 0, 0
        while accepted < len(pieces):
            while begun < len(pieces) and len(running) < self.count:
                if is_needed(begun):
                    with _undisturbed():
                        running[pool.submit(function, pieces[begun])] = begun
                else:
                    done[begun] = _SUPERFLUOUS
                begun += 1
            while accepted in done:
                result = done.pop(accepted)
                # needed when it was begun, but perhaps no longer: the same is left out however many work at a time
                if result is not _SUPERFLUOUS and is_needed(accepted):
                    accept(accepted, result)
                accepted += 1
            if running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    done[running.pop(future)] = future.result()


@contextmanager
def workers(count: int | None = None) -> Iterator[Workers]:
    """Workers for a while: as many as there are local cores, or `count`; 1 works in this process.

    Processes are started afresh (not forked), because the compiled flows of a forked process are not its own. They die
    with this one, however it dies, and at once if it gives up.
    """
    count = local_cores() if count is None else max(1, count)
    if count == 1:
        yield Workers(None, 1)
        return
    context = get_context("spawn")
    held, leash = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(count, context, initializer=_live_on_a_leash, initargs=(held,))
    try:
        yield Workers(pool, count)
    except BaseException:
        leash.close()  # what is being worked on is not waited for
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        leash.close()
        held.close()


def _live_on_a_leash(held: Any) -> None:
    """End this process when the other end of the leash is closed, which the death of its holder does too."""

    def wait_for_the_end() -> None:
        held.poll(None)
        os._exit(1)

    threading.Thread(target=wait_for_the_end, daemon=True).start()


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Processes that are started inside do not see Ctrl-C, which is for this one; nor do they run the user's script.

    Spawned processes import the main script, so it would have to guard its last lines by ``if __name__ == ...``. The
    pieces of work need nothing of it.
    """
    main, blocks = sys.modules["__main__"], hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if blocks else set()
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
