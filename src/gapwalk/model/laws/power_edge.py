"""The polynomial that replaces a fractional power near 0, where that power is not analytic."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial, legendre

DEGREE, MOMENTS = 8, 4


@lru_cache(maxsize=256)
def edge_polynomial(exponent: float, degree: int = DEGREE, moments: int = MOMENTS) -> tuple[float, ...]:
    """Fit ``s**p`` on [0, 1] by ``s Q(s)`` and return the coefficients of ``Q``, that of the highest power first.

    The fit has the value 0 at 0, and the value and the first two derivatives of the power at 1. The first `moments`
    moments of its error vanish: the integral of the error over ``s``, which is the work; that of the error times
    ``s``, from which the duration of a passage follows; ... So the motion beyond the edge has almost no error: four
    moments did more in trials than a higher degree, whose large coefficients cost digits. What is left of the
    coefficients minimises the square of the error.

    An impact whose depth is 10 times the width of the edge, against ``max(x, 0)**1.5``, has a relative error of 4e-15
    in its duration, and of 2e-14 in the derivative of its end by its speed; 5 times, 2e-13 and 1e-12; 2.5 times, 5e-12
    and 1e-11. Rounding adds less than 1e-12 to the transition matrix. An impact that reaches a quarter of the edge
    is wrong by 4e-4 of its duration, and 4e-3 of that derivative.
    """
    # Legendre polynomials in z = 2 s - 1 are orthogonal: powers of s would lose ten digits
    size, p = degree + 1, exponent
    basis = [legendre.Legendre.basis(k, domain=[0.0, 1.0]) for k in range(size)]
    nodes, weights = legendre.leggauss(size + moments + 8)
    s = (nodes + 1.0) / 2.0
    powers = np.array([each(s) for each in basis])
    rows = [
        [each(0.0) for each in basis],
        *([each.deriv(j)(1.0) if j else each(1.0) for each in basis] for j in range(3)),
    ]
    wanted = [0.0, 1.0, p, p * (p - 1.0)]
    for j in range(moments):
        rows.append((powers @ (weights * s**j) / 2.0).tolist())
        wanted.append(1.0 / (p + j + 1.0))
    # the integral of s**p times a Legendre polynomial is a product of ratios
    best = [1.0 / (p + 1.0)]
    for k in range(1, size):
        best.append(best[-1] * (p - k + 1.0) / (p + k + 1.0))
    best = np.array(best) * (2.0 * np.arange(size) + 1.0)
    # least squares: the nearest coefficients to `best` that satisfy the conditions, in the norm of the polynomials
    scale = 1.0 / np.sqrt(2.0 * np.arange(size) + 1.0)
    conditions = np.array(rows) / scale
    change, *_ = np.linalg.lstsq(conditions, np.array(wanted) - np.array(rows) @ best, rcond=None)
    fit = legendre.Legendre(best + change / scale, domain=[0.0, 1.0]).convert(kind=Polynomial, domain=[-1, 1])
    return tuple(float(each) for each in fit.coef[:0:-1])
