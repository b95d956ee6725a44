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
from typing import Any, NamedTuple

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

    Shapes: `scales` (state_size,).
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
        known, distance = self.nearest(orbit.state, orbit.period)
        if known is None or not distance <= _SAME:
            known = Entry(orbit, phases(orbit))
            self.entries.append(known)
            self._states = np.concatenate((self._states, known.states))
            self._owners += [known] * len(known.states)
            self._periods = np.append(self._periods, [orbit.period] * len(known.states))
            self._stable = np.append(self._stable, [orbit.stable] * len(known.states))
        return known

    def nearest(self, state: NDArray[np.float64], period: int) -> tuple[Entry | None, float]:
        """Return the nearest entry to a state of those that repeat after `period` forcing periods, and its distance."""
        return self._nearest(state, period % self._periods == 0)

    def nearest_stable(self, state: NDArray[np.float64]) -> tuple[Entry | None, float]:
        """Return the stable entry nearest to a state, whatever its period, and its distance."""
        return self._nearest(state, self._stable)

    def nearest_each(
        self, states: NDArray[np.float64], periods: NDArray[np.intp]
    ) -> tuple[list[Entry | None], NDArray[np.float64]]:
        """Return `nearest` of each of some states, with its number of forcing periods; shapes (count, ...)."""
        if not self.entries:
            return [None] * len(states), np.full(len(states), math.inf)
        distances = np.abs((self._states - states[:, None]) / self.scales).max(axis=2)
        distances[periods[:, None] % self._periods != 0] = math.inf
        nearest = distances.argmin(axis=1)
        least = distances[np.arange(len(states)), nearest]
        owners = zip(nearest.tolist(), least.tolist(), strict=True)
        return [self._owners[place] if away < math.inf else None for place, away in owners], least

    def _nearest(self, state: NDArray[np.float64], asked: NDArray[np.bool_]) -> tuple[Entry | None, float]:
        if not asked.any():
            return None, math.inf
        distances = np.abs((self._states - state) / self.scales).max(axis=1)
        distances[~asked] = math.inf
        nearest = int(distances.argmin())
        return self._owners[nearest], float(distances[nearest])

    def states(self, period: int) -> NDArray[np.float64]:
        """Return all phases of orbits that repeat after `period` forcing periods; shape (K, state_size)."""
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
    """Options of the search for further orbits. Lengths are shares of the box of states."""

    #: iterations, halvings: Largest number of Newton steps; largest number of halvings of a step that does not reduce
    #: the deflated residual, before the search is given up.
    iterations: int = 15
    halvings: int = 3
    #: power, shift, reach: p, s and r of the deflation operator.
    power: float = 2.0
    shift: float = 1.0
    reach: float = 0.1
    longest: float = 0.5  #: Longest step.
    farthest: float = 3.0  #: Distance from the centre of the box at which the search is given up.


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

    Shapes: `start`, `scales` (N,); `known` (K, N).
    """
    problem = _Deflated(equation, scales, np.zeros((0, len(start))) if known is None else known, options)
    x, evaluation = start, problem.evaluate(start)
    for _ in range(options.iterations):
        if evaluation is None or is_solved(equation, x, evaluation):
            break
        try:
            step = problem.step(x, np.linalg.solve(evaluation.by_unknowns, -evaluation.residual))
        except np.linalg.LinAlgError:
            return None
        x, evaluation = problem.shortened(x, evaluation, step)
        if evaluation is not None and is_enough(x):
            return None
    return None if evaluation is None or not is_solved(equation, x, evaluation) else x


class _Deflated(NamedTuple):
    """Equation with its known solutions divided out."""

    equation: OrbitEquation
    scales: NDArray[np.float64]
    known: NDArray[np.float64]
    options: Deflation

    def evaluate(self, x: NDArray[np.float64]) -> Evaluation | None:
        """Evaluate the equation; None outside the bounds, where hard impacts make integration extremely slow."""
        if not np.abs(x / self.scales).max() <= self.options.farthest:
            return None
        try:
            return self.equation.evaluate(x, 0.0)
        except NumericalError:
            return None

    def step(self, x: NDArray[np.float64], newton: NDArray[Any]) -> NDArray[np.float64]:
        """Return the step of limited length: deflation shortens, lengthens or reverses that of Newton's method."""
        step, options, unit = newton, self.options, self.scales * self.options.reach
        if len(self.known):
            away = (x - self.known) / unit
            distance2 = np.maximum((away * away).sum(axis=1), 1e-300)
            slopes = -options.power / (distance2 * (1.0 + options.shift * distance2 ** (options.power / 2.0)))
            rest = 1.0 - float(slopes @ (away @ (newton / unit)))
            step = newton * (1.0 / (rest if abs(rest) > 1e-9 else 1e-9))
        return step * min(1.0, options.longest / float(np.linalg.norm(step / self.scales)))

    def shortened(
        self, x: NDArray[np.float64], evaluation: Evaluation, step: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], Evaluation | None]:
        """Return the end of the first of the halved steps that reduces the deflated residual; None if none does."""
        before, factor = self.merit(x, evaluation), 1.0
        for _ in range(self.options.halvings + 1):
            there = x + factor * step
            trial = self.evaluate(there)
            if trial is not None and self.merit(there, trial) < before:
                return there, trial
            factor /= 2.0
        return x, None

    def merit(self, x: NDArray[np.float64], evaluation: Evaluation) -> float:
        """Return the logarithm of the size of the deflated residual."""
        size = math.log(max(math.hypot(*(evaluation.residual / self.scales).tolist()), 1e-300))
        if not len(self.known):
            return size
        away = (x - self.known) / (self.scales * self.options.reach)
        distance2 = np.maximum((away * away).sum(axis=1), 1e-300)
        return size + float(np.log(distance2 ** (-self.options.power / 2.0) + self.options.shift).sum())
