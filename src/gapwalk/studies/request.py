"""What a result file answers: a study, or the call of a function that keeps its result in a file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

from gapwalk.model.system import System
from gapwalk.results.codec import Column, OneOf, column_of, register
from gapwalk.results.differences import check_same
from gapwalk.results.result_file import Entry, Part, ResultFile, lock, reading
from gapwalk.results.versions import versions
from gapwalk.studies.kind import StudyKind

# Each is loaded only when a file holds it.
_HOMES = {
    "study": "study_file.Study",
    "call": "request.Call",
}


class Request:
    """What a result file answers."""

    asks: ClassVar[str]
    """What tells it from other requests."""

    system: System


@dataclass(frozen=True)
class Call(Request):
    """The call of a Python function that keeps its result in a file: it asks for what a study asks for.

    Attributes
    ----------
    system
        The system, as at the beginning of such a study.
    options
        What is asked for.
    """

    asks: ClassVar[str] = "call"

    system: System
    options: StudyKind


REQUEST = Part("request", Request)
VERSIONS = Part("versions", Mapping[str, str])


class NoFile:
    """Stands for the file of a job that keeps nothing."""

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
"""What keeps the parts of a job."""


def request_file(
    request: Request, output: str | os.PathLike[str] | None, before: Mapping[str, str] | None = None
) -> Keeper:
    """The file of a request, open for writing.

    Parameters
    ----------
    request
        The request.
    output
        Its name; None for no file.
    before
        The versions that wrote the file that is there, which is then continued; otherwise a new one replaces it.
    """
    if output is None:
        return NoFile()
    written_by = versions(None if before is None else dict(before))
    return ResultFile(output, REQUEST.entry(request), VERSIONS.entry(written_by), exists=before is not None)


@contextmanager
def claimed(request: Request, output: str | os.PathLike[str] | None) -> Iterator[Mapping[str, str] | None]:
    """Keep other writers off the file of a request for a while; the versions that wrote it, if it is to be continued.

    Raises
    ------
    StoreError
        If the file is of something else, or is being written by another run.
    """
    with nullcontext() if output is None else lock(output):
        before = None
        if output is not None and os.path.exists(output) and os.path.getsize(output):
            with reading(output) as parts:
                check_same(os.fspath(output), request, parts.one(REQUEST))
                before = parts.one(VERSIONS)
        yield before


def _column_of(asks: str) -> Column:
    module, _, name = _HOMES[asks].rpartition(".")
    return column_of(getattr(import_module(f"gapwalk.studies.{module}"), name))


register(Request, OneOf(lambda value: value.asks if isinstance(value, Request) else None, _column_of))
