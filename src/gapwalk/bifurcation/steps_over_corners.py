"""Step over a graze at a stiff stop, where the branch turns within a depth too small for steps along the branch.

After a graze at a stop k times stiffer than the rest of the system, the branch turns within a depth of 1/k^2. For k =
1e6 this is within rounding of the state at theta = 0. As a function of the depth itself (`TouchEquation`) the branch is
smooth. The step over such a corner therefore uses depths that grow by a constant factor on both sides of the graze. The
special points in between are detected and located on that scale.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.detector import Detector, unexplained
from gapwalk.bifurcation.friction_along_branch import changes_between
from gapwalk.bifurcation.kinds.sliding import Sliding, describe_friction
from gapwalk.bifurcation.special_point import KINDS, ROUNDING, SAFETY, ErrorEstimator, Kind, SpecialPoint
from gapwalk.bracketed_root import zero_between_signs
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Walk, WalkState
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.event_rule import jumping_switches, one_way_switches
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.orbit.orbit_equation import OrbitEquation
from gapwalk.orbit.shooting import LEAD, Held, ShootingEquation, TouchEquation, touches
from gapwalk.orbit.sticking import text_of

# Discontinuities at which a branch ends: just beyond them, the motion from almost the same state is another one.
#
# Most changes of a motion are continuous along a branch, be they as steep as a square root. Some are not. Friction
# whose static coefficient is larger than the kinetic one may be let go of, or not, where another contact stops. A
# spring with friction by the stages of its contact loses part of its force at once where a stage opens, however
# briefly. A branch ends there, since the orbit's equation jumps by a finite amount. Steps towards such a point become
# ever shorter.
#
# The equation is evaluated along the tangent, which meets the discontinuity if it is near. It is located by bisection.
# A finite jump is as large just beyond it as at a thousand times the distance, where a square root is thirty times as
# large; and just before it there is nothing of it.

REACH = 1e-6
"""Arclength within which a discontinuity is sought, ahead of the last point of a branch."""

_PROBES = (1e-11, 1e-10, 1e-9, 1e-8, 1e-7, REACH)  # distances ahead at which the equation is evaluated
_JUMP = 1e-7  # residual, as a share of the state, that a smooth or a steep change does not have at these distances
_PAST, _FAR = 1e-12, 1e-9  # distances beyond the discontinuity at which residuals are compared
_ONCE = 0.5  # least share of the residual far beyond it that is there at once
_BEFORE = 1e-3  # largest share of it just before the discontinuity
_LOCATED = 1e-13  # distance to which it is located
_MOVED = 1e-3  # radians by which an event may move meanwhile
_ELSEWHERE = "the start of the period: begin it elsewhere, with another phase of the loads"
_AT_ONCE = 1e-7  # radians within which events count as one


class Discontinuity(NamedTuple):
    """Discontinuity ahead of a point of a branch."""

    value: float  #: Value of the parameter.
    words: str  #: Sentence part that says what changes, and by how much.


def discontinuity_ahead(corrector: Corrector, point: BranchPoint) -> Discontinuity | None:
    """Return the discontinuity just ahead of a point, at which its branch ends; None if there is none."""
    size = max(float(np.abs(point.x[:-1]).max()), np.finfo(float).tiny)

    def residual(distance: float) -> float:
        try:
            evaluation = corrector.evaluate(point.x + distance * point.tangent)
        except NumericalError:
            return np.inf
        return float(np.abs(evaluation.residual / corrector.scales[:-1]).max()) / size

    near, far = 0.0, next((each for each in _PROBES if residual(each) > _JUMP), 0.0)
    if not far:
        return None
    while far - near > _LOCATED:
        middle = 0.5 * (near + far)
        near, far = (near, middle) if residual(middle) > _JUMP else (middle, far)
    jump, beyond = residual(far + _PAST), residual(far + _FAR)
    if not _JUMP < jump < np.inf or residual(near) > _BEFORE * jump or not _ONCE * beyond <= jump <= beyond / _ONCE:
        return None
    try:
        sides = [
            corrector.uncorrected(point.x + each * point.tangent, point.tangent, point.arclength)
            for each in (near, far + _PAST)
        ]
    except NumericalError:
        return None
    words = f"{_difference(sides[0].orbit, sides[1].orbit)}; the state after a period jumps by {jump:.1g} of its size"
    return Discontinuity(sides[0].value, words)


def _difference(first: Orbit, last: Orbit) -> str:
    """Return the first event of a motion that another one, which begins in almost the same state, does not have."""
    ours, theirs = (sorted([*each.events, *each.slips], key=lambda event: event.theta) for each in (first, last))
    for own, other in zip(ours, theirs, strict=False):
        if _key(own) != _key(other) or abs(own.theta - other.theta) > _MOVED:
            theta = min(own.theta, other.theta)
            together = [event for event in (*ours, *theirs) if abs(event.theta - theta) <= _AT_ONCE]
            names = sorted({_name(first, event) for event in together})
            words = f"beyond it, {', '.join(names)} behave{'' if names[1:] else 's'} otherwise at theta = {theta:.6g}"
            return f"{words}, {_ELSEWHERE}" if theta < _AT_ONCE else words
    more = max(ours[len(theirs) :], theirs[len(ours) :], key=len)
    if more and PERIOD * first.period - more[0].theta < _MOVED:
        return f"beyond it, {_name(first, more[0])} behaves otherwise at {_ELSEWHERE}"
    if more:
        return f"beyond it, {_name(first, more[0])} behaves otherwise at theta = {more[0].theta:.6g}"
    return "beyond it, its last events differ"


def coincidence(orbit: Orbit) -> str:
    """Return a sentence part on two events of different contacts or friction that coincide; empty if none do."""
    # Friction elements of one deflection stick together wherever it turns round.
    events = sorted([*orbit.events, *(each for each in orbit.slips if each.theta)], key=lambda event: event.theta)
    for first, last in pairwise(events):
        names = _name(orbit, first), _name(orbit, last)
        if last.theta - first.theta <= _AT_ONCE and names[0] != names[1] and not _move_as_one(orbit, first, last):
            advice = "beyond, their order may change: begin a new walk there"
            return f"{names[0]} and {names[1]} change together at theta = {first.theta:.6g}, and {advice}"
    return ""


def _move_as_one(orbit: Orbit, first: ContactEvent | SlipEvent, last: ContactEvent | SlipEvent) -> bool:
    if not (isinstance(first, SlipEvent) and isinstance(last, SlipEvent)):
        return False
    layout, coefficients = layout_of(orbit.system.structure), coefficients_of(orbit.system)
    vectors = [coefficients[layout.contacts[each.contact].deflection] for each in (first, last)]
    return np.array_equal(vectors[0], vectors[1])


def _key(event: ContactEvent | SlipEvent) -> tuple[int, int, int]:
    if isinstance(event, ContactEvent):
        return 0, event.switch, int(event.enters)
    return 1, event.contact, event.slip


def _name(orbit: Orbit, event: ContactEvent | SlipEvent) -> str:
    if isinstance(event, ContactEvent):
        return describe_switch(orbit, event.switch)
    return orbit.system.structure.contacts[event.contact].name


_REACH = 1e-5  # arclength within which the graze must lie ahead
_RIGID_REACH = 1e-4  # the same at a rigid stop: where two of them are struck at once, a walk gets stuck further away
_MISSING = (-1e-6, 1e-6, -1e-7, 1e-7, -1e-8, 1e-8)  # arclengths at which orbits are sought that miss a rigid stop
_BEHIND = (1e-7, 1e-6)  # arclengths behind a point at which orbits are sought whose impact has a depth
_BEYOND = 5e-7  # arclength beyond the graze at which the walk continues
_LITTLE = 1e-8  # smallest arclength by which a step over a graze must advance
_WILD = 1e6  # multiplier beyond a rigid stop that steps along the branch cannot follow
_GROWTH = 0.7  # increase of the logarithm of the depth from one orbit to the next
_LEAST = 1e-16  # depth, in the scale of positions, that is only rounding
_SOFTEST = 1e-12  # the same at a rigid stop
_MISSED = 1e-13  # depth by which an orbit at the graze of a rigid stop misses it
_RIGID_LEAD = 1e-4  # largest angle, in radians, by which a segment begins before a touch of a rigid stop
_BLUR = 1.5  # label up to which the order of events is undetermined; depths there are a few times the above
_ASIDE = 1e-9  # depth, in the scale of positions, at which the depth is calibrated
_SAME_DEPTH = 1e-2  # largest relative difference of the depths of simultaneous contacts in a symmetric motion
_SAFETY = 4.0  # factor on the difference of two computations, neither of which is exact
# distance of a critical pair from the unit circle: next to a stiff stop, multipliers have rounding of 1e-5
_CIRCLE = 1e-3
_FINEST = 1e-3  # smallest distance between special points of one kind, as a share of the depth
_SHARP = 1e-9  # accuracy of zeros, as a share of the depth
_NEAR = 0.01  # share of the depth over which a test function is linear


class GrazePassage(NamedTuple):
    """Result of a step over a graze."""

    point: BranchPoint  #: The point beyond the graze.
    special: list[SpecialPoint]  #: The special points before it, including the graze.
    distance: float  #: Arclength from the graze to the point.


def pass_graze(corrector: Corrector, point: BranchPoint) -> GrazePassage | None:
    """Return the step from a point of a walk over a nearby graze; None if there is none, or the step fails."""
    by_touches = cast("OrbitEquation", corrector.equation).by_touches
    if by_touches is None:
        return None
    leads = (_RIGID_LEAD, LEAD) if jumping_switches(point.orbit.system) else (LEAD,)
    for start in (point, *_behind(corrector, point)):
        # several touches at once first: a motion with one of them alone is on another branch
        for at_once, lead in (*((True, each) for each in leads), (False, leads[0])):
            try:
                return _Corner(corrector, by_touches, start, at_once, lead).passage(point)
            except NumericalError:
                continue
    return _leave_impact(corrector, by_touches, point)


def graze_ahead(corrector: Corrector, point: BranchPoint) -> SpecialPoint | None:
    """Return the graze of a force that jumps at which a walk got stuck: motions beyond touch by less than rounding."""
    by_touches = cast("OrbitEquation", corrector.equation).by_touches
    if by_touches is None:
        return None
    for start in (point, *_behind(corrector, point)):
        for at_once in (True, False):
            with suppress(NumericalError):
                return _Corner(corrector, by_touches, start, at_once, _RIGID_LEAD).graze(point)
    return None


def _behind(corrector: Corrector, point: BranchPoint) -> Iterator[BranchPoint]:
    """Iterate over points a little behind one that has an impact on a rigid stop."""
    # A walk approaches the graze by the velocity of the impact, to a depth that is rounding and cannot be prescribed.
    if not jumping_switches(point.orbit.system):
        return
    for aside in _BEHIND:
        correction = corrector.correct(point.x - aside * point.tangent, point.tangent)
        if correction is not None:
            length = length_of(correction.x - point.x)
            start = corrector.point(correction, point.tangent, point.arclength - length)
            if start.orbit.closings == point.orbit.closings and length < 2.0 * aside:
                yield start


def _leave_impact(
    corrector: Corrector, by_touches: Callable[..., TouchEquation], point: BranchPoint
) -> GrazePassage | None:
    """Return the step from an orbit with the softest touch of a force that jumps to orbits that miss it."""
    # However soft, such a touch has an effect, so a walk comes to within rounding of the graze, where Newton's method
    # jumps over it in any case.
    if not jumping_switches(point.orbit.system, friction=False):
        return None
    for aside in _MISSING:
        start = corrector.point_near(point.x + aside * point.tangent, point.tangent, point.arclength)
        if start is None or sum(start.orbit.closings) != sum(point.orbit.closings) - 1:
            continue
        try:
            return _Corner(corrector, by_touches, start, False, _RIGID_LEAD).retreat(point)
        except NumericalError:
            continue
    return None


class _Corner:
    """Orbits near a graze, by a label that grows along the walk as the logarithm of the depth on either side."""

    def __init__(
        self,
        corrector: Corrector,
        by_touches: Callable[..., TouchEquation],
        point: BranchPoint,
        at_once: bool,
        lead: float,
    ) -> None:
        self._corrector, self._by_touches, self._first = corrector, by_touches, point
        found = touches(point.orbit)
        if not found:
            raise ConvergenceError("no deflection has an extremum near a breakpoint")
        first = found[0]
        self._unit = float(corrector.scales[0])
        rigid = first.switch in jumping_switches(point.orbit.system)
        self._least = _SOFTEST if rigid else _LEAST
        # the branch may turn at the graze itself
        self._turns = rigid or first.switch in one_way_switches(point.orbit.system)
        slack = _SAME_DEPTH * abs(first.depth) + 1e3 * _LEAST * self._unit
        self._simultaneous = [  # contacts that begin simultaneously, in a symmetric motion
            touch
            for touch in found[1:]
            if abs(touch.depth - first.depth) < slack and touch.acceleration * first.acceleration > 0.0
        ]
        self._touches = [first, *self._simultaneous] if at_once else [first]
        self._other_sides = [  # of a gap of no width, which one side leaves as the other enters
            touch
            for touch in found[1:]
            if any(touch.theta == each.theta and touch.depth == -each.depth for each in (first, *self._simultaneous))
        ]
        self._is_several = rigid and len(self._touches) > 1
        # the effect of an impact on a rigid stop is that of the root of its depth, which must be the more exact
        self._posed = by_touches(point.orbit, self._touches, corrector.scales, lead if rigid else LEAD)
        start = self._posed.at(point.orbit)
        ahead = self._posed.slope(start)
        self._way = math.copysign(1.0, float(ahead @ point.tangent))
        if abs(first.depth) * length_of(ahead) > (_RIGID_REACH if rigid else _REACH):
            raise ConvergenceError("no graze lies near")
        self._posed.calibrate(start, _ASIDE * self._unit)
        start = self._posed.at(point.orbit)
        # the first of them is not deep
        self._deepest = max(self._posed.deepest, -1.001 * start.depth * self._posed.free)
        self._held = {self._label(start.depth): start}
        self._points = {self._label(start.depth): point}

    def passage(self, point: BranchPoint) -> GrazePassage:
        """Compute the step over the graze from a point of the walk, which may be ahead of the first orbit."""
        label = begin = next(iter(self._held))
        while label < -_BLUR:
            label = min(label + self._growth(label), -_BLUR)
            self._at(label)
        graze = self._at(0.0)
        if begin > 0.0 and length_of(self._first.x - graze.x) > 0.5 * _BEYOND:
            raise ConvergenceError("the walk has passed the graze, which is far enough behind")
        label = max(begin, _BLUR)
        while self._is_near(label, graze):
            try:
                self._at(label + self._growth(label))
            except NumericalError:  # where the acceleration is about to vanish, a deflection does not turn any more
                break
            label += self._growth(label)
        if length_of(self._at(label).x - point.x) < _LITTLE:
            raise ConvergenceError("the graze is passed, but the walk does not advance")
        if begin < 0.0 and not any(self._first.orbit.closing_changes(self._at(label).orbit)):
            raise ConvergenceError("the graze is reached, but no orbit beyond it is found: the motion may jump there")
        special = list(self._special(begin, label))
        if point is not self._first:  # what lies between the two has been found before
            special = [each for each in special if each.point.arclength > point.arclength]
        last = self._placed(label)
        return GrazePassage(last, special, length_of(last.x - graze.x))

    def graze(self, last: BranchPoint) -> SpecialPoint:
        """Return the graze ahead of the first point, at which one multiplier grows without bound, to one of two sides.

        It grows above +1 if the parameter turns back there, and below -1 otherwise, since the determinant of M - I
        changes its sign where the branch turns.
        """
        if next(iter(self._held)) >= 0.0:
            raise ConvergenceError("the walk has passed the graze")
        graze, held, before = self._at(0.0), self._held[0.0], last.orbit.instability
        ahead = self._posed.shifted(held, -self._posed.free * self._least * self._unit)
        turns = ahead * float(self._way * self._posed.slope(held)[-1]) < 0.0
        after = before._replace(above=before.above + 1) if turns else before._replace(below=before.below + 1)
        is_ahead = float((graze.x - last.x) @ last.tangent) > 0.0  # or the walk came even nearer to it
        point = self._placed(0.0) if is_ahead else last
        contact, parameter = describe_switch(graze.orbit, self._touches[0].switch), self._corrector.equation.parameter
        error = self._error(Kind.GRAZING, 0.0)
        return SpecialPoint(Kind.GRAZING, point, before, after, error, contact, parameter=parameter or "")

    def _is_near(self, label: float, graze: BranchPoint) -> bool:
        """Return True while a point is too near to the graze for steps along the branch, and touches can be posed."""
        # The softest impact on a rigid stop may be far enough away. But a symmetric motion with several of them at once
        # is still more sensitive than such steps can follow.
        misses = label * self._way * self._posed.free > 0.0
        point, deepest = self._at(label), self._posed.turns if misses else self._posed.deepest
        is_wild = self._is_several and float(np.abs(point.orbit.multipliers).max()) > _WILD
        if is_wild:
            try:
                deepest = self._further.deepest
            except NumericalError:
                is_wild = False
        return label < abs(self._label(deepest)) and (is_wild or length_of(point.x - graze.x) < _BEYOND)

    def retreat(self, before: BranchPoint) -> GrazePassage:
        """Return the step to this corner's first point from an orbit that touches, of another branch of the graze."""
        graze, last = self._at(0.0), self._first
        if length_of(graze.x - before.x) > _REACH:
            raise ConvergenceError("no graze lies near")
        ahead = last.tangent if float((last.x - graze.x) @ last.tangent) > 0.0 else -last.tangent
        sign = 1.0 if ahead is last.tangent else -1.0
        length = length_of(last.x - graze.x)
        arclength = before.arclength + length_of(graze.x - before.x)
        contact = describe_switch(last.orbit, self._touches[0].switch)
        counts, error = (before.orbit.instability, last.orbit.instability), self._error(Kind.GRAZING, 0.0)
        special = SpecialPoint(
            Kind.GRAZING,
            replace(graze, arclength=arclength, memo={}),
            *counts,
            error,
            contact,
            parameter=self._corrector.equation.parameter or "",
        )
        point = replace(last, tangent=ahead, determinant=sign * last.determinant, arclength=arclength + length, memo={})
        return GrazePassage(point, [special], length)

    def _growth(self, label: float) -> float:
        """Return the increment of the label; it is larger where the breakpoint is not passed and nothing happens."""
        return _GROWTH if label * self._way * self._posed.free < 0.0 else 3.0 * _GROWTH

    def _label(self, depth: float) -> float:
        return self._way * math.asinh(depth / (self._least * self._unit))

    def _depth(self, label: float) -> float:
        if not label and self._least > _LEAST:  # at a rigid stop even rounding of the depth would be an impact
            return self._posed.free * _MISSED * self._unit
        return self._way * math.sinh(label) * self._least * self._unit

    def _at(self, label: float) -> BranchPoint:
        """Return the point of the branch at a label; all but the first have no arclength yet."""
        if label not in self._points:
            posed = self._posed_at(label)
            own = [known for known in self._held if self._posed_at(known) is posed] or [self._outermost]
            nearest = min(own, key=lambda known: (known * label < 0.0, abs(known - label)))
            start = self._held[nearest] if own != [self._outermost] else posed.at(self._points[nearest].orbit)
            held = posed.hold(start, self._depth(label))
            point = self._point(posed, held)
            if self._misses(label, point):
                raise ConvergenceError("the orbit misses a rigid stop that it should strike")
            self._held[label], self._points[label] = held, point
        return self._points[label]

    def _misses(self, label: float, point: BranchPoint) -> bool:
        """Return True if a point that should strike a rigid stop has no more impacts on it than the graze."""
        graze = self._points.get(0.0)
        if graze is None or self._least == _LEAST or self._depth(label) * self._posed.free > 0.0:
            return False
        now, then = graze.orbit.closings, point.orbit.closings
        return abs(label) >= _BLUR and any(then[touch.switch] <= now[touch.switch] for touch in self._touches)

    def _posed_at(self, label: float) -> TouchEquation:
        """Return the equation whose segments begin early enough before the touches at a label."""
        return self._further if self._is_deep(label) else self._posed

    def _is_deep(self, label: float) -> bool:
        return self._is_several and self._depth(label) * self._posed.free < -self._deepest

    @property
    def _outermost(self) -> float:
        """Label of the deepest touch that the first equation has."""
        own = [known for known in self._points if not self._is_deep(known)]
        return max(own, key=lambda known: -self._depth(known) * self._posed.free)

    @cached_property
    def _further(self) -> TouchEquation:
        """The equation with segments that begin earlier, for deeper touches."""
        orbit = self._points[self._outermost].orbit
        found = [touch for touch in touches(orbit) if touch.depth * self._posed.free < 0.0]
        nearest = [
            min(
                (each for each in found if each.switch == own.switch),
                key=lambda each: abs(each.theta - own.theta),
                default=None,
            )
            for own in self._touches
        ]
        if None in nearest:
            raise ConvergenceError("the touches are not found again")
        further = self._by_touches(orbit, [each for each in nearest if each], self._corrector.scales, LEAD)
        # earlier on, the acceleration changes more before the touch: without this, its depth would be another one
        further.calibrate(further.at(self._freest.orbit), _ASIDE * self._unit)
        return further

    def _point(self, posed: TouchEquation, held: Held) -> BranchPoint:
        unknowns, evaluation = posed.evaluation(held)
        tangent = self._way * posed.slope(held)
        x = np.append(unknowns, held.value) / self._corrector.scales
        return self._corrector.evaluated(x, evaluation, tangent / length_of(tangent), 0.0)

    def _placed(self, label: float) -> BranchPoint:
        """Return the point at a label with its arclength, summed over the known points before it."""
        labels = sorted(known for known in self._points if next(iter(self._held)) <= known <= label)
        lengths = [length_of(self._points[b].x - self._points[a].x) for a, b in pairwise(labels)]
        return replace(self._points[label], arclength=self._first.arclength + sum(lengths), memo={})

    def _special(self, begin: float, end: float) -> Iterator[SpecialPoint]:
        """Yield the special points between two labels, in order."""
        found: list[tuple[float, Kind, str]] = []
        if begin < 0.0:
            found = [(0.0, Kind.GRAZING, describe_switch(self._first.orbit, switch)) for switch in self._grazing(end)]
        nodes = self._resolved(sorted(label for label in self._points if label != 0.0))
        for kind in (each for each in Kind.known() if each.has_function):
            found += [(label, kind, "") for label in self._zeros(kind, nodes)]
        vertices = [label for label, kind, _ in found if kind is Kind.BRANCH_POINT]
        found = sorted(
            (item for item in found if item[1] is not Kind.FOLD or all(abs(item[0] - v) > _NEAR for v in vertices)),
            key=lambda item: item[0],
        )
        if not found:
            return
        between = [0.5 * (a + b) for a, b in pairwise(label for label, _, _ in found)]
        sides = [self._beside(label) for label in (begin, *between, end)]
        if self._least > _LEAST:  # on a rigid stop the walk is where it was, however soft its impact
            sides[0] = self._at(begin)
        for (label, kind, contact), before, after in zip(found, sides[:-1], sides[1:], strict=True):
            counts = (before.instability, after.instability)
            nature = kind.nature(before, after) or ""
            point, error, parameter = self._placed(label), self._error(kind, label), self._corrector.equation.parameter
            yield SpecialPoint(kind, point, *counts, error, contact, nature, parameter=parameter or "")

    def _grazing(self, end: float) -> list[int]:
        """Return the switches that graze: the first, and those that pass their breakpoints simultaneously with it."""
        before, after = self._first.orbit.closings, self._at(end).orbit.closings
        others = (touch.switch for touch in (*self._simultaneous, *self._other_sides))
        return [self._touches[0].switch, *(switch for switch in others if before[switch] != after[switch])]

    def _beside(self, label: float) -> BranchPoint:
        """Return a point between special points; just before the graze if they are too close to it to be separated."""
        return self._at(label if abs(label) >= _BLUR else math.copysign(_BLUR, self._way * self._posed.free))

    def _resolved(self, nodes: list[float]) -> list[float]:
        """Refine labels of orbits where the number of unstable multipliers changes without an explanation."""
        resolved = nodes[:1]
        for a, b in pairwise(nodes):
            if (b - a > _FINEST and a * b > 0.0) and not self._is_explained(self._at(a), self._at(b)):
                resolved += self._resolved([a, 0.5 * (a + b), b])[1:]
            else:
                resolved.append(b)
        return resolved

    @staticmethod
    def _is_explained(a: BranchPoint, b: BranchPoint) -> bool:
        """Return True if sign changes of test functions between two points can explain their unstable multipliers."""
        signs = {kind: kind.at(a) * kind.at(b) < 0.0 for kind in Kind.known() if kind.has_function}
        most = sum(2 if kind is Kind.NEIMARK_SACKER else 1 for kind in signs if signs[kind])
        change = abs(b.instability.total - a.instability.total)
        return change <= most and (most - change) % 2 == 0

    def _zeros(self, kind: Kind, nodes: list[float]) -> list[float]:
        """Return the positions, by label, of the zeros of a test function; on so short a part there is at most one."""
        # A zero too near to the graze to be resolved is placed on the side where the breakpoint is passed.
        pairs = pairwise(nodes)
        changes = [(a, b) for a, b in pairs if kind.at(self._at(a)) * kind.at(self._at(b)) < 0.0]
        if kind.target is None and self._is_several:  # a product of real multipliers, one of them huge: rounding
            changes = [(a, b) for a, b in changes if self._at(a).instability != self._at(b).instability]
        zeros = []
        for a, b in changes:
            if a < 0.0 < b and self._turns:
                continue
            if a < 0.0 < b:
                zeros.append(-1e-3 * self._way * self._posed.free)
                self._at(zeros[-1])
                continue
            zero = zero_between_signs(lambda label: kind.at(self._at(label)), a, b, absolute=_SHARP)
            if kind.is_genuine(self._at(zero), _CIRCLE):
                zeros.append(zero)
        return zeros

    @cached_property
    def _second(self) -> tuple[TouchEquation, Held]:
        """Return the same equation with shorter segments before contacts, for an error estimate, and an orbit of it."""
        posed = self._by_touches(self._first.orbit, self._touches, self._corrector.scales, 0.5 * LEAD)
        return posed, posed.calibrate(posed.at(self._freest.orbit), _ASIDE * self._unit)

    @property
    def _freest(self) -> BranchPoint:
        """The point that misses the breakpoint by most, where Newton's method starts most easily."""
        return self._points[max(self._points, key=lambda label: label * self._way * self._posed.free)]

    def _error(self, kind: Kind, label: float) -> float:
        """Estimate the error of the parameter at a special point from its change with another discretisation."""
        here, scale, beside = self._at(label), float(self._corrector.scales[-1]), None
        try:
            second, start = self._second
            other = self._point(second, second.hold(start, self._depth(label)))
            with suppress(NumericalError):  # two sides of a rigid stop cannot be struck by so little
                beside = self._at(label + _NEAR)
            held = self._held[label]
            off = abs(other.value - here.value) + held.error + self._posed_at(label).rounding(held)
        except NumericalError:
            return math.inf
        if kind is Kind.GRAZING:  # at a rigid stop the orbit there misses it
            off += abs(held.slope[-1] * scale * self._depth(label))
        elif beside is None:
            return math.inf
        else:
            rise = kind.at(beside) - kind.at(here)
            off += abs((beside.value - here.value) * (kind.at(other) / rise)) if rise else 0.0
        return float(_SAFETY * off + ROUNDING * (abs(here.value) + scale))


