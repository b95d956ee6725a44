"""The result of a study, as it comes from a run or from a result file."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import StoreError
from gapwalk.model.system import System
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.codec import PointCodec
from gapwalk.study.database import checksum, reading
from gapwalk.study.file import Study
from gapwalk.study.options import StudyOptions
from gapwalk.study.plain import Progress, end_of, options_of, progress_of, system_of


@dataclass(frozen=True)
class Result:
    """What a study has found.

    Attributes
    ----------
    study
        What was asked.
    branches
        The branches that were found.
    complete
        Whether every walk came to its end; False after an interruption, from which a run can be resumed.
    versions
        Versions of gapwalk, heyoka, numpy and python that computed it.
    """

    study: Study
    branches: tuple[Branch, ...]
    complete: bool
    versions: Mapping[str, str]

    @property
    def title(self) -> str:
        """Title of the study; may be empty."""
        return self.study.title

    @property
    def system(self) -> System:
        """The system at the beginning of the study."""
        return self.study.system

    @property
    def options(self) -> StudyOptions:
        """What was asked of it."""
        return self.study.options

    def __repr__(self) -> str:
        state = "complete" if self.complete else "incomplete"
        return f"Result({self.title!r}, {state}, {', '.join(map(repr, self.branches))})"


class StoredWalk(NamedTuple):
    """All that a result file holds of one walk.

    Attributes
    ----------
    start
        The orbit that was found first.
    points
        Its points, the first included.
    special_points
        Its special points, in order.
    progress
        Where the walk can go on from; None if it has not left its first point.
    end
        Where and why it ended; None if it can go on.
    """

    start: Orbit
    points: list[BranchPoint]
    special_points: list[SpecialPoint]
    progress: Progress | None
    end: End | None


class Stored(NamedTuple):
    """All that a result file holds: the study, the walks by the number of their branch, and the versions."""

    study: Study
    walks: dict[int, StoredWalk]
    versions: dict[str, str]

    def result(self) -> Result:
        """The same as a user sees it."""
        options = self.study.options
        branches = tuple(
            branch_of(options.parameter, options.period, walk.points, walk.special_points, walk.end)
            for walk in self.walks.values()
        )
        complete = all(is_complete(walk.end) for walk in self.walks.values())
        return Result(self.study, branches, complete, self.versions)


def load(path: str | os.PathLike[str]) -> Result:
    """Load the result of a study from its file; a run may still be writing it, or may have been killed.

    Parameters
    ----------
    path
        The result file.

    Raises
    ------
    StoreError
        If there is no such file, it is no result, it comes from a newer gapwalk, or it is damaged.
    """
    return read(path).result()


def read(path: str | os.PathLike[str]) -> Stored:
    """Everything in a result file; errors as `load`."""
    with reading(path) as connection:
        try:
            return _read(connection)
        except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise StoreError(f"{os.fspath(path)} is damaged: {error}") from error


def branch_of(
    parameter: str,
    period: int,
    points: list[BranchPoint],
    special_points: list[SpecialPoint],
    end: End | None,
) -> Branch:
    """The branch of a walk in one direction, as `follow` returns it."""
    ends = (
        End(EndReason.START, points[0].value),
        end or End(EndReason.STOPPED, points[-1].value),
    )
    return Branch(parameter, period, tuple(points), tuple(special_points), ends)


def is_complete(end: End | None) -> bool:
    """Whether a walk with this end cannot go on."""
    return end is not None and end.reason.is_final


def _read(connection: sqlite3.Connection) -> Stored:
    about = {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM result")}
    options = options_of(about["study"])
    study = Study(
        system_of(about["system"]),
        options,
        str(about["title"]),
        str(about["text"]),
        tuple((str(name), value) for name, value in about["changes"]),
    )
    rows = connection.execute(
        "SELECT id, parameter, period, unknowns, start, start_events, state, end FROM branch ORDER BY id"
    ).fetchall()
    walks = {}
    for number, parameter, period, unknowns, start, start_events, state, end in rows:
        if (number, parameter, period) != (len(walks) + 1, options.parameter, options.period):
            raise ValueError("a branch does not belong to the study")
        codec = PointCodec(study.system, parameter, period, unknowns)
        walks[number] = StoredWalk(
            codec.unpack_orbit((start, start_events)),
            _read_points(connection, number, codec),
            _read_special_points(connection, number, codec),
            None if state is None else progress_of(json.loads(state)),
            None if end is None else end_of(json.loads(end)),
        )
    if not walks:
        raise ValueError("it holds no branch")
    return Stored(study, walks, {str(name): str(version) for name, version in about["versions"].items()})


def _read_points(connection: sqlite3.Connection, branch: int, codec: PointCodec) -> list[BranchPoint]:
    points: list[BranchPoint] = []
    rows = connection.execute(
        "SELECT first, count, data, events, checksum FROM points WHERE branch = ? ORDER BY first", (branch,)
    )
    for first, count, data, events, expected in rows:
        if first != len(points):
            raise ValueError(f"the points from number {len(points)} on are missing")
        points += codec.unpack(_checked(data, events, expected), count)
    if not points:
        raise ValueError("a branch has no points")
    return points


def _read_special_points(connection: sqlite3.Connection, branch: int, codec: PointCodec) -> list[SpecialPoint]:
    special_points = []
    rows = connection.execute(
        "SELECT kind, uncertainty, contact, nature, judged, before, after, data, events, checksum FROM special_point "
        "WHERE branch = ? ORDER BY number",
        (branch,),
    )
    for kind, uncertainty, contact, nature, judged, before, after, data, events, expected in rows:
        (point,) = codec.unpack(_checked(data, events, expected), 1)
        sides = (_instability(json.loads(before)), _instability(json.loads(after)))
        special_points.append(SpecialPoint(Kind(kind), point, *sides, uncertainty, contact, nature, judged))
    return special_points


def _checked(data: bytes, events: bytes, expected: int) -> tuple[bytes, bytes]:
    if checksum((data, events)) != expected:
        raise ValueError("the checksum of some points is wrong")
    return data, events


def _instability(plain: Any) -> Instability:
    above, below, pairs = plain
    return Instability(int(above), int(below), int(pairs))
