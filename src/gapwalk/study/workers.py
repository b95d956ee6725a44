"""Where independent pieces of work run: in this process, or on all local cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, TypeVar

Work = TypeVar("Work")
Result = TypeVar("Result")


def local_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


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
        """
        if self.pool is None:
            for index, piece in enumerate(pieces):
                if is_needed(index):
                    accept(index, function(piece))
            return
        self._run_in_pool(self.pool, function, pieces, accept, is_needed)

    def _run_in_pool(self, pool: ProcessPoolExecutor, function, pieces, accept, is_needed) -> None:
        running: dict[Future[Any], int] = {}
        done: dict[int, Any] = {}
        begun, accepted = 0, 0
        while accepted < len(pieces):
            while begun < len(pieces) and len(running) < self.count:
                if is_needed(begun):
                    running[pool.submit(function, pieces[begun])] = begun
                else:
                    done[begun] = None
                begun += 1
            while accepted in done:
                result = done.pop(accepted)
                # needed when it was begun, but perhaps no longer: the same is left out however many work at a time
                if result is not None and is_needed(accepted):
                    accept(accepted, result)
                accepted += 1
            if running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    done[running.pop(future)] = future.result()


@contextmanager
def workers(count: int | None = None) -> Iterator[Workers]:
    """Workers for a while: as many as there are local cores, or `count`; 1 works in this process.

    Processes are started afresh (not forked), because the compiled flows of a forked process are not its own.
    """
    count = local_cores() if count is None else max(1, count)
    if count == 1:
        yield Workers(None, 1)
        return
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
    try:
        yield Workers(pool, count)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