# Step over a corner of a branch, where the sequence of slip and stick changes.
#
# Where a phase of stick begins within slip, neighbouring motions become one from there on. So the derivatives of the
# orbit's equation jump, and the branch has a corner: on the other side its direction is that of the derivatives there.
# It may even turn back. Steps along the old direction shrink, or fail, before such a corner. The step over it
# evaluates the derivatives a little beyond it, follows their direction, and is accepted if the orbit there has the
# other sequence.
#
# Where the motion jumps there is no corner: friction whose static coefficient is larger than the kinetic one sticks
# for a while as soon as its slip rate touches zero. The branch ends there. A branch on the other side, if there is
# one, is another one: a step of the size of the jump would reach it.

_SLIDING_PROBES = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5)  # distances beyond the corner at which the derivatives are evaluated
_CORNER_STEPS = (1e-6, 1e-5, 1e-7, 1e-4)  # lengths of the step over the corner
_ASTRAY = 0.5  # distance of the corrected point from the guess, as a share of the step, beyond which it is astray
_REACHED = 1e-12  # distance from the corner at which it is reached
_FARTHEST = 1e-4  # distance within which rounding may place it
_TURNED = 1e-3  # radians by which the direction on the other side must differ from going back


class CornerPassage(NamedTuple):
    """Result of a step over a corner: both points, the special points at the corner, and the length of the step."""

    corner: BranchPoint
    point: BranchPoint
    special: list[SpecialPoint]
    distance: float


