"""Products over multipliers: smooth along a branch, and zero where one of the factors is.

Factors larger than 1 in absolute value are reduced to 1, so that a large multiplier cannot dominate the critical one.
(Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.)
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.floquet import REAL

_MANY = 8  # number of multipliers above which a product over all of them, or over all pairs, becomes too small
_FEW = 4


def bounded_product(factors: NDArray[np.complex128]) -> float:
    """Return the product of factors, each limited to 1 in absolute value."""
    product = 1.0 + 0.0j
    for factor in factors.tolist():
        product *= factor / max(1.0, abs(factor))
    return product.real


def nearest(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the few factors nearest to zero, and the phase of the others, since a product of many would vanish."""
    if len(factors) <= _MANY:
        return factors
    order = np.argsort(np.abs(factors))
    rest = factors[order[_FEW:]]
    return np.array([*factors[order[:_FEW]], np.prod(rest / np.abs(rest))], dtype=np.complex128)


def pair_factors(multipliers: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return ``mu_i mu_j - 1`` over all pairs; if there are many, ``1 - |mu|^2`` over the conjugate pairs alone.

    Among many multipliers, two unrelated ones nearly always have a product near 1.
    """
    if len(multipliers) <= _MANY:
        first, second = _pairs(len(multipliers))
        return multipliers[first] * multipliers[second] - 1.0
    pairs = multipliers[multipliers.imag > REAL * np.abs(multipliers)]
    return nearest((1.0 - np.abs(pairs) ** 2).astype(complex))


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)
