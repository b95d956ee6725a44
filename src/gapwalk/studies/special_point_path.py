"""Paths of special points through the members of a family, and what becomes of each on the way."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.studies.family_member import Place


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

    Examples
    --------
    >>> gw.records.Passage(kind="cusp", first=1.2, value=0.9, contact="").kind
    'cusp'
    """

    kind: str  #: Kind of the point, a value of `gapwalk.bifurcation.loci.Codim2`.
    #: first, value: The parameter of the members there, and the quantity that differs.
    first: float
    value: float
    contact: str = ""  #: Contact that grazes there, if any.


@dataclass(frozen=True, slots=True)
class Connection:
    """Path of a special point between two neighbouring members.

    Examples
    --------
    >>> connection = family.connections[0][0]
    >>> connection.kind, connection.fate.value
    ('fold', 'joined')
    """

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

    Examples
    --------
    >>> path = family.of_kind("fold")[0]
    >>> path.name, path.exact, len(path.places)
    ('fold-1', True, 2)
    """

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