def pass_corner(corrector: Corrector, point: BranchPoint) -> CornerPassage | None:
    """Return the step over a corner from a point just before it; None if there is none near."""
    here = sequence(point.orbit)
    if not point.orbit.slips or not any(
        _sequence_at(corrector, point, probe) not in {(), here} for probe in _SLIDING_PROBES
    ):
        return None
    if discontinuity_ahead(corrector, point) is not None:
        return None
    corner = _corner(corrector, point)
    for way, length in _ways(corrector, corner):
        beyond = _beyond(corrector, corner, way, length)
        if beyond is not None and sequence(beyond.orbit) != here:
            beyond = _first_beyond(corrector, corner, way, beyond)
            special = _special(corrector, corner, beyond)
            return CornerPassage(corner, beyond, special, beyond.arclength - corner.arclength)
    return None


def _beyond(corrector: Corrector, corner: BranchPoint, way: NDArray[np.float64], length: float) -> BranchPoint | None:
    """Return the point at a distance from a corner in a direction; None if there is none."""
    guess, arclength = corner.x + length * way, corner.arclength + length
    return corrector.point_near(guess, way, arclength, near=1e-3 * length, within=_ASTRAY * length)


def _first_beyond(
    corrector: Corrector, corner: BranchPoint, way: NDArray[np.float64], beyond: BranchPoint
) -> BranchPoint:
    """Return the point beyond a corner before the sequence changes once more, which it may do within the step over it.

    The two changes together may look like a third one.
    """
    here, length = sequence(corner.orbit), beyond.arclength - corner.arclength
    first: BranchPoint | None = None
    for probe in (each for each in _SLIDING_PROBES if each < length):
        nearer = _beyond(corrector, corner, way, probe)
        if nearer is None or sequence(nearer.orbit) == here:
            continue
        if sequence(nearer.orbit) != sequence((first or nearer).orbit):
            break
        if sequence(nearer.orbit) == sequence(beyond.orbit):
            return beyond
        first = nearer
    return first or beyond


