"""Common parts of the tables ``[study]`` of all kinds, and of those of maps over a plane."""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from enum import Enum, StrEnum
from functools import cache
from typing import Annotated, Any, Literal, Optional, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Le, MinLen
from pydantic import (
    AfterValidator,
    BeforeValidator,
    PlainValidator,
    ValidationInfo,
    WrapValidator,
    create_model,
    field_validator,
    model_validator,
)
from pydantic import Field as Key

from gapwalk.bifurcation.kinds import Kind
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Counted
from gapwalk.model.channels.channel_file import NamedFile
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import Number, Part, Text, by_shape, one_of, tagged
from gapwalk.model.system import System
from gapwalk.model.units import PACES, has_unit, read_quantity
from gapwalk.model.units import kind_of as quantity_kind
from gapwalk.studies.study_kind import INLINE, MAX_VALUES, OPEN, StudyKind, added_kinds, kind_of

Within = tuple[tuple[float, float], tuple[float, float]]
"""The ranges of two axes."""

MAX_CELLS = 10_000_000
"""Of a map over a plane; of each some hundred bytes are kept."""


CountOrValues = Annotated[int, Ge(1), Le(MAX_VALUES)] | Annotated[tuple[float, ...], MinLen(1)]
"""How many values, spread evenly over a range; or the values themselves."""


PARAMETERS = (
    Mapping[str, tuple[float, float]],
    MISSING,
    'The two parameters and their ranges, the horizontal one first: ``{"frequency": (0.2, 1.2), "mean.q1": (0, 1)}``.',
)
"""Argument of a function: the plane of two parameters; see `gapwalk.studies.study_kind.StudyKind.call_types`."""
CELLS = (int | tuple[int, int], 128, "Cells along each axis, or (columns, rows).")
"""Argument of a function: the resolution of a plane."""


def check_inside(values: Sequence[float], key: str, ends: tuple[Any, ...]) -> None:
    """Raise a ModelError, beginning with the key, if one of its values lies outside a range."""
    low, high = sorted(ends)
    for value in values:
        if not low <= value <= high:
            raise ModelError(f"{key} has {value:g}, outside the range from {low:g} to {high:g}")


def check_resolution(given: int | tuple[int, int]) -> tuple[int, int]:
    """Return the number of columns and rows; raise a ModelError that says what to write if they are invalid."""
    both = (given, given) if isinstance(given, int) else tuple(given)
    if len(both) != 2 or any(isinstance(n, bool) or not isinstance(n, int) or n < 1 for n in both):
        raise ModelError(f"resolution is {given!r}; write a number of cells, or (columns, rows)")
    if both[0] * both[1] > MAX_CELLS:
        raise ModelError(f"resolution is {both[0]:,} x {both[1]:,} cells; there may be {MAX_CELLS:,}, as 4000 x 2500")
    return both


def check_parameters(system: System, plane: Mapping[str, Sequence[float]]) -> tuple[tuple[str, str], Within]:
    """Return the two parameters of a plane, horizontal one first, and their ranges; raise a ModelError if invalid."""
    if len(plane) != 2:
        raise ModelError(
            f"a plane has two axes, but {len(plane)} ranges were given ({', '.join(plane) or 'none'}); write "
            '{"frequency": (0.2, 1.2), "harmonic1.amplitude": (0, 1)}'
        )
    first, second = plane
    return (first, second), (check_range(system, first, plane[first]), check_range(system, second, plane[second]))


def check_range(system: System, name: str, given: Sequence[float]) -> tuple[float, float]:
    """Return the range of a parameter, the smaller value first; raise a ModelError if an end of it is invalid."""
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        raise ModelError(f"the range of {name} is {given!r}; write two numbers (low, high)") from None
    for value in (low, high):
        there = system.at({name: value})
        if (limits := system.structure.pace_limits).tables and not limits.covers(there[system.structure.pace]):
            raise ModelError(f"the range of {name} is from {low:g} to {high:g}, but {limits.words}: stay within it")
    if not low < high:
        raise ModelError(f"the range of {name} is from {low:g} to {high:g}: it is empty; write (low, high)")
    return low, high


def number_in_unit(system: System, parameter: str, value: object, where: str = "") -> float:
    """Return a value of a parameter as a number in its unit."""
    system.structure.place(parameter)  # refuses an unknown one
    if system.units is not None and system.units.parameter(parameter):
        try:
            return float(system.units.read(parameter, value))
        except ValueError as error:
            raise ModelError(f"a value of {parameter}{where} {error}") from None
    return plain_number(value, parameter + where)


