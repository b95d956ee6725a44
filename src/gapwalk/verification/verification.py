"""Record of a verification: its checks, their worst values, and where these occur.

Method: docs/numerics/notes/results.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Self

from gapwalk.summary import SummaryParts, Table, remarks, summarizes

_NAMED = 5  # special points that a note names
_LISTED = 20  # failed checks that a summary lists

Advance = Callable[[str, int, int], object]
"""Function called with a word for what is verified, the number of completed pieces, and their total."""


class Check(Enum):
    """Kind of check: a name, a sentence, and the largest figure that passes."""

    SEAL = ("seal", "the file is as gapwalk wrote it, by its checksum", 0.0)
    RECORD = ("record", "the stored data of a point are consistent", 1e-9)
    RESIDUAL = ("residual", "the stored residual is one that a walk accepts", 1.0)
    CLOSURE = ("closure", "the orbit closes when another integrator follows it over one period", 1e-9)
    STAGES = ("stages", "the motion passes its breakpoints at the stated angles, and nowhere else", 2e-6)
    EXTREMES = ("extremes", "largest and smallest positions are those of the other integrator", 1e-6)
    LINES = ("lines", "Fourier coefficients by harmonic balance satisfy the equations of motion, by quadrature", 1e-6)
    TRUTH = ("truth", "an exact motion is as near to that of harmonic balance as the truncation allows", 1.0)
    VOLUME = ("volume", "the product of the multipliers is the exponential of the integrated divergence", 1e-5)
    # a walk knows the multipliers of a point about 1e-7 away; near a grazing point they vary like a square root
    MULTIPLIERS = ("multipliers", "another number of segments gives the same multipliers", 3e-3)
    STABILITY = ("stability", "another number of segments gives the same number of unstable multipliers", 0.0)
    ORDER = (
        "order",
        "points and special points are in order, none occurs twice, and all have the period of the branch",
        0.0,
    )
    GAPS = ("gaps", "between two neighbouring points lie orbits of the same branch", 1.0)
    COUNTS = ("counts", "changes of stability, direction and contacts are explained by special points between", 0.0)
    SIDES = ("sides", "the motions on both sides of a special point confirm its kind", 0.0)
    LOCATION = ("location", "the stated location of a special point is right, in units of its stated error", 1.0)
    NATURE = ("nature", "a fold opens, and a doubled branch leaves a flip, to the stated side", 0.0)
    ENDS = ("ends", "the ends of a branch are where it is stated, and have the stated reasons", 0.0)
    TREE = ("tree", "a branch begins and ends at the orbits that it is attached to", 1e-6)
    INVARIANCE = ("invariance", "another integrator carries the curve of a torus into itself, within its error", 1.0)
    REST = ("rest", "at an equilibrium the static forces balance, and small motions have its eigenvalues", 1e-8)
    CONDITION = ("condition", "an orbit on a locus is at its bifurcation", 1e-5)

    sentence: str
    bound: float

    def __new__(cls, word: str, sentence: str, bound: float) -> Self:
        """Create the check with a name; its value is the name."""
        check = object.__new__(cls)
        check._value_, check.sentence, check.bound = word, sentence, bound
        return check

    @property
    def word(self) -> str:
        """Name of the check."""
        return self.value


@dataclass(frozen=True, slots=True)
class Spot:
    """Place of a check."""

    branch: str  #: Name of the branch or locus; of a family, with its member.
    item: str  #: One of its points, such as ``point 12``, ``special point 3`` or ``points 12 to 13``, numbered from 0.
    value: float  #: The parameter there; nan if the item has no place along the parameter.

    def __str__(self) -> str:
        place = "" if math.isnan(self.value) else f", at {self.value:.10g}"
        return f"{self.branch}, {self.item}{place}"


@dataclass(frozen=True, slots=True)
class Figure:
    """Result of one check at one place."""

    check: Check  #: The check.
    spot: Spot  #: Its place.
    size: float  #: The figure; it should not exceed the bound of its check.
    detail: str = ""  #: Further explanation; may be empty.

    @property
    def passes(self) -> bool:
        """True if it is within its bound."""
        return self.size <= self.check.bound

    def __str__(self) -> str:
        bound = self.check.bound
        text = f"{self.check.word}: {self.spot}: {self.size:.2g}, where {bound:g} is allowed" if bound else ""
        text = text or f"{self.check.word}: {self.spot}"
        return f"{text} ({self.detail})" if self.detail else text


@dataclass(frozen=True)
class Summary:
    """Summary of all figures of one check."""

    check: Check  #: The check.
    count: int  #: Number of places at which it was made.
    worst: Figure  #: The largest figure.


@dataclass(frozen=True)
class Verification:
    """Result of a verification."""

    summaries: tuple[Summary, ...]  #: Each check that was made, with its worst figure.
    breaches: tuple[Figure, ...]  #: Every figure that exceeds its bound.
    notes: tuple[str, ...] = ()  #: Remarks on what could not be verified, and why, as sentences.
    #: points, special_points: Numbers of points and special points that were checked.
    points: int = 0
    special_points: int = 0

    @property
    def ok(self) -> bool:
        """True if every figure is within its bound."""
        return not self.breaches

    def worst(self, check: Check | str) -> Figure:
        """Return the worst figure of a check; raise a KeyError if it was not made."""
        for summary in self.summaries:
            if check in (summary.check, summary.check.word):
                return summary.worst
        raise KeyError(f"{check} was not checked; checked were {', '.join(s.check.word for s in self.summaries)}")

    @property
    def words(self) -> str:
        """Result in one line."""
        seen = f"{self.points} points and {self.special_points} special point{'s' * (self.special_points != 1)}"
        if self.ok:
            return f"{seen} verified: all {sum(summary.count for summary in self.summaries)} checks passed"
        return f"{seen} checked: {len(self.breaches)} of the checks failed, the first being {self.breaches[0]}"

    @summarizes
    def summary(self) -> SummaryParts:
        """Return each check with its worst figure, the first failed checks, and notes, as the terminal shows them."""
        rows = []
        for summary in self.summaries:
            worst = summary.worst
            size, where = f"{worst.size:.1e}" if worst.size else "0", str(worst.spot) if worst.size > 0.0 else ""
            rows.append([summary.check.word, str(summary.count), size, f"{summary.check.bound:g}", where])
        yield Table(["check", ">places", ">worst", ">allowed", "where"], rows)
        yield from (f"{each.check.word}: {each.check.sentence}" for each in self.summaries)
        for figure in self.breaches[:_LISTED]:
            yield f"failed: {figure.check.sentence}\n  {figure}"
        if len(self.breaches) > _LISTED:
            yield f"and {len(self.breaches) - _LISTED} more; --json lists them all"
        yield from remarks(self.notes, ())

    def document(self) -> dict[str, Any]:
        """Return the record as plain JSON values."""
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


class Ledger:
    """Collector of figures, which it adds up to a verification."""

    def __init__(self) -> None:
        self._summaries: dict[Check, Summary] = {}
        self._breaches: list[Figure] = []
        self.notes: list[str] = []
        self._unlocated: list[Spot] = []
        self.points = self.special_points = 0

    def enter(self, check: Check, spot: Spot, size: float, detail: str = "") -> None:
        """Enter one figure; nan counts as infinite."""
        figure = Figure(check, spot, math.inf if math.isnan(size) else size, detail)
        known = self._summaries.get(check, Summary(check, 0, figure))
        worst = figure if figure.size > known.worst.size else known.worst
        self._summaries[check] = Summary(check, known.count + 1, worst)
        if not figure.passes:
            self._breaches.append(figure)

    def judge(self, check: Check, spot: Spot, faults: Iterable[str]) -> None:
        """Enter the number of faults found, which are sentences."""
        faults = list(faults)
        self.enter(check, spot, float(len(faults)), "; ".join(faults))

    def note(self, text: str) -> None:
        """Add a remark on what could not be verified; repetitions are dropped."""
        if text not in self.notes:
            self.notes.append(text)

    def leave_unlocated(self, spot: Spot) -> None:
        """Record that a special point could not be located a second time, so that its location is not verified."""
        self._unlocated.append(spot)

    @property
    def verification(self) -> Verification:
        """Verification of everything entered so far."""
        notes, spots = list(self.notes), self._unlocated
        if spots:
            points = "one special point" if len(spots) == 1 else f"{len(spots)} special points"
            named = "; ".join(map(str, spots[:_NAMED])) + ("; and others" if len(spots) > _NAMED else "")
            notes.append(f"the location of {points} could not be computed a second time, and is not verified: {named}")
        summaries = tuple(self._summaries[check] for check in Check if check in self._summaries)
        return Verification(summaries, tuple(self._breaches), tuple(notes), self.points, self.special_points)


def _plain(figure: Figure) -> dict[str, Any]:
    return {
        "branch": figure.spot.branch,
        "item": figure.spot.item,
        "parameter": None if math.isnan(figure.spot.value) else figure.spot.value,
        "size": figure.size if math.isfinite(figure.size) else None,
        "detail": figure.detail or None,
    }
