"""The schema of model files: kinds of values, the tables that hold them, and errors of validation as problems."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar, get_args

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

from gapwalk.errors import ModelError
from gapwalk.model.laws import Law, law_of
from gapwalk.model.loads import check_order
from gapwalk.model.model_source import Source
from gapwalk.model.problems import WITHIN, Path, Problem, did_you_mean, given, idea_of
from gapwalk.model.registry import Parameter
from gapwalk.model.units import QuantityKind, has_unit, read_quantity
from gapwalk.model.value_checks import mass_problems

MAX_COORDINATES = 1000
"""More are refused: dense matrices of that size have a million parameters, each with a name."""

_TOP = "the top of the file, above the first table in brackets"
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
_EXPLAINED = 200  # problems of a table with a hint: nobody reads more, and the search for similar names takes time
_TAG = "\0"  # begins the tags of unions, which pydantic puts among the keys of a path

_ALLOWED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "a text in quotes",
    "list_type": "a list",
    "literal_error": "{expected}",
    "dict_type": "a table, such as {{ q1 = 1.0 }}",
    "model_type": "a table",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "less_than_equal": "<= {le}",
    "greater_than": "> {gt:g}",
    "greater_than_equal": ">= {ge:g}",
}

Choice = TypeVar("Choice", bound=str)


class Part(BaseModel):
    """A table of a model file. Unknown keys are refused; the description of a field explains a missing key."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """Return the line to write in place of an unknown key, if the table knows; otherwise an empty text."""
        return ""


def tagged(name: str) -> Tag:
    """Make the tag of one member of a union."""
    return Tag(_TAG + name)


def by_shape(choose: Callable[[Any], str]) -> Discriminator:
    """Make a discriminator from a function that returns the name of a `tagged` member of a union."""
    return Discriminator(lambda value: _TAG + choose(value))


@dataclass
class Names:
    """Names in a file that may have problems, for the validators of one pass."""

    coordinates: list[str] | None
    what: str = "coordinate"
    taken: set[str] = field(
        # First parts of the names of other parameters: a contact of that name would make them ambiguous.
        default_factory=lambda: {"frequency", "speed", "mass", "damping", "stiffness", "mean", "study"}
    )
    units: bool = False  # whether quantities have units
    law: Law = field(default_factory=lambda: law_of("elastic"))  # of the contact whose table is read

    @classmethod
    def of(cls, data: Any) -> Names:
        """Find the names in the content of a file that may have any problems."""
        names = data.get("coordinates") if isinstance(data, Mapping) else None
        if not isinstance(names, list) or not 0 < len(names) <= MAX_COORDINATES:
            return cls(None)
        if not all(isinstance(name, str) for name in names):
            return cls(None)
        return cls(list(dict.fromkeys(names)))  # a name that is repeated by mistake is one coordinate

    @classmethod
    def of_train(cls, data: Any) -> Names:
        """Find the names of the inertias of a train, which take the place of coordinates."""
        tables = data.get("inertia") if isinstance(data, Mapping) else None
        tables = tables if isinstance(tables, list) else []
        names = [table.get("name") for table in tables if isinstance(table, Mapping)]
        known = [*dict.fromkeys(name for name in names if isinstance(name, str))] or None
        return cls(known, "inertia", units=any(has_unit(value) for value in _quantities(data)))


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
CubicStiffness = Annotated[Number, measured(QuantityKind.CUBIC)]
Order = Annotated[int, BeforeValidator(_whole)]
InertiaName = AfterValidator(_coordinate)
Vector = Annotated[dict[Annotated[Text, InertiaName], Number], Field(max_length=MAX_COORDINATES)]
Direction = Annotated[Vector, AfterValidator(_not_zero)]
Matrix = Annotated[
    # of many wrong numbers, only those of one row are reported
    Annotated[list[list[Number]], Field(fail_fast=True), tagged("matrix")]
    | Annotated[list[Number], tagged("diagonal")],
    by_shape(_matrix_shape),
    AfterValidator(_square),
]
RegularMatrix = Annotated[Matrix, AfterValidator(_regular)]


def number_of(parameter: Parameter) -> Any:
    """Make the type of a parameter's value in a table."""
    number = Angle if parameter.kind is QuantityKind.PHASE else Number
    if parameter.least is not None:
        number = Annotated[number, Field(ge=parameter.least)]
    return number if parameter.kind is None else Annotated[number, measured(parameter.kind)]


P = TypeVar("P", bound=Part)


def validate(
    model: type[P], data: object, source: Source, at: Path = (), context: Callable[[], object] = lambda: None
) -> tuple[P | None, list[Problem]]:
    """Check a table against its schema, and report all of its problems."""
    try:
        return model.model_validate(data, context=context()), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    unknown = [_path_of(error) for error in errors if error["type"] == "extra_forbidden"]
    if unknown:  # pydantic checks a table as a whole only when it finds no unknown key in it
        try:
            model.model_validate(_without(data, unknown), context=context())
        except ValidationError as error:
            seen = {(each["loc"], each["type"]) for each in errors}
            errors += [each for each in error.errors(include_url=False) if (each["loc"], each["type"]) not in seen]
    return None, [_problem(model, error, source, at, number < _EXPLAINED) for number, error in enumerate(errors)]


