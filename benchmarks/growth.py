"""How the time of one forcing period, and that of compiling, grow with the degrees of freedom."""

from __future__ import annotations

import numpy as np

from benchmarks.chain import ScipyChain, chain
from benchmarks.compiling import cold_seconds
from benchmarks.effort import Effort
from benchmarks.row import Row
from benchmarks.stopwatch import fastest, side_by_side
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of

GROUP = "One forcing period of a chain of masses with one stop"
_SETTLE = 60  # forcing periods, so that the mass meets the stop as in steady motion
_AGREE = 1e-6


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    return [row for size in effort.sizes for row in measure_chain(size, effort)]


def measure_chain(size: int, effort: Effort) -> list[Row]:
    """Measure the time of a period, state alone and with the transition matrix, and of compiling without a cache."""
    system, peer = chain(size), ScipyChain(size)
    coefficients, start = coefficients_of(system), np.zeros(2 * size)
    plain, full = flow_of(system), flow_of(system, transition=True)
    for _ in range(_SETTLE):
        start = plain.integrate(coefficients, start).state

    def ours():
        return plain.integrate(coefficients, start)

    def theirs():
        return peer.period(start)

    difference = float(np.abs(ours().state - theirs()).max())
    if not difference < _AGREE:
        raise RuntimeError(f"gapwalk and SciPy differ by {difference:.3g}")
    state, baseline = side_by_side([ours, theirs], effort)
    transition = fastest(lambda: full.integrate(coefficients, start), effort)
    what, counts = f"{size} masses", {"equations": 2 * size, "contact events": len(ours().contacts)}
    equations = {"equations": 2 * size * (2 * size + 1)}
    return [
        Row(GROUP, f"{what}: state", state, baseline, "DOP853", counts=counts),
        Row(GROUP, f"{what}: state, transition matrix", transition, counts=equations),
        Row(GROUP, f"{what}: compile the first, cold", cold_seconds(lambda: flow_of(system))),
        Row(GROUP, f"{what}: compile the second, cold", cold_seconds(lambda: flow_of(system, transition=True))),
    ]
