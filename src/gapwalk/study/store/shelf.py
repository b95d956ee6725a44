"""The shelf: the parts of a job, kept in the result file of its study while the job is done."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Mapping

from gapwalk.study.store.result_file import ResultFile


class Shelf:
    """Keeps the parts of a job in a result file; it stands where the job expects the name of a file.

    Parameters
    ----------
    file
        The file.
    known
        The parts that it has already, by number.
    """

    def __init__(self, file: ResultFile, known: Mapping[int, bytes]) -> None:
        self._file, self._known = file, dict(known)

    def __fspath__(self) -> str:
        return os.fspath(self._file.path)

    def known(self) -> Iterator[tuple[int, bytes]]:
        """The parts that the file had at the beginning."""
        return iter(self._known.items())

    def add(self, number: int, data: bytes) -> None:
        """Write a part; once this returns it is safe.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        values = (number, data, zlib.crc32(data))
        self._file.write(lambda connection: connection.execute("INSERT INTO chunk VALUES (?, ?, ?)", values))

    def close(self) -> None:
        """Nothing: the file is closed by the run to which it belongs."""
