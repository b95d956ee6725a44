"""Families in files: what is to be done, then part by part what has been done; and read back."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict
from types import TracebackType
from typing import Any

from pydantic import TypeAdapter

from gapwalk.errors import StoreError
from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.shooting import Shooting
from gapwalk.study.family.codec import joint_arrays, joints_of, member_arrays, member_of
from gapwalk.study.family.job import FamilyJob, Part, Walk
from gapwalk.study.family.joint import Joint
from gapwalk.study.family.member import Member
from gapwalk.study.family.options import FamilyOptions
from gapwalk.study.family.over import Over
from gapwalk.study.family.record import Family
from gapwalk.study.store.arrays import Arrays
from gapwalk.study.store.cell_store import CellStore, parted
from gapwalk.study.store.chunk_store import read_chunks
from gapwalk.study.store.plain import plain_system, system_of
from gapwalk.study.store.plain_options import plain_method
from gapwalk.study.store.trust import undamaged

KIND = "family"


class FamilyStore:
    """The file of a family that is being worked on.

    Parameters
    ----------
    path
        The file. If it holds a part of the same family, that is gone on with.
    job
        The work.

    Raises
    ------
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], job: FamilyJob) -> None:
        self._job = job
        self._store = CellStore(path, plain_family(job), _numbers(job))
        try:
            with undamaged(path):
                self.members, self.joints = unpacked(job, self._store.chunks)
        except BaseException:
            self._store.__exit__(None, None, None)
            raise

    def add(self, number: int, part: Part) -> None:
        """Write a part; a StoreError if that cannot be done."""
        if isinstance(part, Member):
            arrays = member_arrays(part, self._job.system_at(number), balanced=is_balanced(self._job))
        else:
            arrays = joint_arrays(part)
        self._store.add(number, arrays)

    def __enter__(self) -> FamilyStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._store.__exit__(kind, error, trace)


def unpacked(job: FamilyJob, parts: Mapping[int, Arrays]) -> tuple[dict[int, Member], dict[int, tuple[Joint, ...]]]:
    """Members and joints by number; any of LookupError, TypeError and ValueError if they are not those of the job."""
    members, joints = {}, {}
    for number, arrays in parts.items():
        if number < job.count:
            members[number] = member_of(arrays, job.system_at(number), balanced=is_balanced(job))
            if members[number].number != number:
                raise ValueError(f"member {number} calls itself {members[number].number}")
        else:
            joints[number - job.count] = joints_of(arrays)
    return members, joints


def load_family(path: str | os.PathLike[str]) -> Family:
    """Load a family from the file that `gapwalk.family` wrote, as far as it has come.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    StoreError
        If there is no such file, it holds something else, or it is damaged.
    """
    about, parts = read_chunks(path)
    if about.get("kind") != KIND:
        raise StoreError(f"{os.fspath(path)} does not hold a family, but a job of the kind {about.get('kind')!r}")
    with undamaged(path):
        job = _job_of(about)
        done, _ = parted(path, parts, _numbers(job))
        job.take(*unpacked(job, done))
    return job.family


def plain_family(job: FamilyJob) -> dict[str, Any]:
    """What is to be done, in plain JSON values; the number of workers changes nothing of it."""
    made, how, method = job.family, job.how, job.how.method or Shooting()
    assert isinstance(method, Shooting | Balance)
    options = asdict(job.options)
    del options["workers"]
    return {
        "kind": KIND,
        "system": plain_system(made.system),
        "parameter": made.parameter,
        "over": asdict(made.over),
        "begin": how.begin,
        "end": how.end,
        "start": how.start if isinstance(how.start, str) else list(how.start),
        "period": how.period,
        "walk": None if how.walk is None else asdict(how.walk),
        "method": plain_method(method),
        "options": options,
    }


def _job_of(about: Mapping[str, Any]) -> FamilyJob:
    """The work that a file says; nothing of it is done again, so options play no role."""
    begin, end = float(about["begin"]), float(about["end"])
    over = TypeAdapter(Over).validate_python(about["over"])
    method = Balance() if about["method"]["name"] == Balance.name else Shooting()
    blank = Family(system_of(about["system"]), str(about["parameter"]), (min(begin, end), max(begin, end)), over)
    return FamilyJob(blank, Walk(begin, end, method=method), FamilyOptions())


def is_balanced(job: FamilyJob) -> bool:
    """Whether its orbits are found by harmonic balance."""
    return isinstance(job.how.method, Balance)


def _numbers(job: FamilyJob) -> int:
    """Numbers of parts: those of members, then one for each gap, by the member before it."""
    return 2 * job.count - 1
