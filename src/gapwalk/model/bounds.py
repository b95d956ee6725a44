"""Bounds of numbers, declared once: at a field or a parameter, as ``Annotated[int, Ge(1)]``, for tables and Python."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from numbers import Integral, Real
from types import UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Interval, Le, Lt

from gapwalk.errors import ModelError

Counted = Annotated[int, Ge(1)]
"""1, 2, 3, ..."""

Natural = Annotated[int, Ge(0)]
"""0, 1, 2, ..."""

Positive = Annotated[float, Gt(0)]
"""A number > 0."""

NotNegative = Annotated[float, Ge(0)]
"""A number >= 0."""

Fraction = Annotated[float, Ge(0), Lt(1)]
"""A number from 0 to below 1."""

Finite = Annotated[float, Interval()]
"""Any finite number."""


class Bound(NamedTuple):
    """The numbers that a field or a parameter may have."""

    kind: type  #: int or float.
    least: float = -math.inf  #: The smallest number.
    most: float = math.inf  #: The largest.
    above: bool = False  #: True if `least` itself is not allowed.
    below: bool = False  #: True if `most` itself is not allowed.
    or_none: bool = False  #: True if None is allowed.
    several: bool = False  #: True if it is the bound of each item of a tuple.

    def has(self, value: Any) -> bool:
        """Return True if a value is allowed."""
        kind, least, most, above, below, or_none, several = self
        if type(value) is not kind or several:
            if value is None or several:
                each = self._replace(several=False)
                return or_none if value is None else isinstance(value, tuple | list) and all(map(each.has, value))
            if isinstance(value, bool) or not isinstance(value, Integral if kind is int else Real):
                return False
        number: Any = value
        high = number < most if below else number <= most
        return high and (number > least if above else number >= least) and abs(number) < math.inf

    def __str__(self) -> str:
        what = "an integer" if self.kind is int else "a number"
        what = f"{'numbers' if self.kind is float else 'integers'}, each" if self.several else what
        low, high = (f"{end:,}" if self.kind is int else f"{end:g}" for end in (self.least, self.most))
        if math.inf not in (self.most, -self.least) and not (self.above or self.below):
            return f"{what} from {low} to {high}"
        ends = [f"{'>' if self.above else '>='} {low}"] if self.least > -math.inf else []
        ends += [f"{'<' if self.below else '<='} {high}"] if self.most < math.inf else []
        return f"{what} {' and '.join(ends)}" if ends else "a finite number"


@lru_cache(maxsize=1000)
def bound_of(hint: Any) -> Bound | None:
    """Return the bound that a type hint declares; None if it declares none."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        rest = [each for each in arguments if each is not type(None)]
        found = bound_of(rest[0]) if len(rest) == 1 else None
        return found and found._replace(or_none=True)
    if origin is tuple and arguments[1:] == (...,):
        found = bound_of(arguments[0])
        return found and found._replace(several=True)
    if origin is not Annotated or arguments[0] not in (int, float):
        return None
    ends: dict[str, Any] = {}
    for mark in arguments[1:]:
        for each in mark if isinstance(mark, Interval) else (mark,):
            match each:
                case Ge(end) | Gt(end):
                    ends |= {"least": end, "above": isinstance(each, Gt)}
                case Le(end) | Lt(end):
                    ends |= {"most": end, "below": isinstance(each, Lt)}
    return Bound(arguments[0], **ends) if ends or any(isinstance(mark, Interval) for mark in arguments) else None


def check(name: str, value: object, hint: Any) -> None:
    """Raise a ModelError if a value of this name is not one that a type hint allows."""
    bound = bound_of(hint)
    if bound is not None and not bound.has(value):
        raise ModelError(f"{name} is {value!r}; it must be {bound}")


def has(hint: Any, value: object) -> bool:
    """Return True if a type hint allows a value."""
    bound = bound_of(hint)
    return bound is None or bound.has(value)


@lru_cache(maxsize=1000)
def _bounds(record: type) -> tuple[tuple[str, Bound], ...]:
    hints = get_type_hints(record, include_extras=True)
    return tuple((name, bound) for name, hint in hints.items() if (bound := bound_of(hint)))


class Bounded:
    """Base of the dataclasses whose fields are checked against the bounds in their type hints when one is made."""

    __slots__ = ()

    def __post_init__(self) -> None:
        check_fields(self)


def check_fields(record: object, of: str = "") -> None:
    """Raise a ModelError if a field of a dataclass is outside its bound; `of` follows the name of the field."""
    for name, bound in _bounds(type(record)):
        if not bound.has(value := getattr(record, name)):
            raise ModelError(f"{name}{of} is {value!r}; it must be {bound}")


def field_problems(record: object) -> Iterator[str]:
    """List the fields of a dataclass that are outside their bounds, one sentence each, to follow its name."""
    for name, bound in _bounds(type(record)):
        if not bound.has(value := getattr(record, name)):
            yield f"has {name} = {value!r}; it must be {bound}{', or left out' * bound.or_none}"
