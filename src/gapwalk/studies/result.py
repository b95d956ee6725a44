"""The result of a study, as it comes from a run or from a result file."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.band import band_rows, graze_words
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram, Origin
from gapwalk.bifurcation.isolated import SearchResult, coverage
from gapwalk.bifurcation.special_point import in_runs, words_of
from gapwalk.continuation.curve_points import motion_row, point_row
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import StoreError
from gapwalk.flow.motion import signal_names
from gapwalk.model.system import System
from gapwalk.model.words import measure_symbol, parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import parameter_headings
from gapwalk.results.codec import parameters_of, plain
from gapwalk.results.result_file import (
    Entry,
    Part,
    Parts,
    ResultFile,
    check_not_newer,
    check_place,
    check_same,
    differences,
    lock,
    looks_like_result,
    reading,
    tidy,
    undamaged,
    versions,
)
from gapwalk.studies.bifurcation_map import Map, codim2_rows, locus_rows, map_document
from gapwalk.studies.options import COVERAGE, BranchOptions, coverage_rows, method_names, special_rows, table_rows
from gapwalk.studies.study_file import Study
from gapwalk.studies.study_kind import Finding, StudyKind, Work
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, rows_of, summarizes
from gapwalk.verification import Verification


@dataclass(frozen=True)
class FullCheck:
    """Distance of a branch of the reduced system from that of the full system."""

    branch: str  #: Its name.
    #: Estimated error of the parameter value of each special point, in their order; inf where none was found near by in
    #: the full system.
    errors: tuple[float, ...]
    motion: float  #: Largest estimated error of a motion, relative to its size.
    harmonics: int  #: Harmonics with which it was checked; 0 if that failed.
    detail: str = ""  #: Reason for its failure.

    @property
    def words(self) -> str:
        """The comparison in words."""
        if self.detail:
            return f"{self.branch} could not be compared with the full system: {self.detail}"
        known = [error for error in self.errors if math.isfinite(error)]
        texts = ["it has no special points"]
        if self.errors:
            within = f", and differ by {max(known):.1e} at most" if known else ""
            texts = [f"{len(known)} of its {len(self.errors)} special points exist there{within}"]
        texts.append(
            f"motions differ by {self.motion:.1e} of their size at most"
            if math.isfinite(self.motion)
            else "some of its motions do not exist in the full system: the reduced system has too few modes"
        )
        return f"{self.branch} compared with the full system, by {self.harmonics} harmonics: {'; '.join(texts)}"


@dataclass(frozen=True, eq=False)
class Result(Shown):
    """Result of a study.

    Examples
    --------
    >>> result.title, result.complete, sorted(result.tables())
    ('A sprung mass with a stop', True, ['points', 'special-points'])
    """

    study: Study  #: The request.
    branches: tuple[Branch, ...]  #: The branches that were found.
    complete: bool  #: True if the work is finished; False after an interruption, from which a run can be resumed.
    versions: Mapping[str, str]  #: Versions of gapwalk, llvmlite, numba, numpy and python that computed it.
    diagram: Diagram | None = None  #: The branches as a tree, if the study is of the kind diagram.
    map: Map | None = None  #: The loci, if the study is of the kind map; the branches are those of its sections.
    #: The finding, if the study is of the kind family, settle, sweep, basins or regimes; its `record` is what the
    #: Python function of that name returns. Of a settled motion it is a `SettleFinding`, with the attractor too. There
    #: are no `branches` then: those of a family belong to its members.
    finding: Finding | None = None
    #: Comparison of each branch with the full system, if the system is reduced (see `Study.reduced`).
    checks: tuple[FullCheck, ...] = ()
    verification: Verification | None = None  #: Result of the verification, if the study requests one.

    @property
    def title(self) -> str:
        """Title of the study; may be empty."""
        return self.study.title

    @property
    def system(self) -> System:
        """The system at the beginning of the study."""
        return self.study.system

    @property
    def options(self) -> StudyKind:
        """The options of the study."""
        return self.study.options

    @property
    def walked(self) -> BranchOptions:
        """The options of a study of branches."""
        return self.study.walked

    @property
    def failures(self) -> tuple[str, ...]:
        """Sentences on each walk that failed, and on each change along it that no special point explains.

        They concern whole branches and loci, ends due to numerical failures, and steps in which a special point was
        missed.
        """
        if self.finding is not None:
            return self.finding.failures
        tree = self.diagram is not None or self.map is not None
        found = [f"{name}: {end}" if tree else end for name, branch in self.named for end in branch.failures]
        found += [
            f"{name}: {each}" if tree else str(each) for name, branch in self.named for each in branch.unexplained
        ]
        if self.map is not None:
            loci = zip(self.map.names, self.map.loci, strict=True)
            found += [f"{name}: {end}" for name, locus in loci for end in locus.ends if end.reason.is_failure]
        parts = [part for part in (self.diagram, self.map) if part is not None]
        return (*found, *(text for part in parts for text in part.failures))

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C ended the work; a run with `resume` continues it."""
        if self.finding is not None or self.diagram is not None or self.map is not None:
            return not self.complete
        return any(end.reason is EndReason.INTERRUPTED for branch in self.branches for end in branch.ends)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the branches, such as ``P2-3``; on the sections of a map, such as ``S1-P2-3``."""
        if self.map is not None:
            sections = enumerate(self.map.sections, start=1)
            return tuple(f"S{number}-{name}" for number, section in sections for name, _ in section.named)
        if self.diagram is not None:
            return tuple(member.name for member in self.diagram.members)
        return tuple(f"P{branch.period}-{number}" for number, branch in enumerate(self.branches, start=1))

    @summarizes
    def summary(self, points: bool = True) -> SummaryParts:
        """Return the result as the terminal shows it: lines of text, tables, and the tree of a diagram.

        Parameters
        ----------
        points
            True to include the special points of a diagram or a map.
        """
        if self.study.reduced is not None:
            yield self.study.reduced.words
        yield from (check.words for check in self.checks)
        if self.verification is not None:
            yield self.verification.words
        if self.finding is not None:
            if not self.finding.complete:
                yield self.finding.stored
            if self.finding.record is not None:
                yield from self.finding.summary()
            yield from remarks(self.finding.notes, self.finding.failures)
            return
        curves = (*self.branches, *(self.map.loci if self.map else ()))
        if words := self.walked.method.words([point.orbit for curve in curves for point in curve.points]):
            yield words
        if self.map is not None:
            yield from self._missed()
            yield from self.map.summary(self.walked.measure if points else None)
            return
        yield from self.diagram.summary() if self.diagram is not None else ()
        for branch in self.branches if self.diagram is None else ():
            yield from branch.summary(points=False)
        if self.diagram is None or points:
            yield from self._missed()
            any_special = any(branch.special_points for branch in self.branches)
            yield self.special_points() if any_special else "no special points"

    def _missed(self) -> Iterator[str]:
        """Return the steps of branches in which a special point was missed, in sentences."""
        for name, branch in self.named:
            symbol = parameter_symbol(branch.parameter, branch.system.units)
            yield from (f"not explained: {name}, {symbol} {each}" for each in branch.unexplained)

    def special_points(self) -> Table:
        """Return the table of the special points of all branches, rounded for reading."""
        units, diagram, measure = self.system.units, self.diagram, shown_measure(self.system, self.walked)
        numbers = (parameter_symbol(self.walked.parameter, units), "±", measure_symbol(measure, units))
        headings = ["kind", *(f">{each}" for each in (*numbers, "multiplier"))]
        headings += ["unstable" if diagram else "stability", "criticality or contact"]
        rows, groups = [], []
        for name, branch in self.named:
            for group in in_runs(branch.special_points):
                special, words = group[0], words_of(group)
                index = branch.special_points.index(special)
                counts = dict.fromkeys(str(side.total) for side in (special.before, group[-1].after))
                row = [
                    *(words["kind"], words["at"], words["±"]),
                    f"{special.point.measure(measure):#.8g}" if words["±"] or not group[1:] else "",
                    words["multiplier"],
                    " → ".join(counts) if diagram else words["stability"],  # that of a diagram is wide enough as it is
                    ": ".join(filter(None, (words["contact"], words["criticality"].removesuffix(" values")))),
                ]
                if diagram:
                    leads_to = " ".join(member.name for member in diagram.attached(name, index))
                    row = [name if index == 0 else "", *row, leads_to]
                rows.append(row)
            groups.append(len(rows) - 1)
        return Table(["branch", *headings, "leads to"] if diagram else headings, rows, groups)

    def tables(self) -> Tables:
        """Return the tables of the result by name; `gapwalk.save_tables` writes them.

        ``points`` and ``special-points`` belong to its branches. Of a map they belong to its loci, and ``sections`` has
        the points of its branches. What a search for a diagram has covered is in ``search``. A study without branches
        has tables of its own.

        A row of a point has number and name of its branch, period, parameter (on the sections of a map, both),
        stability, contacts; maximum, minimum, half the peak to peak, mean and rms of each coordinate; by harmonic
        balance, the number of harmonics and the truncation error; the state at theta = 0; modulus and argument (in
        radians) of the multipliers. A row of a special point has the critical multiplier, empty at a grazing point,
        ``contact`` for what grazes there, and ``leads.to`` for the branches of a diagram that begin or end there.
        """
        if self.finding is not None:
            return self.finding.tables()
        parameter, chart, system = self.walked.parameter, self.map, self.system
        if chart is not None:
            methods = method_names(self.walked)
            parameters = (parameter, chart.second)
            return {
                "points": partial(locus_rows, chart, system, methods),
                "special-points": partial(codim2_rows, chart, system.coordinates, methods),
                "sections": lambda: table_rows(self._point_rows(), *parameters, system=system),
            }
        tables: dict[str, Callable[[], Rows]] = {
            "points": lambda: table_rows(self._point_rows(), parameter, system=system),
            "special-points": lambda: table_rows(
                special_rows(self.named, self.diagram, self._measure), parameter, system=system
            ),
        }
        if bands := [band for branch in self.branches for band in branch.bands]:
            (heading,) = parameter_headings([parameter], system.coordinates)
            tables["bands"] = lambda: rows_of(band_rows(bands, heading, system))
        search = None if self.diagram is None else self.diagram.search
        return tables if search is None else {**tables, "search": lambda: [COVERAGE, *coverage_rows(search)]}

    def _point_rows(self) -> Iterator[dict[str, Any]]:
        chart = self.map
        second = [] if chart is None else [section.value for section in chart.sections for _ in section.branches]
        for number, (name, branch) in enumerate(self.named, start=1):
            about = {"branch": number, "name": name, "period": branch.period, "parameter": 0.0}
            about |= {"second": second[number - 1]} if second else {}
            for point in branch.points:
                yield {**about, **point_row(point, self._measure), "motion": motion_row(point.orbit)}

    @property
    def _measure(self) -> str:
        """The measure that its study asks for."""
        return shown_measure(self.system, self.walked)

    @property
    def named(self) -> Iterable[tuple[str, Branch]]:
        """The branches with their names."""
        return zip(self.names, self.branches, strict=True)

    def to_dict(self, points: bool = True) -> dict[str, Any]:
        """Return the result as plain JSON values, as the commands print it with ``--json``.

        Parameters
        ----------
        points
            True to include each point of each branch, and not only the special points.

        Returns
        -------
        dict
            Title, parameters and versions; branches, their ends and special points; or, of a study without branches,
            what it has found. Values that do not exist are None.
        """
        return result_document(self, points)

    def __repr__(self) -> str:
        state = "complete" if self.complete else "incomplete"
        if self.finding is not None:
            found = self.finding.stored if self.finding.record is None else repr(self.finding.record)
            return f"Result({self.title!r}, {state}, {found})"
        parts = [part for part in (self.diagram, self.map) if part is not None] or self.branches
        return f"Result({self.title!r}, {state}, {', '.join(map(repr, parts))})"


# A result as plain JSON values, for other programs.


def result_document(result: Result, points: bool = True) -> dict[str, Any]:
    """Return a result: branches, their points (if wanted), ends, and the special points of all branches."""
    # The finding of a study without branches has a document of its own kind.
    head: dict[str, Any] = {
        "title": result.title,
        "name": result.study.name or None,
        "kind": result.options.kind,
        "complete": result.complete,
        "versions": dict(result.versions),
        "parameters": parameters_of(result.system),
    }
    if (units := result.system.units) is not None:
        head["units"] = {name: unit for name in result.system.structure.names if (unit := units.parameter(name))}
        head["units"] |= {name: units.signal(name)[1] for name in signal_names(result.system)}
    if result.study.reduced is not None:
        head["reduction"] = plain(result.study.reduced)
        head["checks"] = plain(result.checks)
    if result.finding is not None:
        finding = result.finding
        told = {"notes": list(finding.notes), "failures": list(finding.failures)}
        return head | finding.document(points) | told
    document = {
        **head,
        "method": plain(result.walked.method),
        "branches": [
            branch_document(branch, number, points, result._measure)
            for number, branch in enumerate(result.branches, start=1)
        ],
        "special_points": special_documents(result.named, result.diagram),
    }
    for branch, name in zip(document["branches"], result.names, strict=True):
        branch["name"] = name
    if result.verification is not None:
        document["verification"] = result.verification.document()
    if result.map is not None:
        values = [section.value for section in result.map.sections for _ in section.branches]
        for branch, value in zip(document["branches"], values, strict=True):
            branch["section"] = value
        document |= map_document(result.map, points)
    return document if result.diagram is None else document | _tree_document(result.diagram, document["branches"])


def branch_document(branch: Branch, number: int, points: bool = True, measure: str = "") -> dict[str, Any]:
    """Return one branch, numbered from 1; a special point refers to it by that number."""
    document: dict[str, Any] = {
        "id": number,
        "period": branch.period,
        "parameter": branch.parameter,
        "ends": [end_document(end) for end in branch.ends],
        "unexplained": [{"first": each.first, "last": each.last, "text": each.text} for each in branch.unexplained],
        "count": len(branch.points),
    }
    if points:
        document["points"] = [plain(point_row(point, measure)) for point in branch.points]
    if branch.bands:
        document["grazes"] = [text.strip() for text in graze_words(branch.bands, branch.parameter, branch.system)]
        if points:
            document["bands"] = [plain(row) for row in band_rows(branch.bands, "parameter", branch.system)]
    return document


def _tree_document(diagram: Diagram, branches: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the additional parts of the document of a diagram: connections of branches, cascades, and the search."""
    for member, document in zip(diagram.members, branches, strict=True):
        document["begins"], document["joins"] = _origin(member.begins), _origin(member.joins)
    return {
        "branches": branches,
        "cascades": [
            {"branches": list(cascade.members), "values": list(cascade.values), "ratios": list(cascade.ratios)}
            for cascade in diagram.cascades
        ],
        "search": None if diagram.search is None else search_document(diagram.search),
        "notes": list(diagram.notes),
        "failures": list(diagram.failures),
    }


