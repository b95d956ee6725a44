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
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.batch_flow import (
    LIMIT,
    MOST_STEPS,
    BlockPlan,
    Blocks,
    Trial,
    batch_of,
    first_guess,
    judge,
    revised,
)
from gapwalk.errors import NumericalError, UnfitError
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


# Many motions of one system at once, by the batch integrator: transients of a search, and Newton's method.
#
# The map over a forcing period of the batch integrator differs from that of the exact flow by about 1e-5 of the
# motion. It is as smooth: its derivatives are differences over a hundredth of that error. So Newton's method converges
# to a periodic motion of the batch integrator as it does to one of the flow, and a few exact steps lead from one to
# the other.
#
# Method: docs/numerics/isolated-branches.md

_ERROR = 1e-5  # over a forcing period, relative to the motion; with 1e-4 a few orbits fewer are found
_LOOKS = 4  # motions that are compared with the exact flow over one forcing period
_MOST = MOST_STEPS // 10  # steps per forcing period above which the exact flow is as fast
_TRIALS = 6  # largest number of revisions of the steps
_SHIFT = 1e-7  # displacement for derivatives, in half-widths of the box
_SOLVED = 1e-5  # residual, in half-widths of the box, of a periodic motion of the batch integrator


@dataclass(frozen=True, eq=False)
class Lanes:
    """Map over forcing periods of many motions at once."""

    plan: BlockPlan  #: The system and the steps per forcing period.
    box: NDArray[np.float64]  #: shape (state_size,): Half-widths of the box of states.

    def strobes(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """Return the states after each of some forcing periods, shape (periods, count, state_size); nan if diverged."""
        count = len(states)
        if count == 1:  # a single lane would need another compiled kernel
            states = np.repeat(states, 2, axis=0)
        blocks = Blocks(self.plan, states, periods, 1, False, 1)
        blocks.advance(periods)
        strobes = blocks.strobes
        assert strobes is not None
        return strobes[:, :count]

    def paths(self, states: NDArray[np.float64], periods: int) -> list[NDArray[np.float64]]:
        """Return the states at the start of each forcing period, and at the end, of each motion until it diverges."""
        all_states = np.concatenate((states[None], self.strobes(states, periods))).transpose(1, 0, 2)
        return [path[np.isfinite(path).all(axis=1)] for path in all_states]

    def evaluate(
        self, states: NDArray[np.float64], periods: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residuals of states as periodic motions, each with its number of forcing periods, and derivatives.

        Both are in half-widths of the box; their shapes are (count, state_size) and (count, state_size, state_size).
        """
        count, size = states.shape
        shifts = np.vstack((np.zeros(size), _SHIFT * np.diag(self.box)))
        begun = (states + shifts[:, None]).reshape(-1, size)
        strobes = self.strobes(begun, int(periods.max())).reshape(-1, size + 1, count, size)
        ends = strobes[periods - 1, :, np.arange(count)].transpose(1, 0, 2)
        residuals = (ends[0] - states) / self.box
        moved = (ends[1:] - ends[0]) / (_SHIFT * self.box)
        return residuals, moved.transpose(1, 2, 0) - np.eye(size)


def lanes_of(system: System, states: NDArray[np.float64], box: NDArray[np.float64]) -> Lanes | None:
    """Return the map of many motions; None where the exact flow is needed, or is as fast.

    It is needed where friction sticks and stops rebound: derivatives by differences say nothing of motions that touch
    a rigid stop, or stick, for the first time.

    Shapes: `states` (count, state_size); `box` (state_size,).
    """
    if any(contact.law.is_dry or contact.law.rebounds for contact in system.structure.contacts):
        return None
    try:
        batch = batch_of(system, np.repeat(states, 2, axis=0) if len(states) == 1 else states, {})
        plan = BlockPlan(
            batch.linear, batch.pattern, first_guess(batch.linear, _ERROR, batch.states), begins_often=True
        )
        looked_at = np.unique(np.linspace(0, len(batch.states) - 1, _LOOKS).astype(int))
        for _ in range(_TRIALS):
            if plan.steps > _MOST:
                return None
            ends = Lanes(plan, box).strobes(batch.states, 1)[0]
            trials = [Trial(0, batch.states[each], ends[each]) for each in looked_at]
            verdict = judge(trials, lambda _: system, LIMIT)
            if not verdict.trials:
                return None  # all of them diverge: nothing shows how many steps the others need
            if verdict.error <= _ERROR:
                return Lanes(plan, box)
            plan = replace(plan, steps=max(revised(plan.steps, verdict.error, _ERROR), plan.steps + 4))
    except UnfitError:
        return None
    return None


def newton_in_lanes(
    lanes: Lanes,
    starts: NDArray[np.float64],
    periods: NDArray[np.intp],
    is_enough: Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.bool_]],
    options: Deflation = Deflation(),
) -> NDArray[np.float64]:
    """Apply Newton's method from many starts, with damping and bounds as `newton_aside`; nan where it finds nothing.

    Shapes: `starts` (count, state_size); `periods` (count,).
    """
    found, x = np.full(starts.shape, np.nan), starts.copy()
    residuals, jacobians = lanes.evaluate(x, periods)
    active = np.flatnonzero(_within(lanes, x, options) & np.isfinite(residuals).all(axis=1))
    for _ in range(options.iterations + 1):
        solved = np.abs(residuals[active]).max(axis=1) <= _SOLVED
        found[active[solved]] = x[active[solved]]
        active = active[~solved]
        if not len(active):
            break
        steps = _newton_steps(jacobians[active], residuals[active], options.longest)
        there, beyond, derivatives = _shortened(lanes, x[active], periods[active], residuals[active], steps, options)
        moves = np.isfinite(beyond).all(axis=1)
        active = active[moves]
        x[active], residuals[active], jacobians[active] = there[moves], beyond[moves], derivatives[moves]
        if len(active):
            active = active[~is_enough(active, x[active])]
    return found


def _within(lanes: Lanes, x: NDArray[np.float64], options: Deflation) -> NDArray[np.bool_]:
    return np.asarray(np.abs(x / lanes.box).max(axis=1) <= options.farthest)


def _newton_steps(
    jacobians: NDArray[np.float64], residuals: NDArray[np.float64], longest: float
) -> NDArray[np.float64]:
    """Return the steps of limited length, in half-widths of the box; nan where the derivatives are singular or nan."""
    steps = np.full(residuals.shape, np.nan)
    regular = np.flatnonzero(np.isfinite(jacobians).all(axis=(1, 2)))
    regular = regular[np.linalg.det(jacobians[regular]) != 0.0]
    steps[regular] = np.linalg.solve(jacobians[regular], -residuals[regular, :, None])[:, :, 0]
    return steps * np.minimum(1.0, longest / np.maximum(np.linalg.norm(steps, axis=1), longest))[:, None]


def _shortened(
    lanes: Lanes,
    x: NDArray[np.float64],
    periods: NDArray[np.intp],
    residuals: NDArray[np.float64],
    steps: NDArray[np.float64],
    options: Deflation,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return where the first of the halved steps leads that reduces the residual, with residual and derivatives there.

    The residual is nan where none does.
    """
    there, beyond = x.copy(), np.full(residuals.shape, np.nan)
    derivatives = np.full((*residuals.shape, residuals.shape[1]), np.nan)
    sizes, waiting = np.linalg.norm(residuals, axis=1), np.flatnonzero(np.isfinite(steps).all(axis=1))
    halves = 0.5 ** np.arange(1.0, options.halvings + 1.0)
    for factors in (np.ones(1), halves):  # all halves at once: the start of a run takes longer than the run
        which, shares = np.repeat(waiting, len(factors)), np.tile(factors, len(waiting))
        trials = x[which] + shares[:, None] * steps[which] * lanes.box
        inside = _within(lanes, trials, options)
        which, trials = which[inside], trials[inside]
        if len(which):
            ends, slopes = lanes.evaluate(trials, periods[which])
            less = np.flatnonzero(np.linalg.norm(ends, axis=1) < sizes[which])[::-1]  # the longest is written last
            there[which[less]], beyond[which[less]], derivatives[which[less]] = trials[less], ends[less], slopes[less]
            waiting = np.setdiff1d(waiting, which[less])
    return there, beyond, derivatives
