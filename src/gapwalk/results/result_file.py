"""The one file format of gapwalk: named parts in a SQLite database, each with a checksum, and one of all of them.

While a job writes its file, SQLite's log is next to it (``-wal``, ``-shm``); a job that ends, even by Ctrl-C or because
the disk is full, leaves one file. If the process is killed at any time, the file contains all parts up to some moment:
reported parts are never lost.

The seal is the sum of the checksums of all parts: it is kept up to date by each transaction, however long the file is.
Nothing in it is secret: it detects changes by other programs, but not a change with a new seal.

Method: docs/numerics/notes/results.md
"""

from __future__ import annotations

import errno
import os
import platform
import sqlite3
import struct
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import llvmlite
import numpy as np

import gapwalk.results.codec  # noqa: F401 (it registers how systems and orbits are kept)
from gapwalk import __version__
from gapwalk.errors import StoreError
from gapwalk.files import why_no_file
from gapwalk.interrupts import uninterrupted
from gapwalk.model.registry import UnknownNameError
from gapwalk.model.system import System
from gapwalk.model.words import told_apart
from gapwalk.results.codec import Packed, decode, encode

# Differences of two requests: a result file is continued only with the request that began it.

_SHOWN = 3  # differences that are named


def check_same(name: str, now: Any, then: Any, otherwise: str = "choose another name, or remove the file") -> None:
    """Refuse to continue a file with another request."""
    found = list(differences(now, then))
    if found:
        more = f"; and {len(found) - _SHOWN} more differences" if len(found) > _SHOWN else ""
        raise StoreError(
            f"{name} holds the result of something else, so it cannot be continued: {'; '.join(found[:_SHOWN])}{more}; "
            f"{otherwise}"
        )


def differences(now: Any, then: Any, path: str = "") -> Iterator[str]:
    """Yield each difference between two records, in a few words."""
    if isinstance(now, System) and isinstance(then, System):
        yield from _system_differences(now, then)
    elif type(now) is not type(then) and (is_dataclass(now) or is_dataclass(then)):
        yield f"{path or 'its kind'} is {_kind_of(now)}, and was {_kind_of(then)}"
    elif is_dataclass(now):
        for field in (each for each in fields(now) if each.compare):
            # the options of a study, and the system, need no name
            inner = "" if field.name in ("system", "options") else field.name
            joined = ".".join(filter(None, (path, inner)))
            yield from differences(getattr(now, field.name), getattr(then, field.name), joined)
    elif not np.array_equal(now, then) if isinstance(now, np.ndarray) else now != then:
        yield f"{path} is {_said(now)!r}, and was {_said(then)!r}"


def _system_differences(now: System, then: System) -> Iterator[str]:
    if now.structure != then.structure:
        yield "the system is made of other parts"
        return
    for place in np.flatnonzero(now.values != then.values).tolist():
        name, pair = now.structure.names[place], (float(now.values[place]), float(then.values[place]))
        unit = now.units.parameter(name) if now.units else ""
        is_now, was = (f"{text} {unit}".rstrip() for text in told_apart(*pair))
        yield f"{name} is {is_now}, and was {was}"


def _kind_of(value: Any) -> str:
    return getattr(value, "kind", None) or type(value).__name__


def _said(value: Any) -> Any:
    """Return a value with the values of enumerations in place of their members."""
    if isinstance(value, tuple):
        return tuple(map(_said, value))
    return value.value if isinstance(value, Enum) else value


