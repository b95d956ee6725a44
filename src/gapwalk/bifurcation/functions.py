"""Test functions: smooth along a branch, zero at a bifurcation.

==============  =========================================  ==========================================
fold            parameter component of the tangent
branch point    Jacobian bordered by the tangent           zero where branches cross
flip            product of ``mu + 1``                      zero with a multiplier at -1
Neimark-Sacker  product of ``mu_i mu_j - 1`` over pairs    zero with a pair on the unit circle, and at
                                                           neutral saddles, which are no bifurcations
==============  =========================================  ==========================================

(Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.) Factors larger than 1 in size are cut to 1, so
that a large or a small multiplier cannot drown the one that matters.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.continuation.point import BranchPoint
from gapwalk.orbit.floquet import REAL

_MANY = 8  # multipliers from which a product of them all, or of all their pairs, would drown the one that matters
_FEW = 4
BIFURCATIONS = (Kind.BRANCH_POINT, Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER)


def value(kind: Kind, point: BranchPoint) -> float:
    """The test function of one kind at a point."""
    known = point.memo.get(kind)
    if known is None:
        known = point.memo[kind] = _compute(kind, point)
    return known


def _compute(kind: Kind, point: BranchPoint) -> float:
    match kind:
        case Kind.FOLD:
            return float(point.tangent[-1])
        case Kind.BRANCH_POINT:
            return point.determinant
        case Kind.FLIP:
            return _bounded_product(_nearest(point.orbit.multipliers + 1.0))
        case Kind.NEIMARK_SACKER:
            return _bounded_product(_pair_factors(point.orbit.multipliers))
        case Kind.GRAZING:
            raise ValueError("grazing has no test function of the multipliers")


def is_genuine(kind: Kind, point: BranchPoint, near: float = 1e-6) -> bool:
    """Whether a zero of the test function is the bifurcation, and not a neutral saddle.

    At a Neimark-Sacker point a complex pair is on the unit circle, but for rounding: `near` it.
    """
    if kind is not Kind.NEIMARK_SACKER:
        return True
    multipliers = point.orbit.multipliers
    complex_ones = multipliers[np.abs(multipliers.imag) > 1e-6 * np.abs(multipliers)]
    return bool(np.any(np.abs(np.abs(complex_ones) - 1.0) < near))


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)


def _pair_factors(multipliers: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """``mu_i mu_j - 1`` over all pairs; over the conjugate pairs alone, ``1 - |mu|^2``, where there are many.

    Among many multipliers some unrelated two have a product near 1 all the time.
    """
    if len(multipliers) <= _MANY:
        first, second = _pairs(len(multipliers))
        return multipliers[first] * multipliers[second] - 1.0
    pairs = multipliers[multipliers.imag > REAL * np.abs(multipliers)]
    return _nearest((1.0 - np.abs(pairs) ** 2).astype(complex))


def _bounded_product(factors: NDArray[np.complex128]) -> float:
    product = 1.0 + 0.0j
    for factor in factors.tolist():
        product *= factor / max(1.0, abs(factor))
    return product.real


def _nearest(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Of many factors the few nearest to zero, and the sign of the others: the product of them all would drown."""
    if len(factors) <= _MANY:
        return factors
    order = np.argsort(np.abs(factors))
    rest = factors[order[_FEW:]]
    return np.array([*factors[order[:_FEW]], np.prod(rest / np.abs(rest))], dtype=np.complex128)
