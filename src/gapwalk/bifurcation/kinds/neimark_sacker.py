"""Neimark-Sacker points: a complex pair of multipliers passes the unit circle, and a torus begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.defining_functions import (
    COMPLEX,
    Criticality,
    bounded_product,
    critical_pair,
    pair_factors,
    pair_on_circle,
)
from gapwalk.bifurcation.special_point import Kind, Symbol
from gapwalk.continuation.curve_points import BranchPoint


class NeimarkSacker(Kind):
    """Neimark-Sacker point, where the motion becomes quasi-periodic: the product of ``mu_i mu_j - 1`` is zero.

    The product over all pairs is also zero at neutral saddles, where two real multipliers have the product 1. Neutral
    saddles are not bifurcations.
    """

    symbol = Symbol("Neimark–Sacker (NS)", "NS", "*", 8.0, "green", (0.0, (6.0, 1.3, 1.2, 1.3)))

    def function(self, point: BranchPoint) -> float:
        """Return the product of ``mu_i mu_j - 1``."""
        return bounded_product(pair_factors(point.orbit.free_multipliers))

    def is_genuine(self, point: BranchPoint, near: float = 1e-6) -> bool:
        """Return True if a complex pair is on the unit circle: at a neutral saddle none is."""
        multipliers = point.orbit.free_multipliers
        complex_ones = multipliers[np.abs(multipliers.imag) > COMPLEX * np.abs(multipliers)]
        return bool(np.any(np.abs(np.abs(complex_ones) - 1.0) < near))

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the distances of the pairs from the unit circle, positive outside."""
        return np.abs(multipliers[multipliers.imag > COMPLEX * np.abs(multipliers)]) - 1.0

    def critical(self, multipliers: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the indices of the two multipliers nearest to the unit circle, larger imaginary part first."""
        order = np.argsort(np.abs(np.abs(multipliers) - 1.0), kind="stable")[:2]
        return order[np.argsort(-multipliers[order].imag, kind="stable")]

    def critical_multiplier(self, multipliers: NDArray[np.complex128]) -> complex:
        """Return the complex multiplier above the real axis that is nearest to the unit circle."""
        off = np.abs(np.abs(multipliers) - 1.0) + np.where(multipliers.imag > 0.0, 0.0, 1e3)
        return complex(multipliers[np.argmin(off)])

    def angle(self, multipliers: NDArray[np.complex128]) -> float:
        """Return the argument of the pair whose product is nearest to 1, real or not."""
        pair = multipliers[list(critical_pair(multipliers))]
        return float(np.arccos(np.clip(0.5 * pair.sum().real, -1.0, 1.0)))

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the product of a pair of multipliers minus 1."""
        return pair_on_circle(monodromy)
