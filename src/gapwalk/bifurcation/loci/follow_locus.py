"""Continuation of a special point in two parameters: its locus, with its points of codimension two.

Method: docs/numerics/notes/special-points.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, singledispatch
from itertools import pairwise, product
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.loci.begin_at import special_at, special_beside
from gapwalk.bifurcation.loci.locus import (
    AT_GRAZE,
    RESONANT,
    Codim2,
    Codim2Point,
    Finding,
    Locus,
    LocusEnd,
    LocusEndReason,
    LocusPoint,
    errors_of,
    find_codim2,
    find_degenerate,
    find_end_at_graze,
    find_merging,
    half_ahead,
    leaves_degenerate,
    leaves_phase,
    short_of,
    zero_at_graze,
)
from gapwalk.bifurcation.loci.locus_equations import (
    MARGIN,
    GrazingEquation,
    LocusEquation,
    MultiplierEquation,
    OrbitPlane,
    Secant,
    ShotPlane,
    SlidingEquation,
    onto_curve,
    posed,
    zero_along,
)
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.bifurcation.steps_over_corners import free_angle
from gapwalk.continuation.corrector import Correction, Corrector, Range, powers_of_two
from gapwalk.continuation.curve import joined
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, Tracing, Walk, WalkOptions, WalkState
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.event_rule import jumping_switches, one_way_switches
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit, apart, describe_switch, switch_named
from gapwalk.orbit.shooting import Shooting

# Corners: where a contact grazes at a bifurcation, the locus turns sharply, and the walk needs a special step.
#
# A touch adds two events: the deflection turns slightly beyond its breakpoint, at a depth d, and returns. The
# monodromy matrix changes like the square root of d. With the condition ``g = s + c sqrt(d)``, where s is smooth, the
# locus crosses the grazing locus on the side without the touch. On the other side it leaves it tangentially, like the
# parabola ``d = (s / c)^2``. So two smooth arcs meet at an angle. Seen from the grazing locus both are smooth curves,
# over d on one side and over its square root on the other (see `NearGrazing`), so a locus is measured in that length
# there.
#
# The turning points of deflections, and their changes along the locus, give the arclength to the next graze, and show
# steps that have missed one.

_SECANT = Secant()
_SAME = 0.3  # radians by which a turning point may move between two points
_LEAP = 0.5  # largest error of a predicted touch, as a share of the square root of its depth
_NEAR = 1e-3  # distance from a breakpoint, in units of the state, within which a turning point may form the corner
_STRAIGHT = 0.9  # smallest cosine of the angle between the tangent and the direction of the corner
_HALVINGS = 4  # number of times that the depth is reduced to check that the locus leads to the corner
_LEAST = 3.0  # smallest depth in that check, in margins
_NEARER = 0.8  # largest ratio of successive distances from the corner in that check
_SOUGHT_FIRST = 1e-7  # depth, in units of the state, at which the locus beyond the corner is sought first
_SHORTENINGS = 10  # number of times that the next depth there may be brought closer to the one before
_STRAYED = 0.1  # largest deviation of a place from its prediction, as a share of its distance from the one before
_TINY = 1e-7  # scaled deviation that is always allowed
_LEAD = 4.0  # angle before a turning point at which a touch has not begun, in radians by the root of its depth
_WIDER, _CLOSER = 100.0, 1e-3  # ratios of the distances from the breakpoint at which the end at a graze is located
_FAR_ENOUGH = 0.5  # distance from the corner, in multiples of AWAY, from which the walk can continue

AWAY = 1e-3
"""Scaled distance from a corner within which a walk does not step, but is led round the corner."""


class Corner(NamedTuple):
    """Corner of a locus: what happens there, and the point beyond from which the walk continues; None at its end."""

    finding: Finding
    beyond: BranchPoint | None


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
    corner = near.corner(start, None if turning.is_touch else abs(turning.depth))
    if corner is None:
        return None
    way = on_locus(corner) - point.x
    length = float(np.linalg.norm(way))
    if length > within or float(way @ point.tangent) < _STRAIGHT * length:
        return None  # the corner of another arc
    if not _leads_there(near, start, corner, turning):
        return None
    x, orbit = on_locus(corner), near.orbit(corner)
    value, contact = float(x[-1] * corrector.scales[-1]), describe_switch(orbit, turning.switch)
    there = replace(point, value=value, orbit=orbit, x=x, arclength=point.arclength + length, memo={})
    if not turning.is_touch and turning.switch in jumping_switches(orbit.system, friction=False):
        # a touch, however light, moves all multipliers away
        return Corner(Finding(AT_GRAZE[near.equation.kind.target], there, contact), None)
    beyond = _beyond(corrector, near, corner, turning)
    if beyond is None or beyond.orbit.closings == point.orbit.closings:
        return None
    arclength = there.arclength + float(np.linalg.norm(beyond.x - x))
    finding = Finding(Codim2.GRAZING, there, contact)
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

    def corner(self, start: NDArray[np.float64], missed: float | None) -> Correction | None:
        """Return the orbit of the locus that just touches, seen from outside; `missed` is the distance at the start."""
        found = self.at(self._outside(start), start)
        if found is not None or missed is None:
            return found
        return zero_at_graze(self._ever_nearer(missed, start), start, self._condition)

    def _ever_nearer(self, depth: float, start: NDArray[np.float64]) -> list[Corrector]:
        """Return correctors of motions that miss the breakpoint, by a depth and ever less."""
        # Newton's method must not step over the breakpoint, where the effect of a touch is that of a root. Its steps
        # err by their square.
        sign, depths = math.copysign(1.0, self._outside(start)), [depth]
        while depths[-1] > self.margin:
            depths.append(max(_CLOSER * depths[-1], self.margin))
        return [Corrector(replace(self._touch, depth=sign * depth), self._scales) for depth in depths]

    def _condition(self, found: Correction) -> float:
        return self.equation.criticality(found.evaluation.evidence).value

    def outside(self, point: BranchPoint, turning: Turning) -> tuple[list[Corrector], NDArray[np.float64]]:
        """Return correctors of motions that do not touch, by ever less, and a start for the first near a point."""
        # steps to the end of a locus are as long as the root of the depth
        start = np.insert(point.x, -2, turning.theta / PERIOD)
        correctors = self._ever_nearer(_WIDER * abs(turning.depth), start)
        first = cast("GrazingEquation", correctors[0].equation)
        before = turning.theta - _LEAD * math.sqrt(abs(turning.depth) / self.unit)
        return correctors, _deeper(first, start, self._scales, before, first.depth - turning.depth)

    def _outside(self, start: NDArray[np.float64]) -> float:
        x = start * self._scales
        return -self.margin if self._touch.is_highest(x[:-1], float(x[-1])) else self.margin

    def at(self, depth: float, start: NDArray[np.float64]) -> Correction | None:
        """Return the orbit with a given depth, found along the curve of that depth; None if none is found."""
        corrector = Corrector(replace(self._touch, depth=depth), self._scales)
        return zero_along(corrector, start, self._condition, _SECANT)

    def orbit(self, correction: Correction) -> Orbit:
        """Return the orbit of a correction."""
        x = correction.x * self._scales
        return self._touch.orbit(x[:-1], float(x[-1]), correction.evaluation)


def _deeper(
    touch: GrazingEquation, start: NDArray[np.float64], scales: NDArray[np.float64], before: float, change: float
) -> NDArray[np.float64]:
    """Return a start whose deflection is deeper by a change, by the derivatives at an angle before it touches."""
    x, start = start * scales, start.copy()
    place = touch.place(x[:-1], float(x[-1]))
    size = len(place.unknowns)
    _, slopes = touch.plane.turning(touch.switch, place, before)
    way = slopes[0, :size] * scales[:size]
    start[:size] += change * way / float(way @ way)
    return start


def _ends(
    near: NearGrazing, target: float | None, point: BranchPoint, turning: Turning, within: float
) -> Iterator[Finding]:
    """Yield the end of a locus at a graze near a point, if there is one."""
    with suppress(NumericalError, np.linalg.LinAlgError):
        found = find_end_at_graze(target, *near.outside(point, turning), point, within)
        if found is not None:
            yield found


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
    """Return the point of the locus slightly beyond its corner, where the deflection turns on the other side."""
    # The locus is followed outwards from the corner over the measure in which it is smooth: the depth or its square
    # root.
    side = -np.sign(turning.depth) * near.unit
    power, growth = (1, 3.0) if turning.is_touch else (2, 2.0)
    measures, places = [0.0], [corner]
    measure, shortenings = _SOUGHT_FIRST ** (1.0 / power), 0
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
    return corrector.point_near(there, way, within=_STRAYED * float(np.linalg.norm(there - on_locus(corner))))


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
    """Return True if a step changes a touch in a way not predicted by the previous points."""
    # Arcs of a locus that differ only by a touch are close to each other, and a step may jump from one to the other.
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


# Beginning of a locus: a special point in the plane of two parameters, and a direction.

AnyEquation = MultiplierEquation | GrazingEquation | SlidingEquation
"""Equation of a locus, which belongs to the kind of its special point."""

Ranges = tuple[tuple[float, float], tuple[float, float]]
"""Ranges of both parameters."""

_MISSED = 1e-7  # distance from the breakpoint of the start of a locus of grazes, if the motion at the point touches
_FAR = 1e-3  # scaled distance from the special point beyond which the corrected start is another point
_LITTLE = 0.01  # share of the allowed error below which more harmonics would not help
_COARSE = 1e-2  # largest scaled distance if the two are resolved with different numbers of harmonics


@dataclass(frozen=True)
class LocusStart:
    """Point and direction from which a locus can be walked."""

    kind: Kind  #: Kind of the locus.
    corrector: Corrector  #: Corrector for the locus; it holds the equation and the scales.
    first: BranchPoint  #: The point; its tangent gives the direction.
    within: tuple[Range, Range]  #: Ranges of both parameters.
    contact: str = ""  #: On a grazing locus the contact, stage and side that grazes; otherwise empty.

    @property
    def equation(self) -> MultiplierEquation | GrazingEquation:
        """Equation whose solutions form the locus."""
        return cast("MultiplierEquation | GrazingEquation", self.corrector.equation)

    @property
    def plane(self) -> OrbitPlane:
        """Plane of two parameters, with its orbits, in which the locus is followed."""
        return self.equation.plane


def start_locus(
    special: SpecialPoint | Codim2Point,
    first: str,
    second: str,
    to: Ranges,
    method: Method | None = None,
    kind: str | None = None,
) -> list[LocusStart]:
    """Begin the locus of a special point in both directions: towards smaller `first`, then towards larger."""
    start = special_at(special, kind)
    within = _checked(start, first, second, to)
    if isinstance(special, Codim2Point) and special.kind in RESONANT and start.kind.by_multipliers:
        start = special_beside(special, start.kind, (first, second), within)
    corrector, there = _started(plane_of(chosen(method), start.orbit, (first, second)), start, within)
    back = replace(there, tangent=-there.tangent, determinant=-there.determinant, memo={})
    return [LocusStart(start.kind, corrector, point, within, start.contact) for point in (back, there)]


def refined(beginning: LocusStart) -> LocusStart | None:
    """Return the beginning with the next finer resolution of its orbits; None if there is none."""
    equation, scales = beginning.equation, beginning.corrector.scales
    plane = equation.plane.finer()
    if plane is None:
        return None
    # a finer resolution adds unknowns of the same kind
    size = len(plane.unknowns(beginning.first.orbit))
    scales = np.concatenate((np.full(size, scales[0]), scales[-1 - equation.others :]))
    corrector = Corrector(equation.on(plane, scales), scales)
    first = lift(beginning.first, corrector)
    return None if first is None else replace(beginning, corrector=corrector, first=first)


def lift(point: BranchPoint, corrector: Corrector) -> BranchPoint | None:
    """Return a point of a locus, posed by a finer equation of the same locus; None if Newton's method fails."""
    equation = cast("LocusEquation", corrector.equation)
    x = np.append(equation.unknowns(point.orbit), point.value) / corrector.scales
    if isinstance(equation, GrazingEquation):
        x[-3] = point.x[-3]  # the orbit itself does not determine which turning point grazes
    correction, tangent = onto_curve(corrector, x)
    if correction is None or correction.distance > _COARSE:
        return None
    # the angle at which a contact touches, if any, and both parameters
    others = slice(-1 - equation.others, None)
    way = float(tangent[others] @ point.tangent[others])
    return corrector.point(correction, tangent if way > 0.0 else -tangent, point.arclength)


