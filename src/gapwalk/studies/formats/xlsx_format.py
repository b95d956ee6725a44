"""Excel workbooks: a sheet for each table, and one for the parameters; written by openpyxl."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from gapwalk.errors import ModelError
from gapwalk.results.labelled import columns_of, parameter_table
from gapwalk.studies.formats.data_format import DataFormat
from gapwalk.summary import Described

_ROWS, _COLUMNS, _TEXT = 1_048_576, 16_384, 32_767  # of a sheet, and characters of a cell


class XlsxFormat(DataFormat):
    """Sheets with headings as in CSV files. A number that is not finite is an empty cell (nan), or inf or -inf."""

    name: ClassVar[str] = "xlsx"
    ending: ClassVar[str] = ".xlsx"
    needs: ClassVar[tuple[str, ...]] = ("openpyxl",)

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        from openpyxl import Workbook

        book = Workbook(write_only=True)
        for name in record.tables():
            columns = columns_of(record, name)
            _fill(book, name, [each.head for each in columns], [each.values for each in columns])
        if (system := getattr(record, "system", None)) is not None:
            found = parameter_table(system)
            values = (found.coordinates["parameter"], found.variables["value"], found.variables["unit"])
            _fill(book, "parameters", ["parameter", "value", "unit"], [each.values.tolist() for each in values])
        content = io.BytesIO()
        book.save(content)
        return content.getvalue()


def _fill(book: Any, name: str, headings: Sequence[str], columns: Sequence[Iterable[Any]]) -> None:
    rows = list(zip(*columns, strict=True))
    if len(rows) >= _ROWS or len(headings) > _COLUMNS:
        raise ModelError(
            f"the table {name} has {len(rows):,} rows and {len(headings):,} columns, and a sheet holds {_ROWS - 1:,} "
            f"and {_COLUMNS:,}; write --format parquet or netcdf"
        )
    sheet = book.create_sheet(name[:31])
    sheet.freeze_panes = "A2"
    for row in ([*headings], *rows):
        sheet.append([_cell(sheet, value) for value in row])


def _cell(sheet: Any, value: Any) -> Any:
    """Return a value as openpyxl can write it.

    A text that begins with = must not become a formula, and a number keeps all digits: openpyxl would write 16 of them.
    """
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE, WriteOnlyCell

    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        cell = WriteOnlyCell(sheet, ILLEGAL_CHARACTERS_RE.sub("?", value)[:_TEXT])
        cell.data_type = "s"
    else:
        cell = WriteOnlyCell(sheet, value)
        cell._value = repr(value)
    return cell
