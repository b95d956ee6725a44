"""Records of a family of tori: its points, what happens along it, and why it ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from itertools import chain
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import Strobe
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.curve import Curve, CurveEvent, Measured, numbered
from gapwalk.continuation.walk import AnyEnd, Reason
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Rows, SummaryParts, remarks, row_of, rows_of, summarizes
from gapwalk.tori.tongue import LockedWindow, Tongue
from gapwalk.tori.torus import TURN, Torus, at_phases
from gapwalk.verification.dop853 import carry
from gapwalk.verification.verification import Advance, Check, Ledger, Spot


class TorusEndReason(Reason):
    """Reason why a family of tori ends; the value is the sentence that a user reads."""

    START = "the family starts here"
    BORN = "the tori begin here, at a Neimark-Sacker point"
    DOUBLED = "the tori begin here, beside a torus that doubles"
    SHRINKS = "the tori shrink to an orbit, at a Neimark-Sacker point"
    RANGE = "the end of the range was reached"
    CLOSED = "the family closed on itself"
    ROUGH = "the tori lose their smoothness"
    RESONANCE = "the motion locks to a periodic one"
    STEP = "the step became smaller than the smallest allowed"
    POINTS = "the largest number of points was reached"
    STOPPED = "the walk was stopped before its end"


@dataclass(frozen=True, slots=True)
class TorusEnd(AnyEnd):
    """Place and reason of the end of a family of tori."""

    _row: ClassVar = "reason value rotation detail"

    reason: TorusEndReason  #: The reason.
    value: float  #: Value of the parameter there.
    rotation: float  #: Rotation number there.
    detail: str = ""  #: The evidence, in words; may be empty.
    window: LockedWindow | None = None  #: The motions to which the motion locks there; None if there are none.

    @property
    def place(self) -> str:
        """Place of the end in words."""
        return f"{self.value:.8g}, rotation number {self.rotation:.8g}"


class TorusEventKind(StrEnum):
    """Kind of event along a family of tori."""

    FOLD = "fold of tori"
    DOUBLING = "torus doubling"
    CHANGE = "stability changes in one normal direction"
    PAIR = "stability changes in two normal directions"
    RESONANCE = "resonance"
    GRAZING = "a contact grazes along the tori"


@dataclass(frozen=True, eq=False)
class TorusEvent(CurveEvent):
    """Torus of a family at which its stability or its rotation is special."""

    _row: ClassVar = (
        "kind value uncertainty rotation unstable.before=before unstable.after=after ratio=ratio_words "
        "locked.from=locked_from locked.to=locked_to detail"
    )

    #: What happens: the family turns back (fold), tori of twice as many curves begin (doubling), one normal exponent
    #: passes zero otherwise, two pass zero (as where a torus of three frequencies begins), the rotation number is a
    #: fraction, or a contact begins or ceases to graze somewhere along the torus, beyond which tori are smooth only
    #: piecewise.
    kind: TorusEventKind
    value: float  #: Value of the parameter.
    uncertainty: float  #: Estimated error of the value.
    rotation: float  #: Rotation number.
    #: before, after: Number of directions in which deviations grow, on either side, in the direction of the walk.
    before: int
    after: int
    ratio: Fraction | None = None  #: The fraction, for a resonance.
    window: LockedWindow | None = None  #: The locked motions of a resonance; None if none were looked for or found.
    detail: str = ""  #: The evidence, in words; may be empty.
    torus: Torus | None = None  #: The torus of a doubling, at which `follow_tori` may start; otherwise None.

    @property
    def ratio_words(self) -> str:
        """The fraction as text; empty for other kinds."""
        return "" if self.ratio is None else str(self.ratio)

    @property
    def locked_from(self) -> float:
        """Lower end of the range in which motions lock to the fraction; nan if it is not known."""
        return float("nan") if self.window is None else self.window.low

    @property
    def locked_to(self) -> float:
        """Upper end of the range in which motions lock to the fraction; nan if it is not known."""
        return float("nan") if self.window is None else self.window.high

    @property
    def words(self) -> str:
        """The event in words, with the fraction of a resonance."""
        return f"{self.kind.value} {self.ratio_words}".strip()

    @property
    def unstable_words(self) -> str:
        """Number of directions in which deviations grow; on either side if it changes."""
        return f"{self.before} -> {self.after}" if self.before != self.after else str(self.before)

    @property
    def evidence(self) -> str:
        """The locked motions in words, or else the evidence."""
        return self.detail if self.window is None else self.window.words

    def __repr__(self) -> str:
        locked = "" if self.window is None else f", {self.window.words}"
        return f"{super().__repr__()[:-1]}{locked})"


@dataclass(frozen=True, eq=False)
class TorusPoint:
    """One torus of a family."""

    _row: ClassVar = (
        "parameter=value rotation=torus.rotation stable=torus.stable unstable=torus.unstable "
        "exponent=torus.largest_exponent size=torus.size samples=torus.count error=torus.error grazes=torus.grazes"
    )

    value: float  #: Value of the parameter.
    torus: Torus  #: The torus.
    arclength: float  #: Scaled arclength from the first point.

    def measure(self, name: str) -> float:
        """Return one measure of the torus; see `Torus.measure`."""
        return self.torus.measure(name)

    def __repr__(self) -> str:
        return f"TorusPoint({self.value:.10g}, {self.torus!r})"


@dataclass(frozen=True, eq=False)
class TorusFamily(Curve, Measured):
    """Tori along a parameter."""

    _words: ClassVar = {
        "what": "{0.words}",
        "{0.parameter}": "{0.value:.9g}",
        "±": "{0.uncertainty:.0e}",
        "rotation number": "{0.rotation:.8g}",
        "unstable": "{0.unstable_words}",
        "detail": "{0.evidence}",
    }

    parameter: str  #: Name of the parameter.
    points: tuple[TorusPoint, ...]  #: The tori, in order along the family.
    events: tuple[TorusEvent, ...]  #: Folds, changes of stability and resonances, in order along the family.
    ends: tuple[TorusEnd, TorusEnd]  #: The two ends.
    second: str = ""  #: Name of the second parameter, with which the rotation number was kept; empty if it varied.

    @property
    def curves(self) -> int:
        """m, the number of curves that strobes visit in turn."""
        return self.points[0].torus.curves

    @property
    def rotations(self) -> NDArray[np.float64]:
        """Rotation number at each point, shape (points,)."""
        return np.array([point.torus.rotation for point in self.points])

    @property
    def second_values(self) -> NDArray[np.float64]:
        """Value of the second parameter at each point, shape (points,); empty if there is none."""
        return np.array([point.torus.system[self.second] for point in self.points if self.second])

    @property
    def _range_words(self) -> str:
        first, last, number = self.points[0], self.points[-1], len(self.points)
        stable = sum(point.torus.stable for point in self.points)
        curves = "one curve" if self.curves == 1 else f"{self.curves} curves"
        return (
            f"{number} tori of {curves} along {self.parameter}, from {first.value:.8g} to {last.value:.8g}; "
            f"{stable} are stable; {self._rotation_words}"
        )

    @property
    def _rotation_words(self) -> str:
        if not self.second:
            return f"rotation numbers from {self.rotations.min():.8g} to {self.rotations.max():.8g}"
        low, high = self.second_values[0], self.second_values[-1]
        return f"the rotation number {self.rotations[0]:.8g} is kept by {self.second}, from {low:.8g} to {high:.8g}"

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of points and events."""
        return {
            "tori": lambda: rows_of(map(self._row_of, self.points)),
            "events": lambda: rows_of(map(row_of, self.events)),
        }

    def _row_of(self, point: TorusPoint) -> dict[str, object]:
        return {**row_of(point), **({"second": point.torus.system[self.second]} if self.second else {})}

    def __repr__(self) -> str:
        return (
            f"TorusFamily({len(self.points)} tori along {self.parameter}, "
            f"{self.points[0].value:.6g} to {self.points[-1].value:.6g}, {len(self.events)} events)"
        )


