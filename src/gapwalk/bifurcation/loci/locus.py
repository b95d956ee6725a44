"""Records of a finished locus: its points, its ends, and its points of codimension two."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import halves_apart, is_close
from gapwalk.bifurcation.kinds.critical_multipliers import critical_pair
from gapwalk.bifurcation.kinds.grazing import Graze, find_grazing
from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.loci.locus_equations import (
    MARGIN,
    GrazingEquation,
    MultiplierEquation,
    Secant,
    ShotPlane,
    SlidingEquation,
    onto_curve,
    posed,
    zero_along,
)
from gapwalk.bifurcation.special_point import Kind, StepInterval
from gapwalk.bifurcation.touch_map import TouchMap, touch_map
from gapwalk.bracketed_root import zero_between_signs
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.curve import Measured
from gapwalk.continuation.curve_points import BranchPoint, OrbitOnCurve
from gapwalk.continuation.walk import AnyEnd, Reason
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.words import parameter_symbol, with_error
from gapwalk.orbit.orbit import Orbit, apart, describe_switch
from gapwalk.summary import Described, SummaryParts, Table, Tables, rows_of, summarizes


class LocusEndReason(Reason):
    """Reason why a locus ends; the value is the sentence that a user reads."""

    START = "the start lies on the edge of the range"
    RANGE = "the edge of the range was reached"
    TABLE = "a load is not known beyond the end of its table"
    CLOSED = "the locus closed on itself"
    RESONANCE = "the locus ends at a strong resonance"
    DEGENERATE = "the locus ends at a degenerate-sliding point"
    JOINED = "the locus ends where its orbits repeat after half their period"
    GRAZE = "the locus ends on the locus of a graze, which it touches"
    COARSE = "the motion needs more segments (shooting) or harmonics (harmonic balance)"
    STEP = "the step became smaller than the smallest allowed"
    POINTS = "the largest number of points was reached"
    STOPPED = "the walk was stopped before its end"

    @property
    def is_failure(self) -> bool:
        """True if the numerics gave up."""
        return self in (LocusEndReason.COARSE, LocusEndReason.STEP)


@dataclass(frozen=True, slots=True)
class LocusEnd(AnyEnd):
    """Place and reason of the end of a locus."""

    reason: LocusEndReason  #: The reason.
    values: tuple[float, float]  #: Values of both parameters there.
    detail: str = ""  #: Further explanation; may be empty.

    @property
    def place(self) -> str:
        """Place of the end in words."""
        first, second = self.values
        return f"({first:.8g}, {second:.8g})"


@dataclass(frozen=True, eq=False)
class LocusPoint(OrbitOnCurve):
    """Point of a locus."""

    values: tuple[float, float]  #: Values of both parameters.
    orbit: Orbit  #: The orbit at its bifurcation; its system carries all parameter values.
    #: Argument of the critical multiplier in radians, from 0 (fold) to pi (flip); on a grazing locus the angle
    #: ``theta*`` at which the contact touches.
    angle: float
    #: shape (N + 1,): Unknowns of the equation, then the second parameter, scaled; the first parameter is the last
    #: unknown.
    x: NDArray[np.float64]
    #: shape (N + 1,): Unit tangent of the locus there, in scaled variables, in the direction of the walk.
    tangent: NDArray[np.float64]
    arclength: float  #: Scaled arclength from the start of the walk.

    def __repr__(self) -> str:
        first, second = self.values
        return f"LocusPoint({first:.10g}, {second:.10g}, contacts {self.orbit.pattern})"


class Codim2(StrEnum):
    """Kind of a point of codimension two."""

    CUSP = "cusp"
    """Two folds merge and vanish."""
    FOLD_FLIP = "fold-flip"
    """A multiplier at +1 and one at -1."""
    FOLD_NEIMARK_SACKER = "fold-neimark-sacker"
    """A multiplier at +1 and a pair on the unit circle."""
    FLIP_NEIMARK_SACKER = "flip-neimark-sacker"
    """A multiplier at -1 and a pair on the unit circle."""
    RESONANCE_1_1 = "1:1"
    """Both critical multipliers at +1: a Neimark-Sacker locus ends on a fold locus."""
    RESONANCE_1_2 = "1:2"
    """Both critical multipliers at -1: a Neimark-Sacker locus ends on a flip locus."""
    RESONANCE_1_3 = "1:3"
    """The critical pair at third roots of 1."""
    RESONANCE_1_4 = "1:4"
    """The critical pair at fourth roots of 1."""
    GENERALISED_FLIP = "generalised-flip"
    """The flip changes from supercritical to subcritical: a fold locus of the doubled motions ends there."""
    GRAZING = "grazing"
    """A contact grazes at the bifurcation; on a grazing locus: another contact, or the same one a second time."""
    DEGENERATE_GRAZING = "degenerate-grazing"
    """The maximum and the minimum that graze merge: the grazing locus has a cusp."""
    FOLD_GRAZING = "fold-grazing"
    """On a grazing locus: a multiplier at +1."""
    FLIP_GRAZING = "flip-grazing"
    """On a grazing locus: a multiplier at -1."""
    NEIMARK_SACKER_GRAZING = "neimark-sacker-grazing"
    """On a grazing locus: a pair on the unit circle."""
    DEGENERATE_SLIDING = "degenerate-sliding"
    """Where slip ends the friction would neither give way again nor hold: crossing- becomes switching-sliding, and
    grazing- or adding-sliding begins."""
    RESONANT_GRAZING = "resonant-grazing"
    """The square-root term of a graze vanishes: loci of folds and flips end there, tangent to that of the graze."""
    GRAZING_MEETS_FOLD = "grazing-meets-fold"
    """A fold locus ends on the grazing locus, which it touches there, of several degrees of freedom."""
    GRAZING_MEETS_FLIP = "grazing-meets-flip"
    """A flip locus ends on the grazing locus, which it touches there, of several degrees of freedom."""


@dataclass(frozen=True, eq=False)
class Codim2Point:
    """Point of a locus at which a second condition holds."""

    kind: Codim2  #: Its kind.
    point: LocusPoint  #: The located point of the locus.
    contact: str = ""  #: The contact, stage and side that grazes, such as ``stage2 -``; empty if none does.
    #: Estimated errors of both values: four times the distance along the locus at which its condition is no longer zero
    #: but for rounding, and four times the distance from a breakpoint at which grazing motions are computed.
    errors: tuple[float, float] = (math.inf, math.inf)

    @property
    def values(self) -> tuple[float, float]:
        """Values of both parameters."""
        return self.point.values

    @property
    def orbit(self) -> Orbit:
        """Orbit at the point."""
        return self.point.orbit

    @property
    def cells(self) -> list[str]:
        """Both values with their errors, and the angle, in words."""
        values = (with_error(*each, 10) for each in zip(self.values, self.errors, strict=True))
        return [*values, f"{self.point.angle:.6f}"]

    def __repr__(self) -> str:
        first, second = self.values
        contact = f", {self.contact}" if self.contact else ""
        return f"Codim2Point({self.kind.value} at ({first:.10g}, {second:.10g}){contact})"


@dataclass(frozen=True, eq=False)
class Locus(Measured, Described):
    """Curve of special points of one kind in the plane of two parameters."""

    kind: Kind  #: Kind of the special points: fold, flip, Neimark-Sacker, grazing.
    #: first, second: Names of the parameters.
    first: str
    second: str
    period: int  #: m, number of forcing periods of the orbits.
    points: tuple[LocusPoint, ...]  #: Its points in the order of the walk.
    codim2_points: tuple[Codim2Point, ...]  #: Points of codimension two in the order of the walk.
    ends: tuple[LocusEnd, LocusEnd]  #: Ends of the locus with their reasons, at its first and at its last point.
    #: For a grazing locus: contact, stage and side that grazes, such as ``stage2 -``; otherwise empty.
    contact: str = ""

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        points = (*self.points, *(codim2.point for codim2 in self.codim2_points))
        if not self.points or self.period < 1 or any(point.orbit.period != self.period for point in points):
            raise ValueError("a locus has no points, or points of another period")

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of both parameters at each point, shape (points, 2)."""
        return np.array([point.values for point in self.points])

    @property
    def is_closed(self) -> bool:
        """True if it is a closed curve."""
        return self.ends[-1].reason is LocusEndReason.CLOSED

    @property
    def symbols(self) -> list[str]:
        """Names of both parameters as readers see them."""
        return [parameter_symbol(name, self.points[0].orbit.system.units) for name in (self.first, self.second)]

    @summarizes
    def summary(self) -> SummaryParts:
        """Return its range, its ends and its points of codimension two, in words."""
        yield f"{self.kind.value}: {self.range_words}"
        yield from self.end_words
        if self.codim2_points:
            rows = [[each.kind.value, *each.cells, each.contact] for each in self.codim2_points]
            yield Table(["point", *(f">{symbol}" for symbol in self.symbols), ">angle", "contact"], rows)

    def tables(self) -> Tables:
        """Return the tables of the points and of the points of codimension two."""
        return {
            "points": lambda: rows_of(self._row_of(point) for point in self.points),
            "codim2-points": lambda: rows_of(
                {"point": each.kind.value, **self._row_of(each.point)} for each in self.codim2_points
            ),
        }

    def _row_of(self, point: LocusPoint) -> dict[str, Any]:
        about = {"angle": point.angle, "contacts": point.orbit.pattern}
        return {**dict(zip((self.first, self.second), point.values, strict=True)), **about}

    @property
    def range_words(self) -> str:
        """Period, ranges and numbers of points, in words."""
        values = np.array([*self.values, *(each.values for each in self.codim2_points)])
        low, high = values.min(axis=0), values.max(axis=0)
        ranges = ", ".join(f"{name} {a:.8g} to {b:.8g}" for name, a, b in zip(self.symbols, low, high, strict=True))
        counts = ", ".join(f"{len(self.codim2(kind))} {kind.value}" for kind in Codim2 if self.codim2(kind))
        contact = f" of {self.contact}" if self.contact else ""
        parts = (f"period {self.period}{contact}", ranges, f"{len(self.points)} points", counts)
        return "; ".join(filter(None, parts))

    @property
    def end_words(self) -> list[str]:
        """Both ends in words; one if it is closed."""
        places = [", ".join(f"{value:.8g}" for value in end.values) for end in self.ends]
        ends = zip(places, self.ends, strict=True)
        texts = (end.reason.value if self.is_closed else f"({place}): {end.reason_words}" for place, end in ends)
        return [*dict.fromkeys(texts)]

    def codim2(self, kind: Codim2 | str) -> tuple[Codim2Point, ...]:
        """Return the points of codimension two of one kind, which may be given by its name, such as ``cusp``."""
        return tuple(point for point in self.codim2_points if point.kind == kind)

    def live(self, parameter: str, to: tuple[float, float]) -> Any:
        """Draw the locus above a slider for another parameter; see `Branch.live`."""
        from gapwalk.plot.live_slider import live_slider

        return live_slider(self, parameter, to)

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.codim2(kind))} {kind.value}" for kind in Codim2 if self.codim2(kind))
        contact = f", {self.contact}" if self.contact else ""
        return (
            f"Locus({self.kind.value}{contact}, period {self.period}, {self.first} and {self.second}, "
            f"{len(self.points)} points, {counts or 'no points of codimension two'})"
        )


