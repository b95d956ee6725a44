"""The record of a family: its members, the parameter in which they differ, and their special points joined."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from itertools import chain, pairwise
from typing import Any, NamedTuple

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook import Shown


class Place(NamedTuple):
    """Indices of a special point: of its member, of the branch in it, and of the point on the branch, all from 0.

    Attributes
    ----------
    member, branch, special
        The indices.

    Examples
    --------
    >>> family.of_kind("fold")[0].places[0]
    Place(member=0, branch=0, special=0)
    """

    member: int
    branch: int
    special: int


@dataclass(frozen=True)
class Member:
    """A member of a family: the branches at one value of the parameter in which members differ.

    Attributes
    ----------
    number
        Index of the member, from 0.
    value
        Value of the parameter that differs.
    branches
        The branches; none if no first orbit was found.
    notes, failures
        Remarks, and failures to walk a branch, in sentences.

    Examples
    --------
    >>> member = family.members[0]
    >>> member.number, member.value, [name for name, branch in member.named]
    (0, 0.9, ['P1-1'])
    """

    number: int
    value: float
    branches: tuple[Branch, ...] = ()
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    @property
    def named(self) -> Iterator[tuple[str, Branch]]:
        """The branches with their names, such as ``P2-1``: the first branch of period 2."""
        counts: Counter[int] = Counter()
        for branch in self.branches:
            counts[branch.period] += 1
            yield f"P{branch.period}-{counts[branch.period]}", branch

    @property
    def special_points(self) -> Iterator[tuple[Place, SpecialPoint]]:
        """Return all special points with their places."""
        for index, branch in enumerate(self.branches):
            for special_index, special in enumerate(branch.special_points):
                yield Place(self.number, index, special_index), special

    def __repr__(self) -> str:
        return f"Member({self.value:g}, {len(self.branches)} branches)"


_EXAMPLE = 'over = { "mean.q1" = [0.25, 0.3, 0.35] }'


@dataclass(frozen=True, slots=True)
class MemberParameter:
    """The parameters that differ from member to member, with their values.

    Parameters
    ----------
    moved
        Each parameter with its values, one for each member: what an engineer calls one quantity may change several
        coefficients.
    called
        Name of the quantity that differs, if it is not one of the parameters (or a function of them), such as ``"Kb"``;
        by default the first of them.
    values
        Its values; by default those of the first parameter. They rise or fall.

    Raises
    ------
    ModelError
        If there are fewer than two members, lists of different lengths, or values that do not rise or fall throughout.

    Examples
    --------
    >>> over = gw.studies.MemberParameter.of({"stop.clearance": [0.9, 1.0]})
    >>> over.name, over.axis, over.at(1)
    ('stop.clearance', (0.9, 1.0), {'stop.clearance': 1.0})
    """

    moved: tuple[tuple[str, tuple[float, ...]], ...]
    called: str = ""
    values: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.moved:
            raise ModelError(f"over names no parameter; write one with its values, as in {_EXAMPLE}")
        if len({name for name, _ in self.moved}) < len(self.moved):
            raise ModelError("over names a parameter twice; leave one of them out")
        first, values = self.moved[0]
        if len(values) < 2:
            raise ModelError(f"over has {len(values)} values of {first}; a family needs at least two, as in {_EXAMPLE}")
        for name, others in self.moved[1:]:
            if len(others) != len(values):
                raise ModelError(
                    f"over has {len(others)} values of {name} and {len(values)} of {first}; each member needs one of "
                    "each"
                )
        if self.values and len(self.values) != len(values):
            raise ModelError(
                f"values has {len(self.values)} numbers, and over has {len(values)}; each member needs one"
            )
        if bool(self.called) != bool(self.values) and self.called != first:
            raise ModelError(
                "called and values belong together: what the family is over, and its value at each member, as in "
                'called = "Kb", values = [1.0, 1.5]'
            )
        if not all(math.isfinite(value) for value in self.axis):
            raise ModelError(f"over has {self.axis} of {self.name}; they must be finite numbers")
        steps = {math.copysign(1.0, b - a) if b != a else 0.0 for a, b in pairwise(self.axis)}
        if len(steps) > 1 or 0.0 in steps:
            raise ModelError(
                f"over has the values {', '.join(f'{value:g}' for value in self.axis)} of {self.name}; they must rise, "
                "or fall, from each member to the next: special points are joined from one to the next"
            )

    @classmethod
    def of(
        cls, over: MemberParameter | Mapping[str, Sequence[float]], called: str = "", values: Sequence[float] = ()
    ) -> MemberParameter:
        """Make it from a mapping of names to values.

        Parameters
        ----------
        over
            The parameters with their values; or a `MemberParameter`, which is returned.
        called
            Name of the quantity that differs.
        values
            Its values.

        Returns
        -------
        MemberParameter
            The parameters.
        """
        if isinstance(over, MemberParameter):
            return over
        moved = tuple((name, tuple(float(value) for value in given)) for name, given in over.items())
        return cls(moved, called, tuple(float(value) for value in values))

    @property
    def name(self) -> str:
        """Name of the quantity that the family is over."""
        return self.called or self.moved[0][0]

    @property
    def axis(self) -> tuple[float, ...]:
        """Value of that quantity at each member."""
        return self.values or self.moved[0][1]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that differ."""
        return tuple(name for name, _ in self.moved)

    def at(self, number: int) -> dict[str, float]:
        """Return the values of the parameters of one member, from 0.

        Parameters
        ----------
        number
            Index of the member, from 0.

        Returns
        -------
        dict of str to float
            Values by name.
        """
        return {name: values[number] for name, values in self.moved}

    def check(self, system: System, parameter: str, *, names_only: bool = False) -> None:
        """Raise a ModelError if the members of a family along a parameter cannot have these values.

        Parameters
        ----------
        system
            The system.
        parameter
            The parameter along which members are walked.
        names_only
            True to check the names, and not the values.

        Raises
        ------
        ModelError
            If they cannot.
        """
        for name in self.names:
            try:
                system.structure.place(name)
            except ModelError as error:
                raise ModelError(f"over names {name!r}, but {error}") from None
        if parameter in self.names:
            raise ModelError(f"over has {parameter}, along which each member is walked; choose another one")
        pace = system.structure.pace
        if pace in self.names and len(self.moved) > 1:
            raise ModelError(
                f"over has {pace} beside other parameters; it must be alone there, because everything is scaled by it"
            )
        for number in () if names_only else range(len(self.axis)):
            try:
                system.at(self.at(number))
            except ModelError as error:
                where = f"{self.name} = {self.axis[number]:g}"
                raise ModelError(
                    "\n".join(f"over is refused at {where}: {line}" for line in str(error).splitlines())
                ) from None


class Fate(StrEnum):
    """Fate of a special point on the way to the next member.

    Examples
    --------
    >>> [fate.value for fate in gw.records.Fate][:2]
    ['joined', 'near']
    """

    JOINED = "joined"
    """Its locus leads to a special point of the other member: that is proved."""
    NEAR = "near"
    """It is taken for the nearest one of its kind in the other member: that is a guess."""
    MET = "met"
    """It meets another one, and both vanish; seen the other way, both are born there."""
    RANGE = "range"
    """It leaves the range of the parameter along which members are walked."""
    ENDS = "ends"
    """Its locus ends where something else happens too, such as a strong resonance."""
    OUTSIDE = "outside"
    """Its locus reaches the other member, but none of the branches that are known there: it has split off."""
    ALONE = "alone"
    """It is not joined by its locus, and there is none of its kind near."""
    LOST = "lost"
    """Its locus could not be followed, and there is none of its kind near."""


TURN = "turn"
"""Event where two special points meet, if there is no other: their locus turns back."""


@dataclass(frozen=True, slots=True)
class Passage:
    """A point of codimension two on the way from one member to the next.

    Attributes
    ----------
    kind
        Kind of the point, a value of `gapwalk.bifurcation.loci.Codim2`.
    first, value
        The parameter of the members there, and the quantity that differs.
    contact
        Contact that grazes there, if any.

    Examples
    --------
    >>> gw.records.Passage(kind="cusp", first=1.2, value=0.9, contact="").kind
    'cusp'
    """

    kind: str
    first: float
    value: float
    contact: str = ""


@dataclass(frozen=True, slots=True)
class Connection:
    """Path of a special point between two neighbouring members.

    Attributes
    ----------
    kind, contact, period
        Properties of the special point.
    fate
        Its fate.
    begin
        The special point.
    end
        The special point at the end of the path: in the other member, or in the same one if two meet; None if there is
        none.
    at
        The parameter of the members, and the value of what the family is over, where two meet, or where the way ends
        otherwise; None if it leads to the other member.
    event
        Event at that place: a value of `gapwalk.bifurcation.loci.Codim2`, or ``"turn"``; empty for nothing.
    curve
        The path: the parameter and the value at points of the locus.
    passages
        Points of codimension two on it.
    detail
        Reason for a failure.

    Examples
    --------
    >>> connection = family.connections[0][0]
    >>> connection.kind, connection.fate.value
    ('fold', 'joined')
    """

    kind: Kind
    contact: str
    period: int
    fate: Fate
    begin: Place
    end: Place | None = None
    at: tuple[float, float] | None = None
    event: str = ""
    curve: tuple[tuple[float, float], ...] = ()
    passages: tuple[Passage, ...] = ()
    detail: str = ""

    @property
    def leads_on(self) -> bool:
        """True if it connects special points of different members."""
        return self.fate in (Fate.JOINED, Fate.NEAR)

    @property
    def text(self) -> str:
        """Fate of the special point, in words."""
        words = {
            Fate.JOINED: "goes on",
            Fate.NEAR: "goes on to the nearest of its kind (a guess)",
            Fate.MET: "meets another one",
            Fate.RANGE: "leaves the range",
            Fate.ENDS: "ends",
            Fate.OUTSIDE: "goes on where no known branch leads",
            Fate.ALONE: "has none of its kind near",
            Fate.LOST: "could not be followed",
        }[self.fate]
        if self.fate is Fate.MET and self.end is None:
            words += " that lies on no known branch"
        if self.event == TURN:
            event = ", where branches part or join," if self.kind is Kind.FOLD else ""
        else:
            event = f" in a {self.event}" if self.event else ""
        place = "" if self.at is None else f" at ({self.at[0]:.8g}, {self.at[1]:.8g})"
        return f"{words}{event}{place}{f': {self.detail}' if self.detail else ''}"


@dataclass(frozen=True)
class SpecialPointPath:
    """Path of one special point through all members that have it.

    Attributes
    ----------
    name
        Such as ``fold-3``: the third path of folds.
    kind, contact, period
        Kind of the special point, period of the motions, and the contact that grazes, if any.
    places
        The special points, from member to member.
    connections
        The connections of neighbouring places.
    before, after
        Its fate before its first and after its last special point; None at the first and the last member, and
        where that is not known yet.

    Examples
    --------
    >>> path = family.of_kind("fold")[0]
    >>> path.name, path.exact, len(path.places)
    ('fold-1', True, 2)
    """

    name: str
    kind: Kind
    contact: str
    period: int
    places: tuple[Place, ...]
    connections: tuple[Connection, ...]
    before: Connection | None
    after: Connection | None

    @property
    def exact(self) -> bool:
        """True if all of its connections are exact."""
        return all(connection.fate is Fate.JOINED for connection in self.connections)


@dataclass(frozen=True, eq=False)
class Family(Shown):
    """The branches of one system along one parameter, repeated for several values of another one.

    Attributes
    ----------
    system
        The system.
    parameter
        The parameter along which each member is walked.
    within
        Its range, the smaller value first.
    over
        The parameters in which the members differ.
    members
        The members that have been done, in the order of their values.
    connections
        Connections of special points between members, by the number of the member before the gap.

    Examples
    --------
    >>> [member.value for member in family.members], [path.name for path in family.of_kind("fold")]
    ([0.9, 1.0], ['fold-1', 'fold-2'])
    """

    system: System
    parameter: str
    within: tuple[float, float]
    over: MemberParameter
    members: tuple[Member, ...] = ()
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
        """Return the special point at a place.

        Parameters
        ----------
        place
            Indices of the special point.

        Returns
        -------
        SpecialPoint
            The point.
        """
        return self._by_number[place.member].branches[place.branch].special_points[place.special]

    def value(self, place: Place) -> float:
        """Return the value of the quantity that the family is over, at a place.

        Parameters
        ----------
        place
            Indices of the special point.

        Returns
        -------
        float
            In the unit of the parameter that differs.
        """
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

        Returns
        -------
        tuple of SpecialPointPath
            In the order of their names.
        """
        return tuple(point_path for point_path in self.point_paths if point_path.kind == kind)

    def plot(self, **options: Any):
        """Draw all members and their special points; options as in `gapwalk.plot.loci.draw_family`.

        Parameters
        ----------
        **options
            Options of `gapwalk.plot.loci.draw_family`.
        """
        from gapwalk.plot import draw

        return draw(self, **options)

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
