"""Records of a finished walk: the branch, its ends, and its special points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit

if TYPE_CHECKING:
    import pandas


REACH = 0.01
"""Amplitude, as a share of the motion, up to which the period-doubled branch at a flip is examined."""
_WHOLE = 0.5  # share of that amplitude from which a criticality counts as valid over all of it
VERTEX = 1e-3
"""Parameter component of the tangent below which the branch counts as turning back."""


@dataclass(frozen=True, eq=False)
class SpecialPoint(Shown):
    """Point at which orbits appear, vanish, bifurcate, or touch a stop.

    Attributes
    ----------
    kind
        Kind of the special point.
    point
        The located point of the branch.
    before, after
        Unstable multipliers on either side, in the direction of the walk.
    uncertainty
        Estimated error of its parameter value. It is four times the difference from the same point computed with
        another discretisation (by shooting with another number of segments, by harmonic balance with more harmonics,
        so that truncation is included), plus the bracket in which the point was located. Infinite if unknown.
    contact
        For a grazing point: contact, stage and side that grazes, such as ``stage2 -``; otherwise empty.
    nature
        Criticality: ``opens to lower values`` or ``opens to higher values`` for a fold, ``supercritical`` or
        ``subcritical`` for a flip, in the limit towards the point; empty for other kinds, or if it is unknown.
    judged
        Amplitude of the doubled motion, in units of the state, up to which the doubled branch stays on the side that
        the criticality of a flip predicts. The branch is examined up to 1 % of the motion, or to where it turns back.
    """

    kind: Kind
    point: BranchPoint
    before: Instability
    after: Instability
    uncertainty: float
    contact: str = ""
    nature: str = ""
    judged: float = 0.0

    @property
    def value(self) -> float:
        """Value of the parameter."""
        return self.point.value

    @property
    def orbit(self) -> Orbit:
        """Orbit at the point."""
        return self.point.orbit

    @property
    def multiplier(self) -> complex:
        """Critical multiplier: the one nearest to +1, -1 or the unit circle; nan at a grazing point."""
        return self.kind.critical_multiplier(self.point.orbit.multipliers)

    @property
    def is_vertex(self) -> bool:
        """True for a branch point at which this branch turns back, because it branches off from the other one."""
        return self.kind is Kind.BRANCH_POINT and abs(float(self.point.tangent[-1])) < VERTEX

    @property
    def nature_words(self) -> str:
        """Criticality of the point, with the amplitude up to which it holds if the doubled branch soon turns back."""
        whole = self.kind is not Kind.FLIP or not self.nature
        if whole or self.judged >= _WHOLE * REACH * magnitude(self.orbit.state, self.orbit.system):
            return self.nature
        return f"{self.nature} up to {self.judged:.1g}"

    @property
    def multiplier_words(self) -> str:
        """Critical multiplier with six digits, a complex one with its conjugate; empty at a grazing point."""
        multiplier = self.multiplier
        if np.isnan(multiplier):
            return ""
        if abs(multiplier.imag) <= 1e-9 * abs(multiplier):
            return f"{multiplier.real:+.6f}"
        return f"{multiplier.real:+.6f} ± {abs(multiplier.imag):.6f}i"

    @property
    def change(self) -> str:
        """Change of stability in the direction of the walk, in words."""
        texts = ["stable" if side.total == 0 else f"unstable({side.total})" for side in (self.before, self.after)]
        return texts[0] if texts[0] == texts[1] else " -> ".join(texts)

    def __repr__(self) -> str:
        place = f"{self.kind} at {self.value:.10g} +- {self.uncertainty:.0e}"
        return f"SpecialPoint({', '.join(filter(None, (place, self.change, self.nature, self.contact)))})"


@dataclass(frozen=True)
class Unexplained:
    """Step of a branch whose changes are not accounted for by its special points: one was missed there.

    Attributes
    ----------
    first, last
        Values of the parameter at the points before and after it.
    text
        Description of the change, as a sentence.
    """

    first: float
    last: float
    text: str

    def __str__(self) -> str:
        return f"between {self.first:.10g} and {self.last:.10g}: {self.text}"


@dataclass(frozen=True, eq=False)
class Branch(Shown):
    """Branch of orbits along one parameter.

    Attributes
    ----------
    parameter
        Name of the parameter that varies.
    period
        m, number of forcing periods of the orbits.
    points
        The orbits in the order of the walk.
    special_points
        Special points in the order of the walk.
    ends
        Where and why the branch ends, at its first and at its last point.
    """

    parameter: str
    period: int
    points: tuple[BranchPoint, ...]
    special_points: tuple[SpecialPoint, ...]
    ends: tuple[End, ...]

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if not self.points or len(self.ends) != 2 or self.period < 1:
            raise ValueError("a branch has no points, or no ends")
        for point in (*self.points, *(special.point for special in self.special_points)):
            if point.orbit.period != self.period or point.orbit.system[self.parameter] != point.value:
                raise ValueError("a point does not belong to its branch")

    @property
    def system(self) -> System:
        """System at the first point."""
        return self.points[0].orbit.system

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the parameter at the points, shape (points,)."""
        return np.array([point.value for point in self.points])

    def measure(self, name: str) -> NDArray[np.float64]:
        """Return one measure (see `Orbit.measure`) at each point, shape (points,)."""
        return np.array([point.measure(name) for point in self.points])

    @property
    def closed(self) -> bool:
        """True if the branch closed on itself: an isolated branch (isola), connected to no other."""
        return self.ends[-1].reason is EndReason.CLOSED

    @cached_property
    def unexplained(self) -> tuple[Unexplained, ...]:
        """Steps whose changes are not accounted for by the special points in them: a point was missed there.

        Compared are the number of unstable multipliers, the direction, the sign of the determinant, and the number of
        closings of each contact. The tuple is empty if nothing was missed.
        """
        from gapwalk.bifurcation.detector import unexplained_of

        return unexplained_of(self)

    @cached_property
    def instabilities(self) -> tuple[Instability, ...]:
        """Unstable multipliers at each point."""
        return tuple(point.instability for point in self.points)

    def special(self, kind: Kind | str) -> tuple[SpecialPoint, ...]:
        """Return the special points of one kind."""
        return tuple(special for special in self.special_points if special.kind == kind)

    def summary(self) -> Iterator[str]:
        """Return range, points and special points of the branch in a line, then where and why it ends."""
        symbol = parameter_symbol(self.parameter, self.system.units)
        yield (
            f"period-{self.period} motions over {symbol} from {self.values[0]:.10g} to {self.values[-1]:.10g}: "
            f"{self.counts}"
        )
        for end in self.ends:
            yield f"  {symbol} = {end.value:.10g}: {end.reason_words}"

    @property
    def counts(self) -> str:
        """Numbers of points and special points in words."""
        stable = sum(point.stable for point in self.points)
        kinds = ", ".join(f"{len(self.special(kind))} {kind.value}" for kind in Kind.known() if self.special(kind))
        return f"{len(self.points)} points, {stable} of them stable; {kinds or 'no special points'}"

    def plot(self, measure: str = "half", **options: Any):
        """Draw the branch and return the axes; `measure` is a coordinate (``"q1"``) or a measure (``"max.q1"``).

        Options are those of `gapwalk.plot.draw` and `gapwalk.plot.branches.draw_branches`.
        """
        from gapwalk.plot import draw

        return draw(self, measure, **options)

    def to_dataframe(self, *measures: str) -> pandas.DataFrame:
        """Return the points as a pandas DataFrame: parameter, stability, contacts, and measures of each coordinate.

        Needs pandas (``pip install gapwalk[dataframe]``).
        """
        import pandas as pd

        names = measures or tuple(f"{kind}.{q}" for q in self.system.coordinates for kind in ("half", "max", "min"))
        columns: dict[str, Any] = {self.parameter: self.values}
        columns["stable"] = [point.stable for point in self.points]
        columns["instability"] = [point.instability.label for point in self.points]
        columns["contacts"] = [point.orbit.pattern for point in self.points]
        columns.update({name: self.measure(name) for name in names})
        return pd.DataFrame(columns)

    def __repr__(self) -> str:
        kinds = ", ".join(f"{len(self.special(kind))} {kind}" for kind in Kind.known() if self.special(kind))
        return (
            f"Branch(period {self.period}, {self.parameter} {self.points[0].value:.6g} ... "
            f"{self.points[-1].value:.6g}, {len(self.points)} points, {kinds or 'no special points'})"
        )