def search_document(result: SearchResult) -> dict[str, Any]:
    """Return the coverage of a search: numbers for each value of the parameter, and sentences."""
    return {
        "complete": result.complete,
        "values": [dict(zip(COVERAGE, row, strict=True)) for row in coverage_rows(result)],
        "coverage": list(coverage(result)),
    }


def _origin(origin: Origin | None) -> dict[str, Any] | None:
    """Return where a branch begins or ends: the name of another branch, and the index of its special point, from 0."""
    return None if origin is None else {"branch": origin.parent, "special_point": origin.special}


def special_documents(branches: Iterable[tuple[str, Branch]], diagram: Diagram | None = None) -> list[dict[str, Any]]:
    """Return the special points of named branches, in the order of the walks. A value that does not exist is null."""
    return [plain(row) for row in special_rows(branches, diagram)]


def end_document(end: End) -> dict[str, Any]:
    """Return one end of a branch; `reason` is a word for programs, `text` the sentence for people."""
    return {"reason": end.reason.name.lower().replace("_", "-"), "parameter": end.value, "text": str(end)}


# Result files of studies and of calls: read them back, and decide whether a run may begin, continue or replace one.


@dataclass(frozen=True)
class Call:
    """The request of a Python function that writes its result to a file, like that of a study."""

    system: System  #: The system at the beginning of the work.
    options: StudyKind  #: The request: the options of a study, or those of the function.


