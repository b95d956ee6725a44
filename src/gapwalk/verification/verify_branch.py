"""Verification of a branch: its orbits, the gaps between them, its ends, its special points, and what they account for.

A branch must connect each of its points to the next: orbits are sought between them, and must lie there. Its points
must be in order and distinct, and it must end where and why it is stated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.branch_start import halves_apart, lift
from gapwalk.bifurcation.detector import steps_of, unexplained
from gapwalk.bifurcation.error_estimate import ErrorEstimator
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import hermite, length_of
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import NumericalError, VerificationError
from gapwalk.orbit.floquet import is_on_border
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.balanced import verify_truncated
from gapwalk.verification.dop853 import Round, carry
from gapwalk.verification.verification import Advance, Check, Ledger, Spot
from gapwalk.verification.verify_special_points import distance, look, nature_faults, reshoot, spread
from gapwalk.verification.walk_again import CROSSING, Track

_OFF = 0.1  # largest distance of the orbit between from the cubic through both points, in distances of the points
_TURN = 0.6  # largest angle between a tangent and the chord, in radians
_DEEPEST = 7  # largest number of successive halvings of a gap
_LONGER = 0.3  # largest relative difference between the distance of two points and the arclength between them
_TOGETHER = 1e-6  # distance below which two points are one
_SHARES = (0.5, 0.4, 0.62)  # places at which an orbit is sought: close to a crossing of branches correction fails
_SAME = 1e-9  # relative difference below which two values of the parameter are equal
_CLOSED = 1e-5  # largest distance between the first and the last point of a closed branch
_NEAR = 0.1  # difference of the halves of a motion below which a doubled branch may step onto its parent
_BEYOND = 0.02  # distance, in scales of the parameter, by which a junction may lie beyond the last point

_AT_LAST_POINT = frozenset(EndReason) - {EndReason.JOINED}
_EXACT = 1e-12  # error with which a special point can be located again, in widths of the range
_LEAST = 1e-16  # relative error of a parameter below which no number can represent it
_MANY, _MOST = (
    1e4,
    1e-4,
)  # factor on the location error, and share of the parameter, above which no stated error is plausible
_VARIED = 3.0  # allowed difference of multipliers, as a multiple of their variation near the point
_ONE_PLACE = 1e-7  # arclength within which grazing points of two contacts may be one event of a symmetric motion
_INTERPOLATED = 1e-9  # error in widths of the range of a branch point, which is interpolated again


def verify_branches(
    ledger: Ledger,
    branches: Sequence[tuple[str, Branch]],
    advance: Advance | None = None,
    within: tuple[float, float] | None = None,
) -> None:
    """Enter all checks of some branches of one structure, by their names.

    Parameters
    ----------
    ledger
        The ledger in which to enter them.
    branches
        The branches.
    advance
        Called with the progress.
    within
        The range over which they were followed, if known.
    """
    tracks = [(name, Track(branch)) for name, branch in branches]
    _verify_orbits(ledger, [(name, track) for name, track in tracks if track.is_exact], advance)
    for done, (name, track) in enumerate(tracks):
        if advance is not None:
            advance("branches", done, len(tracks))
        if not track.is_exact:
            verify_truncated(ledger, name, track)
        verify_order(ledger, name, track.branch)
        verify_ends(ledger, name, track, within)
        _verify_gaps(ledger, name, track)
        _verify_specials(ledger, name, track)
        ledger.points += len(track.branch.points)
        ledger.special_points += len(track.branch.special_points)


def _verify_orbits(ledger: Ledger, tracks: Sequence[tuple[str, Track]], advance: Advance | None) -> None:
    """Check exact orbits by shooting: all branches together, since they are integrated together."""
    every = [(spot, point, track) for name, track in tracks for spot, point in _spots(name, track.branch)]
    orbits = [point.orbit for _, point, _ in every]

    def report(done: int) -> None:
        if advance is not None:
            advance("orbits", done, len(every))

    report(0)
    kinds = {id(each.point): each.kind for _, track in tracks for each in track.branch.special_points}
    for (spot, point, track), around in zip(every, carry(orbits, report), strict=True):
        ledger.enter(Check.RECORD, spot, track.mismatch(point))
        detail = f"its residual is stored as {point.orbit.residual:.3g}, larger than a walk accepts"
        ledger.enter(Check.RESIDUAL, spot, track.doubtful_residual(point), detail)
        beside, kind = track.asides(point), kinds.get(id(point))
        verify_orbit(ledger, spot, point.orbit, around, track.segments, beside, track.aside(point), kind)


def _spots(name: str, branch: Branch) -> Iterator[tuple[Spot, BranchPoint]]:
    """Yield all points and special points with their places."""
    for number, point in enumerate(branch.points):
        yield Spot(name, f"point {number}", point.value), point
    for number, special in enumerate(branch.special_points):
        yield Spot(name, f"special point {number} ({special.kind.value})", special.value), special.point


def verify_orbit(
    ledger: Ledger,
    spot: Spot,
    orbit: Orbit,
    around: Round,
    segments: int,
    beside: Sequence[NDArray[np.float64]] = (),
    aside: float = 0.0,
    kind: Kind | None = None,
) -> None:
    """Check one orbit by shooting.

    Parameters
    ----------
    ledger, spot
        The ledger and the place at which to enter the checks.
    orbit
        The orbit.
    around
        Its integration over one period.
    segments
        Number of segments with which it was found.
    beside
        Changes of its state that represent the distance to the point at which its multipliers were evaluated.
    aside
        Largest such change of a position.
    kind
        Kind of the special point, if it is one.
    """
    try:
        reshot = reshoot(orbit, segments, around.contraction)
    except NumericalError as error:
        ledger.enter(Check.MULTIPLIERS, spot, math.inf, str(error))
        return
    rough = max(1.0, around.error / Check.CLOSURE.bound)
    if rough > 1.0:
        ledger.note(f"{spot}: the error of the other integrator is {around.error:.1g} of the motion")
    ledger.enter(Check.CLOSURE, spot, around.closure / reshot.growth / rough)
    size = max(float(np.abs(around.extremes).max()), np.finfo(float).tiny)
    # its stages change at a point one Newton step away, which matters more if a motion is small for its branch
    ledger.enter(Check.STAGES, spot, around.astray / reshot.growth / max(rough, aside / size / Check.STAGES.bound))
    extremes = float(np.abs(around.extremes - orbit.extremes[:, :2]).max())
    ledger.enter(Check.EXTREMES, spot, extremes / size / reshot.growth / rough)
    ledger.enter(Check.VOLUME, spot, abs(reshot.contraction - around.contraction) / max(1.0, abs(around.contraction)))
    off = distance(reshot.multipliers, orbit.multipliers)
    if off > Check.MULTIPLIERS.bound and beside:
        off /= max(1.0, _VARIED * spread(orbit, segments, around.contraction, beside) / Check.MULTIPLIERS.bound)
    ledger.enter(Check.MULTIPLIERS, spot, off)
    _verify_stability(ledger, spot, orbit, reshot.multipliers, kind)


def _verify_stability(
    ledger: Ledger, spot: Spot, orbit: Orbit, multipliers: NDArray[np.complex128], kind: Kind | None
) -> None:
    """Check the number of unstable multipliers, unless one is on the unit circle.

    At a special point the critical multipliers are not counted: they are on the circle up to the error with which they
    are known.
    """
    found, stored = (_not_critical(each, kind) for each in (multipliers, orbit.multipliers))
    if is_on_border(found) or is_on_border(stored):
        return
    counts = [int((np.abs(each) > 1.0).sum()) for each in (found, stored)]
    detail = f"{counts[0]} unstable multipliers, where {counts[1]} are stored"
    ledger.enter(Check.STABILITY, spot, float(abs(counts[0] - counts[1])), detail)


def _not_critical(multipliers: NDArray[np.complex128], kind: Kind | None) -> NDArray[np.complex128]:
    """Return the multipliers of a point except those that are critical at a special point of a kind."""
    if kind is None or not len(places := kind.critical(multipliers)):
        return multipliers
    off = np.abs((multipliers if kind.target is not None else np.abs(multipliers)) - (kind.target or 1.0))
    # known are the coefficients of a polynomial: other roots near a root make it less certain
    known = float(off[places].min() * np.prod(np.minimum(np.delete(off, places), 1.0)))
    return np.delete(multipliers, places) if known < Check.MULTIPLIERS.bound else multipliers


def verify_order(ledger: Ledger, name: str, branch: Branch) -> None:
    """Check that points and special points are in the order of their arclength and distinct."""
    points = branch.points
    last = len(points) - 1
    for number, (a, b) in enumerate(pairwise(points)):
        ends = [branch.ends[place].reason for place in (0, -1) if number == (0 if place == 0 else last - 1)]
        if EndReason.JOINED in ends and a.orbit is b.orbit:
            continue  # a walk that is cut off at its parent repeats its last point
        texts = list(_disorder(a, b))
        spot = Spot(name, f"points {number} to {number + 1}", a.value)
        ledger.enter(Check.ORDER, spot, float(len(texts)), "; ".join(texts))
    for number, (first, second) in enumerate(pairwise(branch.special_points)):
        texts = list(_special_disorder(first, second))
        spot = Spot(name, f"special points {number} and {number + 1}", second.value)
        ledger.enter(Check.ORDER, spot, float(len(texts)), "; ".join(texts))


def _disorder(a: BranchPoint, b: BranchPoint) -> Iterator[str]:
    if not b.arclength > a.arclength:
        yield f"the arclength goes from {a.arclength:.10g} to {b.arclength:.10g}"
    if len(a.x) == len(b.x) and length_of(b.x - a.x) == 0.0:
        yield "both are the same point"


def _special_disorder(a: SpecialPoint, b: SpecialPoint) -> Iterator[str]:
    if b.point.arclength < a.point.arclength:
        yield f"the arclength goes from {a.point.arclength:.10g} to {b.point.arclength:.10g}"
    if (a.kind, a.contact, a.point.arclength) == (b.kind, b.contact, b.point.arclength):
        yield f"the {a.kind.value} occurs twice"


def verify_ends(ledger: Ledger, name: str, track: Track, within: tuple[float, float] | None) -> None:
    """Check where and why a branch begins and ends; `within` is the range over which it was followed, if known."""
    branch = track.branch
    if len(branch.ends) != 2:
        ledger.enter(Check.ENDS, Spot(name, "its ends", math.nan), math.inf, f"{len(branch.ends)} ends are stored")
        return
    for place, end in zip((0, -1), branch.ends, strict=True):
        number = 0 if place == 0 else len(branch.points) - 1
        texts = list(_end_faults(track, place, end, within))
        ledger.enter(
            Check.ENDS, Spot(name, f"point {number}", branch.points[place].value), float(len(texts)), "; ".join(texts)
        )
    if within is not None:
        low, high = within
        slack = _SAME * (abs(low) + abs(high))
        for number, point in enumerate(branch.points):
            outside = not low - slack <= point.value <= high + slack
            if outside:
                detail = f"it lies outside the range from {low:.10g} to {high:.10g}"
                ledger.enter(Check.ENDS, Spot(name, f"point {number}", point.value), 1.0, detail)


def _end_faults(track: Track, place: int, end: End, within: tuple[float, float] | None) -> Iterator[str]:
    branch, point = track.branch, track.branch.points[place]
    scale = abs(point.value / point.x[-1]) if point.x[-1] else 1.0
    same = _SAME * (abs(point.value) + scale)
    said = f'"{end.reason.value}, at {end.value:.10g}"'
    if end.reason in _AT_LAST_POINT and not abs(end.value - point.value) <= same:
        yield f"{said}, but the branch ends at {point.value:.10g}"
        return
    match end.reason:
        case EndReason.RANGE | EndReason.TURNED_BACK:
            if within is not None and min(abs(end.value - bound) for bound in within) > same:
                yield f"{said}, where the range is from {within[0]:.10g} to {within[1]:.10g}"
            origin = min(branch.points, key=lambda each: abs(each.arclength))
            way = -1.0 if place == 0 else 1.0
            ahead = (point.value - origin.value) * float(origin.tangent[-1]) * way
            if end.reason is EndReason.TURNED_BACK and ahead > 0.0:
                yield f"{said}, but it lies on the other side"
        case EndReason.CLOSED:
            if _apart(branch.points[0], branch.points[-1]) > _CLOSED:
                yield f"{said}, but its last point is not its first"
        case EndReason.JOINED:
            if not abs(end.value - point.value) <= _BEYOND * (abs(point.value) + scale):
                yield f"{said}, but the branch ends at {point.value:.10g}"
            elif not _may_join(track, point):
                yield f"{said}, but no other branch is near its end"
        case EndReason.POINTS:
            count = sum(each.arclength * (-1.0 if place == 0 else 1.0) > 0.0 for each in branch.points)
            if end.detail and not end.detail.endswith(f" {count}"):
                yield f"{said} ({end.detail}), but it has {count} points"
        case _:
            pass


def _apart(a: BranchPoint, b: BranchPoint) -> float:
    if len(a.x) == len(b.x):
        return length_of(a.x - b.x)
    return float(np.abs(a.orbit.state - b.orbit.state).max()) / max(float(np.abs(a.orbit.state).max()), 1e-300)


def _may_join(track: Track, point: BranchPoint) -> bool:
    """Return whether a branch may join another here: its motion nearly has half its period, or branches cross."""
    try:
        if point.orbit.period % 2 == 0 and float(np.abs(halves_apart(point)).max()) < _NEAR:
            return True
        return track.regularity(point) < CROSSING
    except NumericalError:
        return False


def _verify_gaps(ledger: Ledger, name: str, track: Track) -> None:
    """Check the gaps between neighbours, and the changes over them."""
    for number, (a, b, special) in enumerate(steps_of(track.branch)):
        spot = Spot(name, f"points {number} to {number + 1}", a.value)
        knots = [a, *(each.point for each in special), b]
        ledger.enter(Check.GAPS, spot, max(gap(track, *pair) for pair in pairwise(knots)))
        texts = list(unexplained(a, b, special))
        ledger.enter(Check.COUNTS, spot, float(len(texts)), "; ".join(texts))


def gap(track: Track, a: BranchPoint, b: BranchPoint) -> float:
    """Return how much the branch between two neighbouring points deviates from the cubic through them.

    1 is the largest accepted figure: an orbit between them lies off the cubic through both points by a tenth of their
    distance, or a tangent, at a point or between, is 0.6 rad off the chord. If the figure is larger, the gap is halved.
    It is infinite if there is no orbit between. The distance must also equal the arclength between them within 30 %.
    """
    ahead = b.arclength - a.arclength
    if len(a.x) != len(b.x):  # harmonics may grow along a branch
        coarse, fine = sorted((a, b), key=lambda point: len(point.x))
        corrector = track.corrector_at(fine)
        lifted = lift(coarse, corrector)
        if lifted is None:
            return math.inf
        a, b = (lifted, b) if coarse is a else (a, lifted)
    length = length_of(b.x - a.x)
    # a branch may connect any two points by a long detour
    far = abs(length - ahead) / (_LONGER * abs(ahead) + _TOGETHER)
    return max(far, _gap(track, a, b, 0))


def _gap(track: Track, a: BranchPoint, b: BranchPoint, depth: int) -> float:
    if length_of(b.x - a.x) < _TOGETHER:
        return 0.0
    middle, figure = between(track, a, b)
    if middle is None or figure <= 1.0 or depth == _DEEPEST:
        return figure
    return max(_gap(track, a, middle, depth + 1), _gap(track, middle, b, depth + 1))


def between(track: Track, a: BranchPoint, b: BranchPoint) -> tuple[BranchPoint | None, float]:
    """Return an orbit about half way between two points, and its deviation from that place; see `gap`."""
    chord = b.x - a.x
    length = length_of(chord)
    way, corrector = chord / length, track.corrector_at(a)
    turn = max(_angle(a.tangent, way), _angle(b.tangent, way)) / _TURN
    first = BranchPoint(a.value, a.orbit, a.x, a.tangent, a.determinant, 0.0)
    last = BranchPoint(b.value, b.orbit, b.x, b.tangent, b.determinant, length)
    for share in _SHARES:
        for guess in (hermite(first, last, share), a.x + share * chord):
            try:
                correction = corrector.correct(guess, way)
                if correction is None or length_of(correction.x - guess) > 0.5 * length:
                    continue
                middle = corrector.point(correction, way, a.arclength + share * (b.arclength - a.arclength))
            except NumericalError:
                continue
            off = length_of(correction.x - hermite(first, last, share)) / length / _OFF
            return middle, max(off, turn, _angle(middle.tangent, way) / _TURN)
    return None, math.inf


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the angle between two unit vectors, in radians."""
    return 2.0 * math.asin(min(1.0, length_of(a - b) / 2.0))