def _corner(corrector: Corrector, point: BranchPoint) -> BranchPoint:
    """Return the last point ahead, within a short distance, that is reached along the direction at a point."""
    here, low, high = sequence(point.orbit), 0.0, _SLIDING_PROBES[0]
    last, limit = point, _SLIDING_PROBES[-1]
    while high - low > _REACHED:
        correction = corrector.correct(point.x + high * point.tangent, point.tangent, near=1e-3 * high)
        reached = correction is not None and length_of(correction.x - last.x) < 2.0 * (high - low)
        if correction is not None and reached:
            trial = corrector.point(correction, point.tangent, point.arclength + high)
            reached = sequence(trial.orbit) == here
            last, low = (trial, high) if reached else (last, low)
        if not reached:
            limit = high
        high = 2.0 * high if limit == _SLIDING_PROBES[-1] and reached else 0.5 * (low + limit)
        if low >= _SLIDING_PROBES[-1]:
            break
    return last


def sequence(orbit: Orbit) -> tuple[object, ...]:
    """Return the sequences of slip and stick of all friction in one period, and its modes at the start."""
    start = tuple(event.slip for event in orbit.slips if not event.theta)
    return tuple((contact, text_of(phases)) for contact, phases in orbit.friction.items()), start


def _ways(corrector: Corrector, corner: BranchPoint) -> Iterator[tuple[NDArray[np.float64], float]]:
    """Iterate over directions beyond the corner, each with lengths of the step."""
    known: list[NDArray[np.float64]] = []
    for probe in _SLIDING_PROBES:
        try:
            jacobian = corrector.jacobian(corner.x + probe * corner.tangent)
        except NumericalError:
            continue
        direction = np.linalg.svd(jacobian)[2][-1]
        for way in (direction, -direction):
            back = float(way @ -corner.tangent)
            if back > 1.0 - 0.5 * _TURNED**2 or any(float(way @ each) > 1.0 - 0.5 * _TURNED**2 for each in known):
                continue
            known.append(way)
            for length in _CORNER_STEPS:
                yield way, length