# Detection and location of the points of codimension two in one step along a locus.
#
# As in `gapwalk.bifurcation.detector`, a change of sign of a test function is located by bracketing. Wherever a test
# function bends so much that it may cross zero twice between two points, the step is halved until that is excluded.
# The test functions are smooth, and zero at a point of codimension two:
#
# ==========================  ===========================================================================
# cusp, degenerate grazing    signed speed in the parameter plane: the locus turns back there
# 1:1 and 1:2 on fold, flip   sum of the products of ``mu -+ 1`` over all multipliers but one
# 1:1 to 1:4 on a pair        cosine of its argument, minus that of the resonance
# generalised flip            cubic coefficient
# fold-, flip-                product of ``mu - 1`` or ``mu + 1`` over the multipliers that are not critical
# -Neimark-Sacker             product of ``mu_i mu_j - 1`` over the pairs of those
# ==========================  ===========================================================================
#
# (Kuznetsov, Elements of Applied Bifurcation Theory, chapters 9 and 10.) Factors larger than 1 in absolute value are
# reduced to 1, so that a large multiplier cannot dominate the critical one. A fold locus of doubled motions ends at a
# generalised flip, where they reach half their period.

_TURNED = 1e-5  # speed in the parameter plane, relative to that along the locus, below which the locus turns back
_CIRCLE = 1e-5  # distance from the unit circle within which a pair counts as on it