# Record of all tori over a range: the branches of periodic motions, and the families that begin on them.

_SAME = 1e-6  # distance of two Neimark-Sacker points, relative to the parameter, within which they are one


@dataclass(frozen=True, eq=False)
class TorusDiagram(Shown):
    """Families of tori over a range of one parameter, with the branches at whose Neimark-Sacker points they begin."""

    diagram: Diagram  #: The branches of periodic motions.
    families: tuple[TorusFamily, ...] = ()  #: The families of tori.
    #: Neimark-Sacker points from which no family could be followed, with the reasons, in sentences.
    failures: tuple[str, ...] = ()
    tried: int = 0  #: Number of Neimark-Sacker points, in the order of the branches, that are done.
    #: Windows in which motions lock, followed in a second parameter, if that was asked.
    tongues: tuple[Tongue, ...] = ()
    unfollowed: int = 0  #: Number of windows that are left to be followed so.

    @property
    def starts(self) -> tuple[SpecialPoint, ...]:
        """The Neimark-Sacker points of all branches."""
        branches = (member.branch for member in self.diagram.members)
        return tuple(chain.from_iterable(branch.special(Kind.NEIMARK_SACKER) for branch in branches))

    @property
    def complete(self) -> bool:
        """True if all Neimark-Sacker points are done."""
        return self.diagram.complete and self.tried == len(self.starts) and not self.unfollowed

    @property
    def windows(self) -> tuple[LockedWindow, ...]:
        """The windows along all families, and at their ends, whose own ends are folds, each once."""
        found: list[LockedWindow] = []
        for window in (each.window for family in self.families for each in (*family.events, *family.ends)):
            if window is None or len(window.folds) != 2:
                continue
            period, value = window.orbit.period, window.folds[0].value
            known = ((each.orbit.period, each.folds[0].value) for each in found)
            if all(period != other or abs(value - place) > _SAME * abs(value) for other, place in known):
                found.append(window)
        return tuple(found)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the branches, in sentences."""
        return self.diagram.notes

    def holds(self, special: SpecialPoint) -> bool:
        """Return True if a known family begins or ends at a Neimark-Sacker point."""
        return any(
            family.curves == special.orbit.period and abs(end.value - special.value) <= _SAME * abs(special.value)
            for family in self.families
            for end in family.ends
            if end.reason in (TorusEndReason.BORN, TorusEndReason.SHRINKS)
        )

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the number of branches and points, and each family, in words."""
        branches, starts, families = len(self.diagram.members), len(self.starts), len(self.families)
        begun = (
            f"{branches} {'branch' if branches == 1 else 'branches'} with {starts} Neimark-Sacker "
            f"{'point' if starts == 1 else 'points'}; "
        )
        yield f"{begun if branches else ''}{families} {'family' if families == 1 else 'families'} of tori"
        for number, family in enumerate(self.families, start=1):
            first, *rest = family.summary()
            yield f"T{number}: {first}"
            yield from rest
        for tongue in self.tongues:
            yield from tongue.summary()
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of all tori, and of events and ends, with the number of the family."""
        return {
            "tori": lambda: numbered("family", self.families, lambda family: family.points, "T"),
            "events": lambda: numbered("family", self.families, lambda family: family.events, "T"),
            "ends": lambda: numbered("family", self.families, lambda family: family.ends, "T"),
            "tongues": lambda: rows_of(row for tongue in self.tongues for row in tongue.rows()),
        }

    def __repr__(self) -> str:
        return f"TorusDiagram({len(self.families)} families of tori on {len(self.diagram.members)} branches)"


# Verification of tori: another integrator carries their curves into themselves, and contracts volumes as stated.
#
# The phases at which a curve is tried lie between its samples. Method: docs/numerics/notes/tori.md

_LEAST = 1e-9  # error of the other integrator, relative to the motion
_PHASES = 65  # the most phases at which a curve is tried
_BETWEEN = 0.37  # their place between the samples
_GROWTH = 1e-5  # error of a sum of exponents, beside the stated one


def verify_families(ledger: Ledger, named: Iterable[tuple[str, TorusFamily]], report: Advance | None = None) -> None:
    """Verify all tori of some families."""
    tori = [(name, place, point) for name, family in named for place, point in enumerate(family.points)]
    for count, (name, place, point) in enumerate(tori, start=1):
        verify_torus(ledger, point.torus, Spot(name, f"torus {place}", point.value))
        if report is not None:
            report("tori", count, len(tori))


def verify_torus(ledger: Ledger, torus: Torus, spot: Spot) -> None:
    """Enter how far another integrator carries phases between the samples from the curve, in units of its stated error.

    The sum of the exponents must be the mean of the logarithm by which it finds volumes to change.
    """
    count = min(torus.count, _PHASES)
    psi = TURN * (np.arange(count) + _BETWEEN) / count
    system, strobe = torus.system, Strobe(torus.system)
    starts, unit = at_phases(torus.states, psi), system.state_scales()
    motions, blank = [], np.zeros(system.state_size, complex)
    for state in starts:
        arc = strobe.arc(state, torus.curves)
        motions.append(Orbit(system, torus.curves, state, blank, tuple(arc.contacts), math.inf, arc.steps))
    rounds = carry(motions, closes=False)
    reached = np.array([each.end for each in rounds])
    expected = at_phases(torus.states, psi + TURN * torus.rotation)
    away = float(np.abs((reached - expected) / unit).max() / np.abs(torus.states / unit).max())
    ledger.enter(Check.INVARIANCE, spot, away / (2.0 * torus.error + _LEAST), f"{away:.1e} of the motion")
    contractions = np.array([each.contraction for each in rounds])
    off = abs(float(contractions.mean() - torus.exponents.sum()))
    # where a contact grazes, the mean over few phases is inaccurate itself: those over every other phase tell how much
    rough = abs(float(contractions[::2].mean() - contractions[1::2].mean()))
    allowed = _GROWTH + 3.0 * torus.exponent_error * len(torus.exponents) + rough
    ledger.enter(Check.VOLUME, spot, Check.VOLUME.bound * off / allowed, f"{off:.1e} in the sum of exponents")
