"""Verification of a diagram: its branches are distinct and complete, and their ends are where they are said to be.

The end of a branch must share its orbit with the branch to which it is attached. Each branch that begins at another one
must be in a complete diagram, and none twice.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.branch_start import BranchStart, halves_apart, switch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin
from gapwalk.bifurcation.membership import Curve, lies_on
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.verification import Check, Ledger, Spot

_POINTS = 6  # number of points of a branch that is searched for: enough to distinguish it from others
_CLOSE = 1e-2  # difference of the halves of an orbit below which a doubled branch may end before its parent
_TRUNCATED = 30.0  # allowed difference of orbits, in truncation errors, which are not equal on both branches


def verify_distinct(ledger: Ledger, branches: Sequence[tuple[str, Branch]]) -> None:
    """Check that no two of some branches of one system are the same."""
    for (name, one), (other_name, other) in combinations(branches, 2):
        if one.period == other.period:
            same = _overlap(one, other) and _holds_middle(one, other) and _holds_middle(other, one)
            spot = Spot(other_name, "its middle", _middle(other).system[other.parameter])
            ledger.enter(Check.TREE, spot, math.inf if same else 0.0, f"it is the branch {name} again" if same else "")


def _overlap(one: Branch, other: Branch) -> bool:
    """Return whether the ranges of two branches overlap, before they are compared."""
    return one.values.min() <= other.values.max() and other.values.min() <= one.values.max()


def _holds_middle(branch: Branch, other: Branch) -> bool:
    return lies_on(branch, _middle(other))


def _middle(branch: Branch) -> Orbit:
    return branch.points[len(branch.points) // 2].orbit


def verify_whole(ledger: Ledger, diagram: Diagram) -> None:
    """Check that a complete diagram lacks no branch, neither in the numbering of names nor at special points."""
    counts: Counter[int] = Counter()
    for member in diagram.members:
        counts[member.period] += 1
        name = f"P{member.period}-{counts[member.period]}"
        detail = "" if member.name == name else f"it is in the place of {name}, which is missing"
        ledger.enter(Check.TREE, Spot(member.name, "its name", math.nan), math.inf if detail else 0.0, detail)
    if diagram.max_period is None:
        ledger.note("whether branches are missing is not verified: the longest requested period is not stored")
        return
    curves = {member.name: Curve(member.branch) for member in diagram.members}
    for member in diagram.members:
        for index, special in enumerate(member.branch.special_points):
            period = member.period * special.kind.times
            if not special.kind.ways or period > diagram.max_period or _is_told(diagram, member, index):
                continue
            fellows = [curves[each.name] for each in diagram.members if each.period == period]
            missing = _is_missing(diagram, special, fellows)
            spot = Spot(member.name, f"special point {index} ({special.kind.value})", special.value)
            detail = f"a branch of period {period} begins there, and is missing"
            ledger.enter(Check.TREE, spot, math.inf if missing else 0.0, detail if missing else "")


def _is_told(diagram: Diagram, member: DiagramBranch, index: int) -> bool:
    """Return whether all branches that begin at a special point are present or reported as failures."""
    special = member.branch.special_points[index]
    failed = any(f"{special.value:.10g}" in text for text in diagram.failures)
    return failed or len(diagram.attached(member.name, index)) >= special.kind.ways


def _is_missing(diagram: Diagram, special: SpecialPoint, fellows: Sequence[Curve]) -> bool:
    """Return whether a branch that begins at a special point lies on none of the present ones."""
    try:
        method = special.orbit.posed_in(len(special.point.x) - 1)
        beginnings = switch(special, diagram.parameter, diagram.within, method)
        beginnings = [_beginning(beginning) for beginning in beginnings]
    except (NumericalError, ModelError):
        return False
    found = [orbit for orbit in beginnings if orbit is not None]
    return any(not any(curve.holds(orbit) for curve in fellows) for orbit in found)


def _beginning(beginning: BranchStart) -> Orbit | None:
    """Return a motion of a branch a few points from its beginning; None if it has none."""
    points = [point for point, _ in BranchTracer(beginning, WalkOptions(max_points=_POINTS))]
    return points[len(points) // 2].orbit if points else None


def verify_tree(ledger: Ledger, diagram: Diagram) -> None:
    """Check where each member of a diagram is attached to others."""
    names = {member.name: member for member in diagram.members}
    for member in diagram.members:
        points = member.branch.points
        for origin, end, number in ((member.begins, points[0], 0), (member.joins, points[-1], len(points) - 1)):
            if origin is not None:
                _verify_end(ledger, Spot(member.name, f"point {number}", end.value), names, origin, member, end)


def _verify_end(
    ledger: Ledger, spot: Spot, names: dict[str, DiagramBranch], origin: Origin, member: DiagramBranch, end: BranchPoint
) -> None:
    parent = names.get(origin.parent)
    if parent is None or origin.special >= len(parent.branch.special_points):
        ledger.enter(Check.TREE, spot, np.inf, f"there is no special point {origin.special} on {origin.parent}")
        return
    special = parent.branch.special_points[origin.special]
    detail = f"from special point {origin.special} of {origin.parent}"
    if not special.kind.ways or member.period != parent.period * special.kind.times:
        ledger.enter(Check.TREE, spot, np.inf, f"{detail}, a {special.kind.value} of period {parent.period}")
        return
    apart = _apart(special, end.orbit)
    slack = 0.0
    # it may end just before its parent, whose orbit is the mean of its halves
    if special.kind.times == 2 and origin == member.joins:
        halves = float(np.abs(halves_apart(end)).max())
        slack = halves if halves < _CLOSE else 0.0
    neglected = _TRUNCATED * max(special.orbit.truncation, end.orbit.truncation)
    ledger.enter(Check.TREE, spot, max(0.0, apart - slack - neglected), detail)


def _apart(special: SpecialPoint, orbit: Orbit) -> float:
    """Return the distance of an orbit from that of a special point, in any phase, relative to its size."""
    states = special.orbit.strobes(special.orbit.period)
    return float(np.abs(states - orbit.state).max(axis=1).min()) / (1.0 + float(np.abs(orbit.state).max()))