REQUEST = Part("request", Study | Call)
VERSIONS = Part("versions", Mapping[str, str])
CHECKS = Part("checks", tuple[FullCheck, ...])
VERIFICATION = Part("verification", Verification)


class NoFile:
    """Placeholder for the file of a job that is not stored."""

    path = ""
    is_begun = False

    def known(self, part: Part) -> Iterator[tuple[int, Any]]:
        """No parts."""
        return iter(())

    def count(self, part: Part) -> int:
        """No parts."""
        return 0

    def write(self, *entries: Entry) -> None:
        """Nothing."""

    def __enter__(self) -> NoFile:
        return self

    def __exit__(self, *_: object) -> None:
        pass


Keeper = ResultFile | NoFile
"""File or memory that keeps the parts of a job."""


def request_file(
    request: Study | Call, output: str | os.PathLike[str] | None, before: Mapping[str, str] | None = None
) -> Keeper:
    """Return the file of a request, open for writing."""
    if output is None:
        return NoFile()
    written_by = versions(None if before is None else dict(before))
    return ResultFile(output, REQUEST.entry(request), VERSIONS.entry(written_by), exists=before is not None)


@contextmanager
def claimed(request: Study | Call, output: str | os.PathLike[str] | None) -> Iterator[Mapping[str, str] | None]:
    """Lock the file of a request; yield the versions that wrote it, if it is to be continued."""
    with nullcontext() if output is None else lock(output):
        before = None
        if output is not None and os.path.exists(output) and os.path.getsize(output):
            with reading(output) as parts:
                check_same(os.fspath(output), request, parts.one(REQUEST))
                before = parts.one(VERSIONS)
        yield before


