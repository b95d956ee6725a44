"""One codec for all records: a value as JSON and bytes, and the same value back, bit for bit.

Both sides follow the type hints of the records. Every value is written as a *column* of values of one type, so that a
branch of a thousand points becomes a few long arrays and not a thousand small objects; a single value is a column of
one. Long columns of numbers and all arrays are kept aside as bytes, in the order in which they occur; the JSON holds
the rest. A column of one number or text is written without brackets, so the JSON of a single record reads as usual.

Nothing that is read is trusted: each value must be of the type that its hint names, and memory is allocated only where
the bytes to fill it are there.
"""

from __future__ import annotations

import cmath
import json
import math
import types
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cache, cached_property
from itertools import accumulate, pairwise
from typing import Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.special_point import KINDS, Kind
from gapwalk.errors import ModelError
from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, structure_of
from gapwalk.model.laws import FORMULAS, LAWS, Law
from gapwalk.model.laws.law import data_of
from gapwalk.model.loads import LOADS, Load, LoadForm
from gapwalk.model.paced_matrices import PacedMatrices
from gapwalk.model.registry import Registry, UnknownNameError
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.balance import BalancedOrbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Rows

# Bytes of a stored value: its arrays, one after the other, in the order in which its JSON refers to them.

Node = Any
"""Values that JSON can write."""

_DIMENSIONS = 8  # at most, of an array
_KEYS = {"array", "shape"}


class Writer:
    """Collector of the arrays of a value that is being written; `base` as in `encode`."""

    def __init__(self, base: Any) -> None:
        self.base = base
        self.chunks: list[bytes] = []

    def put(self, array: NDArray[Any], code: str) -> Node:
        """Add an array of numbers; return the node that refers to it."""
        self.chunks.append(np.ascontiguousarray(array, dtype=f"<{code}").tobytes())
        return {"array": code, "shape": list(array.shape)}


class Reader:
    """Source of the arrays of a value that is being read, in the order of writing; `base` as in `encode`.

    Attributes
    ----------
    size
        Bytes of all that is read: each item of a tuple takes at least one.
    """

    def __init__(self, data: bytes, size: int, base: Any) -> None:
        self.size, self.base = size, base
        self._data, self._at = data, 0

    def take(self, node: Node, code: str) -> NDArray[Any]:
        """Return the next array, of numbers of one kind."""
        shape: Any = node.get("shape") if isinstance(node, dict) else None
        if not is_shape(shape) or set(node) != _KEYS or node["array"] != code:
            raise ValueError(f"there is {json.dumps(node):.60} where an array of the kind {code} should be")
        dtype = np.dtype(f"<{code}")
        size = math.prod(shape) * dtype.itemsize
        if size > len(self._data) - self._at:
            raise ValueError(f"an array has the stated shape {shape}, but its bytes are missing")
        found = np.frombuffer(self._data, dtype, math.prod(shape), self._at).astype(dtype.newbyteorder("="))
        self._at += size
        if code == "b1" and found.view(np.uint8).max(initial=0) > 1:
            raise ValueError("an array of truth values holds something else")
        return found.reshape(shape)

    def check_empty(self) -> None:
        """Raise a ValueError unless all bytes were taken."""
        if self._at != len(self._data):
            raise ValueError(f"{len(self._data) - self._at} bytes are left over")


def is_shape(shape: Any) -> bool:
    """Return True if a value that was read can be the shape of an array."""
    return (
        isinstance(shape, list)
        and len(shape) <= _DIMENSIONS
        and all(type(length) is int and 0 <= length < 1 << 62 for length in shape)
    )


# ruff: noqa: D102 (the methods of columns are described in Column)


T = TypeVar("T")

_NONE = "none"  # the tag of None
_LONG = 8  # from so many numbers on a column is kept as an array
_WORDS = {bool: "true or false", int: "an integer", float: "a number", str: "a text", dict: "a table", list: "a list"}


class Packed(NamedTuple):
    """Stored form of a value: JSON, and the bytes of its arrays."""

    head: str
    arrays: bytes


def encode(value: Any, kind: Any, base: Any = None) -> Packed:
    """Return a value as JSON and bytes."""
    writer = Writer(base)
    node = column_of(kind).write([value], writer)
    return Packed(json.dumps(node, allow_nan=False, separators=(",", ":")), b"".join(writer.chunks))


