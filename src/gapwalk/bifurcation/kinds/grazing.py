"""Grazing: a contact just touches a breakpoint, so that the contact pattern changes along the branch."""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.special_point import (
    ErrorEstimator,
    Kind,
    Search,
    StepInterval,
    Symbol,
    Zero,
    location_error,
    zero_between,
)
from gapwalk.bifurcation.touch_map import Beyond, beyond, touch_map
from gapwalk.continuation.corrector import length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.event_rule import jumping_switches, one_way_switches
from gapwalk.flow.flow import PERIOD
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, Turns, apart, describe_switch, reversals_of, switch_named

if TYPE_CHECKING:
    from gapwalk.bifurcation.special_point import SpecialPoint

_EPS = float(np.finfo(float).eps)
_ROUNDING = 1e4  # roundings of the motion within which an extremum is at a rigid stop
_SMALLEST = 1e-11  # arclength below which two changes of the pattern count as one
_BIRTH = 2e-4  # arclength to which the appearance of a pair of extrema near a breakpoint is always narrowed down
_NEAR = 0.02  # share of the range of all extrema within which a pair counts as near a breakpoint
_LONELY = 0.05  # angle from an extremum to the nearest of the other motion beyond which it has no counterpart there
_DRIFT = 4.0  # factor on the change of other extrema that bounds the motion of a pair since it appeared
_TOUCH = 1e-6  # depth of a graze, relative to the depths at the ends of its bracket, that is only rounding
_BESIDE, _TORN = 1e-6, 10.0  # arclength from a graze, and the distance in it, with which orbits are no neighbours
_CLEAR = 1e-4  # share of the range of all extrema, times the growth of changes, by which a Newton step moves none
_DOUBT = 0.5  # share of its bend by which an extremum may have moved between two points; 1/8 for a parabola


class Grazing(Kind):
    """Grazing: a deflection just reaches the clearance of a stage.

    It has no test function of its own. Each extremum of each deflection has one, its depth beyond its breakpoint, and
    extrema appear and vanish along a branch.
    """

    turn = 0
    by_multipliers = False
    symbol = Symbol("grazing", "", "|", 7.0, "grey", (0.0, (1.2, 1.6)), 1.0)

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error from both sides: the depth may rise on one side and stay almost zero on the other."""
        sides = search.known_sides(zero.point)
        near = {point.arclength: point for point in (search.near(zero.point), *sides)}
        return location_error(zero, second, [*near.values()], () if len(sides) == 2 else (search.first, search.last))

    @property
    def no_locus(self) -> str:
        """Empty string, since it has a locus: the depth of the extremum that grazes is zero along it."""
        return ""

    def residual(self, orbit: Orbit, multipliers: NDArray[np.complex128]) -> float:
        """Return the least depth of an extremum beyond its breakpoint, relative to the size of the motion."""
        depths = [abs(depth) for turns in orbit.turning_depths for depth in turns.values]
        return min(depths, default=math.inf) / max(float(np.abs(orbit.extremes[:, :2]).max()), np.finfo(float).tiny)

    def foretold(self, special: SpecialPoint) -> Beyond:
        """See `Kind.foretold`; by the leading term of the touch."""
        switch = switch_named(special.orbit, special.contact)
        return beyond(None if switch is None else touch_map(special.orbit, switch))

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """See `Kind.examined`: the contact pattern must change there, and the depth of an extremum be zero."""
        orbit, contact = special.orbit, special.contact
        switch = switch_named(orbit, contact)
        if switch is None:
            formulas = {each.name for each in orbit.system.structure.contacts if each.law.mode_count}
            unknown = {*contact.split(" and ")} - formulas
            return [f"there is no contact {each!r}" for each in sorted(unknown)], None
        if not before.orbit.closing_changes(after.orbit)[switch]:
            return [f"{contact} closes equally often on both sides of the graze"], None
        turns = orbit.turning_depths[switch]
        theta = turns.thetas[int(np.argmin(np.abs(turns.values)))]
        return [], lambda point: depth_near(point.orbit, switch, theta)

    def points_in(self, search: Search) -> list[Zero]:
        """Return all grazing points of a step; see `find_grazing`."""
        found = find_grazing(search.interval, search.before, search.first, search.last)
        corners = one_way_switches(search.first.orbit.system) if found else ()
        search.corners += [each.point.arclength for each in found if each.switch in corners]
        return [
            Zero(
                self,
                graze.point,
                graze.spread,
                lambda point, graze=graze: depth_near(point.orbit, graze.switch, graze.theta),
                describe_switch(graze.point.orbit, graze.switch),
                _EPS * float(np.abs(graze.point.orbit.extremes[:, :2]).max()),
            )
            for graze in found
        ]


class Graze(NamedTuple):
    """Grazing point: the point of the branch, the switch that grazes, its angle, and the bracket's arclength."""

    point: BranchPoint
    switch: int
    theta: float
    spread: float


