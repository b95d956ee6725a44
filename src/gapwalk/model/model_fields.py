"""The kinds of value in a model file: strict numbers, names, choices, vectors by coordinate, matrices."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, WrapValidator

from gapwalk.model.checks import mass_problems
from gapwalk.model.excitation import check_order
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import by_shape, tagged
from gapwalk.model.units import QuantityKind, has_unit, read_quantity

MAX_COORDINATES = 1000
"""More are refused: dense matrices of that size have a million parameters, each with a name."""

Choice = TypeVar("Choice", bound=str)


@dataclass
class Names:
    """What the validators of one pass know of the names in a file, whatever else is wrong with it."""

    coordinates: list[str] | None
    what: str = "coordinate"
    taken: set[str] = field(
        # First parts of the names of other parameters: a contact of that name would make them ambiguous.
        default_factory=lambda: {"frequency", "speed", "mass", "damping", "stiffness", "mean", "study"}
    )
    units: bool = False  # whether quantities have units

    @classmethod
    def of(cls, data: Any) -> Names:
        """The names in the content of a file that may be wrong in any way."""
        names = data.get("coordinates") if isinstance(data, Mapping) else None
        if not isinstance(names, list) or not 0 < len(names) <= MAX_COORDINATES:
            return cls(None)
        if not all(isinstance(name, str) for name in names):
            return cls(None)
        return cls(list(dict.fromkeys(names)))  # a name that stands twice by mistake is no second coordinate

    @classmethod
    def of_train(cls, data: Any) -> Names:
        """The names of the inertias of a train, which stand in place of coordinates."""
        tables = data.get("inertia") if isinstance(data, Mapping) else None
        tables = tables if isinstance(tables, list) else []
        names = [table.get("name") for table in tables if isinstance(table, Mapping)]
        known = [*dict.fromkeys(name for name in names if isinstance(name, str))] or None
        return cls(known, "inertia", units=any(has_unit(value) for value in _quantities(data)))


def _quantities(data: Any) -> Iterator[object]:
    """All that stands, in the content of a train's file, where a quantity should."""
    for key, value in data.items() if isinstance(data, Mapping) else ():
        if key in ("name", "title", "study", "between", "reaction", "phase", "acts_on"):
            continue
        if isinstance(value, list):
            for table in value:
                yield from _quantities(table)
        elif isinstance(value, Mapping):
            yield from _quantities(value)
        else:
            yield value


def measured(kind: QuantityKind) -> WrapValidator:
    """Make a validator that reads texts with units where a file has units, and otherwise leaves the field as it is."""

    def check(value: object, handler: Callable[[object], Any], info: ValidationInfo[Names]) -> Any:
        if not info.context.units or value is None or (value == 0 and not isinstance(value, str | bool)):
            return handler(value)
        if isinstance(value, bool | list | Mapping):
            return handler(value)
        quantity = read_quantity(value, kind)
        handler(quantity.number)  # its bounds
        return quantity

    return WrapValidator(check)


def one_of(choices: Iterable[Choice], otherwise: str = "") -> Callable[[object], Choice]:
    """Make a validator that accepts the names of choices; `otherwise` names what else is allowed."""
    known = {str(choice): choice for choice in choices}
    allowed = f"one of {', '.join(map(given, known))}" + (f", or {otherwise}" if otherwise else "")

    def check(value: object) -> Choice:
        if isinstance(value, str) and value in known:
            return known[value]
        hint = did_you_mean(value, list(known)) if isinstance(value, str) else ""
        hint = f"; {hint}" if hint.endswith("?") else ""
        raise ValueError(f"is {given(value)}; it must be {allowed}{hint}")

    return check


def claim(name: str, info: ValidationInfo[Names]) -> None:
    """Take a name for a contact or a harmonic, if it is free."""
    if name in info.context.taken:
        raise ValueError(f"is {given(name)}, which is taken already; choose another name")
    info.context.taken.add(name)


