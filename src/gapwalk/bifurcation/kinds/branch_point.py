"""Branch points: two branches cross, by a symmetry that one of them loses."""

from __future__ import annotations

import math

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.departure import Departure
from gapwalk.bifurcation.kind import Kind, Symbol
from gapwalk.bifurcation.kinds.search import Search, Zero
from gapwalk.bifurcation.second import ROUNDING, SAFETY, SecondOpinion
from gapwalk.bifurcation.switch import from_crossing
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.range import Range
from gapwalk.errors import NumericalError
from gapwalk.orbit.method import Method

_AROUND = 5e-3  # arclength within which a second opinion looks for a branch point
_WINDOWS = (1.0, 0.2, 0.04, 0.01)  # shares of it: where a contact grazes near, the branch is smooth in small ones only
_SHARP = 1e-10  # error in scales of the parameter that no smaller window is asked to lessen


class BranchPointKind(Kind):
    """Two branches cross: the Jacobian bordered by the tangent is singular."""

    turn = 1
    symbol = Symbol("branch point (BP)", "BP", "P", 6.5, "purple")
    target = 1.0
    ways = 2
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
        off = math.inf
        for share in _WINDOWS:
            off = min(off, abs(_crossed(second, point, share * min(_AROUND, *ends)) - point.value))
            if off < _SHARP * scale:
                break
        if off == math.inf:
            return math.inf
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


def _crossed(second: SecondOpinion, point: BranchPoint, reach: float) -> float:
    """Where branches cross by a second opinion; infinite where the branch is not smooth within that reach."""
    try:
        return second.crossing(point, reach)
    except NumericalError:
        return math.inf
