"""Record of a special point: where it is, its kind, its error, and the stability on either side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.flow.length_unit import magnitude
from gapwalk.flow.motion import switch_names
from gapwalk.notebook import Shown
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import SummaryParts, summarizes

if TYPE_CHECKING:
    from gapwalk.bifurcation.loci.gradient import Gradient
    from gapwalk.orbit.method import Method

REACH = 0.01
"""Amplitude, as a share of the motion, up to which the period-doubled branch at a flip is examined."""
_ONE_PLACE = 1e-7  # arclength within which points of two contacts or directions may be one event
_ROUNDED = 1e-12  # relative rounding of their parameter
_TIMES = {1: "", 2: "double ", 3: "triple "}
_WHOLE = 0.5  # share of that amplitude from which a criticality counts as valid over all of it
VERTEX = 1e-3
"""Parameter component of the tangent below which the branch counts as turning back."""


@dataclass(frozen=True, eq=False)
class SpecialPoint(Shown):
    """Point at which orbits appear, vanish, bifurcate, or touch a stop.

    Examples
    --------
    >>> str(fold.kind), round(fold.value, 9), fold.uncertainty < 1e-10
    ('fold', 1.392108885, True)
    >>> fold.nature, fold.orbit.measure("max.x") > 1.0
    ('opens to lower values', True)
    """

    _row: ClassVar = {
        "kind": "kind",
        "parameter": "value",
        "uncertainty": "uncertainty",
        "before": "before.label",
        "after": "after.label",
        "unstable.before": "before.total",
        "unstable.after": "after.total",
        "multiplier": "multiplier",
        "stability": "change",
        "multiplicity": "multiplicity",
        "nature": "nature",
        "judged": "judged",
        "contact": "contact",
        "contacts": "orbit.pattern",
    }

    kind: Kind  #: Kind of the special point.
    point: BranchPoint  #: The located point of the branch.
    #: before, after: Unstable multipliers on either side, in the direction of the walk.
    before: Instability
    after: Instability
    #: Estimated error of its parameter value. It is four times the difference from the same point computed with another
    #: discretisation (by shooting with another number of segments, by harmonic balance with more harmonics, so that
    #: truncation is included), plus four times the effect of rounding of the equations, plus the bracket in which the
    #: point was located. Infinite if unknown.
    uncertainty: float
    #: For a grazing point: contact, stage and side that grazes, such as ``stage2 -``; otherwise empty.
    contact: str = ""
    #: Criticality: ``opens to lower values`` or ``opens to higher values`` for a fold, ``supercritical`` or
    #: ``subcritical`` for a flip, in the limit towards the point; empty for other kinds, or if it is unknown.
    nature: str = ""
    #: Amplitude of the doubled motion, in units of the state, up to which the doubled branch stays on the side that the
    #: criticality of a flip predicts. The branch is examined up to 1 % of the motion, or to where it turns back.
    judged: float = 0.0
    parameter: str = ""  #: Name of the parameter along which its branch was followed.
    #: Number of multipliers, or of pairs, that become critical at once: 2 at a double flip, where the parts of a
    #: machine are equal. At a double fold both turn back, and branches on which only one has turned cross there.
    multiplicity: int = 1

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
        return self.kind.critical_multiplier(self.point.orbit.free_multipliers)

    @property
    def ways(self) -> int:
        """Number of directions in which other branches begin, as `Kind.ways`; they also cross at a double fold."""
        return self.kind.ways or Kind.BRANCH_POINT.ways * (self.kind.is_turning and self.multiplicity > 1)

    @property
    def is_vertex(self) -> bool:
        """True for a branch point at which this branch turns back, because it branches off from the other one."""
        return self.kind is Kind.BRANCH_POINT and abs(float(self.point.tangent[-1])) < VERTEX

    @property
    def doubles(self) -> bool:
        """True if a branch of twice the period begins or ends here.

        It does at a flip, and where the sequence of slip and stick changes and a multiplier jumps across -1. There the
        halves of the doubled motion part in proportion to the parameter, not to its square root.
        """
        jumps = self.kind.is_corner and (self.before.below - self.after.below) % 2 == 1
        return self.kind is Kind.FLIP or jumps

    @property
    def turns(self) -> bool:
        """True if the branch turns back here: at a fold, and at a corner where a multiplier jumps across +1."""
        return self.kind.is_turning or (self.is_corner and (self.before.above - self.after.above) % 2 == 1)

    @property
    def passes_flip(self) -> bool:
        """True if a multiplier passes -1 here: at a flip, and at a corner where it jumps across."""
        return self.kind is Kind.FLIP or (self.is_corner and (self.before.below - self.after.below) % 2 == 1)

    @property
    def is_corner(self) -> bool:
        """True if multipliers jump here: where slip and stick change their sequence, or a contact grazes that jumps.

        Beside such a graze (see `jumping_switches`), changes of the motion grow as the inverse of the speed of a touch.
        """
        if self.kind is not Kind.GRAZING:
            return self.kind.is_corner
        return self.contact in {describe_switch(self.orbit, switch) for switch in jumping_switches(self.orbit.system)}

    @property
    def kind_words(self) -> str:
        """Name of the kind, with the number of multipliers if several become critical at once: ``double flip``."""
        return f"{_TIMES.get(self.multiplicity, f'{self.multiplicity}-fold ')}{self.kind}"

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

    def gradient(self, *names: str, method: Method | None = None) -> Gradient:
        """Return how far other parameters move the point; see `gapwalk.bifurcation.loci.gradient.gradient`.

        Parameters
        ----------
        *names
            The parameters; by default all that are not zero.
        method
            How the orbits are posed; by default the method that found them.

        Examples
        --------
        >>> round(fold.gradient("stop.clearance")["stop.clearance"], 6)
        -0.20789
        """
        from gapwalk.bifurcation.loci.gradient import gradient

        return gradient(self, names, method)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the properties of the point, one line each."""
        return (f"{name} {text}" for name, text in self.words.items() if text)

    @property
    def words(self) -> dict[str, str]:
        """Row of the point in a table for readers: rounded, empty where there is nothing to say."""
        return {
            "kind": self.kind_words,
            "at": f"{self.value:#.10g}",
            "±": f"{self.uncertainty:.0e}" if np.isfinite(self.uncertainty) else "",
            "multiplier": self.multiplier_words,
            "stability": self.change,
            "criticality": self.nature_words,
            "contact": self.contact,
        }

    @property
    def change(self) -> str:
        """Change of stability in the direction of the walk, in words."""
        return _change(self.before, self.after)

    def __repr__(self) -> str:
        place = f"{self.kind_words} at {self.value:.10g} +- {self.uncertainty:.0e}"
        return f"SpecialPoint({', '.join(filter(None, (place, self.change, self.nature, self.contact)))})"


