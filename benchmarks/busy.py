"""Processes whose CPU time is measured, to see how evenly they share a job, even on a machine that others use too."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from gapwalk.parallel.processes import Processes
from gapwalk.parallel.shared import Shared


class MeasuredProcesses(Processes):
    """Local processes that report the CPU time of each piece of work.

    Attributes
    ----------
    busy
        CPU seconds of each process, by its id: its start and its pieces.
    """

    def __init__(self, count: int) -> None:
        super().__init__(count)
        self.busy: Counter[int] = Counter()

    def begin(self, function: Shared, piece: Any) -> Future[Any]:
        """Give a piece to an idle process."""
        inner, outer = super().begin(Shared(partial(_measured, function.function)), piece), Future[Any]()

        def finish(future: Future[Any]) -> None:
            if future.cancelled():
                outer.cancel()
            elif error := future.exception():
                outer.set_exception(error)
            else:
                process, used, result = future.result()
                self.busy[process] = max(self.busy[process], used)
                outer.set_result(result)

        inner.add_done_callback(finish)
        return outer


def _measured(function: Callable[[Any], Any], piece: Any) -> tuple[int, float, Any]:
    """Do a piece of work; return the process, its CPU time so far, and the result."""
    result = function(piece)
    return os.getpid(), time.process_time(), result
