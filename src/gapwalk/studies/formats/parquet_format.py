"""Parquet: a file for each table, with typed columns; written by Arrow, read by pandas, Polars, DuckDB and others."""

from __future__ import annotations

import io
import json
from typing import ClassVar

from gapwalk.results.labelled import attributes_of, columns_of
from gapwalk.studies.formats.data_format import DataFormat
from gapwalk.summary import Described


class ParquetFormat(DataFormat):
    """Columns with headings as in CSV files; the unit of each is also in its metadata, and missing values are null."""

    name: ClassVar[str] = "parquet"
    ending: ClassVar[str] = ".parquet"
    needs: ClassVar[tuple[str, ...]] = ("pyarrow",)
    table_by_table: ClassVar[bool] = True

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        types = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}
        columns = columns_of(record, table)
        fields = [
            pa.field(each.head, types[each.type], metadata={"heading": each.heading, "unit": each.unit})
            for each in columns
        ]
        about = {"gapwalk": json.dumps({"table": table, **attributes_of(record)})}
        arrays = [pa.array(each.values, types[each.type]) for each in columns]
        content = io.BytesIO()
        pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=about)), content)
        return content.getvalue()