def decode(packed: Packed, kind: Any, base: Any = None) -> Any:
    """Return the value of JSON and bytes; parameters as `encode`."""
    reader = Reader(packed.arrays, len(packed.head) + len(packed.arrays), base)
    (value,) = column_of(kind).read(json.loads(packed.head), 1, reader)
    reader.check_empty()
    return value


def checked(record: T) -> T:
    """Return a record made from stored values; raise a ValueError if its fields do not fit together."""
    check: Callable[[], object] | None = getattr(record, "_check_read", None)
    if check is not None:
        check()
    return record


class Column(ABC):
    """Writer and reader of the values of one type, many at once."""

    tag: str
    """The name of the type, which tells it from the others of a union."""

    @abstractmethod
    def fits(self, value: Any) -> bool:
        """Return True if a value is of the type."""

    def write(self, values: Sequence[Any], writer: Writer) -> Node:
        """Return the node of some values; raise a ModelError if one of them is of another type."""
        for value in values:
            if not self.fits(value):
                raise MisfitError(f"{value!r:.60} cannot be kept in a file as {self.tag}")
        return self.put(values, writer)

    @abstractmethod
    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        """Return the node of values that are known to be of the type."""

    @abstractmethod
    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        """Return `count` values from their node; raise a ValueError, TypeError or LookupError if it is invalid."""


class Scalar(Column):
    """Numbers, truth values, texts."""

    def __init__(self, kind: type) -> None:
        self.tag, self._kind = kind.__name__, kind
        self._code = {int: "i8", float: "f8", bool: "b1"}.get(kind)
        accepted: dict[type, Any] = {
            int: (int, np.integer),
            float: (float, int, np.floating, np.integer),
            bool: (bool, np.bool_),
        }
        self._accepted = accepted.get(kind, kind)
        self._read = (int, float) if kind is float else (kind,)

    def fits(self, value: Any) -> bool:
        return isinstance(value, self._accepted) and (self._kind is bool or not isinstance(value, bool))

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        plain = [value if type(value) in self._read else self._kind(value) for value in values]
        if self._code and (len(plain) >= _LONG or not all(map(_is_plain, plain))):
            try:
                return writer.put(np.array(plain, dtype=self._code), self._code)
            except OverflowError:  # an integer of more than 64 bits
                pass
        return plain[0] if len(plain) == 1 else plain

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        if self._code and isinstance(node, dict):
            found = reader.take(node, self._code)
            if found.shape != (count,):
                raise ValueError(f"there is an array of shape {found.shape} where {count} numbers should be")
            return found.tolist()
        values = node if isinstance(node, list) else [node]
        if len(values) != count:
            raise ValueError(f"there are {len(values)} values where {count} should be")
        for value in values:
            if type(value) not in self._read or not _is_plain(value):
                raise ValueError(f"there is {_said(value)} where {_WORDS[self._kind]} should be")
        return values


class Array(Column):
    """Arrays of numbers, all of one dtype."""

    def __init__(self, kind: Any) -> None:
        dtype = np.dtype(get_args(get_args(kind)[1])[0])
        self.tag, self._dtype, self._code = "array", dtype, f"{dtype.kind}{dtype.itemsize}"
        if self._code not in ("f8", "c16", "i8", "b1"):
            raise TypeError(f"arrays of {dtype} are not kept")

    def fits(self, value: Any) -> bool:
        return isinstance(value, np.ndarray) and np.can_cast(value.dtype, self._dtype, "safe")

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        if len({value.shape for value in values}) == 1:
            return writer.put(np.stack(values), self._code)
        flat = np.concatenate([value.ravel() for value in values]) if values else np.empty(0, self._dtype)
        return {"shapes": [list(value.shape) for value in values], "numbers": writer.put(flat, self._code)}

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        _check_type(node, dict)
        if "shapes" not in node:
            found = reader.take(node, self._code)
            if found.ndim < 2 or len(found) != count:
                raise ValueError(f"there is an array of shape {found.shape} where {count} arrays should be")
            return list(found)
        shapes, flat = node["shapes"], reader.take(node["numbers"], self._code)
        if not isinstance(shapes, list) or len(shapes) != count or not all(map(is_shape, shapes)) or flat.ndim != 1:
            raise ValueError("the stated shapes of arrays are invalid")
        stops = list(accumulate(map(math.prod, shapes), initial=0))
        if stops[-1] != len(flat):
            raise ValueError("the number of values does not agree with the stated shapes")
        return [flat[first:last].reshape(shape) for shape, (first, last) in zip(shapes, pairwise(stops), strict=True)]


