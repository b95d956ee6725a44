"""How records describe themselves: in words for readers, in tables of numbers, and as plain values for programs.

The terminal, cards in notebooks, the explorer's page, CSV files and JSON documents ask the record.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import partial
from operator import attrgetter
from typing import Any, ClassVar


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Parameters
    ----------
    headings
        Headings of the columns. Those that begin with ``>`` (which is not shown) have columns aligned to the right.
    rows
        The cells of each row.
    groups
        Indices of the rows after which a gap separates groups of rows.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    groups: Sequence[int] = ()

    @property
    def columns(self) -> Iterator[tuple[str, bool]]:
        """Heading of each column, and True if the column is aligned to the right."""
        return ((heading.removeprefix(">"), heading.startswith(">")) for heading in self.headings)


@dataclass(frozen=True)
class Tree:
    """A text with the texts that depend on it.

    Parameters
    ----------
    label
        The text.
    children
        Trees that depend on it.
    """

    label: str
    children: list[Tree] = field(default_factory=list, hash=False)


Summary = Iterable[str | Table | Tree]
"""A record in the words that the terminal shows: lines, tables and trees, from the top to the bottom."""

Rows = Iterable[Sequence[object]]
"""The rows of a table of numbers, the first of them the headings."""

Tables = Mapping[str, Callable[[], Rows]]
"""Functions that return the rows of tables, by the names of the tables; the most important one is the first."""


class Described:
    """A record that describes itself.

    The defaults follow its fields. A class that has more to say overrides `summary` or `tables`.
    """

    __slots__ = ()

    _row: ClassVar[Mapping[str, str]] = {}
    """The row of the record in a table: the path of an attribute, such as ``orbit.pattern``, by each heading. By
    default the row has all fields that are numbers or texts."""

    def summary(self) -> Summary:
        """Return the record in words: lines of text, tables and trees."""
        return (repr(self),)

    def tables(self) -> Tables:
        """Return the tables of the record by name.

        A field with several records is a table with a row for each of them. Fields with arrays of one length are the
        columns of a table, which is named after the first of them.
        """
        tables: dict[str, Callable[[], Rows]] = {}
        arrays: dict[int, dict[str, Any]] = {}
        value: Any
        for name, value in _fields_of(self):
            if isinstance(value, tuple):
                if type(value) is tuple and value and all(map(_is_record, value)):
                    tables[name.replace("_", "-")] = partial(_record_rows, value)
            elif getattr(value, "ndim", 0) == 1:  # NumPy is not imported here: help of commands must appear at once
                arrays.setdefault(len(value), {})[name] = value.tolist()
        for columns in arrays.values():
            tables[next(iter(columns)).replace("_", "-")] = partial(_array_rows, columns)
        return tables

    def to_dict(self) -> dict[str, Any]:
        """Return the record as plain JSON values.

        Complex numbers become pairs, and what is not finite becomes None.
        """
        from gapwalk.results.plain import plain

        return plain(self)


def row_of(record: Any) -> dict[str, Any]:
    """Return the numbers and texts of a record by the headings of its row; None in place of an empty text."""
    paths = getattr(record, "_row", None) or {name: name for name, _ in _fields_of(record)}
    row = {heading: attrgetter(path)(record) for heading, path in paths.items()}
    plain = {name: value.value if isinstance(value, Enum) else value for name, value in row.items()}
    return {
        name: None if isinstance(value, str) and not value else value
        for name, value in plain.items()
        if isinstance(value, str | float | complex | int) or getattr(value, "shape", None) == ()
    }


def rows_of(rows: Iterable[Mapping[str, Any]], empty: Sequence[str] = ()) -> Rows:
    """Yield the rows of a table of numbers, after their headings; `empty` are those of a table without rows.

    A complex number takes two columns, a mapping one for each of its values; a tuple of names is one text.
    """
    number = -1
    for number, row in enumerate(rows):
        cells = dict(_cells(row))
        if not number:
            yield list(cells)
        yield list(cells.values())
    if number < 0:
        yield list(empty)


def _record_rows(records: Sequence[Any]) -> Rows:
    return rows_of(map(row_of, records))


def _array_rows(columns: Mapping[str, list[Any]]) -> Rows:
    return rows_of(dict(zip(columns, line, strict=True)) for line in zip(*columns.values(), strict=True))


def _cells(row: Mapping[str, Any]) -> Iterator[tuple[str, object]]:
    for name, value in row.items():
        if isinstance(value, Mapping):
            yield from value.items()
        elif isinstance(value, complex):
            parts = (None, None) if cmath.isnan(value) else (value.real, value.imag)
            yield from zip((f"re.{name}", f"im.{name}"), parts, strict=True)
        else:
            yield name, " ".join(value) if isinstance(value, tuple) else value


def _fields_of(record: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each field of a dataclass or a named tuple that is its own, not a note of its caches."""
    if is_dataclass(record):
        names = [each.name for each in fields(record) if each.metadata.get("stored", True)]
    else:
        names = record._fields
    return ((name, getattr(record, name)) for name in names)


def _is_record(value: Any) -> bool:
    return (is_dataclass(value) and not isinstance(value, type)) or hasattr(value, "_fields")


def remarks(notes: Iterable[str], failures: Iterable[str]) -> Iterator[str]:
    """Return the last lines of a summary: notes, and what could not be computed."""
    yield from (f"note: {text}" for text in notes)
    yield from (f"failed: {text}" for text in failures)
