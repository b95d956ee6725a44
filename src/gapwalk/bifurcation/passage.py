"""Past a graze at a stiff stop, where the branch turns within a depth too small for steps along the branch.

Past a graze at a stop k times stiffer than the rest the branch turns within a depth of 1/k^2, for k = 1e6 within
rounding of what the state at theta = 0 can say. By the depth itself (`TouchEquation`) it is smooth: so the step over
such a corner is made by depths that grow by the same factor from one to the next, on both sides of the graze, and the
special points between are sought and located on that scale.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.bifurcation.second import ROUNDING
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.orbit.touch import LEAD, Held, Touch, TouchEquation, touches

_REACH = 1e-5  # arclength within which the graze must lie ahead
_BEYOND = 5e-7  # arclength from the graze at which the walk goes on
_LITTLE = 1e-8  # arclength by which a step over a graze must lead on
_GROWTH = 0.7  # of the logarithm of the depth from one orbit to the next
_LEAST = 1e-16  # depth, in the scale of positions, that is nothing but rounding
_BLUR = 1.5  # label up to which it is not known what happens first; depths are a few of the above there
_ASIDE = 1e-9  # the same at which the depth is calibrated
_SAME = 1e-2  # share by which the depths of touches differ at most that happen at once, in a symmetric motion
_SAFETY = 4.0  # times the difference of two computations, of which neither is exact
_CIRCLE = (
    1e-3  # distance from the unit circle of a critical pair: multipliers beside a stiff stop have rounding of 1e-5
)
_FINEST = 1e-3  # to which special points of one kind are told apart, as a share of the depth
_SHARP = 1e-9  # to which zeros are located, as a share of the depth
_NEAR = 0.01  # the same over which a test function is straight


class Passage(NamedTuple):
    """A step over a graze.

    Attributes
    ----------
    point
        The point beyond.
    special
        The special points before it, the graze among them.
    distance
        Arclength from the graze to the point.
    """

    point: BranchPoint
    special: list[SpecialPoint]
    distance: float


def pass_graze(corrector: Corrector, point: BranchPoint) -> Passage | None:
    """The step from a point of a walk over the graze beside it; None where there is none, or no way over it."""
    if not isinstance(corrector.equation, ShootingEquation):
        return None
    for at_once in (True, False):
        try:
            return _Corner(corrector, corrector.equation, point, at_once).passage()
        except NumericalError:
            continue
    return None


class _Corner:
    """The orbits about a graze, by a label that grows along the walk as the logarithm of the depth on either side."""

    def __init__(self, corrector: Corrector, equation: ShootingEquation, point: BranchPoint, at_once: bool) -> None:
        self._corrector, self._equation, self._first = corrector, equation, point
        found = touches(point.orbit)
        if not found:
            raise ConvergenceError("no deflection turns beside a breakpoint")
        first = found[0]
        self._unit = float(corrector.scales[0])
        slack = _SAME * abs(first.depth) + 1e3 * _LEAST * self._unit
        self._twins = [touch for touch in found[1:] if self._is_twin(touch, first, slack)]
        self._touches = [first, *self._twins] if at_once else [first]
        self._posed = TouchEquation(equation, point.orbit, self._touches, corrector.scales)
        start = self._posed.at(point.orbit)
        ahead = self._posed.slope(start)
        self._way = math.copysign(1.0, float(ahead @ point.tangent))
        if abs(first.depth) * length_of(ahead) > _REACH:
            raise ConvergenceError("no graze lies near")
        self._posed.calibrate(start, _ASIDE * self._unit)
        start = self._posed.at(point.orbit)
        self._held = {self._label(start.depth): start}
        self._points = {self._label(start.depth): point}

    @staticmethod
    def _is_twin(touch: Touch, first: Touch, slack: float) -> bool:
        """Whether two touches happen at once, in a symmetric motion."""
        return abs(touch.depth - first.depth) < slack and touch.acceleration * first.acceleration > 0.0

    def passage(self) -> Passage:
        """The step over the graze."""
        label = begin = next(iter(self._held))
        while label < -_BLUR:
            label = min(label + self._growth(label), -_BLUR)
            self._at(label)
        graze = self._at(0.0)
        if begin > 0.0 and length_of(self._first.x - graze.x) > 0.5 * _BEYOND:
            raise ConvergenceError("the graze lies behind, and far enough")
        label, deepest = max(begin, _BLUR), abs(self._label(self._posed.deepest))
        while label < deepest and length_of(self._at(label).x - graze.x) < _BEYOND:
            label += self._growth(label)
        self._at(label)
        if length_of(self._at(label).x - self._first.x) < _LITTLE:
            raise ConvergenceError("the graze is passed, but nothing is gained")
        special = list(self._special(begin, label))
        last = self._placed(label)
        return Passage(last, special, length_of(last.x - graze.x))

    def _growth(self, label: float) -> float:
        """To the next orbit: where the breakpoint is not passed, nothing happens on the way."""
        return _GROWTH if label * self._way * self._posed.free < 0.0 else 3.0 * _GROWTH

    def _label(self, depth: float) -> float:
        return self._way * math.asinh(depth / (_LEAST * self._unit))

    def _depth(self, label: float) -> float:
        return self._way * math.sinh(label) * _LEAST * self._unit

    def _at(self, label: float) -> BranchPoint:
        """The point of the branch at a label; all but the first have no arclength yet."""
        if label not in self._points:
            nearest = min(self._held, key=lambda known: (known * label < 0.0, abs(known - label)))
            held = self._held[label] = self._posed.hold(self._held[nearest], self._depth(label))
            self._points[label] = self._point(self._posed, held)
        return self._points[label]

    def _point(self, posed: TouchEquation, held: Held) -> BranchPoint:
        unknowns, evaluation = posed.evaluation(held)
        tangent = self._way * posed.slope(held)
        x = np.append(unknowns, held.value) / self._corrector.scales
        return self._corrector.evaluated(x, evaluation, tangent / length_of(tangent), 0.0)

    def _placed(self, label: float) -> BranchPoint:
        """The point at a label with its arclength, by the points that are known before it."""
        labels = sorted(known for known in self._points if next(iter(self._held)) <= known <= label)
        lengths = [length_of(self._points[b].x - self._points[a].x) for a, b in pairwise(labels)]
        return replace(self._points[label], arclength=self._first.arclength + sum(lengths), memo={})

    def _special(self, begin: float, end: float) -> Iterator[SpecialPoint]:
        """The special points between two labels, in order."""
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
        marks = [begin, *(label for label, _, _ in found), end]
        sides = [
            self._beside(begin),
            *(self._beside(0.5 * (a + b)) for a, b in pairwise(marks[1:-1])),
            self._beside(end),
        ]
        for (label, kind, contact), before, after in zip(found, sides[:-1], sides[1:], strict=True):
            counts = (before.instability, after.instability)
            nature = kind.nature(before, after) or ""
            yield SpecialPoint(kind, self._placed(label), *counts, self._error(kind, label), contact, nature)

    def _grazing(self, end: float) -> list[int]:
        """The switches that graze: that of the touch, and those that pass their breakpoints at once with it."""
        before, after = self._first.orbit.closings, self._at(end).orbit.closings
        twins = (touch.switch for touch in self._twins)
        return [self._touches[0].switch, *(switch for switch in twins if before[switch] != after[switch])]

    def _beside(self, label: float) -> BranchPoint:
        """A point between special points; where these are nearer to the graze than can be told, one just before it."""
        return self._at(label if abs(label) >= _BLUR else math.copysign(_BLUR, self._way * self._posed.free))

    def _resolved(self, nodes: list[float]) -> list[float]:
        """Labels of orbits with more between where the number of unstable multipliers changes without a reason."""
        resolved = nodes[:1]
        for a, b in pairwise(nodes):
            if (b - a > _FINEST and a * b > 0.0) and not self._is_explained(self._at(a), self._at(b)):
                resolved += self._resolved([a, 0.5 * (a + b), b])[1:]
            else:
                resolved.append(b)
        return resolved

    @staticmethod
    def _is_explained(a: BranchPoint, b: BranchPoint) -> bool:
        """Whether the signs of test functions at two points may explain the unstable multipliers at both."""
        signs = {kind: kind.at(a) * kind.at(b) < 0.0 for kind in Kind.known() if kind.has_function}
        most = sum(2 if kind is Kind.NEIMARK_SACKER else 1 for kind in signs if signs[kind])
        change = abs(b.instability.total - a.instability.total)
        return change <= most and (most - change) % 2 == 0

    def _zeros(self, kind: Kind, nodes: list[float]) -> list[float]:
        """The labels at which a test function vanishes: over so small a part of the branch it does so but once.

        What vanishes nearer to the graze than can be told does so where the breakpoint is passed.
        """
        from scipy.optimize import brentq  # imported late: it takes long

        pairs = pairwise(nodes)
        changes = [(a, b) for a, b in pairs if kind.at(self._at(a)) * kind.at(self._at(b)) < 0.0]
        zeros = []
        for a, b in changes:
            if a < 0.0 < b:
                zeros.append(-1e-3 * self._way * self._posed.free)
                self._at(zeros[-1])
                continue
            zero = float(brentq(lambda label: kind.at(self._at(label)), a, b, xtol=_SHARP))
            if kind.is_genuine(self._at(zero), _CIRCLE):
                zeros.append(zero)
        return zeros

    @cached_property
    def _second(self) -> tuple[TouchEquation, Held]:
        """The same orbits with shorter segments before the touches, and one of them: a second opinion."""
        outermost = max(
            self._points, key=lambda label: label * self._way * self._posed.free
        )  # the easiest to begin from
        orbit = self._points[outermost].orbit
        posed = TouchEquation(self._equation, self._first.orbit, self._touches, self._corrector.scales, 0.5 * LEAD)
        return posed, posed.calibrate(posed.at(orbit), _ASIDE * self._unit)

    def _error(self, kind: Kind, label: float) -> float:
        """Estimated error of the parameter at a special point: by how much it differs where it is posed otherwise."""
        here, scale = self._at(label), float(self._corrector.scales[-1])
        try:
            second, start = self._second
            other = self._point(second, second.hold(start, self._depth(label)))
            beside = self._at(label + _NEAR)
        except NumericalError:
            return math.inf
        off = abs(other.value - here.value) + self._held[label].error
        if kind is not Kind.GRAZING:
            rise = kind.at(beside) - kind.at(here)
            off += abs((beside.value - here.value) * (kind.at(other) / rise)) if rise else 0.0
        return float(_SAFETY * off + ROUNDING * (abs(here.value) + scale))
