"""Second determination of special points: from both sides, with another discretisation.

What changes at a special point, and where, is determined from orbits on both sides of it, and their multipliers are
computed with another number of segments.

The criticality of a fold (the side to which it opens) is judged by the motions on both sides of it. A flip is judged by
doubled motions at growing amplitudes, shot in more segments than in the walk. Decisive is the smallest amplitude at
which their parameter differs from that of the flip by more than rounding, since the criticality is defined in the
limit. No contact may graze up to that amplitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import ErrorEstimator, Kind, SpecialPoint, is_one_place
from gapwalk.continuation.corrector import TRUST, Corrector, length_of, powers_of_two
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import NumericalError
from gapwalk.orbit.floquet import is_on_border
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import OrbitEquation
from gapwalk.orbit.shooting import Shooting, ShootingEquation
from gapwalk.verification.verification import Check, Ledger, Spot

# Reconstruction of the equation and the scales with which a branch was followed, from its points.

CROSSING = 1e-6
"""Regularity of a point below which branches cross there; near a fold it is 1e-4 or more."""

_STUCK = (EndReason.STEP, EndReason.WITHIN_ROUNDING)  # ends of a walk at which it may repeat its last point
_ASIDE = 1e-7  # the longest Newton step after which a walk takes the multipliers of the point before it
_LOOSE = 10.0  # factor on the residual that a walk accepts: states elsewhere may be larger
_TOLD_APART = 2.0  # frequency by which the scales of velocities differ from those of lengths
_WAYS, _SEED = 3, 1995  # number of random directions of such a step, and their seed


def special_spot(name: str, number: int, special: SpecialPoint) -> Spot:
    """Return the place of a special point of a branch."""
    return Spot(name, f"special point {number} ({special.kind.value})", special.value)


class Track:
    """Correctors for a branch, one for each resolution of its points."""

    def __init__(self, name: str, branch: Branch) -> None:
        self.name, self.branch = name, branch
        self._knots = [*branch.points, *(special.point for special in branch.special_points)]
        self.is_exact = branch.points[0].orbit.is_exact
        self.corrector = cache(self._corrector)

    @property
    def segments(self) -> int:
        """Number of segments with which it was shot, if it was."""
        return max(1, (len(self.branch.points[0].x) - 1) // self.branch.system.state_size)

    def spots(self) -> Iterator[tuple[Spot, BranchPoint, Kind | None]]:
        """Yield all points and special points with their places, and the kinds of the latter."""
        for number, point in enumerate(self.branch.points):
            yield Spot(self.name, f"point {number}", point.value), point, None
        for number, special in enumerate(self.branch.special_points):
            yield special_spot(self.name, number, special), special.point, special.kind

    def corrector_at(self, point: BranchPoint) -> Corrector:
        """Return the corrector with the unknowns of a point."""
        return self.corrector(len(point.x))

    def asides(self, point: BranchPoint) -> list[NDArray[np.float64]]:
        """Return changes of a state that represent the distance to where a point's multipliers were evaluated."""
        size = self.branch.system.state_size
        ways = np.random.default_rng(_SEED).normal(size=(_WAYS, size))
        ways = np.vstack((ways / np.linalg.norm(ways, axis=1)[:, None], point.tangent[:size]))
        return [sign * _ASIDE * way * self.corrector_at(point).scales[:size] for way in ways for sign in (-1.0, 1.0)]

    def aside(self, point: BranchPoint) -> float:
        """Return the largest change of a position in such a step."""
        return _ASIDE * float(self.corrector_at(point).scales[: self.branch.system.size].max())

    def mismatch(self, point: BranchPoint) -> float:
        """Return the largest contradiction in the stored data of a point, relative to its size."""
        # Compared are the unknowns with the state or the lines, and the parameter with the system.
        corrector = self.corrector_at(point)
        orbit, scales = point.orbit, corrector.scales
        known = self._determined(cast("OrbitEquation", corrector.equation), orbit)
        x = point.x[: len(known)] * scales[: len(known)]
        apart = float(np.abs(x - known).max()) / max(float(np.abs(known).max()), np.finfo(float).tiny)
        value = orbit.system[self.branch.parameter]
        width = abs(value) + float(scales[-1])
        return max(apart, abs(point.value - value) / width, abs(point.x[-1] * scales[-1] - value) / width)

    def regularity(self, point: BranchPoint) -> float:
        """Return 0 at a crossing of branches, where the derivatives lose rank, and up to 1 far from it."""
        corrector = self.corrector_at(point)
        evaluation = corrector.equation.evaluate(point.x[:-1] * corrector.scales[:-1], point.value)
        assert evaluation.by_parameter is not None
        derivatives = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * corrector.scales
        sizes = np.linalg.svd(derivatives, compute_uv=False)
        return float(sizes[-1] / sizes[0])

    def doubtful_residual(self, point: BranchPoint) -> float:
        """Return the stored residual of a point, in units of the largest that a walk accepts for its last step."""
        residual = point.orbit.residual
        if not residual >= 0.0:
            return math.inf
        if not self.is_exact:
            return 0.0 if math.isfinite(residual) else math.inf
        try:
            extremes = float(np.abs(point.orbit.extremes[:, :2]).max())
        except NumericalError:  # the motion from the stored states diverges
            return math.inf
        size = max(float(np.abs(point.orbit.state).max()), extremes)
        scales = self.corrector_at(point).scales[:-1]
        return residual / (_LOOSE * TRUST * max(size, min(1.0, float(scales.max()))))

    def _determined(self, equation: OrbitEquation, orbit: Orbit) -> NDArray[np.float64]:
        """Return the first unknowns of an orbit: all, or if it is exact its state, from which the others follow."""
        return orbit.determined if self.is_exact else equation.unknowns(orbit)

    def _corrector(self, count: int) -> Corrector:
        """Return the corrector for points with a number of scaled variables."""
        branch = self.branch
        fellows = [point for point in self._knots if len(point.x) == count]
        orbit = fellows[0].orbit
        equation = orbit.posed_in(count - 1).pose(branch.system, branch.parameter, branch.period)
        known = np.array([self._determined(equation, point.orbit) for point in fellows])
        x = np.array([point.x[: known.shape[1]] for point in fellows])
        units, scale = equation.scales(1.0, _TOLD_APART), np.empty(count - 1)
        for unit in np.unique(units):  # lengths have one scale, velocities another
            alike = units == unit
            part = alike[: known.shape[1]]
            scale[alike] = _ratio(known[:, part], x[:, part])
        values, labels = (np.array([[part(p)] for p in fellows]) for part in (lambda p: p.value, lambda p: p.x[-1]))
        return Corrector(equation, powers_of_two(np.append(scale, _ratio(values, labels))))


