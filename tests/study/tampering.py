"""Result files changed in two ways: as by a faulty gapwalk, whose seal holds, or by something else."""

import sqlite3
from pathlib import Path

from gapwalk.study.store.database import close_whole, open_to_write, transaction


def change_sealed(path: Path, statement: str, *values: object) -> None:
    """Change a result file such that its seal holds: what refuses it then is what reads it."""
    connection = open_to_write(path)
    with transaction(path, connection):
        connection.execute(statement, values)
    close_whole(path, connection)


def tamper(path: Path, statement: str, *values: object) -> None:
    """Change a result file as something else than gapwalk would: its seal becomes stale."""
    connection = sqlite3.connect(path)
    changed = connection.execute(statement, values).rowcount
    connection.commit()
    connection.close()
    assert changed > 0
