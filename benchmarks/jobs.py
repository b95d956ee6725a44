"""Wall time of whole jobs on one and on two processes, including the start of the processes and compiling."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import gapwalk as gw
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from gapwalk import System, paper
from gapwalk.parallel.workers import Workers, local_workers

GROUP = "Whole jobs of figure 15 on two processes, wall time"
_BOX = {"q1": (-4.0, 4.0), "q1'": (-4.0, 4.0)}
_PLANE = {"frequency": (0.3, 1.2), "harmonic1.amplitude": (0.2, 0.8)}


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    system, size = paper.case("15"), effort.cells
    slow, many = system.at(frequency=0.45), 4 * size
    return [
        _measure(
            f"regime map, {size} x {size} cells", lambda workers: gw.regimes(system, _PLANE, size, workers=workers)
        ),
        _measure(f"basins, {many} x {many} cells", lambda workers: gw.basins(slow, _BOX, many, workers=workers)),
        _measure(f"sweep, {size} values, each from 8 starts", lambda workers: _sweep(system, size, workers)),
    ]


def _sweep(system: System, values: int, workers: Workers) -> object:
    options = gw.SweepOptions(steps=values, ways="again", starts=8)
    return gw.sweep(system, "frequency", (0.3, 1.2), options=options, workers=workers)


def _measure(what: str, work: Callable[[Workers], object]) -> Row:
    begun, waited = time.perf_counter(), os.getloadavg()[0]
    one = _wall(work, 1)
    two = _wall(work, 2)
    load = max(waited, os.getloadavg()[0])
    note = f"says something only while two cores are free (load before or after: {load:.1f})"
    counts = {"load": round(load, 1), "took": round(time.perf_counter() - begun)}
    return Row(GROUP, what, two, one, "one process", (Target(1.8, "ratio"),), counts, note)


def _wall(work: Callable[[Workers], object], count: int) -> float:
    begun = time.perf_counter()
    with local_workers(count) as workers:
        work(workers)
    return time.perf_counter() - begun
