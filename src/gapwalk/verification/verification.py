"""The record of a verification: what was checked, how far from the ideal the worst figures are, and where."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Self

_NAMED = 5  # special points that a note names

Advance = Callable[[str, int, int], object]
"""Called with a word for what is verified, how many of its pieces are done, and how many there are."""


class Check(Enum):
    """What is checked: a name, a sentence, and the largest figure that passes."""

    SEAL = ("seal", "the file is as gapwalk wrote it, by its checksum", 0.0)
    RECORD = ("record", "what is stored of a point agrees with itself", 1e-9)
    RESIDUAL = ("residual", "the stored residual is one with which a walk takes a point", 1.0)
    CLOSURE = ("closure", "another integrator, carried once around, comes back", 1e-9)
    STAGES = ("stages", "the motion passes its breakpoints where it is said to, and nowhere else", 2e-6)
    EXTREMES = ("extremes", "largest and smallest positions are those of the other integrator", 1e-6)
    LINES = ("lines", "the balanced lines satisfy the equations of motion, by quadrature", 1e-6)
    TRUTH = ("truth", "an exact motion lies as near to the balanced one as the neglected lines allow", 1.0)
    VOLUME = ("volume", "the product of the multipliers is the exponential of the integrated divergence", 1e-5)
    # a walk knows the multipliers of a point some 1e-7 away; beside a grazing point they vary like a square root
    MULTIPLIERS = ("multipliers", "another number of segments gives the same multipliers", 3e-3)
    STABILITY = ("stability", "another number of segments gives the same number of unstable multipliers", 0.0)
    ORDER = ("order", "points and special points follow one another along the branch, and none is there twice", 0.0)
    GAPS = ("gaps", "between two neighbouring points lie orbits of the same branch", 1.0)
    COUNTS = ("counts", "changes of stability, direction and contacts are explained by special points between", 0.0)
    SIDES = ("sides", "a special point is what it is said to be, seen from both sides", 0.0)
    LOCATION = ("location", "a special point is where it is said to be, in units of its stated error", 1.0)
    NATURE = ("nature", "a fold opens, and a doubled branch leaves a flip, to the side that is told", 0.0)
    ENDS = ("ends", "a branch begins and ends where it is said to, and for the reason that is told", 0.0)
    TREE = ("tree", "a branch begins and ends at the orbits that it is attached to", 1e-6)
    CONDITION = ("condition", "an orbit on a locus is on the verge of its bifurcation", 1e-5)

    sentence: str
    bound: float

    def __new__(cls, word: str, sentence: str, bound: float) -> Self:
        """The check of a name; its value is the name."""
        check = object.__new__(cls)
        check._value_, check.sentence, check.bound = word, sentence, bound
        return check

    @property
    def word(self) -> str:
        """Its name."""
        return self.value


@dataclass(frozen=True, slots=True)
class Spot:
    """Where something was checked.

    Attributes
    ----------
    branch
        Name of the branch or locus; of a family, with its member.
    item
        Which of its points, such as ``point 12``, ``special point 3`` or ``points 12 to 13``, numbered from 0.
    value
        The parameter there; nan where it is no place along the parameter.
    """

    branch: str
    item: str
    value: float

    def __str__(self) -> str:
        place = "" if math.isnan(self.value) else f", at {self.value:.10g}"
        return f"{self.branch}, {self.item}{place}"


@dataclass(frozen=True, slots=True)
class Figure:
    """One check at one place.

    Attributes
    ----------
    check
        Which.
    spot
        Where.
    size
        The figure; it should not exceed the bound of its check.
    detail
        More about it; empty where there is no more to say.
    """

    check: Check
    spot: Spot
    size: float
    detail: str = ""

    @property
    def passes(self) -> bool:
        """Whether it is within its bound."""
        return self.size <= self.check.bound

    def __str__(self) -> str:
        bound = self.check.bound
        text = f"{self.check.word}: {self.spot}: {self.size:.2g}, where {bound:g} is allowed" if bound else ""
        text = text or f"{self.check.word}: {self.spot}"
        return f"{text} ({self.detail})" if self.detail else text


@dataclass(frozen=True)
class Summary:
    """All figures of one check.

    Attributes
    ----------
    check
        Which.
    count
        At how many places it was made.
    worst
        The largest figure.
    """

    check: Check
    count: int
    worst: Figure


@dataclass(frozen=True)
class Verification:
    """What a verification has found.

    Attributes
    ----------
    summaries
        Each check that was made, with its worst figure.
    breaches
        Every figure that exceeds its bound.
    notes
        What could not be verified, and why, in sentences.
    points, special_points
        How many were looked at.
    """

    summaries: tuple[Summary, ...]
    breaches: tuple[Figure, ...]
    notes: tuple[str, ...] = ()
    points: int = 0
    special_points: int = 0

    @property
    def ok(self) -> bool:
        """Whether every figure is within its bound."""
        return not self.breaches

    def worst(self, check: Check | str) -> Figure:
        """The worst figure of a check; a KeyError if that was not made."""
        for summary in self.summaries:
            if check in (summary.check, summary.check.word):
                return summary.worst
        raise KeyError(f"{check} was not checked; checked were {', '.join(s.check.word for s in self.summaries)}")

    @property
    def words(self) -> str:
        """The same in a line."""
        seen = f"{self.points} points and {self.special_points} special points"
        if self.ok:
            return f"{seen} verified: all {sum(summary.count for summary in self.summaries)} checks passed"
        return f"{seen} looked at: {len(self.breaches)} of the checks failed, the first being {self.breaches[0]}"

    def document(self) -> dict[str, Any]:
        """The same as plain JSON values."""
        return {
            "ok": self.ok,
            "points": self.points,
            "special_points": self.special_points,
            "checks": [
                {
                    "check": summary.check.word,
                    "text": summary.check.sentence,
                    "bound": summary.check.bound,
                    "count": summary.count,
                    "worst": _plain(summary.worst),
                }
                for summary in self.summaries
            ],
            "breaches": [{"check": each.check.word, **_plain(each)} for each in self.breaches],
            "notes": list(self.notes),
        }

    def __repr__(self) -> str:
        return f"Verification({self.words})"


def verification_of(plain: Any) -> Verification:
    """The same back from plain JSON values; any of KeyError, TypeError, ValueError if they are damaged."""

    def figure(check: Check, each: Any) -> Figure:
        value = math.nan if each["parameter"] is None else float(each["parameter"])
        spot = Spot(str(each["branch"]), str(each["item"]), value)
        size = math.inf if each["size"] is None else float(each["size"])
        return Figure(check, spot, size, str(each["detail"] or ""))

    summaries = [
        Summary(Check(each["check"]), int(each["count"]), figure(Check(each["check"]), each["worst"]))
        for each in plain["checks"]
    ]
    breaches = [figure(Check(each["check"]), each) for each in plain["breaches"]]
    notes = tuple(str(note) for note in plain["notes"])
    return Verification(tuple(summaries), tuple(breaches), notes, int(plain["points"]), int(plain["special_points"]))


class Ledger:
    """Figures as they come in, and the verification that they add up to."""

    def __init__(self) -> None:
        self._counts: dict[Check, int] = {}
        self._worst: dict[Check, Figure] = {}
        self._breaches: list[Figure] = []
        self.notes: list[str] = []
        self._unlocated: list[Spot] = []
        self.points = self.special_points = 0

    def enter(self, check: Check, spot: Spot, size: float, detail: str = "") -> None:
        """Enter one figure; what is no number counts as infinite."""
        figure = Figure(check, spot, math.inf if math.isnan(size) else size, detail)
        self._counts[check] = self._counts.get(check, 0) + 1
        if check not in self._worst or figure.size > self._worst[check].size:
            self._worst[check] = figure
        if not figure.passes:
            self._breaches.append(figure)

    def note(self, text: str) -> None:
        """Note what could not be verified; once is enough."""
        if text not in self.notes:
            self.notes.append(text)

    def leave_unlocated(self, spot: Spot) -> None:
        """Tell that a special point could not be located a second time: its location is not verified."""
        self._unlocated.append(spot)

    @property
    def verification(self) -> Verification:
        """All that was entered."""
        notes = [*self.notes, *_tell_unlocated(self._unlocated)]
        summaries = tuple(
            Summary(check, self._counts[check], self._worst[check]) for check in Check if check in self._counts
        )
        return Verification(summaries, tuple(self._breaches), tuple(notes), self.points, self.special_points)


def _tell_unlocated(spots: list[Spot]) -> list[str]:
    """One note for all special points that could not be located a second time; none if there are none."""
    if not spots:
        return []
    points = "one special point" if len(spots) == 1 else f"{len(spots)} special points"
    named = "; ".join(map(str, spots[:_NAMED])) + ("; and others" if len(spots) > _NAMED else "")
    return [f"the location of {points} could not be computed a second time, and is not verified: {named}"]


def _plain(figure: Figure) -> dict[str, Any]:
    return {
        "branch": figure.spot.branch,
        "item": figure.spot.item,
        "parameter": None if math.isnan(figure.spot.value) else figure.spot.value,
        "size": figure.size if math.isfinite(figure.size) else None,
        "detail": figure.detail or None,
    }
