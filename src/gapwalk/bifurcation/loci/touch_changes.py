"""Change of the turning points of deflections along a locus: the arclength to the next graze, and steps that miss one.

A touch adds two events: the deflection turns slightly beyond its breakpoint, at a depth d, and returns. Near it the
multipliers change like the square root of d, so that is the length in which a locus is measured there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.flow.flow import PERIOD

_SAME = 0.3  # radians by which a turning point may move between two points
_LEAP = 0.5  # largest error of a predicted touch, as a share of the square root of its depth


class Turning(NamedTuple):
    """Turning point of a deflection: switch, angle, depth beyond the breakpoint, and whether it is a touch."""

    switch: int
    theta: float
    depth: float
    is_touch: bool

    @property
    def distance(self) -> float:
        """Distance from the breakpoint, in a measure in which a locus is smooth."""
        return math.sqrt(abs(self.depth)) if self.is_touch else abs(self.depth)


class Approach(NamedTuple):
    """Turning point that approaches its breakpoint, with the arclength after which it will reach it."""

    reach: float
    turning: Turning


def approaches(before: BranchPoint | None, point: BranchPoint) -> list[Approach]:
    """Return the turning points that approach their breakpoints, the first to arrive first."""
    if before is None:
        return []
    found, length = [], point.arclength - before.arclength
    for past, now in _pairs(before, point):
        if past.is_touch is now.is_touch and past.depth * now.depth > 0.0 and now.distance < past.distance:
            found.append(Approach(length * now.distance / (past.distance - now.distance), now))
    return sorted(found)


def leaps(before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> bool:
    """Return whether a step changes a touch in a way that the points before it do not predict.

    Arcs of a locus that differ only by a touch are close to each other, and a step may jump from one to the other.
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
    """Return all turning points of all deflections of an orbit."""
    found = point.memo.get("turnings")
    if found is None:
        found = []
        for switch, (thetas, depths) in enumerate(point.orbit.turning_depths):
            for index, (theta, depth) in enumerate(zip(thetas, depths, strict=True)):
                is_highest = depth >= depths[index - 1]
                found.append(Turning(switch, theta, depth, (depth > 0.0) is is_highest))
        point.memo["turnings"] = found  # stored only when complete: another thread may read it
    return found


def _pairs(first: BranchPoint, last: BranchPoint) -> Iterator[tuple[Turning, Turning]]:
    """Yield the turning points of one orbit, each with the nearby one of the other orbit that it has become."""
    full = PERIOD * first.orbit.period
    for turning in turnings(last):
        others = [other for other in turnings(first) if other.switch == turning.switch]
        if others:
            apart = [abs((other.theta - turning.theta + full / 2) % full - full / 2) for other in others]
            nearest = int(np.argmin(apart))
            if apart[nearest] < _SAME:
                yield others[nearest], turning