class Fixed(Column):
    """Tuples of a fixed length, with one type for each place."""

    def __init__(self, kinds: Sequence[Any]) -> None:
        self.tag, self._columns = "tuple", [column_of(kind) for kind in kinds]

    def fits(self, value: Any) -> bool:
        return isinstance(value, tuple | list) and len(value) == len(self._columns)

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        return [column.write([value[at] for value in values], writer) for at, column in enumerate(self._columns)]

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        _check_type(node, list)
        columns = [column.read(each, count, reader) for column, each in zip(self._columns, node, strict=True)]
        return list(zip(*columns, strict=True))


class Sequential(Column):
    """Tuples of any length, all items of one type."""

    def __init__(self, kind: Any) -> None:
        self.tag, self._items, self._counts = "tuple", column_of(kind), Scalar(int)

    def fits(self, value: Any) -> bool:
        return isinstance(value, tuple | list)

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        counts = self._counts.write([len(value) for value in values], writer)
        items = [item for value in values for item in value]
        return {"count": counts, "items": self._items.write(items, writer) if items else None}

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        _check_type(node, dict)
        sizes = self._counts.read(node["count"], count, reader)
        stops = list(accumulate(sizes, initial=0))
        if min(sizes, default=0) < 0 or stops[-1] > reader.size or set(node) != {"count", "items"}:
            raise ValueError(f"{max(sizes, default=0)} items are stated, but the file does not have them")
        if not stops[-1] and node["items"] is not None:
            raise ValueError("there are items, but their stated number is 0")
        items = self._items.read(node["items"], stops[-1], reader) if stops[-1] else []
        return [tuple(items[first:last]) for first, last in pairwise(stops)]


class Record(Column):
    """Frozen dataclasses and named tuples, field by field.

    A field with ``metadata={"stored": False}`` is left out; one that a file lacks has its default. Cached properties
    that a class names in ``_kept`` are kept too, so that they need not be computed again. What is read is checked by
    its method ``_check_read``, if it has one, which raises a ValueError if its fields do not fit together.
    """

    def __init__(self, kind: type) -> None:
        self.tag, self.kind = kind.__name__, kind
        derived = {name: get_type_hints(getattr(kind, name).func)["return"] for name in getattr(kind, "_kept", ())}
        self._derived = {name: column_of(hint) for name, hint in derived.items()}

    @cached_property
    def _columns(self) -> dict[str, Column]:
        return {name: column_of(hint) for name, hint in _field_hints(self.kind).items()}

    @cached_property
    def _needed(self) -> frozenset[str]:
        if not is_dataclass(self.kind):
            return frozenset(self._columns) - frozenset(getattr(self.kind, "_field_defaults", ()))
        defaults = {
            field.name for field in fields(self.kind) if (field.default, field.default_factory) != (MISSING,) * 2
        }
        return frozenset(self._columns) - defaults

    def fits(self, value: Any) -> bool:
        return type(value) is self.kind

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        node, name = {}, ""
        try:
            for name, column in (self._columns | self._derived).items():
                node[name] = column.write([getattr(value, name) for value in values], writer)
        except MisfitError as error:
            raise MisfitError(f"{self.tag}.{name}: {error}") from None
        return node

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        _check_type(node, dict)
        wanted = self._columns | self._derived
        if strange := set(node) - set(wanted):
            raise ValueError(f"a {self.tag} has no {min(strange):.60}")
        if missing := {*self._needed, *self._derived} - set(node):
            raise ValueError(f"the {min(missing)} of a {self.tag} is missing")
        name, columns = "", {}
        try:
            for name, column in wanted.items():
                if name in node:
                    columns[name] = column.read(node[name], count, reader)
        except UnknownNameError:  # nothing is wrong with the file
            raise
        except ValueError as error:
            raise ValueError(f"{self.tag}.{name}: {error}") from error
        derived = [columns.pop(name) for name in self._derived]
        names = tuple(columns)
        made = [self.kind(**dict(zip(names, row, strict=True))) for row in zip(*columns.values(), strict=True)]
        for name, values in zip(self._derived, derived, strict=True):
            for record, value in zip(made, values, strict=True):
                record.__dict__[name] = value  # where a cached property looks first
        return [checked(record) for record in made] if hasattr(self.kind, "_check_read") else made


