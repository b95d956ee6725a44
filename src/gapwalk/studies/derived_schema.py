"""The schema of a table of a model file, derived from the frozen dataclass that the table describes.

It works along type hints, as the codec of result files does, so that an option is declared once. Numbers are
strict; a tuple is a list; an enumeration has its values; a dataclass is a table of its own, or is written into the
table around it where its field is marked as `INLINE`. Validators of pydantic in ``Annotated`` are added. What a
dataclass refuses when it is made is a problem at the key with which its message begins.
"""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Annotated, Any, Literal, Optional, Union, get_args, get_origin, get_type_hints

from pydantic import AfterValidator, BeforeValidator, PlainValidator, create_model, model_validator
from pydantic import Field as Key

from gapwalk.bifurcation.kinds import Kind
from gapwalk.model.schema import Number, Part, Text, by_shape, one_of, tagged
from gapwalk.model.system import System
from gapwalk.studies.study_kind import StudyKind
from gapwalk.studies.study_registry import INLINE, OPEN, added_kinds, kind_of
from gapwalk.studies.study_tables import StudyPart

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
accuracy balance band bins called carry changes check claim contact correlation error exact exact_borders
factors fixed forces foretell from gaps goals harmonics hold kick kind kinds largest_amplitude listed longest
margin max_branches max_period max_periods max_samples measure method modes name near neighbours of orders over
pairs parameter parameters parts patience period periods phase plane points rate reference release resolution
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
        raise TypeError(f"{arguments} has no type in a table; give one in table_types")
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