def _error(corrector: Corrector, corner: BranchPoint) -> float:
    """Estimate the error of the parameter at a corner: how far from it rounding decides on the sequence."""
    reach, width = _REACHED, float(corrector.scales[-1])
    try:
        blur = ErrorEstimator(corrector).blur(corner)
    except NumericalError:
        return math.inf
    motions = [corner, *blur.asides]
    while True:
        before, after = ({_sequence_at(corrector, each, way * reach) for each in motions} for way in (-1.0, 1.0))
        if len(before) == 1 and before.isdisjoint(after):  # beyond it they may differ among each other
            break
        reach *= 2.0
        if reach > _FARTHEST:
            return math.inf
    across = width * (abs(float(corner.tangent[-1])) * reach + blur.off)
    return SAFETY * across + ROUNDING * (abs(corner.value) + width)


def _sequence_at(corrector: Corrector, point: BranchPoint, distance: float) -> tuple[object, ...]:
    """Return the sequence of the motion, which need not be periodic, a little along the tangent; none if it fails."""
    try:
        ahead = corrector.uncorrected(point.x + distance * point.tangent, point.tangent, point.arclength)
    except NumericalError:
        return ()
    return sequence(ahead.orbit)


def _special(corrector: Corrector, corner: BranchPoint, point: BranchPoint) -> list[SpecialPoint]:
    """Return the special points at the corner: one for each phase that appears or vanishes."""
    # In a symmetric motion there are two or more. The last of them has what changes in the multipliers.
    found: list[SpecialPoint] = []
    before = corner.orbit.instability
    error, parameter = _error(corrector, corner), corrector.equation.parameter or ""
    for change in changes_between(corner.orbit, point.orbit) or []:
        for kind in KINDS.values():
            if isinstance(kind, Sliding) and kind.owns(change):
                words = kind.nature(corner, point)
                name = describe_friction(corner.orbit, change)
                found.append(SpecialPoint(kind, corner, before, before, error, name, words, parameter=parameter))
    return [*found[:-1], *(replace(each, after=point.orbit.instability) for each in found[-1:])]


