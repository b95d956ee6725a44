"""Chunk of a search: a block of starts at one value of the parameter, processed by a pure function.

From each start a transient is followed until it repeats, instead of for a fixed number of forcing periods.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Le
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
    state_at_rest,
    within_stops,
)
from gapwalk.errors import FlowError, ModelError, NumericalError, UnfitError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.bounds import Counted, Natural, Positive, check_fields
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.equilibria import balance_of
from gapwalk.model.spring import Spring, springs_of
from gapwalk.model.static_force import formula_matrices, formulas_of
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, phases, true_period
from gapwalk.orbit.orbit_equation import Evaluation, Newton, OrbitEquation, is_solved
from gapwalk.orbit.shooting import ShootingEquation

# Catalogue of the distinct orbits of one system, and Newton's method with deflation, which avoids known orbits.
#
# The catalogue counts how often each orbit was found. Deflation (Farrell, Birkisson and Funke 2015, SIAM J. Sci.
# Comput. 37, A2026-A2045) solves ``M(x) G(x) = 0`` instead of ``G(x) = 0``, with the deflation operator
#
#     M(x) = prod_i ( 1 / |(x - x_i) / r|^p + s )
#
# over the known solutions x_i. Its Jacobian is that of G plus a matrix of rank one, so by the formula of Sherman and
# Morrison its Newton step is the ordinary one, d, times a number:
#
#     1 / (1 - grad ln M . d)
#
# Its reach r is short. With r as wide as the whole box of states, measured on the paper's system, the known solutions
# flatten everything between them, and fewer new ones are found than without any deflation.

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
    """Find a solution other than the known ones, from a start; return None if Newton's method finds none."""
    # Shapes: `start`, `scales` (N,); `known` (K, N).
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
# Method: docs/numerics/notes/continuation.md

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
    """Return the map of many motions; None where the exact flow is needed, or is as fast."""
    # It is needed where friction sticks and stops rebound: derivatives by differences say nothing of motions that touch
    # a rigid stop, or stick, for the first time.
    #
    # Shapes: `states` (count, state_size); `box` (state_size,).
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
    """Apply Newton's method from many starts, with damping and bounds as `newton_aside`; nan where it finds nothing."""
    # Shapes: `starts` (count, state_size); `periods` (count,).
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


# Options of a search, and the starts that follow from them at each value of the parameter.
#
# Starts are spread evenly over the box of states that a system may visit.

_STARTS = 100_000  # largest number of starts
_REACH = 20.0  # a gap this many times wider than the motion without it is assumed never to close
_REDRAWS = 10  # times that the number of starts is doubled to find enough within rigid stops
_SAMPLES = 64  # samples per forcing period of the velocities of a known orbit
_RESONANCE = 5.0  # upper bound of the amplitude of a linear resonance, in static deflections
_NOTHING = 1e-12  # share of the largest extent below which that of another coordinate is rounding
_STEPPED = 2.0  # largest motion after a load is applied at once, in static deflections
_BENT = 3.0  # extent of the positions, in lengths at which a formula bends
_SINGULAR = 1e12  # condition number above which a stiffness does not support the system


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """Thoroughness of a search at each value of the parameter.

    The defaults suit a search at many values of the parameter, several of them within each isolated branch. For a
    single value of the parameter, use more starts.

    Examples
    --------
    >>> gw.SearchOptions(starts=100, newton_starts=50, seed=3).starts
    100
    """

    starts: Annotated[int, Ge(1), Le(_STARTS)] = 24  #: Starts of transients at each value of the parameter.
    #: Longest period, in forcing periods, of the orbits on which a transient may settle.
    periods: Counted = 8
    #: Number of starts at each value from which Newton's method also searches, to find unstable orbits; 0 for none.
    newton_starts: Annotated[int, Ge(0), Le(_STARTS)] = 24
    #: Periods m, in forcing periods, of the orbits that Newton's method searches for. Every m-th of its starts is used
    #: for period m; orbits of shorter periods are found too.
    newton_periods: tuple[Counted, ...] = (1, 2, 3, 4, 5, 6, 7, 8)
    #: Forcing periods after which a transient whose returns no longer shrink counts as not periodic.
    patience: Annotated[int, Ge(16)] = 400
    #: Half-widths of the box of starts about zero, 2n numbers: positions, then velocities. By default it is derived
    #: from the system; see `state_box`. Friction springs begin without extension.
    box: tuple[Positive, ...] | None = None
    spread: Positive = 1.5  #: Factor by which the derived box is larger than the expected motions.
    #: Seed of the starts: the same seed gives the same result for the same values. From 500 starts on, many are
    #: followed at once, and other unstable orbits may be found than with fewer starts.
    seed: Natural = 0
    #: Number of starts in one piece of work. It affects the result, because no piece uses what other pieces find.
    block: Counted = 24

    def __post_init__(self) -> None:
        check_fields(self)
        if self.newton_starts and not self.newton_periods:
            raise ModelError("newton_periods is empty; name at least one period, or write newton_starts = 0")


