"""What older gapwalks wrote into result files, and how it becomes what this one reads.

Schema 1 stood for several layouts: the first had responses only, the second the natures of special points too. Then
came tables for more kinds of study, in files of their own; those need no change. Since schema 2 each change of a table,
or of the meaning of what stands in it, has a number and a step here.
"""

from __future__ import annotations

import json
import sqlite3

from gapwalk.continuation.walk import EndReason
from gapwalk.study.store.layout import TABLES
from gapwalk.study.store.trust import Older, tables

_RESULT, _BRANCH, _POINTS, _SPECIAL_POINT = TABLES
_FIRST_BRANCH = """CREATE TABLE branch (
    id INTEGER PRIMARY KEY,
    parameter TEXT NOT NULL,
    period INTEGER NOT NULL,
    unknowns INTEGER NOT NULL,
    start BLOB NOT NULL,
    start_events BLOB NOT NULL,
    state TEXT,
    end TEXT -- in JSON; the beginning was not told
)"""
_FIRST_SPECIAL_POINT = """CREATE TABLE special_point (
    branch INTEGER NOT NULL,
    number INTEGER NOT NULL,
    kind TEXT NOT NULL,
    value REAL NOT NULL,
    uncertainty REAL NOT NULL,
    contact TEXT NOT NULL,
    before TEXT NOT NULL,
    after TEXT NOT NULL,
    data BLOB NOT NULL,
    events BLOB NOT NULL,
    checksum INTEGER NOT NULL,
    PRIMARY KEY (branch, number)
)"""


def _add_natures(connection: sqlite3.Connection) -> None:
    """Special points get a nature: the text that stands for one that was not judged."""
    connection.execute("ALTER TABLE special_point RENAME TO old_special_point")
    connection.execute(_SPECIAL_POINT)
    connection.execute(
        "INSERT INTO special_point SELECT branch, number, kind, value, uncertainty, contact, '', 0.0, before, after, "
        "data, events, checksum FROM old_special_point"
    )
    connection.execute("DROP TABLE old_special_point")


def _name_branches(connection: sqlite3.Connection) -> None:
    """Branches get names, and both of their ends are told; results get names too.

    Where a walk had come to is left out: its variables were scaled otherwise, so it cannot go on.
    """
    begin = _about(connection, "study")["begin"]
    connection.execute("ALTER TABLE branch RENAME TO old_branch")
    connection.execute(_BRANCH)
    connection.execute(
        "INSERT INTO branch SELECT id, 'P' || period || '-' || id, parameter, period, unknowns, start, start_events, "
        "NULL, NULL, NULL, NULL FROM old_branch"
    )
    for number, text in connection.execute("SELECT id, end FROM old_branch WHERE end IS NOT NULL").fetchall():
        end = json.loads(text)
        if (end["reason"], end["detail"]) == (EndReason.STOPPED.name, "interrupted"):
            end |= {"reason": EndReason.INTERRUPTED.name, "detail": ""}
        ends = [{"reason": EndReason.START.name, "value": begin, "detail": ""}, end]
        connection.execute("UPDATE branch SET ends = ? WHERE id = ?", (json.dumps(ends), number))
    connection.execute("DROP TABLE old_branch")
    connection.execute("INSERT INTO result VALUES ('name', ?)", (json.dumps(""),))


def _about(connection: sqlite3.Connection, key: str) -> dict[str, object]:
    row = connection.execute("SELECT value FROM result WHERE key = ?", (key,)).fetchone()
    if row is None:
        raise ValueError(f"it does not tell its {key}")
    return json.loads(row[0])


OLDER = (
    Older(tables((_RESULT, _FIRST_BRANCH, _POINTS, _FIRST_SPECIAL_POINT)), _add_natures),
    Older(tables((_RESULT, _FIRST_BRANCH, _POINTS, _SPECIAL_POINT)), _name_branches),
)
"""What older gapwalks wrote; a step leads to the next, or to today's tables."""
