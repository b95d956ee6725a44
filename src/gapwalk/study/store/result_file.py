"""A result file that grows by whole parts, each in one transaction; it is made when the first part comes."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from types import TracebackType

from gapwalk.study.file import Study
from gapwalk.study.store.database import close_whole, open_to_write, transaction
from gapwalk.study.store.rows import begin_file, write_about

Fill = Callable[[sqlite3.Connection], object]
"""Writes one part."""


class ResultFile:
    """The result file of a study that is being computed.

    Parameters
    ----------
    path
        The file.
    study
        The study.
    versions
        Versions of everything that has computed the result.
    exists
        Whether it is to go on with the file that is there; otherwise a new one is made over it.
    """

    def __init__(self, path: str | os.PathLike[str], study: Study, versions: dict[str, str], *, exists: bool) -> None:
        self.path, self.study, self.versions = path, study, versions
        self._connection: sqlite3.Connection | None = None
        self._placed = False  # from then on, what has the file's name is this result
        if exists:
            self._connection = open_to_write(path)
            self.write(lambda connection: write_about(connection, "versions", versions))

    @property
    def is_begun(self) -> bool:
        """Whether there is a file."""
        return self._connection is not None

    def write(self, fill: Fill) -> None:
        """Write one part: all of it, or nothing.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        if self._connection is None and not (self._placed and os.path.exists(self.path)):
            begin_file(self.path, self.study, self.versions, fill, self._place)
            self._connection = open_to_write(self.path)
            return
        if self._connection is None:  # Ctrl-C came between the making of the file and its opening
            self._connection = open_to_write(self.path)
        with transaction(self.path, self._connection):
            fill(self._connection)

    def _place(self) -> None:
        self._placed = True

    def close(self) -> None:
        """Close the file; it is then one file again."""
        if self._connection is not None:
            close_whole(self.path, self._connection)

    def __enter__(self) -> ResultFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