def refusal(error: ModelError, name: str = "") -> str:
    """Return the message of an error of the model as one line that can follow a path which ends in `name`."""
    return "; ".join(line.removeprefix(f"{name} ") for line in dict.fromkeys(str(error).splitlines()))


def _without(data: Any, paths: list[Path]) -> Any:
    """Return data without the values at some paths, which end in keys of tables."""
    unwanted, around = set(paths), {path[:end] for path in paths for end in range(len(path))}

    def pruned(value: Any, at: Path) -> Any:
        if at not in around:
            return value
        if isinstance(value, Mapping):
            places = ((key, each, (*at, key)) for key, each in value.items())
            return {key: pruned(each, place) for key, each, place in places if place not in unwanted}
        if isinstance(value, list):
            return [pruned(each, (*at, index)) for index, each in enumerate(value)]
        return value

    return pruned(data, ())


def _problem(model: type[Part], error: Any, source: Source, at: Path, explained: bool) -> Problem:
    kind, value = error["type"], error["input"]
    path = _path_of(error)
    if kind == "extra_forbidden":
        hint = f"; {_unknown_key(str(path[-1]), value, _owner(model, path), model, at)}" if explained else ""
        message = f"is not a key here{hint}"
        return source.problem(message, (*at, *path))
    owner = _owner(model, path)
    if owner and path and path[-1] in owner.model_fields:  # for a default, pydantic gives the name and not the alias
        path = (*path[:-1], owner.model_fields[str(path[-1])].alias or path[-1])
    if kind == "missing":
        description = _fields(owner).get(str(path[-1]), "") if owner else ""
        message = "is missing" + (f"; {description}" if description else "")
    elif kind == "value_error":
        path = path[:-1] if path[-1:] == ("[key]",) else path  # pydantic's mark of an error of a key
        message, path = _located(error["ctx"]["error"], model, path)
    elif kind == "list_type" and isinstance(value, Mapping):
        name = str(path[-1]) if path else ""
        field = owner.model_fields.get(name) if owner else None
        if field is None or any(_parts_in([field.annotation])):
            message = f"is one table; it must be a list of tables: write [[{name}]] with two brackets"
        else:
            message = f"is a table; it must be a list, as in {name} = [1.0]"
    else:
        allowed = _ALLOWED[kind].format(**error.get("ctx", {})) if kind in _ALLOWED else error["msg"]
        message = f"is {given(value)}; it must be {allowed}"
        if kind == "greater_than_equal" and path[-1:] == ("clearance",):
            message += f": {WITHIN}"
        is_quoted_number = kind in ("float_type", "int_type") and isinstance(value, str) and _is_number(value)
        if is_quoted_number or (kind == "bool_type" and value in ("true", "false")):
            message += ", without quotes"
        elif kind == "float_type" and isinstance(value, str) and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", value):
            message += f"; it has a point, not a comma: {value.strip().replace(',', '.')}"
        elif kind == "float_type" and has_unit(value):
            message += " without a unit, in consistent units; only the quantities of drive trains have units"
    return source.problem(message, (*at, *path))


def _path_of(error: Any) -> Path:
    """Return the path of an error without the tags of unions; an unknown key may look like a tag, but is none."""
    path = error["loc"]
    end = len(path) - (error["type"] == "extra_forbidden")
    return (*(key for key in path[:end] if not (isinstance(key, str) and key.startswith(_TAG))), *path[end:])


def _located(error: Exception, model: type[Part], path: Path) -> tuple[str, Path]:
    """Return the message of an error and its path, with one more key if the message begins with a key of that table."""
    if not isinstance(error, ModelError):
        return str(error), path
    table = _owner(model, (*path, ""))
    name = str(error).split(maxsplit=1)[0]
    if table and name in _fields(table):
        path = (*path, name)
    return refusal(error, str(path[-1]) if path else ""), path


def _unknown_key(key: str, value: object, owner: type[Part] | None, root: type[Part], at: Path) -> str:
    """Suggest a replacement for an unknown key."""
    if owner and (hint := owner.hint_for(key, value)):
        return hint
    if owner is not root and key in _fields(root):
        if any(_parts_in([root.model_fields[key].annotation])):
            return f"it is a table of its own, [[{key}]]"
        above = f"the {at[0]}, above the first of its tables" if at else _TOP
        return f"{key} belongs to {above}"
    for name, info in root.model_fields.items() if owner is root else ():
        if any(key in _fields(part) for part in _parts_in([info.annotation])):
            return f"it belongs in {name}"
    if idea := idea_of(key):
        return idea
    return did_you_mean(key, list(_fields(owner) if owner else ()), "the keys are")


def _owner(model: type[Part], path: Path) -> type[Part] | None:
    """Return the schema of the table that has the last key of `path`."""
    owner: type[Part] | None = model
    for key in path[:-1]:
        if owner is None or isinstance(key, int):
            continue
        annotations = [info.annotation for name, info in owner.model_fields.items() if key in (name, info.alias)]
        owner = next(_parts_in(annotations), None)
    return owner


def _parts_in(annotations: Any) -> Iterator[type[Part]]:
    for annotation in annotations:
        if inspect.isclass(annotation) and issubclass(annotation, Part):
            yield annotation
        else:
            yield from _parts_in(get_args(annotation))


def _fields(part: type[Part]) -> dict[str, str]:
    """Return the keys of a table with their descriptions."""
    return {info.alias or name: info.description or "" for name, info in part.model_fields.items()}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
