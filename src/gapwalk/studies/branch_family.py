"""The record of a family: its members, the parameter in which they differ, and their special points joined."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, partial
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import Branch, named_by_period
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.loci import Codim2, Locus, LocusEndReason, follow_locus
from gapwalk.bifurcation.loci.follow_locus import start_locus
from gapwalk.bifurcation.loci.locus import LocusPoint
from gapwalk.bifurcation.loci.locus_equations import Secant, zero_along
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Correction
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.model.coefficients import WAY, on_the_way
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import is_same, stroboscopic
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.diagram_study import DiagramOptions, diagram_from
from gapwalk.studies.study_kind import AnswerFinding, Found, Work

if TYPE_CHECKING:
    from gapwalk.studies.family_study import FamilyStudy


# The members of a family, and the parameter in which they differ.


class Place(NamedTuple):
    """Indices of a special point: of its member, of the branch in it, and of the point on the branch, all from 0."""

    #: member, branch, special: The indices.
    member: int
    branch: int
    special: int


@dataclass(frozen=True)
class Member:
    """A member of a family: the branches at one value of the parameter in which members differ."""

    number: int  #: Index of the member, from 0.
    value: float  #: Value of the parameter that differs.
    branches: tuple[Branch, ...] = ()  #: The branches; none if no first orbit was found.
    #: notes, failures: Remarks, and failures to walk a branch, in sentences.
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    @property
    def named(self) -> Iterator[tuple[str, Branch]]:
        """The branches with their names, such as ``P2-1``: the first branch of period 2."""
        return named_by_period(self.branches)

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

    #: Each parameter with its values, one for each member: what an engineer calls one quantity may change several
    #: coefficients.
    moved: tuple[tuple[str, tuple[float, ...]], ...]
    #: Name of the quantity that differs, if it is none of the parameters (a function of them, say), such as ``"Kb"``;
    #: by default the first parameter.
    called: str = ""
    values: tuple[float, ...] = ()  #: Its values; by default those of the first parameter. They rise or fall.

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
            raise ModelError(f"over gives {self.name} the values {self.axis}; they must be finite numbers")
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
        """Make a MemberParameter from a mapping of names to values.

        Parameters
        ----------
        over
            The parameters with their values; or a `MemberParameter`, which is returned.
        called
            Name of the quantity that differs.
        values
            Its values.
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
        """Value of the quantity that the family is over, at each member."""
        return self.values or self.moved[0][1]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that differ."""
        return tuple(name for name, _ in self.moved)

    def at(self, number: int) -> dict[str, float]:
        """Return the values of the parameters of one member.

        Parameters
        ----------
        number
            Index of the member, from 0.
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
                f"over has {pace} beside other parameters; it must be alone there, because time is scaled by it"
            )
        for number in () if names_only else range(len(self.axis)):
            try:
                system.at(self.at(number))
            except ModelError as error:
                where = f"{self.name} = {self.axis[number]:g}"
                raise ModelError(
                    "\n".join(f"over is refused at {where}: {line}" for line in str(error).splitlines())
                ) from None


# Paths of special points through the members of a family, and what becomes of each on the way.


class Fate(StrEnum):
    """Fate of a special point on the way to the next member."""

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
    """A point of codimension two on the way from one member to the next."""

    kind: str  #: Kind of the point, a value of `gapwalk.bifurcation.loci.Codim2`.
    #: first, value: The parameter of the members there, and the quantity that differs.
    first: float
    value: float
    contact: str = ""  #: Contact that grazes there, if any.


