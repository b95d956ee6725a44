"""Channels of a workbook of Excel: the columns of its sheets, below a line of names."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import ChannelFile, ColumnHead

_MOST = 1000  # columns
_UNPACKED, _TEXTS = 200_000_000, 10_000_000  # bytes of all parts, and of its table of texts


class WorkbookChannels(ChannelFile):
    """A workbook; the columns of one sheet belong together. Values that Excel computed are read, not formulas."""

    words, endings, begins, row = "a workbook of Excel", (".xlsx", ".xlsm"), (b"PK\x03\x04",), "row"
    module = "openpyxl"

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        import openpyxl

        _check_size(path)
        self.file = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
        self._places: list[tuple[Any, int, int]] = []
        for sheet in self.file.worksheets:
            for number, row in enumerate(sheet.iter_rows(max_row=1000, max_col=_MOST, values_only=True), start=1):
                names = [(column, name) for column, name in enumerate(row, start=1) if isinstance(name, str)]
                self.heads += [ColumnHead.channel(name, "", sheet.title) for _, name in names]
                self._places += [(sheet, number, column) for column, _ in names]
                if any(name is not None for name in row):
                    break
        if not self.heads:
            raise ModelError("the first row of its sheets names no columns; it must, as in time (s)")

    def numbers(self, places: Mapping[str, int], most: int) -> dict[str, NDArray[np.float64]]:
        """See `ChannelFile.numbers`; all columns in one pass of the sheet."""
        held = {label: self._places[place] for label, place in places.items()}
        if len({(sheet.title, first) for sheet, first, _ in held.values()}) > 1:
            raise ModelError(f"{' and '.join(places)} are in different sheets; put them into one")
        sheet, first, _ = next(iter(held.values()))
        self.first, last = first + 1, max(column for *_, column in held.values())
        found: list[list[float]] = []
        for number, row in enumerate(sheet.iter_rows(min_row=first + 1, max_col=last, values_only=True), first + 1):
            values: list[Any] = [row[column - 1] if column <= len(row) else None for *_, column in held.values()]
            if all(value is None for value in values):
                continue
            if len(found) >= most:
                raise ModelError(f"it has more than {most:,} rows; leave out rows")
            for label, value in zip(held, values, strict=True):
                if isinstance(value, bool) or not isinstance(value, int | float):
                    what = "is missing" if value is None else f"is {str(value)[:40]!r}; it must be a number"
                    raise ModelError(f"row {number}: {label} {what}")
            found.append([float(value) for value in values])
        if not found:
            raise ModelError("it has a row of names, but no numbers below it")
        return dict(zip(held, np.array(found).T, strict=True))


def _check_size(path: str) -> None:
    """Refuse an archive that unpacks to more than a table of numbers needs."""
    with zipfile.ZipFile(path) as archive:
        sizes = {each.filename: each.file_size for each in archive.infolist()}
    texts = sum(size for name, size in sizes.items() if "sharedstrings" in name.lower())
    if (total := sum(sizes.values())) > _UNPACKED or texts > _TEXTS:
        raise ModelError(
            f"it unpacks to {total / 1e6:,.0f} MB, {texts / 1e6:,.0f} MB of them texts; a workbook may have "
            f"{_UNPACKED // 1_000_000} MB, and {_TEXTS // 1_000_000} MB of texts. Write its numbers as CSV or HDF5"
        )