def _started(plane: OrbitPlane, special: SpecialPoint, within: tuple[Range, Range]) -> tuple[Corrector, BranchPoint]:
    """Return the corrector for the locus of a special point, refined as necessary, and its first point."""
    names, value = plane.names, special.orbit.system[plane.names[1]]
    corrector, start = _posed(plane, special, within)
    equation, x, finer = corrector.equation, start * corrector.scales, plane.finer()
    orbit = equation.orbit(x[:-1], float(x[-1]), equation.evaluate(x[:-1], float(x[-1])))
    inaccuracy = plane.inaccuracy(orbit)
    if inaccuracy and finer is not None:
        return _started(finer, special, within)
    correction, tangent = onto_curve(corrector, start)
    if correction is None and isinstance(equation, GrazingEquation):  # the motion at the point may touch
        correction, tangent = onto_curve(corrector, _missing(equation, start, corrector.scales))
    if correction is None or correction.distance > (_FAR if isinstance(plane, ShotPlane) else _COARSE):
        if finer is not None and plane.inaccuracy(orbit, _LITTLE):
            return _started(finer, special, within)
        place = ", ".join(f"{name} = {special.orbit.system[name]:.10g}" for name in names)
        raise ConvergenceError(inaccuracy or f"the start is not a {special.kind.value} at {place}")
    held = corrector.at_value(correction.x, value)
    if held is not None and held.distance <= _FAR:  # the same point at the exact second parameter: it may be a limit
        correction = held
    if tangent[-2] < 0.0 or (tangent[-2] == 0.0 and tangent[-1] < 0.0):
        tangent = -tangent
    there = corrector.point(correction, tangent, 0.0)
    inaccuracy = plane.inaccuracy(there.orbit)
    if not inaccuracy:
        return corrector, there
    if finer is None:
        raise ConvergenceError(inaccuracy)
    return _started(finer, special, within)


