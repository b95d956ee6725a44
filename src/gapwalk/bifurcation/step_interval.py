"""One step of a walk: any point within it on request, and the search for all zeros of a test function in it.

A sign change of a test function is located by bracketing. Two zeros in one step, however, leave no sign change.
Therefore the step is halved wherever a test function bends so much that it may cross zero twice between two points.
Known zeros are divided out first, so that only unknown ones cause further halving.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from gapwalk.continuation.corrector import TRUST, Corrector, hermite, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError

if TYPE_CHECKING:
    from gapwalk.bifurcation.kinds.branch_point import Crossing
    from gapwalk.bifurcation.special_point import Kind


# Zero of a function of arclength in a bracket, with few evaluations: each of them is a motion to be computed.
#
# The next place is that of the polynomial through the inverse function at up to five known places (Brent's method has
# three). Where it does not converge, the bracket is halved.
#
# References: R. P. Brent, Algorithms for Minimization without Derivatives, 1973, chapter 4.

EXACT = 1e-13
"""Arclength to which zeros are located."""
_RELATIVE = 1e-14  # the same as a share of the arclength, for those that are large
_SECANT = 1e-6  # arclength of a secant that tells how far a zero is
_SHARE_LEFT = 0.25  # share of `EXACT`, by the secant, at which a zero is reached
_PLACES = 5  # through which the inverse function is interpolated
_ATTEMPTS = 100  # evaluations; about 45 halve a step of a walk to rounding
_TINY = 1e-11  # length of steps that only rounding keeps from converging
_BEYOND = 4.0  # steps by which the next place lies beyond the zero then
_NARROWER, _AS_HIGH = 0.125, 0.5  # shares of the bracket, and of the values at its ends, by which a jump is seen

_Known = tuple[float, float]  # a place, and the value there


def zero_between(
    function: Callable[[float], float],
    low: float,
    high: float,
    beside: Mapping[float, float] | None = None,
    *,
    jumps: bool = True,
) -> tuple[float, bool]:
    """Return the zero of a function of arclength between two places where its signs differ.

    Brent's method spends its last evaluation on the other side of a zero that it has reached. Here a secant to a place
    nearby tells that it has.
    """
    a, b = (low, function(low)), (high, function(high))
    if not a[1] or not b[1]:
        return (a if not a[1] else b)[0], True
    known, last, before = [a, b, *(beside or {}).items()], b[0] - a[0], b[0] - a[0]
    best, narrow, sizes = min(a, b, key=_size), _NARROWER * (b[0] - a[0]), (_AS_HIGH * _size(a), _AS_HIGH * _size(b))
    for _ in range(_ATTEMPTS):
        width, least = b[0] - a[0], 0.5 * (EXACT + _RELATIVE * abs(best[0]))
        if width <= 2.0 * least:
            return best[0], True
        if not jumps and width < narrow and _size(a) > sizes[0] and _size(b) > sizes[1]:
            return best[0], False
        found = _interpolated(known, best)
        place = found if found is not None and a[0] < found < b[0] else math.inf
        step = place - best[0]
        other = b[0] if best is a else a[0]
        slow = abs(step) > 0.5 * abs(before)
        if abs(step) < least or (slow and abs(last) < _TINY):  # go a little beyond, for the bracket to close in
            step = math.copysign(max(least, slow * _BEYOND * abs(last)), other - best[0])
            place = best[0] + step
        if not a[0] < place < b[0] or (slow and not abs(step) <= _BEYOND * _TINY):
            place = 0.5 * (a[0] + b[0])
            step = last = place - best[0]
        before, last = last, step
        here = place, function(place)
        nearest = min(known, key=lambda each: abs(each[0] - place))
        away = abs(nearest[0] - place)
        if abs(here[1]) * away <= _SHARE_LEFT * EXACT * abs(here[1] - nearest[1]) and away <= _SECANT:
            return place, True
        known.append(here)
        a, b = (a, here) if (here[1] > 0.0) is (b[1] > 0.0) else (here, b)
        best = min(a, b, key=_size)
    return best[0], False


def _size(known: _Known) -> float:
    return abs(known[1])


def _interpolated(known: list[_Known], best: _Known) -> float | None:
    """Return the zero of the polynomial through the inverse function at known places; None if it has no inverse.

    The places are those nearest to the best one, as far as the function is monotone over them.
    """
    chosen = [best]
    for each in sorted(known, key=lambda each: abs(each[0] - best[0])):
        if len(chosen) == _PLACES:
            break
        if each is best or each[0] == best[0]:
            continue
        trial = sorted([*chosen, each])
        signs = {after[1] > before[1] for before, after in pairwise(trial)}
        if len(signs) > 1 or len({value for _, value in trial}) < len(trial):
            break
        chosen.append(each)
    if len(chosen) < 2:
        return None
    # Neville's scheme at the value 0
    values, places = [value for _, value in chosen], [place - best[0] for place, _ in chosen]
    for order in range(1, len(chosen)):
        for i in range(len(chosen) - order):
            low, high = values[i], values[i + order]
            places[i] = (high * places[i] - low * places[i + 1]) / (high - low)
    return best[0] + places[0]


RESOLUTION = 1e-11
"""Arclength below which lengths are only rounding."""
_FINEST = 1e-6  # arclength below which two zeros are not distinguished
_SHARE = 1e-4  # the same as a share of a short step, for branches that bend so sharply that the steps are short
_FAR, _NEAR = (
    1e-3,
    0.01,
)  # arclength from its neighbours, and share of it as a last Newton step, of a point like those of a walk
_ASTRAY = 0.3  # smallest cosine of the angle between a chord and a tangent in between; below it a turn was missed
_DOUBT = 1.0  # share of its bend by which a test function may dip between the ends of an interval; 1/8 for a parabola
# between equal ends; unequal ends count with their geometric mean, as a dip to zero has to leave the larger one too
_CROWDED = 1e-6  # arclength over which rates of test functions would be dominated by rounding
_BESIDE = 1e-4  # arclength within which a test function is linear, for the error of its zero
_SPLIT = 1e-5  # distance from criticality within which several multipliers are so at once
_NOISE = 1e-10  # absolute value of a test function that is only rounding
_AT_CORNER = 1e-10  # arclength within which a change of sign is at a corner


@dataclass(frozen=True)
class Zero:
    """Special point as it was located."""

    kind: Kind  #: Its kind.
    point: BranchPoint  #: The point of the branch.
    spread: float  #: Width of its bracket in arclength.
    function: Callable[[BranchPoint], float]  #: The function that is zero there, with a change of sign.
    contact: str = ""  #: For a grazing point: contact, stage and side that grazes; otherwise empty.
    noise: float = 0.0  #: Absolute value of the function that is only rounding.
    multiplicity: int = 1  #: Number of multipliers, or of pairs, that become critical at once.


class StepInterval:
    """Step interval: the orbits between two neighbouring points of a walk, by scaled arclength.

    Each new point is predicted by the cubic through its known neighbours and their tangents, then corrected in a plane
    across their chord. So points become cheaper as they become denser. Close to a crossing with another branch, points
    are interpolated instead; a crossing is added to `crossings` when it is found. Two zeros less than `finest` apart
    are not distinguished. In `located` are places that need not be searched again when the step is divided.
    """

    def __init__(self, corrector: Corrector, first: BranchPoint, last: BranchPoint) -> None:
        self.corrector = corrector
        self._points = [first, last]
        self._lengths = [first.arclength, last.arclength]
        self.crossings: list[Crossing] = []
        self.located: dict[Any, Any] = {}
        self.finest = min(_FINEST, max(RESOLUTION, _SHARE * (last.arclength - first.arclength)))

    @property
    def points(self) -> list[BranchPoint]:
        """All points known so far, in order."""
        return list(self._points)

    def at(self, arclength: float) -> BranchPoint:
        """Return the point at an arclength."""
        index = bisect_left(self._lengths, arclength)
        if index < len(self._lengths) and self._lengths[index] == arclength:
            return self._points[index]
        point = self._between(self._points[index - 1], self._points[index], arclength)
        self._points.insert(index, point)
        self._lengths.insert(index, arclength)
        return point

    def middle(self, first: BranchPoint, last: BranchPoint) -> BranchPoint:
        """Return the point halfway between two points."""
        return self.at(0.5 * (first.arclength + last.arclength))

    def _between(self, a: BranchPoint, b: BranchPoint, arclength: float) -> BranchPoint:
        for crossing in self.crossings:
            if arclength in crossing:
                return self.corrector.crossed(
                    crossing.x(arclength), crossing.tangent(arclength), arclength, crossing.count
                )
        chord = b.x - a.x
        length = length_of(chord)
        share = (arclength - a.arclength) / (b.arclength - a.arclength)
        normal = chord / length if length > 1e-12 else a.tangent
        away = min(share, 1.0 - share) * (b.arclength - a.arclength)
        # far from its neighbours, a point is no special one: it is computed like those of the walk
        trust, near = (TRUST, _NEAR * away) if away > _FAR else (0.0, math.inf)
        for guess in (hermite(a, b, share), a.x + share * chord):
            correction = self.corrector.correct(guess, normal, trust, near)
            if correction is not None and correction.distance <= max(length, 1e-9):
                point = self.corrector.point(correction, a.tangent, arclength)
                if point.tangent @ normal >= _ASTRAY:
                    return point
        raise NumericalError(
            f"no orbit found between {a.value:.12g} and {b.value:.12g} on the branch, where one must be"
        )


class Search:
    """Search of one step of a walk.

    Attributes
    ----------
    interval
        The orbits between the two points.
    memo
        What several kinds need of the step, computed once.
    corners
        Arclengths at which multipliers and tangents may jump.
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
        self.interval = StepInterval(corrector, first, last)
        self._rates, self._recent = rates, recent
        self.memo: dict[Any, Any] = {}
        self.corners: list[float] = []

    def zeros(self, kind: Kind) -> list[Zero]:
        """Return all distinguishable zeros of the test function of a kind, in no order."""
        known, several = self.recent(kind), self.several(kind)
        zeros, taken = [*several], {zero.point.arclength for zero in several}
        # at a zero that is divided out, the sign is rounding
        for a, b in pairwise(_apart([each for each in self.interval.points if each.arclength not in taken])):
            rate, length = self._rates.get(kind), b.arclength - a.arclength
            ends = _deflated(kind, a, known), _deflated(kind, b, known)
            if self._may_vanish(kind, (a, b), ends, rate):
                zeros += self._search(kind, a, b, rate, known)
                ends = _deflated(kind, a, known), _deflated(kind, b, known)
            self._rates[kind] = (ends[1] - ends[0]) / length
        del known[:-4]
        if not zeros:
            return zeros
        return [
            each
            for each in self._resolved(kind, zeros)
            if not self._jumps(each) and not (several and each.multiplicity == 1 and _moves_as_one(kind, each.point))
        ]

    def several(self, kind: Kind) -> list[Zero]:
        """Return the zeros of a kind at which several multipliers become critical at once, by the equality of parts.

        The test function then touches zero, or changes its sign as a higher power. The zeros are divided out as often.
        """
        found = self.memo.get(("several", kind))
        if found is None:
            found = self.memo["several", kind] = []
            points = self.interval.points
            if all(point.orbit.instability.total < 2 for point in points):  # what is beyond criticality is unstable
                return found
            for a, b in pairwise(_apart(points)):
                found += self._several_between(kind, a, b)
            for zero in found:
                self.recent(kind).extend([zero.point.arclength] * (zero.multiplicity - (zero.kind is not kind)))
        return found

    def _several_between(self, kind: Kind, a: BranchPoint, b: BranchPoint) -> list[Zero]:
        """Return such zeros between two points, which are halved as long as those in it may not be at one place."""
        first, last = sorted((kind.beyond(a), kind.beyond(b)))
        if last - first < 2:
            return []
        zero = kind.locate_several(self, a, b, (first, last))
        if zero is not None or b.arclength - a.arclength < self.interval.finest:
            return [zero] if zero is not None else []
        middle = self.interval.middle(a, b)
        return self._several_between(kind, a, middle) + self._several_between(kind, middle, b)

    def bracketed_mean(self, kind: Kind, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int]) -> Zero | None:
        """Return the zero of the mean offset of several multipliers between two points; None if they differ."""

        def function(arclength: float) -> float:
            return kind.mean_offset(self.interval.at(arclength), ranks)

        if not function(a.arclength) * function(b.arclength) < 0.0:
            return None
        root, converged = zero_between(function, a.arclength, b.arclength)
        return self.several_at(kind, self.interval.at(root), EXACT if converged else math.inf, ranks)

    def several_at(self, kind: Kind, point: BranchPoint, spread: float, ranks: tuple[int, int]) -> Zero | None:
        """Return a zero at which several multipliers become critical; None if they are apart there."""
        offsets, (first, last) = np.sort(kind.offsets(point.orbit.free_multipliers))[::-1], ranks
        split = float(np.abs(offsets[first:last]).max())
        if not split < _SPLIT:
            return None
        function = partial(kind.mean_offset, ranks=ranks)
        return Zero(kind, point, spread, function, noise=split, multiplicity=last - first)

    def _jumps(self, zero: Zero) -> bool:
        """Return True if a test function is not zero, but changes its sign by a jump at a corner."""
        near = any(abs(zero.point.arclength - corner) < _AT_CORNER for corner in self.corners)
        return near and zero.kind.by_multipliers and abs(zero.kind.at(zero.point)) > zero.kind.noise

    def recent(self, kind: Kind) -> list[float]:
        """Return the data that the walk keeps for a kind: by default the arclengths of its last zeros."""
        return self._recent.setdefault(kind, [])

    def near(self, point: BranchPoint) -> BranchPoint:
        """Return a point close to another one, but not so close that their difference is only rounding."""
        points = self.interval.points
        away = {abs(each.arclength - point.arclength): each for each in points}
        nearest = min((distance for distance in away if distance > _CROWDED), default=math.inf)
        if nearest <= _BESIDE:
            return away[nearest]
        low, high = (each.arclength - point.arclength for each in (points[0], points[-1]))
        return self.interval.at(point.arclength + (max(low, -_BESIDE) if -low > high else min(high, _BESIDE)))

    def known_sides(self, point: BranchPoint) -> list[BranchPoint]:
        """Return the nearest known points on both sides of another one, except those dominated by rounding."""
        offsets = [(each.arclength - point.arclength, each) for each in self.interval.points]
        sides = [[(abs(s), each) for s, each in offsets if s * way > _CROWDED] for way in (-1.0, 1.0)]
        return [min(side, key=lambda known: known[0])[1] for side in sides if side]

    def sides(self, marks: list[float], index: int) -> tuple[BranchPoint, BranchPoint]:
        """Return points on both sides of a special point: halfway to its neighbours, or the ends of the step."""
        before, here, after = marks[index - 1 : index + 2]
        before = before if index == 1 else 0.5 * (here + before)
        after = after if index == len(marks) - 2 else 0.5 * (here + after)
        return self.interval.at(before), self.interval.at(after)

    def _search(self, kind: Kind, a: BranchPoint, b: BranchPoint, rate: float | None, known: list[float]) -> list[Zero]:
        """Return all zeros between two points, given the rate of change before them (if any) and the known zeros."""
        at_a, at_b = _deflated(kind, a, known), _deflated(kind, b, known)
        if not self._may_vanish(kind, (a, b), (at_a, at_b), rate):
            return []
        if max(abs(kind.at(a)), abs(kind.at(b))) < _NOISE:
            return []  # zero everywhere, as with multipliers that stay on the unit circle without damping
        if at_a * at_b < 0.0:
            zero = kind.locate(self, a, b) or self._bracketed(kind, a, b, known)
            known.append(zero.point.arclength)
            return [zero, *self._search(kind, a, b, None, known)]
        middle = self.interval.middle(a, b)
        left = self._search(kind, a, middle, rate, known)
        return left + self._search(kind, middle, b, _rate(kind, a, middle, known), known)

    def _may_vanish(
        self, kind: Kind, pair: tuple[BranchPoint, BranchPoint], values: tuple[float, float], rate: float | None
    ) -> bool:
        """Return True if a test function may vanish between two points, given its rate of change before them if any."""
        (a, b), (at_a, at_b) = pair, values
        length = b.arclength - a.arclength
        if at_a * at_b < 0.0:
            return True
        if length < self.interval.finest:
            return False
        bend = abs(at_b - at_a - rate * length) if rate is not None else abs(at_b - at_a)
        return math.sqrt(at_a * at_b) <= _DOUBT * bend or kind.hides(a, b)

    def _bracketed(self, kind: Kind, a: BranchPoint, b: BranchPoint, known: list[float]) -> Zero:
        def function(arclength: float) -> float:
            return _deflated(kind, self.interval.at(arclength), known)

        others = [each for each in self.interval.points if kind in each.memo]
        if self.before is not None:
            others.append(self.before)  # its value may have to be computed again, after a resumption
        beside = {each.arclength: _deflated(kind, each, known) for each in others if each is not a and each is not b}
        root, converged = zero_between(function, a.arclength, b.arclength, beside)
        return Zero(kind, self.interval.at(root), EXACT if converged else math.inf, kind.at)

    def _resolved(self, kind: Kind, zeros: list[Zero]) -> list[Zero]:
        """Return the distinguishable zeros of one test function.

        Where the branch turns within lengths that are only rounding, such as at a graze of a stiff stop, rounding
        produces spurious zeros. A group of such zeros counts as one if the sign changes over all of them, else as none.
        """
        groups: list[list[Zero]] = []
        for zero in sorted(zeros, key=lambda zero: zero.point.arclength):
            if groups and zero.point.arclength - groups[-1][-1].point.arclength < RESOLUTION:
                groups[-1].append(zero)
            else:
                groups.append([zero])
        firsts = [group[0].point.arclength for group in groups]
        marks = [self.interval.points[0].arclength, *firsts, self.interval.points[-1].arclength]
        kept = []
        for index, group in enumerate(groups, start=1):
            if len(group) > 1:
                low, high = (kind.at(side) for side in self.sides(marks, index))
                if low * high > 0.0:
                    continue
            kept.append(min(group, key=lambda zero: abs(kind.at(zero.point))))
        return kept