_COSINES = {
    Codim2.RESONANCE_1_1: 1.0,
    Codim2.RESONANCE_1_2: -1.0,
    Codim2.RESONANCE_1_3: -0.5,
    Codim2.RESONANCE_1_4: 0.0,
}
_TURNING = (Codim2.CUSP, Codim2.DEGENERATE_GRAZING)
_KINDS = {
    Kind.FOLD: (Codim2.CUSP, Codim2.RESONANCE_1_1, Codim2.FOLD_FLIP, Codim2.FOLD_NEIMARK_SACKER),
    Kind.FLIP: (Codim2.RESONANCE_1_2, Codim2.FOLD_FLIP, Codim2.FLIP_NEIMARK_SACKER, Codim2.GENERALISED_FLIP),
    Kind.NEIMARK_SACKER: (*_COSINES, Codim2.FOLD_NEIMARK_SACKER, Codim2.FLIP_NEIMARK_SACKER),
}
"""Kinds of points that are detected on a locus of one kind, besides grazing contacts."""
_ON_OTHERS = {
    Codim2.DEGENERATE_GRAZING: None,
    Codim2.FOLD_GRAZING: 1.0,
    Codim2.FLIP_GRAZING: -1.0,
    Codim2.NEIMARK_SACKER_GRAZING: None,
}
"""Kinds of points on all other loci, and the value of the critical multiplier there if it is real."""
AT_GRAZE = {1.0: Codim2.FOLD_GRAZING, -1.0: Codim2.FLIP_GRAZING, None: Codim2.NEIMARK_SACKER_GRAZING}
"""Points on the locus of a graze at which a multiplier is critical, by its value; None for a pair."""
_TARGETS = {
    (Kind.FOLD, Codim2.FOLD_FLIP): -1.0,
    (Kind.FLIP, Codim2.FOLD_FLIP): 1.0,
    (Kind.NEIMARK_SACKER, Codim2.FOLD_NEIMARK_SACKER): 1.0,
    (Kind.NEIMARK_SACKER, Codim2.FLIP_NEIMARK_SACKER): -1.0,
}
"""Value of the second critical multiplier, on a locus of one kind."""
RESONANT = {Codim2.RESONANT_GRAZING: None, Codim2.GRAZING_MEETS_FOLD: 1.0, Codim2.GRAZING_MEETS_FLIP: -1.0}
"""Kinds of points on grazing loci where a touch has a square-root term: the multiplier that no longer depends on it."""
_ONE = 1e-6  # arclength, and share of its largest value, within which these vanish at one point, as with one coordinate
_DOUBT = 0.5  # share of its bend by which a test function may dip between the ends of an interval; 1/8 for a parabola
_FINEST = 1e-5  # arclength below which two zeros are not distinguished
_NOISE = 1e-8  # absolute value of a test function that is only rounding
_TOUCHING = 1e-7  # depth, in units of the unknowns, within which a turning point grazes
_MERGED = 0.1  # radians from the turning point that grazes all along a grazing locus, within which it is the same one
_EXACT = 1e-13  # arclength to which zeros are located
_BESIDE = 1e-5  # arclength from a cusp at which the parameters change at normal speed again
_CUSP = 0.5  # largest sum of the tangents on both sides of a cusp, where they should be opposite, by their difference
_CLOSE = (0.0, *(way * 10.0**power for power in range(-12, -4) for way in (-1.0, 1.0)))
"""Arclengths from a point of a locus of sliding at which another one is taken if it cannot be computed."""
_ACROSS = 1e-5  # arclength from degenerate sliding at which all orbits are known
_SECANT = Secant(first=1e-3, exact=1e-9)  # the accuracy to which the coefficient is known
_STEP = 0.01  # first step of a secant beside a graze, as a share of the root of the distance from the breakpoint
_AHEAD = 0.5  # smallest cosine of the angle between the locus and the way to its end at a graze
_BEGUN = 1e-6  # arclength from degenerate sliding within which a locus begins there
_CLOSE_TO_START, _AT_START = 0.3, 1e-3  # radians from the start of a phase: close to it, and where the two are one
_AT_ONCE = 0.4  # the least share of them after a step
_NEAR_DEGENERATE = 0.02  # arclength, and radians, from degenerate sliding at which a locus may end short of it
_ENDING, _OVERS = 0.02, (2.0, 1.2)  # distance within which the end of a locus of sliding is sought, and shares of it
_OVER = 2.0  # largest distance of the end, in estimated distances


