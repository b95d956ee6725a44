"""How far the content of a file is trusted: it has a mark, a schema and tables that are known, or it is refused."""

from __future__ import annotations

import os
import re
import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from gapwalk import __version__
from gapwalk.errors import StoreError

Tables = frozenset[str]
"""The texts of the tables of a file, without comments and spaces."""

_TYPES = {"INTEGER": "integer", "REAL": "real", "TEXT": "text", "BLOB": "blob"}  # as declared, and as `typeof` tells
_WORDS = {"integer": "an integer", "real": "a number", "text": "a text", "blob": "bytes", "null": "nothing"}


@dataclass(frozen=True, slots=True)
class Older:
    """What an older gapwalk wrote.

    Attributes
    ----------
    tables
        By which it is known.
    renew
        Makes of it what this gapwalk writes, inside of a transaction.
    """

    tables: Tables
    renew: Callable[[sqlite3.Connection], object]


@dataclass(frozen=True, slots=True)
class Format:
    """What a file of one kind is known by.

    Attributes
    ----------
    application
        What marks a SQLite file as one of this kind.
    schema
        Version of its tables and of what stands in them; a file with a larger one comes from a newer gapwalk.
    layouts
        The tables that it may have.
    missing
        What a file is told that has not the mark.
    older
        What older gapwalks wrote.
    """

    application: int
    schema: int
    layouts: tuple[Tables, ...]
    missing: str
    older: tuple[Older, ...] = ()

    def begin(self, connection: sqlite3.Connection) -> None:
        """Mark a new file."""
        connection.execute(f"PRAGMA application_id = {self.application}")
        connection.execute(f"PRAGMA user_version = {self.schema}")

    def check(self, path: str | os.PathLike[str], connection: sqlite3.Connection) -> Older | None:
        """What the file is if an older gapwalk wrote it; None if its tables are those of today.

        Nothing in a stranger's file may run, so its tables are compared as texts before anything is asked of them.

        Raises
        ------
        StoreError
            If it is no file of this kind, comes from a newer gapwalk, or is damaged.
        """
        connection.execute("PRAGMA trusted_schema = OFF")
        (application,) = connection.execute("PRAGMA application_id").fetchone()
        if application != self.application:
            raise StoreError(f"{os.fspath(path)} {self.missing}")
        schema = schema_of(connection)
        if schema > self.schema:
            raise StoreError(
                f"{os.fspath(path)} was written by a newer gapwalk (its schema is {schema}); this is gapwalk "
                f"{__version__}, which reads schemas up to {self.schema}: update gapwalk"
            )
        with undamaged(path):
            found = tables(sql for (sql,) in connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL"))
        if found in self.layouts:
            return None
        for each in self.older:
            if found == each.tables:
                return each
        raise StoreError(f"{os.fspath(path)} is damaged: its tables are not those of gapwalk")

    def renew(self, path: str | os.PathLike[str], connection: sqlite3.Connection) -> None:
        """Make of what an older gapwalk wrote what this one writes, inside of a transaction; errors as `check`."""
        while (older := self.check(path, connection)) is not None:
            with undamaged(path):
                older.renew(connection)
        if schema_of(connection) != self.schema:
            connection.execute(f"PRAGMA user_version = {self.schema}")


def schema_of(connection: sqlite3.Connection) -> int:
    """The schema with which a file was written."""
    (schema,) = connection.execute("PRAGMA user_version").fetchone()
    return schema


def check_types(connection: sqlite3.Connection) -> None:
    """A ValueError if a column of a file holds something of another type than its table says.

    SQLite itself does not mind: it keeps text in a column of numbers, and bytes in one of texts.
    """
    columns = connection.execute(
        "SELECT m.name, c.name, c.type, c.[notnull] OR c.pk FROM sqlite_master AS m, pragma_table_info(m.name) AS c "
        "WHERE m.type = 'table'"
    ).fetchall()
    for table, column, declared, needed in columns:
        types = {_TYPES[declared]} if needed else {_TYPES[declared], "null"}
        allowed = ", ".join(f"'{each}'" for each in sorted(types))
        query = f"SELECT typeof([{column}]) FROM [{table}] WHERE typeof([{column}]) NOT IN ({allowed}) LIMIT 1"
        for (wrong,) in connection.execute(query):
            raise ValueError(
                f"its table {table} has {_WORDS[wrong]} in the column {column}, where {_WORDS[_TYPES[declared]]} "
                "should be"
            )


def tables(texts: Iterable[str]) -> Tables:
    """The texts of some tables as they are compared: what is only said of a column makes no other table."""
    return frozenset(" ".join(re.sub(r"--[^\n]*", "", text).split()) for text in texts)


def checked_parts(connection: sqlite3.Connection) -> Iterator[tuple[int, bytes]]:
    """The parts in the table `chunk` of a file, each with its number; a ValueError if one is damaged."""
    for number, data, checksum in connection.execute("SELECT number, data, checksum FROM chunk ORDER BY number"):
        if not isinstance(data, bytes) or zlib.crc32(data) != checksum:
            raise ValueError(f"the checksum of part {number} is wrong")
        yield number, data


@contextmanager
def undamaged(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what goes wrong when the content of a file is taken apart into a StoreError."""
    try:
        yield
    except StoreError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise StoreError(f"{os.fspath(path)} is damaged: {error}") from error
