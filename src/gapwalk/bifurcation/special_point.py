"""Special points of a branch: the search for them in a step, their errors, what a kind must give, and their record.

Method: docs/numerics/notes/special-points.md
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, cast

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.bifurcation.bracketed_zero import EXACT, zero_between
from gapwalk.continuation.corrector import TRUST, Corrector, hermite, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.flow.event_rule import jumping_switches, one_way_switches
from gapwalk.late_fields import is_known
from gapwalk.model.registry import Registry
from gapwalk.model.words import told_apart
from gapwalk.notebook import Shown
from gapwalk.orbit.floquet import Instability, change_words
from gapwalk.orbit.orbit import Orbit, switch_named
from gapwalk.orbit.orbit_equation import OrbitEquation, places_beside, roundings
from gapwalk.summary import SummaryParts, summarizes

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch_start import BranchStart
    from gapwalk.bifurcation.kinds.critical_multipliers import Criticality, Crossing
    from gapwalk.bifurcation.loci.gradient import Gradient
    from gapwalk.bifurcation.normal_form import NormalForm
    from gapwalk.bifurcation.touch_map import Beyond
    from gapwalk.continuation.corrector import Range
    from gapwalk.orbit.method import Method


# One step of a walk: any point within it on request, and the search for all zeros of a test function in it.
#
# A sign change of a test function is located by bracketing. Two zeros in one step, however, leave no sign change.
# Therefore the step is halved wherever a test function bends so much that it may cross zero twice between two points.
# Known zeros are divided out first, so that only unknown ones cause further halving.

RESOLUTION = 1e-11
"""Arclength below which lengths are only rounding."""
_FINEST = 1e-6  # arclength below which two zeros are not distinguished
_SHARE = 1e-4  # the same as a share of a short step, for branches that bend so sharply that the steps are short
# arclength from its neighbours, and share of it as a last Newton step, of a point like those of a walk
_FAR, _NEAR = 1e-3, 0.01
_ACROSS = 3.0  # largest distance across a chord, as a multiple of that to its nearer end
_ASTRAY = 0.3  # smallest cosine of the angle between a chord and a tangent in between; below it a turn was missed
_DOUBT = 1.0  # share of its bend by which a test function may dip between the ends of an interval; 1/8 for a parabola
# between equal ends; unequal ends count with their geometric mean, as a dip to zero has to leave the larger one too
_SPARSE = 1 / 64  # share of a step between points at which test functions are asked where they are dear
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
    are not distinguished. In `located` are places that need not be searched again when the step is divided, in `jumps`
    the arclengths over which quantities were found to jump.
    """

    def __init__(self, corrector: Corrector, first: BranchPoint, last: BranchPoint) -> None:
        self.corrector = corrector
        self._points = [first, last]
        self._lengths = [first.arclength, last.arclength]
        self.crossings: list[Crossing] = []
        self.located: dict[Any, Any] = {}
        self.jumps: dict[Any, float] = {}
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
        if (beside := self._beside(a, b, arclength)) is not None:
            return beside
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

    def _beside(self, a: BranchPoint, b: BranchPoint, arclength: float) -> BranchPoint | None:
        """Return the point between two points by the derivatives of a neighbour; None if they do not serve.

        The guess is the cubic over the whole step, moved by what the two points are off it.
        """

        def cubic(place: float) -> NDArray[np.float64]:
            first, last = self._points[0], self._points[-1]
            return hermite(first, last, (place - first.arclength) / (last.arclength - first.arclength))

        chord, share = b.x - a.x, (arclength - a.arclength) / (b.arclength - a.arclength)
        length, straight = length_of(chord), a.x + share * chord
        if not self.corrector.is_dear or length <= EXACT or a.orbit.stuck or b.orbit.stuck:  # that needs the transition
            return None
        off = (1.0 - share) * (a.x - cubic(a.arclength)) + share * (b.x - cubic(b.arclength))
        normal, guess = chord / length, cubic(arclength) + off
        correction = self.corrector.correct_beside(guess + ((straight - guess) @ normal) * normal, normal)
        # farther across the chord a turn may have been missed
        if correction is None or length_of(correction.x - straight) > _ACROSS * min(share, 1.0 - share) * length + 1e-9:
            return None
        return self.corrector.point(correction, normal, arclength)


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
        for a, b in pairwise(_apart([each for each in self._asked() if each.arclength not in taken])):
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

    def _asked(self) -> list[BranchPoint]:
        """Return the points at which test functions are asked: if dear, not those that are close to others of them."""
        # all that know their derivatives, and those beside corners, are among them
        points = self.interval.points
        if not self.corrector.is_dear or len(points) == 2:
            return points
        points, sparse = _apart(points), _SPARSE * (points[-1].arclength - points[0].arclength)
        kept = {0, len(points) - 1}  # always, for a walk that was resumed
        kept |= {place for place, point in enumerate(points) if is_known(point, "tangent")}
        for place, (a, b) in enumerate(pairwise(points)):
            kept |= {place, place + 1} if a.orbit.pattern != b.orbit.pattern else set()
        for place, point in enumerate(points):
            if min(abs(points[each].arclength - point.arclength) for each in kept) > sparse:
                kept.add(place)
        return [points[place] for place in sorted(kept)]

    def several(self, kind: Kind) -> list[Zero]:
        """Return the zeros of a kind at which several multipliers become critical at once, by the equality of parts.

        The test function then touches zero, or changes its sign as a higher power. The zeros are divided out as often.
        """
        found = self.memo.get(("several", kind))
        if found is None:
            found = self.memo["several", kind] = []
            points = self._asked()
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


