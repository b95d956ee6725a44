"""Flips: a multiplier passes -1, and a branch of twice the period begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.departure import Departure
from gapwalk.bifurcation.kind import Kind, Symbol
from gapwalk.bifurcation.kinds.condition import Criticality, smallest_singular_value
from gapwalk.bifurcation.kinds.product import bounded_product, nearest
from gapwalk.bifurcation.nature import with_nature
from gapwalk.bifurcation.switch import from_flip
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.range import Range
from gapwalk.orbit.method import Method


class Flip(Kind):
    """The period doubles: the product of ``mu + 1`` over all multipliers is zero."""

    symbol = Symbol("flip (PD)", "PD", "D", 4.3, "vermillion", (0.0, (4.5, 1.4)))
    target = -1.0
    ways, times = 1, 2
    sign_change = "a flip is passed"

    def function(self, point: BranchPoint) -> float:
        """The product of ``mu + 1``."""
        return bounded_product(nearest(point.orbit.multipliers + 1.0))

    def judged(self, special: SpecialPoint, parameter: str, method: Method | None) -> SpecialPoint:
        """The flip with its criticality; see `gapwalk.bifurcation.nature.with_nature`."""
        return with_nature(special, parameter, method)

    def departures(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[Departure]:
        """One, on the branch of twice the period: the other direction is the same motion, one period later."""
        return [from_flip(special, parameter, within, method)]

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """How far a multiplier is from -1."""
        return smallest_singular_value(monodromy + np.eye(len(monodromy)))
