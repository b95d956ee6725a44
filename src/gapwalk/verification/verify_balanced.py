"""Verification of balanced orbits: their lines by quadrature, and an exact motion for comparison.

Here the contact forces are sampled, between breakpoints by Gauss's rule, whereas harmonic balance computes their
spectrum in closed form. Truncation is not a fault, so an exact motion may differ by as much as truncation explains.
"""

from __future__ import annotations

import math
from functools import singledispatch
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.floquet import is_on_border
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.independent_equations import Equations
from gapwalk.verification.verification import Check, Ledger, Spot
from gapwalk.verification.verify_special_points import Track

Array = NDArray[np.float64]

_PERIOD = 2.0 * math.pi
_NODES, _WEIGHTS = leggauss(8)
_CELLS = 16  # of the grid per line on which kinks are bracketed
_BISECTIONS = 50
_HALVINGS = 24  # of panels beside a fractional power
_PANELS = 1.0  # panels per line; each breakpoint adds one
_MOST = 60  # number of points of a branch for which an exact motion is sought
_LARGE = 20  # degrees of freedom from which no exact motion is sought: its flow would take too long
_AMPLIFIED = 30.0  # allowed difference, in neglected amounts, of a motion whose multipliers are far from 1
_FINEST = 1e-7  # smallest neglected amount that is assumed
_NEAR = 0.05  # distance of a multiplier from criticality within which nothing is concluded
_BATCH = 2_000_000  # numbers in the wave matrix of one batch of panels


def verify_truncated(ledger: Ledger, track: Track) -> None:
    """Check the orbits of a branch that are not exact."""
    for spot, point, _ in track.spots():
        ledger.enter(Check.RECORD, spot, track.mismatch(point))
        ledger.enter(Check.RESIDUAL, spot, track.doubtful_residual(point))
        if (off := imbalance(point.orbit)) is not None:
            ledger.enter(Check.LINES, spot, off.lines)
            ledger.enter(Check.STAGES, spot, off.astray)
    points, size = track.branch.points, track.branch.system.size
    if size >= _LARGE:
        ledger.note(f"{track.name}: with {size} degrees of freedom no exact motions were compared with it")
        return
    for spot, point, _ in islice(track.spots(), 0, len(points), max(1, math.ceil(len(points) / _MOST))):
        _compare_with_exact(ledger, spot, point)


class Imbalance(NamedTuple):
    """Errors of an orbit that is not exact, in the equations of motion and at its breakpoints."""

    lines: float  #: Residual of its lines in the equations of motion, relative to the largest term of these.
    astray: float  #: Error at the breakpoints; see `gapwalk.verification.dop853.Round`.


@singledispatch
def imbalance(orbit: Orbit) -> Imbalance | None:
    """Return the residual of an orbit's lines in the equations of motion; None for a class that has no lines."""
    return None


@imbalance.register(BalancedOrbit)
def _of_series(orbit: BalancedOrbit) -> Imbalance:
    system, lines = orbit.system, orbit.series.lines
    count, equations = lines.shape[1] - 1, Equations([system])
    rate = 1j * np.arange(count + 1) * system.frequency / orbit.period
    total = np.zeros((system.size, count + 1), dtype=complex)
    largest, astray, length = 0.0, 0.0, float(np.abs(orbit.extremes[:, :2]).max())
    for theta, weights in _panels(orbit, count, _kinks(orbit, equations, count)):
        waves, states = _states(orbit, theta)
        accelerations = (waves @ (lines * rate**2).T).real
        depths, closed = _closed(equations, theta, states)
        rates = equations.rates(theta, states, closed)[:, system.size : 2 * system.size] * system.frequency
        total += (weights[:, None] * (accelerations - rates)).T @ waves.conj()
        largest = max(largest, float(np.abs(accelerations).max()), float(np.abs(rates).max()))
        astray = max(astray, _astray(orbit, theta, depths))
    total *= np.where(np.arange(count + 1), 2.0, 1.0) / (_PERIOD * orbit.period)
    tiny = np.finfo(float).tiny
    return Imbalance(float(np.abs(total).max()) / max(largest, tiny), astray / max(length, tiny))


def _states(orbit: BalancedOrbit, theta: Array) -> tuple[NDArray[np.complex128], Array]:
    """Return the waves of all lines at some angles, and positions, velocities and a zero, shape (angles, 2n + 1)."""
    lines = orbit.series.lines
    k = np.arange(lines.shape[1])
    waves, rate = np.exp(1j * np.outer(theta / orbit.period, k)), 1j * k * orbit.system.frequency / orbit.period
    parts = [(waves @ (lines * rate**power).T).real for power in (0, 1)]
    return waves, np.column_stack((*parts, np.zeros(len(theta))))


