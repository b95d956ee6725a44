"""Whether a run may write a result file: begin a new one, write over one, go on with one, or none of these."""

from __future__ import annotations

import os
from dataclasses import fields

import numpy as np

from gapwalk.errors import StoreError
from gapwalk.study.file import Study
from gapwalk.study.reduced.before import as_before
from gapwalk.study.store.database import APPLICATION, check_place, explained, tidy
from gapwalk.study.store.stored import Stored, read


def earlier_result(path: str | os.PathLike[str], study: Study, *, resume: bool, force: bool) -> Stored | None:
    """What there is to go on with in a result file; None if there is none, or it is to be written over.

    Raises
    ------
    StoreError
        If there is a file, and it is neither to be resumed nor to be written over, or cannot be.
    """
    stored = check_claim(path, study, resume=resume, force=force)
    if stored is not None:
        tidy(path)
    return stored


def check_claim(path: str | os.PathLike[str], study: Study, *, resume: bool, force: bool) -> Stored | None:
    """The same as `earlier_result`, without a change to any file."""
    name = os.fspath(path)
    if resume and force:
        raise StoreError(f"{name} can be resumed or written over, not both; leave out one of resume and force")
    if not os.path.lexists(name):
        return None
    check_place(path)
    if resume:
        stored = read(path)
        _check_same(name, study, stored.study)
        return stored
    if not force:
        raise StoreError(
            f"{name} exists already; go on with it (--resume), write over it (--force), or choose another name "
            "(--output)"
        )
    if not _looks_like_result(path):
        raise StoreError(f"{name} is no result file of gapwalk, so it is not written over; choose another name")
    return None


def _looks_like_result(path: str | os.PathLike[str]) -> bool:
    """Whether a file has the mark of a result, though it may be damaged; an empty file is no loss either."""
    with explained(path), open(path, "rb") as file:
        head = file.read(72)
    return not head or head[68:72] == APPLICATION.to_bytes(4, "big")


def _check_same(name: str, study: Study, stored: Study) -> None:
    """A StoreError that lists the differences between the study to be run and that of a result."""
    differences = []
    study = as_before(study, stored)
    if study.system.structure != stored.system.structure:
        differences.append("the system is made of other parts")
    else:
        names, now, then = study.system.structure.names, study.system.values, stored.system.values
        differences += [
            f"{names[place]} is {float(now[place])!r}, and was {float(then[place])!r}"
            for place in np.flatnonzero(now != then).tolist()
        ]
    if type(study.options) is not type(stored.options):
        differences.append("the study is of another kind")
    else:
        for field in (each for each in fields(study.options) if each.compare):
            now, before = getattr(study.options, field.name), getattr(stored.options, field.name)
            if now != before:
                differences.append(f"the study's {field.name} is {now!r}, and was {before!r}")
    if differences:
        more = f"; and {len(differences) - 3} more differences" if len(differences) > 3 else ""
        raise StoreError(
            f"{name} is the result of a different study, so it cannot be resumed: {'; '.join(differences[:3])}{more}. "
            "Choose another name for the new result (--output), or write over this one (--force)"
        )