class OneOf(Column):
    """Values of several types, each by its tag, and None where the union is optional."""

    tag = "union"

    def __init__(
        self, tag_of: Callable[[Any], str | None], column_of_tag: Callable[[str], Column], *, optional: bool = False
    ) -> None:
        self._tag_of, self._column_of, self._optional = tag_of, column_of_tag, optional

    @classmethod
    def of(cls, columns: Iterable[Column], *, optional: bool = False) -> OneOf:
        """Return the union of some columns."""
        known = {column.tag: column for column in columns}

        def tag_of(value: Any) -> str | None:
            return next((tag for tag, column in known.items() if column.fits(value)), None)

        return cls(tag_of, known.__getitem__, optional=optional)

    def fits(self, value: Any) -> bool:
        return self._tag(value) is not None

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        tags = [str(self._tag(value)) for value in values]
        node = {"is": tags[0] if len(set(tags)) == 1 else tags}
        for tag in sorted({*tags} - {_NONE}):
            chosen = [value for value, each in zip(values, tags, strict=True) if each == tag]
            node[tag] = self._column_of(tag).write(chosen, writer)
        return node

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        _check_type(node, dict)
        tags = [node["is"]] * count if isinstance(node["is"], str) else Scalar(str).read(node["is"], count, reader)
        found = {}
        for tag in sorted(set(tags)):
            if tag == _NONE and self._optional:
                found[tag] = iter([None] * count)
                continue
            try:
                column = self._column_of(tag)
            except LookupError:
                raise ValueError(f"there is no {tag:.60} here") from None
            found[tag] = iter(column.read(node[tag], tags.count(tag), reader))
        if set(node) - {"is"} != set(found) - {_NONE}:
            raise ValueError("there are more fields than the table names")
        return [next(found[tag]) for tag in tags]

    def _tag(self, value: Any) -> str | None:
        return _NONE if value is None and self._optional else self._tag_of(value)


class Free(Column):
    """Any JSON value, for the hint `object`: numbers, texts, lists and tables."""

    tag = "object"

    def fits(self, value: Any) -> bool:
        return True

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        return list(values)

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        _check_type(node, list)
        if len(node) != count:
            raise ValueError(f"there are {len(node)} values where {count} should be")
        return node


class Converted(Column):
    """Column of values that a file has in another type, such as texts in place of names."""

    def __init__(self, kind: type, hint: Any, to: Callable[[Any], Any], of: Callable[[Any], Any]) -> None:
        self.tag, self._kind, self._hint, self._to, self._of = kind.__name__, kind, hint, to, of

    def fits(self, value: Any) -> bool:
        return isinstance(value, self._kind)

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        return column_of(self._hint).write([self._to(value) for value in values], writer)

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        return [self._of(value) for value in column_of(self._hint).read(node, count, reader)]


class Enumerated(Converted):
    """Members of an enumeration, by their names; a text that is the value of one will do."""

    def __init__(self, kind: type[Enum]) -> None:
        def member(name: str) -> Enum:
            if name not in kind.__members__:
                raise ValueError(f"{name:.60} is no {kind.__name__}")
            return kind[name]

        super().__init__(kind, str, lambda value: kind(value).name, member)
        self._values = [value for value in kind if isinstance(value, str)]

    def fits(self, value: Any) -> bool:
        return super().fits(value) or (isinstance(value, str) and value in self._values)


_COLUMNS: dict[Any, Column] = {object: Free(), **{kind: Scalar(kind) for kind in (bool, int, float, str)}}


def register(kind: Any, column: Column) -> None:
    """Register a column for a type."""
    _COLUMNS[kind] = column
    column_of.cache_clear()