# Error estimate for points of a branch from a second computation with another or finer discretisation.
#
# Shooting uses one segment more, harmonic balance 50 % more harmonics. The difference between the two computations is
# an estimate of the error. Where it is rounding, it may be small by chance, or both computations may share the error.
# So the effect of the rounding of the residual is added: what remains of it where the branch is ill-conditioned.

SAFETY = 4.0  # factor on the difference of two computations, neither of which is exact
_NODES = np.array([-1.0, -0.75, -0.45, 0.45, 0.75, 1.0])  # places of points near a crossing, as multiples of the reach
_REAL = 1e-6  # imaginary part below which a root counts as real
_SAME = 1e-13  # distance in scaled variables, by rounding only, from a point to its correction
_AT = 1e-6  # distance of the critical multiplier from +1 or -1 that its own rounding explains
_NOTABLE, _FARTHEST = 1e-10, 1e-3  # scaled distances by rounding from and up to which it is asked how far it leads
_MORE = 1.25  # factor on the effect of rounding: the largest of a few samples is not the largest of all
_FURTHER, _BENDS = 4.0, 2.0  # factor on the distance, and that on the rounding of a residual that it must exceed
ROUNDING = 2e-14
"""Relative error of a parameter that both computations share, from the flow: about 1e-15 in each of its steps."""