def _verify_specials(ledger: Ledger, name: str, track: Track) -> None:
    """Check each special point from both sides."""
    opinions = {}
    for number, special in enumerate(track.branch.special_points):
        spot = Spot(name, f"special point {number} ({special.kind.value})", special.value)
        size = len(special.point.x)
        if size not in opinions:
            opinions[size] = ErrorEstimator(track.corrector(size))
        branch = track.branch
        next_to_it = _neighbours(special, branch, branch.points)
        changes = _neighbours(special, branch, (branch.points[0], branch.points[-1]))
        sides = look(opinions[size], special, next_to_it, changes)
        faults = sides.faults
        if not sides.held and special.kind is Kind.BRANCH_POINT and track.regularity(special.point) < CROSSING:
            faults = ()  # branches cross there, so near another special point that no motion can be corrected nearby
        ledger.enter(Check.SIDES, spot, float(len(faults)), "; ".join(faults))
        if sides.before is not None and sides.after is not None:
            texts = list(nature_faults(track, opinions[size], special, sides.before, sides.after))
            ledger.enter(Check.NATURE, spot, float(len(texts)), "; ".join(texts))
        if sides.value is None or special.uncertainty == math.inf:
            ledger.leave_unlocated(spot)
        else:
            _enter_location(ledger, spot, special, sides.value)


