"""The store: writes a walk while it is being computed, so that nothing that was reported is ever lost.

A result is one SQLite file. While a run writes it, SQLite's log stands beside it (``-wal``, ``-shm``); a run that
ends, even by Ctrl-C, leaves one file. Killed at any moment, the file holds every point up to some moment together
with the state of the walk at that very moment, so a resumed run goes on as if nothing had happened.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import TracebackType
from typing import NamedTuple

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.trail import TrailState
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.file import Study
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.database import close_whole, open_to_write, transaction
from gapwalk.study.store.plain import Progress, plain_progress
from gapwalk.study.store.rows import (
    BranchRow,
    begin_file,
    ends_text,
    write_about,
    write_branch,
    write_points,
    write_special_points,
)

_SECONDS = 0.1  # between two writes
_POINTS = 500  # at most in one write
_BRANCH = 1  # the number of the one branch of a response

Report = Callable[[BranchPoint, list[SpecialPoint]], object]
"""Called with each point of a branch and the special points between it and the one before."""


@dataclass(frozen=True, slots=True)
class WalkFile:
    """The walk of a result file: how its points are packed, and how many it has.

    Attributes
    ----------
    codec
        Packs its points.
    count, special_count
        Points, the first included, and special points that the file has already.
    """

    codec: PointCodec
    count: int
    special_count: int


class _Found(NamedTuple):
    point: BranchPoint
    special_points: list[SpecialPoint]


class Store:
    """The result file of a response that is being walked.

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
        self._ends: tuple[End, ...] | None = None
        self._written = time.monotonic()
        self._connection = open_to_write(path)
        with transaction(self.path, self._connection):
            write_about(self._connection, "versions", versions)

    def add(
        self,
        point: BranchPoint,
        special_points: list[SpecialPoint],
        state: TrailState,
        ends: tuple[End, ...] | None,
    ) -> None:
        """Take in a new point, the special points before it, and the state of the walk after it.

        It is written, and reported, with one of the next points at the latest a tenth of a second later.

        Raises
        ------
        StoreError
            If the file can no longer be written.
        """
        self._pending.append(_Found(point, special_points))
        self._state, self._ends = state, ends
        if len(self._pending) >= _POINTS or time.monotonic() - self._written >= _SECONDS:
            self._flush()

    def finish(self, ends: tuple[End, ...]) -> None:
        """Write the rest, and where and why the walk ended. Errors as `add`."""
        self._ends = ends
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
        with transaction(self.path, self._connection):
            if safe:
                write_points(self._connection, _BRANCH, walk.codec, [found.point for found in safe], walk.count)
                write_special_points(self._connection, _BRANCH, walk.codec, special_points, walk.special_count)
            if self._state is not None:
                walked, detector = self._state.walk, self._state.detector
                self._update("state", json.dumps(plain_progress(Progress(walked.step, walked.count, detector))))
            self._update("ends", ends_text(self._ends))
        self._pending = []
        self.walk = replace(walk, count=walk.count + len(safe), special_count=walk.special_count + len(special_points))
        self._written = time.monotonic()
        if self._report is not None:
            for found in safe:
                self._report(*found)

    def _update(self, column: str, text: str | None) -> None:
        self._connection.execute(f"UPDATE branch SET {column} = ? WHERE id = ?", (text, _BRANCH))


def create_result(
    path: str | os.PathLike[str], study: Study, start: Orbit, first: BranchPoint, versions: dict[str, str]
) -> None:
    """Make a result file with the first point of its walk; what was there before is lost. Errors as `begin_file`."""
    options = study.walked
    codec = PointCodec(study.system, options.parameter, options.period, len(first.x), balanced=options.balanced)
    row = BranchRow(_BRANCH, f"P{options.period}-1", codec, start)

    def fill(connection) -> None:
        write_branch(connection, row, options.parameter)
        write_points(connection, _BRANCH, codec, [first], 0)

    begin_file(path, study, versions, fill)