def _ratio(physical: NDArray[np.float64], scaled: NDArray[np.float64]) -> float:
    """Return the median scale of the points, so that a wrong one does not spoil the others."""
    sizes = np.abs(scaled).max(axis=1)
    ratios = np.abs(physical).max(axis=1)[sizes > 0.0] / sizes[sizes > 0.0]
    ratios = ratios[ratios > 0.0]
    return float(np.median(ratios)) if len(ratios) else 1.0


_REACH = 1e-3  # arclength at which the sides of a special point are examined, unless its neighbours are nearer
_WIDE = 5e-3  # the same for a branch point, close to which no orbit can be corrected
_RESOLVED = 1e-10  # arclength from the neighbours below which rounding decides on which side of a point a motion is
_SECANT = 1e-4  # arclength over which a test function is linear
_TOLD = 0.01  # share of that arclength beyond which the zero of a secant is not trusted
_HALVINGS = 30  # of the interval in which the point is then found
_SHARE = 0.4  # share of the distance to a neighbour; also the factor for a second, nearer examination
_NEARER = 5  # largest number of examinations
_AMPLITUDES = 1e-6 * 2.0 ** np.arange(12)  # scaled distances of doubled motions from the flip
_NOISE = 1e-13  # error of the scaled parameter of a doubled motion
_ROUNDING = 1e-16  # that error times the amplitude: near the flip a residual hardly determines the parameter
_AGREEING = 2  # number of amplitudes that must agree
_CLEAR = 30.0  # factor on the error above which a difference is significant
_EXACT = 1e-12  # error with which a special point can be located again, in widths of the range
_LEAST = 1e-16  # relative error of a parameter below which no number can represent it
_MANY = 1e4  # factor on the location error above which no stated error is plausible
_MOST = 1e-4  # the same as a share of the parameter
_STRAIGHT = 0.9  # cosine of the angle between tangents on both sides above which one of them serves both
_INTERPOLATED = 1e-9  # error in widths of the range of a branch point, which is interpolated again