def open_result(path: str | os.PathLike[str]) -> Any:
    """Load what a call has written: a study that was run, a sweep, basins, a regime map, a family.

    If a run is still writing the file, or was killed, the result is incomplete.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Result, Sweep, Basins, Regimes or Family
        The record that `gapwalk.run` returned, or `gapwalk.sweep`, `gapwalk.basins`, `gapwalk.regimes`,
        `gapwalk.family` with ``output=``.

    Raises
    ------
    StoreError
        If there is no such file, it is not a result, it comes from another version, it is damaged, or it holds nothing
        that can be returned yet.

    Examples
    --------
    >>> gw.run(study, "stop.gapwalk", force=True).complete
    True
    >>> gw.open_result("stop.gapwalk").title
    'A sprung mass with a stop'
    """
    with reading(path) as parts:
        return read(parts)


def load_result(path: str | os.PathLike[str], *, sealed: bool = True) -> Result:
    """Load the result of a study; errors as `open_result`, also if it is of another kind, or its checksum is wrong."""
    with reading(path, sealed=sealed) as parts:
        found = read(parts)
    if not isinstance(found, Result):
        name = os.fspath(path)
        raise StoreError(
            f"{name} holds {found!r}, and no result of a study; in Python, gapwalk.open_result({name!r}) returns it"
        )
    return found


