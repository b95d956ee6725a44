"""Onset of slip: the place of a branch at which friction that never slips begins to, or at which its slip ends.

Friction that never slips keeps its position, and the orbits are a continuum. From a position off the middle its force
reaches the bound of one direction first. From there on the position moves so that it just reaches it, until the force
reaches the bound of the other direction too. Beyond, friction slips both ways. That second place does not depend on
where friction was left: position and parameter are determined by the two bounds. There slip ends on the way back, at
that position, which friction then keeps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.step_interval import StepInterval
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.friction_gauge import Course, FrictionGauge
from gapwalk.flow.motion import DryModes, modes_along
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, apart
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.orbit.sticking import FrictionPhase, kept_row

# The margin of one change of the sequence of slip and stick: zero where its phase appears or vanishes.

_SAME = 1.0  # radians by which an event may move in a step: where a quantity touches, by the root of its change
_TRACKED = 0.05  # radians by which the least value may have moved since it was known, without being searched for
_ROUGH = 0.1  # radians by which it may be off as a margin of the orbit, by its samples
_SMALL = 1e-4  # share of a value that does not matter far from its zero
_SETTLED, _REFINEMENTS = 1e-5, 8  # last step towards it, whose cube is rounding, and the largest number of steps
_AT_START = 1e-6  # radians from the start of the period within which an instant is taken from its end


class Change(NamedTuple):
    """A phase of friction that appears or vanishes."""

    contact: int  #: Number of the contact.
    #: before, mode, after: Mode of the phase before it, its own, and that of the phase after it.
    before: int
    mode: int
    after: int
    theta: float  #: The angle at which it begins.
    alone: bool  #: True if friction never slips without it.
    others: int = 0  #: Number of the other phases of the same mode between phases of the same modes.

    @property
    def side(self) -> int:
        """Direction of slip that the change concerns: 1 or -1."""
        return self.before or self.mode

    @property
    def reverses(self) -> bool:
        """True if it begins where the slip rate reverses its sign, not where a quantity touches zero."""
        return self.before != self.after


def modes_around(phases: Sequence[FrictionPhase]) -> list[tuple[int, int, int]]:
    """Return the modes before, in and after each phase of a period."""
    modes = [phase.mode for phase in phases]
    return list(zip([*modes[-1:], *modes[:-1]], modes, [*modes[1:], *modes[:1]], strict=True))


def own_phase(orbit: Orbit, change: Change, near: float) -> FrictionPhase | None:
    """Return the phase of a change nearest to an angle, if an orbit has it."""
    phases, full = orbit.friction.get(change.contact, []), PERIOD * orbit.period
    own = (change.before, change.mode, change.after)
    alike = [phase for phase, around in zip(phases, modes_around(phases), strict=True) if around == own]
    if len(alike) <= change.others:
        return None
    found = [(phase.away(near, full), phase) for phase in alike]
    return min((pair for pair in found if pair[0] < _SAME), key=lambda pair: pair[0], default=(0.0, None))[1]


def margin(orbit: Orbit, change: Change, near: float) -> tuple[float, float]:
    """Return the angle nearest to another one at which a change happens, and its margin there."""
    full, coefficients, readings = PERIOD * orbit.period, coefficients_of(orbit.system), flow_of(orbit.system).readings
    gauge = FrictionGauge(layout_of(orbit.system.structure), change.contact, readings)
    if change.reverses:
        phases = orbit.friction.get(change.contact, [])
        theta = min(
            (
                phase.start
                for place, phase in enumerate(phases)
                if phases[place - 1].mode == change.before and phase.mode in (change.mode, change.after)
            ),
            key=lambda start: apart(start, near, full),
            default=math.inf,
        )
        if not apart(theta, near, full) < _SAME:
            raise LookupError
        now, side = instant_of(orbit, theta), change.side
        at = coefficients, now.theta, now.state, gauge.sticking(now.modes)
        reserve = float(gauge.reserve(*at, -side))
        # stick ends at one bound or at the other, whose reserve is zero; both are where the bounds vanish
        return theta, reserve if change.before else reserve - float(gauge.reserve(*at, side))
    quantity = _Quantity(orbit, gauge, change)
    own = own_phase(orbit, change, near)
    if own is not None:
        course = quantity.course(instant_of(orbit, own.start))
        # the angle is that of the vertex, which the least value has on the other side of the change
        return (own.start + quantity.turned(course)) % full, -abs(course.depth)
    return _least(orbit, quantity, change, near)


class _Instant(NamedTuple):
    """One instant of an orbit: its angle, its state, and the modes just before it."""

    theta: float
    state: NDArray[np.float64]
    modes: DryModes


def instant_of(orbit: Orbit, theta: float) -> _Instant:
    """Return the state of an orbit, and its modes, at an angle, which may lie beyond its period."""
    # the modes before the start of the period are those at its end
    full = PERIOD * orbit.period
    angle = theta % full if theta % full > _AT_START else theta % full + full
    angles, flow = np.array([0.0, angle]), flow_of(orbit.system)
    found = flow.sample(coefficients_of(orbit.system), orbit.state, angles, orbit.known_states)
    modes = modes_along(orbit.system.structure, np.array([angle]), found.slips, found.holds, before=True)
    return _Instant(angle, found.states[1], modes.at(0))


class _Quantity:
    """Slip rate or reserve of one orbit, whose least value is the margin of a change."""

    def __init__(self, orbit: Orbit, gauge: FrictionGauge, change: Change) -> None:
        self._gauge, self._change, self._coefficients = gauge, change, coefficients_of(orbit.system)
        self._function = gauge.rate if change.before else gauge.reserve

    def _modes(self, now: _Instant) -> DryModes:
        """Return the modes with the friction as it is before the phase of the change."""
        before = self._change.before
        return self._gauge.slipping(now.modes, before) if before else self._gauge.sticking(now.modes)

    def course(self, now: _Instant) -> Course:
        """Return it at an instant, with its derivatives."""
        at = self._coefficients, now.theta, now.state, self._modes(now), self._change.side
        return self._gauge.course(self._function, *at)

    def turned(self, course: Course) -> float:
        """Return the angle from an instant to the vertex of the parabola there."""
        return course.vertex / float(self._coefficients[0])


def _least(orbit: Orbit, quantity: _Quantity, change: Change, near: float) -> tuple[float, float]:
    """Return the angle and the value of the minimum of a quantity within a phase, the nearest to another angle."""
    full, what = PERIOD * orbit.period, "rate" if change.before else "reserve"
    found = _vertex(orbit, quantity, near, _TRACKED) if _is_within(orbit, change, near) else None
    if found is None:
        own = [
            each
            for each in orbit.margins
            if (each.contact, each.what, each.side) == (change.contact, what, change.side)
        ]
        own = [each for each in own if apart(each.theta, near, full) < _SAME]
        if own:
            found = _vertex(orbit, quantity, min(own, key=lambda each: each.value).theta, _ROUGH)
    if found is None:
        raise LookupError
    return found


def _is_within(orbit: Orbit, change: Change, theta: float) -> bool:
    """Return True if an angle is within a phase like that before a change."""
    phases, full = orbit.friction.get(change.contact, []), PERIOD * orbit.period
    return any(phase.mode == change.before and phase.contains(theta, full) for phase in phases)


def _vertex(orbit: Orbit, quantity: _Quantity, theta: float, farthest: float) -> tuple[float, float] | None:
    """Return angle and value of the minimum of a quantity near an angle, by Newton's method; None if it is far off."""
    start = theta
    for _ in range(_REFINEMENTS):
        course = quantity.course(instant_of(orbit, theta))
        shift = quantity.turned(course)
        if not course.bend > 0.0 or abs(theta + shift - start) > farthest:
            return None
        theta += shift
        value = course.value - course.depth
        # what the parabola leaves out grows with the cube of the shift
        if abs(shift) < _SETTLED or course.depth * abs(shift) < _SMALL * abs(value):
            return theta % (PERIOD * orbit.period), value
    return None


_FIRST = 1e-3  # the first step towards the onset of slip, as a share of the step of the walk
_SHARE = 0.99  # share of the way to it in each step, since there are no such orbits beyond
_REACHED, _CLOSE = 1e-13, 1e-9  # arclength from it at which it is reached, and at which it is accepted
_APPROACHES = 60
_ASIDE = (1e-6, 1e-7)  # changes of a position that tell how the force follows it, in scaled variables
_AT_REST = 1e-7  # arclength from the place of rest at which it is accepted: positions are kept on a grid of 1e-9
_HALVINGS = 20  # of a step towards it that leads to slip


class Located(NamedTuple):
    """A located change."""

    point: BranchPoint  #: The point of the branch.
    change: Change  #: The change.
    spread: float  #: Arclength of its bracket.
    #: If it was located by halving the step, since its margin has no zero there: the point before it. The margin jumps
    #: where another event comes to the instant of the change, such as the opening of a stage whose force jumps.
    before: BranchPoint | None = None


def never_slips(orbit: Orbit, contact: int) -> bool:
    """Return True if friction sticks in all of an orbit."""
    return [phase.mode for phase in orbit.friction.get(contact, [])] == [0]


def position_of(orbit: Orbit, contact: int) -> float:
    """Return the position that friction has at the start of the period, which it keeps until it slips."""
    row = kept_row(layout_of(orbit.system.structure), coefficients_of(orbit.system), contact)
    return float(row @ orbit.state)


def locate_onsets(
    interval: StepInterval, first: BranchPoint, last: BranchPoint, changes: Sequence[Change]
) -> list[Located]:
    """Locate onsets or ends of slip between two points of a walk, as far as they are found, in no order."""
    found = list[Located]()
    for contact in sorted({each.contact for each in changes}):
        stuck, far = (first, last) if never_slips(first.orbit, contact) else (last, first)
        own = {each.side: each for each in changes if each.contact == contact}
        alone = _one_by_one(interval, stuck, far, own.values()) if contact in stuck.orbit.stuck else []
        if len(own) > 1:
            try:
                rest = find_rest(interval.corrector, stuck, far, contact)
            except LookupError:
                pass
            else:
                away = abs(rest.point.arclength - stuck.arclength)
                earlier = [each for each in alone if abs(each.point.arclength - stuck.arclength) < away - _AT_REST]
                alone = earlier if stuck is first else []
                sides = sorted({*own} - {each.change.side for each in alone}, reverse=True)
                alone += [
                    Located(rest.point, own[side]._replace(theta=rest.thetas[side]), rest.spread) for side in sides
                ]
        found += alone
    return found


def _one_by_one(
    interval: StepInterval, stuck: BranchPoint, far: BranchPoint, changes: Iterable[Change]
) -> list[Located]:
    """Locate each change from the point at which friction sticks, at the position that it has there."""
    found = list[Located]()
    for change in changes:
        try:
            found.append(_locate_onset(interval, stuck, far, change))
        except LookupError:
            continue
    return found


def _locate_onset(interval: StepInterval, stuck: BranchPoint, far: BranchPoint, change: Change) -> Located:
    """Locate the onset of slip from the side on which friction never slips.

    The orbits there are some of a continuum, and those at the position that the friction keeps lie along the tangent.
    On the other side the position is another one.
    """
    corrector, way = interval.corrector, math.copysign(1.0, far.arclength - stuck.arclength)
    length, theta = abs(far.arclength - stuck.arclength), change.theta

    def ahead(last: BranchPoint, distance: float) -> BranchPoint | None:
        # from the last point: a guess from farther away may slip, and then leads to another position
        guess, arclength = last.x + way * distance * last.tangent, last.arclength + way * distance
        point = corrector.point_near(guess, stuck.tangent, arclength)
        if point is None:
            return None
        # at the edge of the continuum friction never slips, but its force reaches its bound: it keeps another position
        reaches = any(event.slip for event in point.orbit.slips if event.contact == change.contact)
        return point if never_slips(point.orbit, change.contact) and not reaches else None

    distance, point, step, left = 0.0, stuck, _FIRST * length, math.inf
    theta, value = margin(point.orbit, change, theta)
    for _ in range(_APPROACHES):
        nearer = ahead(point, step)
        if nearer is None:
            step *= 0.5
            continue
        before, (theta, value) = value, margin(nearer.orbit, change, theta)
        distance, point = distance + step, nearer
        if not 0.0 < value < before:
            if value <= 0.0:
                break
            raise LookupError
        left = step * value / (before - value)
        if distance + left > 2.0 * length:
            raise LookupError
        if left < _REACHED:
            return Located(point, change._replace(theta=theta), left)
        step = _SHARE * left
    if step > _CLOSE or left > _CLOSE:  # the force is at its other bound, and this reserve is not zero there
        raise LookupError
    return Located(point, change._replace(theta=theta), step)


