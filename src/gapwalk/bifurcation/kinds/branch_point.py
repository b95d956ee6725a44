"""Branch points: two branches cross, by a symmetry that one of them loses."""

from __future__ import annotations

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.departure import Departure
from gapwalk.bifurcation.kind import Kind, Symbol
from gapwalk.bifurcation.kinds.search import Search, Zero
from gapwalk.bifurcation.second import ROUNDING, SAFETY, SecondOpinion
from gapwalk.bifurcation.switch import from_crossing
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.range import Range
from gapwalk.orbit.equation import Method

_AROUND = 5e-3  # arclength within which a second opinion looks for a branch point


class BranchPointKind(Kind):
    """Two branches cross: the Jacobian bordered by the tangent is singular."""

    turn = 1
    symbol = Symbol("branch point (BP)", "BP", "P", 6.5, "purple")
    target = 1.0
    moves_through_one = True
    sign_change = "another branch crosses"

    def function(self, point: BranchPoint) -> float:
        """The determinant of the bordered Jacobian, scaled."""
        return point.determinant

    def prepare(self, search: Search) -> None:
        """Find the crossing first, so that the search for others steps over it."""
        if search.first.determinant * search.last.determinant < 0.0:
            search.crossing(search.first, search.last)

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """The crossing, from its surroundings: Newton's method cannot hold a point where branches cross."""
        crossing = search.crossing(a, b)
        if crossing is None:
            return None
        return Zero(self, search.stretch.at(crossing.arclength), crossing.spread, self.at)

    def error(self, search: Search, zero: Zero, second: SecondOpinion) -> float:
        """Its bracket, and how far the crossing is off where the branch is posed otherwise."""
        point, scale = zero.point, float(search.corrector.scales[-1])
        ends = [abs(each.arclength - point.arclength) for each in (search.first, search.last)]
        off = abs(second.crossing(point, min(_AROUND, *ends)) - point.value)
        bracket = abs(float(point.tangent[-1])) * scale * zero.spread
        return float(bracket + SAFETY * off + ROUNDING * (abs(point.value) + scale))

    def departures(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[Departure]:
        """Two, in both directions of the branch that crosses."""
        return from_crossing(special, parameter, within, method)

    @property
    def no_locus(self) -> str:
        """Why it has none."""
        return (
            "a branch point has no locus in two parameters: it exists by a symmetry, and vanishes or persists with it; "
            "follow a fold, a flip, a neimark-sacker or a grazing point"
        )
