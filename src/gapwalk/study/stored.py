"""What a result file holds, read back: the study, and the walk of a response or the branches of a diagram."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from typing import Any, NamedTuple

from gapwalk.bifurcation.diagram import Diagram, Limb, Origin
from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import StoreError
from gapwalk.orbit.floquet import Instability
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.codec import PointCodec
from gapwalk.study.database import checksum, reading
from gapwalk.study.file import Study
from gapwalk.study.options import DiagramStudyOptions
from gapwalk.study.plain import Progress, end_of, options_of, origin_of, progress_of, system_of
from gapwalk.study.result import Result


class StoredWalk(NamedTuple):
    """All that a result file holds of the walk of a response.

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
    ends
        Where and why it ends, at its beginning and at its end; None if it can go on.
    """

    start: Orbit
    points: list[BranchPoint]
    special_points: list[SpecialPoint]
    progress: Progress | None
    ends: tuple[End, ...] | None

    def branch(self, parameter: str, period: int) -> Branch:
        """The branch, as `follow` returns it."""
        ends = self.ends or (self.first_end, End(EndReason.STOPPED, self.points[-1].value))
        return Branch(parameter, period, tuple(self.points), tuple(self.special_points), ends)

    @property
    def first_end(self) -> End:
        """Where it begins."""
        return End(EndReason.START, self.points[0].value)

    @property
    def is_complete(self) -> bool:
        """Whether the walk cannot go on."""
        return self.ends is not None and self.ends[-1].reason.is_final


class StoredDiagram(NamedTuple):
    """All that a result file holds of a diagram; it is `finished` if nothing is left to do."""

    diagram: Diagram
    finished: bool


class Stored(NamedTuple):
    """All that a result file holds: the study, what was found, and the versions."""

    study: Study
    found: StoredWalk | StoredDiagram
    versions: dict[str, str]

    def result(self) -> Result:
        """The same as a user sees it."""
        if isinstance(self.found, StoredDiagram):
            diagram, finished = self.found
            return Result(self.study, diagram.branches, finished, self.versions, diagram)
        branch = self.found.branch(self.study.options.parameter, self.study.options.period)
        return Result(self.study, (branch,), self.found.is_complete, self.versions)


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


class _Row(NamedTuple):
    """One branch as it stands in the file."""

    name: str
    codec: PointCodec
    start: tuple[bytes, bytes]
    begins: Origin | None
    joins: Origin | None
    progress: Progress | None
    ends: tuple[End, ...] | None
    points: list[BranchPoint]
    special_points: list[SpecialPoint]


def _read(connection: sqlite3.Connection) -> Stored:
    about = {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM result")}
    study = Study(
        system_of(about["system"]),
        options_of(about["study"]),
        str(about["title"]),
        str(about["text"]),
        tuple((str(name), value) for name, value in about["changes"]),
        str(about["name"]),
    )
    rows = list(_rows(connection, study))
    if not rows:
        raise ValueError("it holds no branch")
    if isinstance(study.options, DiagramStudyOptions):
        found = _diagram(study.options, rows, about["diagram"])
    else:
        found = _walk(study, rows)
    return Stored(study, found, {str(name): str(version) for name, version in about["versions"].items()})


def _rows(connection: sqlite3.Connection, study: Study) -> Iterator[_Row]:
    rows = connection.execute(
        "SELECT id, name, parameter, period, unknowns, start, start_events, begins, joins, state, ends "
        "FROM branch ORDER BY id"
    ).fetchall()
    for place, row in enumerate(rows, start=1):
        number, name, parameter, period, unknowns, start, start_events = row[:7]
        if (number, parameter) != (place, study.options.parameter) or period < 1:
            raise ValueError("a branch does not belong to the study")
        codec = PointCodec(study.system, parameter, period, unknowns)
        begins, joins, state, ends = (None if text is None else json.loads(text) for text in row[7:])
        yield _Row(
            str(name),
            codec,
            (start, start_events),
            origin_of(begins),
            origin_of(joins),
            None if state is None else progress_of(state),
            None if ends is None else tuple(end_of(end) for end in ends),
            _points(connection, number, codec),
            _special_points(connection, number, codec),
        )


def _walk(study: Study, rows: list[_Row]) -> StoredWalk:
    (row,) = rows
    if row.codec.period != study.options.period or (row.ends is not None and len(row.ends) != 2):
        raise ValueError("a branch does not belong to the study")
    return StoredWalk(row.codec.unpack_orbit(row.start), row.points, row.special_points, row.progress, row.ends)


def _diagram(options: DiagramStudyOptions, rows: list[_Row], about: Any) -> StoredDiagram:
    limbs: list[Limb] = []
    for row in rows:
        if row.ends is None or len(row.ends) != 2:
            raise ValueError(f"the ends of branch {row.name} are missing")
        period = row.codec.period
        branch = Branch(options.parameter, period, tuple(row.points), tuple(row.special_points), row.ends)
        limb = Limb(row.name, branch, row.begins, row.joins)
        known = {limb.name: len(limb.branch.special_points) for limb in limbs}
        if limb.name in known or any(not 0 <= o.special < known.get(o.parent, 0) for o in limb.origins):
            raise ValueError(f"branch {row.name} has no place in the tree")
        limbs.append(limb)
    low, high = sorted((options.begin, options.end))
    notes = tuple(str(note) for note in about["notes"])
    return StoredDiagram(
        Diagram(options.parameter, (low, high), tuple(limbs), bool(about["complete"]), notes), bool(about["finished"])
    )


def _points(connection: sqlite3.Connection, branch: int, codec: PointCodec) -> list[BranchPoint]:
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


def _special_points(connection: sqlite3.Connection, branch: int, codec: PointCodec) -> list[SpecialPoint]:
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
