"""Check that the points of a branch are in order and distinct, and that it ends where and why it is stated."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.doubling import halves_apart
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import length_of
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import NumericalError
from gapwalk.verification.verification import Check, Ledger, Spot
from gapwalk.verification.walk_again import CROSSING, Track

_SAME = 1e-9  # relative difference below which two values of the parameter are equal
_CLOSED = 1e-5  # largest distance between the first and the last point of a closed branch
_NEAR = 0.1  # difference of the halves of a motion below which a doubled branch may step onto its parent
_BEYOND = 0.02  # distance, in scales of the parameter, by which a junction may lie beyond the last point

_AT_LAST_POINT = frozenset(EndReason) - {EndReason.JOINED}


def verify_order(ledger: Ledger, name: str, branch: Branch) -> None:
    """Check that points and special points are in the order of their arclength and distinct."""
    points = branch.points
    last = len(points) - 1
    for number, (a, b) in enumerate(pairwise(points)):
        ends = [branch.ends[place].reason for place in (0, -1) if number == (0 if place == 0 else last - 1)]
        if EndReason.JOINED in ends and a.orbit is b.orbit:
            continue  # a walk that is cut off at its parent repeats its last point
        texts = list(_disorder(a, b))
        ledger.enter(Check.ORDER, _between(name, number, a), float(len(texts)), "; ".join(texts))
    for number, (first, second) in enumerate(pairwise(branch.special_points)):
        texts = list(_special_disorder(first, second))
        spot = Spot(name, f"special points {number} and {number + 1}", second.value)
        ledger.enter(Check.ORDER, spot, float(len(texts)), "; ".join(texts))


def _between(name: str, number: int, point: BranchPoint) -> Spot:
    return Spot(name, f"points {number} to {number + 1}", point.value)


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
        if point.orbit.period % 2 == 0 and float(np.abs(halves_apart(point.orbit)).max()) < _NEAR:
            return True
        return track.regularity(point) < CROSSING
    except NumericalError:
        return False