class Finding(NamedTuple):
    """Point of codimension two: its kind, its place, and the contact that grazes, if any."""

    kind: Codim2
    point: BranchPoint
    contact: str = ""
    error: float = 0.0
    """Arclength within which it is known."""

    def reason_of_end(self, locus: Kind) -> tuple[LocusEndReason, str]:
        """Return the reason why a locus ends there, and an explanation."""
        if locus is Kind.NEIMARK_SACKER and self.kind in _COSINES:
            return LocusEndReason.RESONANCE, ""
        if self.kind is not Codim2.DEGENERATE_SLIDING:
            return LocusEndReason.GRAZE, self.kind.value.replace("-", " ")
        other = cast("Sliding", locus).beyond_degenerate
        words = f"beyond it this curve is a locus of {other}" if other else "crossing- and switching-sliding meet there"
        return LocusEndReason.DEGENERATE, words


def find_codim2(
    locus: Kind, corrector: Corrector, before: BranchPoint | None, first: BranchPoint, last: BranchPoint
) -> list[Finding]:
    """Return the points of codimension two between two neighbouring points, in order; `before` is the point before."""
    interval = StepInterval(corrector, first, last)
    found = [
        Finding(Codim2.GRAZING, graze.point, describe_switch(graze.point.orbit, graze.switch), graze.spread)
        for graze in find_grazing(interval, before, first, last)
        if not _is_echo(corrector, graze)
    ]
    for what in _of_sliding(locus) if isinstance(locus, Sliding) else _KINDS.get(locus, _ON_OTHERS):
        function = test_function(locus, what, corrector, first)
        if what is Codim2.DEGENERATE_SLIDING:
            interval = _DegenerateInterval(corrector, first, last, function)
        zeros = _search(function, interval, first, last, before)
        if isinstance(interval, _DegenerateInterval):
            zeros = [interval.refined(point) for point in zeros if point.arclength > _BEGUN]
            if not zeros and is_other_sliding(locus, corrector, last):
                raise NumericalError(f"the locus ceases to be one of {locus}, and degenerate sliding was not located")
        genuine = (point for point in zeros if _is_genuine(locus, what, point, interval))
        found += [Finding(what, point, "", _error(function, interval, point)) for point in genuine]
    if isinstance(corrector.equation, GrazingEquation):
        found += _resonances(corrector, interval, before, first, last)
    return sorted(found, key=lambda finding: finding.point.arclength)