def _neighbours(special: SpecialPoint, branch: Branch, points: Sequence[BranchPoint]) -> list[BranchPoint]:
    """Return the neighbours of a special point: points, or other special points that are not at the same place.

    In a symmetric motion both sides of a gap graze at once; there is nothing between the two.
    """
    others = (each for each in branch.special_points if each is not special and not _is_one_place(each, special))
    knots = [*points, *(each.point for each in others)]
    here = special.point.arclength
    before = max((knot for knot in knots if knot.arclength <= here), key=lambda knot: knot.arclength, default=None)
    after = min((knot for knot in knots if knot.arclength > here), key=lambda knot: knot.arclength, default=None)
    return [each for each in (before, after) if each is not None]


def _is_one_place(a: SpecialPoint, b: SpecialPoint) -> bool:
    """Return whether two contacts graze at once."""
    both_graze = a.kind is b.kind is Kind.GRAZING and a.contact != b.contact
    return both_graze and abs(a.point.arclength - b.point.arclength) < _ONE_PLACE


def _enter_location(ledger: Ledger, spot: Spot, special: SpecialPoint, found: float) -> None:
    """Enter the distance of a special point from its second location, in units of its stated error."""
    off = abs(found - special.value)
    width = abs(special.value / special.point.x[-1]) if special.point.x[-1] else 1.0
    stated = special.uncertainty
    error = stated + width * (_INTERPOLATED if special.kind is Kind.BRANCH_POINT else _EXACT)
    detail = f"found again at {found:.12g}, {off:.2g} away; its stated error is {stated:.2g}"
    least, most = _LEAST * max(abs(special.value), width), max(_MANY * off, _MOST * (abs(special.value) + width))
    if not least <= stated <= most:
        detail = f"{detail}, which is {'less than rounding' if stated < least else 'implausibly large'}"
        error = 0.0
    ledger.enter(Check.LOCATION, spot, off / error if error > 0.0 else math.inf, detail)


def confirm(branch: Branch) -> None:
    """Verify a branch.

    Raises
    ------
    VerificationError
        If a check fails.
    """
    ledger = Ledger()
    verify_branches(ledger, [(f"P{branch.period}-1", branch)])
    found = ledger.verification
    if not found.ok:
        raise VerificationError(f"the branch was followed, but {found.words}", found)
