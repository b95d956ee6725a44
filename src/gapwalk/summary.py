"""Self-description of records: in words for readers, in tables of numbers, and as plain values for programs.

The terminal, cards in notebooks, the explorer's page, CSV files and JSON documents ask the record.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cache, partial, wraps
from io import StringIO
from operator import attrgetter
from textwrap import wrap
from typing import TYPE_CHECKING, Any, ClassVar, ParamSpec

if TYPE_CHECKING:
    import rich.console
    import rich.tree
    import xarray

_WIDTH = 1000  # of text, where tables are not folded


@dataclass(frozen=True)
class Table:
    """A table of texts."""

    #: Headings of the columns. Those that begin with ``>`` (which is not shown) have columns aligned to the right.
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]  #: The cells of each row.
    groups: Sequence[int] = ()  #: Indices of the rows after which a gap separates groups of rows.
    #: Headings of columns that are left out, and named, where the width does not suffice: the first ones first.
    spare: Sequence[str] = ()

    @property
    def filled(self) -> Table:
        """The table without columns whose cells are all empty."""
        places = [at for at in range(len(self.headings)) if any(row[at] for row in self.rows)]
        heads, rows = [self.headings[k] for k in places], [[row[k] for k in places] for row in self.rows]
        return Table(heads, rows, self.groups, [each for each in self.spare if each in heads])

    @property
    def columns(self) -> Iterator[tuple[str, bool]]:
        """Heading of each column, and True if the column is aligned to the right."""
        return ((heading.removeprefix(">"), heading.startswith(">")) for heading in self.headings)


@dataclass(frozen=True)
class Tree:
    """A text with the texts that depend on it."""

    label: str  #: The text.
    children: list[Tree] = field(default_factory=list, hash=False)  #: Trees that depend on it.


SummaryParts = Iterable[str | Table | Tree]
"""SummaryParts of a summary: lines, tables and trees, from the top to the bottom."""

P = ParamSpec("P")


class SummaryText(tuple[str | Table | Tree, ...]):
    """A record in words: lines, tables and trees, from top to bottom. Printed, it is what the terminal shows."""

    __slots__ = ()

    def __str__(self) -> str:
        return text_of(self)

    __repr__ = __str__


def summarizes(parts: Callable[P, SummaryParts]) -> Callable[P, SummaryText]:
    """Decorate a method that yields the parts of a summary; it then returns the summary."""

    @wraps(parts)
    def summary(*arguments: P.args, **options: P.kwargs) -> SummaryText:
        return SummaryText(parts(*arguments, **options))

    return summary


Rows = Iterable[Sequence[object]]
"""The rows of a table of numbers, the first of them the headings."""

Tables = Mapping[str, Callable[[], Rows]]
"""Functions that return the rows of tables, by the names of the tables; the most important one is the first."""


@dataclass(frozen=True)
class TableRows:
    """Rows of a table, with what its headings do not say: the axes of its columns, and their units."""

    rows: Callable[[], Rows]  #: Function that returns the rows.
    #: Number of columns, the first ones, that are axes of a grid: files with labelled arrays (netCDF, MAT) keep it. The
    #: rows of two axes run along the first one fastest.
    axes: int = 0
    #: Signal of a motion whose amplitudes the columns ``order 1``, ``order 2`` ... have; empty if there are none.
    signal: str = ""
    #: For each heading (or each beginning of headings, if it ends with a point): a parameter or a signal that has the
    #: unit of the column, such as ``stop.force``; or the unit itself. Used in systems with units only.
    units: Mapping[str, str] = field(default_factory=dict)

    def __call__(self) -> Rows:
        """Return the rows."""
        return self.rows()


class Described:
    """A record that describes itself.

    The defaults follow its fields. A class that has more to say overrides `summary` or `tables`.
    """

    __slots__ = ()

    _row: ClassVar[str] = ""
    """The row of the record in a table: names of attributes, or headings with the path of an attribute, as in ``stable
    contacts=orbit.pattern``. By default the row has all fields that are numbers or texts."""

    def summary(self) -> SummaryText:
        """Return the record in words: lines of text, tables and trees."""
        return SummaryText((repr(self),))

    def tables(self) -> Tables:
        """Return the tables of the record by name."""
        # A field with several records is a table with a row for each of them. Fields with arrays of one length are the
        # columns of a table, which is named after the first of them.
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
        """Return the record as plain JSON values."""
        # Complex numbers become pairs, and numbers that are not finite become None.
        from gapwalk.results.codec import plain

        return plain(self)

    def to_xarray(self) -> xarray.DataTree:
        """Return the tables of the record as labelled arrays, with units as attributes."""
        # Needs xarray (``pip install "gapwalk[data]"``).
        from gapwalk.results.labelled_tables import to_xarray

        return to_xarray(self)


def row_of(record: Any) -> dict[str, Any]:
    """Return the numbers and texts of a record by the headings of its row; None in place of an empty text."""
    row = {heading: value_of(record) for heading, value_of in _columns(getattr(record, "_row", ""))}
    row = row or dict(_fields_of(record))
    plain = {name: value.value if isinstance(value, Enum) else value for name, value in row.items()}
    return {
        name: None if isinstance(value, str) and not value else value
        for name, value in plain.items()
        if isinstance(value, str | float | complex | int) or getattr(value, "shape", None) == ()
    }


@cache
def _columns(row: str) -> list[tuple[str, attrgetter[Any]]]:
    """Return the headings of a row with what reads their values."""
    parts = [each.partition("=") for each in row.split()]
    return [(heading, attrgetter(path or heading)) for heading, _, path in parts]


def rows_of(rows: Iterable[Mapping[str, Any]], empty: Sequence[str] = ()) -> Rows:
    """Yield the rows of a table of numbers, after their headings; `empty` are those of a table without rows."""
    # A complex number takes two columns, a mapping one for each of its values; a tuple of names is one text.
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


# rich is imported where it is needed: help of commands must appear at once


def render(summary: SummaryParts, screen: rich.console.Console) -> None:
    """Print the parts of a summary on a console: texts are wrapped between words, and no number is ever cut."""
    for part in summary:
        if isinstance(part, Table):
            _print_table(part, screen)
        elif isinstance(part, Tree):
            screen.print(_rich_tree(part))
        else:
            screen.print(wrapped(printable(part), screen.width), soft_wrap=True)


def wrapped(text: str, width: int) -> str:
    """Return a text with lines of at most a width, broken between words alone and with its indents kept."""
    lines = []
    for line in text.split("\n"):
        if line.startswith("    gapwalk "):  # a command, to be copied
            lines.append(line)
            continue
        indent = " " * (len(line) - len(line.lstrip()))
        lines += wrap(line, width, subsequent_indent=f"{indent}  ", break_long_words=False, break_on_hyphens=False) or [
            ""
        ]
    return "\n".join(lines)


def text_of(summary: SummaryParts) -> str:
    """Return the parts of a summary as text."""
    from rich.console import Console

    stream = StringIO()
    screen = Console(file=stream, markup=False, emoji=False, highlight=False, width=_WIDTH, color_system=None)
    screen.is_jupyter = False  # a notebook would display each line too
    render(summary, screen)
    return "\n".join(line.rstrip() for line in stream.getvalue().rstrip().split("\n"))


def printable(text: str) -> str:
    """Make a text from a file safe for a terminal."""
    return "".join(char if char.isprintable() or char == "\n" else repr(char)[1:-1] for char in text)


_GAP = 2  # blanks between two columns
_MOST = 2  # lines of a text in a column, beyond which its row is written in several lines


def _print_table(table: Table, screen: rich.console.Console) -> None:
    """Print a table: with texts in several lines, or each row in several lines, where the width does not suffice."""
    from rich import box
    from rich.table import Table as RichTable

    columns = [(printable(heading), is_right) for heading, is_right in table.columns]
    rows = [list(map(printable, row)) for row in table.rows]
    wide = [max(len(cell) for cell in column) for column in zip([name for name, _ in columns], *rows, strict=True)]
    room = screen.width - _GAP * (len(wide) - 1)
    widths = wide if sum(wide) <= room else _narrowed(columns, rows, wide, room)
    if not widths and (spare := list(table.spare)):
        left_out, places, fits = list[str](), list[int](), False
        while spare and not fits:
            left_out.append(spare.pop(0))
            places = [place for place, name in enumerate(table.headings) if name not in left_out]
            fits = _fits([columns[k] for k in places], [[row[k] for k in places] for row in rows], screen.width)
        head, *less = [[row[place] for place in places] for row in (table.headings, *table.rows)]
        _print_table(Table(head, less, table.groups), screen)
        between = "; " if any(", " in name for name in left_out) else ", "
        names = between.join(dict.fromkeys(each.removeprefix(">") for each in table.headings if each in left_out))
        screen.print(wrapped(f"left out at {screen.width} columns: {names}", screen.width), soft_wrap=True)
        return
    if not widths:
        screen.print("\n".join(_stacked(columns, rows, wide, table.groups, screen.width)), soft_wrap=True)
        return
    is_tight = sum(wide) + len(wide) - 1 > room
    made = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, collapse_padding=is_tight)
    for (heading, is_right), width in zip(columns, widths, strict=True):
        made.add_column(heading, justify="right" if is_right else "left", width=width)
    for number, row in enumerate(rows):
        made.add_row(*row, end_section=number in table.groups)
    screen.print(made)


def _fits(columns: Sequence[tuple[str, bool]], rows: Sequence[Sequence[str]], width: int) -> bool:
    """Return True if a table fits a width, if need be with texts in several lines."""
    wide = [max(map(len, column)) for column in zip([name for name, _ in columns], *rows, strict=True)]
    room = width - _GAP * (len(wide) - 1)
    return sum(wide) <= room or bool(_narrowed(columns, rows, wide, room))


def _narrowed(
    columns: Sequence[tuple[str, bool]], rows: Sequence[Sequence[str]], wide: Sequence[int], room: int
) -> list[int]:
    """Return widths that break texts between words, and headings too; none if that is not narrow enough."""
    found = []
    for place, (heading, is_right) in enumerate(columns):
        texts = [row[place] for row in rows]
        parts = [*heading.split(), *(texts if is_right else " ".join(texts).split())]
        found.append(max(map(len, parts), default=0))
    left = room - sum(found)
    if left < 0:
        return []
    while left and found != list(wide):  # the column that lacks most gets the next place
        place = max(range(len(found)), key=lambda each: wide[each] - found[each])
        found[place] += 1
        left -= 1
    is_broken = any(len(wrap(cell, width)) > _MOST for row in rows for cell, width in zip(row, found, strict=True))
    return [] if is_broken else found


def _stacked(
    columns: Sequence[tuple[str, bool]],
    rows: Sequence[Sequence[str]],
    wide: Sequence[int],
    groups: Sequence[int],
    room: int,
) -> Iterator[str]:
    """Yield a table with several lines for each row, columns below columns; the headings are as many lines."""
    bands: list[list[int]] = [[]]
    for place, width in enumerate(wide):
        used = sum(wide[each] + _GAP for each in bands[-1]) + _GAP * (len(bands) > 1)
        if bands[-1] and used + width > room:
            bands.append([])
        bands[-1].append(place)

    def lines(cells: Sequence[str]) -> Iterator[str]:
        for number, band in enumerate(bands):
            parts = [cells[k].rjust(wide[k]) if columns[k][1] else cells[k].ljust(wide[k]) for k in band]
            line = (" " * _GAP * bool(number) + (" " * _GAP).join(parts)).rstrip()
            if line or not number:
                yield wrapped(line, room) if len(line) > room else line

    yield from lines([heading for heading, _ in columns])
    yield "─" * room
    for number, row in enumerate(rows):
        yield from lines(row)
        if number in groups:
            yield ""


def _rich_tree(tree: Tree, above: rich.tree.Tree | None = None) -> rich.tree.Tree:
    from rich.tree import Tree as RichTree

    label = printable(tree.label)
    made = RichTree(label, guide_style="dim") if above is None else above.add(label)
    for child in tree.children:
        _rich_tree(child, made)
    return made