class Sides(NamedTuple):
    """Result of examining a special point from both sides."""

    faults: tuple[str, ...]  #: Contradictions to the stored point, as sentences.
    value: float | None  #: The parameter where its test function is zero; None if it cannot be computed.
    #: before, after: The motions on both sides of it, with another discretisation; None if they were not computed.
    before: BranchPoint | None = None
    after: BranchPoint | None = None
    held: bool = True  #: True if motions can be corrected on both sides of it.


def verify_special_points(ledger: Ledger, track: Track) -> None:
    """Check each special point of a branch from both sides."""
    estimators = cache(lambda size: ErrorEstimator(track.corrector(size)))
    for number, special in enumerate(track.branch.special_points):
        spot = special_spot(track.name, number, special)
        if ends_at(track.branch, special):
            ledger.leave_unlocated(spot)
            continue
        examination = Examination(track, estimators(len(special.point.x)), special)
        sides = examination.sides()
        faults = sides.faults
        if not sides.held and special.ways > 1 and track.regularity(special.point) < CROSSING:
            faults = ()  # branches cross there, so near another special point that no motion can be corrected nearby
        unresolved = examination.reach < _RESOLVED  # as within the last steps before a jump
        unknown = not sides.held and special.uncertainty == math.inf  # nor could the walk compute it a second time
        if faults and (unresolved or unknown):
            ledger.leave_unlocated(spot)
            continue
        ledger.judge(Check.SIDES, spot, faults)
        if sides.before is not None and sides.after is not None:
            found = examination.criticality(sides.before, sides.after)
            wrong = f"its criticality is stated as {special.nature!r}, but is {found}"
            ledger.judge(Check.NATURE, spot, [wrong] if found and found not in special.nature else [])
        if sides.value is None or special.uncertainty == math.inf:
            ledger.leave_unlocated(spot)
        else:
            _enter_location(ledger, spot, special, sides.value)


def ends_at(branch: Branch, special: SpecialPoint) -> bool:
    """Return True for a graze at which a branch ends, since motions beyond it touch by less than rounding."""
    ends = zip((0, -1), branch.ends, strict=False)  # a lost end is said elsewhere
    places = [branch.points[place].arclength for place, end in ends if end.reason in _STUCK]
    return special.kind is Kind.GRAZING and special.point.arclength in places


