"""The chunk store: a file that keeps the results of a long job, each in one transaction, written by one process only.

Killed at any moment, the file holds every result that was reported; a job that is started again leaves those out.
"""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

from gapwalk.errors import StoreError
from gapwalk.study.store.database import check_readable, close_whole, explained, lock, transaction
from gapwalk.study.store.trust import Format, check_types, checked_parts, tables, undamaged
from gapwalk.study.store.versions import versions

APPLICATION = 0x67617063
"""What marks a SQLite file as a chunk store: the letters gapc."""

SCHEMA = 1
"""Version of the tables below and of what stands in them; files from before it was counted have 0, and are the same."""

TABLES = (
    """CREATE TABLE job (
    key TEXT PRIMARY KEY, -- what is to be done, and the versions of what has done it, in JSON
    value TEXT NOT NULL
) WITHOUT ROWID""",
    """CREATE TABLE chunk (
    number INTEGER PRIMARY KEY, -- of the result
    data BLOB NOT NULL,
    checksum INTEGER NOT NULL -- CRC-32 of data
)""",
)

_FORMAT = Format(APPLICATION, SCHEMA, (tables(TABLES),), "does not hold the results of a job; choose another name")
_VERSIONS = "versions"


@runtime_checkable
class Chunks(Protocol):
    """What keeps the results of a job: a file of its own, or a place in the result file of a study."""

    def __fspath__(self) -> str:
        """The name of the file."""
        ...

    def known(self) -> Iterator[tuple[int, bytes]]:
        """The number of each result that is there, and its bytes."""
        ...

    def add(self, number: int, data: bytes) -> None:
        """Write a result; once this returns it is safe."""
        ...

    def close(self) -> None:
        """Part from it."""
        ...


def open_chunks(place: str | os.PathLike[str], job: Mapping[str, Any]) -> Chunks:
    """Where to keep the results of a job: the place itself if it can, or else a file of that name."""
    return place if isinstance(place, Chunks) else ChunkStore(place, job)


class ChunkStore:
    """The file of a job that is being done.

    Parameters
    ----------
    path
        The file. If it is not there, it is made; if it holds a part of the same job, that is gone on with.
    job
        What is to be done, in plain JSON values: a file of another job is refused.

    Raises
    ------
    StoreError
        If the file is none of this kind or of another job, is being written by another run, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], job: Mapping[str, Any]) -> None:
        self.path = path
        with ExitStack() as stack:
            stack.enter_context(lock(path))
            with explained(path):
                self._connection = stack.enter_context(closing(sqlite3.connect(path, isolation_level=None)))
                is_new = _is_empty(self._connection)
                if is_new:
                    _FORMAT.begin(self._connection)
                else:
                    _FORMAT.check(path, self._connection)
                self._connection.execute("PRAGMA journal_mode = WAL")
                self._connection.execute("PRAGMA synchronous = NORMAL")
            with transaction(path, self._connection):
                self._begin(dict(job), is_new)
            self._stack = stack.pop_all()

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def known(self) -> Iterator[tuple[int, bytes]]:
        """The number of each result that is in the file, and its bytes.

        Raises
        ------
        StoreError
            If the file is damaged.
        """
        with explained(self.path), undamaged(self.path):
            yield from checked_parts(self._connection)

    def add(self, number: int, data: bytes) -> None:
        """Write a result; once this returns it is safe.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        with transaction(self.path, self._connection):
            self._connection.execute("INSERT INTO chunk VALUES (?, ?, ?)", (number, data, zlib.crc32(data)))

    def close(self) -> None:
        """Close the file; it is then one file again."""
        with self._stack:
            close_whole(self.path, self._connection)

    def __enter__(self) -> ChunkStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _begin(self, job: dict[str, Any], is_new: bool) -> None:
        """Write what is to be done, or see that it is the same."""
        before = None
        if is_new:
            for table in TABLES:
                self._connection.execute(table)
        else:
            _FORMAT.renew(self.path, self._connection)
            with undamaged(self.path):
                about = _about(self._connection)
            before = about.pop(_VERSIONS)
            _check_same(os.fspath(self.path), json.loads(json.dumps(job)), about)
        for key, value in (job | {_VERSIONS: versions(before)}).items():
            self._connection.execute("INSERT OR REPLACE INTO job VALUES (?, ?)", (key, json.dumps(value)))


def read_chunks(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[int, bytes]]:
    """All that is in the file of a job, even while it is written: what is to be done, and the results by number.

    Raises
    ------
    StoreError
        If there is no such file, it is none of this kind, or it is damaged.
    """
    check_readable(path)
    with explained(path), closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("BEGIN")
        _FORMAT.check(path, connection)
        with undamaged(path):
            check_types(connection)
            return _about(connection), dict(checked_parts(connection))


def _is_empty(connection: sqlite3.Connection) -> bool:
    (count,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    return count == 0 and application in (0, APPLICATION)


def _about(connection: sqlite3.Connection) -> dict[str, Any]:
    about = {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM job")}
    about[_VERSIONS] = {str(name): str(version) for name, version in about[_VERSIONS].items()}
    return about


def _check_same(name: str, job: Mapping[str, Any], before: Mapping[str, Any]) -> None:
    differences = [f"{path} is {now!r}, and was {then!r}" for path, now, then in _differences(job, before)]
    if differences:
        more = f"; and {len(differences) - 3} more differences" if len(differences) > 3 else ""
        raise StoreError(
            f"{name} holds the results of another job, so it cannot be gone on with: {'; '.join(differences[:3])}{more}"
            ". Choose another name, or remove the file"
        )


def _differences(now: Any, then: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    if isinstance(now, Mapping) and isinstance(then, Mapping):
        for key in {**now, **then}:
            yield from _differences(now.get(key), then.get(key), f"{path}.{key}" if path else str(key))
    elif now != then:
        yield path, now, then
