"""Criticality of a multiplier: a smooth function of the monodromy matrix that is zero there, and its derivative.

Some of these functions are products over multipliers: smooth along a branch, and zero where one of the factors is.
Factors larger than 1 in absolute value are reduced to 1, so that a large multiplier cannot dominate the critical one.
(Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.)
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.floquet import REAL, multipliers

_REAL = 1e-9  # relative imaginary part below which a sum or product of two multipliers counts as real
COMPLEX = 1e-6
"""Relative imaginary part up to which a pair may be two real multipliers that rounding has split."""
_MANY = 8  # number of multipliers above which a product over all of them, or over all pairs, becomes too small
_FEW = 4


class Criticality(NamedTuple):
    """Signed distance of a monodromy matrix from a critical multiplier, and its derivative.

    Examples
    --------
    >>> found = gw.Kind.named("flip").condition(np.diag([-1.2, -0.5]))
    >>> found.directions.shape
    (1, 2)
    """

    value: float  #: Zero, with a change of sign, where a multiplier is critical.
    #: shape (k, state_size): Unit vectors along which the derivative of the matrix is needed.
    directions: NDArray[np.float64]
    #: shape (k, state_size): A change dB of the matrix changes the value by the sum of ``covectors[j] @ dB @
    #: directions[j]``.
    covectors: NDArray[np.float64]


def pair_on_circle(monodromy: NDArray[np.float64]) -> Criticality:
    """Compute the product minus 1 of the pair of multipliers for which it is nearest to zero.

    The pair is split off as a 2 x 2 matrix, ``left^T B right`` with ``left^T right = 1``. Its determinant is smooth in
    B even where the pair meets on the real axis, at the strong resonances 1:1 and 1:2.
    """
    values = multipliers([monodromy])
    pair = values[list(critical_pair(values))]
    quadratic = monodromy @ monodromy - float(pair.sum().real) * monodromy
    quadratic.flat[:: len(monodromy) + 1] += float(pair.prod().real)
    left_vectors, _, right_vectors = np.linalg.svd(quadratic)
    right, left = right_vectors[-2:].T, left_vectors[:, -2:]
    left = left @ np.linalg.inv(right.T @ left)
    (a, b), (c, d) = left.T @ monodromy @ right
    adjugate = np.array([[d, -b], [-c, a]])
    return Criticality(float(a * d - b * c) - 1.0, right.T, adjugate @ left.T)


def critical_pair(values: NDArray[np.complex128]) -> tuple[int, int]:
    """Return the indices of the two multipliers, conjugate or both real, whose product is nearest to 1."""
    first, second = np.triu_indices(len(values), 1)
    sums, products = values[first] + values[second], values[first] * values[second]
    sizes = 1.0 + np.abs(values[first]) + np.abs(values[second])
    distances = np.abs(products - 1.0) / np.maximum(1.0, np.abs(products))
    distances[(np.abs(sums.imag) > _REAL * sizes) | (np.abs(products.imag) > _REAL * sizes)] = np.inf
    nearest = int(np.argmin(distances))
    return int(first[nearest]), int(second[nearest])


def offsets_from(target: float, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the distances of multipliers from +1 or -1: positive beyond it, negative of complex ones.

    A pair that rounding has split from a double multiplier counts as real.
    """
    is_real = np.abs(multipliers.imag) <= COMPLEX * np.abs(multipliers)
    return np.where(is_real, target * multipliers.real - 1.0, -np.abs(multipliers - target))


def nearest(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the few factors nearest to zero, and the phase of the others, since a product of many would vanish."""
    if len(factors) <= _MANY:
        return factors
    order = np.argsort(np.abs(factors))
    rest = factors[order[_FEW:]]
    return np.array([*factors[order[:_FEW]], np.prod(rest / np.abs(rest))], dtype=np.complex128)


def smallest_singular_value(matrix: NDArray[np.float64]) -> Criticality:
    """Compute the smallest singular value of a matrix A, with the sign of ``det A``, which makes it smooth.

    It is the ``g`` of the bordered system (Govaerts 2000, Numerical Methods for Bifurcations, chapter 3)

        [ A    b ] [ v ]     [ 0 ]
        [ c^T  0 ] [ g ]  =  [ 1 ]

    for the best choice of borders, the singular vectors themselves; so borders need not be updated along a locus.
    """
    left, values, right = np.linalg.svd(matrix)
    sign = 1.0 if np.linalg.det(left @ right) > 0.0 else -1.0  # both are orthogonal
    return Criticality(sign * float(values[-1]), right[-1:], sign * left[:, -1:].T)


def bounded_product(factors: NDArray[np.complex128]) -> float:
    """Return the product of factors, each limited to 1 in absolute value."""
    product = 1.0 + 0.0j
    for factor in factors.tolist():
        product *= factor / max(1.0, abs(factor))
    return product.real


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
