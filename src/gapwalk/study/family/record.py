"""The record of a family: its members, and their special points joined from one to the next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.model.system import System
from gapwalk.notebook.shown import Shown
from gapwalk.study.family.joint import Fate, Joint
from gapwalk.study.family.member import Member, Place
from gapwalk.study.family.over import Over


@dataclass(frozen=True)
class Strand:
    """One special point through all members that have it.

    Attributes
    ----------
    name
        Such as ``fold-3``: the third strand of folds.
    kind, contact, period
        What happens at it: to motions of which period; what grazes, if anything does.
    places
        The special points, from member to member.
    joints
        What leads from each to the next.
    before, after
        What becomes of it before its first and after its last special point; None at the first and the last member, and
        where that is not known yet.
    """

    name: str
    kind: Kind
    contact: str
    period: int
    places: tuple[Place, ...]
    joints: tuple[Joint, ...]
    before: Joint | None
    after: Joint | None

    @property
    def exact(self) -> bool:
        """Whether all of its joints are exact."""
        return all(joint.fate is Fate.JOINED for joint in self.joints)


@dataclass(frozen=True, eq=False)
class Family(Shown):
    """The branches of one system along one parameter, repeated for several values of another one.

    Attributes
    ----------
    system
        The system.
    parameter
        The parameter along which each member is walked.
    within
        Its range, the smaller value first.
    over
        What differs from member to member.
    members
        The members that have been done, in the order of their values.
    joints
        What becomes of special points between members, by the number of the member before the gap.
    """

    system: System
    parameter: str
    within: tuple[float, float]
    over: Over
    members: tuple[Member, ...] = ()
    joints: Mapping[int, tuple[Joint, ...]] | None = None

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return len(self.members) == len(self.over.axis) and len(self.joints or {}) == len(self.gaps)

    @property
    def gaps(self) -> tuple[tuple[Member, Member], ...]:
        """The pairs of neighbours between which special points are joined; members without branches are left out."""
        return tuple(pairwise(member for member in self.members if member.branches))

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches of all members."""
        return tuple(branch for member in self.members for branch in member.branches)

    @property
    def notes(self) -> tuple[str, ...]:
        """What else there is to say, in sentences."""
        found = [f"{self._where(member)}: {text}" for member in self.members for text in member.notes]
        guesses = [joint for joint in self._all_joints if joint.fate is Fate.NEAR and joint.detail]
        return (*found, *(f"{self._told(joint)} {joint.text}" for joint in guesses))

    @property
    def failures(self) -> tuple[str, ...]:
        """What could not be walked or followed, in sentences."""
        found = [f"{self._where(member)}: {text}" for member in self.members for text in member.failures]
        for member in self.members:
            for name, branch in member.named:
                found += [f"{self._where(member)}: {name}: {end}" for end in branch.ends if end.reason.is_failure]
        lost = [joint for joint in self._all_joints if joint.fate is Fate.LOST]
        return (*found, *(f"{self._told(joint)} {joint.text}" for joint in lost))

    def special(self, place: Place) -> SpecialPoint:
        """The special point at a place."""
        return self._by_number[place.member].branches[place.branch].special_points[place.special]

    def value(self, place: Place) -> float:
        """What the family is over at a place."""
        return self._by_number[place.member].value

    @cached_property
    def strands(self) -> tuple[Strand, ...]:
        """The special points joined through the members, in the order in which they begin."""
        onwards = {joint.begin: joint for joint in self._all_joints if joint.leads_on}
        before, after = self._ends()
        followers = {joint.end for joint in onwards.values()}
        counts: Counter[Kind] = Counter()
        strands = []
        for start, special in self._special_points():
            if start in followers:
                continue
            places, joints = [start], []
            while (joint := onwards.get(places[-1])) is not None and joint.end is not None:
                joints.append(joint)
                places.append(joint.end)
            counts[special.kind] += 1
            strands.append(
                Strand(
                    f"{special.kind.value}-{counts[special.kind]}",
                    special.kind,
                    special.contact,
                    special.orbit.period,
                    tuple(places),
                    tuple(joints),
                    before.get(start),
                    after.get(places[-1]),
                )
            )
        return tuple(strands)

    def of_kind(self, kind: Kind | str) -> tuple[Strand, ...]:
        """The strands of one kind."""
        return tuple(strand for strand in self.strands if strand.kind == kind)

    def plot(self, **options: Any):
        """Draw all members and their special points; options as in `gapwalk.plot.loci.draw_family`."""
        from gapwalk.plot import draw

        return draw(self, **options)

    def __getitem__(self, name: str) -> Strand:
        """The strand of a name."""
        for strand in self.strands:
            if strand.name == name:
                return strand
        raise KeyError(
            f"there is no strand {name}; there are {', '.join(each.name for each in self.strands) or 'none'}"
        )

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.of_kind(kind))} of {kind.value}" for kind in Kind.known() if self.of_kind(kind))
        done = f"{len(self.members)} members" + ("" if self.complete else f" of {len(self.over.axis)}")
        return f"Family({self.parameter} over {self.over.name}: {done}; strands: {counts or 'none'})"

    @cached_property
    def _by_number(self) -> dict[int, Member]:
        return {member.number: member for member in self.members}

    @property
    def _all_joints(self) -> Iterator[Joint]:
        for _, joints in sorted((self.joints or {}).items()):
            yield from joints

    def _special_points(self) -> Iterator[tuple[Place, SpecialPoint]]:
        """The special points that are joined, or would be: those that some joint knows, and of members without any."""
        for member in self.members:
            yield from member.special_points

    def _ends(self) -> tuple[dict[Place, Joint], dict[Place, Joint]]:
        """What becomes of special points in the gap before their member, and in the one after it, if they end there."""
        before: dict[Place, Joint] = {}
        after: dict[Place, Joint] = {}
        for number, joints in (self.joints or {}).items():
            for joint in joints:
                if joint.leads_on:
                    continue
                for place in (joint.begin, joint.end):
                    if place is not None:
                        (after if place.member == number else before)[place] = joint
        return before, after

    def _told(self, joint: Joint) -> str:
        """Which special point a joint begins at."""
        member = self._by_number[joint.begin.member]
        return f"{self._where(member)}: the {joint.kind.value} at {self.special(joint.begin).value:.10g}"

    def _where(self, member: Member) -> str:
        return f"{self.over.name} = {member.value:.10g}"
