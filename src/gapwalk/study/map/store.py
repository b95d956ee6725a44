"""The store of a map: writes each section and each locus when it is accepted, whole, in one transaction."""

from __future__ import annotations

import json
import sqlite3

from gapwalk.bifurcation.locus import Locus, LocusEnd
from gapwalk.study.map.chart import Map, Section
from gapwalk.study.map.codec import LocusCodec
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.database import checksum
from gapwalk.study.store.result_file import ResultFile
from gapwalk.study.store.rows import BranchRow, write_about, write_whole_branch


class MapStore:
    """Writes the result file of a map that is being computed.

    Parameters
    ----------
    file
        The file.
    known
        What it has already.
    """

    def __init__(self, file: ResultFile, known: Map) -> None:
        self.file = file
        self._branches, self._loci = len(known.branches), len(known.loci)

    def add(self, chart: Map, addition: Section | Locus) -> None:
        """Write the section or the locus that was added to a map last.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """

        def fill(connection: sqlite3.Connection) -> None:
            if isinstance(addition, Section):
                self._write_section(connection, chart, addition)
            else:
                self._write_locus(connection, addition)
            _write_state(connection, chart, finished=False)

        self.file.write(fill)
        self._branches, self._loci = len(chart.branches), len(chart.loci)

    def finish(self, chart: Map, *, finished: bool) -> None:
        """Write what is known of the map as a whole, and whether nothing is left to do. Errors as `add`."""
        self.file.write(lambda connection: _write_state(connection, chart, finished))

    def _write_section(self, connection: sqlite3.Connection, chart: Map, section: Section) -> None:
        system = self.file.study.system.at({chart.second: section.value})
        for number, (name, branch) in enumerate(section.named, start=self._branches + 1):
            unknowns, balanced = len(branch.points[0].x), self.file.study.walked.balanced
            codec = PointCodec(system, chart.first, branch.period, unknowns, balanced=balanced)
            write_whole_branch(connection, BranchRow(number, name, codec, ends=branch.ends), branch)

    def _write_locus(self, connection: sqlite3.Connection, locus: Locus) -> None:
        number, unknowns = self._loci + 1, len(locus.points[0].x)
        study = self.file.study
        plane = (study.system, locus.first, locus.second)
        codec = LocusCodec(*plane, locus.period, unknowns, balanced=study.walked.balanced)
        packed = codec.pack(locus.points)
        ends = json.dumps([_plain_end(end) for end in locus.ends])
        about = (number, locus.kind.value, locus.period, locus.contact, unknowns, ends, len(locus.points))
        connection.execute(
            "INSERT INTO locus VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", (*about, *packed, checksum(packed))
        )
        for place, codim2 in enumerate(locus.codim2_points):
            packed = codec.pack([codim2.point])
            about = (number, place, codim2.kind.value, *codim2.values, codim2.contact)
            connection.execute(
                "INSERT INTO codim2_point VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", (*about, *packed, checksum(packed))
            )


def _plain_end(end: LocusEnd) -> dict[str, object]:
    return {"reason": end.reason.name, "values": list(end.values), "detail": end.detail}


def _write_state(connection: sqlite3.Connection, chart: Map, finished: bool) -> None:
    state = {
        "finished": finished,
        "complete": chart.complete,
        "tried": chart.tried,
        "loci": len(chart.loci),
        "sections": [{"value": section.value, "branches": len(section.branches)} for section in chart.sections],
        "notes": list(chart.notes),
        "failures": list(chart.failures),
    }
    write_about(connection, "map", state)