def find_grazing(
    interval: StepInterval, before: BranchPoint | None, first: BranchPoint, last: BranchPoint
) -> list[Graze]:
    """Find all grazing points between two neighbouring points of a walk, in order; `before` is the point before them.

    A step with a change of the pattern is halved until it contains one grazing point, which can then be located. Two
    changes that cancel within one step are not visible in the pattern. Therefore the step is also halved as long as
    extrema of a deflection may have touched their breakpoint between its two points.
    """
    changes = [
        0 if gapless else change
        for change, gapless in zip(first.orbit.closing_changes(last.orbit), _gapless(first, last), strict=True)
    ]
    number = sum(map(abs, changes))
    length = last.arclength - first.arclength
    if number and length < _SMALLEST:
        return [Graze(last, switch, _touch(last.orbit, switch), length) for switch in np.flatnonzero(changes).tolist()]
    is_doubtful = length > interval.finest and _is_doubtful(before, first, last, changes)
    if number < 2 and not is_doubtful:
        if not number:
            return []
        graze = _locate(interval, first, last, int(np.flatnonzero(changes)[0]))
        if graze is not None:
            return [graze]
    middle = interval.middle(first, last)
    return find_grazing(interval, before, first, middle) + find_grazing(interval, first, middle, last)


def _is_doubtful(before: BranchPoint | None, first: BranchPoint, last: BranchPoint, changes: list[int]) -> bool:
    """Return True if grazing points that cancel may hide between two points with these changes of the pattern."""
    length = last.arclength - first.arclength
    full, pairs = PERIOD * first.orbit.period, _Pairs(PERIOD * first.orbit.period)
    gapless = _gapless(first, last)
    if before is not None and not any(changes) and _is_clear((first, last, before), gapless):
        return False
    for switch, change in enumerate(changes):
        if gapless[switch] or first.orbit.held.get(switch) != last.orbit.held.get(switch):
            continue  # where a stop ceases to be held, infinitely many impacts graze
        now, then = (approaches(point.orbit, switch) for point in (first, last))
        if _crossings(now, then, full) > abs(change):
            return True
        # a new pair may graze once more than the change of the pattern shows: enter, stay inside, and leave
        if _is_born_near_contact(now, then, full, _NEAR if length > _BIRTH else 0.0):
            return True
        if not change and before is not None and _may_touch(before, first, last, switch, pairs):
            return True
    return False


def _is_clear(points: tuple[BranchPoint, BranchPoint, BranchPoint], gapless: list[bool]) -> bool:
    """Return True if it is clear that no extremum touches between the first two of three points: no survey is needed.

    The turning points are those of motions a last Newton step away; what may depend on that step is not clear.
    """
    (first, last, before), full = points, PERIOD * points[0].orbit.period
    every = [_nearby_depths(point) for point in points]
    if first.arclength <= before.arclength or not all(every):
        return False
    ratio = (last.arclength - first.arclength) / (first.arclength - before.arclength)
    growth, pairs = _CLEAR * max(1.0, abs(first.orbit.multipliers[0])), _Pairs(full)
    for now, then, past in (each for each, closed in zip(zip(*every, strict=True), gapless, strict=True) if not closed):
        if not len(now.thetas) == len(then.thetas) == len(past.thetas) > 0:
            return False
        unsure = growth * (max(now.values) - min(now.values))
        for depth, ahead, behind in zip(now.values, pairs.between(now, then), pairs.between(now, past), strict=True):
            following, preceding = then.values[ahead], past.values[behind]
            bend = abs((following - depth) - ratio * (depth - preceding))
            if depth * following <= 0.0 or min(abs(depth), abs(following)) <= _DOUBT * bend + unsure:
                return False
    return True