# Step over the orbits of a branch at which an event passes the start of the period, or of another segment.
#
# The unknowns of shooting are the state at theta = 0. Where an impact passes theta = 0 along a branch, this state
# jumps, from the one before the impact to the one after it; where a force that jumps sets in there, its path along the
# branch has a corner. The motion itself, and what it does, are as smooth as elsewhere. Therefore a few steps are taken
# with another section: the state at an angle at which the motion is free, in the middle between two events. Their
# special points and the last of them become points of the branch with their states at theta = 0, which are a part of
# the same motions. The states at the starts of several segments are moved by one angle.

AT_START = 1e-4  # radians from the start of the period within which an event coincides with it
_CLEAR = 1e-3  # radians from the start at which the last event that passed it leaves the state there free
_FIRST, _LARGEST, _SHORTEST = 1e-4, 2e-3, 1e-11  # first, largest and smallest step of the walk with another section
_STEPS = 60  # largest number of its steps
_AMONG = 0.5  # radians between two impacts on one stop that are so close that further ones will pass too
_SAME = 1e-7  # distance, in scaled variables, within which a point found at theta = 0 is that of the other section

Vector = NDArray[np.float64]


class StartPassage(NamedTuple):
    """Result of the steps with another section."""

    point: BranchPoint  #: The last point.
    special: list[SpecialPoint]  #: The special points before it.
    step: float  #: Length of the next step.
    end: End | None  #: End of the branch at the point; None if it continues.


