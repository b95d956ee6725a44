"""Where the branches of a diagram begin and end on others: both must have the orbit there in common."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, Limb, Origin
from gapwalk.bifurcation.doubling import halves_apart
from gapwalk.continuation.point import BranchPoint
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.verification import Check, Ledger, Spot

_CLOSE = 1e-2  # distance of the halves of an orbit within which a doubled branch may end before its parent
_TRUNCATED = 30.0  # times what is neglected by which orbits may differ, for that is not the same on both


def verify_tree(ledger: Ledger, diagram: Diagram) -> None:
    """Check where each limb of a diagram is attached to others."""
    names = {limb.name: limb for limb in diagram.limbs}
    for limb in diagram.limbs:
        points = limb.branch.points
        for origin, end, number in ((limb.begins, points[0], 0), (limb.joins, points[-1], len(points) - 1)):
            if origin is not None:
                _verify_end(ledger, Spot(limb.name, f"point {number}", end.value), names, origin, limb, end)


def _verify_end(
    ledger: Ledger, spot: Spot, names: dict[str, Limb], origin: Origin, limb: Limb, end: BranchPoint
) -> None:
    parent = names.get(origin.parent)
    if parent is None or origin.special >= len(parent.branch.special_points):
        ledger.enter(Check.TREE, spot, np.inf, f"there is no special point {origin.special} on {origin.parent}")
        return
    special = parent.branch.special_points[origin.special]
    detail = f"from special point {origin.special} of {origin.parent}"
    if not special.kind.ways or limb.period != parent.period * special.kind.times:
        ledger.enter(Check.TREE, spot, np.inf, f"{detail}, a {special.kind.value} of period {parent.period}")
        return
    apart = _apart(special, end.orbit)
    slack = 0.0
    if (
        special.kind.times == 2 and origin == limb.joins
    ):  # it may end just before its parent, whose orbit is the mean of its halves
        halves = float(np.abs(halves_apart(end.orbit)).max())
        slack = halves if halves < _CLOSE else 0.0
    ledger.enter(Check.TREE, spot, max(0.0, apart - slack - _neglected(special.orbit, end.orbit)), detail)


def _apart(special: SpecialPoint, orbit: Orbit) -> float:
    """Distance of an orbit from that of a special point, begun at whichever forcing period, relative to its size."""
    states = special.orbit.strobes(special.orbit.period)
    return float(np.abs(states - orbit.state).max(axis=1).min()) / (1.0 + float(np.abs(orbit.state).max()))


def _neglected(*orbits: Orbit) -> float:
    return _TRUNCATED * max(orbit.truncation for orbit in orbits)