class _DegenerateInterval(StepInterval):
    """Step interval in which orbits so close to degenerate sliding that rounding decides are replaced by close ones."""

    def __init__(
        self, corrector: Corrector, first: BranchPoint, last: BranchPoint, function: Callable[[BranchPoint], float]
    ) -> None:
        super().__init__(corrector, first, last)
        self._function, self._within = function, (first.arclength, last.arclength)

    def at(self, arclength: float) -> BranchPoint:
        """Return the point at an arclength, or the nearest of some beside it that can be computed."""
        for aside in _CLOSE:
            with suppress(NumericalError):
                point = super().at(min(max(arclength + aside, self._within[0]), self._within[1]))
                self._function(point)
                return point
        return super().at(arclength)

    def refined(self, zero: BranchPoint) -> BranchPoint:
        """Return the point at the zero of the secant across a place near a zero, far enough to both sides."""
        sides = (self.at(zero.arclength + way * _ACROSS) for way in (-1.0, 1.0))
        (a, at_a), (b, at_b) = ((each.arclength, self._function(each)) for each in sides)
        place = a - at_a * (b - a) / (at_b - at_a) if at_a * at_b < 0.0 else zero.arclength
        known = list[BranchPoint]()
        for aside in _CLOSE:
            with suppress(NumericalError):
                point = self.at(place + aside)
                _ = point.orbit.extremes  # the motion is known all along
                known.append(point)
        return min(known, key=lambda point: abs(self._function(point)), default=zero)


def tested(locus: Kind) -> list[Codim2]:
    """Return the kinds of points on a locus whose test function needs no more than the points of the locus."""
    kinds = () if isinstance(locus, Sliding) else _KINDS.get(locus, _ON_OTHERS)
    return [each for each in kinds if each is not Codim2.GENERALISED_FLIP]


def _of_sliding(kind: Sliding) -> tuple[Codim2, ...]:
    return (Codim2.DEGENERATE_SLIDING,) if kind.tangency else ()


def errors_of(finding: Finding, corrector: Corrector) -> tuple[float, float]:
    """Return the estimated errors of both values at a point of codimension two."""
    along = 4.0 * finding.error * np.abs(finding.point.tangent[-2:]) if finding.error < np.inf else np.full(2, np.inf)
    size = float(np.abs(finding.point.orbit.extremes[:, :2]).max())
    grazes = finding.contact and finding.kind is not Codim2.DEGENERATE_SLIDING
    share = MARGIN * float(corrector.scales[0]) / size if grazes else _EXACT
    errors = (along + 4.0 * share * np.abs(finding.point.x[-2:])) * corrector.scales[-2:]
    return float(errors[0]), float(errors[1])


def _resonances(
    corrector: Corrector, interval: StepInterval, before: BranchPoint | None, first: BranchPoint, last: BranchPoint
) -> list[Finding]:
    """Return the points between two points of a grazing locus at which the square-root term of the touch vanishes."""
    equation = cast("GrazingEquation", corrector.equation)
    theta, contact, found = float(first.x[-3] * corrector.scales[-3]), describe_switch(first.orbit, equation.switch), []
    if not resonance(first, equation.switch, theta, 1.0):
        return []
    kinds = {AT_GRAZE[one]: one for one in (1.0, -1.0)} if first.memo["touch"].order == 1.0 else RESONANT
    for what, target in kinds.items():

        def function(point: BranchPoint, target: float | None = target) -> float:
            return resonance(point, equation.switch, float(point.x[-3] * corrector.scales[-3]), target)

        for point in _search(function, interval, first, last, before):
            if all(abs(point.arclength - other.point.arclength) > _ONE for other in found):
                found.append(Finding(what, point, contact, _error(function, interval, point)))
    return found


def resonance(point: BranchPoint, switch: int, theta: float, target: float | None) -> float:
    """Return what vanishes where a locus of multipliers ends at a touch, for a target; for any, if None.

    Of order 1/2 it is the square-root term as it moves a multiplier away from a target: ``c M b``, or
    ``c adj(target - M) M b``, with c and M b scaled to 1; see `TouchMap`. Of order 1, where the touch changes M at
    once, it is the determinant of target - M with that change. Otherwise it is zero.
    """
    if "touch" not in point.memo:
        point.memo["touch"] = touch_map(point.orbit, switch, theta)
    touch: TouchMap | None = point.memo["touch"]
    if touch is None or touch.order == 1.5:
        return 0.0
    if touch.order == 1.0:
        return touch.determinant(target) if target is not None else 0.0
    scale = float(np.linalg.norm(touch.covector) * np.linalg.norm(touch.vector))
    return (float(touch.covector @ touch.vector) if target is None else touch.adjugate(target)) / scale


def zero_at_graze(
    touches: Sequence[Corrector],
    start: NDArray[np.float64],
    function: Callable[[Correction], float],
    farthest: float = 0.1,
) -> Correction | None:
    """Locate a zero of a function on the locus of a graze, by motions that miss the contact by ever less."""
    found: Correction | None = None
    for each in touches:
        first = _STEP * math.sqrt(abs(cast("GrazingEquation", each.equation).depth) / float(each.scales[0]))
        found = zero_along(each, start, function, Secant(first=first, farthest=farthest))
        if found is None:
            break
        start = found.x
    return found


