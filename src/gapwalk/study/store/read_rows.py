"""The rows of a result file read back: its branches with their points and special points."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.diagram import Origin
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End
from gapwalk.model.system import System
from gapwalk.orbit.floquet import Instability
from gapwalk.study.options import BranchOptions
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.database import checksum
from gapwalk.study.store.plain import Progress, end_of, origin_of, progress_of


class Row(NamedTuple):
    """One branch as it stands in the file."""

    name: str
    parameter: str
    codec: PointCodec
    start: tuple[bytes, bytes]
    begins: Origin | None
    joins: Origin | None
    progress: Progress | None
    ends: tuple[End, ...] | None
    points: list[BranchPoint]
    special_points: list[SpecialPoint]

    def branch(self) -> Branch:
        """The branch, if it was written whole; a ValueError otherwise."""
        if self.ends is None or len(self.ends) != 2:
            raise ValueError(f"the ends of branch {self.name} are missing")
        return Branch(self.parameter, self.codec.period, tuple(self.points), tuple(self.special_points), self.ends)


def branch_rows(
    connection: sqlite3.Connection, options: BranchOptions, system_of: Callable[[int], System]
) -> Iterator[Row]:
    """The branches of a file in their order.

    Parameters
    ----------
    connection
        The file.
    options
        Those of the study: the parameter along which the branches are, and how their orbits were found.
    system_of
        Gives the system of a branch by its place, from 0.
    """
    rows = connection.execute(
        "SELECT id, name, parameter, period, unknowns, start, start_events, begins, joins, state, ends "
        "FROM branch ORDER BY id"
    ).fetchall()
    for place, row in enumerate(rows):
        number, name, parameter, period, unknowns, start, start_events = row[:7]
        if (number, parameter) != (place + 1, options.parameter) or period < 1:
            raise ValueError("a branch does not belong to the study")
        codec = PointCodec(system_of(place), parameter, period, unknowns, balanced=options.balanced)
        begins, joins, state, ends = (None if text is None else json.loads(text) for text in row[7:])
        yield Row(
            str(name),
            parameter,
            codec,
            (start, start_events),
            origin_of(begins),
            origin_of(joins),
            None if state is None else progress_of(state),
            None if ends is None else tuple(end_of(end) for end in ends),
            _points(connection, number, codec),
            _special_points(connection, number, codec),
        )


def checked(data: bytes, events: bytes, expected: int) -> tuple[bytes, bytes]:
    """Packed points; a ValueError unless their checksum is the expected one."""
    if checksum((data, events)) != expected:
        raise ValueError("the checksum of some points is wrong")
    return data, events


def _points(connection: sqlite3.Connection, branch: int, codec: PointCodec) -> list[BranchPoint]:
    points: list[BranchPoint] = []
    rows = connection.execute(
        "SELECT first, count, data, events, checksum FROM points WHERE branch = ? ORDER BY first", (branch,)
    )
    for first, count, data, events, expected in rows:
        if first != len(points):
            raise ValueError(f"the points from number {len(points)} on are missing")
        points += codec.unpack(checked(data, events, expected), count)
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
        (point,) = codec.unpack(checked(data, events, expected), 1)
        sides = (_instability(json.loads(before)), _instability(json.loads(after)))
        special_points.append(SpecialPoint(Kind(kind), point, *sides, uncertainty, contact, nature, judged))
    return special_points


def _instability(plain: Any) -> Instability:
    above, below, pairs = plain
    return Instability(int(above), int(below), int(pairs))
