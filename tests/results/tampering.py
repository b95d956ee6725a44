"""Result files changed in two ways: as by a faulty gapwalk, whose checksums hold, or by something else."""

import sqlite3
from contextlib import closing
from pathlib import Path

from gapwalk.results import result_file as file


def change(path: Path, statement: str, *values: object) -> int:
    """Change a result file; how many of its parts are others."""
    with closing(sqlite3.connect(path)) as connection:
        changed = connection.execute(statement, values).rowcount
        connection.commit()
    return changed


def tamper(path: Path, statement: str, *values: object) -> None:
    """Change a part of a result file as something else than gapwalk would: its checksums become stale."""
    assert change(path, statement, *values) > 0


def change_sealed(path: Path, statement: str, *values: object) -> None:
    """Change a result file such that its checksums hold: what refuses it then is what reads it."""
    with closing(sqlite3.connect(path)) as connection:
        before = _parts(connection)
        connection.execute(statement, values)
        rows = _parts(connection)
        assert rows != before
        checksums = [file._checksum(*row) for row in rows]
        for row, checksum in zip(rows, checksums, strict=True):
            connection.execute("UPDATE part SET checksum = ? WHERE name = ? AND number = ?", (checksum, *row[:2]))
        total = sum(int(checksum, 16) for checksum in checksums) % file._ALL
        connection.execute("UPDATE part SET head = ? WHERE name = 'seal'", (f"{total:x}",))
        connection.commit()


def _parts(connection: sqlite3.Connection) -> list[tuple[str, int, str, bytes]]:
    return connection.execute("SELECT name, number, head, arrays FROM part WHERE name <> 'seal'").fetchall()
