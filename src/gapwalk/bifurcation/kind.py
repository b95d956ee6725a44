"""What a kind of special point is: the contract that every kind fulfils, and the registry of all kinds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.second import location_error
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import ModelError

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch import SpecialPoint
    from gapwalk.bifurcation.departure import Departure
    from gapwalk.bifurcation.kinds.condition import Criticality
    from gapwalk.bifurcation.kinds.search import Search, Zero
    from gapwalk.bifurcation.second import SecondOpinion
    from gapwalk.continuation.range import Range
    from gapwalk.orbit.equation import Method


@dataclass(frozen=True, slots=True)
class Symbol:
    """How special points of a kind are drawn.

    Attributes
    ----------
    label
        What the legend says.
    letters
        What stands next to a point; may be empty.
    marker, size
        The marker, as matplotlib knows it, and its size in points.
    color
        Name of a colour of the palette.
    dashes
        Of its locus in a map, as matplotlib knows them; None if it has no locus.
    width
        Of that line, in points.
    """

    label: str
    letters: str
    marker: str
    size: float
    color: str
    dashes: str | tuple[float, tuple[float, ...]] | None = None
    width: float = 1.6


class Kind(str):
    """A kind of special point: what happens there.

    A kind is its name, such as ``"fold"``, with which it compares equal, and all that is special about it. To add one,
    write a subclass in a file of `gapwalk.bifurcation.kinds` and register its one instance there; walks, tables,
    pictures, maps, verification and files then know it. A kind whose points are zeros of a smooth function of the
    branch needs `function` and `symbol` alone.

    Parameters
    ----------
    name
        Its name, in tables and files.

    Attributes
    ----------
    symbol
        How it is drawn.
    target
        Where a multiplier is critical, if it is at one place: +1 or -1.
    moves_through_one
        Whether a multiplier passes +1, so that the Jacobian of the orbit changes the sign of its determinant.
    is_turning
        Whether the branch turns round, so that the parameter is stationary there.
    sign_change
        What a change of sign of the function says of a step, as a clause; empty where the function may change its sign
        for another reason, so that nothing is to be concluded.
    noise
        Size of the function that has no sign.
    turn
        When it is looked for: 0 first, 2 last. What is known of a step by then makes later searches shorter.

    Examples
    --------
    >>> gw.Kind.FOLD == "fold"
    True
    """

    symbol: ClassVar[Symbol] = Symbol("event", "", "d", 5.0, "grey")
    target: ClassVar[float | None] = None
    moves_through_one: ClassVar[bool] = False
    is_turning: ClassVar[bool] = False
    sign_change: ClassVar[str] = ""
    noise: ClassVar[float] = 1e-6
    turn: ClassVar[int] = 2

    FOLD: ClassVar[Kind]
    FLIP: ClassVar[Kind]
    NEIMARK_SACKER: ClassVar[Kind]
    BRANCH_POINT: ClassVar[Kind]
    GRAZING: ClassVar[Kind]

    def __new__(cls, name: str) -> Self:  # noqa: D102 - as the class
        return super().__new__(cls, name)

    @staticmethod
    def known() -> tuple[Kind, ...]:
        """All kinds, in the order in which tables and legends have them."""
        return tuple(_KINDS.values())

    @staticmethod
    def named(name: str) -> Kind:
        """The kind of a name.

        Raises
        ------
        ModelError
            If there is none.
        """
        if name not in _KINDS:
            raise ModelError(f"there is no kind of special point {name!r}; there are {', '.join(_KINDS)}")
        return _KINDS[name]

    def function(self, point: BranchPoint) -> float:
        """The test function: smooth along a branch, and zero with a change of sign at a point of this kind."""
        raise NotImplementedError(f"a {self} is not the zero of one function")

    @property
    def value(self) -> str:
        """Its name, as enumerations have it."""
        return str(self)

    @property
    def has_function(self) -> bool:
        """Whether its points are the zeros of one test function."""
        return type(self).function is not Kind.function

    def at(self, point: BranchPoint) -> float:
        """The test function at a point; it is computed once."""
        known = point.memo.get(self)
        if known is None:
            known = point.memo[self] = self.function(point)
        return known

    def is_genuine(self, point: BranchPoint, near: float = 1e-6) -> bool:
        """Whether a zero of the function is a point of this kind; a multiplier on the unit circle is `near` it."""
        return True

    def prepare(self, search: Search) -> None:
        """What has to be known of a step before any kind is looked for in it; by default nothing."""

    def points_in(self, search: Search) -> list[Zero]:
        """All points of this kind in one step of a walk: by default, all genuine zeros of the test function.

        Raises
        ------
        NumericalError
            If an orbit between both ends of the step cannot be found.
        """
        return [zero for zero in search.zeros(self) if self.is_genuine(zero.point)]

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """The one zero between two points, where the kind has a better way than a bracket; otherwise None."""
        return None

    def error(self, search: Search, zero: Zero, second: SecondOpinion) -> float:
        """Estimated error of the parameter at a point that was found; infinite where it cannot be told.

        Raises
        ------
        NumericalError
            The same: if there are no orbits to compare it with.
        """
        return location_error(zero, second, [search.near(zero.point)])

    def nature(self, before: BranchPoint, after: BranchPoint) -> str | None:
        """What the motions on both sides say of the point, in words; None if it is none after all."""
        return ""

    def judged(self, special: SpecialPoint, parameter: str, method: Method | None) -> SpecialPoint:
        """The special point with what is told by other branches, such as whether a flip is supercritical."""
        return special

    def departures(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[Departure]:
        """The departures along the other branches that begin or cross at a point of this kind.

        Raises
        ------
        ModelError
            If there are none.
        """
        raise ModelError(f"no other branch of periodic motions leaves a {self}; switch at a flip or at a branch point")

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """The equation of its locus in two parameters: how far a monodromy matrix is from having such a multiplier."""
        raise NotImplementedError(f"a {self} is no matter of multipliers")

    def angle(self, multipliers: NDArray[np.complex128]) -> float:
        """The argument of the critical multiplier, from 0 to pi."""
        return math.pi if self.target is not None and self.target < 0.0 else 0.0

    @property
    def no_locus(self) -> str:
        """Why it has no locus in two parameters, as a sentence; empty if it has one."""
        has_one = type(self).condition is not Kind.condition
        return "" if has_one else f"a {self} has no locus in two parameters; {_WITH_A_LOCUS}"

    def critical(self, multipliers: NDArray[np.complex128]) -> NDArray[np.intp]:
        """The places of the multipliers that are critical at a point of this kind, nearest first; none if none are."""
        if self.target is None:
            return np.zeros(0, dtype=np.intp)
        return np.argsort(np.abs(multipliers - self.target), kind="stable")[:1]

    def critical_multiplier(self, multipliers: NDArray[np.complex128]) -> complex:
        """The multiplier that a point of this kind is about; nan if there is none."""
        places = self.critical(multipliers)
        return complex(multipliers[places[0]]) if len(places) else complex(np.nan, np.nan)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """How model files and results are checked: a name of a known kind."""
        from pydantic_core import core_schema  # imported late: walks need no files

        def checked(value: Any) -> Kind:
            try:
                return value if isinstance(value, Kind) else cls.named(value)
            except (ModelError, TypeError) as error:
                raise ValueError(str(error)) from None

        return core_schema.no_info_plain_validator_function(checked, serialization=core_schema.to_string_ser_schema())

    def __reduce__(self) -> tuple[Any, ...]:
        return Kind.named, (str(self),)


_KINDS: dict[str, Kind] = {}
_WITH_A_LOCUS = "follow a fold, a flip, a neimark-sacker or a grazing point"


def register(kind: Kind) -> Kind:
    """Make a kind known by its name."""
    return _KINDS.setdefault(str(kind), kind)
