"""Products over multipliers: smooth along a branch, and zero where one of the factors is.

Factors larger than 1 in size are cut to 1, so that a large or a small multiplier cannot drown the one that matters.
(Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.)
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.floquet import REAL

_MANY = 8  # multipliers from which a product of them all, or of all their pairs, would drown the one that matters
_FEW = 4


def bounded_product(factors: NDArray[np.complex128]) -> float:
    """The product of factors, each cut to 1 in size."""
    product = 1.0 + 0.0j
    for factor in factors.tolist():
        product *= factor / max(1.0, abs(factor))
    return product.real


def nearest(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Of many factors the few nearest to zero, and the sign of the others: the product of them all would drown."""
    if len(factors) <= _MANY:
        return factors
    order = np.argsort(np.abs(factors))
    rest = factors[order[_FEW:]]
    return np.array([*factors[order[:_FEW]], np.prod(rest / np.abs(rest))], dtype=np.complex128)


def pair_factors(multipliers: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """``mu_i mu_j - 1`` over all pairs; over the conjugate pairs alone, ``1 - |mu|^2``, where there are many.

    Among many multipliers some unrelated two have a product near 1 all the time.
    """
    if len(multipliers) <= _MANY:
        first, second = _pairs(len(multipliers))
        return multipliers[first] * multipliers[second] - 1.0
    pairs = multipliers[multipliers.imag > REAL * np.abs(multipliers)]
    return nearest((1.0 - np.abs(pairs) ** 2).astype(complex))


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)