def state_box(system: System, known: Iterable[Orbit] = (), spread: float = 1.5) -> NDArray[np.float64]:
    """Return the half-widths of a box about zero that contains the motions of a system with a margin; shape (2n,)."""
    # Positions: as far as the static load, the widths of the gaps and the excitation move the system while its contacts
    # touch, and at least as wide as the gaps; if a contact has one side only, as far as the system moves without it.
    # With forces by formulas, about each static equilibrium. Velocities: the positions times the natural frequency of
    # the coordinate with the others fixed and the contacts touching, or times the excitation frequency if that is
    # higher. Known orbits enlarge the box if necessary.
    stiffness, positions = _touching(system)
    positions[positions <= _NOTHING * positions.max()] = positions.max() or 1.0
    rates = np.sqrt(np.abs(stiffness.diagonal()))
    box = np.append(positions, positions * np.maximum(rates, system.frequency))
    for orbit in known:
        motion = orbit.motion(_SAMPLES)
        box = np.maximum(box, np.abs(np.hstack((motion.q, motion.v))).max(axis=0))
    return spread * box


def with_extensions(system: System, box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a box with half-widths for extensions, those of the deflections within the box; shape (state_size,)."""
    structure, n = system.structure, system.size
    vectors = (system.vector(structure.contacts[place].vectors[0]) for place in structure.memories)
    return np.append(box, [float(np.abs(vector) @ box[:n]) for vector in vectors])


def _touching(system: System) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stiffness per unit of mass with the contacts touching, and the extent of the positions."""
    # With forces by formulas there is one for each of the static equilibria, and the largest counts. The positions then
    # contain the equilibria under the mean load, twice those under the peaks of all loads, and, where the motion is not
    # far smaller or an equilibrium is unstable, the lengths at which formulas bend: such as a limit cycle.
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    rows, n = coefficients[layout.accelerations], system.size
    if not formulas_of(system):
        return _about(system, rows)
    balance = balance_of(system)
    rests = balance.near(balance.rests()[0]) or [np.zeros(n)]
    stiffest, extent, unstable = np.zeros((n, n)), np.abs(rests).max(axis=0), False
    for rest in rests:
        tangents = rows.copy()
        for matrix, part in zip(formula_matrices(system, rest, strict=False), (slice(n), slice(n, 2 * n)), strict=True):
            tangents[:, part] += np.linalg.solve(system.matrix("mass"), matrix)
        stiffness, positions = _about(system, tangents)
        stiffest = np.where(np.abs(stiffness) > np.abs(stiffest), stiffness, stiffest)
        extent = np.maximum(extent, np.abs(rest) + np.where(np.isfinite(positions), positions, 0.0))
        flow = np.block([[np.zeros((n, n)), np.eye(n)], [-tangents[:, :n], -tangents[:, n : 2 * n]]])
        unstable = unstable or bool(np.linalg.eigvals(flow).real.max() > 0.0)
    peak = balance.peak_loads(system)
    for load in (balance.load + peak, balance.load - peak):
        for rest in balance.near(replace(balance, load=load).rests()[0])[:1]:
            extent = np.maximum(extent, _STEPPED * np.abs(rest))
    rates = np.maximum(np.sqrt(np.abs(stiffest.diagonal())), system.frequency)
    for lengths in (*balance.lengths, *(balance.speeds / rates)):
        if unstable or (lengths <= _REACH * extent)[lengths > 0.0].all():
            extent = np.maximum(extent, _BENT * lengths)
    return stiffest, extent


def _about(system: System, rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stiffness per unit of mass with the contacts touching, and the extent of the positions."""
    # A gap far wider than the motion without it is left out: a stop that is never reached does not affect the motion.
    layout, coefficients, n = layout_of(system.structure), coefficients_of(system), system.size
    mean = rows[:, 2 * n + len(layout.contacts)]
    stiffness, load = rows[:, :n].copy(), np.abs(mean)
    free, widths = _linear_motion(system, rows, stiffness, load, np.inf), np.zeros(n)
    bounded = any(contact.stages for contact in layout.contacts)
    for contact, spring in zip(layout.contacts, springs_of(system), strict=True):
        if not contact.stages:
            continue
        vector, force = coefficients[contact.deflection], coefficients[contact.force]
        moved = vector != 0.0
        reach = _REACH * float(np.abs(vector[moved]) @ free[moved])
        sides = [_side(spring, sign, reach) for sign in (1, -1)]
        slope, pull, width = max(sides)
        if contact.sway is not None:  # a displacement that is prescribed is felt like a wider gap
            sway = float(np.abs(coefficients[contact.sway]).sum())
            pull, width = pull + abs(slope) * sway, width + sway
        stiffness += slope * np.outer(force, vector)
        load = load + pull * np.abs(force)
        widths[moved] = np.maximum(widths[moved], width / np.abs(vector[moved]))
        bounded = bounded and min(sides)[0] > 0.0
    if not bounded and np.all(np.isfinite(free)):
        return stiffness, np.maximum(free, widths)
    touching = _linear_motion(system, rows, stiffness, load, _RESONANCE)
    return stiffness, np.maximum(np.where(np.isfinite(touching), touching, 0.0), widths)


def _linear_motion(
    system: System,
    rows: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    load: NDArray[np.float64],
    resonance: float,
) -> NDArray[np.float64]:
    """Return the extent of the positions of a linear system under static load and excitation; infinite if unsupported.

    A resonance is limited to `resonance` times the deflection under static loads: gaps detune it, and contacts damp it.
    """
    n, orders = system.size, layout_of(system.structure).orders
    if np.linalg.cond(stiffness) > _SINGULAR:
        return np.full(n, np.inf)
    flexibility = np.abs(np.linalg.inv(stiffness))
    static, amplitudes = flexibility @ load, np.zeros(n)
    believed = static.copy()
    for index, order in enumerate(orders):
        w = order * system.frequency
        force = rows[:, index - 2 * len(orders)] - 1j * rows[:, index - len(orders)]
        dynamic = stiffness - w**2 * np.eye(n) + 1j * w * rows[:, n : 2 * n]
        resonant = np.linalg.cond(dynamic) > _SINGULAR
        amplitudes += np.inf if resonant else np.abs(np.linalg.solve(dynamic, force))
        believed += flexibility @ np.abs(force)
    return static + (np.minimum(amplitudes, resonance * believed) if resonance < np.inf else amplitudes)


def _side(spring: Spring, sign: int, reach: float) -> tuple[float, float, float]:
    """Return, for one side of a contact: the stiffness, the sum of spring stiffness times gap, and the widest gap."""
    slope = pull = width = 0.0
    for stage in spring.slopes:
        if stage.sign == sign and stage.clearance <= reach:
            # a spring that is not linear counts with its stiffness at a depth of one clearance
            stiffness = sign * sum(each * stage.clearance**power for power, each in enumerate(stage.pull[1:]))
            slope, pull = slope + stiffness, pull + abs(stiffness) * stage.clearance
            width = max(width, stage.clearance)
    return slope, pull, width


def spread_starts(
    systems: Sequence[System], box: NDArray[np.float64], count: int, seed: int, value: float
) -> NDArray[np.float64]:
    """Return starts spread evenly over a box by a scrambled Sobol sequence, shape (count, state_size)."""
    # They depend only on the seed and the value of the parameter, not on what else is searched. Those beyond a rigid
    # stop of one of the systems are left out, and others follow. The box is about rest. Extensions are zero.
    from scipy.stats import qmc  # imported late, because the import takes longer than everything else here

    power, states, points = (count - 1).bit_length(), np.empty((0, 0)), np.empty((0, 0))
    for more in range(_REDRAWS):
        engine = qmc.Sobol(len(box), scramble=True, rng=generator(seed, value))
        points = (2.0 * engine.random_base2(power + more) - 1.0) * box
        states = state_at_rest(systems[0]) + np.pad(points, ((0, 0), (0, systems[0].state_size - len(box))))
        for system in systems:
            states = states[within_stops(system, states)]
        if len(states) >= count:
            return states[:count]
    raise ModelError(
        f"only {len(states)} of {len(points)} states in the box of starts are within the rigid stops; give a smaller "
        "box"
    )


def generator(seed: int, value: float, block: int = 0) -> np.random.Generator:
    """Return the random numbers for one value of the parameter, and for one block of starts there."""
    return np.random.default_rng([seed, int(np.float64(value).view(np.uint64)), block])


_EVERY = 8  # forcing periods between two examinations of the returns
_TOGETHER = 4 * _EVERY  # the same of many transients: their start takes as long as all of these periods
_STROBES = np.array([PERIOD * k for k in range(_EVERY + 1)])  # in one call: a call costs as much as a period
_RETURN = 1e-3  # distance of a return, in half-widths of the box, below which a transient may be settling
_FINEST = 1e-11  # the closest return that is required
_NEAR = 1e-2  # distance from a stable orbit within which a transient that returns has settled on it
_SHRINKING = 0.75  # ratio of the returns, over half the patience, up to which a transient is continued
_LONGEST = 10  # longest transient, as a multiple of the patience; slower decay would not end by then
_DOUBTS = 8  # number of times per patience that the returns of a long transient are examined
_EARLY = 1  # forcing periods after which the state of a transient is a start of Newton's method for short periods
_SHORT = 3  # the longest of the short periods
_LATE = 2  # forcing periods, in addition to the period sought, after which it is a start for any period
_THERE = 1e-2  # distance from a known orbit within which Newton's method would only return to it
_FEW = 0.25  # largest share of unsettled starts for which the patience is extended
_PATIENCE = 5  # factor by which it is extended
_NEARBY = 40  # largest number of new orbits whose neighbourhood is searched: without damping there are families of them
_KICK = 0.1  # distance from a known orbit at which the search for its neighbours begins, in half-widths of the box


@dataclass(frozen=True, eq=False)
class Settling:
    """Outcome of one transient."""

    path: NDArray[np.float64]  #: shape (periods + 1, state_size): States at the start of each forcing period.
    entry: Entry | None  #: The stable orbit on which it settled, or None.
    ran_away: bool = False  #: True if it could not be followed.


@dataclass(frozen=True, eq=False)
class Chunk:
    """Block of starts at one value of the parameter."""

    value: float  #: The value of the parameter.
    block: int  #: Index of the block among those of this value.
    system: System  #: The system at that value.
    box: NDArray[np.float64]  #: shape (state_size,): Half-widths of the box of states.
    starts: NDArray[np.float64]  #: shape (count, state_size): The starts.
    known: tuple[Orbit, ...]  #: Orbits known at that value.
    options: SearchOptions  #: Options of the search.
    many: bool = False  #: True if the search has so many starts that the batch integrator pays.


@dataclass(frozen=True, eq=False)
class Catch:
    """Result of one chunk: orbits with their hits by transients and by Newton's method, and the other transients."""

    #: Each orbit with the number of transients that settled on it, and of Newton iterations that ended on it.
    orbits: tuple[tuple[Orbit, int, int], ...]
    #: shape (count, state_size): Last states of the transients that did not become periodic.
    unsettled: NDArray[np.float64]
    ran_away: int  #: Number of transients that could not be followed.
    newton_starts: int  #: Number of starts of Newton's method.


def search_chunk(chunk: Chunk) -> Catch:
    """Process one chunk. The result depends only on the chunk, so chunks can be distributed over processes."""
    # Every start is followed until it settles. States along the transients are starts of Newton's method for orbits of
    # several periods, stable or not. Finally, Newton's method with deflation searches near each new orbit for others.
    options = chunk.options
    lanes = lanes_of(chunk.system, chunk.starts, chunk.box) if chunk.many else None
    hunt = _Hunt(chunk, lanes)
    settler = Settler(chunk.system, hunt.catalogue, options.periods, options.patience, lanes)
    every = math.ceil(options.starts / options.newton_starts) if options.newton_starts else 0
    unsettled, ran_away = [], 0
    first = chunk.block * options.block
    if (
        lanes is not None and every
    ):  # stable orbits that Newton's method finds let transients settle that die away slowly
        for number, path in enumerate(lanes.paths(chunk.starts, _LATE + max(options.newton_periods)), first):
            if number % every == 0:
                hunt.along(number // every, path)
        hunt.together()
    for number, settling in enumerate(settler.settle_each(chunk.starts), first):
        if settling.entry is not None:
            settling.entry.settled += 1
        elif settling.ran_away:
            ran_away += 1
        else:
            unsettled.append(settling.path[-1])
        if every and number % every == 0:
            if lanes is None:
                hunt.along(number // every, settling.path)
            if settling.entry is None:
                hunt.at_return(number // every, settling.path)
    hunt.together()
    if len(unsettled) <= _FEW * len(chunk.starts):  # if most have settled, a few may still linger near a chaotic saddle
        settler = Settler(chunk.system, hunt.catalogue, options.periods, _PATIENCE * options.patience, lanes)
        late = [*settler.settle_each(np.array(unsettled))] if unsettled else []
        unsettled = [settling.path[-1] for settling in late if settling.entry is None]
        for settling in late:
            if settling.entry is not None:
                settling.entry.settled += 1
    if every:
        hunt.beside()
    found = tuple((entry.orbit, entry.settled, entry.newton) for entry in hunt.catalogue.entries)
    last = np.array(unsettled).reshape(-1, len(chunk.box))
    return Catch(tuple(each for each in found if each[1] or each[2]), last, ran_away, hunt.tried)


class _Hunt:
    """Search for orbits, stable or not, by Newton's method: at once, or in lanes when all starts are known."""

    def __init__(self, chunk: Chunk, lanes: Lanes | None) -> None:
        self._chunk, self._lanes = chunk, lanes
        self._waiting: list[tuple[NDArray[np.float64], int]] = []
        self._random = generator(chunk.options.seed, chunk.value, chunk.block + 1)
        self._equations: dict[int, ShootingEquation] = {}
        self.catalogue = Catalogue(chunk.box)
        self.tried = 0
        for orbit in chunk.known:
            self.catalogue.add(orbit)
        self._known = len(self.catalogue.entries)

    def along(self, number: int, path: NDArray[np.float64]) -> None:
        """Search from states along a transient."""
        # One transient in m is used for period m, so that all periods take the same time. Newton's method for long
        # periods converges from fewer states. It therefore begins later, when the transient is nearer to its attractor.
        # For short periods it begins early too, where it may reach orbits that the transient moves away from.
        for period in self._periods(number):
            for place in (_EARLY, _LATE + period)[period > _SHORT :]:
                state = path[min(place, len(path) - 1)]
                if self._lanes is not None or self.catalogue.nearest(state, period)[1] > _THERE:
                    self._begin(state, period)

    def at_return(self, number: int, path: NDArray[np.float64]) -> None:
        """Search from the closest return of a transient that has not settled."""
        for period in self._periods(number):
            if len(path) > 2 * period:
                returns = np.abs((path[period:] - path[:-period]) / self._chunk.box).max(axis=1)
                self._begin(path[int(np.argmin(returns))], period)

    def _periods(self, number: int) -> Iterator[int]:
        return (period for period in self._chunk.options.newton_periods if number % period == 0)

    def _begin(self, start: NDArray[np.float64], period: int) -> None:
        if self._lanes is None:
            self._try(start, period)
        else:
            self._waiting.append((start, period))

    def together(self) -> None:
        """Apply Newton's method in lanes from the starts that wait, and exactly from where it leads."""
        # Like `_try`, it gives up what leads to an orbit that is already in the catalogue.
        if self._lanes is None or not self._waiting:
            return
        starts, periods = np.array([start for start, _ in self._waiting]), np.array([m for _, m in self._waiting])
        self._waiting.clear()
        away = self.catalogue.nearest_each(starts, periods)[1] > _THERE
        starts, periods = starts[away], periods[away]
        self.tried += len(starts)

        def are_met(which: NDArray[np.intp], states: NDArray[np.float64]) -> NDArray[np.bool_]:
            entries, distances = self.catalogue.nearest_each(states, periods[which])
            near = distances <= _THERE
            for place in np.flatnonzero(near).tolist():
                if (entry := entries[place]) is not None:
                    entry.newton += 1
            return near

        for state, period in zip(newton_in_lanes(self._lanes, starts, periods, are_met), periods.tolist(), strict=True):
            if np.isfinite(state).all():
                entry, distance = self.catalogue.nearest(state, period)
                if entry is not None and distance <= _THERE:
                    entry.newton += 1
                else:
                    self.tried -= 1  # it is counted again
                    self._try(state, period)

    def beside(self) -> None:
        """Search near each orbit found, with all known ones deflated: a second orbit is often near."""
        # Orbits known beforehand are skipped: orbits near them lie on their branches, or on branches attached to these.
        done = self._known
        while done < min(len(self.catalogue.entries), self._known + _NEARBY):  # the list grows in the loop
            orbit = self.catalogue.entries[done].orbit
            kick = self._random.normal(size=len(orbit.state))
            kick[2 * orbit.system.size :] = 0.0  # friction would not let an extension be larger
            kick *= _KICK / np.linalg.norm(kick)
            self._try(orbit.state + kick * self._chunk.box, orbit.period, self.catalogue.states(orbit.period))
            done += 1

    def _try(self, start: NDArray[np.float64], period: int, known: NDArray[np.float64] | None = None) -> None:
        """Apply Newton's method from a start, and give up if it leads to an orbit that is already in the catalogue."""
        self.tried += 1
        met: list[Entry] = []

        def is_met(state: NDArray[np.float64]) -> bool:
            entry, distance = self.catalogue.nearest(state, period)
            if entry is not None and distance <= _THERE:
                met.append(entry)
            return bool(met)

        if period not in self._equations:
            self._equations[period] = ShootingEquation(self._chunk.system, None, period)
        state = newton_aside(self._equations[period], start, self._chunk.box, known, is_enough=is_met)
        orbit = None if state is None else exact_orbit(self._chunk.system, period, state)
        if orbit is not None:
            met.append(self.catalogue.add(orbit))
        for entry in met:
            entry.newton += 1


@dataclass(eq=False)
class _Transient:
    """One transient so far."""

    path: list[NDArray[np.float64]]  #: States at the start of each forcing period.
    finest: float = _RETURN  #: Distance of a return, in half-widths of the box, below which it may be settling.
    #: beside, before: The nearest stable orbit at the last examination, and its distance.
    beside: Entry | None = None
    before: float = math.inf


class Settler:
    """Integrator that follows the transients of one system until they settle."""

    def __init__(
        self, system: System, catalogue: Catalogue, periods: int, patience: int, lanes: Lanes | None = None
    ) -> None:
        self._system, self._catalogue, self._periods, self._patience = system, catalogue, periods, patience
        self._flow, self._coefficients, self._lanes = flow_of(system), coefficients_of(system), lanes

    def settle_each(self, states: NDArray[np.float64]) -> Iterator[Settling]:
        """Follow the transients from some states, one after the other as they are asked for, or all at once."""
        if self._lanes is None:
            yield from map(self.settle, states)
            return
        transients, found = [_Transient([state]) for state in states], dict[int, Settling]()
        while waiting := [number for number in range(len(states)) if number not in found]:
            strobes = self._lanes.strobes(np.array([transients[number].path[-1] for number in waiting]), _TOGETHER)
            for number, after in zip(waiting, strobes.transpose(1, 0, 2), strict=True):
                settling = self._examined(transients[number], after)
                if settling is not None and settling.ran_away:
                    settling = self.settle(states[number])  # the exact flow decides whether it diverges
                if settling is not None:
                    found[number] = settling
        yield from (found[number] for number in range(len(states)))

    def settle(self, state: NDArray[np.float64]) -> Settling:
        """Follow the transient from a state until it has settled, has diverged, or shows no sign of settling."""
        # It has settled if it returns closely and Newton's method finds a stable orbit there. Earlier than that, it has
        # settled if it approaches a known stable orbit from one examination to the next.
        transient = _Transient([state])
        try:
            while self._goes_on(transient.path):
                transient.path += list(self._flow.sample(self._coefficients, transient.path[-1], _STROBES).states[1:])
                entry = self._settled(transient)
                if entry is not None:
                    return Settling(np.array(transient.path), entry)
        except FlowError:
            return Settling(np.array(transient.path), None, ran_away=True)
        return Settling(np.array(transient.path), None)

    def _examined(self, transient: _Transient, after: NDArray[np.float64]) -> Settling | None:
        """Return the outcome of a transient within its next states; None if it should be followed further."""
        for states in np.split(after, len(after) // _EVERY):
            if not self._goes_on(transient.path):
                return Settling(np.array(transient.path), None)
            if not np.isfinite(states).all():
                return Settling(np.array(transient.path), None, ran_away=True)
            transient.path += list(states)
            entry = self._settled(transient)
            if entry is not None:
                return Settling(np.array(transient.path), entry)
        return None

    def _settled(self, transient: _Transient) -> Entry | None:
        """Return the stable orbit on which a transient has settled since the last examination; None if it has not."""
        path = transient.path
        entry, distance = self._catalogue.nearest_stable(path[-1])
        if entry is transient.beside and distance < transient.before <= _NEAR:
            return entry
        transient.beside, transient.before = entry, distance
        period = self._returns(path, transient.finest)
        if period:
            entry = self._orbit_near(path[-1], period)
            if entry is not None:
                return entry
            transient.finest = max(transient.finest / 10.0, _FINEST)
        return None

    def _goes_on(self, path: list[NDArray[np.float64]]) -> bool:
        """Return True if a transient should be followed further: it is still short, or its returns shrink."""
        length = len(path) - 1
        if length < max(self._patience, 4 * self._periods):  # before that there are no two halves to compare
            return True
        if length >= _LONGEST * self._patience:
            return False
        if (length - self._patience) % max(_EVERY, self._patience // _DOUBTS // _EVERY * _EVERY) >= _EVERY:
            return True  # the next examination is not due yet
        half = max(self._patience // 2, 2 * self._periods)
        last, before = self._closeness(path[-half:]), self._closeness(path[-2 * half : -half])
        return last < _SHRINKING * before

    def _closeness(self, path: list[NDArray[np.float64]]) -> float:
        """Return the median distance of returns in a section of the path, for the period that returns most closely."""
        states = np.array(path) / self._catalogue.scales
        returns = [np.abs(states[m:] - states[:-m]).max(axis=1) for m in range(1, self._periods + 1) if m < len(states)]
        return min(float(np.median(each)) for each in returns)

    def _returns(self, path: list[NDArray[np.float64]], finest: float) -> int:
        """Return the smallest number of forcing periods after which the last state recurs within `finest`, or 0."""
        last = np.array(path[-self._periods - 1 :]) / self._catalogue.scales
        distances = np.abs(last[-1] - last[-2::-1]).max(axis=1)
        close = np.flatnonzero(distances <= finest)
        return int(close[0]) + 1 if len(close) else 0

    def _orbit_near(self, state: NDArray[np.float64], period: int) -> Entry | None:
        """Return the stable orbit on which a state that nearly returns has settled."""
        entry, distance = self._catalogue.nearest(state, period)
        if entry is None or distance > _NEAR or not entry.orbit.stable:
            equation = ShootingEquation(self._system, None, period)
            exact = newton_aside(equation, state, self._catalogue.scales, options=Deflation(iterations=8))
            orbit = None if exact is None else exact_orbit(self._system, period, exact)
            if orbit is None:
                return None
            entry = self._catalogue.add(orbit)
            distance = float(np.abs((entry.states - state) / self._catalogue.scales).max(axis=1).min())
        if entry.orbit.stable and distance <= _NEAR:
            return entry
        entry.newton += 1
        return None