def _closed(equations: Equations, theta: Array, states: Array) -> tuple[Array, Array]:
    """Return the depths beyond the breakpoints, and 1 for each stage that acts, otherwise 0."""
    depths = equations.depths(equations.deflections(theta, states[:, : equations.size]))
    return depths, (depths > 0.0).astype(float)


def _kinks(orbit: BalancedOrbit, equations: Equations, count: int) -> Array:
    """Return the angles at which a number jumps or a formula has a kink, and angles that approach the latter."""
    end = _PERIOD * orbit.period
    turns = _PERIOD * np.arange(orbit.period)[:, None]
    known = [(turns + jumps).ravel() for jumps in equations.jumps(0)]
    if equations.guard_count:

        def guards(theta: Array) -> Array:
            _, states = _states(orbit, theta)
            return equations.guards(theta, states, _closed(equations, theta, states)[1])

        grid = np.linspace(0.0, end, _CELLS * (count + 1) + 1)
        above = guards(grid) > 0.0
        cells, modes = np.nonzero(above[1:] != above[:-1])
        low, high, each = grid[cells], grid[cells + 1], np.arange(len(cells))
        for _ in range(_BISECTIONS if len(cells) else 0):
            middle = 0.5 * (low + high)
            is_like_low = (guards(middle)[each, modes] > 0.0) == above[cells, modes]
            low, high = np.where(is_like_low, middle, low), np.where(is_like_low, high, middle)
        # beside a fractional power the rule needs panels that become smaller and smaller
        approach = np.outer(2.0 ** -np.arange(_HALVINGS), [-1.0, 1.0]).ravel() * end / (count + 1)
        known += [low, (low[equations.graded[modes], None] + approach).ravel() % end]
    return np.concatenate(known) if known else np.zeros(0)


def _panels(orbit: BalancedOrbit, count: int, kinks: Array):
    """Yield angles and weights of Gauss's rule on panels that end at breakpoints and kinks, in batches."""
    end = _PERIOD * orbit.period
    knots = np.linspace(0.0, end, math.ceil(_PANELS * count) + 2)
    knots = np.unique(np.concatenate((knots, [event.theta % end for event in orbit.events], kinks)))
    size = max(1, _BATCH // (8 * (count + 1)))
    for first in range(0, len(knots) - 1, size):
        a, b = knots[first : first + size + 1][:-1], knots[first + 1 : first + size + 1]
        half = 0.5 * (b - a)
        yield ((0.5 * (a + b))[:, None] + half[:, None] * _NODES).ravel(), (half[:, None] * _WEIGHTS).ravel()


def _astray(orbit: Orbit, theta: NDArray[np.float64], depths: NDArray[np.float64]) -> float:
    """Return the distance by which a deflection is on the wrong side of a breakpoint, according to its events."""
    worst = 0.0
    for switch in range(depths.shape[1]):
        events = [event for event in orbit.events if event.switch == switch]
        depth = depths[:, switch]
        if events:
            order = np.argsort([event.theta for event in events])
            thetas = np.array([events[index].theta for index in order])
            enters = np.array([events[index].enters for index in order])
            closed = enters[np.searchsorted(thetas, theta, side="right") - 1]
            worst = max(worst, float(np.where(closed, -depth, depth).max()))
        else:
            worst = max(worst, min(float(depth.max()), float(-depth.min())))
    return worst


def _compare_with_exact(ledger: Ledger, spot: Spot, point: BranchPoint) -> None:
    """Find an exact motion near one that is not, and compare their states and stability."""
    orbit = point.orbit
    near = float(np.abs(orbit.free_multipliers - 1.0).min())
    if near < _NEAR:
        return  # near a fold or a branch point
    try:
        exact = find_orbit(orbit.system, orbit.period, orbit.state)
    except NumericalError as error:
        ledger.enter(Check.TRUTH, spot, math.inf, f"no exact motion is found from it: {error}")
        return
    n, size = orbit.system.size, np.full(orbit.system.state_size, np.abs(orbit.extremes[:, :2]).max())
    size[n : 2 * n] = np.abs(orbit.motion().v).max()
    off = float((np.abs(exact.state - orbit.state) / size).max())
    allowed = _AMPLIFIED * max(orbit.truncation, _FINEST) / min(1.0, near)
    ledger.enter(
        Check.TRUTH, spot, off / allowed, f"difference {off:.2g} of the motion, truncation {orbit.truncation:.2g}"
    )
    # the truncation may change the number of multipliers outside of the unit circle if one is near it
    distances = np.abs(np.abs(orbit.free_multipliers) - 1.0)
    if not is_on_border(orbit.free_multipliers) and distances.min() >= max(_NEAR, allowed):
        found = exact.instability.total
        detail = f"{found} unstable multipliers of the exact motion, where {orbit.instability.total} are stored"
        ledger.enter(Check.STABILITY, spot, float(found != orbit.instability.total), detail)
