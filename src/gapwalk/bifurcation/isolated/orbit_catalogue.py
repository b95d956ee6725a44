"""Catalogue of the distinct orbits of one system, and Newton's method with deflation, which avoids known orbits.

The catalogue counts how often each orbit was found. Deflation (Farrell, Birkisson and Funke 2015, SIAM J. Sci. Comput.
37, A2026-A2045) solves ``M(x) G(x) = 0`` instead of ``G(x) = 0``, with the deflation operator

    M(x) = prod_i ( 1 / |(x - x_i) / r|^p + s )

over the known solutions x_i. Its Jacobian is that of G plus a matrix of rank one, so by the formula of Sherman and
Morrison its Newton step is the ordinary one, d, times a number:

    1 / (1 - grad ln M . d)

Its reach r is short. With r as wide as the whole box of states, measured on the paper's system, the known solutions
flatten everything between them, and fewer new ones are found than without any deflation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, phases, true_period
from gapwalk.orbit.orbit_equation import Evaluation, Newton, OrbitEquation, is_solved

_SAME = 1e-6
"""Distance of two states, in half-widths of the box, within which they count as equal."""


class Catalogue:
    """Catalogue of the orbits of one system, which holds no motion twice, whatever its phase.

    Parameters
    ----------
    scales : shape (2n,)
        Half-widths of the box of states, by which distances are scaled.
    """

    def __init__(self, scales: NDArray[np.float64]) -> None:
        self.scales = scales
        self.entries: list[Entry] = []
        # a row for each state of each entry
        self._states = np.zeros((0, len(scales)))
        self._owners: list[Entry] = []
        self._periods = np.zeros(0, dtype=int)
        self._stable = np.zeros(0, dtype=bool)

    def add(self, orbit: Orbit) -> Entry:
        """Add an orbit and return its entry, which may exist already."""
        known = self.at(orbit.state, orbit.period)
        if known is None:
            known = Entry(orbit, phases(orbit))
            self.entries.append(known)
            self._states = np.concatenate((self._states, known.states))
            self._owners += [known] * len(known.states)
            self._periods = np.append(self._periods, [orbit.period] * len(known.states))
            self._stable = np.append(self._stable, [orbit.stable] * len(known.states))
        return known

    def at(self, state: NDArray[np.float64], period: int) -> Entry | None:
        """Return the entry that passes through a state and repeats after `period` forcing periods."""
        entry, distance = self.nearest(state, period)
        return entry if distance <= _SAME else None

    def nearest(self, state: NDArray[np.float64], period: int) -> tuple[Entry | None, float]:
        """Return the nearest entry to a state of those that repeat after `period` forcing periods, and its distance."""
        return self._nearest(state, period % self._periods == 0)

    def nearest_stable(self, state: NDArray[np.float64]) -> tuple[Entry | None, float]:
        """Return the stable entry nearest to a state, whatever its period, and its distance."""
        return self._nearest(state, self._stable)

    def _nearest(self, state: NDArray[np.float64], asked: NDArray[np.bool_]) -> tuple[Entry | None, float]:
        if not asked.any():
            return None, math.inf
        distances = np.abs((self._states - state) / self.scales).max(axis=1)
        distances[~asked] = math.inf
        nearest = int(distances.argmin())
        return self._owners[nearest], float(distances[nearest])

    def states(self, period: int) -> NDArray[np.float64]:
        """Return all phases of orbits that repeat after `period` forcing periods; shape (K, 2n)."""
        return self._states[period % self._periods == 0]


@dataclass(eq=False)
class Entry:
    """One orbit, its `phases`, and the numbers of transients and of Newton iterations that reached it."""

    orbit: Orbit
    states: NDArray[np.float64]
    settled: int = 0
    newton: int = 0


@dataclass(frozen=True, slots=True)
class Deflation:
    """Options of the search for further orbits. Lengths are shares of the box of states.

    Parameters
    ----------
    iterations, halvings
        Largest number of Newton steps; largest number of halvings of a step that does not reduce the deflated residual,
        before the search is given up.
    power, shift, reach
        p, s and r of the deflation operator.
    longest
        Longest step.
    farthest
        Distance from the centre of the box at which the search is given up.
    """

    iterations: int = 15
    halvings: int = 3
    power: float = 2.0
    shift: float = 1.0
    reach: float = 0.1
    longest: float = 0.5
    farthest: float = 3.0


def exact_orbit(system: System, period: int, state: NDArray[np.float64]) -> Orbit | None:
    """Return the exact orbit, with its true period, through a state that nearly repeats; None if there is none."""
    try:
        orbit = find_orbit(system, period, state, newton=Newton(iterations=10))
        shortest = true_period(orbit)
        if shortest < period:
            orbit = find_orbit(system, shortest, orbit.state, newton=Newton(iterations=10))
    except NumericalError:
        return None
    return orbit


def newton_aside(
    equation: OrbitEquation,
    start: NDArray[np.float64],
    scales: NDArray[np.float64],
    known: NDArray[np.float64] | None = None,
    options: Deflation = Deflation(),
    is_enough: Callable[[NDArray[np.float64]], bool] = lambda _: False,
) -> NDArray[np.float64] | None:
    """Find a solution other than the known ones, from a start; return None if Newton's method finds none.

    Parameters
    ----------
    equation
        The equation, without a parameter.
    start : shape (N,)
        The initial guess.
    scales : shape (N,)
        Half-widths of the box of states, the units of length.
    known : shape (K, N)
        The known solutions; without any, this is Newton's method with damping and bounds.
    options
        Options of the search.
    is_enough
        Called after each step; if it returns True, the search is given up, for instance near a known solution.
    """
    known = np.zeros((0, len(start))) if known is None else known
    x, evaluation = start, _evaluate(equation, start, scales, options)
    for _ in range(options.iterations):
        if evaluation is None or is_solved(equation, x, evaluation):
            break
        try:
            newton = np.linalg.solve(evaluation.by_unknowns, -evaluation.residual)
        except np.linalg.LinAlgError:
            return None
        step = newton
        if len(known):
            away = (x - known) / (scales * options.reach)
            step = newton * _step_factor(away, newton / (scales * options.reach), options)
        step *= min(1.0, options.longest / float(np.linalg.norm(step / scales)))
        x, evaluation = _line_search(equation, x, evaluation, step, scales, known, options)
        if evaluation is not None and is_enough(x):
            return None
    if evaluation is None or not is_solved(equation, x, evaluation):
        return None
    return x


def _evaluate(equation: OrbitEquation, x: NDArray[np.float64], scales, options: Deflation) -> Evaluation | None:
    """Evaluate the equation at a point; None outside the bounds, where hard impacts make integration extremely slow."""
    if not np.abs(x / scales).max() <= options.farthest:
        return None
    try:
        return equation.evaluate(x, 0.0)
    except NumericalError:
        return None


def _step_factor(away: NDArray[np.float64], step: NDArray[np.float64], options: Deflation) -> float:
    """Return the factor by which deflation intervals (or reverses) the Newton step."""
    p, distance2 = options.power, np.maximum((away * away).sum(axis=1), 1e-300)
    slopes = -p / (distance2 * (1.0 + options.shift * distance2 ** (p / 2.0)))
    rest = 1.0 - float(slopes @ (away @ step))
    return 1.0 / (rest if abs(rest) > 1e-9 else 1e-9)


def _line_search(equation, x, evaluation, step, scales, known, options: Deflation):
    """Return the first of the halved steps that reduces the deflated residual; None as evaluation if none does."""
    before, factor = _merit(x, evaluation, scales, known, options), 1.0
    for _ in range(options.halvings + 1):
        there = x + factor * step
        trial = _evaluate(equation, there, scales, options)
        if trial is not None and _merit(there, trial, scales, known, options) < before:
            return there, trial
        factor /= 2.0
    return x, None


def _merit(x, evaluation: Evaluation, scales, known, options: Deflation) -> float:
    """Return the logarithm of the size of the deflated residual."""
    size = math.log(max(math.hypot(*(evaluation.residual / scales).tolist()), 1e-300))
    if not len(known):
        return size
    away = (x - known) / (scales * options.reach)
    distance2 = np.maximum((away * away).sum(axis=1), 1e-300)
    return size + float(np.log(distance2 ** (-options.power / 2.0) + options.shift).sum())
