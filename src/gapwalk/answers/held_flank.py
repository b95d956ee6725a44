"""Ends of quiet bands exactly, before any transient: the response with all teeth held on their flank.

In the held system, the spring of a gap whose parts press on one flank may also pull. So this system has no gap, and its
response is a smooth curve. While no flank pulls, its motion is one of the machine. Where the smallest force of a flank
is zero, the quiet motion ends, and beyond there is none.

Method: docs/numerics/notes/answers.md
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import RANGE, BandEnd, chosen_gaps, contact_place, innermost, kept
from gapwalk.bifurcation.kinds import Kind
from gapwalk.bifurcation.loci.gradient import moving_names
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation, ShotPlane
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bracketed_root import find_root
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError, FlowError, ModelError, NumericalError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.forces import contact_deflections
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.laws import Stages, StageTerms
from gapwalk.model.system import System
from gapwalk.model.words import value_words
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.shooting import Shooting

Ends = tuple[tuple[BandEnd, BandEnd], ...]
"""Ranges by their ends, the low one first."""
JUMP = "jump"
"""Kind of an end at which the held motion itself ends, as other non-linear parts make it jump."""
_FIRST, _LONGEST, _SHORTEST = 1 / 128, 1 / 16, 1 / 4096  # steps of the response, as shares of the range
_GOOD, _ASTRAY = 0.02, 0.2  # distance from the guess, as a share of the motion, from which steps shrink; are refused
_ITERATIONS, _STEP = 16, 1e-7  # of Broyden's method, and of the differences with which it begins
_LOOKS, _HOPE = 5, 0.1  # iterations after which it fails if the residual, relative to the first, has not come so far
_ROUGH, _ENOUGH, _EXACT = 1e-8, 1e-10, 1e-14  # residuals relative to the state: of a walk, of an end, of rounding
_NEAR, _ABOUT = 1e-9, 1e-4  # shares of the range to which ends are located that are exact, and the others
_ROUNDING = 1e-12  # relative error of an end, beside the last step of Newton's method
_TINY = 1e-300  # size of a motion that is none
_SHRINKS, _CLOSE = 0.5, 1e-10  # ratio of the steps of Newton's method towards a touch; the relative step that ends them


@dataclass(frozen=True, eq=False)
class QuietLimit:
    """The held response at one gap: where it would pull, and where the quiet motion ends."""

    gap: str  #: Name of the contact.
    side: int  #: The flank on which it is held: 1 or -1; 0 if nothing presses it, so that it is open.
    #: shape (points,): The least force of the held contact in a period at each of `QuietLimits.values`, positive while
    #: it presses.
    forces: NDArray[np.float64]
    #: Ranges in which the held contact would pull. Their ends are those of the held motion.
    lifts: Ends
    #: The ends among them at which no other held contact pulls, so that the motion is one of the machine: ends of the
    #: quiet motion, with the orbit as `special.orbit`. Others follow impacts of gaps that have lifted before: they need
    #: simulation.
    exact: tuple[BandEnd, ...]


@dataclass(frozen=True, eq=False)
class QuietLimits:
    """Held response over a range, and the ranges in which no quiet motion exists."""

    system: System  #: The held system.
    parameter: str  #: Name of the parameter.
    within: tuple[float, float]  #: The range over which the held motion was followed.
    values: NDArray[np.float64]  #: shape (points,): Values of the parameter at which it was computed.
    limits: tuple[QuietLimit, ...]  #: One for each gap.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.

    @property
    def restless(self) -> Ends:
        """The ranges in which no quiet motion exists: one of the gaps must rattle. They lie between the exact ends."""
        found: list[tuple[BandEnd, BandEnd]] = []
        every = [pair for limit in self.limits for pair in limit.lifts]
        for low, high in sorted(every, key=lambda pair: pair[0].value):
            if found and low.value <= found[-1][1].value:
                found[-1] = found[-1][0], max(found[-1][1], high, key=lambda end: end.value)
            else:
                found.append((low, high))
        return tuple(found)


def quiet_limits(
    system: System, parameter: str, within: tuple[float, float], gaps: str | Iterable[str] = (), *, rising: bool = False
) -> QuietLimits:
    """Return where quiet motions end over a parameter, with the gaps held on the flank that the mean load presses.

    The held motion is followed from the upper end of the range, or from the lower one if the parameter is `rising`.
    """
    names, (low, high) = chosen_gaps(system, gaps), sorted(map(float, within))
    if low == high:
        raise ModelError(f"the range of {parameter} has no width: {low:g} to {high:g}")
    for name in names:
        if system.structure.contacts[contact_place(system, name)].law.rebounds:
            raise ModelError(
                f"{name} is a rigid stop, which no spring can hold closed; leave it out of gaps, or give it a stiffness"
            )
    begin, end = (low, high) if rising else (high, low)
    held = system.at({parameter: end}).at({parameter: begin})
    rests = find_equilibria(held).equilibria
    if not rests:
        raise ConvergenceError("there is no static equilibrium: nothing holds the mean load, so no motion is quiet")
    pressed = {contact.name: contact.side for contact in rests[0].contacts}
    sides = {gap: pressed[gap] for gap in names}
    for name, side in sides.items():
        held = kept(held, name, side)
    response = _Response(held, parameter, high - low, sides)
    response.walk(begin, end, np.concatenate((rests[0].position, np.zeros(held.state_size - held.size))))
    return _judged(response, (low, high))


class _Point:
    """A held orbit."""

    def __init__(self, system: System, value: float, state: NDArray[np.float64], sides: Mapping[str, int]) -> None:
        self.system, self.value, self.state, self.sides = system, value, state, sides
        self.layout, self.coefficients = layout_of(system.structure), coefficients_of(system)

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit, without its multipliers."""
        return unpolished(self.system, 1, self.state)

    @cached_property
    def depths(self) -> dict[str, float]:
        """Least depth of each gap beyond the breakpoint of its flank; inf for one that is not held."""
        found, means = dict.fromkeys(self.sides, math.inf), self.orbit.extremes[:, 2]
        for gap, side in self.sides.items():
            for switch in [each for each, own in innermost(self.system, gap).items() if own == side]:
                turns = self.orbit.turning_depths[switch].values
                found[gap] = min(turns) if turns else self._depth(switch, self.state[: self.system.size])
                if self._depth(switch, means) < 0.0:
                    raise ModelError(
                        f"the mean load does not press {gap} on the same flank over the whole range: at "
                        f"{self.value:.6g} it is on the other flank, or on none; compute each part of the range alone"
                    )
        return found

    def is_first(self, gap: str) -> bool:
        """Return True if no contact but this one pulls."""
        return all(depth > 0.0 for name, depth in self.depths.items() if name != gap)

    def _depth(self, switch: int, q: NDArray[np.float64]) -> float:
        contact, side, clearance = self.system.breakpoints[switch]
        return side * float(contact_deflections(self.layout, self.coefficients, 0.0, q)[contact]) - clearance

    def force(self, gap: str) -> float:
        """Return the force of a held contact where its depth is least and its rate zero; positive if it presses."""
        slots, side, given = self.layout.contacts[contact_place(self.system, gap)], self.sides[gap], self.coefficients
        if not side:
            return 0.0
        stages, first = list[StageTerms](), next(each for each in slots.stages if each.sign * each.innermost == side)
        x = side * (self.depths[gap] + given[first.numbers["clearance"]])
        for each in slots.stages:
            numbers = {name: given[at] for name, at in each.numbers.items()}
            depth = x - each.sign * numbers["clearance"]
            stages.append(StageTerms(each.sign, depth, float(each.sign * depth > 0.0), each.innermost, numbers))
        whole, law = {name: given[at] for name, at in slots.numbers.items()}, slots.form.law
        return side * float(law.force(0.0, Stages(stages, modes=[1.0] * law.mode_count), whole))


