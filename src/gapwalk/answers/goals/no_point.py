"""The goal that no special point of a kind lies in a band: points leave it at either end, or vanish in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gapwalk.answers.goals.goal import LOWEST, Goal, Need
from gapwalk.answers.local_response import LocalResponse
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.model.words import between_words

_MOVES: dict[str, Callable[[float, float, float], bool]] = {  # True if a point of a band leaves it at its upper end
    "below": lambda value, low, high: value > high,
    "above": lambda value, low, high: value > low,
    "apart": lambda value, low, high: value > 0.5 * (low + high),
}


@dataclass(frozen=True)
class NoPoint(Goal):
    """No special point of a kind in a band of the walked parameter.

    Examples
    --------
    >>> gw.ask.NoPoint("fold", (1.35, 1.42)).words(system, "frequency")
    'no fold between Ω = 1.35 and 1.42'
    """

    kind: Kind  #: ``fold``, ``flip``, ``neimark-sacker`` or ``grazing``.
    within: tuple[float, float]  #: The band.

    def __post_init__(self) -> None:
        known = [str(each) for each in Kind.known() if not each.no_locus]
        if str(self.kind) not in known:
            raise ModelError(f"a goal is without {str(self.kind)!r}; {did_you_mean(str(self.kind), known)}")
        object.__setattr__(self, "kind", next(each for each in Kind.known() if str(each) == str(self.kind)))
        low, high = self.within
        if not low < high:
            raise ModelError(f"the band of a goal is from {low:g} to {high:g}; write the smaller value first")

    def ways(self, system: System) -> tuple[str, ...]:
        """Return the ways in which the points leave the band."""
        return (*_MOVES, "vanish") if self.kind in (Kind.FOLD, Kind.FLIP) else tuple(_MOVES)

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        return f"no {self.kind} {between_words(self.within, parameter, system.units)}"

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margin of each point of the kind; or, if they are to vanish, of the branch that bears them.

        Between a pair of folds the branch runs back. The smallest component of its tangent along the parameter is
        negative there, zero where the pair merges in a cusp, and positive beyond. For flips the product of all
        multipliers plus one plays this role.
        """
        points = [each for each in response.branch.special_points if each.kind == self.kind]
        if way != "vanish" and (points or "vanish" not in self.ways(response.system)):
            return _moved_out(response, points, self.within, way, margin)
        # without points, others must not appear: a design beyond the cusp may come back to it, and no further
        measure = response.advance if self.kind is Kind.FOLD else _from_flips
        words = "the branch does not run back" if self.kind is Kind.FOLD else "no multiplier passes -1"
        return [
            Need(value - margin, response.slopes(place, measure), f"{words} near {place.point.value:.6g}")
            for place, value in response.lowest(measure, *self.within, most=LOWEST)
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the distance of the nearest point from the band, as a share of its width; 1 if there is none."""
        low, high = self.within
        parts = [
            max(low - each.value, each.value - high) / (high - low)
            for each in response.branch.special_points
            if each.kind == self.kind
        ]
        return min([1.0, *parts])

    def against(self, branch: Branch) -> list[str]:
        """Return a sentence on each special point of the kind inside the band."""
        low, high = self.within
        points = [each for each in branch.special_points if each.kind == self.kind]
        return [
            f"an isolated branch has a {each.kind} at {each.value:.8g}, inside the band"
            for each in points
            if low <= each.value <= high
        ]


def _from_flips(point: BranchPoint) -> float:
    return float(np.prod(1.0 + point.orbit.free_multipliers).real)


def _moved_out(
    response: LocalResponse, points: Sequence[SpecialPoint], within: tuple[float, float], way: str, margin: float
) -> list[Need]:
    """Return the margins of special points that are to leave a band on the sides that a way says."""
    low, high = within
    width, needs = high - low, []
    for special in points:
        to_top = _MOVES[way](special.value, low, high)
        slopes = special.gradient(*response.names).slopes * np.array(response.scales)
        side = 1.0 if to_top else -1.0
        part = side * (special.value - (high if to_top else low)) / width
        words = f"{special.kind} at {special.value:.6g} {'above' if to_top else 'below'} the band"
        needs.append(Need(part - margin, side * slopes / width, words))
    return needs
