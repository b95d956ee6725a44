"""Corners: where a contact grazes at a bifurcation, the locus turns sharply, and the walk needs a special step.

A touch adds two events: the deflection turns slightly beyond its breakpoint, at a depth d, and returns. The monodromy
matrix changes like the square root of d. With the condition ``g = s + c sqrt(d)``, where s is smooth, the locus crosses
the grazing locus on the side without the touch. On the other side it leaves it tangentially, like the parabola
``d = (s / c)^2``. So two smooth arcs meet at an angle. Seen from the grazing locus both are smooth curves, over d on
one side and over its square root on the other (see `NearGrazing`), so a locus is measured in that length there.

The turning points of deflections, and their changes along the locus, give the arclength to the next graze, and show
steps that have missed one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.loci.codimension_two import Finding
from gapwalk.bifurcation.loci.locus import Codim2
from gapwalk.bifurcation.loci.locus_equations import MARGIN, GrazingEquation, MultiplierEquation, Secant, zero_along
from gapwalk.bifurcation.special_point import describe_switch
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.orbit import Orbit

_SECANT = Secant()
_SAME = 0.3  # radians by which a turning point may move between two points
_LEAP = 0.5  # largest error of a predicted touch, as a share of the square root of its depth
_NEAR = 1e-3  # distance from a breakpoint, in units of the state, within which a turning point may form the corner
_STRAIGHT = 0.9  # smallest cosine of the angle between the tangent and the direction of the corner
_HALVINGS = 4  # number of times that the depth is reduced to check that the locus leads to the corner
_LEAST = 3.0  # smallest depth in that check, in margins
_NEARER = 0.8  # largest ratio of successive distances from the corner in that check
_SHALLOW = 1e-7  # depth, in units of the state, at which the locus beyond the corner is sought first
_SHORTENINGS = 10  # number of times that the next depth there may be brought closer to the one before
_STRAYED = 0.1  # largest deviation of a place from its prediction, as a share of its distance from the one before
_TINY = 1e-7  # scaled deviation that is always allowed
_FAR_ENOUGH = 0.5  # distance from the corner, in multiples of AWAY, from which the walk can continue

AWAY = 1e-3
"""Scaled distance from a corner within which a walk does not step, but is led round the corner."""


class Corner(NamedTuple):
    """Corner of a locus: what happens there, and the point of the locus beyond, from which the walk continues."""

    finding: Finding
    beyond: BranchPoint


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


def turn_corner(
    corrector: Corrector, point: BranchPoint, within: float, ahead: Sequence[Approach] = ()
) -> Corner | None:
    """Return the corner just ahead of a point of a locus; None if there is none that can be turned."""
    near = _NEAR * float(corrector.scales[0])
    nearby = sorted((each for each in turnings(point) if abs(each.depth) < near), key=lambda each: abs(each.depth))
    for turning in [each.turning for each in ahead] or nearby:
        try:
            corner = _turn(corrector, point, within, turning)
        except (NumericalError, np.linalg.LinAlgError):
            continue
        if corner is not None:
            return corner
    return None


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


def is_highest(correction: Correction) -> bool:
    """Return True if the deflection has a maximum, not a minimum, on the corrected orbit."""
    return bool(correction.evaluation.by_unknowns[-1, -2] < 0.0)  # the derivative of its rate by the angle


def _turn(corrector: Corrector, point: BranchPoint, within: float, turning: Turning) -> Corner | None:
    """Return the corner at which one turning point grazes, if the locus leads there and continues beyond."""
    near = NearGrazing(corrector, turning.switch)
    start = np.insert(point.x, -2, turning.theta / PERIOD)
    corner = near.corner(start)
    if corner is None:
        return None
    way = on_locus(corner) - point.x
    length = float(np.linalg.norm(way))
    if length > within or float(way @ point.tangent) < _STRAIGHT * length:
        return None  # the corner of another arc
    if not _leads_there(near, start, corner, turning):
        return None
    beyond = _beyond(corrector, near, corner, turning)
    if beyond is None or beyond.orbit.closings == point.orbit.closings:
        return None
    x, orbit = on_locus(corner), near.orbit(corner)
    value = float(x[-1] * corrector.scales[-1])
    there = replace(point, value=value, orbit=orbit, x=x, arclength=point.arclength + length, memo={})
    arclength = there.arclength + float(np.linalg.norm(beyond.x - x))
    finding = Finding(Codim2.GRAZING, there, describe_switch(orbit, turning.switch))
    return Corner(finding, replace(beyond, arclength=arclength))


class NearGrazing:
    """Orbits of a locus of multipliers on which one deflection turns at a given depth beyond its breakpoint.

    The condition on the multipliers changes like the square root of that depth. The orbits of a given depth, however,
    form a smooth curve close to the grazing locus, and the condition is smooth along it. So the orbits are found by
    following that curve to the point where the condition holds.
    """

    def __init__(self, corrector: Corrector, switch: int) -> None:
        equation = cast("MultiplierEquation", corrector.equation)
        self.equation, self.unit = equation, float(corrector.scales[0])
        self.margin = MARGIN * self.unit
        self._touch = GrazingEquation(equation.plane, switch, 0.0, min(equation.tolerance, 0.1 * self.margin))
        self._scales = np.insert(corrector.scales, -2, PERIOD)

    def corner(self, start: NDArray[np.float64]) -> Correction | None:
        """Return the orbit of the locus that just touches, seen from outside the breakpoint."""
        x = start * self._scales
        return self.at(-self.margin if self._touch.is_highest(x[:-1], float(x[-1])) else self.margin, start)

    def at(self, depth: float, start: NDArray[np.float64]) -> Correction | None:
        """Return the orbit with a given depth, found along the curve of that depth; None if none is found."""
        corrector = Corrector(replace(self._touch, depth=depth), self._scales)
        criticality = self.equation.criticality
        return zero_along(corrector, start, lambda found: criticality(found.evaluation.evidence).value, _SECANT)

    def orbit(self, correction: Correction) -> Orbit:
        """Return the orbit of a correction."""
        x = correction.x * self._scales
        return self._touch.orbit(x[:-1], float(x[-1]), correction.evaluation)


def on_locus(correction: Correction) -> NDArray[np.float64]:
    """Return the locus variables of the orbit of a correction: all except the angle of the turning point."""
    return np.delete(correction.x, -3)


def _leads_there(near: NearGrazing, start: NDArray[np.float64], corner: Correction, turning: Turning) -> bool:
    """Return True if the locus leads from a start to a corner: its distance must shrink in proportion to the depth."""
    there, depth = on_locus(corner), turning.depth
    distance = float(np.linalg.norm(np.delete(start, -3) - there))
    for _ in range(_HALVINGS):
        depth *= 0.25 if turning.is_touch else 0.5
        if abs(depth) < _LEAST * near.margin:
            break
        at = near.at(depth, start)
        if at is None or is_highest(at) is not is_highest(corner):
            return False
        start, before = at.x, distance
        distance = float(np.linalg.norm(on_locus(at) - there))
        if distance > _NEARER * before:
            return False
    return True


def _beyond(corrector: Corrector, near: NearGrazing, corner: Correction, turning: Turning) -> BranchPoint | None:
    """Return the point of the locus slightly beyond its corner, where the deflection turns on the other side.

    The locus is followed outwards from the corner over the measure in which it is smooth: the depth or its square root.
    """
    side = -np.sign(turning.depth) * near.unit
    power, growth = (1, 3.0) if turning.is_touch else (2, 2.0)
    measures, places = [0.0], [corner]
    measure, shortenings = _SHALLOW ** (1.0 / power), 0
    while shortenings < _SHORTENINGS:
        guess = _extrapolated(measures, [place.x for place in places], measure)
        at = near.at(side * measure**power, guess)
        # an orbit that deviates far from its prediction belongs to another arc
        far = max(_STRAYED * float(np.linalg.norm(guess - places[-1].x)), _TINY) if len(places) > 1 else math.inf
        if at is None or is_highest(at) is not is_highest(corner) or float(np.linalg.norm(at.x - guess)) > far:
            measure, shortenings = 0.5 * (measures[-1] + measure), shortenings + 1
            continue
        measures.append(measure)
        places.append(at)
        if float(np.linalg.norm(on_locus(at) - on_locus(corner))) > _FAR_ENOUGH * AWAY:
            break
        measure *= growth
    if len(places) == 1:
        return None
    there, way = on_locus(places[-1]), on_locus(places[-1]) - on_locus(places[-2])
    way /= np.linalg.norm(way)
    correction = corrector.correct(there, way)
    if correction is None or correction.distance > _STRAYED * float(np.linalg.norm(there - on_locus(corner))):
        return None
    return corrector.point(correction, way, 0.0)


def _extrapolated(measures: list[float], places: list[NDArray[np.float64]], measure: float) -> NDArray[np.float64]:
    """Return the place at a measure by the parabola through the last three places, or a lower order with fewer."""
    nodes, known = measures[-3:], places[-3:]
    result = np.zeros_like(known[0])
    for i, place in enumerate(known):
        others = [node for j, node in enumerate(nodes) if j != i]
        result += place * float(np.prod([(measure - node) / (nodes[i] - node) for node in others]))
    return result


def approaches(before: BranchPoint | None, point: BranchPoint) -> list[Approach]:
    """Return the turning points that approach their breakpoints, the first to arrive first."""
    if before is None:
        return []
    found, length = [], point.arclength - before.arclength
    for past, now in _pairs(before, point):
        if past.is_touch is now.is_touch and past.depth * now.depth > 0.0 and now.distance < past.distance:
            found.append(Approach(length * now.distance / (past.distance - now.distance), now))
    return sorted(found)


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


def leaps(before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> bool:
    """Return True if a step changes a touch in a way not predicted by the previous points.

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
