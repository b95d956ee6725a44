"""Verification of a diagram: its branches are distinct and complete, and their ends are where the diagram states them.

The end of a branch must share its orbit with the branch to which it is attached. Each branch that begins at another one
must be in a complete diagram, and none twice.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import halves_apart, switch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.verification.branch_corrector import special_spot
from gapwalk.verification.verification import Check, Ledger, Spot

_POINTS = 6  # number of points of a branch that is searched for: enough to distinguish it from others
_CLOSE = 1e-2  # difference of the halves of an orbit below which a doubled branch may end before its parent
_TRUNCATED = 30.0  # allowed difference of orbits, in truncation errors, which are not equal on both branches


def verify_distinct(ledger: Ledger, branches: Sequence[tuple[str, Branch]]) -> None:
    """Check that no two of some branches of one system are the same."""
    for (name, one), (other_name, other) in combinations(branches, 2):
        if one.period != other.period:
            continue
        middle, others = (branch.points[len(branch.points) // 2].orbit for branch in (one, other))
        overlap = one.values.min() <= other.values.max() and other.values.min() <= one.values.max()
        same = overlap and lies_on(one, others) and lies_on(other, middle)
        spot = Spot(other_name, "its middle", others.system[other.parameter])
        ledger.enter(Check.TREE, spot, math.inf if same else 0.0, f"it is the branch {name} again" if same else "")


def verify_whole(ledger: Ledger, diagram: Diagram) -> None:
    """Check that a complete diagram lacks no branch, neither in the numbering of names nor at special points."""
    counts: Counter[int] = Counter()
    for member in diagram.members:
        counts[member.period] += 1
        name = f"P{member.period}-{counts[member.period]}"
        detail = f"by its number it should be {name}: a branch of period {member.period} before it is missing"
        detail = "" if member.name == name else detail
        ledger.enter(Check.TREE, Spot(member.name, "its name", math.nan), math.inf if detail else 0.0, detail)
    if diagram.max_period is None:
        ledger.note("whether branches are missing is not verified: the longest requested period is not stored")
        return
    curves = {member.name: Curve(member.branch) for member in diagram.members}
    for member in diagram.members:
        for index, special in enumerate(member.branch.special_points):
            period = member.period * special.kind.times
            failed = any(f"{special.value:.10g}" in text for text in diagram.failures)
            present = len(diagram.attached(member.name, index)) >= special.ways  # also if it has no ways
            if period > diagram.max_period or failed or present:
                continue
            fellows = [curves[each.name] for each in diagram.members if each.period == period]
            missing = _is_missing(diagram, special, fellows)
            detail = f"a branch of period {period} begins there, and is missing" if missing else ""
            ledger.enter(Check.TREE, special_spot(member.name, index, special), math.inf if missing else 0.0, detail)


def _is_missing(diagram: Diagram, special: SpecialPoint, fellows: Sequence[Curve]) -> bool:
    """Return True if a branch that begins at a special point is not one of the present branches."""
    try:
        method = special.orbit.posed_in(len(special.point.x) - 1)
        starts = switch(special, diagram.parameter, diagram.within, method)
        walks = [[point for point, _ in BranchTracer(start, WalkOptions(max_points=_POINTS))] for start in starts]
    except (NumericalError, ModelError):
        return False
    found = [points[len(points) // 2].orbit for points in walks if points]
    return any(not any(curve.holds(orbit) for curve in fellows) for orbit in found)


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
    jumps = special.doubles and not special.ways and origin == member.joins
    times = 2 if jumps else special.kind.times
    if not (special.ways or jumps) or member.period != parent.period * times:
        ledger.enter(Check.TREE, spot, np.inf, f"{detail}, a {special.kind.value} of period {parent.period}")
        return
    # in any phase, relative to its size
    state, states = end.orbit.state, special.orbit.strobes(special.orbit.period)
    apart = float(np.abs(states - state).max(axis=1).min()) / (1.0 + float(np.abs(state).max()))
    slack = 0.0
    # it may end just before its parent, whose orbit is the mean of its halves
    if times == 2 and origin == member.joins:
        halves = float(np.abs(halves_apart(end)).max())
        slack = halves if halves < _CLOSE else 0.0
    neglected = _TRUNCATED * max(special.orbit.truncation, end.orbit.truncation)
    ledger.enter(Check.TREE, spot, max(0.0, apart - slack - neglected), detail)
