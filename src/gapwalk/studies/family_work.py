"""The work on a family: its members, then what becomes of special points between them, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from gapwalk.bifurcation.follow import follow
from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.diagram_study import DiagramOptions, diagram
from gapwalk.studies.family import Connection, Family, Member
from gapwalk.studies.family_joining import Gap, join
from gapwalk.studies.kind import Finding, Found, Work

if TYPE_CHECKING:
    from gapwalk.studies.family_study import FamilyStudy

MEMBER = Part("member", Member, numbered=True)
JOINTS = Part("connections", tuple[Connection, ...], numbered=True)
"""What becomes of special points between two members, by the number of the first."""


class FamilyWork(Work):
    """The work on one family: its members, then what becomes of special points between them.

    Parameters
    ----------
    finding
        Makes of a family what a study finds.
    """

    def __init__(self, system: System, asked: FamilyStudy, finding: Callable[[Family], Finding]) -> None:
        self.asked, self._finding = asked, finding
        self._family = Family(system, asked.parameter, asked.ends, asked.over)
        self.members: dict[int, Member] = {}
        self.connections: dict[int, tuple[Connection, ...]] = {}

    def take(self, known: Parts) -> None:
        """Take over members and connections; a ValueError if they are not those of this family."""
        self.members, self.connections = dict(known.all(MEMBER)), dict(known.all(JOINTS))
        for number, member in self.members.items():
            if member.number != number or not 0 <= number < self.count:
                raise ValueError(f"member {number} calls itself {member.number}")
        if any(not 0 <= number < self.count - 1 for number in self.connections):
            raise ValueError("there are connections between members that are not there")

    def parts(self, hands: Workers) -> Generator[Found]:
        """Walk the members that are left; then join special points where that is left."""
        numbers = [number for number in range(self.count) if number not in self.members]
        walk = partial(_walk_member, self._family.system, self.asked)
        for index, member in hands.each(walk, numbers, in_order=False):
            self.members[numbers[index]] = member
            yield Found.part(MEMBER, member, numbers[index])
        gaps = [self._gap(*pair) for pair in self.record.gaps if pair[0].number not in self.connections]
        for index, connections in hands.each(join, gaps, in_order=False):
            number = gaps[index].members[0].number
            self.connections[number] = connections
            yield Found.part(JOINTS, connections, number)

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return self.record.complete

    @property
    def done(self) -> int:
        """Members that are walked, and gaps between two of them that are closed."""
        return len(self.members) + len(self.connections)

    @property
    def total(self) -> int:
        """Members, and gaps between them, of which there are fewer where a member has no branch."""
        gaps = len(self.record.gaps) if len(self.members) == self.count else self.count - 1
        return self.count + gaps

    @property
    def record(self) -> Family:
        """The family, as far as it has come."""
        members = tuple(member for _, member in sorted(self.members.items()))
        return replace(self._family, members=members, connections=dict(sorted(self.connections.items())))

    def finding(self) -> Finding:
        """The family as what a study has found."""
        return self._finding(self.record)

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self._family.over.axis)

    def _gap(self, one: Member, other: Member) -> Gap:
        over = self.asked.over
        ends = (over.at(one.number), over.at(other.number))
        return Gap((one, other), self.asked.parameter, self.asked.ends, ends, replace(self.asked.limits, workers=1))


def _walk_member(system: System, asked: FamilyStudy, number: int) -> Member:
    """Walk the branches of one member; what goes wrong costs no other one."""
    value, parameter, ends = asked.over.axis[number], asked.parameter, (asked.begin, asked.end)
    how: Any = {"walk": asked.walk, "method": asked.method}
    try:
        first = system.at({**asked.over.at(number), parameter: asked.begin})
        orbit = find_orbit(first, asked.period, asked.start, method=asked.method)
        if asked.max_period is None:
            return Member(number, value, (follow(orbit, parameter, asked.end, **how),))
        limits = DiagramOptions(max_period=asked.max_period, workers=1)
        grown = diagram(first, parameter, ends, start=orbit, options=limits, **how)
    except NumericalError as error:
        return Member(number, value, failures=(f"no branch could be walked: {error}",))
    return Member(number, value, grown.branches, grown.notes, grown.failures)