def _apart(points: list[BranchPoint]) -> list[BranchPoint]:
    """Return the points except those crowded around a zero, between which test functions change only by rounding."""
    if len(points) == 2:
        return points
    kept = points[:1]
    for point in points[1:-1]:
        if point.arclength - kept[-1].arclength > _CROWDED and points[-1].arclength - point.arclength > _CROWDED:
            kept.append(point)
    return [*kept, points[-1]]


def _moves_as_one(kind: Kind, point: BranchPoint) -> bool:
    """Return True if the two multipliers nearest to criticality are equally far from it.

    Beside a point where they are critical at once, the test function is so small that rounding decides on its sign.
    """
    offsets = kind.offsets(point.orbit.free_multipliers)
    nearest = offsets[np.argsort(np.abs(offsets), kind="stable")[:2]]
    return len(nearest) == 2 and abs(nearest[1] - nearest[0]) < 0.5 * abs(nearest[0])


def _rate(kind: Kind, a: BranchPoint, b: BranchPoint, known: list[float]) -> float:
    return (_deflated(kind, b, known) - _deflated(kind, a, known)) / (b.arclength - a.arclength)


def _deflated(kind: Kind, point: BranchPoint, known: list[float]) -> float:
    """Return the test function with its known zeros divided out."""
    result = kind.at(point)
    for zero in known:
        result /= point.arclength - zero if point.arclength != zero else 1e-300
    return result
