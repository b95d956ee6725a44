"""Verification of a branch: its orbits, the gaps between them, its ends, its special points, and what they account for.

A branch must connect each of its points to the next: orbits are sought between them, and must lie there. Its points
must be in order and distinct, and it must end where and why it is stated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import halves_apart, lift, period_of
from gapwalk.bifurcation.detector import joining_points, steps_of, unexplained
from gapwalk.bifurcation.special_point import ErrorEstimator, Kind, SpecialPoint
from gapwalk.bifurcation.steps_over_corners import REACH, smooth_between
from gapwalk.continuation.corrector import Corrector, hermite, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, angle
from gapwalk.errors import NumericalError, VerificationError
from gapwalk.orbit.orbit import describe_switch, phases
from gapwalk.verification.verification import Advance, Check, Ledger, Spot
from gapwalk.verification.verify_orbits import verify_orbits, verify_truncated
from gapwalk.verification.verify_special_points import CROSSING, Track, ends_at, verify_special_points

_OFF = 0.1  # largest distance of the orbit between from the cubic through both points, in distances of the points
_TURN = 0.6  # largest angle between a tangent and the chord, in radians
_DEEPEST = 7  # largest number of successive halvings of a gap
_SHARPEST = 14  # the same where a contact grazes at a force that jumps: the branch turns within 1e-6 beside it
_LONGER = 0.3  # largest difference between the distance of two points and the arclength between them, in steps
_TOGETHER = 1e-6  # distance below which two points are one
_ON_SIDE = 1e-3  # share of a gap at which the tangent on one side of a corner is taken
_SHARES = (0.5, 0.4, 0.62)  # places at which an orbit is sought: close to a crossing of branches correction fails
_SAME = 1e-9  # relative difference below which two values of the parameter are equal
_CLOSED = 1e-5  # largest distance between the first and the last point of a closed branch
_NEAR = 0.1  # difference of the halves of a motion below which a doubled branch may step onto its parent
_AHEAD = 3.0  # factor on the extrapolated distance to a junction within which it must be
_BEYOND = 0.02  # distance, in scales of the parameter, by which a junction may lie beyond the last point

_AT_LAST_POINT = frozenset(EndReason) - {EndReason.JOINED}


def verify_branches(
    ledger: Ledger,
    branches: Sequence[tuple[str, Branch]],
    advance: Advance | None = None,
    within: tuple[float, float] | None = None,
) -> None:
    """Enter all checks of some branches of one structure, by their names."""
    tracks = [Track(name, branch) for name, branch in branches]
    verify_orbits(ledger, [track for track in tracks if track.is_exact], advance)
    for done, track in enumerate(tracks):
        if advance is not None:
            advance("branches", done, len(tracks))
        if not track.is_exact:
            verify_truncated(ledger, track)
        _verify_order(ledger, track)
        _verify_periods(ledger, track)
        _verify_ends(ledger, track, within)
        _verify_gaps(ledger, track)
        verify_special_points(ledger, track)
        ledger.points += len(track.branch.points)
        ledger.special_points += len(track.branch.special_points)


def _has_no_width(graze: SpecialPoint) -> bool:
    """Return True if a contact grazes whose two sides are at one place."""
    orbit = graze.orbit
    places = [(contact, side * place) for contact, side, place in orbit.system.breakpoints]
    return any(
        places.count(place) == 2 and describe_switch(orbit, switch) == graze.contact
        for switch, place in enumerate(places)
    )


def _verify_order(ledger: Ledger, track: Track) -> None:
    """Check that points and special points are in the order of their arclength and distinct."""
    name, branch, points = track.name, track.branch, track.branch.points
    last = len(points) - 1
    for number, (a, b) in enumerate(pairwise(points)):
        ends = [branch.ends[place].reason for place in (0, -1) if number == (0 if place == 0 else last - 1)]
        if np.array_equal(a.x, b.x) and {*ends} & {EndReason.JOINED, EndReason.STEP, EndReason.WITHIN_ROUNDING}:
            continue  # a walk that is cut off behind special points repeats its last point
        faults = []
        if not b.arclength > a.arclength:
            faults.append(f"the arclength goes from {a.arclength:.10g} to {b.arclength:.10g}")
        if len(a.x) == len(b.x) and length_of(b.x - a.x) == 0.0:
            faults.append("both are the same point")
        ledger.judge(Check.ORDER, Spot(name, f"points {number} to {number + 1}", a.value), faults)
    for number, (a, b) in enumerate(pairwise(branch.special_points)):
        faults = []
        if b.point.arclength < a.point.arclength:
            faults.append(f"the arclength goes from {a.point.arclength:.10g} to {b.point.arclength:.10g}")
        is_same = (a.kind, a.contact, a.point.arclength) == (b.kind, b.contact, b.point.arclength)
        if is_same and not _has_no_width(a):  # there a motion may touch it from one side and then from the other
            faults.append(f"the {a.kind.value} occurs twice")
        ledger.judge(Check.ORDER, Spot(name, f"special points {number} and {number + 1}", b.value), faults)


def _verify_periods(ledger: Ledger, track: Track) -> None:
    """Check that no motion has a shorter period than the branch; where it joins its parent, the period is half."""
    points = track.branch.points
    for number, point in enumerate(points if track.branch.period > 1 else ()):
        try:
            found = period_of(point)
        except NumericalError:
            continue  # its orbit cannot be followed, which is entered elsewhere
        # a branch that joins its parent may repeat its last point
        ends = [each for each in (points[0], points[-1]) if each.orbit is point.orbit]
        least = track.branch.period // 2 if ends and not track.branch.period % 2 else track.branch.period
        faults = [f"its motion repeats after {found} periods, where the branch is of period {track.branch.period}"]
        spot = Spot(track.name, f"point {number}", point.value)
        ledger.judge(Check.ORDER, spot, faults if found < least else [])


def _verify_ends(ledger: Ledger, track: Track, within: tuple[float, float] | None) -> None:
    """Check where and why a branch begins and ends; `within` is the range over which it was followed, if known."""
    name, branch = track.name, track.branch
    if len(branch.ends) != 2:
        ledger.enter(Check.ENDS, Spot(name, "its ends", math.nan), math.inf, f"{len(branch.ends)} ends are stored")
        return
    for place, end in zip((0, -1), branch.ends, strict=True):
        number = 0 if place == 0 else len(branch.points) - 1
        spot = Spot(name, f"point {number}", branch.points[place].value)
        ledger.judge(Check.ENDS, spot, _end_faults(track, place, end, within))
    if within is not None:
        low, high = within
        slack = _SAME * (abs(low) + abs(high))
        for number, point in enumerate(branch.points):
            if not low - slack <= point.value <= high + slack:
                detail = f"it lies outside the range from {low:.10g} to {high:.10g}"
                ledger.enter(Check.ENDS, Spot(name, f"point {number}", point.value), 1.0, detail)


def _end_faults(track: Track, place: int, end: End, within: tuple[float, float] | None) -> Iterator[str]:
    branch, point = track.branch, track.branch.points[place]
    scale = abs(point.value / point.x[-1]) if point.x[-1] else 1.0
    same = _SAME * (abs(point.value) + scale)
    said = f'"{end.reason.value}, at {end.value:.10g}"'
    ahead = REACH * scale if end.reason is EndReason.JUMPS else 0.0
    if end.reason in _AT_LAST_POINT and not abs(end.value - point.value) <= same + ahead:
        yield f"{said}, but the branch ends at {point.value:.10g}"
        return
    match end.reason:
        case EndReason.RANGE | EndReason.TURNED_BACK | EndReason.TABLE:
            tables = point.orbit.system.structure.pace_limits
            limits = (tables.low, tables.high) if end.reason is EndReason.TABLE else within
            if limits is not None and min(abs(end.value - bound) for bound in limits) > same:
                yield f"{said}, where the range is from {limits[0]:.10g} to {limits[1]:.10g}"
            origin = min(branch.points, key=lambda each: abs(each.arclength))
            way = -1.0 if place == 0 else 1.0
            ahead = (point.value - origin.value) * float(origin.tangent[-1]) * way
            if end.reason is EndReason.TURNED_BACK and ahead > 0.0:
                yield f"{said}, but it is ahead of the start, where the branch was walked to"
        case EndReason.CLOSED:
            a, b = branch.points[0].orbit, branch.points[-1].orbit
            places = phases(a)  # a motion may come back with another phase
            apart = float(np.abs(places - b.state).max(axis=1).min()) / max(float(np.abs(places).max()), 1e-300)
            if apart > _CLOSED:
                yield f"{said}, but its last motion is not its first"
        case EndReason.JOINED:
            if within is not None and not within[0] - same <= end.value <= within[1] + same:
                yield f"{said}, where the range is from {within[0]:.10g} to {within[1]:.10g}"
            elif not abs(end.value - point.value) <= _BEYOND * (abs(point.value) + scale):
                yield f"{said}, but the branch ends at {point.value:.10g}"
            elif not _may_join(track, point):
                yield f"{said}, but no other branch is near its end"
            elif abs(end.value - point.value) > same + _AHEAD * _left(branch.points if place else branch.points[::-1]):
                yield f"{said}, but the branch, which ends at {point.value:.10g}, does not lead there"
        case EndReason.POINTS:
            count = sum(each.arclength * (-1.0 if place == 0 else 1.0) > 0.0 for each in branch.points)
            if end.detail and not end.detail.endswith(f" {count}"):
                yield f"{said} ({end.detail}), but it has {count} points"
        case _:
            pass


def _may_join(track: Track, point: BranchPoint) -> bool:
    """Return True if a branch may join another here: its motion nearly has half its period, or branches cross."""
    with suppress(NumericalError):
        if point.orbit.period % 2 == 0 and float(np.abs(halves_apart(point)).max()) < _NEAR:
            return True
        return track.regularity(point) < CROSSING
    return False


def _left(points: Sequence[BranchPoint]) -> float:
    """Return how far the parameter is from where the halves of a doubled motion meet, beyond the last of some points.

    It is extrapolated with the difference of the halves. If the parameter is quadratic in that, that is too far.
    """
    last = points[-1]
    before = next((each for each in reversed(points) if each.orbit is not last.orbit), last)
    if last.orbit.period % 2 or before is last:
        return math.inf
    try:
        a, b = (float(np.linalg.norm(halves_apart(each))) for each in (before, last))
    except NumericalError:
        return math.inf
    return abs(last.value - before.value) * b / (a - b) if b < a else math.inf


def _verify_gaps(ledger: Ledger, track: Track) -> None:
    """Check the gaps between neighbours, and the changes over them."""
    for number, (a, b, within) in enumerate(steps_of(track.branch)):
        special = [each for each in within if not ends_at(track.branch, each)]
        spot = Spot(track.name, f"points {number} to {number + 1}", a.value)
        knots = [a, *(each.point for each in special), b]
        corners = [each.point for each in special if not each.kind.by_multipliers]
        grazes = [each.point for each in special if each.kind is Kind.GRAZING and each.is_corner]
        figures, step = [], b.arclength - a.arclength  # arclengths in a step are measured along it, not around a turn
        for pair in pairwise(knots):
            figure = _gap(track, *_one_sided(track, pair, corners), step, _SHARPEST if grazes else _DEEPEST)
            if figure == math.inf or (figure > 1.0 and any(knot is graze for knot in pair for graze in grazes)):
                figure = _shot_finer(track, *pair, step, grazes)
            figures.append(figure)
        ledger.enter(Check.GAPS, spot, max(figures))
        ledger.judge(Check.COUNTS, spot, unexplained(a, b, special, joining_points(track.branch)))


def _one_sided(
    track: Track, pair: tuple[BranchPoint, BranchPoint], corners: Sequence[BranchPoint]
) -> tuple[BranchPoint, BranchPoint]:
    """Return two neighbours; one at which the branch may have a corner, with its tangent on the side of the other."""
    # Where the sequence of slip and stick changes, the tangent that is stored is that of one side.
    a, b = pair
    if len(a.x) != len(b.x) or length_of(b.x - a.x) < _TOGETHER:
        return pair
    way = (b.x - a.x) / length_of(b.x - a.x)
    sided = []
    for knot, other in ((a, b), (b, a)):
        if any(knot is corner for corner in corners):
            with suppress(NumericalError):
                corrector = track.corrector_at(knot)
                correction = corrector.correct(knot.x + _ON_SIDE * (other.x - knot.x), way)
                if correction is not None:
                    knot = replace(knot, tangent=corrector.point(correction, way, 0.0).tangent)
        sided.append(knot)
    return sided[0], sided[1]


def _gap(track: Track, a: BranchPoint, b: BranchPoint, step: float, deepest: int) -> float:
    """Return the deviation of the branch between two neighbouring points from the cubic through them."""
    # 1 is the largest accepted figure: an orbit between them is off the cubic through both points by a tenth of their
    # distance, or a tangent, at a point or between, is 0.6 rad off the chord. If the figure is larger, the gap is
    # halved, up to `deepest` times. It is infinite if there is no orbit between. The distance must also equal the
    # arclength between them within 30 % of their `step` of the walk.
    ahead = b.arclength - a.arclength
    if len(a.x) != len(b.x):  # harmonics may grow along a branch
        coarse, fine = sorted((a, b), key=lambda point: len(point.x))
        lifted = lift(coarse, track.corrector_at(fine))
        if lifted is None:
            return math.inf
        a, b = (lifted, b) if coarse is a else (a, lifted)
    far = _detour(a, b, ahead, step)
    corrector, a, b = smooth_between(track.corrector_at(a), a, b)
    # lengths differ from section to section, and the step may have been taken in either
    return max(min(far, _detour(a, b, ahead, step)), _deviation(corrector, a, b, deepest))


def _detour(a: BranchPoint, b: BranchPoint, ahead: float, step: float) -> float:
    """Return the difference of the distance of two points and an arclength; 1 is the largest accepted figure."""
    # A branch may connect any two points by a long detour.
    return abs(length_of(b.x - a.x) - ahead) / (_LONGER * abs(step) + _TOGETHER)


def _shot_finer(track: Track, a: BranchPoint, b: BranchPoint, step: float, grazes: Sequence[BranchPoint]) -> float:
    """Return the figure of `_gap` for two neighbours of which one may graze a rigid stop, shot in one segment more."""
    # Beside such a graze motions grow 1e6 times and more: one segment does not determine them to its tolerance. The
    # branch turns at the graze itself, and the stored tangent may be that of its other side.
    try:
        second = ErrorEstimator(track.corrector_at(a))
        ends = [second.at(each) for each in (a, b)]
    except NumericalError:
        return math.inf
    way = ends[1].x - ends[0].x
    way /= length_of(way)
    ends = [
        replace(end, tangent=way) if any(knot is graze for graze in grazes) else end
        for knot, end in zip((a, b), ends, strict=True)
    ]
    return max(_detour(a, b, b.arclength - a.arclength, step), _deviation(second.corrector, ends[0], ends[1], _DEEPEST))


def _deviation(corrector: Corrector, a: BranchPoint, b: BranchPoint, halvings: int) -> float:
    """Return the deviation from the cubic, of a gap that may be halved so many times."""
    if length_of(b.x - a.x) < _TOGETHER:
        return 0.0
    middle, figure = _between(corrector, a, b)
    if middle is None or figure <= 1.0 or halvings == 0:
        return figure
    return max(_deviation(corrector, a, middle, halvings - 1), _deviation(corrector, middle, b, halvings - 1))


def _between(corrector: Corrector, a: BranchPoint, b: BranchPoint) -> tuple[BranchPoint | None, float]:
    """Return an orbit about half-way between two points, and its deviation from the interpolated one; see `_gap`."""
    chord = b.x - a.x
    length = length_of(chord)
    way = chord / length
    turn = max(angle(a.tangent, way), angle(b.tangent, way)) / _TURN
    first = BranchPoint(a.value, a.orbit, a.x, a.tangent, a.determinant, 0.0)
    last = BranchPoint(b.value, b.orbit, b.x, b.tangent, b.determinant, length)
    for share in _SHARES:
        # the tangent at a corner may be that of its other side
        by_first = a.x + share * length * a.tangent + share**2 * (chord - length * a.tangent)
        by_last = b.x - (1.0 - share) * length * b.tangent - (1.0 - share) ** 2 * (chord - length * b.tangent)
        for guess in (hermite(first, last, share), a.x + share * chord, by_last, by_first):
            try:
                correction = corrector.correct(guess, way)
                if correction is None or length_of(correction.x - guess) > 0.5 * length:
                    continue
                middle = corrector.point(correction, way, a.arclength + share * (b.arclength - a.arclength))
            except NumericalError:
                continue
            off = length_of(correction.x - hermite(first, last, share)) / length / _OFF
            return middle, max(off, turn, angle(middle.tangent, way) / _TURN)
    return None, math.inf


def confirm(branch: Branch) -> None:
    """Verify a branch."""
    ledger = Ledger()
    verify_branches(ledger, [(f"P{branch.period}-1", branch)])
    found = ledger.verification
    if not found.ok:
        raise VerificationError(f"the branch was followed, but {found.words}", found)