def read(parts: Parts) -> Any:
    """Return the result or record that the parts of a file make together; errors as `open_result`."""
    written_by = parts.one(VERSIONS)
    try:
        request = parts.one(REQUEST)
        parts.base = request.system
        with undamaged(parts.path):
            work = request.options.work(request.system)
            work.take(parts)
            if isinstance(request, Call):
                return _record_of(request, work, parts)
            result = result_of(request, work, {})
            checks, verification = parts.get(CHECKS) or (), parts.get(VERIFICATION)
            return replace(result, versions=written_by, checks=checks, verification=verification)
    except StoreError:
        check_not_newer(parts.path, written_by.get("gapwalk", ""))
        raise


def result_of(study: Study, work: Work, written_by: Mapping[str, str]) -> Result:
    """Return the result of a study so far."""
    if (finding := work.finding()) is not None:
        return Result(study, (), work.complete, written_by, finding=finding)
    found: Branch | Diagram | Map = work.record
    match found:
        case Diagram():
            return Result(study, found.branches, work.complete, written_by, diagram=found)
        case Map():
            return Result(study, found.branches, work.complete, written_by, map=found)
    return Result(study, (found, *found.beyond), work.complete, written_by)


def _record_of(call: Call, work: Work, parts: Parts) -> Any:
    """Return the record of a function so far; raise a StoreError if there is none yet."""
    finding = work.finding()
    if finding is not None and finding.record is None:
        name, kind = os.fspath(parts.path), call.options.kind
        raise StoreError(
            f"{name} is not complete: {finding.stored}; continue it by gapwalk.{kind}(..., output={name!r}) with the "
            "same arguments as before"
        )
    return work.record


