"""Record of a special point: where it is, its kind, its error, and the stability on either side."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.error_estimate import location_error
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.flow.equations import magnitude
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.flow.motion import switch_names
from gapwalk.model.registry import Registry
from gapwalk.notebook import Shown
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import SummaryParts, summarizes

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch_start import BranchStart
    from gapwalk.bifurcation.error_estimate import ErrorEstimator
    from gapwalk.bifurcation.kinds.defining_functions import Criticality
    from gapwalk.bifurcation.loci.gradient import Gradient
    from gapwalk.bifurcation.step_interval import Search, Zero
    from gapwalk.continuation.corrector import Range
    from gapwalk.orbit.method import Method


# Kind of special point: the contract that every kind fulfils, and the registry of all kinds.
#
# Method: docs/numerics/special-points.md


@dataclass(frozen=True, slots=True)
class Symbol:
    """Style in which special points of a kind are drawn.

    Examples
    --------
    >>> gw.Kind.named("fold").symbol.letters
    'LP'
    """

    label: str  #: Text of the legend.
    letters: str  #: Text next to a point; may be empty.
    #: marker, size: The matplotlib marker, and its size in points.
    marker: str
    size: float
    color: str  #: Name of a colour of the palette.
    #: Matplotlib dashes of its locus in a map; None if it has no locus.
    dashes: str | tuple[float, tuple[float, ...]] | None = None
    width: float = 1.6  #: Width of that line, in points.


class Kind(str):
    """Kind of special point.

    A kind is a string: its name, such as ``"fold"``, with which it compares equal. It also holds everything specific to
    the kind. To add one, write a subclass in a file of `gapwalk.bifurcation.kinds` and register its one instance there.
    Walks, tables, pictures, maps, verification and files then support it. If its points are zeros of a smooth function
    along the branch, it needs only `function` and `symbol`.

    Parameters
    ----------
    name
        Its name, in tables and files.

    Attributes
    ----------
    symbol
        Drawing style.
    target
        Value of the critical multiplier if it is fixed: +1 or -1.
    moves_through_one
        True if a multiplier passes +1, so that the determinant of the orbit's Jacobian changes its sign.
    ways
        Number of directions in which other periodic branches begin: 1 at a flip, 2 at a branch point, otherwise 0.
    times
        Periods of this branch in one period of those branches.
    is_turning
        True if the branch turns back, so that the parameter is stationary there.
    sign_change
        Meaning of a sign change of the function in a step, as a clause; empty if the function may change its sign for
        another reason, so that nothing can be concluded.
    noise
        Absolute value of the function below which its sign is undetermined.
    by_multipliers
        True if its locus is that of a critical multiplier, which has corners where a contact grazes.
    is_corner
        True if tangent and multipliers may jump at such a point.
    turn
        Order of detection: 0 first, 2 last. Results of earlier searches in a step make later ones shorter.

    Examples
    --------
    >>> gw.Kind.FOLD == "fold"
    True
    """

    symbol: ClassVar[Symbol] = Symbol("event", "", "d", 5.0, "grey")
    target: ClassVar[float | None] = None
    moves_through_one: ClassVar[bool] = False
    ways: ClassVar[int] = 0
    times: ClassVar[int] = 1
    is_turning: ClassVar[bool] = False
    sign_change: ClassVar[str] = ""
    noise: ClassVar[float] = 1e-6
    turn: ClassVar[int] = 2
    by_multipliers: ClassVar[bool] = True
    is_corner: ClassVar[bool] = False

    FOLD: ClassVar[Kind]
    FLIP: ClassVar[Kind]
    NEIMARK_SACKER: ClassVar[Kind]
    BRANCH_POINT: ClassVar[Kind]
    GRAZING: ClassVar[Kind]
    HELD_STOP: ClassVar[Kind]
    CROSSING_SLIDING: ClassVar[Kind]
    SWITCHING_SLIDING: ClassVar[Kind]
    GRAZING_SLIDING: ClassVar[Kind]
    ADDING_SLIDING: ClassVar[Kind]
    SLIP_ONSET: ClassVar[Kind]

    def __new__(cls, name: str) -> Self:  # noqa: D102 - as the class
        return super().__new__(cls, name)

    @staticmethod
    def known() -> tuple[Kind, ...]:
        """Return all kinds, in the order of tables and legends."""
        return tuple(KINDS.values())

    @staticmethod
    def with_locus() -> tuple[Kind, ...]:
        """Return the kinds whose points can be followed in two parameters, in the same order."""
        return tuple(kind for kind in KINDS.values() if not kind.no_locus)

    @staticmethod
    def named(name: str) -> Kind:
        """Return the kind with a name, such as ``fold``."""
        return KINDS.named(name)

    def function(self, point: BranchPoint) -> float:
        """Evaluate the test function: smooth along a branch, and zero with a sign change at a point of this kind."""
        raise NotImplementedError(f"a {self} is not the zero of one function")

    def hides(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Return True if two neighbours, at which the function has one sign, show that it vanishes twice in between."""
        return False

    @property
    def value(self) -> str:
        """Name of the kind, as for members of an enumeration."""
        return str(self)

    @property
    def has_function(self) -> bool:
        """True if its points are the zeros of one test function."""
        return type(self).function is not Kind.function

    def at(self, point: BranchPoint) -> float:
        """Return the test function at a point; it is computed once."""
        known = point.memo.get(self)
        if known is None:
            known = point.memo[self] = self.function(point)
        return known

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the signed distances of multipliers from criticality, positive beyond it; by default there are none.

        In a machine with equal parts several become critical at once. Their mean is then smooth and changes its sign,
        while the test function may not: see `Search.zeros`.
        """
        return np.zeros(0)

    def beyond(self, point: BranchPoint) -> int:
        """Return the number of multipliers, or of pairs, beyond criticality at a point; it is computed once."""
        known = point.memo.get(("beyond", self))
        if known is None:
            offsets = self.offsets(point.orbit.free_multipliers)
            known = point.memo["beyond", self] = int(np.count_nonzero(offsets > 0.0))
        return known

    def mean_offset(self, point: BranchPoint, ranks: tuple[int, int]) -> float:
        """Return the mean of the offsets from one rank to before another, largest first; nan if there are fewer."""
        offsets, (first, last) = self.offsets(point.orbit.free_multipliers), ranks
        return float(np.sort(offsets)[::-1][first:last].mean()) if len(offsets) >= last else math.nan

    def is_genuine(self, point: BranchPoint, near: float = 1e-6) -> bool:
        """Return True if a zero of the function is a point of this kind; `near` is the tolerance of a multiplier."""
        return True

    def prepare(self, search: Search) -> None:
        """Prepare a step before any kind is searched for in it; by default nothing is done."""

    def points_in(self, search: Search) -> list[Zero]:
        """Return all points of this kind in one step of a walk: by default, all genuine zeros of the test function."""
        return [zero for zero in search.zeros(self) if self.is_genuine(zero.point)]

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """Locate the one zero between two points, if the kind has a better method than bracketing; otherwise None."""
        return None

    def locate_several(self, search: Search, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int]) -> Zero | None:
        """Locate the point between two others at which multipliers of some ranks become critical; None if none is."""
        return search.bracketed_mean(self, a, b, ranks)

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Return the error of a located zero, from that of another discretisation; infinite if it has none."""
        return location_error(zero, second, [search.near(zero.point)])

    def nature(self, before: BranchPoint, after: BranchPoint) -> str | None:
        """Return the criticality that follows from the points on both sides, in words; None to reject the point."""
        return ""

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """Return what contradicts a point between others computed again, and a function that is zero there, or None."""
        first, last = sorted((self.beyond(before), self.beyond(after)))
        function = self.at if special.multiplicity == 1 else partial(self.mean_offset, ranks=(first, last))
        if function(before) * function(after) > 0.0:
            return [f"the test function of a {self} does not change its sign"], None
        return [], function

    def judged(self, special: SpecialPoint, parameter: str, method: Method | None) -> SpecialPoint:
        """Complete the special point with information from other branches, such as the criticality of a flip."""
        return special

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return the beginnings of the other branches that begin or cross at a point of this kind."""
        raise ModelError(f"no other periodic branch begins at a {self}; switch at a flip or at a branch point")

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the locus equation in two parameters: the distance of a monodromy matrix from criticality."""
        raise NotImplementedError(f"a {self} is not defined by multipliers")

    def angle(self, multipliers: NDArray[np.complex128]) -> float:
        """Return the argument of the critical multiplier, from 0 to pi."""
        return math.pi if self.target is not None and self.target < 0.0 else 0.0

    def residual(self, orbit: Orbit, multipliers: NDArray[np.complex128]) -> float:
        """Return the distance of an orbit of a locus from a point of this kind, with multipliers computed again.

        It is a product over all multipliers, if the kind has such a function. So a factor that is small for
        another reason, as at a point of codimension two, does no harm.
        """
        if self.target is not None:
            return float(np.prod(np.minimum(np.abs(multipliers - self.target), 1.0)))
        again = replace(orbit, multipliers=multipliers)
        return abs(self.function(BranchPoint(math.nan, again, _NONE, _NONE, math.nan, math.nan)))

    @property
    def no_locus(self) -> str:
        """Reason why this kind has no locus in two parameters, as a sentence; empty if it has one."""
        has_one = type(self).condition is not Kind.condition
        return "" if has_one else f"a {self} has no locus in two parameters; {_WITH_A_LOCUS}"

    def critical(self, multipliers: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the indices of the multipliers that are critical at such a point, nearest first; may be empty."""
        if self.target is None:
            return np.zeros(0, dtype=np.intp)
        return np.argsort(np.abs(multipliers - self.target), kind="stable")[:1]

    def critical_multiplier(self, multipliers: NDArray[np.complex128]) -> complex:
        """Return the critical multiplier of a point of this kind; nan if there is none."""
        places = self.critical(multipliers)
        return complex(multipliers[places[0]]) if len(places) else complex(np.nan, np.nan)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """Validate entries of model files and results: the name of a known kind."""
        from pydantic_core import core_schema  # imported late: only files need it

        def checked(value: Any) -> Kind:
            try:
                return value if isinstance(value, Kind) else cls.named(value)
            except (ModelError, TypeError) as error:
                raise ValueError(str(error)) from None

        return core_schema.no_info_plain_validator_function(checked, serialization=core_schema.to_string_ser_schema())

    def __reduce__(self) -> tuple[Any, ...]:
        return Kind.named, (str(self),)


_NONE = np.zeros(0)  # unknowns of an orbit that is on no branch
KINDS: Registry[Kind] = Registry("kind of special point", "kinds of special points")
_WITH_A_LOCUS = "follow a fold, a flip, a neimark-sacker or a grazing point, or one of sliding"


def register(kind: Kind) -> Kind:
    """Register a kind under its name; a class that is defined again replaces its earlier definition.

    Parameters
    ----------
    kind
        The kind, an instance of its class.

    Returns
    -------
    Kind
        The kind itself.

    Raises
    ------
    ModelError
        If a kind of another class has the name.

    Examples
    --------
    >>> gw.special_points.register(gw.Kind.named("fold"))  # as gapwalk has done
    'fold'
    """
    return KINDS.add(str(kind), kind)


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
        """Return how far other parameters, by default all that are not zero, move the point.

        See `gapwalk.bifurcation.loci.gradient.gradient`.

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