def _nearby_depths(point: BranchPoint) -> list[Turns]:
    """Return what `Orbit.turning_depths` holds for a motion a last Newton step away; nothing where it is not known."""
    known, orbit = point.memo.get(_nearby_depths), point.orbit
    if known is None:
        reversals = reversals_of(orbit)
        rows = [] if reversals is None else reversals.tolist()
        n, coefficients, of_contact = orbit.system.size, coefficients_of(orbit.system), list[Turns]()
        for place, contact in enumerate(layout_of(orbit.system.structure).contacts):
            vector, own = coefficients[contact.deflection].tolist(), [row for row in rows if row[0] == place]
            values = [float(sum(map(mul, vector, row[2 : 2 + n]))) for row in own]
            of_contact.append(Turns([row[1] for row in own], values))
        known = point.memo[_nearby_depths] = [
            Turns(of_contact[contact].thetas, [side * x - clearance for x in of_contact[contact].values])
            for contact, side, clearance in orbit.system.breakpoints
        ]
    return known


def approaches(orbit: Orbit, switch: int) -> Turns:
    """Return the extrema of a deflection that may pass a breakpoint."""
    # At a rigid stop those are the places nearest to it without an impact. The others are impacts, which are at the
    # stop up to rounding, the farthest places between two of them, and where it is held.
    turns = orbit.turning_depths[switch]
    reactions = orbit.system.structure.reactions
    if not reactions or switch not in {each for _, each in reactions}:
        return turns
    size, depths = _EPS * float(np.abs(orbit.extremes[:, :2]).max()), turns.values
    around = zip(turns.thetas, depths, [*depths[-1:], *depths[:-1]], [*depths[1:], *depths[:1]], strict=True)
    free = [(theta, here) for theta, here, *beside in around if here >= max(beside) and here < -_ROUNDING * size]
    return Turns([theta for theta, _ in free], [depth for _, depth in free])


def _gapless(first: BranchPoint, last: BranchPoint) -> list[bool]:
    """Return for each switch whether its stage has no gap at one of two points: without a gap nothing can touch."""
    both = zip(first.orbit.system.gapless, last.orbit.system.gapless, strict=True)
    return [now or then for now, then in both]


def _crossings(now: Turns, then: Turns, full: float) -> int:
    """Count the extrema that have passed from one side of their breakpoint to the other."""
    # One that enters and one that leaves may cancel in the pattern: a maximum that enters adds a visit, a minimum that
    # enters removes one.
    if [depth > 0.0 for depth in now.values] == [depth > 0.0 for depth in then.values]:
        return 0
    count = 0
    for index, (theta, depth) in enumerate(zip(*now, strict=True)):
        if then.thetas:
            nearest = then.nearest(theta, full)
            if now.nearest(then.thetas[nearest], full) == index:
                count += (depth > 0.0) is not (then.values[nearest] > 0.0)
    return count


def _is_born_near_contact(now: Turns, then: Turns, full: float, near: float) -> bool:
    """Return True if a pair of extrema appeared or vanished near a breakpoint, which it may then have passed."""
    # Near means within the given share of the range of all extrema, or within the distance that other extrema moved
    # meanwhile. That distance shrinks with the step. So a pair that passes a breakpoint just after it appeared is
    # found, however soon.
    fewer, more = sorted((now, then), key=lambda turns: len(turns.thetas))
    if len(more.thetas) < len(fewer.thetas) + 2:
        return False
    lonely, drift = [], 0.0
    for theta, depth in zip(*more, strict=True):
        nearest = fewer.nearest(theta, full) if fewer.thetas else None
        if nearest is None or apart(fewer.thetas[nearest], theta, full) > _LONELY:
            lonely.append(depth)
        else:
            drift = max(drift, abs(depth - fewer.values[nearest]))
    return bool(lonely) and min(map(abs, lonely)) < max(near * (max(more.values) - min(more.values)), _DRIFT * drift)


class _Pairs:
    """The extrema of a motion that are nearest to those of another one, found once for all breakpoints of a contact."""

    def __init__(self, full: float) -> None:
        self._full, self._known = full, list[tuple[list[float], list[float], list[int]]]()

    def between(self, some: Turns, others: Turns) -> list[int]:
        """Return, for each extremum of the first motion, the index of the nearest one of the other."""
        for thetas, theirs, places in self._known:
            if thetas is some.thetas and theirs is others.thetas:
                return places
        places = [others.nearest(theta, self._full) for theta in some.thetas]
        self._known.append((some.thetas, others.thetas, places))
        return places