def plain_number(value: object, what: str) -> float:
    """Return a value of something as a number without a unit."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ModelError(f"a value of {what} is {value!r}; write a number")
    return float(value)


@dataclass(frozen=True)
class Surroundings:
    """Context of the validators of a study.

    Examples
    --------
    >>> import dataclasses
    >>> [each.name for each in dataclasses.fields(gw.studies.Surroundings)][:2]
    ['system', 'frequency_given']
    """

    #: The system; if the file is wrong elsewhere, one with the same parameters; None if even those are unknown.
    system: System | None
    frequency_given: bool  #: True if the file gives the frequency.
    alone: bool = True  #: True if there is no other study in the file.
    taken: tuple[str, ...] = ()  #: Names of the studies before it.
    #: Returns the keys of all kinds of study, which are not allowed as names of studies.
    all_keys: Callable[[], frozenset[str]] = frozenset
    #: True if the numbers of the system are placeholders: then values of parameters are not checked.
    guessed: bool = False
    #: Reads a file that the model file names; see `gapwalk.model.measured.measured_table.read_named`.
    read: Callable[[str], NamedFile] | None = None


def _state_length(start: tuple[float, ...], info: ValidationInfo[Surroundings]) -> tuple[float, ...]:
    system = info.context.system
    if system and len(start) not in {2 * system.size, system.state_size}:
        more = f", and perhaps the extensions ({', '.join(system.state_names[2 * system.size :])})"
        raise ValueError(
            f"is a list of {len(start)} numbers; it must have {2 * system.size}: the positions at t = 0, "
            f"then the velocities{more if system.structure.memories else ''}"
        )
    return start


class Start(StrEnum):
    """Start of the search for the first orbit of a study."""

    REST = "rest"
    """Newton's method from the state zero."""
    SETTLE = "settle"
    """Newton's method from the state that a transient from rest has reached."""
    LINEAR = "linear"
    """Newton's method from the response with all gaps open, as of a motion below a graze."""


_STATE = "the state at t = 0, a list of numbers"

State = Annotated[tuple[float, ...], AfterValidator(_state_length)]
"""A state at t = 0: positions, then velocities, then extensions, which are 0 if they are left out."""

CountOrStates = Counted | Annotated[tuple[State, ...], MinLen(1)]
"""How many states; or the states themselves."""

RestOrState = Annotated[str, BeforeValidator(one_of(["rest"], _STATE))] | State
"""Where a motion begins: from rest, or from a state."""

StartOrState = Annotated[Start, BeforeValidator(one_of(Start, _STATE))] | State
"""Where an orbit is looked for: from rest, from where a transient settles, or from a state."""

Resolution = Annotated[Counted | tuple[Counted, Counted], AfterValidator(check_resolution)]
"""Cells along each axis of a plane, or columns and rows; as columns and rows."""


def check_signal(signal: str, known: Sequence[str]) -> str:
    """Refuse an unknown signal; accept any if the signals are not known.

    Parameters
    ----------
    signal
        Name of the signal.
    known
        Names of the signals that there are; empty if they are not known.

    Returns
    -------
    str
        The name itself.

    Raises
    ------
    ValueError
        If it is unknown.
    """
    if known and signal not in known:
        raise ValueError(f"is {given(signal)}; {did_you_mean(signal, list(known))}")
    return signal


def check_parameter(parameter: str, surroundings: Surroundings) -> str:
    """Refuse a parameter that the system does not have."""
    if surroundings.system:
        try:
            surroundings.system.structure.place(parameter)
        except ModelError as error:
            raise ValueError(f"is {given(parameter)}, but {error}") from None
    return parameter


def check_value(value: float, parameter: str | None, surroundings: Surroundings) -> float:
    """Refuse a value that a parameter cannot have; ignore an unknown parameter, which is refused elsewhere."""
    system = None if surroundings.guessed else surroundings.system
    if system is None and parameter in PACES:
        system, parameter = System(["q"], [[1.0]]), "frequency"  # any has one
    if system and parameter:
        try:
            system.at({parameter: value})
        except ModelError as error:
            raise ValueError(f"is not allowed: {error}") from None
    return value


def _with_unit(value: object, handler: Callable[[object], Any], info: ValidationInfo[Surroundings]) -> Any:
    """Convert a text with a unit to a number in the unit of the parameter, if it has one."""
    parameter, system = info.data.get("parameter"), info.context.system
    if parameter is None and has_unit(value):
        return math.nan  # its unit is unknown while the parameter is wrong itself
    if not isinstance(parameter, str) or value is None or isinstance(value, bool | list | Mapping):
        return handler(value)
    if system is None:  # the file is wrong elsewhere, so it is unknown if it has units
        kind = quantity_kind(parameter)
        if kind is None and has_unit(value):
            return math.nan
        return read_quantity(value, kind).number if kind and isinstance(value, str) else handler(value)
    if system.units is None or not system.units.parameter(parameter) or (value == 0 and not isinstance(value, str)):
        return handler(value)
    return handler(system.units.read(parameter, value))