@dataclass(frozen=True)
class Examination:
    """Examination of one special point of a branch, with another discretisation."""

    track: Track  #: The branch.
    second: ErrorEstimator  #: Estimator that computes it with the other discretisation.
    special: SpecialPoint  #: The special point.
    straight: bool = False  #: True to examine it along its tangent, even if the branch turns near it.

    def sides(self) -> Sides:
        """Examine the point from both sides, at decreasing distances while a result contradicts the stored point."""
        # A branch that turns between two steps of the walk need not turn at the point.
        seen = self._at_reaches()
        return replace(self, straight=True)._at_reaches() if seen.faults and self._turn else seen

    def _at_reaches(self) -> Sides:
        branch = self.track.branch
        # the steps of a walk are tiny beyond a turn, where rounding would tell the side
        from_afar = self._reach((branch.points[0], branch.points[-1]) if self._turn else branch.points)
        reaches = [from_afar * _SHARE**power for power in range(_NEARER)]
        if self.special.ways > 1:
            # close to it no orbit can be corrected; beyond the ends other changes would be included
            reaches.insert(1, self._reach((branch.points[0], branch.points[-1])))
        first = seen = self._look(reaches[0])
        for reach in reaches[1:]:
            if not seen.faults:
                return seen
            seen = self._look(reach)
        return first if seen.faults else seen

    @property
    def reach(self) -> float:
        """The largest arclength at which the point can be examined."""
        return self._reach(self.track.branch.points)

    def _reach(self, points: Sequence[BranchPoint]) -> float:
        """Return the arclength at which the point is examined: closer to it than its neighbours are."""
        special = self.special
        reach = _WIDE if special.ways > 1 else _REACH
        others = _neighbours(special, self.track.branch, points)
        distances = [length_of(each.x - special.point.x) for each in others if len(each.x) == len(special.point.x)]
        return min([reach, *(_SHARE * distance for distance in distances)])

    def _look(self, reach: float) -> Sides:
        """Examine the point at one distance on both sides."""
        special = self.special
        at_once = [each for each in self.track.branch.special_points if each is special or is_one_place(each, special)]
        try:
            a, b = self._beside(-reach), self._beside(reach)
        except NumericalError as error:
            return Sides((str(error),), None, held=False)
        faults = [
            f"{point.instability.total} unstable multipliers {side} it, where {stored.total} are stored"
            for side, point, stored in (("before", a, at_once[0].before), ("after", b, at_once[-1].after))
            if not is_on_border(point.orbit.free_multipliers) and point.instability.total != stored.total
        ]
        found, function = special.kind.examined(special, a, b)
        if function is None:
            return Sides((*faults, *found), None)
        on_branch = special.ways < 2
        value = self._zero(reach, function) if on_branch else self._crossing(reach, function)
        smooth = special.kind.has_function
        return Sides((*faults, *found), value, a if smooth else None, b if smooth else None)

    def _beside(self, shift: float) -> BranchPoint:
        """Return the point of the second computation at a distance, or not quite so far where the branch turns."""
        # Beside a graze of a rigid stop, motions grow so fast that none is found from a guess along the tangent. The
        # points of the walk on that side are better guesses.
        here = self.special.point
        if not self._turn:
            try:
                return self.second.at(here, shift)
            except NumericalError:
                if self.straight or self.special.kind is not Kind.GRAZING:
                    raise
        side = [each for each in self.track.branch.points if (each.arclength - here.arclength) * shift > 0.0]
        side.sort(key=lambda each: abs(each.arclength - here.arclength))
        if between := self._between(shift, side):
            return between
        within = [each for each in side if abs(each.arclength - here.arclength) <= abs(shift)]
        if not side:
            raise NumericalError(f"the branch has no points on one side of {self.special.value:.12g}")
        return self.second.at((within or side[:1])[-1])

    def _between(self, shift: float, side: Sequence[BranchPoint]) -> BranchPoint | None:
        """Return a point halfway to the next special point on one side, if no point of the walk lies between them."""
        # The step over a graze passes a fold or a flip just beside it, where points of the walk are beyond both.
        here = self.special.point
        others = [
            each.point
            for each in self.track.branch.special_points
            if (each.point.arclength - here.arclength) * shift > 0.0 and not is_one_place(each, self.special)
        ]
        nearest = min(others, key=lambda each: abs(each.arclength - here.arclength), default=None)
        if nearest is None or len(nearest.x) != len(here.x):
            return None
        if side and abs(side[0].arclength - here.arclength) <= abs(nearest.arclength - here.arclength):
            return None
        sign, chord = math.copysign(1.0, shift), nearest.x - here.x
        length = length_of(chord)
        if length == 0.0:
            return None
        return self.second.at(replace(here, tangent=sign * chord / length, memo={}), 0.5 * sign * length)

    @cached_property
    def _turn(self) -> bool:
        """True if the branch turns sharply at the point, as where a rigid stop is grazed."""
        # Nothing of the branch may then lie along one tangent on both sides, or both sides along the same one.
        here = self.special.point
        if self.straight:
            return False
        before = [each for each in self.track.branch.points if each.arclength < here.arclength]
        after = [each for each in self.track.branch.points if each.arclength > here.arclength]
        if not (self.special.is_corner and before and after and len(before[-1].x) == len(after[0].x) == len(here.x)):
            return False
        return float(before[-1].tangent @ after[0].tangent) < _STRAIGHT

    def _zero(self, reach: float, function: Callable[[BranchPoint], float]) -> float | None:
        """Return the parameter where a function of the point is zero, by a secant from the special point."""
        # Where a contact grazes or a phase of friction vanishes, the function may have another slope on each side. Then
        # the secant is that of the side on which rounding has put the special point.
        #
        # The function may also jump across zero, or be zero on all of one side: another event may end the phase, or a
        # bound may vanish. Its secant then leads astray, and the point is where the sides begin to differ.
        point, length = self.special.point, min(reach, _SECANT)
        try:
            here, beside = self.second.at(point), self._beside(length)
            first, last = function(here), function(beside)
        except NumericalError:
            return None
        if first * last < 0.0 and not self.special.kind.by_multipliers:
            with suppress(NumericalError):  # it may be defined on one side only
                before = self._beside(-length)
                last, beside = function(before), before
        if abs(first) > _TOLD * abs(last) and not self._turn:
            return self._parting(reach)
        if first == last:
            return None
        return here.value - (beside.value - here.value) * first / (last - first)

    def _parting(self, reach: float) -> float | None:
        """Return the parameter where motions cease to be as before the special point, by halving."""
        low, high = -reach, reach
        try:
            before = self._beside(low)
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                faults, _ = self.special.kind.examined(self.special, before, self._beside(middle))
                low, high = (middle, high) if faults else (low, middle)
            sides = self._beside(low), self._beside(high)
        except NumericalError:
            return None
        # on one side a point of the walk, farther away, may stand for one that is not found
        return min(sides, key=lambda each: abs(each.arclength - self.special.point.arclength)).value

    def _crossing(self, reach: float, function: Callable[[BranchPoint], float]) -> float | None:
        """Return the parameter where the branch crosses another, with the other discretisation."""
        # A contact may graze just beyond the reach, so that polynomials through points up to there would be less
        # accurate. Therefore points up to a share of it are used first.
        for share in (_SHARE, 1.0):
            with suppress(NumericalError):
                return self.second.crossing(self.special.point, share * reach, function)
        return None

    def criticality(self, before: BranchPoint, after: BranchPoint) -> str:
        """Determine the criticality again from motions on both sides; empty if none is stated, or it is unknown."""
        kind = self.special.kind
        with suppress(NumericalError):
            if self.special.nature and kind is Kind.FOLD:
                return self._fold(before, after)
            if self.special.nature and kind is Kind.FLIP and self.special.orbit.is_exact:
                return self._flip(before, after)
        return ""

    def _fold(self, before: BranchPoint, after: BranchPoint) -> str:
        """Return the side to which a fold opens; empty if rounding hides it."""
        special, here = self.special, self.second.at(self.special.point).value
        sides = [each.value - here for each in (before, after)]
        scaled = float(special.point.x[-1])
        width = abs(special.value) + (abs(special.value / scaled) if scaled else 1.0)
        if min(map(abs, sides)) < _CLEAR * _NOISE * width or sides[0] * sides[1] < 0.0:
            return ""
        return "lower" if sides[0] < 0.0 else "higher"

    def _flip(self, before: BranchPoint, after: BranchPoint) -> str:
        """Return the criticality of a flip: supercritical if the doubled branch is where the motion is unstable."""
        critical = [min(each.orbit.free_multipliers.tolist(), key=lambda mu: abs(mu + 1.0)) for each in (before, after)]
        outside = [abs(each) > 1.0 for each in critical]
        if outside[0] == outside[1]:
            return ""
        unstable = (before if outside[0] else after).value - self.special.value
        leaves = self._doubled_side()
        if not leaves or not unstable:
            return ""
        return "supercritical" if leaves * unstable > 0.0 else "subcritical"

    def _doubled_side(self) -> float:
        """Return the side, as a sign, on which the doubled branch leaves a flip; 0 if it cannot be determined."""
        special, track = self.special, self.track
        segments = track.segments + 1
        orbit, size = special.orbit.repeated(2), special.orbit.system.state_size
        equation = ShootingEquation(orbit.system, track.branch.parameter, orbit.period, Shooting(segments))
        known = track.corrector(len(special.point.x)).scales
        scales = np.append(np.tile(known[:size], segments), known[-1])
        start = np.append(equation.unknowns(orbit), special.value) / scales
        evaluation = equation.evaluate(start[:-1] * scales[:-1], special.value)
        across = np.append(np.linalg.svd(evaluation.by_unknowns * scales[:-1])[2][-1], 0.0)
        corrector = Corrector(equation, scales)
        error = _CLEAR * (special.uncertainty / abs(known[-1]) + _NOISE * (1.0 + abs(start[-1])))
        closings = tuple(2 * count for count in special.orbit.closings)
        sides: list[float] = []
        for amplitude in _AMPLITUDES:
            correction = corrector.correct(start + amplitude * across, across)
            if correction is None:
                continue
            shift = float(correction.x[-1] - start[-1])
            if abs(shift) > error + _CLEAR * _ROUNDING / amplitude:
                if corrector.point(correction, across, amplitude).orbit.closings != closings:
                    break  # a contact grazes at a smaller amplitude than can be distinguished from the flip
                sides.append(float(np.sign(shift)))
            if len(sides) == _AGREEING:
                break
        return sides[0] if len(sides) == _AGREEING and len(set(sides)) == 1 else 0.0


def _neighbours(special: SpecialPoint, branch: Branch, points: Sequence[BranchPoint]) -> list[BranchPoint]:
    """Return the neighbours of a special point: points, or other special points that are not at the same place."""
    # In a symmetric motion both sides of a gap graze at once, or friction changes in both directions of slip; there is
    # nothing between the two. A point of the walk at the special point itself is no neighbour: a walk may end there, or
    # step onto it.
    others = (each for each in branch.special_points if each is not special and not is_one_place(each, special))
    here = special.point.arclength
    knots = [point for point in points if point.arclength != here]
    knots += [each.point for each in others]
    before = max((knot for knot in knots if knot.arclength <= here), key=lambda knot: knot.arclength, default=None)
    after = min((knot for knot in knots if knot.arclength > here), key=lambda knot: knot.arclength, default=None)
    return [each for each in (before, after) if each is not None]


def _enter_location(ledger: Ledger, spot: Spot, special: SpecialPoint, found: float) -> None:
    """Enter the distance of a special point from its second location, in units of its stated error."""
    off = abs(found - special.value)
    width = abs(special.value / special.point.x[-1]) if special.point.x[-1] else 1.0
    stated = special.uncertainty
    error = stated + width * (_INTERPOLATED if special.ways > 1 else _EXACT)
    detail = f"found again at {found:.12g}, {off:.2g} away; its stated error is {stated:.2g}"
    least, most = _LEAST * max(abs(special.value), width), max(_MANY * off, _MOST * (abs(special.value) + width))
    if not least <= stated <= most:
        detail = f"{detail}, which is {'less than rounding' if stated < least else 'implausibly large'}"
        error = 0.0
    ledger.enter(Check.LOCATION, spot, off / error if error > 0.0 else math.inf, detail)