def _may_touch(before: BranchPoint, first: BranchPoint, last: BranchPoint, switch: int, pairs: _Pairs) -> bool:
    """Return True if an extremum, known at three points, may have touched a breakpoint between the last two."""
    if first.arclength <= before.arclength:
        return False
    ratio = (last.arclength - first.arclength) / (first.arclength - before.arclength)
    now, then, past = (approaches(point.orbit, switch) for point in (first, last, before))
    if not now.thetas or not then.thetas or not past.thetas:
        return False
    places = zip(now.values, pairs.between(now, then), pairs.between(now, past), strict=True)
    for depth, following, preceding in places:
        ahead = then.values[following]
        bend = abs((ahead - depth) - ratio * (depth - past.values[preceding]))
        if min(abs(depth), abs(ahead)) < _DOUBT * bend:
            return True
    return False


def _locate(interval: StepInterval, first: BranchPoint, last: BranchPoint, switch: int) -> Graze | None:
    """Locate the point between `first` and `last` where the deflection just reaches the breakpoint of a switch."""
    # Return None if the extremum that reaches it cannot be tracked, because it may have appeared in between.
    fewer, richer = sorted((first, last), key=lambda point: point.orbit.closings[switch])
    tracked = {richer.arclength: _extremum(richer.orbit, switch, _shortest_visit(richer.orbit, switch))}

    def depth(arclength: float) -> float:
        if arclength not in tracked:
            nearest = min(tracked, key=lambda known: abs(known - arclength))
            tracked[arclength] = _extremum(interval.at(arclength).orbit, switch, tracked[nearest][0])
        return tracked[arclength][1]

    ends = depth(richer.arclength), depth(fewer.arclength)
    if ends[0] * ends[1] >= 0.0:
        return None
    root = zero_between(depth, first.arclength, last.arclength)[0]
    if abs(depth(root)) > _TOUCH * max(map(abs, ends)):
        return None
    point = interval.at(root)
    if _is_torn(interval, richer, point, switch):
        raise NumericalError(
            "the orbits on both sides of a graze are not neighbours: the branch turns back between them"
        )
    return Graze(point, switch, tracked[root][0], 1e-12)


def _is_torn(interval: StepInterval, richer: BranchPoint, graze: BranchPoint, switch: int) -> bool:
    """Return True if the orbits just beside a graze are far from it, on the side on which the stage is passed."""
    # Beside a graze of a stage whose friction is there at once, changes of the motion grow without bound. The branch
    # may turn back at the graze, and once more a little beyond; a step may pass over both, with both ends stable.
    rigid = {each for _, each in graze.orbit.system.structure.reactions}
    if switch in rigid or switch not in jumping_switches(graze.orbit.system):
        return False
    ahead = 0.5 * (richer.arclength - graze.arclength)
    ahead = math.copysign(min(_BESIDE, abs(ahead)), ahead)
    return length_of(interval.at(graze.arclength + ahead).x - graze.x) > _TORN * abs(ahead)


def _shortest_visit(orbit: Orbit, switch: int) -> float:
    """Return the middle of the shortest time between two events of a switch: the visit or absence about to vanish."""
    thetas = np.array([event.theta for event in orbit.events if event.switch == switch])
    full = PERIOD * orbit.period
    following = np.append(thetas[1:], thetas[0] + full)
    shortest = int(np.argmin(following - thetas))
    return float(0.5 * (thetas[shortest] + following[shortest]) % full)


def depth_near(orbit: Orbit, switch: int, theta: float) -> float:
    """Return the depth beyond the breakpoint of a switch of the deflection's extremum nearest to an angle."""
    return _extremum(orbit, switch, theta)[1]


def _touch(orbit: Orbit, switch: int) -> float:
    """Return the angle of the extremum that is nearest to the breakpoint of a switch."""
    turns = orbit.turning_depths[switch]
    return turns.thetas[int(np.argmin(np.abs(turns.values)))]


def _extremum(orbit: Orbit, switch: int, near: float) -> tuple[float, float]:
    """Return angle, and depth beyond the breakpoint, of the deflection's extremum nearest to an angle."""
    turns = orbit.turning_depths[switch]
    nearest = turns.nearest(near, PERIOD * orbit.period)
    return turns.thetas[nearest], turns.values[nearest]
