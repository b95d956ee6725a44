"""Check of the ends of branches in a diagram: an end must share its orbit with the branch to which it is attached."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin
from gapwalk.bifurcation.doubling import halves_apart
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.verification import Check, Ledger, Spot

_CLOSE = 1e-2  # difference of the halves of an orbit below which a doubled branch may end before its parent
_TRUNCATED = 30.0  # allowed difference of orbits, in truncation errors, which are not equal on both branches


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
    if (
        special.kind.times == 2 and origin == member.joins
    ):  # it may end just before its parent, whose orbit is the mean of its halves
        halves = float(np.abs(halves_apart(end.orbit)).max())
        slack = halves if halves < _CLOSE else 0.0
    ledger.enter(Check.TREE, spot, max(0.0, apart - slack - _neglected(special.orbit, end.orbit)), detail)


def _apart(special: SpecialPoint, orbit: Orbit) -> float:
    """Return the distance of an orbit from that of a special point, in any phase, relative to its size."""
    states = special.orbit.strobes(special.orbit.period)
    return float(np.abs(states - orbit.state).max(axis=1).min()) / (1.0 + float(np.abs(orbit.state).max()))


def _neglected(*orbits: Orbit) -> float:
    return _TRUNCATED * max(orbit.truncation for orbit in orbits)