WITH_UNIT = WrapValidator(_with_unit)
"""Reads texts with units where the parameter of the same table has a unit."""


class StudyPart(Part):
    """Keys that the tables of all kinds of study share; `gapwalk.studies.study_schema` adds those of each kind."""

    name: Text | None = Key(default=None, validate_default=True)
    title: Text = ""
    set: Any = None  # other values of the system; read by `gapwalk.studies.set_values`

    @field_validator("name")
    @classmethod
    def _can_name_a_file(cls, name: str | None, info: ValidationInfo[Surroundings]) -> str | None:
        if name is None:
            if not info.context.alone:
                raise ValueError('is missing; it names the file of the result, as in name = "light-load"')
            return None
        if not re.fullmatch(r"\w[\w-]*", name):
            raise ValueError(f"is {given(name)}; write letters, digits, - and _, as in light-load")
        if name in info.context.all_keys():
            raise ValueError(f"is {given(name)}, which is a key of studies; choose another name")
        if name.casefold() in (
            other.casefold() for other in info.context.taken
        ):  # on some disks they would be one file
            raise ValueError(f"is {given(name)}, which is taken already; choose another name")
        return name


# The schema of a table of a model file, derived from the frozen dataclass that the table describes.
#
# It works along type hints, as the codec of result files does, so that an option is declared once. Numbers are
# strict; a tuple is a list; an enumeration has its values; a dataclass is a table of its own, or is written into the
# table around it where its field is marked as `INLINE`. Validators of pydantic in ``Annotated`` are added. What a
# dataclass refuses when it is made is a problem at the key with which its message begins.

_SCALARS: dict[Any, Any] = {
    int: Annotated[int, Key(strict=True)],
    bool: Annotated[bool, Key(strict=True)],
    float: Number,
    str: Text,
    Kind: Annotated[Kind, PlainValidator(one_of(Kind.known))],
}


class DerivedPart(StudyPart):
    """The table of a study whose keys are the fields of its kind."""

    def options(self, system: System) -> StudyKind:
        """Return the study that the table requests; raise a ModelError if it is invalid."""
        kind = _KINDS[type(self)]
        return kind.of_table(given_of(kind, self), system)

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of tables in it that have no effect."""
        return _KINDS[type(self)].unused({name: getattr(self, name) for name in self.model_fields_set})


_KINDS: dict[type[Part], type[StudyKind]] = {}


@cache
def study_schema(kind: type[StudyKind]) -> type[DerivedPart]:
    """Return the schema of the table of a kind of study."""
    schema = _made(kind, DerivedPart, {"kind": (Literal[kind.kind], ...)}, kind.table_types)
    _KINDS[schema] = kind
    return schema


_KEYS = """
accuracy balance band bins box by called carry changes check claim confidence contact correlation error exact
exact_borders factors fixed forces foretell from gaps goals harmonics hold kick kind kinds largest_amplitude listed
longest margin max_branches max_period max_periods max_samples measure method modes name near neighbours of orders
over pairs parameter parameters parts patience period periods phase plane points rate reference release resolution
rounds samples search second sections seed set shooting shortest signal spread start starts steps title to
tolerance tolerated tone tongues trace tries values verify walk ways window with_response workers
"""
"""The keys of the package's kinds of study, which would take a third of a second to load."""


def all_keys() -> frozenset[str]:
    """Return the keys of all kinds of study."""
    return frozenset(_KEYS.split()).union(*map(keys_of, added_kinds()))


def keys_of(name: str) -> frozenset[str]:
    """Return the keys of a kind of study, by its name."""
    fields_of_table = study_schema(kind_of(name)).model_fields
    return frozenset(info.alias or field for field, info in fields_of_table.items())


@cache
def table_schema(record: type) -> type[Part]:
    """Return the schema of a table that describes a dataclass."""
    return _made(record, Part, {}, {})


def given_of(record: type, part: Part) -> dict[str, Any]:
    """Return the values that a table gives to the fields of a dataclass, by name."""
    names = {field.name for field, _ in _hints(record)}
    own = (getattr(record, "table_types", {}).keys() & type(part).model_fields.keys()) - names
    found = {name: getattr(part, name) for name in own}
    for field, hint in _hints(record):
        if INLINE in marks_of(hint):
            inner = given_of(_bare(hint), part)
            found |= {field.name: _bare(hint)(**inner)} if inner else {}
        elif field.name in type(part).model_fields:
            value = getattr(part, field.name)
            is_given = field.name in part.model_fields_set or value is not default_of(field)
            if is_given and not (value is None and OPEN in marks_of(hint)):
                found[field.name] = value
    return found


