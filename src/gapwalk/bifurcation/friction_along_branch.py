"""Friction that never slips, along a walk: springs in series that keep their positions, or are pushed along.

Such friction keeps its position until its force reaches a bound. If the motion then grows on that side, the position
moves with it, so that the force just reaches the bound, in all such elements at once. This is the limit of a parameter
that changes ever more slowly, and does not depend on the steps of a walk: the equation of the motions holds each spring
where it is, or at its bound. Where a position would turn back, it is kept from there on. Where the force reaches both
bounds, friction slips in both directions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.bracketed_zero import zero_between
from gapwalk.bifurcation.friction_margin import Change, instant_of, margin, modes_around, own_phase
from gapwalk.bifurcation.special_point import StepInterval
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.floating import spare_of
from gapwalk.orbit.orbit import Orbit, apart
from gapwalk.orbit.shooting import HeldSpring, ShootingEquation
from gapwalk.orbit.sticking import FrictionGauge, FrictionPhase, Margin, friction_phases, kept_row, text_of

_AT_BOUND = 1e-7  # share of the limit within which a force is at its bound
_PUSHED, _ON_GRID = 2e-10, 2e-9  # doubt about a position, in lengths: to which it was pushed, and of other orbits
_MOMENT = 1e-3  # radians of slip in a period that errors of a state at a bound make
_AT_ONCE = 1e-9  # arclength beyond a point at which a spring is at its bound already
_BEYOND = (1e-6, 1e-5, 1e-4, 1e-7, 1e-3)  # arclengths beyond which friction is seen to slip both ways
# of a transient beyond it: change of the parameter, length, and how far
_TRANSIENT, _PERIODS, _CLOSE_TO_BOUND = (
    1e-5,
    100,
    100.0,
)  # of a transient beyond it: change of the parameter, length, and how far
_TOWARDS_BOUND = 1e-6  # arclength over which it is seen how the force of a spring comes to its bound
_FURTHER = 1.5  # factor on the distance at which it would at that rate
_JUST_AHEAD, _FAR_BACK = 1e-5, 8.0  # arclength ahead, and steps back, within which slip is seen to end

Held = Mapping[int, int]
"""Contacts by number: 0 if the position is kept, 1 or -1 for the side of the bound that the force just reaches."""


def held_in(corrector: Corrector) -> dict[int, int]:
    """Return the springs that the equation of a branch holds."""
    equation = corrector.equation
    return {each.contact: each.side for each in equation.held} if isinstance(equation, ShootingEquation) else {}


def never_slipping_springs(orbit: Orbit) -> list[int]:
    """Return the springs of constant limit that never slip, but for a moment to one side."""
    found = list[int]()
    for contact, phases in orbit.friction.items():
        slips = [phase for phase in phases if phase.mode]
        if len({phase.mode for phase in slips}) < 2 and sum(phase.length for phase in slips) < _MOMENT:
            found.append(contact)
    return springs_of_constant_limit(orbit, found)


def springs_of_constant_limit(orbit: Orbit, contacts: Iterable[int]) -> list[int]:
    """Return those of some contacts that can be held."""
    layout = layout_of(orbit.system.structure)
    return [each for each in contacts if orbit.is_exact and FrictionGauge(layout, each).has_constant_limit]


def bounds_reached(orbit: Orbit, contact: int) -> list[int]:
    """Return the sides of the bounds that the force of a spring that never slips reaches in a motion."""
    numbers = layout_of(orbit.system.structure).contacts[contact].numbers
    limit, stiffness = (float(coefficients_of(orbit.system)[numbers[name]]) for name in ("limit", "stiffness"))
    return [side for side, spare in spare_of(orbit, contact).items() if spare < _AT_BOUND * limit / stiffness]


def go_on_with(
    corrector: Corrector, point: BranchPoint, held: Held, lead: int | None = None, origin: BranchPoint | None = None
) -> tuple[Corrector, BranchPoint] | None:
    """Return the corrector and the point of the motions that go on from a point with some springs held."""
    # A spring that would be pulled back from its bound is kept where it is. The direction is that in which `lead`,
    # which has just reached its bound, is pushed; without one it is that of the point. Positions that are kept are
    # those of the origin, by default the point. None if there are no such motions.
    equation = cast("ShootingEquation", corrector.equation)
    known = {each.contact: each for each in equation.held}
    while True:
        for contact, side in held.items():
            old = known.get(contact)
            if old is None or old.side != side:
                place, is_pulled = _position(corrector, origin or point, contact), old is not None and old.side
                doubt = (_PUSHED if is_pulled else _ON_GRID) * equation.length
                known[contact] = HeldSpring(contact, side, *(() if side else (place, doubt)))
        moving = Corrector(replace(equation, held=tuple(known[each] for each in held)), corrector.scales)
        moved = moving.point_at(point.x, point.value, point.tangent, point.arclength)
        if moved is None:
            return None
        point = moved
        if lead is not None and _rate(moving, point, lead, held[lead]) < 0.0:
            point = replace(point, tangent=-point.tangent, determinant=-point.determinant)
        back = [each for each, side in held.items() if side and each != lead and _rate(moving, point, each, side) <= 0]
        if not back:
            return moving, point
        held = {each: 0 if each in back else side for each, side in held.items()}


def _rate(corrector: Corrector, point: BranchPoint, contact: int, side: int) -> float:
    """Return how fast the position of friction moves to a side along the branch."""
    row = _row(point.orbit, contact)
    return side * float(row @ (point.tangent * corrector.scales)[: len(row)])


def _position(corrector: Corrector, point: BranchPoint, contact: int) -> float:
    row = _row(point.orbit, contact)
    return float(row @ (point.x * corrector.scales)[: len(row)])


def _spare(point: BranchPoint, contact: int) -> dict[int, float]:
    if (spare_of, contact) not in point.memo:
        point.memo[spare_of, contact] = spare_of(point.orbit, contact)
    return point.memo[spare_of, contact]


def _row(orbit: Orbit, contact: int) -> NDArray[np.float64]:
    return kept_row(layout_of(orbit.system.structure), coefficients_of(orbit.system), contact)


class HeldChange(NamedTuple):
    """Place at which a spring turns back from its bound, or reaches another one: side 0, or that of the bound.

    The function of a point of the branch of the corrector is zero there; `near` is another point of that branch.
    """

    corrector: Corrector
    point: BranchPoint
    contact: int
    side: int
    function: Callable[[BranchPoint], float]
    near: BranchPoint


def first_change(corrector: Corrector, first: BranchPoint, last: BranchPoint) -> HeldChange | None:
    """Return the first change of a spring that is held between two points of a walk."""
    found, interval = list[HeldChange](), StepInterval(corrector, first, last)
    for contact, side in held_in(corrector).items():
        for towards in {0, 1, -1} - {side}:

            def function(point: BranchPoint, contact: int = contact, side: int = side, towards: int = towards) -> float:
                return _spare(point, contact)[towards] if towards else _rate(corrector, point, contact, side)

            at_first, at_last = function(first), function(last)
            if at_last < 0.0 and at_last < at_first:
                least = first.arclength + min(_AT_ONCE, 0.5 * (last.arclength - first.arclength))
                place, converged = least, True
                if at_first > 0.0:
                    ends = first.arclength, last.arclength
                    place, converged = zero_between(lambda at, own=function: own(interval.at(at)), *ends)
                if not converged:
                    raise NumericalError("friction that never slips jumps to another position")
                found.append(HeldChange(corrector, interval.at(max(place, least)), contact, towards, function, first))
    return min(found, key=lambda each: each.point.arclength, default=None)


def end_of_slip(corrector: Corrector, first: BranchPoint, last: BranchPoint | None = None) -> HeldChange | None:
    """Return the first place in a step at which a spring ceases to slip, in both directions at once; None if none does.

    Among the motions at one of its bounds it is the one that just reaches the other bound too. Without a last point of
    the step, such a place just ahead of the first one is sought.
    """
    if not first.orbit.slips or not isinstance(corrector.equation, ShootingEquation):
        return None
    slipping = [each for each in first.orbit.friction if slips_both_ways(first.orbit, [each])]
    able = springs_of_constant_limit(first.orbit, slipping)
    if last is not None:
        able = [each for each in never_slipping_springs(last.orbit) if each in able]
    reach = _JUST_AHEAD if last is None else _FAR_BACK * (last.arclength - first.arclength)
    found = [_end_of_slip(corrector, first, last or first, each, reach) for each in able]
    return min((each for each in found if each), key=lambda each: each.point.arclength, default=None)


def _end_of_slip(
    corrector: Corrector, first: BranchPoint, last: BranchPoint, contact: int, reach: float
) -> HeldChange | None:
    equation = cast("ShootingEquation", corrector.equation)
    pushed = Corrector(replace(equation, held=(*equation.held, HeldSpring(contact, 1))), corrector.scales)

    def function(point: BranchPoint) -> float:
        return _spare(point, contact)[-1]

    begun = pushed.point_at(last.x, last.value, last.tangent)
    if begun is None:
        return None
    here = begun

    def at(distance: float) -> BranchPoint:
        there = pushed.point_near(here.x + distance * here.tangent, here.tangent, distance)
        if there is None:
            raise NumericalError("no motion is found where the friction in series with a spring ceases to slip")
        return there

    spare, rate = function(here), (function(at(_TOWARDS_BOUND)) - function(here)) / _TOWARDS_BOUND
    if rate < 0.0:  # beyond that place it does not slip
        here, rate = replace(here, tangent=-here.tangent, determinant=-here.determinant), -rate
    if not abs(spare) < rate * reach:
        return None
    way = -math.copysign(max(_FURTHER * abs(spare) / rate, _TOWARDS_BOUND), spare)
    ends = sorted((here, at(way)), key=lambda point: point.arclength)
    if not function(ends[0]) < 0.0 < function(ends[1]):
        return None
    interval, (low, high) = StepInterval(pushed, *ends), (each.arclength for each in ends)
    place, converged = zero_between(lambda distance: function(interval.at(distance)), low, high)
    if not converged:
        return None
    rest, beyond = interval.at(place), at(place + _TOWARDS_BOUND)
    rest = replace(rest, arclength=first.arclength + length_of(rest.x - first.x))
    return HeldChange(pushed, rest, contact, -1, function, replace(beyond, arclength=rest.arclength + _TOWARDS_BOUND))


def beyond_slip(rest: HeldChange, held: Held) -> tuple[Corrector, BranchPoint] | None:
    """Return the corrector and the point of the motions that go on from where slip ends, as `go_on_with`; None if none.

    The spring is pushed to a side if its force then leaves the other bound; otherwise it leaves both, and is kept.
    """
    back = replace(rest.point, tangent=-rest.point.tangent, determinant=-rest.point.determinant)
    for side, point in ((1, rest.point), (-1, rest.point), (0, rest.point), (0, back)):
        moved = go_on_with(rest.corrector, point, {**held, rest.contact: side}, rest.contact if side else None)
        if moved is None:
            continue
        corrector, here = moved
        ahead = corrector.point_near(here.x + _TOWARDS_BOUND * here.tangent, here.tangent)
        if ahead is not None:
            now, then = (_spare(each, rest.contact) for each in (here, ahead))
            if all(then[each] > now[each] for each in {1, -1} - {side}):
                return moved
    return None


def slipping_beside(
    corrector: Corrector, point: BranchPoint, contacts: list[int], way: float = 1.0
) -> BranchPoint | None:
    """Return a point just beyond another one, or before it, at which friction slips in both directions, if any."""
    for length in _BEYOND:
        beyond = corrector.point_ahead(point, way * length)
        if beyond is not None and slips_both_ways(beyond.orbit, contacts):
            return beyond
    return _settled_beyond(corrector, point, contacts) if way > 0.0 else None


def _settled_beyond(corrector: Corrector, point: BranchPoint, contacts: list[int]) -> BranchPoint | None:
    """Return a point beyond another one, at which friction slips in both directions, from the end of a transient."""
    # The derivatives of a guess that slips in one direction only do not lead there.
    if len(point.x) > point.orbit.system.state_size + 1:
        return None
    for length in (_TRANSIENT, -_TRANSIENT):
        x = point.x.copy()
        x[-1] += length * math.copysign(1.0, point.tangent[-1])
        value, along = float(x[-1] * corrector.scales[-1]), (x - point.x) / _TRANSIENT
        try:
            for _ in range(_PERIODS):
                x[:-1] += corrector.evaluate_late(x).residual / corrector.scales[:-1]
        except NumericalError:
            continue
        correction = corrector.at_value(x, value)
        if correction is None or length_of(correction.x - point.x) > _CLOSE_TO_BOUND * _TRANSIENT:
            continue
        beyond = corrector.point(correction, along, point.arclength)
        if slips_both_ways(beyond.orbit, contacts):
            return replace(beyond, arclength=point.arclength + length_of(beyond.x - point.x))
    return None


def slips_both_ways(orbit: Orbit, contacts: Iterable[int]) -> bool:
    """Return True if the friction of all of some contacts slips in both directions."""
    return all({1, -1} <= {phase.mode for phase in orbit.friction.get(contact, [])} for contact in contacts)


# Onset of slip: the place of a branch at which friction that never slips begins to, or at which its slip ends.
#
# Friction that never slips keeps its position, and the orbits are a continuum. From a position off the middle its
# force reaches the bound of one direction first. From there on the position moves so that it just reaches it, until
# the force reaches the bound of the other direction too. Beyond, friction slips both ways. That second place does not
# depend on where friction was left: position and parameter are determined by the two bounds. There slip ends on the
# way back, at that position, which friction then keeps.

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
    """Locate the onset of slip from the side on which friction never slips."""
    # The orbits there are some of a continuum, and those at the position that the friction keeps lie along the tangent.
    # On the other side the position is another one.
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
    """Find the place between two points at which the force of friction just reaches both of its bounds."""
    # Position and place along the branch are sought by Broyden's method for the two reserves, from the point at which
    # friction sticks. Steps go a little less than all the way, since beyond there is slip.
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
    """Return a point of a walk with its friction at the position at which its slip has ended since the point before."""
    # The step went from slip to stick at any position near. If slip has ended in one contact, and in both directions,
    # the position follows from its bounds. Otherwise, and if it is not found, the point is returned as it is.
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
    """Return the directions in which friction slips in the first of two orbits, if it never slips in the last one."""
    # It ceases to slip in all of them at once, with its force at both bounds: only then is there a position to keep.
    if never_slips(first, contact) or not never_slips(last, contact):
        return set()
    return {phase.mode for phase in first.friction.get(contact, [])} - {0}


# Changes of the sequence of slip and stick along a branch: which phase appears or vanishes, and exactly where.
#
# One phase vanishes at each such point, between the phase before and the phase after it. At that point a *margin* of
# the orbit is zero. It is defined on both sides and continuous:
#
# - Where the slip rate reverses its sign, the margin is the *reserve* of the force there: friction sticks if the force
#   that it needs for that is within its bound.
# - Where stick ends in slip of one direction or of the other, the margin is the difference of the reserves of both:
#   there the bounds vanish, as where the contact that presses opens.
# - Where slip is interrupted by stick, the margin is the least slip rate. With stick, it is the value that the rate
#   would reach if slip went on, to leading order: ``-g'^2 / (2 g'')`` of the rate g where slip ends.
# - Where stick is interrupted by slip, the margin is the least reserve, and with slip the value that it would reach.
#
# di Bernardo, Budd, Champneys and Kowalczyk (2008), Piecewise-smooth Dynamical Systems, chapter 8.

_SMALLEST = 1e-11  # arclength below which a step is not divided any more
_MOST = 4  # number of phases that may vanish at once, as in symmetric motions
_RESERVE = 1e-8  # share of its bound by which a force must fall short of it not to have reached it
_BESIDE = 1e-5  # arclength at which the sequence is examined on both sides of a change
_NARROW = 1e-4  # arclength of a step below which it is not
_MOVED = 0.5  # radians by which a margin may move between two points
_DOUBT = 0.5  # share of its bend by which a margin may have moved between two points; 1/8 for a parabola
_NEAR = 0.05  # share of its range within which a least value that appears counts as near zero
_FAR, _LONG = 0.6, 4e-3  # the same in steps of more than this arclength
_BIRTH = 2e-4  # arclength to which the appearance of such a value is narrowed down
_FALLS = 0.75  # share of its bend before that the bend of a margin has at most, in a half of a step
_JUMPS = 1e-11  # arclength from a located point within which the margin is that small too
_UNSEEN = 1e-6  # arclength within which the margin of a change is zero if it was found by halving
_AT_ONE = 1e-12  # arclength within which two changes are at one point
_AGAIN = 0.1  # share of the arclength over which a margin jumped, over which its zero is sought again
_TOUCH = 1e-6  # margin of a located point, relative to the margins at the ends of its bracket, that is only rounding


def changes_between(first: Orbit, last: Orbit) -> list[Change] | None:
    """Return the phases that only one of two neighbouring orbits has; None if several changes cannot be separated."""
    if not (first.is_exact and last.is_exact):
        return []
    found: list[Change] = []
    for contact in sorted({*first.friction, *last.friction}):
        poor, rich = sorted((each.friction.get(contact, []) for each in (first, last)), key=len)
        tries = (_removed(contact, rich, text_of(poor), most) for most in range(_MOST + 1))
        removed = next((each for each in tries if each is not None), None)  # with the fewest phases
        if removed is None:
            return None
        found += removed or _reached(contact, first, last)
    return found


def _reached(contact: int, first: Orbit, last: Orbit) -> list[Change]:
    """Return the onset of slip if friction sticks in both orbits, but its force reaches its bound in the last one."""
    # The motion then moves along the edge of the continuum, and back into it only if a step leads there.
    if contact not in first.stuck or not never_slips(last, contact):
        return []
    slips = [phase for phase in friction_phases(last.slips, contact, PERIOD * last.period) if phase.mode]
    if not slips:
        return []
    change = Change(contact, 0, slips[0].mode, 0, slips[0].start, True)
    try:
        reserve = margin(first, change, change.theta)[1]
    except LookupError:
        return []
    return [change] if reserve > _RESERVE * abs(_bound(first, change)) else []


def _bound(orbit: Orbit, change: Change) -> float:
    """Return the force at which slip begins, at the angle of a change."""
    gauge, now = FrictionGauge(layout_of(orbit.system.structure), change.contact), instant_of(orbit, change.theta)
    return float(
        gauge.bound_and_force(coefficients_of(orbit.system), now.theta, now.state, gauge.sticking(now.modes))[0]
    )


def _removed(contact: int, phases: list[FrictionPhase], text: str, most: int) -> list[Change] | None:
    """Return the shortest phases without which the others have the given cyclic sequence of modes."""
    own = text_of(phases)
    if len(own) == len(text) and own in text + text:
        return []
    if len(own) <= len(text) or not most:
        return None
    for place in sorted(range(len(phases)), key=lambda number: phases[number].length)[:_MOST]:
        phase, past, following = phases[place], phases[place - 1], phases[(place + 1) % len(phases)]
        rest = [*phases[place + 1 :], *phases[:place]]
        if past.mode == following.mode:
            merged = FrictionPhase(past.mode, past.start, past.start + past.length + phase.length + following.length)
            rest = [merged] if len(rest) == 1 else [*rest[1:-1], merged]
        others = _removed(contact, rest, text, most - 1)
        if others is not None:
            around = past.mode, phase.mode, following.mode
            return [Change(contact, *around, phase.start, text == "0", modes_around(rest).count(around)), *others]
    return None


def find_changes(
    interval: StepInterval, before: BranchPoint | None, first: BranchPoint, last: BranchPoint, bend: float = math.inf
) -> list[Located]:
    """Find the changes of friction between two neighbouring points of a walk, in order; `before` is the point before.

    A step in which they cannot be told apart is halved, and one in which changes that cancel each other may hide:
    `bend` is the largest bend of a margin that may hide some in the step of which this is a half.
    """
    changes, length = changes_between(first.orbit, last.orbit), last.arclength - first.arclength
    if changes == []:
        held = held_in(interval.corrector)
        if length <= interval.finest or not (bend := _hiding_bend(before, first, last, held, bend)):
            return []
    if changes:
        onsets = [change for change in changes if change.alone]
        found = [_locate(interval, first, last, change) for change in changes if not change.alone]
        located = [*locate_onsets(interval, first, last, onsets), *(each for each in found if each is not None)]
        # the force may be at its other bound already
        if len(located) == len(changes) or (len(onsets) == len(changes) and located):
            return _refined(interval, before, first, last, sorted(located, key=lambda each: each.point.arclength))
    if length < _SMALLEST:
        return [_locate_beside(interval, first, last, change) for change in changes or []]
    middle = interval.middle(first, last)
    halves = (before, first, middle), (first, middle, last)
    return [each for half in halves for each in find_changes(interval, *half, bend)]


def _hiding_bend(before: BranchPoint | None, first: BranchPoint, last: BranchPoint, held: Held, known: float) -> float:
    """Return the largest bend of a margin, if changes that cancel each other may hide between two points; 0 if not.

    Where such a step is halved, the bend of a margin falls to a quarter, or to .7 of it where it is a root. A jump
    stays as it is, as where its place passes a sample: halving does not tell more about it, and short steps are not
    halved for it. `known` is the bend before.
    """
    # Springs that are held do not slip.
    if not any(any(phase.mode for phase in phases) for phases in first.orbit.friction.values()):
        return 0.0
    full, length = PERIOD * first.orbit.period, last.arclength - first.arclength
    now, then = ([each for each in point.orbit.margins if each.contact not in held] for point in (first, last))
    past = None if before is None or first.arclength <= before.arclength else before.orbit.margins
    ratio = math.nan if past is None or before is None else length / (first.arclength - before.arclength)
    most, found = math.inf if length > _BIRTH else _FALLS * known, 0.0
    for own in now:
        following = _become(own, then, full)
        if following is None:
            continue
        preceding = None if past is None else _become(own, past, full)
        if preceding is not None:
            bend = abs((following.value - own.value) - ratio * (own.value - preceding.value))
            if min(abs(own.value), abs(following.value)) < _DOUBT * bend <= _DOUBT * most:
                found = max(found, bend)
    if found or length <= _BIRTH:
        return found
    lonely = [each for each in now if _become(each, then, full) is None]
    lonely += [each for each in then if _become(each, now, full) is None]
    near = _NEAR if length <= _LONG else _FAR
    return math.inf if any(each.what != "stop" and 0.0 <= each.value < near * each.range for each in lonely) else 0.0


def _become(own: Margin, others: Sequence[Margin], full: float) -> Margin | None:
    """Return the margin among others that one has become."""
    alike = [
        each
        for each in others
        if (each.contact, each.what, each.side) == (own.contact, own.what, own.side)
        and apart(each.theta, own.theta, full) < _MOVED
    ]
    return min(alike, key=lambda each: apart(each.theta, own.theta, full), default=None)


def _refined(
    interval: StepInterval, before: BranchPoint | None, first: BranchPoint, last: BranchPoint, located: list[Located]
) -> list[Located]:
    """Return located changes with those in the rest of the step."""
    # The changes at the ends of the step may be the sum of several, of which only one has been located.
    length = last.arclength - first.arclength
    beside = min(_BESIDE, 1e-3 * length)
    low, high = located[0].point.arclength - beside, located[-1].point.arclength + beside
    if length < _NARROW or any(each.change.alone for each in located):
        return located
    if low <= first.arclength or high >= last.arclength:
        return located
    ends = interval.at(low), interval.at(high)
    outer = [(before, first, ends[0]), (ends[0], ends[1], last)]
    left, right = ([part] if changes_between(part[1].orbit, part[2].orbit) != [] else [] for part in outer)
    if not left and not right:
        return located
    # where nothing changes any more, the margin that vanishes at the end would let the part be halved over and over
    return [each for part in [*left, (first, *ends), *right] for each in find_changes(interval, *part)]


def _locate_beside(interval: StepInterval, first: BranchPoint, last: BranchPoint, change: Change) -> Located:
    """Locate a change between two points that halving has found: by its margin, or where it has none, as their place.

    The flow leaves out slip and stick so brief that rounding would decide on them, so the sequence changes a little
    beside the zero of the margin.
    """
    low, high = (interval.points[place].arclength for place in (0, -1))
    with suppress(NumericalError):
        before, after = (interval.at(min(max(last.arclength + shift, low), high)) for shift in (-_UNSEEN, _UNSEEN))
        if before is not after and (found := _locate(interval, before, after, change)) is not None:
            return found
    return Located(last, change, last.arclength - first.arclength, first)


def _locate(interval: StepInterval, first: BranchPoint, last: BranchPoint, change: Change) -> Located | None:
    """Locate the zero of the margin of one change; None if its margin cannot be tracked over the step."""
    located: Located | None = interval.located.get(change)
    if located is not None and first.arclength < located.point.arclength < last.arclength:
        return located  # found before the step was divided
    kind, length = change[:4], last.arclength - first.arclength
    if length > _AGAIN * interval.jumps.get(kind, math.inf):
        return None
    tracked: dict[float, tuple[float, float]] = {}

    def value(arclength: float) -> float:
        if arclength not in tracked:
            nearest = min(tracked, key=lambda known: abs(known - arclength), default=None)
            theta = change.theta if nearest is None else tracked[nearest][0]
            point = interval.at(arclength)
            if (change, theta) not in point.memo:  # the ends of a step that is divided are asked again
                point.memo[change, theta] = margin(point.orbit, change, theta)
            tracked[arclength] = point.memo[change, theta]
        return tracked[arclength][1]

    rich = _has(first.orbit, change), _has(last.orbit, change)
    ends = (last, first) if rich[1] and not rich[0] else (first, last)
    try:
        sizes = value(ends[0].arclength), value(ends[1].arclength)
        # where a bound vanishes, the margin is zero wherever the phase is not, and its sign there is only rounding
        if sizes[0] * sizes[1] >= 0.0 or min(map(abs, sizes)) <= _TOUCH * max(map(abs, sizes)):
            return None
        # the friction of both directions, or of equal parts, changes at one point
        known = (each.point.arclength for each in interval.located.values())
        inside = (place for place in known if first.arclength < place < last.arclength)
        rate = abs(sizes[1] - sizes[0]) / (last.arclength - first.arclength)
        root, converged = next((place for place in inside if abs(value(place)) <= _AT_ONE * rate), None), True
        if root is None:  # where the margin jumps, it has no zero, and the step is divided
            root, converged = zero_between(value, first.arclength, last.arclength, jumps=False)
        if not converged:
            interval.jumps[kind] = length
            return None
        # where the margin jumps, one of several phases was tracked on one side, and another one on the other side
        around = [size for place, (_, size) in tracked.items() if abs(place - root) <= _JUMPS]
        if max(map(abs, [value(root), *around])) > _TOUCH * max(map(abs, sizes)):
            return None
    except LookupError:
        return None
    point, found = interval.at(root), change._replace(theta=tracked[root][0])
    point.memo[found] = tracked[root][1]
    interval.located[change] = Located(point, found, _AT_ONE)
    return interval.located[change]


def _has(orbit: Orbit, change: Change) -> bool:
    return own_phase(orbit, change, change.theta) is not None


def unexplained_changes(first: Orbit, last: Orbit, explained: Callable[[int], int]) -> list[str]:
    """Return, as sentences, the changes of friction between two orbits that the points between do not explain."""
    # `explained` returns the number of such points of a contact, by its number.
    found = []
    if not (first.system.structure.friction and first.is_exact and last.is_exact):
        return []
    for contact in sorted({*first.friction, *last.friction}):
        texts = [text_of(each.friction.get(contact, [])) for each in (first, last)]
        if len(texts[0]) == len(texts[1]) and texts[0] in texts[1] * 2:
            continue
        count = explained(contact)
        if not count or (abs(len(texts[1]) - len(texts[0])) > 2 * count and "0" not in texts):
            name = first.system.structure.contacts[contact].name
            found.append(
                f"{name} goes through {texts[0]} per period before this step and through {texts[1]} after it, with "
                f"{count} points of sliding between"
            )
    return found


def located_again(orbit: Orbit, change: Change) -> Callable[[BranchPoint], float]:
    """Return the margin of a change as a function of a point of the branch near an orbit; nan if it is not found."""

    def function(point: BranchPoint) -> float:
        if change in point.memo:
            return point.memo[change]
        try:
            return margin(point.orbit, change, change.theta)[1]
        except LookupError:
            raise NumericalError("the motion has no such phase of slip or stick there") from None

    return function
