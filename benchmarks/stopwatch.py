"""Measurement of CPU time on shared machines: the least of many short measurements, taken in turns."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from benchmarks.effort import Effort

Work = Callable[[], Any]

_LONG = 0.5  # CPU seconds of a single call above which few repeats suffice
_FEW = 3


def fastest(work: Work, effort: Effort) -> float:
    """Return the CPU seconds of one call, the least of several measurements."""
    return side_by_side([work], effort)[0]


def side_by_side(works: list[Work], effort: Effort) -> list[float]:
    """Return the CPU seconds of one call of each, measured in turns so that noise affects all of them alike."""
    sizes = [_calls_a_burst(work, effort.burst) for work in works]
    least = [float("inf")] * len(works)
    for repeat in range(effort.repeats):
        for index, (work, calls) in enumerate(zip(works, sizes, strict=True)):
            if repeat < _FEW or least[index] * calls < _LONG:
                least[index] = min(least[index], cpu_seconds(work, calls))
    return least


def cpu_seconds(work: Work, calls: int = 1) -> float:
    """Return the CPU seconds of one call, of this process and all its threads, averaged over some calls."""
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls


def _calls_a_burst(work: Work, burst: float) -> int:
    work()
    return max(1, round(burst / max(cpu_seconds(work), 1e-9)))