def find_end_at_graze(
    target: float | None, touches: Sequence[Corrector], start: NDArray[np.float64], point: BranchPoint, within: float
) -> Finding | None:
    """Locate the end of a locus of multipliers on the locus of a graze; None if none is near.

    The correctors are those of motions beside the graze, nearer to it one after the other.

    A multiplier is critical at a depth whose root is half the response of the motion to the touch (see `TouchMap`). So
    the locus ends where that response vanishes, which is sought on the locus of the graze.
    """
    touch = touches[-1]
    equation = cast("GrazingEquation", touch.equation)
    if target is None and equation.plane.system.state_size > 2:
        return None  # a pair leaves where two terms vanish, of which none is known to be the end of the locus

    def there(correction: Correction) -> BranchPoint:
        x = correction.x * touch.scales
        orbit, place = equation.orbit(x[:-1], float(x[-1]), correction.evaluation), np.delete(correction.x, -3)
        length = float(np.linalg.norm(place - point.x))
        return replace(
            point, value=float(x[-1]), orbit=orbit, x=place, arclength=point.arclength + length,
            tangent=(place - point.x) / (length or 1.0), memo={},
        )  # fmt: skip

    def function(correction: Correction) -> float:
        theta = float(correction.x[-3] * touch.scales[-3])
        return resonance(there(correction), equation.switch, theta, target)

    found = zero_at_graze(touches, start, function, 2.0 * within)
    if found is None:
        return None
    end = there(found)
    length, (way, along) = end.arclength - point.arclength, ((end.x - point.x)[-2:], point.tangent[-2:])
    ahead = float(way @ along) >= _AHEAD * float(np.linalg.norm(way) * np.linalg.norm(along))
    if not 0.0 < length < within or not ahead:
        return None
    theta = float(found.x[-3] * touch.scales[-3])
    every = abs(resonance(end, equation.switch, theta, None)) < _ONE
    meets = {1.0: Codim2.GRAZING_MEETS_FOLD, -1.0: Codim2.GRAZING_MEETS_FLIP}.get(target or 0.0)
    what = Codim2.RESONANT_GRAZING if every or meets is None else meets
    if end.memo["touch"].order == 1.0:
        what = AT_GRAZE[target]
    here, values = function(found), []
    for way in (-_BESIDE, _BESIDE):
        beside = touch.correct(found.x + way * (tangent := onto_curve(touch, found.x)[1]), tangent)
        values.append(function(beside) if beside is not None else math.nan)
    here = abs(here) + (abs(resonance(end, equation.switch, theta, None)) if every else 0.0)  # several points in one
    off, slope = abs(here) + abs(0.5 * sum(values) - here), abs(values[1] - values[0]) / (2.0 * _BESIDE)
    return Finding(what, end, describe_switch(end.orbit, equation.switch), off / slope if slope > 0.0 else math.inf)


def _is_echo(corrector: Corrector, graze: Graze) -> bool:
    """Return True if the touch belongs to a grazing locus itself, where the margin changes sides or its turns merge."""
    equation = corrector.equation
    if not isinstance(equation, GrazingEquation) or equation.switch != graze.switch:
        return False
    full, depths = PERIOD * equation.period, graze.point.orbit.turning_depths[graze.switch]
    own = float(graze.point.x[-3] * corrector.scales[-3]) % full
    touches = [theta for theta, depth in zip(*depths, strict=True) if abs(depth) < _TOUCHING * corrector.scales[0]]
    return all(apart(theta, own, full) < _MERGED for theta in touches)


def test_function(
    locus: Kind, what: Codim2, corrector: Corrector, first: BranchPoint
) -> Callable[[BranchPoint], float]:
    """Return the test function of one kind of point on a locus; `first` is the point at which a step begins."""
    if what in _TURNING:
        heading = first.tangent[-2:] / (float(np.linalg.norm(first.tangent[-2:])) or 1.0)
        return lambda point: float(point.tangent[-2:] @ heading)

    def compute(point: BranchPoint) -> float:
        if isinstance(corrector.equation, SlidingEquation):
            return corrector.equation.tangency(point.x[:-1] * corrector.scales[:-1], point.value)
        if what is not Codim2.GENERALISED_FLIP:
            return _multiplier_test(locus, what, point.orbit.free_multipliers)
        equation = cast("MultiplierEquation", corrector.equation)
        coefficient = equation.flip_coefficient(point.x[:-1] * corrector.scales[:-1], point.value)
        return coefficient * _product(point.orbit.free_multipliers - 1.0)  # the factor removes its poles, at fold-flips

    def function(point: BranchPoint) -> float:
        known = point.memo.get(what)
        if known is None:
            known = point.memo[what] = compute(point)
        return known

    return function


def _product(factors: NDArray[np.complex128]) -> float:
    return float(np.prod(_cut(factors)).real)