# Errors of SQLite and of the system about a result file, in words.

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a disk that is full, or of a limit that is reached."""
_LOCKED = ("SQLITE_BUSY", "SQLITE_LOCKED")


@contextmanager
def explained(path: str | os.PathLike[str]) -> Iterator[None]:
    """Convert errors of SQLite and of the system into a StoreError."""
    try:
        yield
    except (sqlite3.Error, OSError, UnicodeError) as error:
        raise StoreError(_explain(os.fspath(path), error)) from error


@contextmanager
def undamaged(path: str | os.PathLike[str], where: str = "") -> Iterator[None]:
    """Convert errors while the content of a file is decoded into a StoreError."""
    try:
        yield
    except StoreError:
        raise
    except UnknownNameError as error:
        raise StoreError(
            f"{os.fspath(path)} cannot be read: {error}. Import the module that adds it; if there is none, the file is "
            "damaged"
        ) from error
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise StoreError(f"{os.fspath(path)} is damaged: {where}{error}") from error


def _explain(name: str, error: Exception) -> str:
    code = getattr(error, "sqlite_errorname", "")
    folder = os.path.dirname(os.path.abspath(name))
    if code == "SQLITE_NOTADB":
        hint = f", but a model file; compute a result first: gapwalk run {name}" if name.endswith(".toml") else ""
        return f"{name} is not a result file of gapwalk{hint}"
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
    if code == "SQLITE_FULL" or getattr(error, "errno", None) in FULL[:2]:
        return f"{name} cannot be written: the disk is full; all that was reported is in the file"
    if code.startswith("SQLITE_IOERR") or getattr(error, "errno", None) in FULL:
        return (
            f"{name} cannot be read or written ({error}): the disk may be full, a limit reached, or the disk gone; all "
            "that was reported is in the file"
        )
    return f"{name} cannot be read or written: {error}"


# The versions of what computes a result.


def check_not_newer(path: str | os.PathLike[str], writers: str) -> None:
    """Raise a StoreError if a file states that a newer version of gapwalk than this one has written to it."""
    newest = max(writers.split(", "), key=_numbers)
    if _numbers(newest) > _numbers(__version__):
        raise StoreError(
            f"{os.fspath(path)} was written by gapwalk {newest}, and has contents that "
            f"gapwalk {__version__} does not know: update gapwalk"
        )


def versions(before: dict[str, str] | None = None) -> dict[str, str]:
    """Return the versions of the software that computes a result, after those of `before` that differ from them."""
    from importlib.metadata import version as version_of  # only now: it loads slowly

    now = {
        "gapwalk": __version__,
        "llvmlite": llvmlite.__version__,
        "numba": version_of("numba"),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
    for name, version in (before or {}).items():
        if now.get(name, version) not in version.split(", "):
            now[name] = f"{version}, {now[name]}"
        else:
            now[name] = version
    return now


@cache
def sources(modules: tuple[str, ...] = ()) -> str:
    """Return a hash of the code of gapwalk and of some modules; read once, as a process goes on with what it loaded."""
    root = Path(__file__).parents[1]
    named = [(path.relative_to(root).as_posix(), path) for path in sorted(root.rglob("*.py"))]
    named += [(name, Path(file)) for name in modules if (file := getattr(import_module(name), "__file__", None))]
    hashed = blake2b(digest_size=6)
    for name, path in named:
        content = path.read_bytes()
        hashed.update(f"{name} {len(content)} ".encode() + content)
    return hashed.hexdigest()


def _numbers(version: str) -> tuple[int, ...]:
    """Return a version such as 1.10.2 as numbers that can be compared."""
    return tuple(int(part) for part in version.split(".") if part.isdigit())


APPLICATION = 0x67617077
"""Mark of a SQLite file that is a result of gapwalk: the letters gapw."""

SCHEMA = 13
"""Version of the format and of the records in it; a file of another version is refused."""

TABLE = """CREATE TABLE part (
    name TEXT NOT NULL, -- what it is
    number INTEGER NOT NULL, -- which of that name, from 0
    head TEXT NOT NULL, -- in JSON
    arrays BLOB NOT NULL, -- its numbers, see gapwalk.results.codec
    checksum TEXT NOT NULL, -- BLAKE2b of the columns before, in hexadecimal digits
    PRIMARY KEY (name, number)
)"""
"""The one table of a file."""

_SEAL = "seal"  # name of the part whose head is the sum of all checksums
_SIZE = 16  # bytes of a checksum
_ALL = 1 << 8 * _SIZE
_SIDE_FILES = ("-wal", "-shm", "-journal")
_TYPES = {str: "a text", int: "an integer", float: "a number", bytes: "bytes", type(None): "nothing"}
_COLUMNS = {"name": str, "number": int, "head": str, "arrays": bytes, "checksum": str}


@dataclass(frozen=True, slots=True)
class Part:
    """Kind of part of a result file, such as the points of branches.

    Examples
    --------
    >>> part = gw.studies.Part("members", str, numbered=True)
    >>> part.entry("a text", number=2).number
    2
    """

    name: str  #: Its name in a file.
    type: Any  #: The type hint of its contents.
    #: True if a file may have several parts of this kind: each has a number and is written once. Otherwise it has one
    #: at most, and a new part replaces it.
    numbered: bool = False

    def entry(self, value: Any, number: int = 0) -> Entry:
        """Return a value as an entry of a file, under the name of this part."""
        return Entry(self, number, value)


class Entry(NamedTuple):
    """Value that is written as a part."""

    part: Part  #: Kind of part.
    number: int  #: Its number, from 0.
    value: Any  #: Its contents.


class Parts:
    """Parts of a file at one moment."""

    def __init__(self, path: str | os.PathLike[str], connection: sqlite3.Connection) -> None:
        self.path = path
        self.base: Any = None
        self._connection = connection

    def all(self, part: Part) -> Iterator[tuple[int, Any]]:
        """Yield the number and the value of each part of a kind, in order."""
        with undamaged(self.path):
            for _, number, *packed, _ in _rows(self._connection, "WHERE name = ? ORDER BY number", part.name):
                with undamaged(self.path, f"its part {part.name}{f' {number}' if part.numbered else ''}: "):
                    value = decode(Packed(*packed), part.type, self.base)
                yield number, value

    def one(self, part: Part) -> Any:
        """Return the only part of a kind; errors as `all`, and if it is missing."""
        found = self.get(part)
        if found is None:
            raise StoreError(f"{os.fspath(self.path)} is damaged: its part {part.name} is missing")
        return found

    def get(self, part: Part) -> Any:
        """Return the only part of a kind, or None if it is missing."""
        return next((value for _, value in self.all(part)), None)


class ResultFile:
    """File that grows part by part during a job; it is created with the first part."""

    def __init__(self, path: str | os.PathLike[str], *head: Entry, exists: bool) -> None:
        self.path, self._head = path, head
        self._base = head[0].value.system
        self._exists = exists
        self._connection: _Writer | None = None
        if exists:
            self.write(*head[1:])

    @property
    def is_begun(self) -> bool:
        """True if there is a file."""
        return self._exists

    def known(self, part: Part) -> Iterator[tuple[int, Any]]:
        """Yield the parts of a kind that the file has, as `Parts.all`."""
        if self._exists:
            parts = Parts(self.path, self._opened())
            parts.base = self._base
            with explained(self.path):
                yield from parts.all(part)

    def count(self, part: Part) -> int:
        """Return the number of parts of a kind in the file."""
        if not self._exists:
            return 0
        with explained(self.path):
            (count,) = self._opened().execute("SELECT count(*) FROM part WHERE name = ?", (part.name,)).fetchone()
        return count

    def write(self, *entries: Entry) -> None:
        """Write some parts, all or none; they are stored safely when this returns. Ctrl-C is delayed until then."""
        with uninterrupted():
            if self._exists:
                with _transaction(self.path, connection := self._opened()):
                    _insert(connection, entries, self._base)
            else:
                _begin(self.path, self._head, entries)
                self._exists = True  # from here on, what has the file's name is this result
                self._opened()

    def close(self) -> None:
        """Close the file; it is then one file again."""
        if self._connection is not None:
            with uninterrupted():
                _close_whole(self.path, self._connection)

    def __enter__(self) -> ResultFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _opened(self) -> _Writer:
        if self._connection is None:
            self._connection = _open_to_write(self.path)
        return self._connection


@contextmanager
def reading(path: str | os.PathLike[str], *, sealed: bool = True) -> Iterator[Parts]:
    """Open a consistent view of a file, even while another program writes it."""
    check_place(path)
    if not os.path.exists(path):
        raise StoreError(f"there is no file {os.fspath(path)}; `gapwalk run FILE` writes a result")
    with explained(path):
        connection = _open_to_read(path)
        try:
            connection.execute("BEGIN")
            _check_format(path, connection)
            with undamaged(path):
                if sealed and (fault := _seal_fault(connection)):
                    raise ValueError(fault)
            yield Parts(path, connection)
        finally:
            connection.close()


def seal_fault(path: str | os.PathLike[str]) -> str:
    """Describe the fault of the checksums of a file in a clause; empty if they are correct. Errors as `reading`."""
    with reading(path, sealed=False) as parts, undamaged(path):
        return _seal_fault(parts._connection)


def write_more(path: str | os.PathLike[str], system: Any, *entries: Entry) -> None:
    """Write parts into a file that is complete; `system` is that of its request. Errors as `ResultFile.write`."""
    with uninterrupted():
        connection = _open_to_write(path)
        try:
            with _transaction(path, connection):
                _insert(connection, entries, system)
        finally:
            _close_whole(path, connection)


def tidy(path: str | os.PathLike[str]) -> None:
    """Make one file of a result whose writer was killed just before it would have done so."""
    if any(os.path.exists(f"{os.path.realpath(path)}{suffix}") for suffix in _SIDE_FILES):
        _close_whole(path, _open_to_write(path))


@contextmanager
def lock(path: str | os.PathLike[str]) -> Iterator[None]:
    """Keep other writers off a file: a lock that ends with this process, however that ends."""
    # It is an empty database next to the file: SQLite's own locks work on every system.
    check_place(path)
    name = f"{os.path.realpath(path)}-lock"  # one file has one lock, also by way of a link
    with explained(path):
        holder = sqlite3.connect(name, isolation_level=None, timeout=0)
    try:
        with explained(path):
            holder.execute("PRAGMA journal_mode = MEMORY")  # no second file
            holder.execute("BEGIN EXCLUSIVE")
        yield
    finally:
        if holder.in_transaction:
            with suppress(OSError):
                os.unlink(name)  # before the lock is released: who waits for this file would lock one without a name
        holder.close()


def check_place(path: str | os.PathLike[str]) -> None:
    """Raise a StoreError if the name, or one that SQLite derives from it, belongs to something other than a file."""
    for suffix in ("", *_SIDE_FILES, "-lock"):
        if why := why_no_file(name := f"{os.fspath(path)}{suffix}"):
            raise StoreError(f"{name} {why}")


def looks_like_result(path: str | os.PathLike[str]) -> bool:
    """Return True if a file has the mark of a result, even if it is damaged, or if it is empty."""
    with explained(path), open(path, "rb") as file:
        head = file.read(72)
    return not head or head[68:72] == APPLICATION.to_bytes(4, "big")


def _begin(path: str | os.PathLike[str], head: tuple[Entry, ...], entries: tuple[Entry, ...]) -> None:
    """Create a file with its first parts; it replaces an existing one."""
    # A file of that name is at any moment either whole or not there.
    path = os.path.realpath(path)  # a link stays one
    new = f"{path}-new"
    base = head[0].value.system
    with explained(path):
        _remove(new)
        connection = sqlite3.connect(new, isolation_level=None)
        try:
            connection.execute(f"PRAGMA application_id = {APPLICATION}")
            connection.execute(f"PRAGMA user_version = {SCHEMA}")
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(TABLE)
            connection.execute("INSERT INTO part VALUES (?, 0, '0', x'', '')", (_SEAL,))
            _insert(connection, head[:1], None)  # the request has its system in full
            _insert(connection, (*head[1:], *entries), base)
            connection.execute("COMMIT")
        except BaseException:
            connection.close()
            _remove(new)
            raise
        connection.close()
        _remove(path)  # its log too, which must not be taken for that of the new file
        os.replace(new, path)


def _insert(connection: sqlite3.Connection, entries: tuple[Entry, ...], base: Any) -> None:
    """Write parts and the new seal, in a transaction."""
    seal = _seal_of(connection)
    for part, number, value in entries:
        packed = encode(value, part.type, base)
        if not part.numbered:
            before = connection.execute("SELECT checksum FROM part WHERE name = ? AND number = 0", (part.name,))
            seal -= sum(int(checksum, 16) for (checksum,) in before)
            connection.execute("DELETE FROM part WHERE name = ?", (part.name,))
        checksum = _checksum(part.name, number, *packed)
        connection.execute("INSERT INTO part VALUES (?, ?, ?, ?, ?)", (part.name, number, *packed, checksum))
        seal += int(checksum, 16)
    connection.execute("UPDATE part SET head = ? WHERE name = ?", (f"{seal % _ALL:x}", _SEAL))


def _seal_of(connection: sqlite3.Connection) -> int:
    """Return the sum of the checksums that the file states."""
    for (text,) in connection.execute("SELECT head FROM part WHERE name = ?", (_SEAL,)):
        return int(text, 16)
    raise ValueError("it has no checksum")


def _checksum(name: str, number: int, head: str, arrays: bytes) -> str:
    digest = blake2b(digest_size=_SIZE)
    for data in (name.encode(), struct.pack("<q", number), head.encode("utf-8", "surrogatepass"), arrays):
        digest.update(struct.pack("<q", len(data)))
        digest.update(data)
    return digest.hexdigest()


def _check_format(path: str | os.PathLike[str], connection: sqlite3.Connection) -> None:
    """Refuse a file that does not have this version of the format."""
    # Nothing in a stranger's file may run, so its table is compared as a text before anything is asked of it.
    name = os.fspath(path)
    connection.execute("PRAGMA trusted_schema = OFF")
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    if application != APPLICATION:
        raise StoreError(f"{name} is not a result file of gapwalk")
    (schema,) = connection.execute("PRAGMA user_version").fetchone()
    if schema > SCHEMA:
        raise StoreError(
            f"{name} was written by a newer gapwalk (its schema is {schema}); this is gapwalk {__version__}, which "
            f"reads schema {SCHEMA}: update gapwalk"
        )
    if schema < SCHEMA:
        raise StoreError(
            f"{name} was written by an older gapwalk (its schema is {schema}; this one reads schema {SCHEMA} only): "
            "compute the result again, into another file or over this one (--force)"
        )
    with undamaged(path):
        found = connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
        if found != [(TABLE,)]:
            raise ValueError("its tables are not those of gapwalk")


def _rows(connection: sqlite3.Connection, where: str = "", *values: str) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a file; raise a ValueError for a value of a wrong type, which SQLite accepts."""
    for row in connection.execute(f"SELECT {', '.join(_COLUMNS)} FROM part {where}", values):
        for (column, kind), value in zip(_COLUMNS.items(), row, strict=True):
            if type(value) is not kind:
                raise ValueError(
                    f"its part {row[0]!r:.60} has {_TYPES[type(value)]} in the column {column}, where {_TYPES[kind]} "
                    "should be"
                )
        yield row


