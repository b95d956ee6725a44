"""Whether a run may write a result file: begin a new one, write over one, continue one, or none of these."""

from __future__ import annotations

import os
from dataclasses import replace

from gapwalk.errors import StoreError
from gapwalk.results.differences import check_same
from gapwalk.results.result_file import check_place, looks_like_result, tidy
from gapwalk.studies.file import Study
from gapwalk.studies.load import load_result
from gapwalk.studies.reduced.before import as_before
from gapwalk.studies.result import Result


def earlier_result(path: str | os.PathLike[str] | None, study: Study, *, resume: bool, force: bool) -> Result | None:
    """The result to continue in a file; None if there is none, or it is to be written over.

    Raises
    ------
    StoreError
        If there is a file, and it is neither to be resumed nor to be written over, or cannot be.
    """
    if path is None:
        return None
    result = check_claim(path, study, resume=resume, force=force)
    if result is not None:
        tidy(path)
    return result


def check_claim(path: str | os.PathLike[str], study: Study, *, resume: bool, force: bool) -> Result | None:
    """The same as `earlier_result`, without a change to any file."""
    name = os.fspath(path)
    if resume and force:
        raise StoreError(f"{name} can be resumed or written over, not both; leave out one of resume and force")
    if not os.path.lexists(name):
        return None
    check_place(path)
    if resume:
        result = load_result(path)
        _check_same(name, study, result.study)
        return result
    if not force:
        raise StoreError(
            f"{name} exists already; go on with it (--resume), write over it (--force), or choose another name "
            "(--output)"
        )
    if not looks_like_result(path):
        raise StoreError(f"{name} is no result file of gapwalk, so it is not written over; choose another name")
    return None


def _check_same(name: str, study: Study, stored: Study) -> None:
    """Refuse to resume another study; titles, texts and names change nothing of a result."""
    study = as_before(study, stored)
    before = replace(study, system=stored.system, options=stored.options)
    check_same(
        name, study, before, "choose another name for the new result (--output), or write over this one (--force)"
    )
