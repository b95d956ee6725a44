"""The record of a family: its members, the parameter in which they differ, and their special points joined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.studies.family_member import Member, MemberParameter, Place
from gapwalk.studies.special_point_path import Connection, Fate, SpecialPointPath


@dataclass(frozen=True, eq=False)
class Family(Shown):
    """The branches of one system along one parameter, repeated for several values of another one.

    Examples
    --------
    >>> [member.value for member in family.members], [path.name for path in family.of_kind("fold")]
    ([0.9, 1.0], ['fold-1', 'fold-2'])
    """

    system: System  #: The system.
    parameter: str  #: The parameter along which each member is walked.
    within: tuple[float, float]  #: Its range, the smaller value first.
    over: MemberParameter  #: The parameters in which the members differ.
    members: tuple[Member, ...] = ()  #: The members that have been done, in the order of their values.
    #: Connections of special points between members, by the number of the member before the gap.
    connections: Mapping[int, tuple[Connection, ...]] | None = None

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return len(self.members) == len(self.over.axis) and len(self.connections or {}) == len(self.gaps)

    @property
    def gaps(self) -> tuple[tuple[Member, Member], ...]:
        """The pairs of neighbours between which special points are joined; members without branches are left out."""
        return tuple(pairwise(member for member in self.members if member.branches))

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches of all members."""
        return tuple(branch for member in self.members for branch in member.branches)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks, in sentences."""
        found = [f"{self._where(member)}: {text}" for member in self.members for text in member.notes]
        guesses = [
            connection for connection in self._all_connections if connection.fate is Fate.NEAR and connection.detail
        ]
        return (*found, *(f"{self._told(connection)} {connection.text}" for connection in guesses))

    @property
    def failures(self) -> tuple[str, ...]:
        """Sentences on what could not be walked or followed."""
        found = [f"{self._where(member)}: {text}" for member in self.members for text in member.failures]
        for member in self.members:
            for name, branch in member.named:
                found += [f"{self._where(member)}: {name}: {end}" for end in branch.ends if end.reason.is_failure]
        lost = [connection for connection in self._all_connections if connection.fate is Fate.LOST]
        return (*found, *(f"{self._told(connection)} {connection.text}" for connection in lost))

    def special(self, place: Place) -> SpecialPoint:
        """Return the special point at a place."""
        return self._by_number[place.member].branches[place.branch].special_points[place.special]

    def value(self, place: Place) -> float:
        """Return the value of the quantity that the family is over, at a place."""
        return self._by_number[place.member].value

    @cached_property
    def point_paths(self) -> tuple[SpecialPointPath, ...]:
        """The special points joined through the members, in the order in which they begin."""
        onwards = {connection.begin: connection for connection in self._all_connections if connection.leads_on}
        before, after = self._ends()
        followers = {connection.end for connection in onwards.values()}
        counts: Counter[Kind] = Counter()
        point_paths = []
        for start, special in chain.from_iterable(member.special_points for member in self.members):
            if start in followers:
                continue
            places, connections = [start], []
            while (connection := onwards.get(places[-1])) is not None and connection.end is not None:
                connections.append(connection)
                places.append(connection.end)
            counts[special.kind] += 1
            point_paths.append(
                SpecialPointPath(
                    f"{special.kind.value}-{counts[special.kind]}",
                    special.kind,
                    special.contact,
                    special.orbit.period,
                    tuple(places),
                    tuple(connections),
                    before.get(start),
                    after.get(places[-1]),
                )
            )
        return tuple(point_paths)

    def of_kind(self, kind: Kind | str) -> tuple[SpecialPointPath, ...]:
        """Return the paths of one kind.

        Parameters
        ----------
        kind
            The kind, or its name, such as ``fold``.
        """
        return tuple(point_path for point_path in self.point_paths if point_path.kind == kind)

    def __getitem__(self, name: str) -> SpecialPointPath:
        """Return the path of a name."""
        for point_path in self.point_paths:
            if point_path.name == name:
                return point_path
        raise KeyError(
            f"there is no point_path {name}; there are {', '.join(each.name for each in self.point_paths) or 'none'}"
        )

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.of_kind(kind))} of {kind.value}" for kind in Kind.known() if self.of_kind(kind))
        done = f"{len(self.members)} members" + ("" if self.complete else f" of {len(self.over.axis)}")
        return f"Family({self.parameter} over {self.over.name}: {done}; point_paths: {counts or 'none'})"

    @cached_property
    def _by_number(self) -> dict[int, Member]:
        return {member.number: member for member in self.members}

    @property
    def _all_connections(self) -> Iterator[Connection]:
        for _, connections in sorted((self.connections or {}).items()):
            yield from connections

    def _ends(self) -> tuple[dict[Place, Connection], dict[Place, Connection]]:
        """Return the connections of a special point to the member before, and to the member after."""
        before: dict[Place, Connection] = {}
        after: dict[Place, Connection] = {}
        for number, connections in (self.connections or {}).items():
            for connection in connections:
                if connection.leads_on:
                    continue
                for place in (connection.begin, connection.end):
                    if place is not None:
                        (after if place.member == number else before)[place] = connection
        return before, after

    def _told(self, connection: Connection) -> str:
        """Describe the special point at which a connection begins."""
        member = self._by_number[connection.begin.member]
        return f"{self._where(member)}: the {connection.kind.value} at {self.special(connection.begin).value:.10g}"

    def _where(self, member: Member) -> str:
        return f"{self.over.name} = {member.value:.10g}"
