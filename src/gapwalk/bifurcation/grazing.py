"""Grazing: where a contact just touches a breakpoint, so that the contact pattern changes along the branch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gapwalk.bifurcation.stretch import Stretch
from gapwalk.continuation.point import BranchPoint
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.motion import switch_names
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.survey import Turns, apart

_SMALLEST = 1e-11  # arclength below which two changes of the pattern count as one
_BIRTH = 2e-4  # arclength to which the appearance of a pair of extremes near a breakpoint is narrowed down
_FINEST = 1e-6  # arclength below which a pair of changes that undo each other is not told apart
_DOUBT = 0.5  # share of its bend by which an extremum may have moved between two points; 1/8 for a parabola


class Graze(NamedTuple):
    """A grazing point: the point of the branch, which switch grazes, and the bracket's width in the parameter."""

    point: BranchPoint
    switch: int
    uncertainty: float


def find_grazing(stretch: Stretch, before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> list[Graze]:
    """All grazing points between two neighbouring points of a walk, in order; `before` is the point before them.

    A change of the pattern between two points is halved until each grazing point stands alone. Two changes that undo
    each other within one step leave no trace in the pattern: wherever an extremum of a deflection bends so fast that
    it may have touched its breakpoint between two points, the step is halved until that doubt is gone.
    """
    changes = [then - now for now, then in zip(first.orbit.closings, last.orbit.closings, strict=True)]
    number = sum(map(abs, changes))
    if number == 1:
        return [_locate(stretch, first, last, int(np.flatnonzero(changes)[0]))]
    length = last.arclength - first.arclength
    if number and length < _SMALLEST:
        spread = abs(last.value - first.value)
        return [Graze(last, int(switch), spread) for switch in np.flatnonzero(changes)]
    if not number and not _is_doubtful(before, first, last, length):
        return []
    middle = stretch.middle(first, last)
    return find_grazing(stretch, before, first, middle) + find_grazing(stretch, first, middle, last)


def _is_doubtful(before: BranchPoint | None, first: BranchPoint, last: BranchPoint, length: float) -> bool:
    """Whether a pair of grazing points may hide between two points of equal pattern."""
    if length > _BIRTH and _is_born_near_contact(first.orbit, last.orbit):
        return True
    return length > _FINEST and _may_touch(before, first, last)


def _is_born_near_contact(first: Orbit, last: Orbit) -> bool:
    """Whether a pair of extremes of a deflection appeared or vanished near a breakpoint."""
    for switch in range(len(first.closings)):
        fewer, more = sorted((orbit.turning_depths[switch] for orbit in (first, last)), key=lambda t: len(t.thetas))
        if len(more.thetas) < len(fewer.thetas) + 2:
            continue
        lonely = [depth for theta, depth in zip(*more, strict=True) if _is_lonely(theta, fewer, PERIOD * last.period)]
        if lonely and min(map(abs, lonely)) < 0.02 * (max(more.values) - min(more.values)):
            return True
    return False


def _is_lonely(theta: float, turns: Turns, full: float) -> bool:
    """Whether no turning point is near an angle."""
    return not turns.thetas or apart(turns.thetas[turns.nearest(theta, full)], theta, full) > 0.05


def _may_touch(before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> bool:
    """Whether an extremum of a deflection, seen at three points, may have touched a breakpoint between the last two."""
    if before is None or first.arclength <= before.arclength:
        return False
    ratio = (last.arclength - first.arclength) / (first.arclength - before.arclength)
    full = PERIOD * first.orbit.period
    for now, then, past in zip(*(point.orbit.turning_depths for point in (first, last, before)), strict=True):
        if not now.thetas or not then.thetas or not past.thetas:
            continue
        for theta, depth in zip(*now, strict=True):
            following = then.values[then.nearest(theta, full)]
            preceding = past.values[past.nearest(theta, full)]
            bend = abs((following - depth) - ratio * (depth - preceding))
            if min(abs(depth), abs(following)) < _DOUBT * bend:
                return True
    return False


def describe_switch(orbit: Orbit, switch: int) -> str:
    """Contact, stage and side of a switch, such as ``stage2 -``."""
    contact, stage, side = switch_names(orbit.system)[switch]
    return f"{contact}{'.' + stage if stage else ''} {'+' if side > 0 else '-'}"


def _locate(stretch: Stretch, first: BranchPoint, last: BranchPoint, switch: int) -> Graze:
    """The point between `first` and `last` where the deflection just reaches the breakpoint of a switch."""
    fewer, richer = sorted((first, last), key=lambda point: point.orbit.closings[switch])
    where = _shortest_visit(richer.orbit, switch)
    tracked, depths = {"theta": where}, {}

    def depth(arclength: float) -> float:
        if arclength not in depths:  # once for each place: the extremum that is tracked moves on
            tracked["theta"], depths[arclength] = _extremal_depth(stretch.at(arclength).orbit, switch, tracked["theta"])
        return depths[arclength]

    low, high = first.arclength, last.arclength
    if depth(richer.arclength) * depth(fewer.arclength) < 0:
        root = float(brentq(depth, low, high, xtol=1e-13, rtol=1e-14))
        point = stretch.at(root)
        return Graze(point, switch, abs(float(point.tangent[-1])) * 1e-12)
    return _halve(stretch, first, last, switch)


def _halve(stretch: Stretch, first: BranchPoint, last: BranchPoint, switch: int) -> Graze:
    """The same by halving on the number of closings, where no extremum can be tracked."""
    while last.arclength - first.arclength > _SMALLEST:
        middle = stretch.middle(first, last)
        if middle.orbit.closings[switch] == first.orbit.closings[switch]:
            first = middle
        else:
            last = middle
    return Graze(last, switch, abs(last.value - first.value))


def _shortest_visit(orbit: Orbit, switch: int) -> float:
    """Middle of the shortest time between two events of one switch: the visit or the absence about to vanish."""
    thetas = np.array([event.theta for event in orbit.events if event.switch == switch])
    full = PERIOD * orbit.period
    following = np.append(thetas[1:], thetas[0] + full)
    shortest = int(np.argmin(following - thetas))
    return float(0.5 * (thetas[shortest] + following[shortest]) % full)


def _extremal_depth(orbit: Orbit, switch: int, near: float) -> tuple[float, float]:
    """Angle, and deflection past the breakpoint, of the deflection's extremum nearest to an angle."""
    turns = orbit.turning_depths[switch]
    nearest = turns.nearest(near, PERIOD * orbit.period)
    return turns.thetas[nearest], turns.values[nearest]
