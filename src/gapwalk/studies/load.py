"""What a result file holds, read back: what the call returned that wrote it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

from gapwalk.errors import StoreError
from gapwalk.results.faults import undamaged
from gapwalk.results.result_file import Part, Parts, reading
from gapwalk.results.versions import check_not_newer
from gapwalk.studies.file import Study
from gapwalk.studies.jobs import JOBS, job_of
from gapwalk.studies.reduced.full_check import FullCheck
from gapwalk.studies.request import REQUEST, VERSIONS, Call
from gapwalk.studies.result import Result
from gapwalk.verification import Verification

CHECKS = Part("checks", tuple[FullCheck, ...])
VERIFICATION = Part("verification", Verification)

# Each is loaded only when it is asked for.
_READERS = {
    "response": "response.read_response",
    "diagram": "diagram.study.read_diagram",
    "map": "map.study.read_map",
    "locus": "map.study.read_map",
}


def load(path: str | os.PathLike[str]) -> Any:
    """Load what a call has written: a study that was run, a sweep, basins, a regime map, a family.

    A run may still be writing the file, or may have been killed: then it is what has been found so far.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Result, Sweep, Basins, Regimes or Family
        What `gapwalk.run` returned, or `gapwalk.sweep`, `gapwalk.basins`, `gapwalk.regimes`, `gapwalk.family` with
        ``output=``.

    Raises
    ------
    StoreError
        If there is no such file, it is no result, it comes from another version, it is damaged, or it holds nothing
        that can be returned yet.

    Examples
    --------
    >>> result = gw.load("clutch.gapwalk")
    >>> result.branches[0]
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
    """What the parts of a file make together; errors as `load`."""
    versions = parts.one(VERSIONS)
    try:
        request = parts.one(REQUEST)
        parts.base = request.system
        with undamaged(parts.path):
            if isinstance(request, Call):
                return request.found(parts)
            result = _reader_of(request.options.kind)(request, parts)
            checks, verification = parts.get(CHECKS) or (), parts.get(VERIFICATION)
            return replace(result, versions=versions, checks=checks, verification=verification)
    except StoreError:
        check_not_newer(parts.path, versions.get("gapwalk", ""))
        raise


def _reader_of(kind: str) -> Callable[[Study, Parts], Result]:
    """Reads the result of a kind of study from the parts of its file; the versions are added later."""
    if kind in JOBS:

        def read_job(study: Study, parts: Parts) -> Result:
            finding = job_of(kind).read(study, parts)
            return Result(study, (), finding.complete, {}, finding=finding)

        return read_job
    module, _, name = _READERS[kind].rpartition(".")
    return getattr(import_module(f"gapwalk.studies.{module}"), name)
