"""The rows of a result file: how a new file is begun, and how branches, points and special points are written."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.diagram import Origin
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.file import Study
from gapwalk.study.reduced.origin import plain_reduced
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.database import checksum, create, explained, remove
from gapwalk.study.store.plain import plain_end, plain_origin, plain_system
from gapwalk.study.store.plain_options import plain_options


@dataclass(frozen=True, slots=True)
class BranchRow:
    """What a result file says of a branch beside its points.

    Attributes
    ----------
    number
        Of the branch, from 1.
    name
        Such as ``P2-3``.
    codec
        Packs its points.
    start
        Of a response, the orbit that was found first.
    begins, joins
        Where it begins and ends on other branches.
    ends
        Where and why it ends; None while it goes on.
    """

    number: int
    name: str
    codec: PointCodec
    start: Orbit | None = None
    begins: Origin | None = None
    joins: Origin | None = None
    ends: tuple[End, ...] | None = None


def begin_file(
    path: str | os.PathLike[str],
    study: Study,
    versions: dict[str, str],
    fill: Callable[[sqlite3.Connection], object],
    placed: Callable[[], object] = lambda: None,
) -> None:
    """Make a result file with what `fill` writes into it; what was there before is lost.

    `placed` is called when the earlier file is removed, just before the new one gets its name: Ctrl-C may come right
    after that, and the new file must not be taken for an earlier one then.

    A file of that name is at any moment either whole or not there.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    about = {
        "title": study.title,
        "name": study.name,
        "text": study.text,
        "matrices": study.matrices,
        "changes": [[name, value] for name, value in study.changes],
        "system": plain_system(study.system),
        "study": plain_options(study.options),
        "versions": versions,
    }
    if study.reduced is not None:
        about["reduction"] = plain_reduced(study.reduced)
    new = f"{os.fspath(path)}-new"
    with explained(path):
        remove(new)
        connection = create(new, study.options.kind)
        try:
            for key, value in about.items():
                write_about(connection, key, value)
            fill(connection)
            connection.execute("COMMIT")
        finally:
            connection.close()
        remove(path)  # its log too, which must not be taken for that of the new file
        placed()
        os.replace(new, path)


def write_about(connection: sqlite3.Connection, key: str, value: object) -> None:
    """Write one value of the table of the result, over an earlier one."""
    connection.execute("INSERT OR REPLACE INTO result VALUES (?, ?)", (key, json.dumps(value)))


def write_branch(connection: sqlite3.Connection, row: BranchRow, parameter: str) -> None:
    """Write what there is to say of a branch beside its points."""
    start = (None, None) if row.start is None else row.codec.pack_orbit(row.start)
    connection.execute(
        "INSERT INTO branch VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, NULL, ?)",
        (
            row.number,
            row.name,
            parameter,
            row.codec.period,
            row.codec.unknowns,
            *start,
            _text(plain_origin(row.begins)),
            _text(plain_origin(row.joins)),
            ends_text(row.ends),
        ),
    )


def write_whole_branch(connection: sqlite3.Connection, row: BranchRow, branch: Branch) -> None:
    """Write a branch that is walked to its ends, with all of its points."""
    write_branch(connection, row, branch.parameter)
    write_points(connection, row.number, row.codec, branch.points, 0)
    write_special_points(connection, row.number, row.codec, branch.special_points, 0)


def write_points(
    connection: sqlite3.Connection, branch: int, codec: PointCodec, points: Sequence[BranchPoint], first: int
) -> None:
    """Write points of a branch; `first` is the number of the first of them."""
    packed = codec.pack(points)
    connection.execute(
        "INSERT INTO points VALUES (?, ?, ?, ?, ?, ?)", (branch, first, len(points), *packed, checksum(packed))
    )


def write_special_points(
    connection: sqlite3.Connection, branch: int, codec: PointCodec, special_points: Sequence[SpecialPoint], first: int
) -> None:
    """Write special points of a branch; `first` is the number of the first of them."""
    for number, special in enumerate(special_points, start=first):
        packed = codec.pack([special.point])
        connection.execute(
            "INSERT INTO special_point VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                branch,
                number,
                special.kind.value,
                special.value,
                special.uncertainty,
                special.contact,
                special.nature,
                special.judged,
                json.dumps(special.before),
                json.dumps(special.after),
                *packed,
                checksum(packed),
            ),
        )


def ends_text(ends: tuple[End, ...] | None) -> str | None:
    """Where and why a branch ends, as a result file has it."""
    return None if ends is None else json.dumps([plain_end(end) for end in ends])


def _text(value: object) -> str | None:
    return None if value is None else json.dumps(value)