@singledispatch
def plane_of(method: Method, orbit: Orbit, names: tuple[str, str]) -> OrbitPlane:
    """Return the plane of orbits of two parameters that contains an orbit, with the discretisation of a method."""
    raise ModelError(f"a locus cannot be followed by the method {method.name}; write Shooting() or Balance()")


@plane_of.register(Shooting)
def _shot(method: Shooting, orbit: Orbit, names: tuple[str, str]) -> OrbitPlane:
    if method.segments > 1:
        raise ModelError(f"segments is {method.segments}; a locus is followed with one, write Shooting(segments=1)")
    # where an event passes the start of the period the state there jumps, or has a corner
    sharp = jumping_switches(orbit.system, friction=False) | one_way_switches(orbit.system)
    begin = free_angle(orbit, 1) if sharp else 0.0
    return ShotPlane(orbit.system, names, orbit.period, method, begin=begin)


@plane_of.register(Balance)
def _balanced(method: Balance, orbit: Orbit, names: tuple[str, str]) -> OrbitPlane:
    from gapwalk.bifurcation.loci.balanced_plane import BalancedPlane  # loads numba, which takes time

    harmonics = method.pose(orbit.system, None, orbit.period).harmonics
    if method.harmonics is None:
        harmonics = max(harmonics, orbit.harmonics)
    return BalancedPlane(orbit.system, names, orbit.period, method, harmonics)


