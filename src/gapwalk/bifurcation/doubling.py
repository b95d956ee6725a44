"""Period-doubled branches: difference between the two halves of an orbit, and where it vanishes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.predictor import hermite
from gapwalk.flow.length_unit import magnitude
from gapwalk.orbit.orbit import Orbit

MERGED = 1e-7
"""Relative difference between the halves of an orbit below which it has half the period."""
_CLOSE = 1e-2  # relative difference between the halves below which an orbit is close to one of half the period


def halves_apart(orbit: Orbit) -> NDArray[np.float64]:
    """Return the state after half the period minus the initial state, shape (2n,), relative to the size of the state.

    It is zero on an orbit of half the period, and changes sign through zero where a period-doubled branch passes
    through its parent.
    """
    half = orbit.strobes(orbit.period // 2 + 1)[-1]
    return (half - orbit.state) / magnitude(orbit.state, orbit.system)


def has_merged(point: BranchPoint) -> bool:
    """Return whether the orbit of a point has half its period, so that it lies on the parent branch."""
    return float(np.abs(_apart(point)).max()) < MERGED


def is_close(point: BranchPoint) -> bool:
    """Return whether the orbit of a point nearly repeats after half its period."""
    return float(np.abs(_apart(point)).max()) < _CLOSE


def passes_parent(first: BranchPoint, last: BranchPoint) -> bool:
    """Return whether the halves of the orbit exchange places between two neighbouring points."""
    a, b = _apart(first), _apart(last)
    return float(a @ b) < 0.0 and min(float(np.abs(a).max()), float(np.abs(b).max())) < 10 * _CLOSE


def value_between(first: BranchPoint, last: BranchPoint, scale: float) -> float:
    """Return the parameter at which the halves coincide between two points, by the cubic through them."""
    a, b = _size(first), _size(last)
    return float(hermite(first, last, a / (a + b))[-1]) * scale


def value_ahead(before: BranchPoint, last: BranchPoint) -> float:
    """Return the parameter at which the halves will coincide, just beyond two points.

    The branch turns back there: the difference of the halves is linear in arclength, and the parameter quadratic in it.
    """
    a, b = _size(before) ** 2, _size(last) ** 2
    return last.value if a <= b else (a * last.value - b * before.value) / (a - b)


def _size(point: BranchPoint) -> float:
    return float(np.linalg.norm(_apart(point)))


def _apart(point: BranchPoint) -> NDArray[np.float64]:
    known = point.memo.get("halves apart")
    if known is None:
        known = point.memo["halves apart"] = halves_apart(point.orbit)
    return known