def starts_among_impacts(orbit: Orbit) -> bool:
    """Return True if the start of the period lies between two impacts of a chatter: along a branch, many will pass."""
    rigid = {switch for _, switch in orbit.system.structure.reactions if switch >= 0}
    if not rigid:
        return False
    own = [event for event in orbit.events if event.switch in rigid and event.enters]
    if len(own) < 2 or own[0].switch != own[-1].switch:
        return False
    return own[0].theta - own[-1].theta + PERIOD * orbit.period < _AMONG


def pass_start(corrector: Corrector, walk: Walk, state: WalkState, kinds: Sequence[Kind]) -> StartPassage | None:
    """Return steps from a point of a walk until the event at the start of the period has passed it."""
    # If the start lies among the impacts of a chatter, a step of the walk's own length is taken, which many may pass.
    equation, first = corrector.equation, state.point
    if not isinstance(equation, ShootingEquation) or not _may_pass(equation, first.orbit):
        return None
    try:
        return _Section(corrector, equation, first).passage(walk, state, kinds)
    except NumericalError:
        return None


def smooth_between(
    corrector: Corrector, first: BranchPoint, last: BranchPoint
) -> tuple[Corrector, BranchPoint, BranchPoint]:
    """Return a section in which the orbits between two neighbouring points of a branch are smooth."""
    # That is the start of the period, unless an event of one of them is there.
    equation = corrector.equation
    if isinstance(equation, ShootingEquation) and _may_pass(equation, first.orbit, last.orbit):
        section = _Section(corrector, equation, first)
        try:
            return section.corrector, section.entered(first), section.entered(last)
        except NumericalError:
            pass  # both may be on one side of the event, and what follows tells
    return corrector, first, last


