"""The work on a family: its members, then what becomes of special points between them, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace

from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.family import Connection, Family, Member
from gapwalk.studies.family_joining import FamilyOptions, Gap, join
from gapwalk.studies.kind import Content, Finding, Found, Work
from gapwalk.studies.whole_diagram import DiagramOptions, grow

MEMBER = Part("member", Member, numbered=True)
JOINTS = Part("connections", tuple[Connection, ...], numbered=True)
"""What becomes of special points between two members, by the number of the first."""


@dataclass(frozen=True)
class Walk:
    """How each member of a family is walked.

    Parameters
    ----------
    begin, end
        Where the walk begins, and where it ends.
    start, period
        Where the first orbit is looked for, as in `find_orbit`.
    walk, method
        Options of the walk and of the method.
    """

    begin: float
    end: float
    start: str | Sequence[float] = "settle"
    period: int = 1
    walk: WalkOptions | None = None
    method: Method | None = None


@dataclass(frozen=True)
class _Piece:
    """One member to walk."""

    number: int
    value: float
    system: System
    parameter: str
    how: Walk
    max_period: int | None


class FamilyWork(Work):
    """The work on one family: its members, then what becomes of special points between them.

    Parameters
    ----------
    family
        The family, without members.
    how
        How each of them is walked.
    options
        How far they go, and how their special points are joined.
    finding
        Makes of a family what a study finds.
    """

    def __init__(self, family: Family, how: Walk, options: FamilyOptions, finding: Callable[[Family], Finding]) -> None:
        self._family, self.how, self.options, self._finding = family, how, options, finding
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

    def parts(self, workers: Workers) -> Generator[Found]:
        """Walk the members that are left; then join special points where that is left."""
        members = [self._piece(number) for number in range(self.count) if number not in self.members]
        for index, member in workers.each(_walk_member, members, in_order=False):
            number = members[index].number
            self.members[number] = member
            yield Found.part(MEMBER, member, number)
        gaps = [self._gap(pair) for pair in self.record.gaps if pair[0].number not in self.connections]
        for index, connections in workers.each(join, gaps, in_order=False):
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

    def content(self) -> Content:
        """The family as what a study has found."""
        return Content(self.complete, finding=self._finding(self.record))

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self._family.over.axis)

    def _piece(self, number: int) -> _Piece:
        family = self._family
        system = family.system.at({**family.over.at(number), family.parameter: self.how.begin})
        value, parameter = family.over.axis[number], family.parameter
        return _Piece(number, value, system, parameter, self.how, self.options.max_period)

    def _gap(self, pair: tuple[Member, Member]) -> Gap:
        family = self._family
        one, other = (family.over.at(member.number) for member in pair)
        return Gap(pair, family.parameter, family.within, (one, other), replace(self.options, workers=1))


def _walk_member(piece: _Piece) -> Member:
    """Walk the branches of one member; what goes wrong costs no other one."""
    how = piece.how
    try:
        orbit = find_orbit(piece.system, how.period, how.start, method=how.method)
        if piece.max_period is None:
            branch = follow(orbit, piece.parameter, how.end, walk=how.walk, method=how.method)
            return Member(piece.number, piece.value, (branch,))
    except NumericalError as error:
        return Member(piece.number, piece.value, failures=(f"no branch could be walked: {error}",))
    limits = DiagramOptions(max_period=piece.max_period, workers=1)
    grown, finished = grow(orbit, piece.parameter, (how.begin, how.end), limits, how.walk, how.method)
    if not finished:
        raise KeyboardInterrupt  # a member counts only as a whole
    return Member(piece.number, piece.value, grown.branches, grown.notes, grown.failures)
