"""Flips: a multiplier passes -1, and a branch of twice the period begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.branch_start import BranchStart
from gapwalk.bifurcation.criticality import with_nature
from gapwalk.bifurcation.kinds.condition import Criticality, bounded_product, nearest, smallest_singular_value
from gapwalk.bifurcation.special_point_kind import Kind, Symbol
from gapwalk.bifurcation.switch import from_flip
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk_options import Range
from gapwalk.orbit.method import Method


class Flip(Kind):
    """Period doubling: the product of ``mu + 1`` over all multipliers is zero."""

    symbol = Symbol("flip (PD)", "PD", "D", 4.3, "vermillion", (0.0, (4.5, 1.4)))
    target = -1.0
    ways, times = 1, 2
    sign_change = "a flip is passed"

    def function(self, point: BranchPoint) -> float:
        """Return the product of ``mu + 1``."""
        return bounded_product(nearest(point.orbit.multipliers + 1.0))

    def judged(self, special: SpecialPoint, parameter: str, method: Method | None) -> SpecialPoint:
        """Return the flip with its criticality; see `gapwalk.bifurcation.criticality.with_nature`."""
        return with_nature(special, parameter, method)

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return one beginning, on the branch of twice the period: the other direction gives the same motions."""
        return [from_flip(special, parameter, within, method)]

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the distance of a multiplier from -1."""
        return smallest_singular_value(monodromy + np.eye(len(monodromy)))
