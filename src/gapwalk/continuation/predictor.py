"""Prediction of the next point, and interpolation between two: the cubic through two points and their tangents."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import length_of


def hermite(a: BranchPoint, b: BranchPoint, share: float) -> NDArray[np.float64]:
    """Evaluate the cubic through two points with their tangents: `share` 0 is the first, 1 the second, > 1 is ahead."""
    length, t = b.arclength - a.arclength, share
    return (
        (1 + 2 * t) * (1 - t) ** 2 * a.x
        + t * (1 - t) ** 2 * length * a.tangent
        + t * t * (3 - 2 * t) * b.x
        + t * t * (t - 1) * length * b.tangent
    )


def ahead(previous: BranchPoint | None, point: BranchPoint, step: float) -> list[NDArray[np.float64]]:
    """Return guesses for the point one step ahead, best first: by the cubic through two points, by the tangent."""
    straight = point.x + step * point.tangent
    if previous is None:
        return [straight]
    length = point.arclength - previous.arclength
    if not 0.0 < step < 3.0 * length:
        return [straight]
    curved = hermite(previous, point, 1.0 + step / length)
    if length_of(curved - straight) > 0.5 * step:
        return [straight]
    # both guesses lie on the same plane across the tangent
    curved += ((straight - curved) @ point.tangent) * point.tangent
    return [curved, straight]