class Rest(NamedTuple):
    """Place at which slip ends in both directions at once."""

    point: BranchPoint  #: The point there, at which friction sticks with its force at both bounds.
    thetas: dict[int, float]  #: For each direction, the angle at which the force reaches its bound.
    #: shape (N + 1,): Change of the scaled variables of the point at which friction sticks, to the position that it has
    #: there.
    shift: NDArray[np.float64]
    spread: float  #: Arclength to which the place is known.


def find_rest(corrector: Corrector, stuck: BranchPoint, far: BranchPoint, contact: int) -> Rest:
    """Find the place between two points at which the force of friction just reaches both of its bounds.

    Position and place along the branch are sought by Broyden's method for the two reserves, from the point at which
    friction sticks. Steps go a little less than all the way, since beyond there is slip.
    """
    search = _RestSearch(corrector, stuck, far, contact)
    first, matrix = search.at(np.zeros(2)), search.slopes()
    here = first
    reserves, step, left = here.reserves, np.zeros(2), math.inf
    for _ in range(_APPROACHES):
        step = np.linalg.solve(matrix, -reserves) if abs(np.linalg.det(matrix)) > 0.0 else np.full(2, np.nan)
        if not np.all(np.isfinite(step)) or not -_AT_REST <= here.place[0] + step[0] <= 1.5 * search.length:
            raise LookupError
        left, share = abs(float(step[0])), _SHARE
        if left < _REACHED:
            break
        ahead = search.near(here.place + share * step, here, first)
        for _ in range(_HALVINGS if left > _CLOSE else 0):
            if ahead is not None:
                break
            share *= 0.5
            ahead = search.near(here.place + share * step, here, first)
        if ahead is None or not np.abs(ahead.reserves).max() < (1.0 - 0.1 * share) * np.abs(here.reserves).max():
            break
        moved, change = ahead.place - here.place, ahead.reserves - reserves
        matrix = matrix + np.outer(change - matrix @ moved, moved) / float(moved @ moved)
        here, reserves = ahead, ahead.reserves
    if left > _AT_REST:
        raise LookupError
    return Rest(here.point, here.thetas, search.shift_to(here.point), left)


class _Tried(NamedTuple):
    """An orbit near the place of rest: distance from the stuck point and shift of the position, and the reserves."""

    place: NDArray[np.float64]
    point: BranchPoint
    reserves: NDArray[np.float64]
    thetas: dict[int, float]


