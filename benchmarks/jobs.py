"""Whole jobs on one and on two processes: CPU time of who works longest, and wall time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import gapwalk as gw
from benchmarks.busy import MeasuredProcesses
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from gapwalk import System, paper
from gapwalk.parallel.workers import Workers, local_workers

GROUP = "Whole jobs on two processes, CPU time of this process and of the busier of the two"
_BOX = {"q1": (-4.0, 4.0), "q1'": (-4.0, 4.0)}
_PLANE = {"frequency": (0.3, 1.2), "harmonic1.amplitude": (0.2, 0.8)}
_SAMPLES = 16  # per column of a regime map
_RATIO = 1.6


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
        _measure("map of loci, figure 27", _map),
        _measure(f"tolerances, {_SAMPLES * size} samples", lambda workers: _tolerance(_SAMPLES * size, workers)),
    ]


def _sweep(system: System, values: int, workers: Workers) -> object:
    options = {"steps": values, "ways": "again", "starts": 8}
    return gw.sweep(system, "frequency", (0.3, 1.2), **options, workers=workers)


def _map(workers: Workers) -> object:
    plane = {"frequency": (0.25, 0.35), "mean.q1": (0.2, 0.3)}
    options = {"sections": 4, "max_period": 2}
    return gw.bifurcation_map(paper.case("27"), plane, **options, workers=workers)


def _tolerance(samples: int, workers: Workers) -> object:
    """Vary a mass on a spring that touches a soft stop near its resonance."""
    stop = gw.stop("stop", {"x": 1.0}, 1.0, 0.05)
    load = gw.Harmonic(0.15, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], [[0.1]], [[1.0]], contacts=[stop], harmonics=[load], frequency=0.5)
    laws = [gw.ask.Spread("stop.clearance", sd=0.03), gw.ask.Spread("harmonic1.amplitude", sd=0.005)]
    options = {"samples": samples, "check": 8}
    return gw.ask.tolerance(system, "frequency", (0.5, 1.5), laws, **options, workers=workers)


def _measure(what: str, work: Callable[[Workers], object]) -> Row:
    begun, waited = time.perf_counter(), os.getloadavg()[0]
    wall, alone = _alone(work)
    shared, together = _together(work)
    load = max(waited, os.getloadavg()[0])
    counts = {"wall ratio": round(wall / shared, 2), "load": round(load, 1), "took": round(time.perf_counter() - begun)}
    note = (
        f"{wall:.3g} s of wall time by one process, {shared:.3g} s by two: {wall / shared:.2f} times as fast, which "
        f"says something only while two cores are free (load before or after: {load:.1f}). CPU times leave out where "
        "one waits for the other, and the start of the processes beside the first steps of a job"
    )
    return Row(GROUP, what, together, alone, "one process", (Target(_RATIO, "ratio"),), counts, note)


def _alone(work: Callable[[Workers], object]) -> tuple[float, float]:
    """Return wall and CPU seconds of a job in this process."""
    begun, used = time.perf_counter(), time.process_time()
    with local_workers(1) as workers:
        work(workers)
    return time.perf_counter() - begun, time.process_time() - used


def _together(work: Callable[[Workers], object]) -> tuple[float, float]:
    """Return wall seconds of a job on two processes, and the CPU seconds of the busier one and of this process."""
    begun, used = time.perf_counter(), time.process_time()
    processes = MeasuredProcesses(2)
    try:
        work(Workers(processes))
    finally:
        processes.close(at_once=False)
    own = time.process_time() - used
    return time.perf_counter() - begun, own + max(processes.busy.values(), default=0.0)
