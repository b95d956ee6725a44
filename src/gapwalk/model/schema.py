"""The schema of model files: kinds of values, and the tables that hold them."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    WrapValidator,
)

from gapwalk.model.laws import Law, law_of
from gapwalk.model.loads import check_order
from gapwalk.model.problems import Path, did_you_mean, given
from gapwalk.model.registry import Parameter
from gapwalk.model.states import STATE_KINDS
from gapwalk.model.units import QuantityKind, has_unit, read_quantity
from gapwalk.model.value_checks import mass_problems

MAX_COORDINATES = 1000
"""More are refused: dense matrices of that size have a million parameters, each with a name."""

_NO_QUANTITIES = {
    *(
        "name",
        "title",
        "study",
        "between",
        "reaction",
        "reference",
        "phase",
        "acts_on",
        "varies",
        "mesh",
        "turns_of",
        "law",
    )
}
_DIRECTIONS = ("deflection", "force", "acts_on")
TAG = "\0"  # begins the tags of unions, which pydantic puts among the keys of a path

Choice = TypeVar("Choice", bound=str)


class Part(BaseModel):
    """A table of a model file. Unknown keys are refused; the description of a field explains a missing key."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """Return the line to write in place of an unknown key, if the table knows; otherwise an empty text."""
        return ""


def tagged(name: str) -> Tag:
    """Make the tag of one member of a union."""
    return Tag(TAG + name)


def by_shape(**shapes: type) -> Discriminator:
    """Make a discriminator from the names of `tagged` members of a union, each with its type: the first one fits."""
    return Discriminator(lambda value: TAG + next(name for name, kind in shapes.items() if isinstance(value, kind)))


@dataclass
class Names:
    """Names in a file that may have problems, for the validators of one pass."""

    coordinates: list[str] | None
    states: list[str] = field(default_factory=list)  # without inertia
    damping: Any = None  # as the file has it
    what: str = "coordinate"
    taken: set[str] = field(
        # First parts of the names of other parameters: a contact of that name would make them ambiguous.
        default_factory=lambda: {
            "frequency",
            "speed",
            "mass",
            "damping",
            "stiffness",
            "gyroscopic",
            "centrifugal",
            "mean",
            "study",
        }
    )
    units: bool = False  # whether quantities have units
    # What the tables make: the contacts of each, or its load; by the keys of the tables.
    elements: dict[str, list[Any]] = field(default_factory=dict)
    law: Law = field(default_factory=lambda: law_of("elastic"))  # of the contact whose table is read

    @classmethod
    def of(cls, data: Any) -> Names:
        """Find the names in the content of a file that may have any problems."""
        names = data.get("coordinates") if isinstance(data, Mapping) else None
        if not isinstance(names, list) or not 0 < len(names) <= MAX_COORDINATES:
            return cls(None)
        if not all(isinstance(name, str) for name in names):
            return cls(None)
        tables = [table for key in ("state", *STATE_KINDS) for table in _tables(data, key)]
        states = [table["name"] for table in tables if isinstance(table.get("name"), str)]
        once = [*dict.fromkeys(names)]  # a name that is repeated by mistake is one coordinate
        return cls(once, states, data.get("damping"))

    def is_idle(self, place: int) -> bool:
        """Return True if the damping of the file leaves out the coordinate of a number."""
        if not isinstance(self.damping, list) or place >= len(self.damping):
            return not (isinstance(self.damping, Mapping) and self.damping.get("stiffness"))
        row = self.damping[place]
        return not (any(row) if isinstance(row, list) else row)

    @classmethod
    def of_train(cls, data: Any) -> Names:
        """Find the names of the inertias of a train, which take the place of coordinates."""
        tables = data.get("inertia") if isinstance(data, Mapping) else None
        tables = tables if isinstance(tables, list) else []
        names = [table.get("name") for table in tables if isinstance(table, Mapping)]
        known = [*dict.fromkeys(name for name in names if isinstance(name, str))] or None
        return cls(known, what="inertia", units=any(has_unit(value) for value in _quantities(data)))


def _tables(data: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    """Return the tables of one key in the content of a file that may have any problems."""
    tables = data.get(key)
    return [table for table in tables if isinstance(table, Mapping)] if isinstance(tables, list) else []


def _quantities(data: Any) -> Iterator[object]:
    """List the values in the content of a train's file that should be quantities."""
    for key, value in data.items() if isinstance(data, Mapping) else ():
        if key in _NO_QUANTITIES:
            continue
        if isinstance(value, list):
            for table in value:
                yield from _quantities(table)
        elif isinstance(value, Mapping):
            yield from _quantities(value)
        else:
            yield value


def error_path(error: Any) -> Path:
    """Return the path of an error without the tags of unions; an unknown key may look like a tag, but is none."""
    path = error["loc"]
    end = len(path) - (error["type"] == "extra_forbidden")
    return (*(key for key in path[:end] if not (isinstance(key, str) and key.startswith(TAG))), *path[end:])


