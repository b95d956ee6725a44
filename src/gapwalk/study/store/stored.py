"""What a result file holds, read back: the study, and what was found, by its kind."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.bifurcation.search import SearchResult
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.diagram.search_result import search_of
from gapwalk.study.file import Study
from gapwalk.study.finding import Finding
from gapwalk.study.jobs import JOBS, job_of
from gapwalk.study.map.read import StoredMap, read_map
from gapwalk.study.options import BranchOptions, DiagramStudyOptions, MapStudyOptions
from gapwalk.study.reduced.full_check import FullCheck, checks_of
from gapwalk.study.reduced.origin import reduced_of
from gapwalk.study.result import Result
from gapwalk.study.store.database import reading
from gapwalk.study.store.plain import Progress, system_of
from gapwalk.study.store.plain_options import options_of
from gapwalk.study.store.read_rows import Row, branch_rows
from gapwalk.study.store.trust import checked_parts, undamaged
from gapwalk.study.store.versions import check_not_newer
from gapwalk.verification import Verification, verification_of


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


class StoredParts(NamedTuple):
    """All that a result file holds of a study without branches: what was found, and the parts it comes from."""

    finding: Finding | None
    parts: Mapping[int, bytes]


Found = StoredWalk | StoredDiagram | StoredMap | StoredParts
"""What a result file holds beside the study."""


class Stored(NamedTuple):
    """All that a result file holds: the study, what was found, the versions, and what was said of it afterwards."""

    study: Study
    found: Found
    versions: dict[str, str]
    checks: tuple[FullCheck, ...] = ()
    verification: Verification | None = None

    def result(self) -> Result:
        """The same as a user sees it."""
        return replace(self._result(), checks=self.checks, verification=self.verification)

    def _result(self) -> Result:
        if isinstance(self.found, StoredMap):
            chart, finished = self.found
            return Result(self.study, chart.branches, finished, self.versions, map=chart)
        if isinstance(self.found, StoredDiagram):
            diagram, finished = self.found
            return Result(self.study, diagram.branches, finished, self.versions, diagram)
        if isinstance(self.found, StoredParts):
            finding = self.found.finding
            assert finding is not None  # as it is read from a file
            return Result(self.study, (), finding.complete, self.versions, finding=finding)
        options = self.study.options
        assert isinstance(options, BranchOptions)
        branch = self.found.branch(options.parameter, options.period)
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


def read(path: str | os.PathLike[str], *, sealed: bool = True) -> Stored:
    """Everything in a result file; errors as `load`, also where its checksum does not hold, unless not `sealed`."""
    with reading(path, sealed=sealed) as connection, undamaged(path):
        about = {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM result")}
        try:
            return _read(connection, about)
        except (LookupError, TypeError, ValueError):
            check_not_newer(path, about["versions"]["gapwalk"])
            raise


def _read(connection: sqlite3.Connection, about: dict[str, Any]) -> Stored:
    study = Study(
        system_of(about["system"]),
        options_of(about["study"]),
        str(about["title"]),
        str(about["text"]),
        tuple((str(name), value) for name, value in about["changes"]),
        str(about["name"]),
        reduced_of(about.get("reduction")),
        matrices=str(about.get("matrices", "")),
    )
    found = _found(connection, study, about)
    versions = {str(name): str(version) for name, version in about["versions"].items()}
    verification = verification_of(about["verification"]) if "verification" in about else None
    return Stored(study, found, versions, checks_of(about.get("checks", ())), verification)


def _found(connection: sqlite3.Connection, study: Study, about: dict[str, Any]) -> Found:
    """What there is beside the study, by its kind."""
    options = study.options
    if options.kind in JOBS:
        parts = dict(checked_parts(connection))
        return StoredParts(job_of(options.kind).read(study, parts), parts)
    if isinstance(options, MapStudyOptions):
        return read_map(connection, study.system, options, about["map"])
    assert isinstance(options, BranchOptions)
    rows = list(branch_rows(connection, options, lambda place: study.system))
    if isinstance(options, DiagramStudyOptions) and "search" in about:  # which may have led to nothing new
        return _diagram(options, rows, about["diagram"], search_of(about["search"], study.system))
    if not rows:
        raise ValueError("it holds no branch")
    if isinstance(options, DiagramStudyOptions):
        return _diagram(options, rows, about["diagram"], None)
    return _walk(options, rows)


def _walk(options: BranchOptions, rows: list[Row]) -> StoredWalk:
    (row,) = rows
    if row.codec.period != options.period or (row.ends is not None and len(row.ends) != 2):
        raise ValueError("a branch does not belong to the study")
    return StoredWalk(row.codec.unpack_orbit(row.start), row.points, row.special_points, row.progress, row.ends)


def _diagram(options: DiagramStudyOptions, rows: list[Row], about: Any, search: SearchResult | None) -> StoredDiagram:
    limbs: list[Limb] = []
    for row in rows:
        limb = Limb(row.name, row.branch(), row.begins, row.joins)
        known = {limb.name: len(limb.branch.special_points) for limb in limbs}
        if limb.name in known or any(not 0 <= o.special < known.get(o.parent, 0) for o in limb.origins):
            raise ValueError(f"branch {row.name} has no place in the tree")
        limbs.append(limb)
    low, high = sorted((options.begin, options.end))
    notes, failures = (tuple(str(text) for text in about.get(key, ())) for key in ("notes", "failures"))
    longest = about.get("max_period")
    if longest is not None and not (isinstance(longest, int) and longest >= 1):
        raise ValueError(f"its longest period is {longest!r}")
    whole = (bool(about["complete"]), notes, failures, search, longest)
    diagram = Diagram(options.parameter, (low, high), tuple(limbs), *whole)
    return StoredDiagram(diagram, bool(about["finished"]))
