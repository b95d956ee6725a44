"""The seal of a result file: a digest of all that stands in it, kept up to date by each transaction that changes it.

It holds the sum of the digests of all rows of each table, so that a row that comes, goes or changes costs no more than
its own digest, however long the file is. SQLite itself tells of each, by triggers that live as long as a connection and
are no part of the file: no writer can forget it, and the seal of a killed run is that of what it has committed. Nothing
in it is secret: it finds what was changed by something else than gapwalk, but not a change with a seal made anew.
"""

from __future__ import annotations

import json
import sqlite3
import struct
from hashlib import blake2b

SEALED = 3
"""The schema since which result files have a seal."""

_KEY = "seal"  # of the row in which it stands, in the table of the result
_SIZE = 16  # bytes of a digest
_ALL = 1 << 8 * _SIZE
_COLUMNS = "SELECT name FROM pragma_table_info(?) ORDER BY cid"
_TABLES = "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite!_%' ESCAPE '!' ORDER BY name"

Value = str | bytes | float | int | None
"""What stands in a column."""


def keep_sealed(connection: sqlite3.Connection, *, anew: bool) -> None:
    """Keep the seal up to date from now on, as long as a connection is open.

    Parameters
    ----------
    connection
        A result file that is open for writing.
    anew
        Whether it has none yet: then one is made of what stands in it.
    """
    if anew:
        connection.execute("INSERT OR REPLACE INTO result VALUES (?, ?)", (_KEY, json.dumps(_digests(connection))))
    connection.create_function("_sealed", -1, _sealed, deterministic=True)
    connection.execute("PRAGMA recursive_triggers = ON")  # else what is replaced would not count as deleted
    for table in _tables(connection):
        columns = [name for (name,) in connection.execute(_COLUMNS, (table,))]
        old, new = ((f"'{table}', {', '.join(f'{row}.[{name}]' for name in columns)}") for row in ("OLD", "NEW"))
        for event, sealed in (
            ("INSERT", f"_sealed(value, 1, {new})"),
            ("DELETE", f"_sealed(value, -1, {old})"),
            ("UPDATE", f"_sealed(_sealed(value, -1, {old}), 1, {new})"),
        ):
            row = "OLD" if event == "DELETE" else "NEW"
            when = f"WHEN {row}.key <> '{_KEY}'" if table == "result" else ""
            connection.execute(
                f"CREATE TEMP TRIGGER _{event}_{table} AFTER {event} ON main.{table} {when} "
                f"BEGIN UPDATE result SET value = {sealed} WHERE key = '{_KEY}'; END"
            )


def seal_fault(connection: sqlite3.Connection) -> str:
    """What is wrong with the seal of a result file that should have one, as a clause; empty if it holds."""
    row = connection.execute("SELECT value FROM result WHERE key = ?", (_KEY,)).fetchone()
    try:
        sealed = json.loads(row[0]) if row else None
    except (TypeError, ValueError):
        sealed = None
    if not isinstance(sealed, dict):
        return "it has no checksum"
    found = _digests(connection)
    changed = sorted(name for name in {*found, *sealed} if found.get(name) != sealed.get(name))
    if not changed:
        return ""
    return f"its checksum does not hold; what was changed since gapwalk wrote it is in the table {', '.join(changed)}"


def _tables(connection: sqlite3.Connection) -> list[str]:
    return [name for (name,) in connection.execute(_TABLES)]


def _digests(connection: sqlite3.Connection) -> dict[str, str]:
    """The digest of each table that has rows."""
    digests = {}
    for table in _tables(connection):
        rows = connection.execute(f"SELECT * FROM [{table}]")
        total = sum(_digest(row) for row in rows if (table, row[0]) != ("result", _KEY)) % _ALL
        if total:
            digests[table] = _text(total)
    return digests


def _sealed(seal: str, sign: int, table: str, *row: Value) -> str:
    """A seal after a row was added to a table (1) or taken from it (-1)."""
    digests = json.loads(seal)
    total = (int(digests.pop(table, "0"), 16) + sign * _digest(row)) % _ALL
    if total:
        digests[table] = _text(total)
    return json.dumps(digests)


def _text(total: int) -> str:
    return f"{total:0{2 * _SIZE}x}"


def _digest(row: tuple[Value, ...]) -> int:
    """The digest of a row: of its values with their types and lengths."""
    digest = blake2b(digest_size=_SIZE)
    for value in row:
        match value:
            case str():
                kind, data = b"t", value.encode("utf-8", "surrogatepass")
            case bytes():
                kind, data = b"b", value
            case float():
                kind, data = b"f", struct.pack("<d", value + 0.0)  # SQLite stores -0.0 as 0
            case int():
                kind, data = b"i", str(value).encode()
            case None:
                kind, data = b"n", b""
        digest.update(kind + len(data).to_bytes(8, "little"))
        digest.update(data)
    return int.from_bytes(digest.digest(), "little")