def without_repeats(names: list[str]) -> list[str]:
    """Refuse a name that stands twice in a list."""
    for index, name in enumerate(names):
        if name in names[:index]:
            raise ValueError(f"has {given(name)} twice; give one of them another name")
    return names


def _word(name: str) -> str:
    if not name.isidentifier():
        raise ValueError(f"is {given(name)}; write a word of letters, digits and underscores")
    return name


def _coordinate(name: str, info: ValidationInfo[Names]) -> str:
    known = info.context.coordinates
    if known and name not in known:
        raise ValueError(f"names no {info.context.what}; {did_you_mean(name, known)}")
    return name


def _not_zero(vector: dict[str, float]) -> dict[str, float]:
    if not any(vector.values()):
        raise ValueError("is zero; name at least one coordinate, as in { q1 = 1.0 }")
    return vector


def _square(matrix: list, info: ValidationInfo[Names]) -> list[list[float]]:
    known = info.context.coordinates
    if not known:
        return matrix  # of no use while nobody knows how large it must be
    n = len(known)
    wanted = f"{n} x {n}, a row and a column per coordinate"
    if not matrix:
        raise ValueError(f"is empty; it must be {wanted}")
    if not isinstance(matrix[0], list):
        if len(matrix) != n:
            raise ValueError(f"is a diagonal of {len(matrix)} numbers; it must have {n}, one per coordinate")
        return np.diag(matrix).tolist()
    lengths = [len(row) for row in matrix]
    if lengths != [n] * n:
        text = ", ".join(map(str, lengths[:10])) + (", ..." if len(lengths) > 10 else "")
        raise ValueError(f"has rows of length {text}; it must be {wanted}")
    return matrix


def _regular(mass: list[list[float]], info: ValidationInfo[Names]) -> list[list[float]]:
    if not info.context.coordinates:
        return mass
    for problem in mass_problems(info.context.coordinates, np.array(mass)):
        raise ValueError(problem.removeprefix("mass "))
    return mass


def _matrix_shape(value: object) -> str:
    flat = isinstance(value, list) and value and not any(isinstance(row, list) for row in value)
    return "diagonal" if flat else "matrix"


def _radians(phase: object) -> object:
    if not isinstance(phase, str):
        return phase
    match = re.fullmatch(r"\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*(deg|°|rad)\s*", phase, re.ASCII)
    if not match:
        raise ValueError(f'is {given(phase)}; it must be a number of radians, or a text such as "120 deg"')
    return float(match[1]) if match[2] == "rad" else math.radians(float(match[1]))


def _whole(order: Any) -> int:
    check_order(order)
    return int(order)


# Strict: true is no 1, and "1.5" is no number.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Count = Annotated[int, Field(strict=True, ge=1)]
Text = Annotated[str, Field(strict=True)]
Name = Annotated[Text, AfterValidator(_word)]
Angle = Annotated[Number, BeforeValidator(_radians)]
Phase = Annotated[Angle, measured(QuantityKind.PHASE)]
Torque = Annotated[Number, measured(QuantityKind.TORQUE)]
Stiffness = Annotated[Number, measured(QuantityKind.STIFFNESS)]
CubicStiffness = Annotated[Number, measured(QuantityKind.CUBIC)]
Clearance = Annotated[NonNegative, measured(QuantityKind.ANGLE)]
Order = Annotated[int, BeforeValidator(_whole)]
InertiaName = AfterValidator(_coordinate)
Vector = Annotated[dict[Annotated[Text, InertiaName], Number], Field(max_length=MAX_COORDINATES)]
Direction = Annotated[Vector, AfterValidator(_not_zero)]
Matrix = Annotated[
    # of many wrong numbers only those of one row are told
    Annotated[list[list[Number]], Field(fail_fast=True), tagged("matrix")]
    | Annotated[list[Number], tagged("diagonal")],
    by_shape(_matrix_shape),
    AfterValidator(_square),
]
RegularMatrix = Annotated[Matrix, AfterValidator(_regular)]