class _RestSearch:
    """Orbits in which friction never slips, by their distance from one of them and by the position that it keeps."""

    def __init__(self, corrector: Corrector, stuck: BranchPoint, far: BranchPoint, contact: int) -> None:
        if not isinstance(corrector.equation, ShootingEquation):
            raise LookupError
        self._corrector, self._stuck, self._contact = corrector, stuck, contact
        self._along = math.copysign(1.0, far.arclength - stuck.arclength) * stuck.tangent
        self.length = abs(far.arclength - stuck.arclength)
        self._kept, self._way = _position_of(stuck, contact)
        own = [each for each in stuck.orbit.margins if (each.contact, each.what) == (contact, "reserve")]
        if {each.side for each in own} != {1, -1}:
            raise LookupError
        least = [min((each for each in own if each.side == side), key=lambda each: each.value) for side in (1, -1)]
        self._thetas = {each.side: each.theta for each in least}

    def near(self, place: NDArray[np.float64], *origins: _Tried) -> _Tried | None:
        """Return the orbit at a place, sought from some orbits in turn; None if friction slips there."""
        for origin in origins:
            with suppress(LookupError):
                return self.at(place, origin)
        return None

    def at(self, place: NDArray[np.float64], origin: _Tried | None = None) -> _Tried:
        """Return the orbit at a place, sought from another one; by default the stuck point."""
        point = self._stuck
        if origin is not None:
            away, ahead = place - origin.place, origin.point.tangent / float(origin.point.tangent @ self._along)
            guess = origin.point.x + away[0] * ahead + away[1] * self._way
            arclength = point.arclength + float(place[0]) * float(self._along @ point.tangent)
            found = self._corrector.point_near(guess, point.tangent, arclength)
            if found is None or any(each.slip for each in found.orbit.slips if each.contact == self._contact):
                raise LookupError
            point = found
        found = {
            side: margin(point.orbit, Change(self._contact, 0, side, 0, theta, True), theta)
            for side, theta in self._thetas.items()
        }
        self._thetas = {side: theta for side, (theta, _) in found.items()}
        return _Tried(place, point, np.array([found[side][1] for side in (1, -1)]), dict(self._thetas))

    def shift_to(self, point: BranchPoint) -> NDArray[np.float64]:
        """Return the change of the variables of the stuck point to the position that friction has at another one."""
        return float(self._kept @ (point.x - self._stuck.x)) * self._way

    def slopes(self) -> NDArray[np.float64]:
        """Return the derivatives of both reserves by distance and position at the stuck point."""
        here = self.at(np.zeros(2))
        # a shift that makes the smaller reserve larger, and with it a step towards slip
        way = math.copysign(1.0, here.reserves[1] - here.reserves[0])
        tries = (self.near(np.array([0.0, way * aside]), here) for share in _ASIDE for aside in (share, -share))
        shifted = next((each for each in tries if each is not None), None)
        if shifted is None:
            raise LookupError
        ahead = self.near(np.array([_FIRST * self.length, shifted.place[1]]), here, shifted)
        if ahead is None:
            raise LookupError
        along = (ahead.reserves - shifted.reserves) / (ahead.place[0] - shifted.place[0])
        return np.column_stack((along, (shifted.reserves - here.reserves) / shifted.place[1]))


def _position_of(stuck: BranchPoint, contact: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the derivative by the scaled variables of the position that friction keeps, and a change of it by 1."""
    system = stuck.orbit.system
    structure, n = system.structure, system.size
    kept, way = np.zeros((2, len(stuck.x)))
    vector = coefficients_of(system)[layout_of(structure).contacts[contact].deflection]
    kept[:n] = vector
    if contact in structure.memories:  # positions and extensions have one scale
        place = 2 * n + structure.memories.index(contact)
        kept[place] = way[place] = -1.0
    else:
        way[:n] = vector / float(vector @ vector)
    return kept, way


def come_to_rest(corrector: Corrector, first: BranchPoint, point: BranchPoint) -> BranchPoint:
    """Return a point of a walk with its friction at the position at which its slip has ended since the point before.

    The step went from slip to stick at any position near. If slip has ended in one contact, and in both directions, the
    position follows from its bounds. Otherwise, and if it is not found, the point is returned as it is.
    """
    ended = [contact for contact in point.orbit.friction if len(directions_left(first.orbit, point.orbit, contact)) > 1]
    if len(ended) != 1:
        return point
    try:
        rest = find_rest(corrector, point, first, ended[0])
    except LookupError:
        return point
    moved = corrector.point_at(point.x + rest.shift, point.value, point.tangent, point.arclength)
    return moved if moved is not None and never_slips(moved.orbit, ended[0]) else point


def directions_left(first: Orbit, last: Orbit, contact: int) -> set[int]:
    """Return the directions in which friction slips in the first of two orbits, if it never slips in the last one.

    It ceases to slip in all of them at once, with its force at both bounds: only then is there a position to keep.
    """
    if never_slips(first, contact) or not never_slips(last, contact):
        return set()
    return {phase.mode for phase in first.friction.get(contact, [])} - {0}