def with_placeholders(table: Mapping[str, Any], error: ValidationError, names: Names) -> Any:
    """Return the table of an element with placeholders for its wrong values, so that it has the same names."""
    found = copy.deepcopy({**table})
    for each in error.errors(include_url=False):
        *around, key = error_path(each) or ("",)
        if around and around[0] in _DIRECTIONS:
            around, key = [], around[0]
        inner: Any = found
        for step in around:
            inner = inner[step]
        if not isinstance(inner, dict):
            continue
        if key in _DIRECTIONS:
            inner[key] = dict.fromkeys((names.coordinates or [])[:1], 1.0)
        elif each["type"] in ("extra_forbidden", "list_type") or isinstance(each["input"], str):
            inner.pop(key, None)
        elif key not in ("", "stage"):
            inner[key] = 1.0
    stages = found.get("stage")
    for place, stage in enumerate(stages if isinstance(stages, list) else ()):
        if isinstance(stage, dict):
            stage["clearance"] = 1.0 + place
    return found


def measured(kind: QuantityKind) -> WrapValidator:
    """Make a validator that reads texts with units if the file has units, and otherwise does nothing."""

    def check(value: object, handler: Callable[[object], Any], info: ValidationInfo[Names]) -> Any:
        if not info.context.units or value is None or (value == 0 and not isinstance(value, str | bool)):
            return handler(value)
        if isinstance(value, bool | list | Mapping):
            return handler(value)
        quantity = read_quantity(value, kind)
        handler(quantity.number)  # its bounds
        return quantity

    return WrapValidator(check)


def one_of(
    choices: Iterable[Choice] | Callable[[], Iterable[Choice]], otherwise: str = ""
) -> Callable[[object], Choice]:
    """Make a validator that accepts the names of choices; `otherwise` describes other values that are allowed.

    Choices that may become more, as those of a registry, are given by a function, which is called at each check.
    """

    def check(value: object) -> Choice:
        known = {str(choice): choice for choice in (choices if isinstance(choices, Iterable) else choices())}
        if isinstance(value, str) and value in known:
            return known[value]
        hint = did_you_mean(value, list(known)) if isinstance(value, str) else ""
        hint = f"; {hint}" if hint.endswith("?") else ""
        allowed = f"one of {', '.join(map(given, known))}" + (f", or {otherwise}" if otherwise else "")
        raise ValueError(f"is {given(value)}; it must be {allowed}{hint}")

    return check


def claim(name: str, info: ValidationInfo[Names]) -> str:
    """Claim a name for a contact or a harmonic, if it is free."""
    if name in info.context.taken:
        raise ValueError(f"is {given(name)}, which is taken already; choose another name")
    info.context.taken.add(name)
    return name


def without_repeats(names: list[str]) -> list[str]:
    """Refuse a name that is twice in a list."""
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
    if known and name not in (*known, *info.context.states):
        raise ValueError(f"names no {info.context.what}; {did_you_mean(name, known)}")
    return name


def _not_zero(vector: dict[str, float]) -> dict[str, float]:
    if not any(vector.values()):
        raise ValueError("is zero; name at least one coordinate, as in { q1 = 1.0 }")
    return vector


def _square(matrix: list, info: ValidationInfo[Names]) -> list[list[float]]:
    known = info.context.coordinates
    if not known:
        return matrix  # cannot be checked, as its size is unknown
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
    matrix, names = np.array(mass), info.context.coordinates
    if len(matrix) == len(names):  # rows of zeros are of coordinates without inertia
        idle = np.array(list(map(info.context.is_idle, range(len(names)))))
        kept = np.flatnonzero(matrix.any(axis=0) | matrix.any(axis=1) | idle)
        matrix, names = matrix[np.ix_(kept, kept)], [names[place] for place in kept]
    for problem in mass_problems(names, matrix) if names else ():
        raise ValueError(problem.removeprefix("mass "))
    return mass


def _matrix_shape(value: object) -> str:
    flat = isinstance(value, list) and value and not any(isinstance(row, list) for row in value)
    return TAG + ("diagonal" if flat else "matrix")


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


# Strict: true is not 1, and "1.5" is not a number.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Count = Annotated[int, Field(strict=True, ge=1)]
Text = Annotated[str, Field(strict=True)]
Name = Annotated[Text, AfterValidator(_word)]
OwnName = Annotated[Name, AfterValidator(claim)]
Angle = Annotated[Number, BeforeValidator(_radians)]
Torque = Annotated[Number, measured(QuantityKind.TORQUE)]
Clearance = Annotated[NonNegative, measured(QuantityKind.ANGLE)]
Centre = Annotated[Number, measured(QuantityKind.ANGLE)]
CubicStiffness = Annotated[Number, measured(QuantityKind.CUBIC)]
Order = Annotated[int, BeforeValidator(_whole)]
InertiaName = AfterValidator(_coordinate)
Vector = Annotated[dict[Annotated[Text, InertiaName], Number], Field(max_length=MAX_COORDINATES)]
Direction = Annotated[Vector, AfterValidator(_not_zero)]
Matrix = Annotated[
    # of many wrong numbers, only those of one row are reported
    Annotated[list[list[Number]], Field(fail_fast=True), tagged("matrix")]
    | Annotated[list[Number], tagged("diagonal")],
    Discriminator(_matrix_shape),
    AfterValidator(_square),
]
RegularMatrix = Annotated[Matrix, AfterValidator(_regular)]


def number_of(parameter: Parameter) -> Any:
    """Make the type of a parameter's value in a table."""
    number = Angle if parameter.kind is QuantityKind.PHASE else Number
    if parameter.least is not None:
        number = Annotated[number, Field(ge=parameter.least)]
    return number if parameter.kind is None else Annotated[number, measured(parameter.kind)]