def _seal_fault(connection: sqlite3.Connection) -> str:
    """Describe the fault of the checksums in a clause; empty if they are correct."""
    total, seal = 0, None
    for name, number, head, arrays, checksum in _rows(connection):
        if name == _SEAL:
            seal = head
            continue
        found = _checksum(name, number, head, arrays)
        if found != checksum:
            return (
                f"the checksum of its part {name!r:.60} {number} does not hold; it was changed since gapwalk wrote it"
            )
        total += int(found, 16)
    if seal is None:
        return "it has no checksum"
    if seal != f"{total % _ALL:x}":
        return "its checksum does not hold; parts of it were taken away, added or exchanged since gapwalk wrote it"
    return ""


class _Writer(sqlite3.Connection):
    """A connection that keeps space in the file for all parts in its log: on a full disk they could not move there."""

    _space = -1  # opened before this connection ends, and closed after: closing it gives up all locks of this process

    def reserve(self, path: str | os.PathLike[str]) -> None:
        """Have the system set aside what the file needs with the parts of this transaction."""
        if sys.platform != "linux":
            return
        (pages,), (size,) = (self.execute(f"PRAGMA page_{what}").fetchone() for what in ("count", "size"))
        self._space = os.open(path, os.O_RDWR) if self._space < 0 else self._space
        try:
            os.posix_fallocate(self._space, 0, pages * size)
        except OSError as error:
            if error.errno in FULL:
                raise

    def close(self) -> None:
        """Close the file."""
        super().close()
        if self._space >= 0:
            os.close(self._space)
            self._space = -1


