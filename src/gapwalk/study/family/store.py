"""Families in files: what is to be done, then part by part what has been done; and read back."""

from __future__ import annotations

import os
from collections.abc import Mapping
from types import TracebackType
from typing import Any

from gapwalk.orbit.balance.options import Balance
from gapwalk.study.family.codec import joint_arrays, joints_of, member_arrays, member_of
from gapwalk.study.family.job import FamilyJob, Part
from gapwalk.study.family.joint import Joint
from gapwalk.study.family.member import Member
from gapwalk.study.store.cell_store import Arrays, CellStore, undamaged


class FamilyStore:
    """The file of a family that is being worked on.

    Parameters
    ----------
    path
        The file. If it holds a part of the same family, that is gone on with.
    job
        The work.
    about
        What is to be done, in plain JSON values.

    Raises
    ------
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], job: FamilyJob, about: Mapping[str, Any]) -> None:
        self._job = job
        self._store = CellStore(path, about, _numbers(job))
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


def unpacked(
    job: FamilyJob, parts: Mapping[int, Arrays]
) -> tuple[dict[int, Member], dict[int, tuple[Joint, ...]]]:
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


def is_balanced(job: FamilyJob) -> bool:
    """Whether its orbits are found by harmonic balance."""
    return isinstance(job.how.method, Balance)


def _numbers(job: FamilyJob) -> int:
    """Numbers of parts: those of members, then one for each gap, by the member before it."""
    return 2 * job.count - 1
