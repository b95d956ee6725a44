"""What a result file answers: a study, or the call of a function that keeps its result in a file."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any, ClassVar

from gapwalk.model.system import System
from gapwalk.results.codec import Column, OneOf, column_of, register
from gapwalk.results.differences import check_same
from gapwalk.results.result_file import Entry, Part, Parts, ResultFile, lock, reading
from gapwalk.results.versions import versions

# Each is loaded only when a file holds it: a frequency response need not wait for the code of basins.
_HOMES = {
    "study": "file.Study",
    "sweep": "sweep.call.SweepCall",
    "basins": "basins.call.BasinsCall",
    "regimes": "regimes.call.RegimesCall",
    "family": "family.call.FamilyCall",
}


class Request:
    """What a result file answers."""

    asks: ClassVar[str]
    """What tells it from other requests."""

    system: System


class Call(Request):
    """The arguments of a function that keeps its result in a file."""

    @abstractmethod
    def found(self, parts: Parts) -> Any:
        """What the function returned, from the parts of its file."""


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

Output = str | os.PathLike[str] | Keeper | None
"""Where a function keeps its result: a file by name, the open file of a study, or nowhere."""


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
def call_file(call: Call, output: Output) -> Iterator[Keeper]:
    """The file in which a function keeps what it finds; if it holds a part of the same call already, it is continued.

    Raises
    ------
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    """
    if isinstance(output, ResultFile | NoFile):
        yield output
        return
    if output is None:
        yield NoFile()
        return
    with lock(output):
        before = None
        if os.path.exists(output) and os.path.getsize(output):
            with reading(output) as parts:
                check_same(os.fspath(output), call, parts.one(REQUEST))
                before = parts.one(VERSIONS)
        with request_file(call, output, before) as file:
            yield file


def _column_of(asks: str) -> Column:
    module, _, name = _HOMES[asks].rpartition(".")
    return column_of(getattr(import_module(f"gapwalk.studies.{module}"), name))


register(Request, OneOf(lambda value: value.asks if isinstance(value, Request) else None, _column_of))
