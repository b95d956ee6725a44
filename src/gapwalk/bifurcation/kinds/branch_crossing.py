"""Branch points: two branches cross, because one of them breaks a symmetry."""

from __future__ import annotations

import math

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.branch_start import BranchStart
from gapwalk.bifurcation.error_estimate import ROUNDING, SAFETY, ErrorEstimator
from gapwalk.bifurcation.special_point_kind import Kind, Symbol
from gapwalk.bifurcation.step_interval import Search, Zero
from gapwalk.bifurcation.switch import from_crossing
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk_options import Range
from gapwalk.errors import NumericalError
from gapwalk.orbit.method import Method

_AROUND = 5e-3  # arclength within which a second computation searches for the branch point
_WINDOWS = (1.0, 0.2, 0.04, 0.01)  # shares of it: if a contact grazes nearby, the branch is smooth only in small ones
_SHARP = 1e-10  # error, in scales of the parameter, below which no smaller window is tried


class BranchPointKind(Kind):
    """Kind of point at which two branches cross: the Jacobian bordered by the tangent is singular."""

    turn = 1
    symbol = Symbol("branch point (BP)", "BP", "P", 6.5, "purple")
    target = 1.0
    ways = 2
    moves_through_one = True
    sign_change = "another branch crosses"

    def function(self, point: BranchPoint) -> float:
        """Return the determinant of the bordered Jacobian, scaled."""
        return point.determinant

    def prepare(self, search: Search) -> None:
        """Locate the crossing first, so that the search for other kinds steps over it."""
        if search.first.determinant * search.last.determinant < 0.0:
            search.crossing(search.first, search.last)

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """Locate the crossing by interpolation: Newton's method is ill-conditioned where branches cross."""
        crossing = search.crossing(a, b)
        if crossing is None:
            return None
        return Zero(self, search.interval.at(crossing.arclength), crossing.spread, self.at)

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error from the bracket, and from the shift of the crossing in a second computation."""
        point, scale = zero.point, float(search.corrector.scales[-1])
        ends = [abs(each.arclength - point.arclength) for each in (search.first, search.last)]
        off = math.inf
        for share in _WINDOWS:
            off = min(off, abs(_crossed(second, point, share * min(_AROUND, *ends)) - point.value))
            if off < _SHARP * scale:
                break
        if off == math.inf:
            return math.inf
        bracket = abs(float(point.tangent[-1])) * scale * zero.spread
        return float(bracket + SAFETY * off + ROUNDING * (abs(point.value) + scale))

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return two beginnings, in both directions of the crossing branch."""
        return from_crossing(special, parameter, within, method)

    @property
    def no_locus(self) -> str:
        """Reason why it has no locus."""
        return (
            "a branch point has no locus in two parameters: it exists by a symmetry, and vanishes or persists with it; "
            "follow a fold, a flip, a neimark-sacker or a grazing point"
        )


def _crossed(second: ErrorEstimator, point: BranchPoint, reach: float) -> float:
    """Return the crossing by a second computation; infinite if the branch is not smooth within that reach."""
    try:
        return second.crossing(point, reach)
    except NumericalError:
        return math.inf
