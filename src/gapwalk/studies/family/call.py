"""The call of `gapwalk.family` as its file keeps it, and the parts of its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.family.connection import Connection
from gapwalk.studies.family.job import FamilyJob, Walk
from gapwalk.studies.family.member import Member
from gapwalk.studies.family.options import FamilyOptions
from gapwalk.studies.family.over import MemberParameter
from gapwalk.studies.family.record import Family
from gapwalk.studies.request import Call, Keeper

MEMBER = Part("member", Member, numbered=True)
JOINTS = Part("connections", tuple[Connection, ...], numbered=True)
"""What becomes of special points between two members, by the number of the first."""


@dataclass(frozen=True)
class FamilyCall(Call):
    """What family is to be made; parameters as in `gapwalk.family`."""

    asks: ClassVar[str] = "family"

    system: System
    parameter: str
    over: MemberParameter
    begin: float
    end: float
    start: str | tuple[float, ...]
    period: int
    walk: WalkOptions | None
    method: Method
    options: FamilyOptions

    @classmethod
    def of(cls, job: FamilyJob) -> FamilyCall:
        """The call that a job does; a ModelError for a method that cannot be kept."""
        made, how, method = job.family, job.how, job.how.method or Shooting()
        if not isinstance(method, Method):
            raise ModelError(f"{method!r:.60} cannot be kept in a file; leave output out, or derive it from Method")
        start = how.start if isinstance(how.start, str) else tuple(float(each) for each in how.start)
        plane = (made.system, made.parameter, made.over, how.begin, how.end)
        return cls(*plane, start, how.period, how.walk, method, job.options)

    def found(self, parts: Parts) -> Family:
        """The family, as far as it has come."""
        low, high = sorted((self.begin, self.end))
        how = Walk(self.begin, self.end, self.start, self.period, self.walk, self.method)
        job = FamilyJob(Family(self.system, self.parameter, (low, high), self.over), how, self.options)
        job.take(*stored_parts(parts.all, job))
        return job.family


def stored_parts(known: Any, job: FamilyJob) -> tuple[dict[int, Member], dict[int, tuple[Connection, ...]]]:
    """Members and connections by number; a ValueError if they are not those of the job.

    Parameters
    ----------
    known
        Gives the parts of a kind: `Parts.all` or `ResultFile.known`.
    job
        The job.
    """
    members, connections = dict(known(MEMBER)), dict(known(JOINTS))
    for number, member in members.items():
        if member.number != number or not 0 <= number < job.count:
            raise ValueError(f"member {number} calls itself {member.number}")
    if any(not 0 <= number < job.count - 1 for number in connections):
        raise ValueError("there are connections between members that are not there")
    return members, connections


def keep_part(file: Keeper, job: FamilyJob, number: int, part: Member | tuple[Connection, ...]) -> None:
    """Write a part of the work, by its number among all; a StoreError if that cannot be done."""
    file.write(MEMBER.entry(part, number) if isinstance(part, Member) else JOINTS.entry(part, number - job.count))
