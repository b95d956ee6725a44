"""Whether a diagram that calls itself complete is whole: each branch that leaves another is there, and none twice."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import combinations

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.departure import Departure
from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.bifurcation.membership import Curve, lies_on
from gapwalk.bifurcation.switch import switch
from gapwalk.bifurcation.trail import Trail
from gapwalk.continuation.options import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.verification import Check, Ledger, Spot

_POINTS = 6  # of a branch that is looked for: far enough from its beginning to tell it from others


def verify_distinct(ledger: Ledger, branches: Sequence[tuple[str, Branch]]) -> None:
    """Check that no two of some branches of one system are the same."""
    for (name, one), (other_name, other) in combinations(branches, 2):
        if one.period == other.period:
            same = _overlap(one, other) and _holds_middle(one, other) and _holds_middle(other, one)
            spot = Spot(other_name, "its middle", _middle(other).system[other.parameter])
            ledger.enter(Check.TREE, spot, math.inf if same else 0.0, f"it is the branch {name} again" if same else "")


def verify_whole(ledger: Ledger, diagram: Diagram) -> None:
    """Check that a complete diagram lacks no branch: none in the order of their names, none that leaves another."""
    counts: Counter[int] = Counter()
    for limb in diagram.limbs:
        counts[limb.period] += 1
        name = f"P{limb.period}-{counts[limb.period]}"
        detail = "" if limb.name == name else f"it is in the place of {name}, which is missing"
        ledger.enter(Check.TREE, Spot(limb.name, "its name", math.nan), math.inf if detail else 0.0, detail)
    if diagram.max_period is None:
        ledger.note("whether branches are missing is not verified: it is not told how long periods were asked for")
        return
    curves = {limb.name: Curve(limb.branch) for limb in diagram.limbs}
    for limb in diagram.limbs:
        for index, special in enumerate(limb.branch.special_points):
            period = limb.period * special.kind.times
            if not special.kind.ways or period > diagram.max_period or _is_told(diagram, limb, index):
                continue
            fellows = [curves[each.name] for each in diagram.limbs if each.period == period]
            missing = _is_missing(diagram, special, fellows)
            spot = Spot(limb.name, f"special point {index} ({special.kind.value})", special.value)
            detail = f"a branch of period {period} leaves it, and is not there"
            ledger.enter(Check.TREE, spot, math.inf if missing else 0.0, detail if missing else "")


def _is_told(diagram: Diagram, limb: Limb, index: int) -> bool:
    """Whether all that leaves a special point is there, or the diagram says that it could not be walked."""
    special = limb.branch.special_points[index]
    failed = any(f"{special.value:.10g}" in text for text in diagram.failures)
    return failed or len(diagram.attached(limb.name, index)) >= special.kind.ways


def _is_missing(diagram: Diagram, special: SpecialPoint, fellows: Sequence[Curve]) -> bool:
    """Whether a branch that leaves a special point lies on none of those that are there."""
    try:
        method = special.orbit.posed_in(len(special.point.x) - 1)
        departures = switch(special, diagram.parameter, diagram.within, method)
        beginnings = [_beginning(departure) for departure in departures]
    except (NumericalError, ModelError):
        return False
    found = [orbit for orbit in beginnings if orbit is not None]
    return any(not any(curve.holds(orbit) for curve in fellows) for orbit in found)


def _beginning(departure: Departure) -> Orbit | None:
    """A motion of a branch a few points from its beginning; None if it has none."""
    points = [point for point, _ in Trail(departure, WalkOptions(max_points=_POINTS))]
    return points[len(points) // 2].orbit if points else None


def _overlap(one: Branch, other: Branch) -> bool:
    """Whether the ranges of two branches overlap, before they are compared."""
    return one.values.min() <= other.values.max() and other.values.min() <= one.values.max()


def _holds_middle(branch: Branch, other: Branch) -> bool:
    return lies_on(branch, _middle(other))


def _middle(branch: Branch) -> Orbit:
    return branch.points[len(branch.points) // 2].orbit
