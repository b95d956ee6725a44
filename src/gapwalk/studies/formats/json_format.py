"""JSON: one document with everything that the record says of itself."""

from __future__ import annotations

import json
from typing import ClassVar

from gapwalk.studies.formats.data_format import DataFormat
from gapwalk.summary import Described


class JsonFormat(DataFormat):
    """The document of `to_dict`, with all points; numbers have all digits, and those that do not exist are null."""

    name: ClassVar[str] = "json"
    ending: ClassVar[str] = ".json"

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        return f"{json.dumps(record.to_dict(), indent=1, allow_nan=False, ensure_ascii=False)}\n".encode()
