"""A map read back from its result file."""

from __future__ import annotations

import json
import sqlite3
from bisect import bisect_right
from itertools import accumulate
from typing import Any, NamedTuple

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.locus import Codim2, Codim2Point, Locus, LocusEnd, LocusEndReason
from gapwalk.model.system import System
from gapwalk.study.map.chart import Map, Section
from gapwalk.study.map.codec import LocusCodec
from gapwalk.study.options import MapStudyOptions
from gapwalk.study.store.read_rows import branch_rows, checked


class StoredMap(NamedTuple):
    """All that a result file holds of a map; it is `finished` if nothing is left to do."""

    chart: Map
    finished: bool


def read_map(connection: sqlite3.Connection, system: System, options: MapStudyOptions, about: Any) -> StoredMap:
    """The map of a result file; a ValueError, KeyError or TypeError if it makes no sense.

    Parameters
    ----------
    connection
        The file.
    system, options
        Those of the study.
    about
        What the file says of the map as a whole.
    """
    first, second = options.parameter, options.second.parameter
    loci = tuple(_loci(connection, system, options))
    if len(loci) != int(about["loci"]):
        raise ValueError("a locus is missing")
    notes, failures = (tuple(str(text) for text in about[key]) for key in ("notes", "failures"))
    sections = _sections(connection, system, options, about["sections"])
    complete, tried = bool(about["complete"]), int(about["tried"])
    chart = Map(first, second, options.within, loci, sections, complete, notes, failures, tried)
    return StoredMap(chart, bool(about["finished"]))


def _sections(
    connection: sqlite3.Connection, system: System, options: MapStudyOptions, about: Any
) -> tuple[Section, ...]:
    values, counts = [float(each["value"]) for each in about], [int(each["branches"]) for each in about]
    systems = [system.at({options.second.parameter: value}) for value in values]
    stops = list(accumulate(counts))

    def system_of(place: int) -> System:
        if not stops or place >= stops[-1]:
            raise ValueError("a branch belongs to no section")
        return systems[bisect_right(stops, place)]

    branches = [row.branch() for row in branch_rows(connection, options, system_of)]
    if len(branches) != sum(counts):
        raise ValueError("branches of a section are missing")
    return tuple(
        Section(value, tuple(branches[stop - count : stop]))
        for value, count, stop in zip(values, counts, stops, strict=True)
    )


def _loci(connection: sqlite3.Connection, system: System, options: MapStudyOptions):
    first, second = options.parameter, options.second.parameter
    rows = connection.execute(
        "SELECT id, kind, period, contact, unknowns, ends, count, data, events, checksum FROM locus ORDER BY id"
    ).fetchall()
    for place, row in enumerate(rows, start=1):
        number, kind, period, contact, unknowns, ends, count, data, events, expected = row
        if number != place or period < 1:
            raise ValueError("a locus is missing")
        codec = LocusCodec(system, first, second, period, unknowns, balanced=options.balanced)
        points = codec.unpack(checked(data, events, expected), count)
        one, other = (_end_of(end) for end in json.loads(ends))
        codim2 = tuple(_codim2_points(connection, number, codec))
        yield Locus(Kind(kind), first, second, period, tuple(points), codim2, (one, other), str(contact))


def _codim2_points(connection: sqlite3.Connection, locus: int, codec: LocusCodec):
    rows = connection.execute(
        "SELECT kind, contact, data, events, checksum FROM codim2_point WHERE locus = ? ORDER BY number", (locus,)
    )
    for kind, contact, data, events, expected in rows:
        (point,) = codec.unpack(checked(data, events, expected), 1)
        yield Codim2Point(Codim2(kind), point, str(contact))


def _end_of(plain: Any) -> LocusEnd:
    first, second = plain["values"]
    return LocusEnd(LocusEndReason[plain["reason"]], (float(first), float(second)), str(plain["detail"]))