def _cut(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return factors / np.maximum(1.0, np.abs(factors))


def _multiplier_test(locus: Kind, what: Codim2, multipliers: NDArray[np.complex128]) -> float:
    """Evaluate the test function of a kind that is defined by the multipliers."""
    critical = _critical(locus, multipliers)
    if what in _COSINES:
        if locus is Kind.NEIMARK_SACKER:
            return 0.5 * float(multipliers[critical].sum().real) - _COSINES[what]
        # the sum of all products without one factor is smooth where two factors meet
        table = np.tile(_cut(multipliers - _COSINES[what]), (len(multipliers), 1))
        np.fill_diagonal(table, 1.0)
        return float(table.prod(axis=1).sum().real)
    others = np.delete(multipliers, critical)
    target = _TARGETS.get((locus, what), _ON_OTHERS.get(what))
    if target is not None:
        return _product(others - target)
    first, second = np.triu_indices(len(others), 1)
    return _product(others[first] * others[second] - 1.0)


def _critical(locus: Kind, multipliers: NDArray[np.complex128]) -> list[int]:
    """Return the indices of the multipliers that are critical all along a locus."""
    return list(critical_pair(multipliers)) if locus is Kind.NEIMARK_SACKER else locus.critical(multipliers).tolist()


def _search(
    function: Callable[[BranchPoint], float],
    interval: StepInterval,
    a: BranchPoint,
    b: BranchPoint,
    before: BranchPoint | None,
) -> list[BranchPoint]:
    """Return all zeros between two points, given the point before them, if any."""
    length, at_a, at_b = b.arclength - a.arclength, function(a), function(b)
    if not max(abs(at_a), abs(at_b)) >= _NOISE:
        return []  # undefined, or zero everywhere, as with multipliers on the unit circle without damping
    if at_a * at_b < 0.0:
        ends = a.arclength, b.arclength
        root = zero_between_signs(lambda s: function(interval.at(s)), *ends, absolute=_EXACT, relative=1e-14)
        return [interval.at(root)]
    bend = abs(at_b - at_a)
    if before is not None and before.arclength < a.arclength:
        bend = abs(at_b - at_a - (at_a - function(before)) / (a.arclength - before.arclength) * length)
    if length < _FINEST or min(abs(at_a), abs(at_b)) > _DOUBT * bend:
        return []
    middle = interval.middle(a, b)
    return _search(function, interval, a, middle, before) + _search(function, interval, middle, b, a)


def _error(function: Callable[[BranchPoint], float], interval: StepInterval, point: BranchPoint) -> float:
    """Return the arclength within which a zero is known, from values on both sides, where the function is linear."""
    first, *_, last = (each.arclength for each in interval.points)
    beside = min(_BESIDE, 0.5 * (last - first))
    places = [min(max(point.arclength + way * beside, first), last) for way in (-1.0, 1.0)]
    try:
        values = [function(interval.at(place)) for place in places]
    except NumericalError:
        return math.inf
    share = (point.arclength - places[0]) / (places[1] - places[0])
    off = abs(values[0] + share * (values[1] - values[0]) - function(point)) + abs(function(point))
    slope = abs(values[1] - values[0]) / (places[1] - places[0])
    return off / slope + _EXACT if slope else math.inf


def _is_genuine(locus: Kind, what: Codim2, point: BranchPoint, interval: StepInterval) -> bool:
    """Return True if a zero of a test function is a point of the expected kind."""
    if what in _TURNING:
        if float(np.linalg.norm(point.tangent[-2:])) < _TURNED:
            return True  # both components vanish: not a turn of 90 degrees
        # at a sharp cusp rounding leaves some speed in the parameter plane; both parameters must then turn back
        first, *_, last = (each.arclength for each in interval.points)
        beside = min(_BESIDE, point.arclength - first, last - point.arclength)
        if beside <= 0.0:
            return False
        before, after = (interval.at(point.arclength + way * beside).tangent[-2:] for way in (-1.0, 1.0))
        return bool((np.abs(after + before) < _CUSP * np.abs(after - before)).all())
    pairs = (Codim2.FOLD_NEIMARK_SACKER, Codim2.FLIP_NEIMARK_SACKER, Codim2.NEIMARK_SACKER_GRAZING)
    if locus is Kind.NEIMARK_SACKER or what not in pairs:
        return True
    multipliers = point.orbit.free_multipliers
    others = np.delete(multipliers, _critical(locus, multipliers))
    complex_ones = others[np.abs(others.imag) > _CIRCLE]
    return bool(np.any(np.abs(np.abs(complex_ones) - 1.0) < _CIRCLE))  # excludes neutral saddles


def half_ahead(before: BranchPoint | None, point: BranchPoint) -> float:
    """Return the arclength after which the orbits reach half their period; infinity if they do not approach it."""
    if before is None or point.orbit.period % 2 or not is_close(point):
        return math.inf
    past, now = (float(np.linalg.norm(halves_apart(each))) for each in (before, point))
    return (point.arclength - before.arclength) * now / (past - now) if now < past else math.inf


def find_merging(corrector: Corrector, before: BranchPoint | None, point: BranchPoint) -> BranchPoint | None:
    """Locate the end of a fold locus, where its orbits reach half their period, if it is just ahead; otherwise None."""
    # The equation is singular there, because every flip of the parent solves it too. So the end is located on the locus
    # of those flips as the zero of their cubic coefficient, by the secant method.
    distance = half_ahead(before, point)
    if distance == math.inf:
        return None
    equation = cast("MultiplierEquation", corrector.equation)
    shared = np.append(equation.plane.shared(), [True, True])  # and both parameters
    plane, scales = equation.plane.halved(), corrector.scales[shared]
    flips = replace(equation, plane=plane, kind=Kind.FLIP, scales=scales)
    middle = equation.plane.mean_of_halves(point.orbit) / scales[:-2]

    def coefficient(correction: Correction) -> float:
        x = correction.x * scales
        return flips.flip_coefficient(x[:-1], float(x[-1]))

    found = zero_along(Corrector(flips, scales), np.concatenate((middle, point.x[-2:])), coefficient, _SECANT)
    if found is None:
        return None
    end = np.zeros(len(point.x))
    end[shared] = found.x
    way = end - point.x
    length = float(np.linalg.norm(way))
    return corrector.uncorrected(end, way / length, point.arclength + length) if length < _OVER * distance else None


def find_degenerate(
    corrector: Corrector, contact: str, before: BranchPoint | None, point: BranchPoint
) -> Finding | None:
    """Locate the end of a locus of sliding within a phase, just ahead at degenerate sliding; None if none is."""
    # The instant comes to the beginning of its phase, where slip in the other direction ends: to the locus of that.
    equation, scales = corrector.equation, corrector.scales
    if before is None or not isinstance(equation, SlidingEquation):
        return None
    past, now = (since_begin(corrector, each) for each in (before, point))
    reach = (point.arclength - before.arclength) * now / (past - now) if now < past else math.inf
    if not reach < _ENDING:
        return None
    other = contact[:-1] + ("-" if contact.endswith("+") else "+")
    plane, kind = cast("ShotPlane", equation.plane), cast("Sliding", Kind.SWITCHING_SLIDING)
    length = float(plane.scales(point.orbit)[0])
    ends = Corrector(posed(plane, kind, point.orbit, other, length, plane.tolerance), scales)
    start = point.x.copy()
    start[-3] -= now / scales[-3]
    correction, tangent = onto_curve(ends, start)
    if correction is None:
        return None
    ahead = tangent * math.copysign(1.0, float(np.delete(tangent * point.tangent, -3).sum()))
    tried = (ends.correct(correction.x + over * reach * ahead, ahead) for over in _OVERS)
    if (beyond := next(filter(None, tried), None)) is None:
        return None
    first, length = ends.point(correction, ahead, 0.0), float(np.linalg.norm(beyond.x - correction.x))
    for found in find_codim2(kind, ends, None, first, ends.point(beyond, ahead, length)):
        if found.kind is Codim2.DEGENERATE_SLIDING:
            arclength = point.arclength + float(np.linalg.norm(found.point.x - point.x))
            return found._replace(point=replace(found.point, arclength=arclength), contact=other)
    return None


def since_begin(corrector: Corrector, point: BranchPoint) -> float:
    """Return the angle from the end of slip in the other direction to an instant within a phase; infinite without."""
    equation = corrector.equation
    if not isinstance(equation, SlidingEquation):
        return math.inf
    return equation.since_begin(point.orbit.slips, float(point.x[-3] * corrector.scales[-3]))


def leaves_phase(corrector: Corrector, point: BranchPoint, last: BranchPoint, *, is_coarse: bool) -> bool:
    """Return True if a step comes to the beginning of the phase of an instant, or over it, which only its end may."""
    now, then = (since_begin(corrector, each) for each in (point, last))
    least = max(_AT_START, _AT_ONCE * now * is_coarse)
    return now < _CLOSE_TO_START and not least < then < now + _CLOSE_TO_START


def is_other_sliding(locus: Kind, corrector: Corrector, point: BranchPoint, ahead: float = 0.0) -> bool:
    """Return True if a point of a locus where slip ends, or one just ahead of it, is of the other kind."""
    if not isinstance(locus, Sliding) or not locus.tangency:
        return False
    x = (point.x + ahead * point.tangent) * corrector.scales
    with suppress(NumericalError):
        return locus.tangency * cast("SlidingEquation", corrector.equation).tangency(x[:-1], float(x[-1])) < -_NOISE
    return not ahead  # where it is not known, the point is not taken for one of its kind


def leaves_degenerate(locus: Kind, corrector: Corrector, first: BranchPoint) -> bool:
    """Return True if a locus begins at degenerate sliding, and is of the other kind ahead."""
    sides = (is_other_sliding(locus, corrector, first, way * _BEGUN) for way in (-1.0, 1.0))
    return [*sides] == [False, True]


def short_of(locus: Kind, corrector: Corrector, point: BranchPoint) -> str:
    """Return the explanation if a locus that cannot be followed further ends short of degenerate sliding."""
    is_other = is_other_sliding(locus, corrector, point, _NEAR_DEGENERATE)
    near = is_other or since_begin(corrector, point) < _NEAR_DEGENERATE
    return "a degenerate-sliding point is near, but was not located" * near
