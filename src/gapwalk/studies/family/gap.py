"""The gap between two neighbouring members of a family: the plane in which the loci of special points cross it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.loci import Locus
from gapwalk.model.parameter_path import WAY, on_the_way
from gapwalk.model.system import System
from gapwalk.studies.family.member import Member
from gapwalk.studies.family.options import FamilyOptions


@dataclass(frozen=True)
class Gap:
    """Two neighbouring members, and what moves between them.

    One parameter is followed by its own name; several that move together are one parameter, the way from the one member
    to the other.

    Parameters
    ----------
    members
        The two.
    parameter, within
        Along what the members are walked, and the range, the smaller value first.
    ends
        The values of what moves, at the one member and at the other.
    options
        How special points are joined.
    """

    members: tuple[Member, Member]
    parameter: str
    within: tuple[float, float]
    ends: tuple[Mapping[str, float], Mapping[str, float]]
    options: FamilyOptions

    @property
    def second(self) -> str:
        """The parameter that leads from the one member to the other."""
        return next(iter(self.ends[0])) if len(self.ends[0]) == 1 else WAY

    @property
    def bounds(self) -> tuple[float, float]:
        """Its values at the one member and at the other."""
        return (0.0, 1.0) if self.second == WAY else (self.ends[0][self.second], self.ends[1][self.second])

    @property
    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The ranges of both parameters, the smaller value first."""
        low, high = sorted(self.bounds)
        return self.within, (low, high)

    def lifted(self, special: SpecialPoint, side: int) -> SpecialPoint:
        """A special point of the one member (side 0) or the other (1), in a system that has the second parameter."""
        system = self._lifted(special.orbit.system, side)
        return replace(special, point=replace(special.point, orbit=replace(special.orbit, system=system)))

    def share(self, second: float) -> float:
        """How far a value of the second parameter is on the way from the one member (0) to the other (1)."""
        begin, end = self.bounds
        return (second - begin) / (end - begin)

    def value(self, second: float) -> float:
        """What the family is over at a value of the second parameter."""
        one, other = (member.value for member in self.members)
        share = self.share(second)
        return (1.0 - share) * one + share * other

    def curve(self, locus: Locus) -> tuple[tuple[float, float], ...]:
        """The points of a locus: the parameter, and what the family is over."""
        return tuple((first, self.value(second)) for first, second in locus.values.tolist())

    def _lifted(self, system: System, side: int) -> System:
        if self.second != WAY:
            return system
        return on_the_way(system.at(self.ends[0]), self.ends[1]).at({WAY: self.bounds[side]})
