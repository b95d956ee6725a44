"""The store of a diagram: writes each branch when it is accepted, whole, in one transaction."""

from __future__ import annotations

import os
import sqlite3
from types import TracebackType

from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.study.codec import PointCodec
from gapwalk.study.database import close_whole, open_to_write
from gapwalk.study.file import Study
from gapwalk.study.rows import (
    BranchRow,
    begin_file,
    transaction,
    write_about,
    write_branch,
    write_points,
    write_special_points,
)


class DiagramStore:
    """The result file of a diagram that is being computed; it is made when the first branch comes.

    Parameters
    ----------
    path
        The file.
    study
        The study.
    versions
        Versions of everything that has computed the result.
    count
        Branches that the file has already; 0 if it is to be made, over an earlier one.
    """

    def __init__(self, path: str | os.PathLike[str], study: Study, versions: dict[str, str], count: int = 0) -> None:
        self.path, self.study, self.versions, self.count = path, study, versions, count
        self._connection: sqlite3.Connection | None = None
        if count:
            self._connection = open_to_write(path)
            with transaction(path, self._connection):
                write_about(self._connection, "versions", versions)

    def add(self, diagram: Diagram, limb: Limb) -> None:
        """Write the branch that was added to a diagram last.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        number = self.count + 1
        if self._connection is None:
            begin_file(
                self.path, self.study, self.versions, lambda connection: self._write(connection, diagram, limb, number)
            )
            self._connection = open_to_write(self.path)
        else:
            with transaction(self.path, self._connection):
                self._write(self._connection, diagram, limb, number)
        self.count = number

    def finish(self, diagram: Diagram, *, finished: bool) -> None:
        """Write what is known of the diagram as a whole, and whether nothing is left to do. Errors as `add`."""
        if self._connection is not None:
            with transaction(self.path, self._connection):
                _write_state(self._connection, diagram, finished)

    def close(self) -> None:
        """Close the file; it is then one file again."""
        if self._connection is not None:
            close_whole(self.path, self._connection)

    def __enter__(self) -> DiagramStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, connection: sqlite3.Connection, diagram: Diagram, limb: Limb, number: int) -> None:
        branch = limb.branch
        codec = PointCodec(self.study.system, branch.parameter, branch.period, len(branch.points[0].x))
        row = BranchRow(number, limb.name, codec, begins=limb.begins, joins=limb.joins, ends=branch.ends)
        write_branch(connection, row, branch.parameter)
        write_points(connection, number, codec, branch.points, 0)
        write_special_points(connection, number, codec, branch.special_points, 0)
        _write_state(connection, diagram, finished=False)


def _write_state(connection: sqlite3.Connection, diagram: Diagram, finished: bool) -> None:
    state = {"finished": finished, "complete": diagram.complete, "notes": list(diagram.notes)}
    write_about(connection, "diagram", state)
