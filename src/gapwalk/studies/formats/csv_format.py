"""Comma-separated values: a file for each table, headings with units, numbers with all digits."""

from __future__ import annotations

import csv
import io
from typing import ClassVar

from gapwalk.results.labelled import table_headings
from gapwalk.studies.formats.data_format import DataFormat
from gapwalk.summary import Described


class CsvFormat(DataFormat):
    """Comma-separated values in UTF-8."""

    name: ClassVar[str] = "csv"
    ending: ClassVar[str] = ".csv"
    table_by_table: ClassVar[bool] = True

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        return table_of(record, table).encode()


def table_of(record: Described, name: str) -> str:
    """Return one of the tables of a record as comma-separated values; headings have units if its system has some."""
    header, *rows = record.tables()[name]()
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table_headings(record, name, header))
    writer.writerows([str(value).lower() if isinstance(value, bool) else value for value in row] for row in rows)
    return text.getvalue()
