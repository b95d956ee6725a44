"""A table of numbers in a CSV file: a line of names, then rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError

# Records and measured tables are read with it.
#
# The file is treated as data only. Its lines are separated by any usual end of a line; its entries by tabs, semicolons
# or commas, the first of these that the line of names contains. Empty lines, and lines that begin with ``#``, are
# skipped. Numbers may have a decimal comma where the comma does not separate them; then all of them must have it.

_MAX_COLUMNS = 1000
_QUOTED = 40  # characters of an entry that is quoted


@dataclass(frozen=True, eq=False)
class CsvColumns:
    """The text of a CSV file, in lines; the numbers of its columns are read on request."""

    heads: tuple[str, ...]  #: The names of the columns, as they are written.
    mark: str  #: What separates the entries: a tab, a semicolon or a comma.
    rows: tuple[tuple[int, str], ...]  #: The other lines, each with its number in the file, from 1.

    def numbers(self, places: Mapping[str, int]) -> dict[str, NDArray[np.float64]]:
        """Read the numbers of some columns, each of shape (rows,)."""
        table = np.empty((len(places), len(self.rows)))
        commas: dict[bool, tuple[int, str]] = {}  # the first number with a point, and the first one with a comma
        for row, (number, line) in enumerate(self.rows):
            try:
                entries = _entries(line, self.mark, strict=True)
            except csv.Error as error:
                raise ModelError(f"line {number}: it cannot be divided into entries: {error}") from None
            if len(entries) > len(self.heads) and any(entry.strip() for entry in entries[len(self.heads) :]):
                hint = "; with decimal commas, separate the columns by semicolons" if self.mark == "," else ""
                raise ModelError(
                    f"line {number}: it has {len(entries)} entries, but the first line names {len(self.heads)} "
                    f"columns{hint}"
                )
            for index, (name, place) in enumerate(places.items()):
                entry = entries[place].strip() if place < len(entries) else ""
                try:
                    table[index, row] = _number(entry, self.mark)
                except ValueError:
                    raise ModelError(f"line {number}: {_complaint(name, entry, self.mark)}") from None
                if "." in entry or "," in entry:
                    first = commas.setdefault("," in entry, (number, entry))
                    if len(commas) == 2:
                        other = commas["," not in entry]
                        raise ModelError(
                            f"line {first[0]}: {name} is {first[1]!r}, but line {other[0]} has {other[1]!r}; write all "
                            "numbers with a decimal point, or all with a decimal comma, and none with separators of "
                            "thousands"
                        )
        return dict(zip(places, table, strict=True))

    def texts(self, place: int) -> list[str]:
        """Return the entries of a column as texts; empty where a line ends before it."""
        lines = [_entries(line, self.mark) for _, line in self.rows]
        return [line[place].strip() if place < len(line) else "" for line in lines]


def parse_csv(content: bytes, example: str, most: int, hint: str = "") -> CsvColumns:
    """Divide the content of a CSV file into its line of names and its rows."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, error.start) + 1
        raise ModelError(
            f"line {place}: it is not UTF-8 text (byte 0x{content[error.start]:02x}); save it as CSV in UTF-8"
        ) from None
    rows: list[tuple[int, str]] = []
    commented = False
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):  # it knows all ends of lines
        if line.lstrip().startswith("#"):
            commented = commented or not rows
        elif line.strip():
            rows.append((number, line.rstrip("\n")))
            if len(rows) > most + 1:  # before the lines take far more memory than the text
                raise ModelError(f"it has more than {most:,} rows{hint and f'; {hint}'}")
    if not rows:
        raise ModelError(f"it is empty; the first line names the columns, as in {example}")
    number, first = rows[0]
    mark = next((mark for mark in "\t;," if mark in first), ",")
    try:
        heads = tuple(head.strip() for head in _entries(first, mark))
    except csv.Error as error:
        raise ModelError(f"line {number}: it is not a line of column names: {error}") from None
    if len(heads) > _MAX_COLUMNS:
        raise ModelError(f"line {number}: it names more than {_MAX_COLUMNS:,} columns; leave out those not needed")
    if all(_is_number(head, mark) for head in heads):
        skipped = "; a line that begins with # is a comment" if commented else ""
        raise ModelError(f"its first line holds numbers; it must name the columns, as in {example}{skipped}")
    return CsvColumns(heads, mark, tuple(rows[1:]))


def _entries(line: str, mark: str, *, strict: bool = False) -> list[str]:
    """Divide a line, at most into one entry more than there may be columns."""
    if '"' in line:
        return next(csv.reader([line], delimiter=mark, strict=strict))[: _MAX_COLUMNS + 1]
    return line.split(mark, _MAX_COLUMNS)


def _number(entry: str, mark: str) -> float:
    """Return a number with a decimal point, or with a decimal comma where commas do not separate the entries."""
    if "_" in entry:  # which Python would read
        raise ValueError
    if mark != "," and entry.count(",") == 1 and "." not in entry:
        entry = entry.replace(",", ".")
    return float(entry)


def _is_number(entry: str, mark: str) -> bool:
    try:
        _number(entry, mark)
    except ValueError:
        return False
    return True


def _complaint(name: str, entry: str, mark: str) -> str:
    if not entry:
        return f"{name} is missing; every line must have as many entries as the first"
    hint = ""
    if mark != "," and "," in entry:
        hint = ", without separators of thousands"
    elif entry.count(",") == 1:
        hint = "; with decimal commas, separate the columns by semicolons"
    return f"{name} is {entry[:_QUOTED]!r}; it must be a number{hint}"
