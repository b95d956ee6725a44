"""Folds: the branch turns back, and a multiplier passes +1."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.defining_functions import Criticality, smallest_singular_value
from gapwalk.bifurcation.special_point import Kind, Symbol
from gapwalk.bifurcation.step_interval import Search, Zero
from gapwalk.continuation.curve_points import BranchPoint

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch_start import BranchStart
    from gapwalk.bifurcation.error_estimate import ErrorEstimator
    from gapwalk.bifurcation.special_point import SpecialPoint
    from gapwalk.continuation.corrector import Range
    from gapwalk.orbit.method import Method

_VERTEX = 1e-6  # arclength from a crossing within which a fold is its vertex
# arclength, component of the tangent, and change of the parameter along a part of a branch that runs straight across
_STRAIGHT, _ACROSS, _SAME = 1e-5, 1e-7, 1e-12
_LEVEL = 1e-10  # component of the tangent that is zero but for rounding, halfway to the next special point


class Fold(Kind):
    """Fold, where two motions merge and vanish: the parameter component of the tangent is zero."""

    symbol = Symbol("fold (LP)", "LP", "o", 4.8, "blue", "-", 1.7)
    target = 1.0
    moves_through_one = True
    is_turning = True
    sign_change = "the branch turns back"
    noise = 1e-5

    def function(self, point: BranchPoint) -> float:
        """Return the parameter component of the tangent."""
        return float(point.tangent[-1])

    def hides(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Return True if the parameter, as a cubic between two points, turns back twice."""
        first, last = self.function(a), self.function(b)
        mean = float(b.x[-1] - a.x[-1]) / (b.arclength - a.arclength)
        bend = first + last - 2.0 * mean
        lowest = (first + last - 3.0 * mean) ** 2 - first * last  # discriminant of the slope of the cubic
        place = (2.0 * first + last - 3.0 * mean) / (3.0 * bend) if bend else 0.0
        return first * last > 0.0 and lowest > 0.0 and first * bend > 0.0 and 0.0 < place < 1.0

    def points_in(self, search: Search) -> list[Zero]:
        """Return all folds except the vertex of a pitchfork, which is a branch point.

        A branch may run straight across the parameter: at a flip of a motion that stays linear, the doubled motion has
        any size at the same value. There the component is zero throughout, and its sign is rounding.

        The vertex lies where the branch is interpolated through the crossing. Outside that interval orbits can be
        corrected, and a fold is a separate one however near it is: if a contact grazes near the vertex, the branch may
        turn back again at once.
        """
        crossings = search.interval.crossings
        return [
            zero
            for zero in search.zeros(self)
            if all(abs(zero.point.arclength - each.arclength) >= min(_VERTEX, each.radius) for each in crossings)
            and not self._runs_across(search, zero.point)
        ]

    def _runs_across(self, search: Search, point: BranchPoint) -> bool:
        """Return True if the parameter does not change from a point to one of the ends of its step."""
        return any(
            abs(end.arclength - point.arclength) > _STRAIGHT
            and abs(self.function(end)) < _ACROSS
            and abs(end.value - point.value) < _SAME * abs(point.value)
            for end in (search.interval.points[0], search.interval.points[-1])
        )

    def nature(self, before: BranchPoint, after: BranchPoint) -> str | None:
        """Return the side to which the fold opens; None if the direction does not change: the zero is only rounding.

        It follows from the motions up to the next special points: farther away another fold may have turned the branch.
        """
        ways = [float(point.tangent[-1]) for point in (before, after)]
        if ways[0] * ways[1] >= 0.0 or min(map(abs, ways)) < _LEVEL:
            return None
        return f"opens to {'higher' if ways[1] > 0.0 else 'lower'} values"

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error of a double fold as that of the crossing with other branches."""
        if zero.multiplicity > 1:
            return Kind.BRANCH_POINT.error(search, zero, second)
        return super().error(search, zero, second)

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """Compare a double fold with points on both sides by its multipliers."""
        if special.multiplicity > 1:
            return Kind.BRANCH_POINT.examined(special, before, after)
        return super().examined(special, before, after)

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return the beginnings of the branch that crosses at a double fold."""
        if special.multiplicity > 1:
            return Kind.BRANCH_POINT.beginnings(special, parameter, within, method)
        return super().beginnings(special, parameter, within, method)

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the distance of a multiplier from +1."""
        return smallest_singular_value(monodromy - np.eye(len(monodromy)))