@cache
def column_of(kind: Any) -> Column:
    """Return the column of a type; raise a TypeError for a type hint that cannot be stored."""
    kind = _meant(kind)
    if kind in _COLUMNS:
        return _COLUMNS[kind]
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        rest = [each for each in arguments if each is not type(None)]
        return OneOf.of(map(column_of, rest), optional=len(rest) < len(arguments))
    if origin is tuple:
        return Sequential(arguments[0]) if arguments[1:] == (...,) else Fixed(arguments)
    if origin is np.ndarray:
        return Array(kind)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        pairs = tuple[tuple[arguments[0], arguments[1]], ...]
        return Converted(Mapping, pairs, lambda value: tuple(value.items()), dict)
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return Sequential(arguments[0])
    if isinstance(kind, type) and issubclass(kind, Enum):
        return Enumerated(kind)
    if isinstance(kind, type) and (is_dataclass(kind) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))):
        return Record(kind)
    raise TypeError(f"values of the type {kind} cannot be kept")


def _meant(kind: Any) -> Any:
    """Return what an alias of the `type` statement stands for: so is `NDArray` of NumPy 2.5 on Python 3.12."""
    alias = get_origin(kind) or kind
    if not hasattr(alias, "__value__"):  # typing.TypeAliasType, which Python 3.11 lacks
        return kind
    return alias.__value__[get_args(kind)] if get_args(kind) else alias.__value__


class MisfitError(ModelError):
    """Error: a value is not of the type that its hint names, so that it cannot be stored."""


def _field_hints(kind: type) -> dict[str, Any]:
    hints = get_type_hints(kind)
    if not is_dataclass(kind):
        return {name: hints[name] for name in kind._fields}  # pyright: ignore[reportAttributeAccessIssue]
    stored = (field for field in fields(kind) if field.init and field.metadata.get("stored", True))
    return {field.name: hints[field.name] for field in stored}


def _is_plain(value: Any) -> bool:
    """Return True if JSON can write a number without loss."""
    return not isinstance(value, float) or math.isfinite(value)


def _check_type(node: Node, kind: type) -> None:
    if type(node) is not kind:
        raise ValueError(f"there is {_said(node)} where {_WORDS[kind]} should be")


def _said(node: Node) -> str:
    return "nothing" if node is None else _WORDS.get(type(node), type(node).__name__)


# Columns of records that are more than their fields: systems, their structures, orbits.

# ruff: noqa: D102 (the methods of columns are described in gapwalk.results.codec.Column)


MANY = 10_000
"""Parameters beyond which zeros of vectors and matrices are not written."""

_COORDINATES = 5_000  # at most, in a file


class PlainStructure(NamedTuple):
    """Parts of a structure without an assembly."""

    coordinates: tuple[str, ...]
    contacts: tuple[ContactForm, ...]
    harmonics: tuple[LoadForm, ...]


class WholeSystem(NamedTuple):
    """Structure of a system, and its parameters by name."""

    structure: Structure
    parameters: Mapping[str, float]


class Systems(Column):
    """Systems of one structure, stored by the parameters in which they differ from a base system.

    If there is no base, or it has another structure, the first of them is written completely and is the base.
    """

    tag = "System"

    def fits(self, value: Any) -> bool:
        return isinstance(value, System)

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        for value in values:
            if value.structure is not values[0].structure and value.structure != values[0].structure:
                raise MisfitError(f"{value!r:.60} cannot be kept beside systems of another structure")
        base, whole = writer.base, None
        if values and (base is None or base.structure != values[0].structure):
            base = values[0]
            whole = column_of(WholeSystem).write([WholeSystem(base.structure, parameters_of(base))], writer)
        changes = _changes(values, base) if values else []
        places = sorted({place for each in changes for place in each})
        rows = [[change.get(place, base.values[place]) for place in places] for change in changes]
        numbers = np.array(rows, dtype=float).reshape(len(values), len(places))
        names = [base.structure.names[place] for place in places]
        return {"base": whole, "names": names, "values": writer.put(numbers, "f8")}

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        base: Any = reader.base
        names = node["names"]
        if node["base"] is not None:
            (whole,) = column_of(WholeSystem).read(node["base"], 1, reader)
            base = system_of(whole)
        numbers = reader.take(node["values"], "f8")
        if numbers.shape != (count, len(names)) or not np.isfinite(numbers).all():
            raise ValueError("the parameters of some systems are missing")
        if base is None:
            if count:
                raise ValueError("there is no system from which others differ")
            return []
        places = [base.structure.place(name) for name in names]
        return [_changed(base, places, row) for row in numbers.tolist()]


