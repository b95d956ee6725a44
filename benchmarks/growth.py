"""How the time of one forcing period, and that of making flows, grow with the degrees of freedom."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np

from benchmarks.chain import ScipyChain, chain
from benchmarks.compiling import build_seconds
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.stopwatch import fastest, side_by_side
from gapwalk.flow import flow as flow_module
from gapwalk.flow.flow import Flow, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System

GROUP = "One forcing period of a chain of masses with one stop"
_SETTLE = 60  # forcing periods, so that the mass meets the stop as in steady motion
_AGREE = 1e-6
_ALIKE = 1e-11  # share of a transition matrix within which both ways agree
_MOST = {10: 0.3e-3, 20: 1e-3, 50: 5e-3}  # seconds that the transition matrix should take


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    return [row for size in effort.sizes for row in measure_chain(size, effort)]


def measure_chain(size: int, effort: Effort) -> list[Row]:
    """Measure the time of a period, state alone and with the transition matrix, and of making flows."""
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
    what, counts = f"{size} masses", {"equations": 2 * size, "contact events": len(ours().contacts)}
    matrix = f"{what}: state, transition matrix"
    if full.is_linear:
        series = _series(system)
        one, other = (flow.integrate(coefficients, start).transition for flow in (full, series))
        assert one is not None
        assert other is not None
        if not float(np.abs(one - other).max()) < _ALIKE * float(np.abs(other).max()):
            raise RuntimeError(f"the transition matrices of {size} masses differ")
        times = side_by_side([lambda each=each: each.integrate(coefficients, start) for each in (full, series)], effort)
        targets = (Target(_MOST[size]),) if size in _MOST else ()
        with_matrix = Row(GROUP, matrix, *times, "its Taylor series", targets=targets)
    else:
        seconds = fastest(lambda: full.integrate(coefficients, start), effort)
        with_matrix = Row(GROUP, matrix, seconds, counts={"equations": 2 * size * (2 * size + 1)})
    return [
        Row(GROUP, f"{what}: state", state, baseline, "DOP853", counts=counts),
        with_matrix,
        Row(GROUP, f"{what}: make the first flow", build_seconds(lambda: flow_of(system))),
        Row(GROUP, f"{what}: make the second flow", build_seconds(lambda: flow_of(system, transition=True))),
    ]


def _series(system: System) -> Flow:
    """Return the flow that integrates the transition matrix with the state."""
    with patch.object(flow_module, "LARGE", system.size + 1):
        flow_module._compile.cache_clear()  # pyright: ignore[reportPrivateUsage]
        found = flow_of(system, transition=True)
    flow_module._compile.cache_clear()  # pyright: ignore[reportPrivateUsage]
    return found
