"""The store of a diagram: writes each branch when it is accepted, whole, in one transaction."""

from __future__ import annotations

import sqlite3

from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.bifurcation.search import SearchResult
from gapwalk.study.diagram.search_result import plain_search
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.result_file import ResultFile
from gapwalk.study.store.rows import BranchRow, write_about, write_whole_branch


class DiagramStore:
    """Writes the result file of a diagram that is being computed.

    Parameters
    ----------
    file
        The file.
    count
        Branches that it has already.
    """

    def __init__(self, file: ResultFile, count: int = 0) -> None:
        self.file, self.count = file, count
        self._search: SearchResult | None = None

    def add(self, diagram: Diagram, limb: Limb) -> None:
        """Write the branch that was added to a diagram last.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """

        def fill(connection: sqlite3.Connection) -> None:
            branch, number = limb.branch, self.count + 1
            study, unknowns = self.file.study, len(branch.points[0].x)
            balanced = study.walked.balanced
            codec = PointCodec(study.system, branch.parameter, branch.period, unknowns, balanced=balanced)
            row = BranchRow(number, limb.name, codec, begins=limb.begins, joins=limb.joins, ends=branch.ends)
            write_whole_branch(connection, row, branch)
            self._write_state(connection, diagram, finished=False)

        self.file.write(fill)
        self.count += 1
        self._search = diagram.search

    def finish(self, diagram: Diagram, *, finished: bool) -> None:
        """Write what is known of the diagram as a whole, and whether nothing is left to do. Errors as `add`."""
        self.file.write(lambda connection: self._write_state(connection, diagram, finished))

    def _write_state(self, connection: sqlite3.Connection, diagram: Diagram, finished: bool) -> None:
        """Write what is known of the diagram as a whole; its search only when it is new, for it may be long."""
        state = {
            "finished": finished,
            "complete": diagram.complete,
            "notes": list(diagram.notes),
            "failures": list(diagram.failures),
            "max_period": diagram.max_period,
        }
        write_about(connection, "diagram", state)
        if diagram.search is not None and diagram.search is not self._search:
            write_about(connection, "search", plain_search(diagram.search))
