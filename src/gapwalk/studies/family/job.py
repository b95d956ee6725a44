"""The work on a family: its members, then what becomes of special points between them, piece by piece."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers
from gapwalk.studies.diagram.diagram import DiagramOptions, grow
from gapwalk.studies.family.connection import Connection
from gapwalk.studies.family.gap import Gap
from gapwalk.studies.family.joining import join
from gapwalk.studies.family.member import Member
from gapwalk.studies.family.options import FamilyOptions
from gapwalk.studies.family.record import Family

Part = Member | tuple[Connection, ...]
"""A member; or what becomes of special points between two of them."""

Report = Callable[[Part, Pace], object]
"""Called with each part when it is done, and with how far the family has come."""


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


class FamilyJob:
    """Does the work on one family, and knows how far it has come.

    Parameters
    ----------
    family
        The family, without members.
    how
        How each of them is walked.
    options
        How far they go, and how their special points are joined.
    """

    def __init__(self, family: Family, how: Walk, options: FamilyOptions) -> None:
        self._family, self.how, self.options = family, how, options
        self.members: dict[int, Member] = {}
        self.connections: dict[int, tuple[Connection, ...]] = {}
        self._begun, self._before = time.monotonic(), 0

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self._family.over.axis)

    @property
    def family(self) -> Family:
        """The family, as far as it has come."""
        members = tuple(member for _, member in sorted(self.members.items()))
        return replace(self._family, members=members, connections=dict(sorted(self.connections.items())))

    def system_at(self, number: int) -> System:
        """The system of a member, where its walk begins."""
        family = self._family
        return family.system.at({**family.over.at(number), family.parameter: self.how.begin})

    def take(self, members: dict[int, Member], connections: dict[int, tuple[Connection, ...]]) -> None:
        """Take over what has been done already."""
        self.members.update(members)
        self.connections.update(connections)
        self._before = len(self.members) + len(self.connections)

    def work(self, hands: Workers, keep: Callable[[int, Part], object], report: Report | None = None) -> None:
        """Do what is left, members first; `keep` gets the number of each part, those of gaps after the members'."""

        def accept(number: int, part: Part) -> None:
            keep(number, part)
            if isinstance(part, Member):
                self.members[number] = part
            else:
                self.connections[number - self.count] = part
            if report is not None:
                report(part, self._pace())

        self._begun = time.monotonic()
        members = [self._piece(number) for number in range(self.count) if number not in self.members]
        hands.run(_walk_member, members, lambda index, member: accept(members[index].number, member), in_order=False)
        gaps = [self._gap(pair) for pair in self.family.gaps if pair[0].number not in self.connections]
        places = [self.count + gap.members[0].number for gap in gaps]
        hands.run(join, gaps, lambda index, connections: accept(places[index], connections), in_order=False)

    def _pace(self) -> Pace:
        gaps = len(self.family.gaps) if len(self.members) == self.count else self.count - 1
        done = len(self.members) + len(self.connections)
        return Pace(done, self.count + gaps, self._before, time.monotonic() - self._begun)

    def _piece(self, number: int) -> _Piece:
        value, parameter = self._family.over.axis[number], self._family.parameter
        return _Piece(number, value, self.system_at(number), parameter, self.how, self.options.max_period)

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
