"""Folds: the branch turns round, and a multiplier passes +1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kind import Kind, Symbol
from gapwalk.bifurcation.kinds.condition import Criticality, smallest_singular_value
from gapwalk.bifurcation.kinds.search import Search, Zero
from gapwalk.continuation.point import BranchPoint

_VERTEX = 1e-6  # arclength from a crossing within which a fold is its vertex


class Fold(Kind):
    """Two motions meet and vanish: the parameter component of the tangent is zero."""

    symbol = Symbol("fold (LP)", "LP", "o", 4.8, "blue", "-", 1.7)
    target = 1.0
    moves_through_one = True
    is_turning = True
    sign_change = "the branch turns round"
    noise = 1e-5

    def function(self, point: BranchPoint) -> float:
        """The parameter component of the tangent."""
        return float(point.tangent[-1])

    def points_in(self, search: Search) -> list[Zero]:
        """All folds but the vertex of a pitchfork, which is a branch point.

        That one lies where the branch is interpolated through the crossing. Outside of there orbits are held, and
        however near a fold is, it is one of its own: where a contact grazes near the vertex, the branch may turn at
        once again.
        """
        crossings = search.stretch.crossings
        return [
            zero
            for zero in search.zeros(self)
            if all(abs(zero.point.arclength - each.arclength) >= min(_VERTEX, each.radius) for each in crossings)
        ]

    def nature(self, before: BranchPoint, after: BranchPoint) -> str | None:
        """To which side the fold opens; None where the branch goes the same way on both sides: rounding made the zero.

        It is told by the motions up to the next special points: farther away another fold may have turned the branch.
        """
        ways = [float(point.tangent[-1]) for point in (before, after)]
        if ways[0] * ways[1] >= 0.0:
            return None
        return f"opens to {'higher' if ways[1] > 0.0 else 'lower'} values"

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """How far a multiplier is from +1."""
        return smallest_singular_value(monodromy - np.eye(len(monodromy)))