def parameters_of(system: System) -> dict[str, float]:
    """Return the parameters by name; of very many, zeros in vectors and matrices are left out."""
    if len(system.parameters) <= MANY:
        return dict(system.parameters)
    names, values = system.structure.names, system.values
    places = {*np.flatnonzero(_bits(values)).tolist(), *names.single}
    return {names[place]: float(values[place]) for place in sorted(places)}


def system_of(whole: WholeSystem) -> System:
    """Return the system; raise a ValueError (such as a ModelError) if the stored values do not describe one."""
    structure, parameters = whole
    if len(structure.coordinates) > min(_COORDINATES, len(parameters)):  # before room is made for their matrices
        raise ValueError("a system has more parameters than are given")
    names = structure.names
    places = [names.place(name) for name in parameters]
    values = np.zeros(len(names))
    values[places] = list(parameters.values())
    if not set(range(len(names)) if len(names) <= MANY else names.single) <= set(places):
        raise ValueError("the parameters are not those of the system")
    return System.from_values(structure, values).at()  # `at` refuses values that no system can have


def _changes(systems: Sequence[System], base: System) -> list[dict[int, float]]:
    """Return the parameters, by place, in which each system differs from the base; zeros may differ in their signs."""
    shared: dict[int, dict[int, float]] = {}
    changes = []
    for system in systems:
        values, own = system.shared
        if id(values) not in shared:
            places = np.flatnonzero(_bits(values) != _bits(base.values)).tolist()
            shared[id(values)] = {place: float(values[place]) for place in places}
        changes.append(shared[id(values)] | own)
    return changes


def _changed(base: System, places: Sequence[int], values: Sequence[float]) -> System:
    if not places:
        return base
    if len(places) == 1:
        return System.beside(base, places[0], values[0])
    changed = base.values.copy()
    changed[list(places)] = values
    return System.from_values(base.structure, changed)


def _bits(values: NDArray[np.float64]) -> NDArray[np.int64]:
    return values.view(np.int64)


def _plain_structure(structure: Structure) -> Any:
    if structure.assembly is not None:
        return structure.assembly
    return PlainStructure(structure.coordinates, structure.contacts, structure.harmonics)


def _structure_of(plain: Any) -> Structure:
    if isinstance(plain, PacedMatrices):
        return replace(plain.inner, assembly=plain)
    structure = structure_of(plain) if isinstance(plain, TrainAssembly) else Structure(*plain)
    for each in (structure, structure.equations):
        prefixes = [block.prefix for block in each.names.blocks]
        words = [*each.coordinates, *(word for prefix in prefixes for word in prefix.split("."))]
        if not all(word.isidentifier() for word in words) or len(set(prefixes)) < len(prefixes):
            raise ValueError("a part of the system has no name, or the name of another part")
        if len(set(each.coordinates)) < len(each.coordinates):
            raise ValueError("two coordinates have one name")
    return structure


def _options_of(name: str) -> Column:
    """Return the column of the options of a method, by its name."""
    return column_of(Method.named(name))


@cache
def _orbits_of(name: str) -> Column:
    """Return the column of orbits of a class, by its name: those of a method may have more fields than others."""
    return Record({kind.__name__: kind for kind in (Orbit, BalancedOrbit, *Orbit.__subclasses__())}[name])


class Registered(Converted):
    """Members of a registry, by their names; an unregistered object is refused, because it could not be read again."""

    def __init__(self, registry: Registry[Any], name_of: Callable[[Any], str]) -> None:
        super().__init__(object, str, name_of, registry.named)
        self.tag, self._registry = f"a {registry.words} that is registered", registry

    def fits(self, value: Any) -> bool:
        return value in self._registry.values()


register(Kind, Registered(KINDS, str))


class PlainLaw(NamedTuple):
    """Name of a force law, and its data as JSON; none if it is registered under that name."""

    name: str
    data: str


class PlainLoad(NamedTuple):
    """Parts of the form of a load, with its constants as JSON."""

    name: str
    order: int
    kind: type[Load]
    constants: str
    varies: tuple[tuple[str, float], ...]


class Laws(Converted):
    """Force laws by their names, with the data of those that have some; one that could not be read is refused."""

    def __init__(self) -> None:
        super().__init__(Law, PlainLaw, _plain_law, _law_of)
        self.tag = f"a {LAWS.words} that is registered"

    def fits(self, value: Any) -> bool:
        return value in LAWS.values() or type(value) in FORMULAS.values()


