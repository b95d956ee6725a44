"""What becomes of a special point between two neighbouring members of a family."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from gapwalk.bifurcation.branch import Kind
from gapwalk.studies.family.member import Place


class Fate(StrEnum):
    """What becomes of a special point on the way to the next member."""

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
"""What happens where two special points meet, if nothing else does: their locus turns back."""


@dataclass(frozen=True, slots=True)
class Passage:
    """A point of codimension two on the way from one member to the next.

    Attributes
    ----------
    kind
        What happens there, a value of `gapwalk.bifurcation.loci.Codim2`.
    first, value
        The parameter of the members there, and the value of what the family is over.
    contact
        What grazes there, if anything does.
    """

    kind: str
    first: float
    value: float
    contact: str = ""


@dataclass(frozen=True, slots=True)
class Connection:
    """What becomes of a special point between two neighbouring members.

    Attributes
    ----------
    kind, contact, period
        Of the special point.
    fate
        What becomes of it.
    begin
        The special point.
    end
        Where its way ends: a special point of the other member, or of the same one if the two meet; None for none.
    at
        The parameter of the members, and the value of what the family is over, where two meet, or where the way ends
        otherwise; None if it leads to the other member.
    event
        What happens there: a value of `gapwalk.bifurcation.loci.Codim2`, or ``"turn"``; empty for nothing.
    curve
        The way: the parameter and the value at points of the locus.
    passages
        Points of codimension two on it.
    detail
        What could not be done.
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
        """Whether it joins a special point to one of the other member."""
        return self.fate in (Fate.JOINED, Fate.NEAR)

    @property
    def text(self) -> str:
        """What becomes of the special point, in words."""
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
