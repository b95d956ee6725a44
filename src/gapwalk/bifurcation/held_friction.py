"""Friction that never slips, along a walk: springs in series that keep their positions, or are pushed along.

Such friction keeps its position until its force reaches a bound. If the motion then grows on that side, the position
moves with it, so that the force just reaches the bound, in all such elements at once. This is the limit of a parameter
that changes ever more slowly, and does not depend on the steps of a walk: the equation of the motions holds each spring
where it is, or at its bound. Where a position would turn back, it is kept from there on. Where the force reaches both
bounds, friction slips in both directions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.step_interval import StepInterval, zero_between
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.friction_gauge import FrictionGauge
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.floating import spare_of
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import HeldSpring, ShootingEquation
from gapwalk.orbit.sticking import kept_row

_AT_BOUND = 1e-7  # share of the limit within which a force is at its bound
_PUSHED, _ON_GRID = 2e-10, 2e-9  # doubt about a position, in lengths: to which it was pushed, and of other orbits
_MOMENT = 1e-3  # radians of slip in a period that errors of a state at a bound make
_AT_ONCE = 1e-9  # arclength beyond a point at which a spring is at its bound already
_BEYOND = (1e-6, 1e-5, 1e-4, 1e-7, 1e-3)  # arclengths beyond which friction is seen to slip both ways
_SETTLED, _PERIODS, _CLOSE = 1e-5, 100, 100.0  # of a transient beyond it: change of the parameter, length, and how far
_ASIDE = 1e-6  # arclength over which it is seen how the force of a spring comes to its bound
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
    """Return the corrector and the point of the motions that go on from a point with some springs held.

    A spring that would be pulled back from its bound is kept where it is. The direction is that in which `lead`, which
    has just reached its bound, is pushed; without one it is that of the point. Positions that are kept are those of
    the origin, by default the point. None if there are no such motions.
    """
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
                    raise NumericalError("the position of friction that never slips jumps")
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
            raise NumericalError("no motion is found where the slip of a spring ends")
        return there

    spare, rate = function(here), (function(at(_ASIDE)) - function(here)) / _ASIDE
    if rate < 0.0:  # beyond that place it does not slip
        here, rate = replace(here, tangent=-here.tangent, determinant=-here.determinant), -rate
    if not abs(spare) < rate * reach:
        return None
    way = -math.copysign(max(_FURTHER * abs(spare) / rate, _ASIDE), spare)
    ends = sorted((here, at(way)), key=lambda point: point.arclength)
    if not function(ends[0]) < 0.0 < function(ends[1]):
        return None
    interval, (low, high) = StepInterval(pushed, *ends), (each.arclength for each in ends)
    place, converged = zero_between(lambda distance: function(interval.at(distance)), low, high)
    if not converged:
        return None
    rest, beyond = interval.at(place), at(place + _ASIDE)
    rest = replace(rest, arclength=first.arclength + length_of(rest.x - first.x))
    return HeldChange(pushed, rest, contact, -1, function, replace(beyond, arclength=rest.arclength + _ASIDE))


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
        ahead = corrector.point_near(here.x + _ASIDE * here.tangent, here.tangent)
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
    """Return a point beyond another one, at which friction slips in both directions, from the end of a transient.

    The derivatives of a guess that slips in one direction only do not lead there.
    """
    if len(point.x) > point.orbit.system.state_size + 1:
        return None
    for length in (_SETTLED, -_SETTLED):
        x = point.x.copy()
        x[-1] += length * math.copysign(1.0, point.tangent[-1])
        value, along = float(x[-1] * corrector.scales[-1]), (x - point.x) / _SETTLED
        try:
            for _ in range(_PERIODS):
                x[:-1] += corrector.evaluate(x).residual / corrector.scales[:-1]
        except NumericalError:
            continue
        correction = corrector.at_value(x, value)
        if correction is None or length_of(correction.x - point.x) > _CLOSE * _SETTLED:
            continue
        beyond = corrector.point(correction, along, point.arclength)
        if slips_both_ways(beyond.orbit, contacts):
            return replace(beyond, arclength=point.arclength + length_of(beyond.x - point.x))
    return None


def slips_both_ways(orbit: Orbit, contacts: Iterable[int]) -> bool:
    """Return True if the friction of all of some contacts slips in both directions."""
    return all({1, -1} <= {phase.mode for phase in orbit.friction.get(contact, [])} for contact in contacts)
