"""Find and locate every special point in one step of a walk, so that none hides between two points.

A sign change of a test function is located by bracketing. But two zeros in one step leave no sign change: wherever a
test function bends so much that it may dip through zero between two points, the step is halved until that doubt is
gone. Zeros that are already known are divided out first, so that only unknown ones raise doubt.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

from gapwalk.bifurcation.branch import Kind, SpecialPoint, critical_multiplier
from gapwalk.bifurcation.crossing import Crossing, locate_crossing
from gapwalk.bifurcation.functions import BIFURCATIONS, is_genuine, value
from gapwalk.bifurcation.grazing import Graze, depth_near, describe_switch, find_grazing
from gapwalk.bifurcation.second import ROUNDING, SAFETY, Neighbour, SecondOpinion, location_error
from gapwalk.bifurcation.stretch import RESOLUTION, Stretch
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.floquet import Instability

_DOUBT = 1.0  # share of the bend over an interval by which a test function may dip between its ends; 1/8 for a parabola
# between equal ends; unequal ones count with their geometric mean, as a dip to zero has to leave the larger one too
_VERTEX = 1e-6  # arclength from a crossing within which a fold is its vertex
_CROWDED = 1e-6  # arclength over which rates of test functions would be made of rounding
_BESIDE = 1e-4  # arclength within which a test function is straight, for the error of its zero
_AROUND = 5e-3  # arclength within which a second opinion looks for a branch point
_NOISE = 1e-10  # size of a test function that is nothing but rounding
_EXACT = 1e-14  # arclength to which zeros are located


@dataclass(frozen=True)
class _Zero:
    """A zero of one test function: where, and how wide its bracket was in arclength."""

    kind: Kind
    point: BranchPoint
    spread: float


class DetectorState(NamedTuple):
    """What a detector remembers from step to step, by test function: its rate of change, and its last zeros."""

    rates: Mapping[Kind, float] = MappingProxyType({})
    recent: Mapping[Kind, tuple[float, ...]] = MappingProxyType({})


class Detector:
    """Finds the special points of a walk, step by step.

    It remembers the step before, for the rate at which each test function varies, and the last zeros found.

    Parameters
    ----------
    corrector
        Corrects onto the branch.
    kinds
        The bifurcations to look for.
    grazing
        Whether to look for grazing points too.
    """

    def __init__(self, corrector: Corrector, kinds: tuple[Kind, ...] = BIFURCATIONS, grazing: bool = True) -> None:
        self.corrector, self.kinds, self.grazing = corrector, kinds, grazing
        self.restore(DetectorState())

    @property
    def state(self) -> DetectorState:
        """What it remembers now."""
        return DetectorState(dict(self._rates), {kind: tuple(zeros) for kind, zeros in self._recent.items()})

    def restore(self, state: DetectorState) -> None:
        """Remember what a detector remembered at an earlier time."""
        self._rates = dict(state.rates)
        self._recent = {kind: list(state.recent.get(kind, ())) for kind in self.kinds}

    def inspect(self, first: BranchPoint, last: BranchPoint, before: BranchPoint | None = None) -> list[SpecialPoint]:
        """The special points between two neighbouring points, in the order of the walk; `before` is the one before.

        Raises
        ------
        NumericalError
            If an orbit between the two cannot be found.
        """
        stretch = Stretch(self.corrector, first, last)
        if Kind.BRANCH_POINT in self.kinds and first.determinant * last.determinant < 0.0:
            _crossing(stretch, first, last)  # known first, so that the search for others steps over it
        grazes = find_grazing(stretch, before, first, last) if self.grazing else []
        zeros: list[_Zero] = []
        for kind in self.kinds:
            zeros += _resolved(kind, self._scan(kind, stretch), stretch)
        found = [(zero.point.arclength, zero) for zero in zeros if _is_genuine(zero, stretch)]
        found += [(graze.point.arclength, graze) for graze in grazes]
        found.sort(key=lambda item: item[0])
        marks = [first.arclength, *(arclength for arclength, _ in found), last.arclength]
        special = []
        for index, (_, item) in enumerate(found):
            sides = [stretch.at(_beside(marks, index + 1, side)) for side in (-1, 1)]
            kind, contact, nature = Kind.GRAZING, "", ""
            if isinstance(item, _Zero):
                kind = item.kind
                nature = opening(*sides) if kind is Kind.FOLD else ""
                if kind is Kind.FOLD and not nature:
                    continue  # the branch goes on as before: rounding made this zero
            else:
                contact = describe_switch(item.point.orbit, item.switch)
            error = float(self._location_error(kind, item, stretch))  # a plain number, as a result file has it
            before_it, after_it = _instabilities(kind, *sides)
            special.append(SpecialPoint(kind, item.point, before_it, after_it, error, contact, nature))
        return special

    def _location_error(self, kind: Kind, item: _Zero | Graze, stretch: Stretch) -> float:
        """Estimated error of the parameter at a special point: its bracket, and what a second opinion says."""
        try:
            if kind is Kind.BRANCH_POINT:
                return self._crossing_error(item, stretch)

            def seen(point: BranchPoint) -> Neighbour:
                zero = (
                    value(kind, point) if isinstance(item, _Zero) else depth_near(point.orbit, item.switch, item.theta)
                )
                return Neighbour(point, zero)

            beside, second = _beside_point(stretch, item.point), self._second.at(item.point)
            return location_error(kind, seen(item.point), seen(beside), seen(second), item.spread)
        except NumericalError:
            return math.inf

    def _crossing_error(self, item: _Zero | Graze, stretch: Stretch) -> float:
        """The same for a branch point, where no other equation could hold an orbit either."""
        point, scale = item.point, float(self.corrector.scales[-1])
        ends = [abs(each.arclength - point.arclength) for each in (stretch.points[0], stretch.points[-1])]
        off = abs(self._second.crossing(point, min(_AROUND, *ends)) - point.value)
        bracket = abs(float(point.tangent[-1])) * scale * item.spread
        return float(bracket + SAFETY * off + ROUNDING * (abs(point.value) + scale))

    @cached_property
    def _second(self) -> SecondOpinion:
        return SecondOpinion(self.corrector)

    def _scan(self, kind: Kind, stretch: Stretch) -> list[_Zero]:
        """All zeros of one test function on a stretch."""
        known = self._recent[kind]
        zeros: list[_Zero] = []
        for a, b in pairwise(_apart(stretch.points)):
            zeros += self._search(kind, stretch, a, b, self._rates.get(kind), known)
            self._rates[kind] = _rate(kind, a, b, known)
        del known[:-4]
        return zeros

    def _search(
        self, kind: Kind, stretch: Stretch, a: BranchPoint, b: BranchPoint, rate: float | None, known: list[float]
    ) -> list[_Zero]:
        """All zeros between two points, given the rate of change before them (if any) and the zeros known already."""
        length = b.arclength - a.arclength
        at_a, at_b = _deflated(kind, a, known), _deflated(kind, b, known)
        changes = at_a * at_b < 0.0
        bend = abs(at_b - at_a - rate * length) if rate is not None else abs(at_b - at_a)
        if not changes and (length < stretch.finest or math.sqrt(at_a * at_b) > _DOUBT * bend):
            return []
        if max(abs(value(kind, a)), abs(value(kind, b))) < _NOISE:
            return []  # it vanishes all along, as with multipliers that stay on the unit circle without damping
        if changes:
            zero = self._locate(kind, stretch, a, b, known)
            known.append(zero.point.arclength)
            return [zero, *self._search(kind, stretch, a, b, None, known)]
        middle = stretch.middle(a, b)
        left = self._search(kind, stretch, a, middle, rate, known)
        return left + self._search(kind, stretch, middle, b, _rate(kind, a, middle, known), known)

    def _locate(self, kind: Kind, stretch: Stretch, a: BranchPoint, b: BranchPoint, known: list[float]) -> _Zero:
        from scipy.optimize import brentq  # imported late: it takes long

        if kind is Kind.BRANCH_POINT:
            crossing = _crossing(stretch, a, b)
            if crossing is not None:
                point = stretch.at(crossing.arclength)
                return _Zero(kind, point, crossing.spread)

        def function(arclength: float) -> float:
            return _deflated(kind, stretch.at(arclength), known)

        root, report = brentq(
            function, a.arclength, b.arclength, xtol=_EXACT * 10, rtol=1e-14, full_output=True, disp=False
        )
        point = stretch.at(float(root))
        return _Zero(kind, point, _EXACT * 10 if report.converged else math.inf)


def _resolved(kind: Kind, zeros: list[_Zero], stretch: Stretch) -> list[_Zero]:
    """The zeros of one test function that can be told apart.

    Where the branch turns within lengths that are made of rounding, as where it grazes a stiff stop, the function has
    zeros wherever rounding puts them: if its sign changes over all of them they are one, if not there is none.
    """
    groups: list[list[_Zero]] = []
    for zero in sorted(zeros, key=lambda zero: zero.point.arclength):
        if groups and zero.point.arclength - groups[-1][-1].point.arclength < RESOLUTION:
            groups[-1].append(zero)
        else:
            groups.append([zero])
    firsts = [group[0].point.arclength for group in groups]
    marks = [stretch.points[0].arclength, *firsts, stretch.points[-1].arclength]
    kept = []
    for index, group in enumerate(groups, start=1):
        if len(group) > 1:
            low, high = (value(kind, stretch.at(_beside(marks, index, side))) for side in (-1, 1))
            if low * high > 0.0:
                continue
        kept.append(min(group, key=lambda zero: abs(value(kind, zero.point))))
    return kept


def _instabilities(kind: Kind, before: BranchPoint, after: BranchPoint) -> tuple[Instability, Instability]:
    """Unstable multipliers on both sides of a special point.

    Where the Jacobian changes the sign of its determinant, one multiplier passes +1. By harmonic balance multipliers
    are those of the motion, but folds and branch points those of the truncated equation. So on one of both sides the
    multiplier may be where it is on the other: which way it goes then tells the numbers.
    """
    sides = before.instability, after.instability
    signs = [point.determinant * float(point.tangent[-1]) for point in (before, after)]
    if kind not in (Kind.FOLD, Kind.BRANCH_POINT) or signs[0] * signs[1] >= 0.0 or sides[0].total != sides[1].total:
        return sides
    near, far = (critical_multiplier(kind, point.orbit.multipliers).real for point in (before, after))
    inner, outer = sides if near < far else sides[::-1]
    if max(near, far) <= 1.0:
        outer = outer._replace(above=outer.above + 1)
    elif min(near, far) > 1.0 and inner.above:
        inner = inner._replace(above=inner.above - 1)
    return (inner, outer) if near < far else (outer, inner)


def opening(before: BranchPoint, after: BranchPoint) -> str:
    """To which side a fold opens, by which way the branch goes before and after it, up to the next special points.

    Farther away another fold may have turned it again. Empty if it goes the same way on both sides.
    """
    ways = [float(point.tangent[-1]) for point in (before, after)]
    if ways[0] * ways[1] >= 0.0:
        return ""
    return f"opens to {'higher' if ways[1] > 0.0 else 'lower'} values"


def _beside_point(stretch: Stretch, point: BranchPoint) -> BranchPoint:
    """A point close to another, but not crowding about it."""
    away = {abs(each.arclength - point.arclength): each for each in stretch.points}
    nearest = min((distance for distance in away if distance > _CROWDED), default=math.inf)
    if nearest <= _BESIDE:
        return away[nearest]
    low, high = (each.arclength - point.arclength for each in (stretch.points[0], stretch.points[-1]))
    return stretch.at(point.arclength + (max(low, -_BESIDE) if -low > high else min(high, _BESIDE)))


def _crossing(stretch: Stretch, a: BranchPoint, b: BranchPoint) -> Crossing | None:
    """The crossing between two points, found now or before; None if the branch is not smooth enough for one."""
    for crossing in stretch.crossings:
        if a.arclength < crossing.arclength < b.arclength:
            return crossing
    try:
        stretch.crossings.append(locate_crossing(stretch, a, b))
    except NumericalError:
        return None
    return stretch.crossings[-1]


def _is_genuine(zero: _Zero, stretch: Stretch) -> bool:
    """Whether a zero is a bifurcation of its own: no neutral saddle, and no fold that is the vertex of a pitchfork.

    That one lies where the branch is interpolated through the crossing. Outside of there orbits are held, and however
    near a fold is, it is one of its own: where a contact grazes beside the vertex, the branch may turn at once again.
    """
    if zero.kind is not Kind.FOLD:
        return is_genuine(zero.kind, zero.point)
    return not any(
        abs(zero.point.arclength - crossing.arclength) < min(_VERTEX, crossing.radius) for crossing in stretch.crossings
    )


def _deflated(kind: Kind, point: BranchPoint, known: list[float]) -> float:
    """The test function with its known zeros divided out."""
    result = value(kind, point)
    for zero in known:
        result /= point.arclength - zero if point.arclength != zero else 1e-300
    return result


def _apart(points: list[BranchPoint]) -> list[BranchPoint]:
    """The points but those that crowd about a zero: between them test functions change by no more than rounding."""
    kept = points[:1]
    for point in points[1:-1]:
        if point.arclength - kept[-1].arclength > _CROWDED and points[-1].arclength - point.arclength > _CROWDED:
            kept.append(point)
    return [*kept, points[-1]]


def _rate(kind: Kind, a: BranchPoint, b: BranchPoint, known: list[float]) -> float:
    return (_deflated(kind, b, known) - _deflated(kind, a, known)) / (b.arclength - a.arclength)


def _beside(marks: list[float], index: int, side: int) -> float:
    """An arclength between a special point and its neighbour on one side: the neighbour itself if it is an end."""
    neighbour = marks[index + side]
    is_end = index + side in (0, len(marks) - 1)
    return neighbour if is_end else 0.5 * (marks[index] + neighbour)
