"""Records of a finished locus: its points, its ends, and its points of codimension two."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve import Measured
from gapwalk.continuation.curve_points import OrbitOnCurve
from gapwalk.continuation.walk import AnyEnd, Reason
from gapwalk.orbit.orbit import Orbit


class LocusEndReason(Reason):
    """Reason why a locus ends; the value is the sentence that a user reads."""

    START = "the start lies on the edge of the range"
    RANGE = "the edge of the range was reached"
    TABLE = "a load is not known beyond the end of its table"
    CLOSED = "the locus closed on itself"
    RESONANCE = "the locus ends at a strong resonance"
    JOINED = "the locus ends where its orbits reach half their period"
    COARSE = "the motion needs to be resolved more finely"
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


@dataclass(frozen=True, eq=False)
class Codim2Point:
    """Point of a locus at which a second condition holds."""

    kind: Codim2  #: Its kind.
    point: LocusPoint  #: The located point of the locus.
    contact: str = ""  #: The contact, stage and side that grazes, such as ``stage2 -``; empty if none does.

    @property
    def values(self) -> tuple[float, float]:
        """Values of both parameters."""
        return self.point.values

    @property
    def orbit(self) -> Orbit:
        """Orbit at the point."""
        return self.point.orbit

    def __repr__(self) -> str:
        first, second = self.values
        contact = f", {self.contact}" if self.contact else ""
        return f"Codim2Point({self.kind.value} at ({first:.10g}, {second:.10g}){contact})"


@dataclass(frozen=True, eq=False)
class Locus(Measured):
    """Curve of special points of one kind in the plane of two parameters.

    Examples
    --------
    >>> locus.first, locus.second, locus.values.shape == (len(locus.points), 2)
    ('frequency', 'stop.clearance', True)
    """

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

    def codim2(self, kind: Codim2 | str) -> tuple[Codim2Point, ...]:
        """Return the points of codimension two of one kind, which may be given by its name, such as ``cusp``."""
        return tuple(point for point in self.codim2_points if point.kind == kind)

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.codim2(kind))} {kind.value}" for kind in Codim2 if self.codim2(kind))
        contact = f", {self.contact}" if self.contact else ""
        return (
            f"Locus({self.kind.value}{contact}, period {self.period}, {self.first} and {self.second}, "
            f"{len(self.points)} points, {counts or 'no points of codimension two'})"
        )
