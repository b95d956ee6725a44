"""The result file as a database: how it is opened and locked, and what its errors mean in words."""

from __future__ import annotations

import os
import sqlite3
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gapwalk.errors import StoreError
from gapwalk.files import why_no_file
from gapwalk.study.store.layout import EXTRA_TABLES, SCHEMA, TABLES
from gapwalk.study.store.older import OLDER
from gapwalk.study.store.seal import SEALED, keep_sealed, seal_fault
from gapwalk.study.store.trust import Format, check_types, schema_of, tables, undamaged

APPLICATION = 0x67617077
"""What marks a SQLite file as a result of gapwalk: the letters gapw."""

RESULT = Format(
    APPLICATION,
    SCHEMA,
    tuple({tables((*TABLES, *extra)) for extra in ((), *EXTRA_TABLES.values())}),
    "is no result file of gapwalk",
    OLDER,
)
"""What a result file is known by."""

_LOCKED = ("SQLITE_BUSY", "SQLITE_LOCKED")
_SIDE_FILES = ("-wal", "-shm", "-journal")


def checksum(packed: tuple[bytes, bytes]) -> int:
    """The checksum that is stored with packed points."""
    return zlib.crc32(packed[1], zlib.crc32(packed[0]))


@contextmanager
def reading(path: str | os.PathLike[str], *, sealed: bool = True) -> Iterator[sqlite3.Connection]:
    """One consistent look at a result file, even while another program writes it.

    Parameters
    ----------
    path
        The file.
    sealed
        Whether it is refused if its checksum does not hold; a file from a gapwalk that made none has none.

    Raises
    ------
    StoreError
        If there is no such file, or it is none that this version can read, or damaged.
    """
    check_readable(path)
    with explained(path):
        connection = _open_to_read(path)
        try:
            connection.execute("BEGIN")
            older = RESULT.check(path, connection)
            with undamaged(path):
                check_types(connection)
                if sealed and (fault := _seal_fault(connection)):
                    raise ValueError(fault)
            if older is not None:
                connection = _renewed_copy(path, connection)
            yield connection
        finally:
            connection.close()


def seal_of(path: str | os.PathLike[str]) -> tuple[bool, str]:
    """Whether a result file has a checksum, and what is wrong with it, as a clause; errors as `reading`."""
    with reading(path, sealed=False) as connection, undamaged(path):
        return schema_of(connection) >= SEALED, _seal_fault(connection)


def _seal_fault(connection: sqlite3.Connection) -> str:
    return seal_fault(connection) if schema_of(connection) >= SEALED else ""


def create(path: str | os.PathLike[str], kind: str) -> sqlite3.Connection:
    """A new and empty result file for a kind of study, open for writing and in the midst of its first transaction.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    with explained(path), _closed_on_error(sqlite3.connect(path, isolation_level=None)) as connection:
        RESULT.begin(connection)
        connection.execute("BEGIN IMMEDIATE")
        for table in (*TABLES, *EXTRA_TABLES.get(kind, ())):
            connection.execute(table)
        keep_sealed(connection, anew=True)
        return connection


def open_to_write(path: str | os.PathLike[str]) -> sqlite3.Connection:
    """An existing result file, such that what is committed survives the death of this process at any moment."""
    with explained(path), _closed_on_error(sqlite3.connect(path, isolation_level=None)) as connection:
        RESULT.check(path, connection)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        with transaction(path, connection):
            is_sealed = schema_of(connection) >= SEALED
            RESULT.renew(path, connection)
            keep_sealed(connection, anew=not is_sealed)
        return connection


def close_whole(path: str | os.PathLike[str], connection: sqlite3.Connection) -> None:
    """Close a result file such that it is one file again; while somebody reads it, that is left to the reader."""
    with explained(path):
        try:
            with suppress(sqlite3.OperationalError):
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                connection.execute("PRAGMA journal_mode = DELETE")
        finally:
            connection.close()


def tidy(path: str | os.PathLike[str]) -> None:
    """Make one file of a result whose writer was killed just before it would have done so."""
    if any(os.path.exists(f"{os.fspath(path)}{suffix}") for suffix in _SIDE_FILES):
        close_whole(path, open_to_write(path))


@contextmanager
def lock(path: str | os.PathLike[str]) -> Iterator[None]:
    """Keep other writers off a result file: a lock that ends with this process, however that ends.

    It is an empty database beside the result: SQLite's own locks work on every system.
    """
    check_place(path)
    name = f"{os.fspath(path)}-lock"
    with explained(path), _closed_on_error(sqlite3.connect(name, isolation_level=None, timeout=0)) as holder:
        holder.execute("PRAGMA journal_mode = MEMORY")  # no second file
        holder.execute("BEGIN EXCLUSIVE")
    try:
        yield
    finally:
        with suppress(OSError):
            os.unlink(name)  # before the lock is released: who waits for this file would lock one without a name
        holder.close()


def remove(path: str | os.PathLike[str]) -> None:
    """Remove a result file with what a killed run left beside it."""
    for suffix in ("", *_SIDE_FILES):
        with suppress(FileNotFoundError):
            os.unlink(f"{os.fspath(path)}{suffix}")


def check_readable(path: str | os.PathLike[str]) -> None:
    """A StoreError if there is no file of that name."""
    check_place(path)
    name = os.fspath(path)
    if not os.path.exists(name):
        raise StoreError(f"there is no file {name}; `gapwalk run FILE` writes a result")


def check_place(path: str | os.PathLike[str]) -> None:
    """A StoreError if something of that name, or of one that SQLite writes beside it, is no file."""
    for suffix in ("", *_SIDE_FILES, "-lock"):
        if why := why_no_file(name := f"{os.fspath(path)}{suffix}"):
            raise StoreError(f"{name} {why}")


@contextmanager
def explained(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what SQLite and the system say about a result file into a StoreError."""
    try:
        yield
    except (sqlite3.Error, OSError, UnicodeError) as error:
        raise StoreError(_explain(os.fspath(path), error)) from error