def _may_pass(equation: ShootingEquation, *orbits: Orbit) -> bool:
    """Return True if an event may pass the start of a segment at some orbits, and another section is possible."""
    count = equation.options.segments
    among = count == 1 and any(map(starts_among_impacts, orbits))
    return not equation.begin and (among or any(_clearance(orbit, count) < AT_START for orbit in orbits))


class _Section:
    """Another section for the orbits near a point of a branch, and the way from one section to the other."""

    def __init__(self, corrector: Corrector, equation: ShootingEquation, point: BranchPoint) -> None:
        self._own, self._equation = corrector, equation
        self._posed = replace(equation, begin=free_angle(point.orbit, equation.options.segments))
        self.corrector = Corrector(self._posed, corrector.scales)

    def passage(self, outer: Walk, state: WalkState, kinds: Sequence[Kind]) -> StartPassage:
        """Walk from a point until the state at theta = 0 is free; see `pass_start`."""
        first, options, among = state.point, outer.options, starts_among_impacts(state.point.orbit)
        options = replace(
            options,
            initial_step=_FIRST,
            smallest_step=min(options.smallest_step, _SHORTEST),
            largest_step=options.largest_step if among else min(_LARGEST, options.largest_step),
            max_points=_STEPS,
        )
        begin = self.entered(first)
        walk, special = Walk(begin, outer.within, self.corrector, options, change=outer.change), list[SpecialPoint]()
        walk.step = max(walk.step, state.step) if among else walk.step
        if first is not outer.origin and abs(first.x[-1] - outer.origin.x[-1]) < 2.0 * walk.step:
            walk.origin = self.entered(outer.origin)  # where a closed branch ends
        detector, before, last = Detector(self.corrector, kinds), None, begin
        for ahead in walk:
            found = detector.inspect(last, ahead, before)
            for text in unexplained(last, ahead, found):
                raise NumericalError(text)
            special += found
            before, last = last, ahead
            if _clearance(last.orbit, self._equation.options.segments) > (AT_START if among else _CLEAR):
                break
        end = None if walk.end is None or walk.end.reason is EndReason.POINTS else walk.end
        if last is begin or (end is not None and end.reason.is_failure):
            raise ConvergenceError("no orbit is found beyond the event at the start of the period")
        if end is not None and end.reason is not EndReason.CLOSED:
            end = outer.end_at(end.value)
        found = [replace(each, point=self._at_zero(each.point)) for each in special]
        return StartPassage(self._left(last), found, walk.step, end)

    def entered(self, point: BranchPoint) -> BranchPoint:
        """Return a point with this section."""
        x = np.append(self._posed.unknowns(point.orbit), point.value) / self._own.scales
        along = self._carried(point, self._equation.knots[:-1], self._posed.knots[:-1])
        found = self.corrector.point_near(x, along, point.arclength, within=_SAME * max(1.0, length_of(x)))
        if found is None:
            raise ConvergenceError("the orbit is not found again from another angle of the excitation")
        return found

    def _left(self, point: BranchPoint) -> BranchPoint:
        """Return a point of this section with its state at theta = 0, corrected there."""
        moved = self._at_zero(point)
        within = _SAME * max(1.0, length_of(moved.x))
        found = self._own.point_near(moved.x, moved.tangent, point.arclength, within=within)
        if found is None:
            raise ConvergenceError("the orbit is not found with its state at theta = 0")
        return found

    def _at_zero(self, point: BranchPoint) -> BranchPoint:
        """Return a point of this section with its state at theta = 0."""
        along = self._carried(point, self._posed.knots[:-1], self._equation.knots[1:])
        along[:-1] = np.roll(along[:-1], self._equation.system.state_size)  # that at the end is that at the start
        x = np.append(self._equation.unknowns(point.orbit), point.value) / self._own.scales
        return replace(point, x=x, tangent=along, memo={})

    def _carried(self, point: BranchPoint, starts: list[float], stops: list[float]) -> Vector:
        """Return the scaled tangent of a point at some angles as a unit tangent at a later one for each."""
        scales, along = self._own.scales, point.tangent[-1] * self._own.scales[-1]
        states, changes = ((x[:-1] * scales[:-1]).reshape(len(starts), -1) for x in (point.x, point.tangent))
        moved = [
            self._equation.carried(state, np.append(change, along), point.value, start, stop)[:-1]
            for state, change, start, stop in zip(states, changes, starts, stops, strict=True)
        ]
        tangent = np.append(np.concatenate(moved), along) / scales
        return tangent / length_of(tangent)


def _angles(orbit: Orbit) -> list[float]:
    """Return the angles of all events of an orbit; modes of friction that only go on at its start are none."""
    full = PERIOD * orbit.period
    found = [event.theta % full for event in orbit.events]
    for phases in orbit.friction.values():
        found += [phase.start % full for phase in phases if len(phases) > 1]
    return found


def _clearance(orbit: Orbit, segments: int) -> float:
    """Return the angle between the start of a segment and the nearest event."""
    span = PERIOD * orbit.period / segments
    return min((min(theta % span, span - theta % span) for theta in _angles(orbit)), default=math.inf)


def free_angle(orbit: Orbit, segments: int) -> float:
    """Return the angle, after the start of each segment, in the middle of the longest part without events there."""
    span = PERIOD * orbit.period / segments
    angles = sorted([0.0, *(theta % span for theta in _angles(orbit)), span])
    start, stop = max(pairwise(angles), key=lambda pair: pair[1] - pair[0])
    return 0.5 * (start + stop)