def at_once(special: Sequence[SpecialPoint]) -> list[tuple[SpecialPoint, ...]]:
    """Return special points in groups of those that are one event, as where both sides of a gap graze at one value."""
    groups: list[tuple[SpecialPoint, ...]] = []
    for each in special:
        last = groups[-1][-1] if groups else each
        error = last.uncertainty + each.uncertainty + _ROUNDED * abs(each.value)
        if is_one_place(each, last) and abs(each.value - last.value) <= error < np.inf:
            groups[-1] += (each,)
        else:
            groups.append((each,))
    return groups


def is_one_place(other: SpecialPoint, special: SpecialPoint) -> bool:
    """Return True if two points are one event of a symmetric motion, in two contacts or directions."""
    alike = other.kind == special.kind and not special.kind.by_multipliers and other.contact != special.contact
    return alike and abs(other.point.arclength - special.point.arclength) < _ONE_PLACE


def words_of(group: Sequence[SpecialPoint]) -> dict[str, str]:
    """Return one row of a table for readers for special points at one place, with all their contacts."""
    contacts = ", ".join(dict.fromkeys(each.contact for each in group if each.contact))
    return group[0].words | {"stability": _change(group[0].before, group[-1].after), "contact": contacts}


def _change(before: Instability, after: Instability) -> str:
    texts = [f"unstable({side.total})" if side.total else side.label for side in (before, after)]
    return texts[0] if texts[0] == texts[1] else " -> ".join(texts)


def describe_switch(orbit: Orbit, switch: int) -> str:
    """Return contact, stage and side of a switch, such as ``stage2 -``."""
    contact, stage, side = switch_names(orbit.system)[switch]
    return f"{contact}{'.' + stage if stage else ''} {'+' if side > 0 else '-'}"