def _posed(
    plane: OrbitPlane, special: SpecialPoint, within: tuple[Range, Range]
) -> tuple[Corrector, NDArray[np.float64]]:
    """Return the corrector for the locus of a special point, and the start in its variables."""
    equation, unknowns, scales = equation_of(plane, special, [each.width for each in within])
    start = np.append(unknowns, special.orbit.system[plane.names[1]]) / scales
    if isinstance(equation, GrazingEquation) and equation.switch in one_way_switches(special.orbit.system):
        start = _missing(equation, start, scales)  # how far it touches is rounding
    return Corrector(equation, scales), start


def _missing(touch: GrazingEquation, start: NDArray[np.float64], scales: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a start whose motion does not touch."""
    before = float(start[-3] * scales[-3]) - _LEAD * math.sqrt(_MISSED)
    return _deeper(touch, start, scales, before, math.copysign(_MISSED * float(scales[0]), touch.depth))


def equation_of(
    plane: OrbitPlane, special: SpecialPoint, widths: Sequence[float]
) -> tuple[AnyEquation, NDArray[np.float64], NDArray[np.float64]]:
    """Return the equation of the locus of a special point, its unknowns there, and the scales of all variables."""
    if special.multiplicity > 1:
        raise ConvergenceError(
            f"{special.multiplicity} multipliers become critical at once at the {special.kind_words} at "
            f"{special.value:.10g}, and separate where equal parts become unequal, so the point has no gradient and no "
            "locus; make the parts a little unequal"
        )
    orbit, units = special.orbit, plane.scales(special.orbit)
    equation: AnyEquation
    if isinstance(special.kind, Sliding):
        if not isinstance(plane, ShotPlane):
            raise ModelError(f"the locus of a {special.kind} is followed by shooting; write method=Shooting()")
        equation = posed(plane, special.kind, orbit, special.contact, float(units[0]), plane.tolerance)
        scales = powers_of_two(np.concatenate((units, [PERIOD], widths)))
        unknowns = equation.unknowns(orbit)
    elif special.kind is not Kind.GRAZING:
        scales = powers_of_two(np.append(units, widths))
        equation = MultiplierEquation(plane, special.kind, scales, plane.tolerance)
        unknowns = equation.unknowns(orbit)
    else:
        scales = powers_of_two(np.concatenate((units, [PERIOD], widths)))
        switch = switch_named(orbit, special.contact) or 0
        margin, others = MARGIN * float(units[0]), [orbit.system[name] for name in plane.names[1:]]
        equation = GrazingEquation(plane, switch, 0.0, min(plane.tolerance, 0.1 * margin))
        unknowns = equation.unknowns(orbit)
        before = unknowns.copy()  # the motion at the point may touch
        before[-2] -= _LEAD * math.sqrt(_MISSED)
        equation = replace(equation, depth=-margin if equation.is_highest(before, *others) else margin)
    return equation, unknowns, scales


def _checked(special: SpecialPoint, first: str, second: str, to: Ranges) -> tuple[Range, Range]:
    """Return the ranges; raise a ModelError if the request is invalid."""
    system = special.orbit.system
    if special.kind.no_locus:
        raise ModelError(special.kind.no_locus)
    if special.kind is Kind.GRAZING and switch_named(special.orbit, special.contact) is None:
        raise ModelError(
            f"at this graze {special.contact} begins to act at all angles at once; its locus is not followed: find it "
            f"on branches for several values of {second!r}, as gw.family does"
        )
    if special.orbit.own_method is not None:
        raise ModelError(
            "this motion has no excitation, and its frequency is an unknown; loci of such motions are not followed. "
            "Follow the motions for several values of the second parameter instead"
        )
    places = [system.structure.place(name) for name in (first, second)]
    if places[0] == places[1]:
        raise ModelError(f"both parameters are {first!r}; a locus is a curve in the plane of two different ones")
    try:
        pairs = [(float(low), float(high)) for low, high in to]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) != 2:
        raise ModelError(f"to is {to!r}; write a range for each parameter, such as ((0.2, 0.9), (0.0, 0.5))")
    ranges = []
    for name, (low, high) in zip((first, second), pairs, strict=True):
        if not low < high:
            raise ModelError(
                f"the range of {name} is ({low:.10g}, {high:.10g}); its first value must be the smaller one"
            )
        if not low <= system[name] <= high:
            raise ModelError(
                f"the locus starts at {name} = {system[name]:.10g}, outside the range from {low:.10g} to {high:.10g}"
            )
        ranges.append(replace(Range(low, high).along(name, system), is_relative=False))
    for corner in product(*pairs):
        system.at(dict(zip((first, second), corner, strict=True)))
    return ranges[0], ranges[1]


LocusReport = Callable[[LocusPoint, list[Codim2Point]], None]
"""Function called with each new point and the points of codimension two before it."""


_CORNER = 1e-7  # step below which a corner is searched for if none was predicted
_AT = 100.0  # distance within which it must then lie, in lengths of that step
_OVER = 3.0  # distance within which a predicted corner must lie, in estimated distances
_ENDING = 0.02  # distance within which the end of a locus at a graze is sought
_SHALLOW, _WIDE = 1e-6, 1e-2  # a touch shallower than this, in units of the state, is led to a corner this far ahead
_SHARE = 0.7  # share of the distance to a corner that a step may cover
_BESIDE = 0.1 * AWAY  # distance from the path round a corner within which the start lies on it
_EDGE = 1e-12  # distance from the limit of a range, in widths, within which the start lies on it
_OWN = 1e-3  # radians from the turning point that grazes all along a locus, within which another is the same one
_BEHIND = 0.1  # distance behind the last point at which a secant to the graze ahead begins, as a share of that ahead
_RESTART = 0.2  # first step beyond a corner, as a share of the distance already covered from the corner
_ENDS = {Kind.NEIMARK_SACKER: (Codim2.RESONANCE_1_1, Codim2.RESONANCE_1_2)}  # the pair is real beyond them


def follow_locus(
    special: SpecialPoint | Codim2Point,
    first: str,
    second: str,
    to: Ranges,
    *,
    kind: str | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: LocusReport | None = None,
) -> Locus:
    """Follow a fold, flip, Neimark-Sacker or grazing point in two named parameters, in both directions.

    Parameters
    ----------
    special
        The special point to start from, of a branch along any parameter; or a point of codimension two of a locus.
    first, second
        Names of the parameters, such as ``"frequency"`` and ``"mean.q1"``.
    to
        The range of each: ``((low, high), (low, high))``.
    kind
        At a point of codimension two the locus to follow: ``"fold"``, ``"flip"``, ``"neimark-sacker"``, ``"grazing"``;
        at degenerate sliding ``"crossing-sliding"`` or ``"switching-sliding"``.
    walk
        Options of the walk.
    method
        Discretisation of the orbits: `Shooting` in one segment (default), or `Balance`, even if the special point was
        found by another method.
    report
        Called with each new point and the points of codimension two between it and the point before.

    Returns
    -------
    Locus
        The locus: its points, and where it ends.

    Raises
    ------
    ModelError
        For a branch point or an ordinary point; for unknown or equal parameters; for ranges that exclude the start.
    ConvergenceError
        If `method` does not confirm the special point to within its tolerance, or needs too many harmonics for it.
    Interrupted
        After Ctrl-C; the field `found` of the error is the locus so far.

    Notes
    -----
    Kuznetsov (2004), *Elements of Applied Bifurcation Theory*; Govaerts (2000), *Numerical Methods for Bifurcations of
    Dynamical Equilibria*.

    Examples
    --------
    >>> curve = gw.follow_locus(fold, "frequency", "stop.clearance", ((1.0, 1.6), (0.9, 1.1)))
    >>> curve.values[[0, -1]].round(6)
    array([[1.372124, 1.1     ],
           [1.41379 , 0.9     ]])
    """
    return trace_locus(start_locus(special, first, second, to, method, kind), walk).to_end(traced_locus, report)


class LocusStep(NamedTuple):
    """New point of a locus, and the points of codimension two between it and the point before."""

    point: LocusPoint
    codim2: list[Codim2Point]


class LocusTracer(Iterator[LocusStep]):
    """Tracer of a locus in one direction."""

    def __init__(self, beginning: LocusStart, walk: WalkOptions | None = None, resume: WalkState | None = None) -> None:
        self.beginning, self.options = beginning, walk or WalkOptions()
        self.first = self._point(beginning.first)
        self.end: LocusEnd | None = None
        while resume is not None and len(self.beginning.first.x) < len(resume.point.x):
            finer = refined(self.beginning)
            if finer is None:
                break
            self.beginning = finer
        self.walk = self._walk_from(resume)

    @property
    def state(self) -> WalkState:
        """Progress so far; a tracer made with it as `resume` continues as if never stopped."""
        return self.walk.state

    @property
    def is_closed(self) -> bool:
        """True if the locus has closed on itself."""
        return self.end is not None and self.end.reason is LocusEndReason.CLOSED

    def stopped(self, last: LocusPoint) -> LocusEnd:
        """Return the end; that it was stopped at the last point if it has none yet."""
        return self.end or LocusEnd(LocusEndReason.STOPPED, last.values)

    def __next__(self) -> LocusStep:
        if self.end is not None:
            raise StopIteration
        start = self.beginning
        if self._starts_outwards():
            self.end = LocusEnd(LocusEndReason.START, self.first.values)
            raise StopIteration
        if self.walk.state.point is start.first and leaves_degenerate(start.kind, start.corrector, start.first):
            self.end = LocusEnd(LocusEndReason.DEGENERATE, self.first.values)
            raise StopIteration
        while True:
            step = self._to_merging() or self._to_graze() or self._around_corner_ahead()
            if step is not None:
                return step
            state = self.walk.state
            coarse = max(_CORNER, self.options.smallest_step)
            is_coarse = state.step >= coarse
            self.walk.options = replace(self.options, smallest_step=coarse) if is_coarse else self.options
            try:
                point = next(self.walk)
            except StopIteration:
                end, last = self.walk.end, self.walk.point
                assert end is not None
                if end.reason is not EndReason.STEP or not is_coarse:
                    short = end.reason is EndReason.STEP and short_of(start.kind, start.corrector, last)
                    self.end = LocusEnd(LocusEndReason.of(end.reason), self._values(last), short or end.detail)
                    raise
                step = self._around_corner(_AT * _CORNER, [])
                if step is not None:
                    return step
                self.walk = self._walk_from(self.walk.state)
                continue
            inaccuracy = self.beginning.plane.inaccuracy(point.orbit)
            if inaccuracy:
                if self._refine(state):
                    continue
                self.end = LocusEnd(LocusEndReason.COARSE, self._values(state.point), inaccuracy)
                raise StopIteration
            with suppress(NumericalError):
                if self._is_smooth(state, point, is_coarse) and (step := self._step(state, point)) is not None:
                    return step
            # no points connect the two: the step went astray, or over a corner
            self.walk.go_back(state, point)

    def _around_corner_ahead(self) -> LocusStep | None:
        """Return the step round a nearby corner; without one, limit the next step to end before the next corner."""
        if not self.beginning.kind.by_multipliers:
            return None
        ahead = approaches(self.walk.previous, self.walk.point)
        shallow = _SHALLOW * float(self.beginning.corrector.scales[0])
        near = [
            each
            for each in ahead
            if each.reach < AWAY or (each.turning.is_touch and abs(each.turning.depth) < shallow and each.reach < _WIDE)
        ]
        if near and (step := self._around_corner(_OVER * near[-1].reach, near)) is not None:
            return step
        if ahead:
            self.walk.step = min(self.walk.step, _SHARE * ahead[0].reach)
        return None

    def _is_smooth(self, state: WalkState, last: BranchPoint, is_coarse: bool) -> bool:
        """Return True if a step stays on its arc."""
        # Arcs that nearly meet are distinguished by the orientation of the Jacobian. Along one arc the orientation
        # changes only where arcs really cross; there the smallest steps are accepted. A locus of multipliers has a
        # corner wherever a contact begins or ceases to touch.
        if is_coarse and last.determinant * state.point.determinant < 0.0:
            return False
        if leaves_phase(self.beginning.corrector, state.point, last, is_coarse=is_coarse):
            return False
        if not self.beginning.kind.by_multipliers:
            return True
        return state.point.orbit.closings == last.orbit.closings and not leaps(state.previous, state.point, last)

    def _refine(self, state: WalkState) -> bool:
        """Continue from a state with a finer resolution; return whether that was possible."""
        finer = refined(self.beginning)
        point = None if finer is None else lift(state.point, finer.corrector)
        if finer is None or point is None:
            return False
        self.beginning = finer
        self.walk = self._walk_from(WalkState(None, point, state.step, state.count))
        return True

    def _walk_from(self, state: WalkState | None) -> Walk:
        start = self.beginning
        return Walk(start.first, start.within[1], start.corrector, self.options, state, trust=0.0)

    def _step(self, state: WalkState, point: BranchPoint) -> LocusStep | None:
        """Return the step, cut off at the limit of the first range or the end of the locus; None to step shorter."""
        reason, detail, outside = None, "", point
        if self._first_value(point) not in self.beginning.within[0]:
            edge = self._at_edge(state.point, point)
            if edge is None:
                return None
            point, within = edge, self.beginning.within[0]
            table = within.table_at(within.bound(self._first_value(outside)))
            reason, detail = LocusEndReason.TABLE if table else LocusEndReason.RANGE, table
        found = find_codim2(self.beginning.kind, self.beginning.corrector, state.previous, state.point, point)
        for number, finding in enumerate(found):
            if finding.kind in _ENDS.get(self.beginning.kind, (Codim2.DEGENERATE_SLIDING,)):
                found, point = found[: number + 1], finding.point
                reason, detail = finding.reason_of_end(self.beginning.kind)
                break
        step = LocusStep(self._point(point), [self._codim2(finding) for finding in found])
        if reason is not None:
            self.end = LocusEnd(reason, step.point.values, detail)
        return step

    def _to_merging(self) -> LocusStep | None:
        """Return the last step, if it leads to the point where the orbits reach half their period."""
        if self.beginning.kind is not Kind.FOLD:
            return None
        state = self.walk.state
        try:
            end = find_merging(self.beginning.corrector, state.previous, state.point)
        except NumericalError:
            return None
        if end is None:
            return None
        step = LocusStep(self._point(end), [self._codim2(Finding(Codim2.GENERALISED_FLIP, end))])
        self.end = LocusEnd(LocusEndReason.JOINED, step.point.values)
        return step

    def _to_graze(self) -> LocusStep | None:
        """Return the last step, if it leads to a graze at which the locus ends."""
        state, own = self.walk.state, self.beginning
        with suppress(NumericalError):
            if end := find_degenerate(own.corrector, own.contact, state.previous, state.point):
                return self._ended_at(end)
        ends = *self._ends_of_multipliers(), *self._ends_at_half(), *self._ends_at_another()
        return self._ended_at(ends[0]) if ends else None

    def _ended_at(self, found: Finding) -> LocusStep:
        """Return the last step, to the end of the locus at a graze or at degenerate sliding."""
        step = LocusStep(self._point(found.point), [self._codim2(found)])
        reason, detail = found.reason_of_end(self.beginning.kind)
        self.end = LocusEnd(reason, step.point.values, detail)
        return step

    @cached_property
    def _jumping(self) -> frozenset[int]:
        return jumping_switches(self.first.orbit.system)

    def _ends_of_multipliers(self) -> Iterator[Finding]:
        """Yield the ends just ahead of a locus of multipliers, at a contact that ceases to touch."""
        kind, corrector, state = self.beginning.kind, self.beginning.corrector, self.walk.state
        sharp = self._jumping | one_way_switches(self.first.orbit.system)
        for reach, turning in approaches(state.previous, state.point) if kind.by_multipliers else ():
            if turning.is_touch and reach < _ENDING and turning.switch in sharp:
                near = NearGrazing(corrector, turning.switch)
                yield from _ends(near, kind.target, state.point, turning, _OVER * reach)

    def _ends_at_half(self) -> Iterator[Finding]:
        """Yield the ends just ahead at which both halves of the motions graze alike: they reach half their period."""
        state, plane, corrector = self.walk.state, self.beginning.plane, self.beginning.corrector
        reach, own = half_ahead(state.previous, state.point), corrector.scales
        deflections = [each for each in turnings(state.point) if each.switch in self._jumping]
        if not reach < _ENDING or not deflections:
            return
        turning = min(deflections, key=lambda each: abs(each.depth))
        states = plane.mean_of_halves(state.point.orbit)
        scales = np.append(own[: len(states)], own[-2:])
        halves = MultiplierEquation(plane.halved(), Kind.FLIP, scales, plane.tolerance)
        mean = np.append(states / scales[:-2], state.point.x[-2:])
        near = NearGrazing(Corrector(halves, scales), turning.switch)
        for found in _ends(near, -1.0, replace(state.point, x=mean), turning, _OVER * reach):
            place, tangent = np.delete(state.point.x, range(len(states))), state.point.tangent
            place[-2:] = found.point.x[-2:]
            x = np.append(found.point.x[:-2], place)  # on a grazing locus with the angle of the last point
            yield found._replace(point=corrector.uncorrected(x, tangent, found.point.arclength))

    def _ends_at_another(self) -> Iterator[Finding]:
        """Yield the ends just ahead of a grazing locus at which another deflection grazes a force that jumps."""
        state, corrector, equation = self.walk.state, self.beginning.corrector, self.beginning.equation
        if not isinstance(equation, GrazingEquation):
            return
        full, own = PERIOD * equation.period, self._angle(state.point)
        for reach, turning in approaches(state.previous, state.point):
            is_own = turning.switch == equation.switch and apart(turning.theta, own, full) < _OWN
            if is_own or turning.is_touch or turning.switch not in self._jumping or reach > AWAY:
                continue
            misses = np.sign(turning.depth) * MARGIN * float(corrector.scales[0])

            def function(found: Correction, turning: Turning = turning, misses: float = misses) -> float:
                orbit = equation.orbit(*self._unscaled(found.x), found.evaluation)
                turns = zip(*orbit.turning_depths[turning.switch], strict=True)
                return min(turns, key=lambda each: apart(each[0], turning.theta, full))[1] - misses

            secant = Secant(first=_BEHIND * reach, longest=reach, farthest=_OVER * reach)
            found = zero_along(corrector, state.point.x, function, secant)
            if found is not None:
                length = float(np.linalg.norm(found.x - state.point.x))
                there = corrector.point(found, state.point.tangent, state.point.arclength + length)
                yield Finding(Codim2.GRAZING, there, describe_switch(there.orbit, turning.switch))

    def _unscaled(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        unknowns = x * self.beginning.corrector.scales
        return unknowns[:-1], float(unknowns[-1])

    def _at_edge(self, inside: BranchPoint, outside: BranchPoint) -> BranchPoint | None:
        """Return the point of the locus at the limit of the first parameter that a step has passed."""
        corrector = self.beginning.corrector
        value = self.beginning.within[0].bound(self._first_value(outside)) / corrector.scales[-2]
        share = (value - inside.x[-2]) / (outside.x[-2] - inside.x[-2])
        guess, normal = inside.x + share * (outside.x - inside.x), np.zeros(len(inside.x))
        guess[-2], normal[-2] = value, 1.0
        correction = corrector.correct(guess, normal)
        if correction is None:
            return None
        length = inside.arclength + float(np.linalg.norm(correction.x - inside.x))
        correction.x[-2] = value  # it differs only by rounding
        return corrector.point(correction, inside.tangent, length)

    def _around_corner(self, within: float, ahead: list[Approach]) -> LocusStep | None:
        """Return the step from the present point around a corner; None if there is no corner, or it was just passed."""
        state = self.walk.state
        if not self.beginning.kind.by_multipliers or (
            state.previous is None and state.point is not self.beginning.first
        ):
            return None
        corner = turn_corner(self.beginning.corrector, state.point, within, ahead)
        if corner is None:
            return None
        if corner.beyond is None:
            return self._ended_at(corner.finding)
        if self._passes_start(state.point, corner):
            self.end = LocusEnd(LocusEndReason.CLOSED, self.first.values)
            length = state.point.arclength + float(np.linalg.norm(self.first.x - state.point.x))
            return LocusStep(replace(self.first, arclength=length), [self._codim2(corner.finding)])
        step = _RESTART * (corner.beyond.arclength - corner.finding.point.arclength)
        self.walk = self._walk_from(WalkState(None, corner.beyond, step, state.count + 1))
        return LocusStep(self._point(corner.beyond), [self._codim2(corner.finding)])

    def _passes_start(self, point: BranchPoint, corner: Corner) -> bool:
        """Return True if the path round a corner passes the first point of the tracer."""
        if point.arclength < 4.0 * self.options.first_step:
            return False
        assert corner.beyond is not None
        places = [point.x, corner.finding.point.x, corner.beyond.x]
        return any(_distance(self.first.x, a, b) < _BESIDE for a, b in pairwise(places))

    def _starts_outwards(self) -> bool:
        """Return True if the first step would leave the ranges at once."""
        state, first = self.walk.state, self.beginning.first
        if state.point is not first:
            return False
        for within, value, slope in zip(self.beginning.within, self.first.values, first.tangent[-2:], strict=True):
            bound = within.low if slope < 0.0 else within.high
            if slope != 0.0 and abs(value - bound) <= _EDGE * (within.high - within.low):
                return True
        return False

    def _first_value(self, point: BranchPoint) -> float:
        return float(point.x[-2] * self.beginning.corrector.scales[-2])

    def _values(self, point: BranchPoint) -> tuple[float, float]:
        return self._first_value(point), point.value

    def _point(self, point: BranchPoint) -> LocusPoint:
        return LocusPoint(self._values(point), point.orbit, self._angle(point), point.x, point.tangent, point.arclength)

    def _codim2(self, finding: Finding) -> Codim2Point:
        errors = errors_of(finding, self.beginning.corrector)
        slides = finding.kind is Codim2.DEGENERATE_SLIDING
        contact = finding.contact or self.beginning.contact * slides
        return Codim2Point(finding.kind, self._point(finding.point), contact, errors)

    def _angle(self, point: BranchPoint) -> float:
        if isinstance(self.beginning.equation, GrazingEquation):
            return float(point.x[-3] * self.beginning.corrector.scales[-3]) % (PERIOD * self.beginning.plane.period)
        return self.beginning.kind.angle(point.orbit.free_multipliers)


def _distance(x: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the distance of a place from the straight line segment between two others."""
    share = float((x - a) @ (b - a)) / float((b - a) @ (b - a))
    return float(np.linalg.norm(x - a - min(1.0, max(0.0, share)) * (b - a)))


LocusTracing = Tracing[LocusStart, LocusTracer, LocusStep]
"""Tracing of a locus."""


def trace_locus(beginnings: list[LocusStart], walk: WalkOptions | None = None) -> LocusTracing:
    """Return an iterator over the steps of a locus, from beginnings in one or both directions."""
    return Tracing(beginnings, lambda beginning, state: LocusTracer(beginning, walk, state))


def traced_locus(tracing: LocusTracing) -> Locus:
    """Return the locus so far, in one direction of travel; a single trace may cover a closed curve."""
    start = tracing.traces[-1].beginning
    points, codim2, ends = joined(tracing, None, _reversed, lambda found: replace(found, point=_reversed(found.point)))
    plane, (first, second) = start.plane, start.plane.names
    return Locus(start.kind, first, second, plane.period, points, codim2, ends, start.contact)


def _reversed(point: LocusPoint) -> LocusPoint:
    return replace(point, tangent=-point.tangent, arclength=-point.arclength)