@dataclass(frozen=True, slots=True)
class Connection:
    """Path of a special point between two neighbouring members."""

    #: kind, contact, period: Properties of the special point.
    kind: Kind
    contact: str
    period: int
    fate: Fate  #: Its fate.
    begin: Place  #: The special point.
    #: The special point at the end of the path: in the other member, or in the same one if two meet; None if there is
    #: none.
    end: Place | None = None
    #: The parameter of the members, and the value of what the family is over, where two meet, or where the way ends
    #: otherwise; None if it leads to the other member.
    at: tuple[float, float] | None = None
    #: Event at that place: a value of `gapwalk.bifurcation.loci.Codim2`, or ``"turn"``; empty for nothing.
    event: str = ""
    curve: tuple[tuple[float, float], ...] = ()  #: The path: the parameter and the value at points of the locus.
    passages: tuple[Passage, ...] = ()  #: Points of codimension two on it.
    detail: str = ""  #: Reason for a failure.

    @property
    def leads_on(self) -> bool:
        """True if it connects special points of different members."""
        return self.fate in (Fate.JOINED, Fate.NEAR)

    @property
    def text(self) -> str:
        """Fate of the special point, in words."""
        words = {
            Fate.JOINED: "continues",
            Fate.NEAR: "continues in the nearest point of its kind (a guess)",
            Fate.MET: "meets another one",
            Fate.RANGE: "leaves the range",
            Fate.ENDS: "ends",
            Fate.OUTSIDE: "continues on a branch that is not known",
            Fate.ALONE: "has no point of its kind nearby",
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
    """Path of one special point through all members that have it."""

    name: str  #: Such as ``fold-3``: the third path of folds.
    #: kind, contact, period: Kind of the special point, period of the motions, and the contact that grazes, if any.
    kind: Kind
    contact: str
    period: int
    places: tuple[Place, ...]  #: The special points, from member to member.
    connections: tuple[Connection, ...]  #: The connections of neighbouring places.
    #: before, after: Its fate before its first and after its last special point; None at the first and the last member,
    #: and where that is not known yet.
    before: Connection | None
    after: Connection | None

    @property
    def exact(self) -> bool:
        """True if all of its connections are exact."""
        return all(connection.fate is Fate.JOINED for connection in self.connections)


@dataclass(frozen=True, eq=False)
class Family(Shown):
    """The branches of one system along one parameter, repeated for several values of another one."""

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
                found += [f"{self._where(member)}: {name}: {end}" for end in branch.failures]
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
        """Return the paths of one kind."""
        return tuple(point_path for point_path in self.point_paths if point_path.kind == kind)

    def __getitem__(self, name: str) -> SpecialPointPath:
        """Return the path of a name."""
        for point_path in self.point_paths:
            if point_path.name == name:
                return point_path
        raise KeyError(
            f"there is no special point {name}; there are {', '.join(each.name for each in self.point_paths) or 'none'}"
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


# The work on a family: its members, then their special points joined, by their exact loci or by nearness.
#
# The locus of a special point is followed from one member towards the next, in the plane of the parameter of the
# branches and of the one in which members differ. Points whose loci end on the way, or are not followed, are assigned
# by nearness.

LIMIT = 0.25
"""Distance beyond which two special points are not taken for the same, as `distance_between` measures it."""

_FORBIDDEN = 1e6


def nearest_pairs(
    left: Mapping[Place, SpecialPoint], right: Mapping[Place, SpecialPoint], within: tuple[float, float]
) -> list[tuple[Place, Place]]:
    """Return the pairs with the least sum of distances, each within `LIMIT`; the other points stay single."""
    # A single point costs half of the limit, so that a point that appears or vanishes between the members is not paired
    # with one that continues.
    from scipy.optimize import linear_sum_assignment  # imported late: it takes long

    if not left or not right:
        return []
    rows, columns = list(left), list(right)
    distances = np.array([[distance_between(left[a], right[b], within) for b in columns] for a in rows])
    alone = 0.5 * LIMIT
    count = len(rows) + len(columns)
    costs = np.full((count, count), _FORBIDDEN)
    costs[: len(rows), : len(columns)] = np.minimum(distances, _FORBIDDEN)
    costs[: len(rows), len(columns) :][np.diag_indices(len(rows))] = alone
    costs[len(rows) :, : len(columns)][np.diag_indices(len(columns))] = alone
    costs[len(rows) :, len(columns) :] = 0.0
    pairs = zip(*linear_sum_assignment(costs), strict=True)
    return [(rows[a], columns[b]) for a, b in pairs if a < len(rows) and b < len(columns) and distances[a, b] < LIMIT]


def distance_between(a: SpecialPoint, b: SpecialPoint, within: tuple[float, float]) -> float:
    """Return the distance of two special points, relative to the range and their motions; inf if their kinds differ."""
    # The motions may begin at different forcing periods.
    if (a.kind, a.contact, a.orbit.period) != (b.kind, b.contact, b.orbit.period):
        return np.inf
    orbit, width = b.orbit, within[1] - within[0]
    apart = np.abs(stroboscopic(a.orbit) - orbit.state).max(axis=1).min() / magnitude(orbit.state, orbit.system)
    return float(np.hypot((a.value - b.value) / width, apart))


MEMBER = Part("member", Member, numbered=True)
JOINTS = Part("connections", tuple[Connection, ...], numbered=True)
"""Changes of special points between two members, by the number of the first."""


class FamilyWork(Work):
    """The work on one family: its members, then the connections of special points between them."""

    def __init__(self, system: System, asked: FamilyStudy) -> None:
        self.asked = asked
        self._family = Family(system, asked.parameter, asked.ends, asked.over)
        self.members: dict[int, Member] = {}
        self.connections: dict[int, tuple[Connection, ...]] = {}

    def take(self, known: Parts) -> None:
        """Read members and connections; raise a ValueError if they belong to another family."""
        self.members, self.connections = dict(known.all(MEMBER)), dict(known.all(JOINTS))
        for number, member in self.members.items():
            if member.number != number or not 0 <= number < self.count:
                raise ValueError(f"member {number} has the number {member.number}")
        if any(not 0 <= number < self.count - 1 for number in self.connections):
            raise ValueError("the file has connections of members that it does not contain")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Walk the remaining members, and join the remaining special points of neighbours that are walked."""
        begun = set(self.connections)
        pieces: list[int | tuple[Member, Member]] = [k for k in range(self.count) if k not in self.members]
        pieces += self._ready(begun)
        do_one = partial(_do_one, self._family.system, self.asked)
        for index, found in workers.each(do_one, pieces, in_order=False):
            piece = pieces[index]
            if isinstance(found, Member):
                self.members[found.number] = found
                pieces += self._ready(begun)
                yield Found.part(MEMBER, found, found.number)
            elif isinstance(piece, tuple):
                number = piece[0].number
                self.connections[number] = found
                yield Found.part(JOINTS, found, number)

    def _ready(self, begun: set[int]) -> list[tuple[Member, Member]]:
        """Return the gaps that can be joined now, and note them: all members from one side to the other are known."""
        ready = [
            (left, right)
            for left, right in self.record.gaps
            if left.number not in begun and all(k in self.members for k in range(left.number, right.number))
        ]
        begun.update(left.number for left, _ in ready)
        return ready

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self.record.complete

    @property
    def done(self) -> int:
        """Number of members that are walked, and of gaps in which special points are joined."""
        return len(self.members) + len(self.connections)

    @property
    def total(self) -> int:
        """Number of members, and of gaps between members that have branches."""
        gaps = len(self.record.gaps) if len(self.members) == self.count else self.count - 1
        return self.count + gaps

    @property
    def record(self) -> Family:
        """The family so far."""
        members = tuple(member for _, member in sorted(self.members.items()))
        return replace(self._family, members=members, connections=dict(sorted(self.connections.items())))

    def finding(self) -> AnswerFinding:
        """Return the family as the finding of a study."""
        return AnswerFinding(self.asked, self.record if self.members else None, self.done, self.total)

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self._family.over.axis)


def _do_one(system: System, asked: FamilyStudy, piece: int | tuple[Member, Member]) -> Member | tuple[Connection, ...]:
    """Walk a member, given by its number, or join the special points of two."""
    return _walk_member(system, asked, piece) if isinstance(piece, int) else _join(asked, piece)


def _walk_member(system: System, asked: FamilyStudy, number: int) -> Member:
    """Walk the branches of one member; a failure does not affect the others."""
    value, parameter, ends = asked.over.axis[number], asked.parameter, (asked.begin, asked.end)
    how: Any = {"walk": asked.walk, "method": asked.method.suited_to(system)}
    try:
        first = system.at({**asked.over.at(number), parameter: asked.begin})
        orbit = find_orbit(first, asked.period, asked.start, method=how["method"])
        if asked.max_period is None:
            return Member(number, value, (follow(orbit, parameter, asked.end, **how),))
        limits = DiagramOptions(max_period=asked.max_period, workers=1)
        grown = diagram_from(orbit, parameter, ends, limits, **how)
    except NumericalError as error:
        return Member(number, value, failures=(f"no branch could be walked: {error}",))
    return Member(number, value, grown.branches, grown.notes, grown.failures)


def _join(asked: FamilyStudy, members: tuple[Member, Member]) -> tuple[Connection, ...]:
    """Join the special points of two neighbouring members."""
    # Points of the first member are followed towards the second; then those of the second that were not reached are
    # followed back.
    return _Joiner(asked, members).join()


# The gap is one wide, like the range. Loci bend less than branches, and steps shorten where they do; where one leads is
# verified by the orbit at its end.
_WALK = WalkOptions(initial_step=0.02, largest_step=0.1)
_EDGE = 1e-9  # share of the gap within which a locus has reached a member
_SECANT = Secant(longest=0.05, farthest=0.2)
_CORNERS = (Codim2.CUSP, Codim2.GRAZING, Codim2.DEGENERATE_GRAZING)  # in which a locus may turn back


Specials = dict[Place, SpecialPoint]

_SAME = 1e-5  # distance of two special points, in widths of the range, and of their orbits, within which they are one
_TRUNCATED = 30.0  # the same in the share of the motion that is neglected: contacts amplify it


class _Joiner:
    """Connection of the special points of two neighbouring members.

    A single parameter keeps its name; several parameters that change together are replaced by one, the path from the
    first member to the second.

    Attributes
    ----------
    plane
        The parameter of the members, the one that leads from the one member to the other, and their ranges.
    bounds
        The values of the second at the one member and at the other.
    """

    def __init__(self, asked: FamilyStudy, members: tuple[Member, Member]) -> None:
        self.asked, self.members = asked, members
        self.ends = tuple(asked.over.at(member.number) for member in members)
        names = asked.over.names
        second = names[0] if len(names) == 1 else WAY
        self.bounds = (0.0, 1.0) if second == WAY else (self.ends[0][second], self.ends[1][second])
        self.plane = (asked.parameter, second, (asked.ends, (min(self.bounds), max(self.bounds))))
        self.left: tuple[Specials, Specials] = (self._chosen(0), self._chosen(1))
        self.lost: dict[Place, str] = {}
        self.connections: list[Connection] = []

    def join(self) -> tuple[Connection, ...]:
        """Join special points by their loci, then by nearness; the others stay single."""
        if self.asked.exact:
            for side in (0, 1):
                for place in list(self.left[side]):
                    special = self.left[side].get(place)  # it may be what another one has led to
                    if special is not None and special.kind is not Kind.BRANCH_POINT:
                        self._join_exactly(place, special, side)
        for one, other in nearest_pairs(*self.left, self.asked.ends):
            pair = (self.left[0].pop(one), self.left[1].pop(other))
            curve = tuple((each.value, member.value) for each, member in zip(pair, self.members, strict=True))
            detail = self.lost.get(one, self.lost.get(other, ""))
            self._add(pair[0], Fate.NEAR, one, other, curve=curve, detail=detail)
        for specials in self.left:
            for place, special in specials.items():
                fate = Fate.LOST if place in self.lost else Fate.ALONE
                self._add(special, fate, place, detail=self.lost.get(place, ""))
        return tuple(sorted(self.connections, key=lambda connection: connection.begin))

    def _chosen(self, side: int) -> Specials:
        low, high = self.asked.ends
        kinds = self.asked.kinds
        # a fold between two points of a branch may lie just beyond the edge
        return {
            place: special
            for place, special in self.members[side].special_points
            if special.kind in kinds and low <= special.value <= high
        }

    def _lifted(self, special: SpecialPoint, side: int) -> SpecialPoint:
        """Return a special point of the first (side 0) or second (1) member, in a system with the second parameter."""
        system = special.orbit.system
        if self.plane[1] == WAY:
            system = on_the_way(system.at(self.ends[0]), self.ends[1]).at({WAY: self.bounds[side]})
        return replace(special, point=replace(special.point, orbit=replace(special.orbit, system=system)))

    def _share(self, second: float) -> float:
        """Return the position of a value of the second parameter between the two members, from 0 to 1."""
        begin, end = self.bounds
        return (second - begin) / (end - begin)

    def _value(self, second: float) -> float:
        """Return the quantity in which members differ, at a value of the second parameter."""
        one, other = (member.value for member in self.members)
        share = self._share(second)
        return (1.0 - share) * one + share * other

    def _add(self, special: SpecialPoint, fate: Fate, begin: Place, end: Place | None = None, **more: Any) -> None:
        about = (special.kind, special.contact, special.orbit.period)
        self.connections.append(Connection(*about, fate, begin, end, **more))

    def _join_exactly(self, place: Place, special: SpecialPoint, side: int) -> None:
        """Add the connection of a special point by its locus; if it cannot be followed, note the reason."""
        lifted = self._lifted(special, side)
        try:
            locus = _inwards(follow_locus(lifted, *self.plane, walk=_WALK))
        except NumericalError as error:
            self.lost[place] = str(error)
            return
        end = locus.ends[1]
        if end.reason.is_failure:
            self.lost[place] = str(end)
            return
        del self.left[side][place]
        first, second = locus.points[-1].values
        at_edge = end.reason in (LocusEndReason.RANGE, LocusEndReason.TABLE) and len(locus.points) > 1
        arrives = next((edge for edge in (0, 1) if at_edge and abs(self._share(second) - edge) <= _EDGE), None)
        partner = None if arrives is None else self._at_end(locus, arrives)
        if partner is not None and arrives is not None:
            del self.left[arrives][partner]
        ways = tuple((first, self._value(second)) for first, second in locus.values.tolist())
        passages = tuple(
            Passage(each.kind.value, each.values[0], self._value(each.values[1]), each.contact)
            for each in locus.codim2_points
        )
        more: dict[str, Any] = {"curve": ways, "passages": passages, "at": (first, self._value(second))}
        if partner is not None and arrives != side:
            if side == 0:
                self._add(special, Fate.JOINED, place, partner, curve=ways, passages=passages)
            else:
                self._add(special, Fate.JOINED, partner, place, curve=ways[::-1], passages=passages[::-1])
        elif arrives == side:  # even where the other one is on no branch that is known, the two met
            more["at"], event = self._farthest(locus, lifted, side)
            self._add(special, Fate.MET, place, partner, event=event, **more)
        elif arrives is not None:
            self._add(special, Fate.OUTSIDE, place, **more)
        elif end.reason in (LocusEndReason.RANGE, LocusEndReason.TABLE, LocusEndReason.START):
            self._add(special, Fate.RANGE, place, **more)
        else:
            event = locus.codim2_points[-1].kind.value if locus.codim2_points else ""
            self._add(special, Fate.ENDS, place, event=event, **more)

    def _at_end(self, locus: Locus, side: int) -> Place | None:
        """Return the special point to which a locus has led."""
        (low, high), reached = self.asked.ends, locus.points[-1]
        near = []
        for place, special in self.left[side].items():
            tolerance = max(_SAME, _TRUNCATED * special.orbit.truncation)
            distance = abs(special.value - reached.values[0]) / (high - low)
            is_alike = (special.kind, special.contact) == (locus.kind, locus.contact)
            if is_alike and distance <= tolerance and is_same(special.orbit, reached.orbit, tolerance):
                near.append((distance, place))
        return min(near)[1] if near else None

    def _farthest(self, locus: Locus, lifted: SpecialPoint, side: int) -> tuple[tuple[float, float], str]:
        """Find the farthest point of a locus that returns to the member from which it started, and the event there."""
        # Unless it turns in a corner, it turns where the second parameter does not change along it.
        here = self.bounds[side]
        points: list[tuple[LocusPoint, str]] = [(point, TURN) for point in locus.points]
        points += [(each.point, each.kind.value) for each in locus.codim2_points if each.kind in _CORNERS]
        best, event = max(points, key=lambda each: abs(each[0].values[1] - here))
        first, second = best.values
        if event == TURN:
            corrector = start_locus(lifted, *self.plane)[0].corrector

            def slope(correction: Correction) -> float:
                return float(corrector.tangent(correction.evaluation, best.tangent).tangent[-1])

            if (turn := zero_along(corrector, best.x, slope, _SECANT)) is not None:
                first, second = (turn.x[-2:] * corrector.scales[-2:]).tolist()
        return (first, self._value(second)), event


def _inwards(locus: Locus) -> Locus:
    """Return the half of the locus that leads into the gap; the other half leaves it at the start and ends at once."""
    begin, end = locus.ends
    if begin.reason is LocusEndReason.START:
        return locus
    points, codim2 = locus.points[::-1], locus.codim2_points[::-1]
    return replace(locus, points=points, codim2_points=codim2, ends=(end, begin))