class ErrorEstimator:
    """Error estimator that computes the branch of a corrector with another discretisation."""

    def __init__(self, corrector: Corrector) -> None:
        self._equation = cast("OrbitEquation", corrector.equation)
        self._own = corrector
        self._other = self._equation.otherwise()
        self._known = corrector.scales
        known = corrector.scales[:-1]
        velocity = known[min(self._equation.system.size, len(known) - 1)]  # harmonic balance has no velocities
        scales = self._other.scales(1.0, velocity / known[0])
        scales *= known[0] / scales[0]  # so that lengths along the branch are equal in both
        self._corrector = Corrector(self._other, np.append(scales, corrector.scales[-1]))

    @property
    def corrector(self) -> Corrector:
        """Corrector for the branch of the second computation."""
        return self._corrector

    def at(self, point: BranchPoint, shift: float = 0.0) -> BranchPoint:
        """Return the point of the second computation in the plane normal to a point's tangent, `shift` along it."""
        along = self._embedded(point.tangent)
        try:
            start = self._ahead(point, shift)
        except NumericalError:
            start = self._embedded(point.x) + shift * along
        normal = along / np.linalg.norm(along)
        correction = None if point.orbit.stuck else self._corrector.correct_beside(start, normal)
        correction = correction or self._corrector.correct(start, normal)
        if correction is None:
            raise NumericalError(f"no orbit is found at {point.value:.12g} with another discretisation")
        if correction.distance <= _SAME:
            return self._corrector.point(correction, along, point.arclength + shift)
        # evaluated exactly there: the correction may have been evaluated one Newton step away
        return self._corrector.exact_point(correction.x, along, point.arclength + shift)

    def _ahead(self, point: BranchPoint, shift: float) -> NDArray[np.float64]:
        """Return the scaled unknowns of the motion that lies `shift` along the tangent at a point, to first order.

        They are computed from the motion itself, because the other discretisation has additional unknowns, which also
        change along the branch.
        """
        orbit, value = point.orbit, float(point.x[-1])
        if shift:
            x = (point.x + shift * point.tangent) * self._known
            orbit = self._equation.orbit(x[:-1], float(x[-1]), self._equation.evaluate_late(x[:-1], float(x[-1])))
            value += shift * float(point.tangent[-1])
        return np.append(self._other.unknowns(orbit) / self._corrector.scales[:-1], value)

    def blur(self, point: BranchPoint, rounding: NDArray[np.float64] | None = None) -> _Blur:
        """Return how rounding moves a point of the first computation across its tangent.

        Shapes: `rounding` (samples, N).
        """
        evaluation = self._own.evaluate_late(point.x) if rounding is None else self._own.evaluated_near(point.x)
        assert evaluation.by_parameter is not None
        if rounding is None:
            x = point.x * self._known
            places = places_beside(x, self._known)
            asides = [self._equation.evaluate_late(place[:-1], float(place[-1])) for place in places]
            rounding = roundings(x, evaluation, places, asides)
        jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * self._known
        right = np.column_stack((rounding, np.zeros(len(rounding)))).T
        try:
            moved = _MORE * np.linalg.solve(np.vstack((jacobian, point.tangent)), right).T
        except np.linalg.LinAlgError:
            raise NumericalError(f"the branch is singular at {point.value:.12g}") from None
        farthest = moved[int(np.argmax(np.linalg.norm(moved, axis=1)))]
        most, times = _BENDS * float(np.abs(rounding).max()), 1.0
        # where motions are nearly a continuum, the equation bends: rounding leads farther than its derivatives tell
        while _NOTABLE < times * length_of(farthest) < _FARTHEST:
            ahead = (self._own.evaluate_late(point.x + way * times * farthest) for way in (-_FURTHER, _FURTHER))
            if min(float(np.abs(each.residual - evaluation.residual).max()) for each in ahead) > most:
                break
            times *= _FURTHER
        ways = (times,) if times == 1.0 else (times, -times)
        asides = [self._own.exact_point(point.x + way * farthest, point.tangent, point.arclength) for way in ways]
        reached = times if times == 1.0 else _FURTHER * times  # it ends between the two
        return _Blur(reached * float(np.abs(moved[:, -1]).max()), asides, rounding)

    def crossing(self, point: BranchPoint, reach: float, function: Callable[[BranchPoint], float]) -> float:
        """Return the parameter at which the second computation has a crossing, near a branch point.

        Close to the crossing no orbit can be corrected, but the branch and its determinant are smooth. Polynomials
        through points on both sides, up to `reach` away, give the zero of the determinant or another function.
        """
        points = [self.at(point, float(share) * reach) for share in _NODES]

        def polynomial(values: list[float]) -> Polynomial:
            return Polynomial.fit(_NODES, values, len(_NODES) - 1, domain=[-1.0, 1.0])

        roots = polynomial([function(each) for each in points]).roots()
        places = roots[np.abs(roots.imag) < _REAL].real
        places = places[np.abs(places) <= 1.0]
        if not len(places):
            raise NumericalError(f"no branches cross near {point.value:.12g} with another discretisation")
        return float(polynomial([each.value for each in points])(places[np.argmin(np.abs(places))]))

    def _embedded(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(self._equation.embed(x[:-1], self._other), x[-1])


class _Blur(NamedTuple):
    """Effect of rounding on a point of a branch."""

    off: float  #: Largest change of the scaled parameter.
    asides: list[BranchPoint]  #: The point displaced farthest; to both sides, if that is farther than derivatives tell.
    rounding: NDArray[np.float64]  #: shape (samples, N): Samples of the rounding errors of the residual.


class _Seen(NamedTuple):
    """Point, the test function there, and what rounding makes of both."""

    point: BranchPoint  #: The point.
    zero: float  #: The test function.
    off: float = 0.0  #: Change of the scaled parameter across the branch by rounding.
    blur: float = 0.0  #: Change of the test function by rounding.


def location_error(
    zero: Zero, second: ErrorEstimator, around: Sequence[BranchPoint], ends: Sequence[BranchPoint] = ()
) -> float:
    """Estimate the error of the parameter at a special point; infinite if it cannot be estimated.

    The point is compared with points near it on the branch, and with the same point of a second computation, in the
    plane across the tangent. The largest of the estimates counts.

    At a graze the depth may rise on one side of the point and stay almost zero on the other, and rounding may move the
    motions of one side only. So its effect on the points of both sides is counted with the steepest of the rates, and
    so is a second computation that lies on the other side.
    """
    there, blur = second.at(zero.point), second.blur(zero.point)

    def seen(point: BranchPoint, blur: _Blur) -> _Seen:
        value = zero.function(point)
        return _Seen(point, value, blur.off, max(abs(zero.function(each) - value) for each in blur.asides))

    here, other = seen(zero.point, blur), _Seen(there, zero.function(there))
    if not zero.contact:  # both sides are alike
        return max(_location_error(zero, here, other, _Seen(point, zero.function(point))) for point in around)
    near, further = ([seen(point, second.blur(point, blur.rounding)) for point in each] for each in (around, ends))
    sides = [here, *near, *further]
    here = here._replace(off=max(each.off for each in sides), blur=max(each.blur for each in sides))
    steepest = max(near, key=lambda each: abs(_secant_rate(here, each)))
    return max(_location_error(zero, here, other, each, each is not steepest) for each in near)


def _secant_rate(here: _Seen, near: _Seen) -> float:
    """Return the rate of change of the test function along the branch between two points; 0 if they are the same."""
    apart = near.point.arclength - here.point.arclength
    return (near.zero - here.zero) / apart if apart else 0.0


def _location_error(zero: Zero, here: _Seen, other: _Seen, near: _Seen, is_flat: bool = False) -> float:
    kind, spread = zero.kind, zero.spread
    point, apart = here.point, near.point.arclength - here.point.arclength
    rate = _secant_rate(here, near)
    if not rate or not math.isfinite(rate):
        return math.inf
    off = abs(other.point.value - point.value)  # across the branch
    shift, blur = abs(other.zero), here.blur
    if is_flat:
        shift, blur = shift if other.zero * near.zero > 0.0 else 0.0, near.blur
    along = max(abs(here.zero), shift, zero.noise, blur) / abs(rate)
    width = abs(point.x[-1] and point.value / point.x[-1])  # the scale of the parameter
    off += width * here.off
    ahead = abs(float(point.tangent[-1])) * along
    if kind.is_turning:
        ahead += 0.5 * abs(rate) * along**2  # the parameter is stationary there: what counts is its curvature
    if kind.target is not None:
        critical = [kind.critical_multiplier(each.point.orbit.free_multipliers) for each in (here, near, other)]
        blurred = abs(critical[1] - critical[0]) / abs(apart) * (along + spread) + abs(critical[2] - critical[0])
        if abs(critical[0] - kind.target) > SAFETY * blurred + _AT:
            return math.inf  # no multiplier is critical here
    bracket = abs(float(point.tangent[-1])) * width * spread
    return float(bracket + SAFETY * (off + width * ahead) + ROUNDING * (abs(point.value) + width))


# Kind of special point: the contract that every kind fulfils, and the registry of all kinds.


@dataclass(frozen=True, slots=True)
class Symbol:
    """Style in which special points of a kind are drawn.

    Examples
    --------
    >>> gw.Kind.named("fold").symbol.letters
    'LP'
    """

    label: str  #: Text of the legend.
    letters: str  #: Text next to a point; may be empty.
    #: marker, size: The matplotlib marker, and its size in points.
    marker: str
    size: float
    color: str  #: Name of a colour of the palette.
    #: Matplotlib dashes of the kind's locus in a map; None if it has no locus.
    dashes: str | tuple[float, tuple[float, ...]] | None = None
    width: float = 1.6  #: Width of the line of the locus, in points.


class Kind(str):
    """Kind of special point.

    A kind is a string, its name: ``Kind.FOLD == "fold"``. A kind also holds everything specific to its points. To add a
    kind, write a subclass in a file of `gapwalk.bifurcation.kinds`, and register its one instance there. Walks, tables,
    pictures, maps, verification and files then support the kind. A kind whose points are zeros of a smooth function
    along the branch needs only `function` and `symbol`.

    Parameters
    ----------
    name
        Name of the kind, in tables and files.

    Attributes
    ----------
    symbol
        Drawing style.
    target
        Value of the critical multiplier if it is fixed: +1 or -1.
    moves_through_one
        True if a multiplier passes +1, so that the determinant of the orbit's Jacobian changes its sign.
    ways
        Number of directions in which other periodic branches begin: 1 at a flip, 2 at a branch point, otherwise 0.
    times
        Period of the branches that begin there, in periods of this branch: 2 at a flip.
    is_turning
        True if the branch turns back, so that the parameter is stationary there.
    order
        Order of the leading term of its normal form: 2 at a fold, 3 at a flip; 0 if it has no normal form.
    sign_change
        What it means if the test function changes its sign in a step, as a clause for messages; empty if the function
        may change its sign for another reason too.
    noise
        Absolute value of the test function below which its sign is uncertain.
    by_multipliers
        True if a multiplier is critical all along the kind's locus, which then has corners where contacts graze.
    is_corner
        True if the tangent of the branch and the multipliers may jump at such a point.
    turn
        Order in which kinds are searched for in a step: 0 first, 2 last. Later searches use what earlier ones found.

    Examples
    --------
    >>> gw.Kind.FOLD == "fold"
    True
    """

    symbol: ClassVar[Symbol] = Symbol("event", "", "d", 5.0, "grey")
    target: ClassVar[float | None] = None
    moves_through_one: ClassVar[bool] = False
    ways: ClassVar[int] = 0
    times: ClassVar[int] = 1
    is_turning: ClassVar[bool] = False
    order: ClassVar[int] = 0
    sign_change: ClassVar[str] = ""
    noise: ClassVar[float] = 1e-6
    turn: ClassVar[int] = 2
    by_multipliers: ClassVar[bool] = True
    is_corner: ClassVar[bool] = False

    FOLD: ClassVar[Kind]
    FLIP: ClassVar[Kind]
    NEIMARK_SACKER: ClassVar[Kind]
    BRANCH_POINT: ClassVar[Kind]
    GRAZING: ClassVar[Kind]
    HELD_STOP: ClassVar[Kind]
    CROSSING_SLIDING: ClassVar[Kind]
    SWITCHING_SLIDING: ClassVar[Kind]
    GRAZING_SLIDING: ClassVar[Kind]
    ADDING_SLIDING: ClassVar[Kind]
    SLIP_ONSET: ClassVar[Kind]

    def __new__(cls, name: str) -> Self:  # noqa: D102 - as the class
        return super().__new__(cls, name)

    @staticmethod
    def known() -> tuple[Kind, ...]:
        """Return all kinds, in the order of tables and legends."""
        return tuple(KINDS.values())

    @staticmethod
    def with_locus() -> tuple[Kind, ...]:
        """Return the kinds whose points can be followed in two parameters, in the order of `known`."""
        return tuple(kind for kind in KINDS.values() if not kind.no_locus)

    @staticmethod
    def named(name: str) -> Kind:
        """Return the kind with a name, such as ``fold``."""
        return KINDS.named(name)

    def function(self, point: BranchPoint) -> float:
        """Evaluate the test function: smooth along a branch, and zero with a sign change at a point of this kind."""
        raise NotImplementedError(f"a {self} is not the zero of one function")

    def hides(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Return True if the test function, of equal sign at `a` and `b`, must have two zeros between these points."""
        return False

    @property
    def value(self) -> str:
        """Name of the kind, such as ``fold``."""
        return str(self)

    @property
    def has_function(self) -> bool:
        """True if the points of this kind are the zeros of one test function."""
        return type(self).function is not Kind.function

    def at(self, point: BranchPoint) -> float:
        """Return the value of the test function at a point; it is computed once for each point."""
        known = point.memo.get(self)
        if known is None:
            known = point.memo[self] = self.function(point)
        return known

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the signed distances of multipliers from criticality, positive beyond it; by default there are none.

        In a machine with equal parts several multipliers become critical at once. The mean of their distances is then
        smooth and changes its sign, while the test function may keep its sign.
        """
        return np.zeros(0)

    def beyond(self, point: BranchPoint) -> int:
        """Return how many multipliers, or complex pairs, are beyond criticality, such as below -1 for a flip."""
        known = point.memo.get(("beyond", self))
        if known is None:
            offsets = self.offsets(point.orbit.free_multipliers)
            known = point.memo["beyond", self] = int(np.count_nonzero(offsets > 0.0))
        return known

    def mean_offset(self, point: BranchPoint, ranks: tuple[int, int]) -> float:
        """Sort the offsets from the largest; return the mean of those numbered ``ranks[0]`` to ``ranks[1] - 1``."""
        offsets, (first, last) = self.offsets(point.orbit.free_multipliers), ranks
        return float(np.sort(offsets)[::-1][first:last].mean()) if len(offsets) >= last else math.nan

    def is_genuine(self, point: BranchPoint, near: float = 1e-6) -> bool:
        """Return True if a zero of the test function is a point of this kind, with multipliers known to `near`."""
        return True

    def prepare(self, search: Search) -> None:
        """Prepare a step of the walk before special points are searched for in it; by default nothing is done."""

    def points_in(self, search: Search) -> list[Zero]:
        """Return all points of this kind in one step of a walk: by default, all zeros that `is_genuine` accepts."""
        return [zero for zero in search.zeros(self) if self.is_genuine(zero.point)]

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """Locate the one zero between two points by a better method than bracketing; None if the kind has none."""
        return None

    def locate_several(self, search: Search, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int]) -> Zero | None:
        """Locate the point between `a` and `b` at which several multipliers become critical; None if there is none."""
        return search.bracketed_mean(self, a, b, ranks)

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error of a located zero by comparison with another discretisation; infinite if unknown."""
        return location_error(zero, second, [search.near(zero.point)])

    def nature(self, before: BranchPoint, after: BranchPoint) -> str | None:
        """Return the criticality that the points on both sides show, in words; None if they refute the point."""
        return ""

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """Verify a point from recomputed neighbours: return objections, and a function that is zero there, or None."""
        first, last = sorted((self.beyond(before), self.beyond(after)))
        function = self.at if special.multiplicity == 1 else partial(self.mean_offset, ranks=(first, last))
        if function(before) * function(after) > 0.0:
            return [f"the test function of a {self} does not change its sign"], None
        return [], function

    def judged(self, special: SpecialPoint, parameter: str, method: Method | None) -> SpecialPoint:
        """Complete the special point with information from other branches, such as the criticality of a flip."""
        return special

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return the beginnings of the other branches that begin or cross at a point of this kind."""
        raise ModelError(f"no other periodic branch begins at a {self}; switch at a flip or at a branch point")

    def foretold(self, special: SpecialPoint) -> Beyond | None:
        """Return the motion that theory predicts beyond a point of this kind; None if there is no such prediction."""
        return None

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the locus equation in two parameters: the distance of a monodromy matrix from criticality."""
        raise NotImplementedError(f"a {self} is not defined by multipliers")

    def angle(self, multipliers: NDArray[np.complex128]) -> float:
        """Return the argument of the critical multiplier, from 0 to pi."""
        return math.pi if self.target is not None and self.target < 0.0 else 0.0

    def residual(self, orbit: Orbit, multipliers: NDArray[np.complex128]) -> float:
        """Return how far an orbit of a locus is from a point of this kind, by recomputed multipliers.

        If the kind has a `target`, this is the product of the distances of all multipliers from it, each at most 1.
        The product stays small if a second multiplier is near the target, as at a point of codimension two.
        """
        if self.target is not None:
            return float(np.prod(np.minimum(np.abs(multipliers - self.target), 1.0)))
        again = replace(orbit, multipliers=multipliers)
        return abs(self.function(BranchPoint(math.nan, again, _NONE, _NONE, math.nan, math.nan)))

    @property
    def no_locus(self) -> str:
        """Reason why this kind has no locus in two parameters, as a sentence; empty if it has one."""
        has_one = type(self).condition is not Kind.condition
        return "" if has_one else f"a {self} has no locus in two parameters; {_WITH_A_LOCUS}"

    def critical(self, multipliers: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the indices of the multipliers that are critical at a point of this kind, nearest first."""
        if self.target is None:
            return np.zeros(0, dtype=np.intp)
        return np.argsort(np.abs(multipliers - self.target), kind="stable")[:1]

    def critical_multiplier(self, multipliers: NDArray[np.complex128]) -> complex:
        """Return the critical multiplier of a point of this kind; nan if there is none."""
        places = self.critical(multipliers)
        return complex(multipliers[places[0]]) if len(places) else complex(np.nan, np.nan)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """Validate entries of model files and results: the name of a known kind."""
        from pydantic_core import core_schema  # imported late: only files need it

        def checked(value: Any) -> Kind:
            try:
                return value if isinstance(value, Kind) else cls.named(value)
            except (ModelError, TypeError) as error:
                raise ValueError(str(error)) from None

        return core_schema.no_info_plain_validator_function(checked, serialization=core_schema.to_string_ser_schema())

    def __reduce__(self) -> tuple[Any, ...]:
        return Kind.named, (str(self),)


_NONE = np.zeros(0)  # unknowns of an orbit that is on no branch
KINDS: Registry[Kind] = Registry("kind of special point", "kinds of special points")
_WITH_A_LOCUS = "follow a fold, a flip, a neimark-sacker or a grazing point, or one of sliding"


def register(kind: Kind) -> Kind:
    """Register a kind under its name; a class that is defined again replaces its earlier definition.

    Parameters
    ----------
    kind
        The kind, an instance of its class.

    Returns
    -------
    Kind
        The kind itself.

    Raises
    ------
    ModelError
        If the name belongs to a kind of another class.

    Examples
    --------
    >>> gw.special_points.register(gw.Kind.named("fold"))  # as gapwalk has done
    'fold'
    """
    return KINDS.add(str(kind), kind)


REACH = 0.01
"""Amplitude, as a share of the motion, up to which the period-doubled branch at a flip is examined."""
_ONE_PLACE = 1e-7  # arclength within which points of two contacts or directions may be one event
_MANY = 20  # points of a kind after each other that are one line for readers
_ROUNDED = 1e-12  # relative rounding of their parameter
_TIMES = {1: "", 2: "double ", 3: "triple "}
_WHOLE = 0.5  # share of that amplitude from which a criticality counts as valid over all of it
VERTEX = 1e-3
"""Parameter component of the tangent below which the branch counts as turning back."""


@dataclass(frozen=True, eq=False)
class SpecialPoint(Shown):
    """Point at which orbits appear, vanish, bifurcate, or touch a stop.

    Examples
    --------
    >>> str(fold.kind), round(fold.value, 9), fold.uncertainty < 1e-10
    ('fold', 1.392108885, True)
    >>> fold.nature, fold.orbit.measure("max.x") > 1.0
    ('opens to lower values', True)
    """

    _row: ClassVar = (
        "kind parameter=value uncertainty before=before.label after=after.label unstable.before=before.total "
        "unstable.after=after.total multiplier stability=change multiplicity nature coefficient judged "
        "beyond=beyond_words contact contacts=orbit.pattern"
    )

    kind: Kind  #: Kind of the special point.
    point: BranchPoint  #: The located point of the branch.
    #: before, after: Unstable multipliers before and after the point, in the direction of the walk.
    before: Instability
    after: Instability
    #: Estimated error of its parameter value; infinite if unknown. It has three parts: four times the difference from
    #: the same point in another discretisation (other segments, or more harmonics, so that truncation is included);
    #: four times the effect of rounding of the equations; and the width of the bracket in which the point was located.
    uncertainty: float
    #: For a grazing point: contact, stage and side that grazes, such as ``stage2 -``; otherwise empty.
    contact: str = ""
    #: Criticality: ``opens to lower values`` or ``opens to higher values`` for a fold, ``supercritical`` or
    #: ``subcritical`` for a flip, in the limit towards the point; empty for other kinds, or if it is unknown.
    nature: str = ""
    #: Amplitude of the doubled motion, in units of the state, up to which the doubled branch stays on the side that the
    #: criticality of a flip predicts. It is examined up to 1 % of the size of the motion, or to where it turns back.
    judged: float = 0.0
    parameter: str = ""  #: Name of the parameter along which its branch was followed.
    #: Number of multipliers, or complex pairs, that become critical at once: 2 at a double flip of two equal parts of a
    #: machine. At a double fold of two equal parts, branches cross on which only one of the parts has passed its fold.
    multiplicity: int = 1

    @property
    def value(self) -> float:
        """Value of the parameter."""
        return self.point.value

    @property
    def orbit(self) -> Orbit:
        """Orbit at the point."""
        return self.point.orbit

    @property
    def multiplier(self) -> complex:
        """Multiplier nearest to +1 (fold), -1 (flip) or the unit circle (Neimark-Sacker); nan at a grazing point."""
        return self.kind.critical_multiplier(self.point.orbit.free_multipliers)

    @property
    def ways(self) -> int:
        """Number of directions in which other branches begin: that of `Kind.ways`, and 2 at a double fold."""
        return self.kind.ways or Kind.BRANCH_POINT.ways * (self.kind.is_turning and self.multiplicity > 1)

    @property
    def is_vertex(self) -> bool:
        """True at a branch point at which this branch turns back, because it branches off there from another one."""
        return self.kind is Kind.BRANCH_POINT and abs(float(self.point.tangent[-1])) < VERTEX

    @property
    def doubles(self) -> bool:
        """True if a branch of twice the period begins or ends here.

        This is so at flips, and at changes of the sequence of slip and stick where a multiplier jumps across -1. From
        such a change the doubled motion grows in proportion to the change of the parameter, not to its square root.
        """
        jumps = self.kind.is_corner and (self.before.below - self.after.below) % 2 == 1
        return self.kind is Kind.FLIP or jumps

    @property
    def turns(self) -> bool:
        """True if the branch turns back here: at a fold, or where a multiplier jumps across +1."""
        return self.kind.is_turning or (self.is_corner and (self.before.above - self.after.above) % 2 == 1)

    @property
    def passes_flip(self) -> bool:
        """True if a multiplier passes -1 here: at a flip, or where it jumps across -1."""
        return self.kind is Kind.FLIP or (self.is_corner and (self.before.below - self.after.below) % 2 == 1)

    @property
    def is_corner(self) -> bool:
        """True if multipliers jump here: where the sequence of slip and stick changes, or at some grazes.

        Near a graze of a contact whose force jumps, derivatives of the motion grow as the inverse of the speed of the
        touch. At a graze of a damper that acts in one direction only, multipliers jump by a finite amount. A force
        given by a formula sets in at all angles of the excitation at once.
        """
        if self.kind is not Kind.GRAZING:
            return self.kind.is_corner
        switches = {*jumping_switches(self.orbit.system), *one_way_switches(self.orbit.system)}
        return switch_named(self.orbit, self.contact) in {None, *switches}

    @cached_property
    def beyond(self) -> Beyond | None:
        """Motion beyond a graze, as the theory of discontinuity maps predicts it; None at other special points.

        Its `verdict` is ``goes on``, ``doubles``, ``jumps``, ``period adding``, ``period adding and chaos``, ``chaos at
        once``, or ``unknown`` where the theory does not decide. See the guide on grazes.

        Examples
        --------
        >>> graze = branch.special("grazing")[0]
        >>> graze.beyond.verdict, graze.beyond.order
        ('goes on', 1.5)
        """
        return self.kind.foretold(self)

    @property
    def beyond_words(self) -> str:
        """Predicted motion beyond a graze, as tables show it; empty at other special points."""
        return self.beyond.words if self.beyond is not None else ""

    @cached_property
    def normal_form(self) -> NormalForm | None:
        """Normal form of a fold, a flip or a Neimark-Sacker point; None at other points, and where it is not known.

        The normal form is that of the exact motion: at a point found by harmonic balance, its error includes that of
        the truncation. None is known where friction sticks throughout, or several multipliers are critical at once.

        Examples
        --------
        >>> fold.normal_form.criticality == fold.nature
        True
        """
        from gapwalk.bifurcation.normal_form import normal_form

        return normal_form(self)

    @property
    def coefficient(self) -> float:
        """Coefficient of the normal form; nan where it is not known."""
        return self.normal_form.coefficient if self.normal_form else math.nan

    @property
    def kind_words(self) -> str:
        """Name of the kind, with the number of multipliers if several become critical at once: ``double flip``."""
        return f"{_TIMES.get(self.multiplicity, f'{self.multiplicity}-fold ')}{self.kind}"

    @property
    def nature_words(self) -> str:
        """Criticality of the point; for a flip whose doubled branch soon turns back, with the amplitude to there."""
        if self.kind is Kind.NEIMARK_SACKER and self.normal_form:
            return self.normal_form.criticality
        whole = self.kind is not Kind.FLIP or not self.nature
        if whole or self.judged >= _WHOLE * REACH * magnitude(self.orbit.state, self.orbit.system):
            return self.nature
        return f"{self.nature} up to {self.judged:.1g}"

    @property
    def multiplier_words(self) -> str:
        """Critical multiplier with six decimals; a complex one with its conjugate; empty at a grazing point."""
        multiplier = self.multiplier
        if np.isnan(multiplier):
            return ""
        if abs(multiplier.imag) <= 1e-9 * abs(multiplier):
            return f"{multiplier.real:+.6f}"
        return f"{multiplier.real:+.6f} ± {abs(multiplier.imag):.6f}i"

    def gradient(self, *names: str, method: Method | None = None) -> Gradient:
        """Return the derivatives of the point's value by other parameters, by default by all that are not zero.

        See `gapwalk.bifurcation.loci.gradient.gradient`.

        Examples
        --------
        >>> round(fold.gradient("stop.clearance")["stop.clearance"], 6)
        -0.20789
        """
        from gapwalk.bifurcation.loci.gradient import gradient

        return gradient(self, names, method)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the properties of the point, one line each."""
        return (f"{name} {text}" for name, text in self.words.items() if text)

    @property
    def words(self) -> dict[str, str]:
        """Row of the point in a table, by column: texts of rounded numbers, empty where nothing applies."""
        return {
            "kind": self.kind_words,
            "at": f"{self.value:#.10g}",
            "±": f"{self.uncertainty:.0e}" if np.isfinite(self.uncertainty) else "",
            "multiplier": self.multiplier_words,
            "stability": self.change,
            "criticality": self.nature_words or self.beyond_words,
            "contact": self.contact,
        }

    @property
    def change(self) -> str:
        """Change of stability in the direction of the walk, in words."""
        return change_words(self.before, self.after)

    def __repr__(self) -> str:
        place = f"{self.kind_words} at {self.value:.10g} +- {self.uncertainty:.0e}"
        nature = self.nature or getattr(vars(self).get("normal_form"), "criticality", "")  # it is not computed here
        return f"SpecialPoint({', '.join(filter(None, (place, self.change, nature, self.contact)))})"


def at_once(special: Sequence[SpecialPoint]) -> list[tuple[SpecialPoint, ...]]:
    """Return special points in groups of those that are one event, as where both sides of a gap graze at one value."""
    groups: list[tuple[SpecialPoint, ...]] = []
    for each in special:
        last = groups[-1][-1] if groups else each
        error = last.uncertainty + each.uncertainty + _ROUNDED * abs(each.value)
        if is_one_place(each, last) and abs(each.value - last.value) <= error < np.inf:
            groups[-1] += (each,)
        else:
            groups.append((each,))
    return groups


def is_one_place(other: SpecialPoint, special: SpecialPoint) -> bool:
    """Return True if two points are one event of a symmetric motion, in two contacts or directions."""
    alike = other.kind == special.kind and not special.kind.by_multipliers and other.contact != special.contact
    return alike and abs(other.point.arclength - special.point.arclength) < _ONE_PLACE


def in_runs(special: Sequence[SpecialPoint]) -> list[tuple[SpecialPoint, ...]]:
    """Return special points in groups for readers: as `at_once`, and many grazes after each other are one."""
    groups: list[tuple[SpecialPoint, ...]] = []
    for kind, run in groupby(at_once(special), lambda group: group[0].kind):
        alike = list(run)
        groups += [sum(alike, ())] if len(alike) >= _MANY and not kind.by_multipliers else alike
    return groups


def words_of(group: Sequence[SpecialPoint]) -> dict[str, str]:
    """Return one row of a table for readers for special points at one place, or of a run, with all their contacts."""
    if len(group) >= _MANY:
        values = [each.value for each in group]
        shown = {"at": " to ".join(told_apart(min(values), max(values)))}
        shown["contact"] = ", ".join(dict.fromkeys(each.contact.partition(" ")[0] for each in group))
        shown |= {"kind": f"{len(group)} {group[0].kind}", "stability": change_words(group[0].before, group[-1].after)}
        return dict.fromkeys(group[0].words, "") | shown
    contacts = ", ".join(dict.fromkeys(each.contact for each in group if each.contact))
    count = {"kind": f"{len(group)} {group[0].kind_words}"} if group[1:] else {}
    return group[0].words | count | {"stability": change_words(group[0].before, group[-1].after), "contact": contacts}
