"""The goal that a gap does not rattle over a band: it stays closed on one side, or open."""

from __future__ import annotations

from dataclasses import dataclass

from gapwalk.answers.gap_states import chosen_gaps, contact_place, gap_state, innermost, kept
from gapwalk.answers.goals.goal import LOWEST, Goal, Need
from gapwalk.answers.local_response import LocalResponse, band_points
from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.model.system import System
from gapwalk.model.words import between_words
from gapwalk.orbit.orbit import Orbit

_CLOSED = {1: "closed on the positive side", -1: "closed on the negative side"}


@dataclass(frozen=True)
class Quiet(Goal):
    """A gap does not rattle over a band: it stays closed on one side, or it stays open.

    Examples
    --------
    >>> gw.ask.Quiet("stop", (0.6, 0.8)).words(system, "frequency")
    'stop quiet between Ω = 0.6 and 0.8'
    """

    gap: str  #: Name of the contact.
    within: tuple[float, float]  #: The band.

    def ways(self, system: System) -> tuple[str, ...]:
        """Return the ways: closed on one of its sides, if there it is no rigid stop, or open."""
        law = system.structure.contacts[contact_place(system, self.gap)].law
        sides = () if law.rebounds else sorted(innermost(system, self.gap).values(), reverse=True)
        return (*(_CLOSED[side] for side in sides), "open")

    def posed(self, system: System, way: str) -> System:
        """Return the system whose gap keeps the state: it has no rattle that hides how far a quiet motion is."""
        return kept(system, self.gap, _side(way))

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        return f"{self.gap} quiet {between_words(self.within, parameter, system.units)}"

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if there is no such gap, or the band leaves the range of the response."""
        super().check(system, ends)
        chosen_gaps(system, self.gap)

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins of the depth of its turning points where it is least in the band.

        A grazing point that leaves the band passes an end of it, where the depth is zero then: no way of its own.
        """

        def measure(point: BranchPoint) -> float:
            return quiet_depth(point.orbit, self.gap, _side(way))

        return [
            Need(value - margin, response.slopes(place, measure), f"{self.gap} {way} at {place.point.value:.6g}")
            for place, value in response.lowest(measure, *self.within, most=LOWEST)
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the depth by which the gap stays closed or open over the band, relative to its clearance."""
        sides = [0, *innermost(response.system, self.gap).values()]
        return max(
            response.lowest(lambda point, side=side: quiet_depth(point.orbit, self.gap, side), *self.within)[0][1]
            for side in sides
        )

    def against(self, branch: Branch) -> list[str]:
        """Return a sentence if the gap rattles on the branch inside the band."""
        points = [point for point in band_points(branch, *self.within) if gap_state(point.orbit, self.gap).rattles]
        if not points:
            return []
        values = [point.value for point in points]
        return [f"{self.gap} rattles on an isolated branch between {min(values):.6g} and {max(values):.6g}"]


def _side(way: str) -> int:
    """Return the side on which a way keeps a gap closed; 0 for open."""
    return next((side for side, words in _CLOSED.items() if words == way), 0)


def quiet_depth(orbit: Orbit, gap: str, side: int) -> float:
    """Return the depth by which a gap stays closed or open in an orbit, relative to its clearance; negative if not."""
    depths, breakpoints = [], orbit.system.breakpoints
    for switch, own in innermost(orbit.system, gap).items():
        contact, _, clearance = breakpoints[switch]
        turns = [own * value for value in orbit.turns[contact].values]
        size = abs(clearance) or 1.0
        if not side:
            depths.append((clearance - max(turns)) / size)
        elif own == side:
            depths.append((min(turns) - clearance) / size)
    return min(depths)
