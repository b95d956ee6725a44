"""Neimark-Sacker points: a complex pair of multipliers passes the unit circle, and a torus begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kind import Kind, Symbol
from gapwalk.bifurcation.kinds.condition import Criticality, critical_pair, pair_on_circle
from gapwalk.bifurcation.kinds.product import bounded_product, pair_factors
from gapwalk.continuation.point import BranchPoint

_COMPLEX = 1e-6  # relative imaginary part beyond which multipliers are a pair


class NeimarkSacker(Kind):
    """The motion becomes quasi-periodic: the product of ``mu_i mu_j - 1`` over all pairs is zero.

    So it is at neutral saddles too, where two real multipliers have the product 1; they are no bifurcations.
    """

    symbol = Symbol("Neimark–Sacker (NS)", "NS", "*", 8.0, "green", (0.0, (6.0, 1.3, 1.2, 1.3)))

    def function(self, point: BranchPoint) -> float:
        """The product of ``mu_i mu_j - 1``."""
        return bounded_product(pair_factors(point.orbit.multipliers))

    def is_genuine(self, point: BranchPoint, near: float = 1e-6) -> bool:
        """Whether a complex pair is on the unit circle: at a neutral saddle none is."""
        multipliers = point.orbit.multipliers
        complex_ones = multipliers[np.abs(multipliers.imag) > _COMPLEX * np.abs(multipliers)]
        return bool(np.any(np.abs(np.abs(complex_ones) - 1.0) < near))

    def critical(self, multipliers: NDArray[np.complex128]) -> NDArray[np.intp]:
        """The places of the two multipliers nearest to the unit circle, that with the larger imaginary part first."""
        order = np.argsort(np.abs(np.abs(multipliers) - 1.0), kind="stable")[:2]
        return order[np.argsort(-multipliers[order].imag, kind="stable")]

    def critical_multiplier(self, multipliers: NDArray[np.complex128]) -> complex:
        """Of the complex multipliers the one nearest to the unit circle, above the real axis."""
        off = np.abs(np.abs(multipliers) - 1.0) + np.where(multipliers.imag > 0.0, 0.0, 1e3)
        return complex(multipliers[np.argmin(off)])

    def angle(self, multipliers: NDArray[np.complex128]) -> float:
        """The argument of the pair whose product is nearest to 1, real or not."""
        pair = multipliers[list(critical_pair(multipliers))]
        return float(np.arccos(np.clip(0.5 * pair.sum().real, -1.0, 1.0)))

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """How far the product of a pair of multipliers is from 1."""
        return pair_on_circle(monodromy)
