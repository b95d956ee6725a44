"""Result files of studies and of calls: read them back, and decide whether a run may begin, continue or replace one."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import StoreError
from gapwalk.model.system import System
from gapwalk.results.differences import check_same
from gapwalk.results.faults import undamaged
from gapwalk.results.result_file import (
    Entry,
    Part,
    Parts,
    ResultFile,
    check_place,
    lock,
    looks_like_result,
    reading,
    tidy,
)
from gapwalk.results.versions import check_not_newer, versions
from gapwalk.studies.map import Map
from gapwalk.studies.result import FullCheck, Result
from gapwalk.studies.study_file import Study
from gapwalk.studies.study_kind import StudyKind, Work
from gapwalk.verification import Verification


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


def load(path: str | os.PathLike[str]) -> Any:
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
    >>> gw.load("stop.gapwalk").title
    'A sprung mass with a stop'
    """
    with reading(path) as parts:
        return read(parts)


def load_result(path: str | os.PathLike[str], *, sealed: bool = True) -> Result:
    """Load the result of a study; errors as `load`, also if it is of another kind, or its checksum does not hold."""
    with reading(path, sealed=sealed) as parts:
        found = read(parts)
    if not isinstance(found, Result):
        name = os.fspath(path)
        raise StoreError(
            f"{name} holds {found!r}, and no result of a study; in Python, gapwalk.load({name!r}) returns it"
        )
    return found


def read(parts: Parts) -> Any:
    """Return the result or record that the parts of a file make together; errors as `load`."""
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
    return Result(study, (found,), work.complete, written_by)


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
        now, before = as_before(study, result.study), result.study
        # titles, texts and names change nothing of a result
        before = replace(now, system=before.system, options=before.options)
        check_same(
            name, now, before, "choose another name for the new result (--output), or write over this one (--force)"
        )
        return result
    if not force:
        raise StoreError(
            f"{name} exists already; continue it (--resume), overwrite it (--force), or choose another name (--output)"
        )
    if not looks_like_result(path):
        raise StoreError(f"{name} is not a result file of gapwalk, so it is not overwritten; choose another name")
    return None


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
