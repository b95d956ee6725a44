"""When a multiplier is critical: a number that vanishes there, smooth in the monodromy matrix, and its derivative."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.floquet import multipliers

_REAL = 1e-9  # relative imaginary part within which two multipliers count as real or as conjugate


class Criticality(NamedTuple):
    """How far a monodromy matrix is from having a critical multiplier.

    Attributes
    ----------
    value
        Zero, with a change of sign, where it has one.
    directions : shape (k, 2n)
        Unit vectors along which the derivative of the matrix is needed.
    covectors : shape (k, 2n)
        A change dB of the matrix changes the value by the sum of ``covectors[j] @ dB @ directions[j]``.
    """

    value: float
    directions: NDArray[np.float64]
    covectors: NDArray[np.float64]


def pair_on_circle(monodromy: NDArray[np.float64]) -> Criticality:
    """How far the product of a pair of multipliers is from 1: of the pair that comes nearest.

    The pair is split off as a matrix of 2 x 2, ``left^T B right`` with ``left^T right = 1``, whose determinant is
    smooth in B even where the pair meets on the real axis, at the strong resonances 1:1 and 1:2.
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
    """Places of the two multipliers, conjugate or both real, whose product is nearest to 1."""
    first, second = np.triu_indices(len(values), 1)
    sums, products = values[first] + values[second], values[first] * values[second]
    sizes = 1.0 + np.abs(values[first]) + np.abs(values[second])
    distances = np.abs(products - 1.0) / np.maximum(1.0, np.abs(products))
    distances[(np.abs(sums.imag) > _REAL * sizes) | (np.abs(products.imag) > _REAL * sizes)] = np.inf
    nearest = int(np.argmin(distances))
    return int(first[nearest]), int(second[nearest])


def smallest_singular_value(matrix: NDArray[np.float64]) -> Criticality:
    """The smallest singular value of a matrix A, with the sign of ``det A``, which makes it smooth.

    It is the ``g`` of the bordered system (Govaerts 2000, Numerical Methods for Bifurcations, chapter 3)

        [ A    b ] [ v ]     [ 0 ]
        [ c^T  0 ] [ g ]  =  [ 1 ]

    for the best of all borders, the singular vectors themselves; so no borders have to be kept up to date.
    """
    left, values, right = np.linalg.svd(matrix)
    sign = 1.0 if np.linalg.det(left) * np.linalg.det(right) > 0.0 else -1.0
    return Criticality(sign * float(values[-1]), right[-1:], sign * left[:, -1:].T)