def unpolished(system: System, period: int, state: NDArray[np.float64]) -> Orbit:
    """Return the motion of one period from a state as an orbit, without its multipliers."""
    arc = flow_of(system).integrate(coefficients_of(system), state, 0.0, PERIOD * period)
    events, unknown = tuple(arc.contacts), np.full(len(state), 0j)
    return Orbit(system, period, state, unknown, events, 0.0, arc.steps, slips=tuple(arc.slips))


class _Response:
    """Held orbits over the parameter, followed from an end of its range as far as they go.

    Each is found by Broyden's method from the states before it: an iteration is one period without derivatives, some
    fifty times cheaper than one of Newton's method.
    """

    def __init__(self, held: System, parameter: str, width: float, sides: Mapping[str, int]) -> None:
        self.held, self.parameter, self.width, self.sides = held, parameter, width, sides
        self.line, self.scales = ParameterLine(held, parameter), held.state_scales()
        self.points: list[_Point] = []
        self.jacobian: NDArray[np.float64] | None = None

    def words(self, value: float) -> str:
        """Write a value of the parameter."""
        return value_words(value, self.parameter, self.held.units, 7)

    @property
    def ordered(self) -> list[_Point]:
        """The points, by the parameter."""
        return sorted(self.points, key=lambda point: point.value)

    def walk(self, begin: float, end: float, rest: NDArray[np.float64]) -> None:
        """Follow the response from a state of rest at one value towards another."""
        first = self._solved(begin, rest)
        self._add(begin, find_orbit(self.line.system_at(begin)).state if first is None else first)
        way, value, step = math.copysign(1.0, end - begin), begin, _FIRST * self.width
        while value != end:
            ahead = value + way * step
            ahead = end if way * (end - ahead) < _NEAR * self.width else ahead
            guess = self._guess(ahead, self.points[-3:])
            state = self._solved(ahead, guess, twice=step > _FIRST * self.width)
            far = math.inf if state is None else self._apart(state, guess)
            if state is None or far > _ASTRAY:
                if step <= _SHORTEST * self.width:
                    return
                step *= 0.25
                continue
            self._add(ahead, state)
            factor = 2.0 if far < _GOOD else 1.0 if far < 0.5 * _ASTRAY else 0.5
            value, step = ahead, min(step * factor, _LONGEST * self.width)

    def at(self, value: float, goal: float = _EXACT) -> _Point:
        """Return the held orbit at a value between those of the walk."""
        near = sorted(self.points, key=lambda point: abs(point.value - value))[:3]
        if near[0].value == value:
            return near[0]
        for guess in self._guess(value, near), near[0].state:
            if (state := self._solved(value, guess, goal)) is not None:
                return self._add(value, state)
        raise ConvergenceError(f"no motion with held flanks was found at {self.words(value)}, but one was nearby")

    def _add(self, value: float, state: NDArray[np.float64]) -> _Point:
        self.points.append(_Point(self.line.system_at(value), value, state, self.sides))
        return self.points[-1]

    def _apart(self, state: NDArray[np.float64], guess: NDArray[np.float64]) -> float:
        """Return the distance of two states, as a share of their size."""
        return float(np.abs((state - guess) / self.scales).max() / np.abs(state / self.scales).max())

    def _guess(self, value: float, near: Sequence[_Point]) -> NDArray[np.float64]:
        """Interpolate the states of some points."""
        found = np.zeros(self.held.state_size)
        for one in near:
            others = [other.value for other in near if other is not one]
            found += one.state * math.prod((value - other) / (one.value - other) for other in others)
        return found

    def _solved(
        self, value: float, guess: NDArray[np.float64], goal: float = _ROUGH, *, twice: bool = True
    ) -> NDArray[np.float64] | None:
        """Return the periodic state near a guess by Broyden's method, begun twice if asked; None if it fails."""
        # What friction keeps that never slips leaves a direction without a residual, hence least squares.
        system, enough = self.line.system_at(value), max(goal, _ENOUGH)
        flow, coefficients = flow_of(system), coefficients_of(system)
        for jacobian in (self.jacobian, None) if twice or self.jacobian is None else (self.jacobian,):
            x, last, best = guess / self.scales, None, (math.inf, guess)
            first = 0.0
            with suppress(FlowError):
                jacobian = self._differences(flow, coefficients, x) if jacobian is None else jacobian
                for number in range(_ITERATIONS):
                    residual = flow.integrate(coefficients, x * self.scales).state / self.scales - x
                    error = float(np.abs(residual).max() / max(float(np.abs(x).max()), _TINY))
                    if last is not None:
                        wrong = residual - last[1] - jacobian @ last[0]
                        jacobian = jacobian + np.outer(wrong, last[0]) / float(last[0] @ last[0])
                    first = error if not number else first
                    if error >= best[0] and (best[0] <= enough or (number >= _LOOKS and best[0] > _HOPE * first)):
                        break
                    best = (error, x * self.scales) if error < best[0] else best
                    if error <= goal:
                        break
                    last = -np.linalg.lstsq(jacobian, residual, rcond=_ENOUGH)[0], residual
                    x = x + last[0]
            if best[0] <= enough:
                self.jacobian = jacobian
                return best[1]
        return None

    def _differences(
        self, flow: Flow, coefficients: NDArray[np.float64], x: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivative of the residual by differences: to compile one takes longer than the whole walk."""
        step = _STEP * max(float(np.abs(x).max()), _TINY)
        moved = np.vstack((x + step * np.eye(len(x)), x)) * self.scales
        ends = np.array([flow.integrate(coefficients, each).state for each in moved]) / self.scales
        return (ends[:-1] - ends[-1]).T / step - np.eye(len(x))


def _judged(response: _Response, within: tuple[float, float]) -> QuietLimits:
    """Return the ranges in which held contacts would pull, with located ends."""
    first, last = response.ordered[0], response.ordered[-1]
    low, high = (
        BandEnd(each.value, RANGE) if each.value in within else BandEnd(each.value, JUMP, _SHORTEST * response.width)
        for each in (first, last)
    )
    limits, notes = list[QuietLimit](), list[str]()
    for gap, side in response.sides.items():
        if not side:
            notes.append(f"nothing presses {gap} on a flank: only a simulation shows whether it rattles")
        ends = [*[low] * (first.depths[gap] < 0.0), *(_ends(response, gap) if side else ())]
        ends += [high] * (len(ends) % 2)
        exact = tuple(end for end in ends if end.special)
        limits.append(QuietLimit(gap, side, np.zeros(0), tuple(zip(ends[::2], ends[1::2], strict=True)), exact))
    for end in (each for each in (low, high) if each.kind == JUMP):
        notes.append(
            f"with the flanks held, the motion jumps at {response.words(end.value)} because of other nonlinear parts; "
            "beyond, other motions may settle, periodic or not"
        )
    for special in [end.special for limit in limits for end in limit.exact if end.special]:
        stuck = " and ".join(special.orbit.system.structure.contacts[place].name for place in special.orbit.stuck)
        where = response.words(special.value)
        notes += [f"the quiet motion is lost before {where}: it is unstable there"] * (not special.orbit.stable)
        notes += [f"{stuck} never slips at {where}: the quiet range depends on where it sticks"] * bool(stuck)
    points = response.ordered  # with those at which ends were looked for
    values, extent = np.array([point.value for point in points]), (low.value, high.value)
    limits = [replace(each, forces=np.array([point.force(each.gap) for point in points])) for each in limits]
    return QuietLimits(response.held, response.parameter, extent, values, tuple(limits), tuple(notes))


def _ends(response: _Response, gap: str) -> Iterator[BandEnd]:
    """Yield the values at which a held contact just begins or ceases to pull; located where no other one pulls."""
    _look_into_dips(response, gap)
    for one, other in pairwise(response.ordered):
        if one.depths[gap] * other.depths[gap] >= 0.0:
            continue
        is_first = one.is_first(gap) or other.is_first(gap)
        near, at = (
            (_NEAR if is_first else _ABOUT) * response.width,
            partial(response.at, goal=_EXACT if is_first else _ROUGH),
        )
        root = find_root(lambda value, at=at: at(value).depths[gap], one.value, other.value, absolute=near)
        point = at(root.place)
        located = point.is_first(gap) and is_first
        switch = next(each for each, own in innermost(point.system, gap).items() if own == response.sides[gap])
        yield (
            grazing_near(point.orbit, response.parameter, switch)
            if located
            else BandEnd(point.value, str(Kind.GRAZING), 2.0 * near)
        )


def _look_into_dips(response: _Response, gap: str) -> None:
    """Add points where the parabola through three of them comes near to zero between."""
    points = response.ordered
    for three in zip(points, points[1:], points[2:], strict=False):
        depths = [point.depths[gap] for point in three]
        if 0.0 < depths[1] <= min(depths[0], depths[2]):
            x = np.array([point.value for point in three]) - three[1].value
            bend, slope, _ = np.polyfit(x, depths, 2)
            if bend > 0.0 and 0.25 * slope**2 / bend > 0.5 * depths[1]:
                response.at(three[1].value - 0.5 * slope / bend)


def grazing_near(orbit: Orbit, parameter: str, switch: int, theta: float | None = None) -> BandEnd:
    """Return the grazing point of a breakpoint near an orbit; a NumericalError if Newton's method does not find it.

    It is that of the turning point at the angle `theta`; by default of the one nearest to the breakpoint.
    """
    names = parameter, moving_names(orbit.system, parameter)[0]
    wide = ShotPlane(orbit.system, names, orbit.period, Shooting())
    plane = replace(wide, names=names[:1])
    equation = GrazingEquation(plane, switch, 0.0, _EXACT)
    unknowns = equation.unknowns(orbit)
    scales = np.concatenate((plane.scales(orbit), [PERIOD, abs(orbit.system[parameter]) or 1.0]))
    unknowns[-2], far = unknowns[-2] if theta is None else theta, math.inf
    while True:
        residual, matrix, place = equation.linearised(unknowns)
        before, step = unknowns, -scales * np.linalg.solve(matrix[:, : len(scales)] * scales, residual)
        unknowns, last, far = before + step, far, abs(float(step[-1]))
        if far <= _CLOSE * abs(float(unknowns[-1])):
            break
        if not far <= _SHRINKS * last:
            raise ConvergenceError(f"no touch was found near {parameter} = {orbit.system[parameter]:.6g}")
    value = float(unknowns[-1])
    error = far + _ROUNDING * abs(value)
    evaluation = Evaluation(place.residual, place.jacobian, None, place)
    orbit = wide.orbit(before[:-2], float(before[-1]), orbit.system[names[1]], evaluation)
    at = BranchPoint(value, orbit, np.append(orbit.state, value), np.zeros(len(orbit.state) + 1), math.nan, math.nan)
    contact, sides = describe_switch(orbit, switch), orbit.instability
    special = SpecialPoint(Kind.GRAZING, at, sides, sides, error, contact, parameter=parameter)
    return BandEnd(value, str(Kind.GRAZING), error, special)


@dataclass(frozen=True, eq=False)
class QuietRanges:
    """Where a system cannot be quiet, known before any transient is run."""

    notes: tuple[str, ...]  #: Remarks, in sentences.


def quiet_ranges(system: System, parameter: str, within: tuple[float, float], gaps: Sequence[str]) -> QuietRanges:
    """Say where no motion is quiet, by the exact ends of the held response, or why that is not known."""
    try:
        found = quiet_limits(system, parameter, within, gaps)
    except (ModelError, NumericalError) as error:
        return QuietRanges((f"the ends of the quiet motion are not exact: {error}",))
    ranges = [
        f"from {value_words(low.value, parameter, system.units)} to {value_words(high.value, parameter, system.units)}"
        for low, high in found.restless
    ]
    notes = [f"no motion is quiet {' and '.join(ranges)}: a closed contact would have to pull there"] if ranges else []
    return QuietRanges((*notes, *found.notes))