def _open_to_write(path: str | os.PathLike[str]) -> _Writer:
    """Open an existing file so that committed parts survive the death of this process at any time."""
    with explained(path), ExitStack() as on_error:
        connection = on_error.enter_context(closing(sqlite3.connect(path, isolation_level=None, factory=_Writer)))
        _check_format(path, connection)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        with undamaged(path):
            _seal_of(connection)
        on_error.pop_all()
        return connection


def _close_whole(path: str | os.PathLike[str], connection: sqlite3.Connection) -> None:
    """Close a file so that it is a single file again; if somebody reads it, the reader does that."""
    with explained(path):
        try:
            with suppress(sqlite3.OperationalError):
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                connection.execute("PRAGMA journal_mode = DELETE")
        finally:
            connection.close()


def _remove(path: str | os.PathLike[str]) -> None:
    """Remove a file, and the files that a killed run has left next to it."""
    for suffix in ("", *_SIDE_FILES):
        with suppress(FileNotFoundError):
            os.unlink(f"{os.fspath(path)}{suffix}")


@contextmanager
def _transaction(path: str | os.PathLike[str], connection: _Writer) -> Iterator[None]:
    """Write everything inside the block, or nothing."""
    with explained(path):
        connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            connection.reserve(path)
            connection.execute("COMMIT")
        except BaseException:
            if connection.in_transaction:
                connection.execute("ROLLBACK")
            raise
        os.stat(path)  # SQLite goes on writing into a file that has been removed


def _open_to_read(path: str | os.PathLike[str]) -> sqlite3.Connection:
    address = Path(path).absolute().as_uri()
    connection = sqlite3.connect(f"{address}?mode=ro", uri=True, isolation_level=None)
    try:
        connection.execute("PRAGMA user_version").fetchone()
    except sqlite3.Error as error:
        connection.close()
        if not isinstance(error, sqlite3.OperationalError) or os.path.exists(f"{os.path.realpath(path)}-wal"):
            raise
        # A file of a killed run in a folder that cannot be written: nobody can be writing it.
        connection = sqlite3.connect(f"{address}?mode=ro&immutable=1", uri=True, isolation_level=None)
    return connection