def _made(record: type, base: type[Part], first: Mapping[str, Any], types: Mapping[str, Any]) -> Any:
    keys = dict(first)
    for field, hint in _keys(record):
        if field.name not in types:
            keys[field.name] = (key_type(hint), _key_default(field, hint))
    known = {field.name: (field, hint) for field, hint in _keys(record)}
    for name, kind in types.items():
        if isinstance(kind, tuple):
            keys[name] = kind
        elif kind is not None:
            keys[name] = (kind, _key_default(*known[name]))

    def makes_sense(part: Part) -> Part:
        for options in _parts_of(record):
            options(**given_of(options, part))
        return part

    check: Any = model_validator(mode="after")(makes_sense)
    return create_model(
        f"{record.__name__}Table", __base__=base, __module__=record.__module__, __validators__={"_sense": check}, **keys
    )


def key_type(hint: Any) -> Any:
    """Return the type of a key of a table, from the type hint of a field."""
    if get_origin(hint) is Annotated:
        inner, *marks = get_args(hint)
        kind = key_type(inner)
        if OPEN in marks:
            kind = Optional[kind]  # noqa: UP045 (what | does not take)
        marks = [mark for mark in marks if not isinstance(mark, str)]
        return Annotated[kind, *marks] if marks else kind
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return _union(arguments)
    if origin is tuple:
        return _list(arguments)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return dict[key_type(arguments[0]), key_type(arguments[1])]
    if isinstance(hint, type) and issubclass(hint, Enum):
        return Annotated[hint, BeforeValidator(one_of(hint))]  # pyright: ignore[reportArgumentType]
    if isinstance(hint, type) and is_dataclass(hint):
        return Annotated[table_schema(hint), AfterValidator(lambda part: hint(**given_of(hint, part)))]
    return _SCALARS.get(hint, hint)


def _list(arguments: tuple[Any, ...]) -> Any:
    """Return the type of a tuple, which a file writes as a list."""
    if arguments[1:] == (...,):
        return Annotated[list[key_type(arguments[0])], AfterValidator(tuple)]
    size = len(arguments)
    return Annotated[list[key_type(arguments[0])], Key(min_length=size, max_length=size), AfterValidator(tuple)]


def _union(arguments: tuple[Any, ...]) -> Any:
    """Return the type of a union: lists are distinguished from other values by their shape; None is omitted."""
    rest = [each for each in arguments if each is not type(None)]
    found = key_type(rest[0])
    if len(rest) == 2 and get_origin(_bare(rest[1])) is tuple:
        found = Annotated[
            Annotated[found, tagged("one")] | Annotated[key_type(rest[1]), tagged("list")],
            by_shape(list=list, one=object),
        ]
    elif len(rest) > 1:
        raise TypeError(f"{arguments} needs a type for the table of the study; add one to table_types")
    return Optional[found] if len(rest) < len(arguments) else found  # noqa: UP045 (what | does not take)


def _keys(record: type) -> Iterator[tuple[Field[Any], Any]]:
    """Return the fields that are keys, with their type hints; those of studies first, since other checks use them."""
    rest = []
    plain = {field.name for options in _parts_of(record) if options is not record for field in fields(options)}
    for field, hint in _hints(record):
        if INLINE in marks_of(hint):
            rest += _keys(_bare(hint))
        elif field.name in plain:
            rest.append((field, hint))
        else:
            yield field, hint
    yield from rest


def _parts_of(record: type) -> list[Any]:
    """Return the dataclasses of options from which a kind of study derives; of another dataclass, itself."""
    if not issubclass(record, StudyKind):
        return [record]
    return [each for each in record.__mro__ if is_dataclass(each) and not issubclass(each, StudyKind)]


def _hints(record: type) -> Iterator[tuple[Field[Any], Any]]:
    hints = get_type_hints(record, include_extras=True)
    return ((field, hints[field.name]) for field in fields(record) if field.init)


def _key_default(field: Field[Any], hint: Any) -> Any:
    default = None if OPEN in marks_of(hint) else default_of(field)
    return ... if default is MISSING else default


def default_of(field: Field[Any]) -> Any:
    """Return the default of a field; MISSING if it has none."""
    return field.default_factory() if field.default_factory is not MISSING else field.default


def marks_of(hint: Any) -> tuple[Any, ...]:
    """Return the marks of a field, such as `INLINE`."""
    return tuple(mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, str))


def _bare(hint: Any) -> Any:
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint
