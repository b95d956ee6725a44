"""How the touches of an orbit change along a locus: how far ahead one will graze, and whether a step leaps over any.

A touch adds two events: the deflection turns a little way past its breakpoint, at a depth d, and goes back. Beside it
the multipliers change like the square root of d, so that is the length by which a locus is measured there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gapwalk.continuation.point import BranchPoint
from gapwalk.motion.flow import PERIOD

_SAME = 0.3  # radians by which a turning point may move between two points
_LEAP = 0.5  # share of its root depth by which a touch may differ from what the points before foretell


class Turning(NamedTuple):
    """A turning point of a deflection: switch, angle, depth past the breakpoint, and whether it is a touch."""

    switch: int
    theta: float
    depth: float
    is_touch: bool

    @property
    def distance(self) -> float:
        """Distance from the breakpoint, in a measure in which a locus is smooth."""
        return math.sqrt(abs(self.depth)) if self.is_touch else abs(self.depth)


class Approach(NamedTuple):
    """A turning point that heads for its breakpoint: the arclength ahead at which it will be there, and which it is."""

    reach: float
    turning: Turning


def approaches(before: BranchPoint | None, point: BranchPoint) -> list[Approach]:
    """The turning points that come nearer to their breakpoints, the first to reach it first."""
    if before is None:
        return []
    found, length = [], point.arclength - before.arclength
    for past, now in _pairs(before, point):
        if past.is_touch is now.is_touch and past.depth * now.depth > 0.0 and now.distance < past.distance:
            found.append(Approach(length * now.distance / (past.distance - now.distance), now))
    return sorted(found)


def leaps(before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> bool:
    """Whether a step changes a touch in a way that the points before it do not foretell.

    Arcs of a locus that differ by a touch alone run close to one another, and a step may leap from one to the other.
    """
    rates: dict[tuple[int, float], float] = {}
    if before is not None:
        for past, now in _pairs(before, first):
            rates[now.switch, now.theta] = (now.distance - past.distance) / (first.arclength - before.arclength)
    for now, following in _pairs(first, last):
        if now.is_touch and following.is_touch:
            change = rates.get((now.switch, now.theta), 0.0) * (last.arclength - first.arclength)
            if abs(following.distance - now.distance - change) > _LEAP * now.distance:
                return True
    return False


def turnings(point: BranchPoint) -> list[Turning]:
    """All turning points of all deflections of an orbit."""
    found = point.memo.get("turnings")
    if found is None:
        found = []
        for switch, (thetas, depths) in enumerate(point.orbit.turning_depths):
            for index, (theta, depth) in enumerate(zip(thetas, depths, strict=True)):
                is_highest = depth >= depths[index - 1]
                found.append(Turning(switch, theta, depth, (depth > 0.0) is is_highest))
        point.memo["turnings"] = found  # when it is whole: another thread may ask
    return found


def _pairs(first: BranchPoint, last: BranchPoint) -> Iterator[tuple[Turning, Turning]]:
    """The turning points of one orbit, each with that of another nearby that it has become."""
    full = PERIOD * first.orbit.period
    for turning in turnings(last):
        others = [other for other in turnings(first) if other.switch == turning.switch]
        if others:
            apart = [abs((other.theta - turning.theta + full / 2) % full - full / 2) for other in others]
            nearest = int(np.argmin(apart))
            if apart[nearest] < _SAME:
                yield others[nearest], turning
