"""Tables of texts from spreadsheets: CSV files as programs and countries write them, and Excel workbooks."""

from __future__ import annotations

import csv
import io
import os
import re
from typing import Any, NamedTuple

from gapwalk.errors import ModelError
from gapwalk.files import open_file

_MAX_BYTES, _MAX_ROWS, _MAX_COLUMNS = 10_000_000, 5000, 200


class Spreadsheet(NamedTuple):
    """A table of texts."""

    head_row: int  #: Number of the row with the headings, from 1 as a spreadsheet shows it.
    heads: list[str]  #: The headings.
    #: The rows below that are neither empty nor comments (``#``), each with its number.
    rows: list[tuple[int, list[str]]]
    mark: str  #: The separator of the cells: a tab, a semicolon or a comma; empty for a workbook.


def read_spreadsheet(path: str | os.PathLike[str]) -> Spreadsheet:
    """Read a table of texts from a CSV file, or from the first sheet of a workbook (``.xlsx``)."""
    name = os.fspath(path)
    try:
        with open_file(name) as file:
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise ModelError(f"{name} cannot be read: {error.strerror or error}") from None
    if len(content) > _MAX_BYTES:
        raise ModelError(f"{name} is larger than {_MAX_BYTES // 1_000_000} MB; save the table of the train alone")
    is_workbook = os.path.splitext(name)[1].lower() == ".xlsx"
    mark, records = ("", _workbook(name, content)) if is_workbook else _text_rows(name, content)
    rows = [
        (number, cells)
        for number, cells in ((number, _without_end(cells)) for number, cells in records)
        if cells and not cells[0].lstrip().startswith("#")
    ]
    if not rows:
        raise ModelError(
            f"{name} is empty; write headings in its first row: part, name, from, to, inertia [kg m^2] ..."
        )
    if len(rows) > _MAX_ROWS or max(len(cells) for _, cells in rows) > _MAX_COLUMNS:
        most = f"{_MAX_ROWS:,} rows or {_MAX_COLUMNS} columns"
        raise ModelError(f"{name} has more than {most}; save the table of the train alone")
    return Spreadsheet(*rows[0], rows[1:], mark)


def letters(place: int) -> str:
    """Return the letters of a column of a spreadsheet: A for 0, Z for 25, AA for 26."""
    found, place = "", place + 1
    while place:
        place, rest = divmod(place - 1, 26)
        found = chr(65 + rest) + found
    return found


def plain_number(number: float) -> str:
    """Return a number with all digits; a whole one without a point."""
    return str(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)


def _text_rows(name: str, content: bytes) -> tuple[str, list[tuple[int, list[str]]]]:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content.count(b"\n", 0, error.start) + 1
        raise ModelError(f"{name}: row {row} is not UTF-8 text; save the table as CSV UTF-8") from None
    first, _, rest = text.partition("\n")
    skipped = 0
    if match := re.fullmatch(r"sep=(.)\s*", first, re.IGNORECASE):  # Excel writes and reads it
        mark, text, skipped = match[1], rest, 1
    else:
        head = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
        mark = next((mark for mark in "\t;," if mark in head), ",")
    try:
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=mark, strict=True)
        return mark, list(enumerate(rows, start=1 + skipped))
    except csv.Error as error:
        raise ModelError(f"{name} cannot be divided into cells: {error}; save the table as CSV again") from None


def _workbook(name: str, content: bytes) -> list[tuple[int, list[str]]]:
    try:
        from openpyxl import load_workbook
    except ModuleNotFoundError:
        raise ModelError(
            f'{name} needs openpyxl; install it: pip install "gapwalk[data]", or save the table as CSV UTF-8'
        ) from None
    try:
        sheet: Any = load_workbook(io.BytesIO(content), read_only=True, data_only=True).worksheets[0]
        rows = sheet.iter_rows(values_only=True, max_row=2 * _MAX_ROWS, max_col=2 * _MAX_COLUMNS)
        return [(number, [_cell_text(value) for value in row]) for number, row in enumerate(rows, start=1)]
    except Exception as error:  # of zipfile, of the XML, and of openpyxl itself
        raise ModelError(f"{name} is not a readable workbook ({error}); save the table as CSV UTF-8") from None


def _without_end(cells: list[str]) -> list[str]:
    """Return the cells of a row up to the last one that is not empty."""
    last = max((place for place, cell in enumerate(cells) if cell.strip()), default=-1)
    return cells[: last + 1]


def _cell_text(value: object) -> str:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return plain_number(float(value))
    return "" if value is None else str(value)
