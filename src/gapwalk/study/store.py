"""The store: writes a result while it is being computed, so that nothing that was reported is ever lost.

A result is one SQLite file. While a run writes it, SQLite's log stands beside it (``-wal``, ``-shm``); a run that
ends, even by Ctrl-C, leaves one file. Killed at any moment, the file holds every point up to some moment together
with the state of the walk at that very moment, so a resumed run goes on as if nothing had happened.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import NamedTuple

import heyoka
import numpy as np

from gapwalk import __version__
from gapwalk.bifurcation.follow import TrailState
from gapwalk.continuation.branch import SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End
from gapwalk.errors import StoreError
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.codec import PointCodec
from gapwalk.study.database import checksum, close_whole, create, explained, lock, open_to_write, remove
from gapwalk.study.file import Study
from gapwalk.study.plain import Progress, plain_end, plain_options, plain_progress, plain_system
from gapwalk.study.result import Stored, is_complete, read

_SECONDS = 0.1  # between two writes
_POINTS = 500  # at most in one write

Report = Callable[[BranchPoint, list[SpecialPoint]], object]
"""Called with each point of a branch and the special points between it and the one before."""


class _Pending(NamedTuple):
    point: BranchPoint
    special_points: list[SpecialPoint]


class Store:
    """A result file that is being written, one walk of it at a time.

    Parameters
    ----------
    path
        The file, as made by `create_result`.
    codec
        Packs the points of the walk.
    count, special_count
        Points and special points that it has already.
    report
        Called with each point once it is safe.
    branch
        Number of the branch.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        codec: PointCodec,
        count: int,
        special_count: int,
        report: Report | None = None,
        branch: int = 1,
    ) -> None:
        self.path, self.codec, self.branch = path, codec, branch
        self._count, self._special_count, self._report = count, special_count, report
        self._pending: list[_Pending] = []
        self._state: TrailState | None = None
        self._end: End | None = None
        self._written = time.monotonic()
        self._connection = open_to_write(path)

    def add(self, point: BranchPoint, special_points: list[SpecialPoint], state: TrailState, end: End | None) -> None:
        """Take in a new point, the special points before it, and the state of the walk after it.

        It is safe, and reported, a tenth of a second later at most.

        Raises
        ------
        StoreError
            If the file can no longer be written.
        """
        self._pending.append(_Pending(point, special_points))
        self._state, self._end = state, end
        if len(self._pending) >= _POINTS or time.monotonic() - self._written >= _SECONDS:
            self.flush()

    def finish(self, end: End) -> None:
        """Write the rest, and where and why the walk ended. Errors as `add`."""
        self._end = end
        self.flush()

    def flush(self) -> None:
        """Write what has been taken in, with the state of the walk, in one transaction; then report it."""
        safe = self._pending
        with explained(self.path), transaction(self._connection):
            if safe:
                points = [pending.point for pending in safe]
                write_points(self._connection, self.branch, self._count, self.codec, points)
                self._write_special_points([each for pending in safe for each in pending.special_points])
            if self._state is not None and self._state.walk is not None:
                walk = self._state.walk
                plain = plain_progress(Progress(walk.step, walk.count, self._state.detector))
                self._update("state", json.dumps(plain))
            self._update("end", None if self._end is None else json.dumps(plain_end(self._end)))
        self._pending = []
        self._count += len(safe)
        self._special_count += sum(len(pending.special_points) for pending in safe)
        self._written = time.monotonic()
        if self._report is not None:
            for point, special_points in safe:
                self._report(point, special_points)

    def close(self) -> None:
        """Close the file; it is then one file again."""
        close_whole(self.path, self._connection)

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _update(self, column: str, value: str | None) -> None:
        self._connection.execute(f"UPDATE branch SET {column} = ? WHERE id = ?", (value, self.branch))

    def _write_special_points(self, special_points: list[SpecialPoint]) -> None:
        for number, special in enumerate(special_points, start=self._special_count):
            packed = self.codec.pack([special.point])
            self._connection.execute(
                "INSERT OR REPLACE INTO special_point VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    self.branch,
                    number,
                    special.kind.value,
                    special.value,
                    special.uncertainty,
                    special.contact,
                    json.dumps(special.before),
                    json.dumps(special.after),
                    *packed,
                    checksum(packed),
                ),
            )


def write_points(connection, branch: int, first: int, codec: PointCodec, points: list[BranchPoint]) -> None:
    """Write one batch of points; `first` is the number of the first of them on the branch."""
    packed = codec.pack(points)
    connection.execute(
        "INSERT OR REPLACE INTO points VALUES (?, ?, ?, ?, ?, ?)",
        (branch, first, len(points), *packed, checksum(packed)),
    )


@contextmanager
def transaction(connection) -> Iterator[None]:
    """All or nothing of what is written inside."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        connection.execute("ROLLBACK")
        raise
    connection.execute("COMMIT")