def _plain_law(law: Law) -> PlainLaw:
    return PlainLaw(law.name, _json(data_of(law)) if type(law) in FORMULAS.values() else "")


def _law_of(plain: PlainLaw) -> Law:
    if not plain.data:
        return LAWS.named(plain.name)
    return FORMULAS.named(plain.name)(**_from_json(plain.data))


def _plain_load(form: LoadForm) -> PlainLoad:
    return PlainLoad(form.name, form.order, form.kind, _json(dict(form.constants)), form.varies)


def _load_of(plain: PlainLoad) -> LoadForm:
    return LoadForm(*plain[:3], tuple(_from_json(plain.constants).items()), plain.varies)


def _json(data: Mapping[str, Any]) -> str:
    return json.dumps(data, allow_nan=False)


def _from_json(text: str) -> dict[str, Any]:
    """Read data of texts, numbers and tuples; raise a ValueError for anything else."""

    def tuples(value: Any) -> Any:
        if isinstance(value, dict):
            raise ValueError("the data of a force law or a load are not plain")
        return tuple(map(tuples, value)) if isinstance(value, list) else value

    data = json.loads(text)
    if not isinstance(data, dict):
        raise ValueError("the data of a force law or a load are no table")
    return {name: tuples(value) for name, value in data.items()}


register(Fraction, Converted(Fraction, str, str, Fraction))
register(Law, Laws())
register(LoadForm, Converted(LoadForm, PlainLoad, _plain_load, _load_of))
register(type[Load], Registered(LOADS, lambda kind: kind.key))
register(System, Systems())
register(
    Structure, Converted(Structure, TrainAssembly | PacedMatrices | PlainStructure, _plain_structure, _structure_of)
)
register(Method, OneOf(lambda value: value.name if isinstance(value, Method) else None, _options_of))
register(Orbit, OneOf(lambda value: type(value).__name__ if isinstance(value, Orbit) else None, _orbits_of))


# Records as plain JSON values, for other programs; what gapwalk reads back is written by its codec.


def plain(value: Any) -> Any:
    """Return a record, or anything in one, as plain JSON values."""
    # Records become tables, named by the `kind` or `name` of their class if it has one. Complex numbers become pairs,
    # and what is not finite becomes null. Force laws and loads are written by name; systems within records are left
    # out.
    match value:
        case System():
            return _plain_system(value)
        case Law():
            return {"name": value.name, **data_of(value)} if is_dataclass(value) else value.name
        case type() if issubclass(value, Load):
            return value.key
        case Enum():
            return value.value
        case np.ndarray() if np.iscomplexobj(value):
            return plain(np.stack((value.real, value.imag), axis=-1))
        case np.ndarray():
            return plain(value.tolist())
        case Mapping():
            return {str(plain(key)): plain(item) for key, item in value.items()}
        case list() | tuple():
            return [plain(item) for item in value]
        case np.generic():
            return plain(value.item())
        case complex():
            return [value.real, value.imag] if cmath.isfinite(value) else None
        case float():
            return value if math.isfinite(value) else None
        case _ if is_dataclass(value):
            return _plain_record(value)
    return value


def plain_rows(rows: Rows) -> list[dict[str, Any]]:
    """Return the rows of a table, the first of them its headings, as plain JSON values by their headings."""
    headings, *others = rows
    return [dict(zip(map(str, headings), plain(tuple(row)), strict=True)) for row in others]


def _plain_record(record: Any) -> dict[str, Any]:
    labels = {label: getattr(type(record), label, None) for label in ("kind", "name")}
    document = {label: text for label, text in labels.items() if isinstance(text, str)}
    for field in fields(record):
        value = getattr(record, field.name)
        if field.metadata.get("stored", True) and not isinstance(value, System):
            document[field.name] = plain(value)
    return document


def _plain_system(system: System) -> dict[str, Any]:
    """Return the parts of a system, and its parameters by name."""
    structure = system.structure
    parts = {name: plain(getattr(structure, name)) for name in ("coordinates", "contacts", "harmonics")}
    train = {} if structure.assembly is None else {"train": plain(structure.assembly)}
    return parts | train | {"parameters": parameters_of(system)}
