"""The store: writes a result while it is being computed, so that nothing that was reported is ever lost.

A result is one SQLite file. While a run writes it, SQLite's log stands beside it (``-wal``, ``-shm``); a run that
ends, even by Ctrl-C, leaves one file. Killed at any moment, the file holds every point up to some moment together
with the state of the walk at that very moment, so a resumed run goes on as if nothing had happened.
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import TracebackType
from typing import NamedTuple

from gapwalk.bifurcation.trail import TrailState
from gapwalk.continuation.branch import SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.codec import PointCodec
from gapwalk.study.database import checksum, close_whole, create, explained, open_to_write, remove
from gapwalk.study.file import Study
from gapwalk.study.plain import Progress, plain_end, plain_options, plain_progress, plain_system

_SECONDS = 0.1  # between two writes
_POINTS = 500  # at most in one write

Report = Callable[[BranchPoint, list[SpecialPoint]], object]
"""Called with each point of a branch and the special points between it and the one before."""


@dataclass(frozen=True, slots=True)
class WalkFile:
    """One walk of a result file: how its points are packed, and how many it has.

    Attributes
    ----------
    codec
        Packs its points.
    count, special_count
        Points, the first included, and special points that the file has already.
    branch
        Number of its branch.
    """

    codec: PointCodec
    count: int
    special_count: int
    branch: int = 1


class _Found(NamedTuple):
    point: BranchPoint
    special_points: list[SpecialPoint]


class Store:
    """A result file that is being written, one walk of it at a time.

    Parameters
    ----------
    path
        The file, as made by `create_result`.
    walk
        The walk that is written.
    versions
        Versions of everything that has computed the result.
    report
        Called with each point once it is safe.
    """

    def __init__(
        self, path: str | os.PathLike[str], walk: WalkFile, versions: dict[str, str], report: Report | None = None
    ) -> None:
        self.path, self.walk = path, walk
        self._report = report
        self._pending: list[_Found] = []
        self._state: TrailState | None = None
        self._end: End | None = None
        self._written = time.monotonic()
        self._connection = open_to_write(path)
        with self._transaction():
            self._connection.execute("INSERT OR REPLACE INTO result VALUES ('versions', ?)", (json.dumps(versions),))

    def add(self, point: BranchPoint, special_points: list[SpecialPoint], state: TrailState, end: End | None) -> None:
        """Take in a new point, the special points before it, and the state of the walk after it.

        It is written, and reported, with one of the next points at the latest a tenth of a second later.

        Raises
        ------
        StoreError
            If the file can no longer be written.
        """
        self._pending.append(_Found(point, special_points))
        self._state, self._end = state, end
        if len(self._pending) >= _POINTS or time.monotonic() - self._written >= _SECONDS:
            self._flush()

    def finish(self, end: End) -> None:
        """Write the rest, and where and why the walk ended. Errors as `add`."""
        self._end = end
        self._flush()

    def close(self) -> None:
        """Close the file; it is then one file again."""
        close_whole(self.path, self._connection)

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _flush(self) -> None:
        """Write what has been taken in, with the state of the walk, in one transaction; then report it."""
        safe, walk = self._pending, self.walk
        special_points = [each for found in safe for each in found.special_points]
        with self._transaction():
            if safe:
                _write_points(self._connection, walk, [found.point for found in safe])
                _write_special_points(self._connection, walk, special_points)
            if self._state is not None:
                walked, detector = self._state.walk, self._state.detector
                self._update("state", plain_progress(Progress(walked.step, walked.count, detector)))
            self._update("end", None if self._end is None else plain_end(self._end))
        self._pending = []
        self.walk = replace(walk, count=walk.count + len(safe), special_count=walk.special_count + len(special_points))
        self._written = time.monotonic()
        if self._report is not None:
            for found in safe:
                self._report(*found)

    def _update(self, column: str, value: object) -> None:
        text = None if value is None else json.dumps(value)
        self._connection.execute(f"UPDATE branch SET {column} = ? WHERE id = ?", (text, self.walk.branch))

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """All or nothing of what is written inside."""
        with explained(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise


def create_result(
    path: str | os.PathLike[str], study: Study, start: Orbit, first: BranchPoint, versions: dict[str, str]
) -> None:
    """Make a result file with the first point of its one walk; what was there before is lost.

    A file of that name is at any moment either whole or not there.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    options = study.options
    walk = WalkFile(PointCodec(study.system, options.parameter, options.period, len(first.x)), 0, 0)
    about = {
        "title": study.title,
        "text": study.text,
        "changes": [[name, value] for name, value in study.changes],
        "system": plain_system(study.system),
        "study": plain_options(options),
        "versions": versions,
    }
    new = f"{os.fspath(path)}-new"
    with explained(path):
        remove(new)
        connection = create(new)
        try:
            for key, value in about.items():
                connection.execute("INSERT INTO result VALUES (?, ?)", (key, json.dumps(value)))
            connection.execute(
                "INSERT INTO branch VALUES (?, ?, ?, ?, ?, ?, NULL, NULL)",
                (walk.branch, options.parameter, options.period, len(first.x), *walk.codec.pack_orbit(start)),
            )
            _write_points(connection, walk, [first])
            connection.execute("COMMIT")
        finally:
            connection.close()
        remove(path)  # its log too, which must not be taken for that of the new file
        os.replace(new, path)


def _write_points(connection: sqlite3.Connection, walk: WalkFile, points: list[BranchPoint]) -> None:
    packed = walk.codec.pack(points)
    connection.execute(
        "INSERT INTO points VALUES (?, ?, ?, ?, ?, ?)",
        (walk.branch, walk.count, len(points), *packed, checksum(packed)),
    )


def _write_special_points(connection: sqlite3.Connection, walk: WalkFile, special_points: list[SpecialPoint]) -> None:
    for number, special in enumerate(special_points, start=walk.special_count):
        packed = walk.codec.pack([special.point])
        connection.execute(
            "INSERT INTO special_point VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                walk.branch,
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