def earlier_result(path: str | os.PathLike[str] | None, study: Study, *, resume: bool, force: bool) -> Result | None:
    """Return the result to continue in a file; None if there is none, or if it is to be overwritten."""
    if path is None:
        return None
    result = check_claim(path, study, resume=resume, force=force)
    if result is not None:
        tidy(path)
    return result


def check_claim(path: str | os.PathLike[str], study: Study, *, resume: bool, force: bool) -> Result | None:
    """Check as `earlier_result`, without a change to any file."""
    name = os.fspath(path)
    if resume and force:
        raise StoreError(f"{name} can be resumed or overwritten, not both; leave out one of resume and force")
    if not os.path.lexists(name):
        return None
    check_place(path)
    if resume:
        result = load_result(path)
        advice = "choose another name for the new result (--output), or write over this one (--force)"
        check_same(name, *_compared(study, result.study), advice)
        return result
    if not force:
        raise StoreError(
            f"{name} exists already; continue it (--resume), overwrite it (--force), or choose another name (--output)"
        )
    if not looks_like_result(path):
        raise StoreError(f"{name} is not a result file of gapwalk, so it is not overwritten; choose another name")
    return None


def is_another(path: str | os.PathLike[str], study: Study) -> bool:
    """Return True if a file has the result of another study; errors as `load_result`."""
    return any(differences(*_compared(study, load_result(path).study)))


def _compared(study: Study, stored: Study) -> tuple[Study, Study]:
    """Return a study and a stored one without titles, texts and names, which change nothing of a result."""
    now = as_before(study, stored)
    return now, replace(now, system=stored.system, options=stored.options)


_ROUNDING = 1e-9  # of a value, relative to the largest there is


def as_before(study: Study, stored: Study) -> Study:
    """Return the study with the system of a stored one, if both are reduced and the systems differ by rounding alone.

    A resumed walk is the same bit for bit only with exactly the numbers with which it began.
    """
    if study.reduced is None or stored.reduced is None or study.system.structure != stored.system.structure:
        return study
    now, then = study.system.values, stored.system.values
    if np.abs(now - then).max() > _ROUNDING * np.abs(then).max():
        return study
    return replace(study, system=stored.system)
