"""The search of one step of a walk for zeros of test functions, so that none hides between its two points.

A sign change of a test function is located by bracketing. But two zeros in one step leave no sign change: wherever a
test function bends so much that it may dip through zero between two points, the step is halved until that doubt is
gone. Zeros that are already known are divided out first, so that only unknown ones raise doubt.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from gapwalk.bifurcation.crossing import Crossing, locate_crossing
from gapwalk.bifurcation.stretch import RESOLUTION, Stretch
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError

if TYPE_CHECKING:
    from gapwalk.bifurcation.kind import Kind

_DOUBT = 1.0  # share of the bend over an interval by which a test function may dip between its ends; 1/8 for a parabola
# between equal ends; unequal ones count with their geometric mean, as a dip to zero has to leave the larger one too
_CROWDED = 1e-6  # arclength over which rates of test functions would be made of rounding
_BESIDE = 1e-4  # arclength within which a test function is straight, for the error of its zero
_NOISE = 1e-10  # size of a test function that is nothing but rounding
_EXACT = 1e-14  # arclength to which zeros are located


@dataclass(frozen=True)
class Zero:
    """A special point as it was located.

    Attributes
    ----------
    kind
        What happens there.
    point
        The point of the branch.
    spread
        Width of its bracket in arclength.
    function
        What is zero there, with a change of sign.
    contact
        For a grazing point: contact, stage and side that grazes; otherwise empty.
    noise
        Size of the function that is nothing but rounding.
    """

    kind: Kind
    point: BranchPoint
    spread: float
    function: Callable[[BranchPoint], float]
    contact: str = ""
    noise: float = 0.0


class Search:
    """The search of one step of a walk.

    Parameters
    ----------
    corrector
        Corrects onto the branch.
    first, last
        The points between which to look.
    before
        The point before them, if it is known.
    rates
        By test function, its rate of change before `first`, where that is known; kept up to date.
    recent
        By test function, the arclengths of its last zeros; kept up to date.

    Attributes
    ----------
    stretch
        The orbits between the two points.
    """

    def __init__(
        self,
        corrector: Corrector,
        first: BranchPoint,
        last: BranchPoint,
        before: BranchPoint | None,
        rates: dict[Kind, float],
        recent: dict[Kind, list[float]],
    ) -> None:
        self.corrector, self.first, self.last, self.before = corrector, first, last, before
        self.stretch = Stretch(corrector, first, last)
        self._rates, self._recent = rates, recent

    def zeros(self, kind: Kind) -> list[Zero]:
        """All zeros of the test function of a kind that can be told apart, in no order.

        Raises
        ------
        NumericalError
            If an orbit between the two points cannot be found.
        """
        known = self._recent.setdefault(kind, [])
        zeros: list[Zero] = []
        for a, b in pairwise(_apart(self.stretch.points)):
            zeros += self._search(kind, a, b, self._rates.get(kind), known)
            self._rates[kind] = _rate(kind, a, b, known)
        del known[:-4]
        return self._resolved(kind, zeros)

    def crossing(self, a: BranchPoint, b: BranchPoint) -> Crossing | None:
        """Where another branch crosses between two points; None if the branch is not smooth enough for that.

        Once it is found, points near it are interpolated: no orbit can be held there.
        """
        for crossing in self.stretch.crossings:
            if a.arclength < crossing.arclength < b.arclength:
                return crossing
        try:
            self.stretch.crossings.append(locate_crossing(self.stretch, a, b))
        except NumericalError:
            return None
        return self.stretch.crossings[-1]

    def near(self, point: BranchPoint) -> BranchPoint:
        """A point close to another, but not crowding about it."""
        points = self.stretch.points
        away = {abs(each.arclength - point.arclength): each for each in points}
        nearest = min((distance for distance in away if distance > _CROWDED), default=math.inf)
        if nearest <= _BESIDE:
            return away[nearest]
        low, high = (each.arclength - point.arclength for each in (points[0], points[-1]))
        return self.stretch.at(point.arclength + (max(low, -_BESIDE) if -low > high else min(high, _BESIDE)))

    def known_sides(self, point: BranchPoint) -> list[BranchPoint]:
        """The nearest known points on both sides of another, but not those that crowd about it."""
        offsets = [(each.arclength - point.arclength, each) for each in self.stretch.points]
        sides = [[(abs(s), each) for s, each in offsets if s * way > _CROWDED] for way in (-1.0, 1.0)]
        return [min(side, key=lambda known: known[0])[1] for side in sides if side]

    def sides(self, marks: list[float], index: int) -> tuple[BranchPoint, BranchPoint]:
        """Points on both sides of a special point: halfway to its neighbours, or these if they are the ends.

        Parameters
        ----------
        marks
            Arclengths of the first point, all special points, and the last point.
        index
            Of the special point among them.
        """
        return self.stretch.at(_between(marks, index, -1)), self.stretch.at(_between(marks, index, 1))

    def _search(self, kind: Kind, a: BranchPoint, b: BranchPoint, rate: float | None, known: list[float]) -> list[Zero]:
        """All zeros between two points, given the rate of change before them (if any) and the zeros known already."""
        length = b.arclength - a.arclength
        at_a, at_b = _deflated(kind, a, known), _deflated(kind, b, known)
        changes = at_a * at_b < 0.0
        bend = abs(at_b - at_a - rate * length) if rate is not None else abs(at_b - at_a)
        if not changes and (length < self.stretch.finest or math.sqrt(at_a * at_b) > _DOUBT * bend):
            return []
        if max(abs(kind.at(a)), abs(kind.at(b))) < _NOISE:
            return []  # it vanishes all along, as with multipliers that stay on the unit circle without damping
        if changes:
            zero = kind.locate(self, a, b) or self._bracketed(kind, a, b, known)
            known.append(zero.point.arclength)
            return [zero, *self._search(kind, a, b, None, known)]
        middle = self.stretch.middle(a, b)
        left = self._search(kind, a, middle, rate, known)
        return left + self._search(kind, middle, b, _rate(kind, a, middle, known), known)

    def _bracketed(self, kind: Kind, a: BranchPoint, b: BranchPoint, known: list[float]) -> Zero:
        from scipy.optimize import brentq  # imported late: it takes long

        def function(arclength: float) -> float:
            return _deflated(kind, self.stretch.at(arclength), known)

        root, report = brentq(
            function, a.arclength, b.arclength, xtol=_EXACT * 10, rtol=1e-14, full_output=True, disp=False
        )
        point = self.stretch.at(float(root))
        return Zero(kind, point, _EXACT * 10 if report.converged else math.inf, kind.at)

    def _resolved(self, kind: Kind, zeros: list[Zero]) -> list[Zero]:
        """The zeros of one test function that can be told apart.

        Where the branch turns within lengths that are made of rounding, as where it grazes a stiff stop, the function
        has zeros wherever rounding puts them: if its sign changes over all of them they are one, if not there is none.
        """
        groups: list[list[Zero]] = []
        for zero in sorted(zeros, key=lambda zero: zero.point.arclength):
            if groups and zero.point.arclength - groups[-1][-1].point.arclength < RESOLUTION:
                groups[-1].append(zero)
            else:
                groups.append([zero])
        firsts = [group[0].point.arclength for group in groups]
        marks = [self.stretch.points[0].arclength, *firsts, self.stretch.points[-1].arclength]
        kept = []
        for index, group in enumerate(groups, start=1):
            if len(group) > 1:
                low, high = (kind.at(side) for side in self.sides(marks, index))
                if low * high > 0.0:
                    continue
            kept.append(min(group, key=lambda zero: abs(kind.at(zero.point))))
        return kept


def _deflated(kind: Kind, point: BranchPoint, known: list[float]) -> float:
    """The test function with its known zeros divided out."""
    result = kind.at(point)
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


def _between(marks: list[float], index: int, side: int) -> float:
    """An arclength between a special point and its neighbour on one side: the neighbour itself if it is an end."""
    neighbour = marks[index + side]
    is_end = index + side in (0, len(marks) - 1)
    return neighbour if is_end else 0.5 * (marks[index] + neighbour)
