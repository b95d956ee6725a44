"""Which special points of two neighbouring members of a family may be the same, by nearness alone: an assignment."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.flow.length_unit import magnitude
from gapwalk.orbit.identity import stroboscopic
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.family.member import Place

LIMIT = 0.25
"""Distance beyond which two special points are not taken for the same, as `distance_between` measures it."""

_FORBIDDEN = 1e6


def nearest_pairs(
    left: Mapping[Place, SpecialPoint], right: Mapping[Place, SpecialPoint], within: tuple[float, float]
) -> list[tuple[Place, Place]]:
    """The pairs whose distances are least in all, each within the `LIMIT`; others stay alone.

    To leave one alone costs half of the limit, so that what is born or vanishes between the members is not forced upon
    what goes on.
    """
    from scipy.optimize import linear_sum_assignment  # imported late: it takes long

    if not left or not right:
        return []
    rows, columns = list(left), list(right)
    distances = np.array([[distance_between(left[a], right[b], within) for b in columns] for a in rows])
    alone = 0.5 * LIMIT
    count = len(rows) + len(columns)
    costs = np.full((count, count), _FORBIDDEN)
    costs[: len(rows), : len(columns)] = np.minimum(distances, _FORBIDDEN)
    costs[: len(rows), len(columns) :][np.diag_indices(len(rows))] = alone
    costs[len(rows) :, : len(columns)][np.diag_indices(len(columns))] = alone
    costs[len(rows) :, len(columns) :] = 0.0
    pairs = zip(*linear_sum_assignment(costs), strict=True)
    return [(rows[a], columns[b]) for a, b in pairs if a < len(rows) and b < len(columns) and distances[a, b] < LIMIT]


def distance_between(a: SpecialPoint, b: SpecialPoint, within: tuple[float, float]) -> float:
    """How far two special points are apart: in widths of the range, and of their motions; infinite for other kinds."""
    if (a.kind, a.contact, a.orbit.period) != (b.kind, b.contact, b.orbit.period):
        return np.inf
    width = within[1] - within[0]
    return float(np.hypot((a.value - b.value) / width, _apart(stroboscopic(a.orbit), b.orbit)))


def _apart(states: NDArray[np.float64], orbit: Orbit) -> float:
    """Relative distance of two motions, which may begin at different forcing periods."""
    return float(np.abs(states - orbit.state).max(axis=1).min() / magnitude(orbit.state, orbit.system))