@contextmanager
def transaction(path: str | os.PathLike[str], connection: sqlite3.Connection) -> Iterator[None]:
    """All or nothing of what is written inside."""
    with explained(path):
        connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            connection.execute("COMMIT")
        except BaseException:
            if connection.in_transaction:
                connection.execute("ROLLBACK")
            raise
        os.stat(path)  # SQLite goes on writing into a file that has been removed


@contextmanager
def _closed_on_error(connection: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    try:
        yield connection
    except BaseException:
        connection.close()
        raise


def _open_to_read(path: str | os.PathLike[str]) -> sqlite3.Connection:
    address = Path(path).absolute().as_uri()
    connection = sqlite3.connect(f"{address}?mode=ro", uri=True, isolation_level=None)
    try:
        connection.execute("PRAGMA user_version").fetchone()
    except sqlite3.OperationalError:
        connection.close()
        if os.path.exists(f"{os.fspath(path)}-wal"):
            raise
        # A file of a killed run in a folder that cannot be written: nobody can be writing it.
        connection = sqlite3.connect(f"{address}?mode=ro&immutable=1", uri=True, isolation_level=None)
    return connection


def _renewed_copy(path: str | os.PathLike[str], connection: sqlite3.Connection) -> sqlite3.Connection:
    """The content of a file from an older gapwalk as this one writes it, in memory: who only looks changes no file."""
    copy = sqlite3.connect(":memory:", isolation_level=None)
    try:
        connection.backup(copy)
        RESULT.renew(path, copy)
    except BaseException:
        copy.close()
        raise
    connection.close()
    return copy


def _explain(name: str, error: Exception) -> str:
    code = getattr(error, "sqlite_errorname", "")
    folder = os.path.dirname(os.path.abspath(name))
    if code == "SQLITE_NOTADB":
        hint = f", but a model file; compute a result first: gapwalk run {name}" if name.endswith(".toml") else ""
        return f"{name} is no result file of gapwalk{hint}"
    if code.startswith("SQLITE_CORRUPT") or isinstance(error, UnicodeError):
        return f"{name} is damaged or cut short ({error})"
    if code.startswith(_LOCKED):
        return f"{name} is being written by another run; wait for its end, or stop it"
    if not os.path.isdir(folder):
        return f"there is no folder {folder}; make it, or choose another place for {os.path.basename(name)}"
    is_gone = code.startswith(("SQLITE_IOERR", "SQLITE_READONLY_DBMOVED")) and not os.path.exists(name)
    if is_gone or isinstance(error, FileNotFoundError):
        return f"{name} has been removed or moved while it was written; what a run finds now would be lost"
    if code.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM")) or isinstance(error, PermissionError):
        if not os.access(folder, os.W_OK) and os.path.exists(f"{name}-wal"):
            return f"{name} cannot be opened in a folder that cannot be written; copy it and {name}-wal to another one"
        if not os.access(folder, os.W_OK):
            return f"{name} cannot be opened: its folder cannot be written; choose another place for the result"
        return f"{name} cannot be opened; look at its permissions ({error})"
    if code == "SQLITE_FULL":
        return f"{name} cannot be written: the disk is full; all that was reported is in the file"
    if code.startswith("SQLITE_IOERR"):
        return (
            f"{name} cannot be read or written ({error}): the disk may be full, a limit reached, or the disk gone; all "
            "that was reported is in the file"
        )
    return f"{name} cannot be read or written: {error}"
