"""What the study of a family has found, as JSON values and as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from gapwalk.study.columns import measure_names, measure_values, method_names, method_values, parameter_headings
from gapwalk.study.document import branch_document, special_document
from gapwalk.study.family.joint import Joint
from gapwalk.study.family.member import Member, Place
from gapwalk.study.family.record import Family, Strand
from gapwalk.study.family.study_options import FamilyStudyOptions
from gapwalk.study.finding import Finding, Rows


@dataclass(frozen=True)
class FamilyFinding(Finding):
    """A family, as far as it has been worked on.

    Attributes
    ----------
    options
        What was asked.
    family
        The family.
    """

    options: FamilyStudyOptions
    family: Family

    @property
    def record(self) -> Family | None:
        """The family; None before its first member."""
        return self.family if self.family.members else None

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return self.family.complete

    @property
    def stored(self) -> str:
        """How many members have been done, and between how many of them special points are joined."""
        found, joints = self.family, self.family.joints or {}
        return f"{len(found.members)} of {len(found.over.axis)} members are stored, joined at {len(joints)} places"

    @property
    def can_be_drawn(self) -> bool:
        """Whether there is any branch."""
        return bool(self.family.branches)

    @property
    def notes(self) -> tuple[str, ...]:
        """What else there is to say."""
        return self.family.notes

    @property
    def failures(self) -> tuple[str, ...]:
        """What could not be walked or followed."""
        return self.family.failures

    def document(self, points: bool) -> dict[str, Any]:
        """Members with their branches, and strands; with all points, and the ways between members, if wanted."""
        found = self.family
        return {
            "parameter": found.parameter,
            "over": {
                "name": found.over.name,
                "values": list(found.over.axis),
                "parameters": {name: list(values) for name, values in found.over.moved},
            },
            "members": [_member_document(member, points) for member in found.members],
            "strands": [self._strand_document(strand, points) for strand in found.strands],
        }

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The special points, strand by strand; what becomes of them between members; the points of all branches."""
        return {"special-points": self._special_rows, "joints": self._joint_rows, "points": self._point_rows}

    def _strand_document(self, strand: Strand, points: bool) -> dict[str, Any]:
        found = self.family
        document: dict[str, Any] = {
            "name": strand.name,
            "kind": strand.kind.value,
            "contact": strand.contact or None,
            "period": strand.period,
            "exact": strand.exact,
            "before": None if strand.before is None else _joint_document(strand.before),
            "after": None if strand.after is None else _joint_document(strand.after),
            "special_points": [
                {"member": place.member, "value": found.value(place), **_special_document(found, place)}
                for place in strand.places
            ],
            "passages": [asdict(passage) for joint in strand.joints for passage in joint.passages],
        }
        if points:
            document["ways"] = [[list(pair) for pair in joint.curve] for joint in strand.joints]
        return document

    def _special_rows(self) -> Iterator[list[object]]:
        found, names = self.family, self.family.system.coordinates
        first, second = self._headings
        header = ["strand", "kind", "contact", "period", second, "branch", first, "uncertainty"]
        header += ["unstable.before", "unstable.after", "nature", "contacts", "joined"]
        yield [*header, *measure_names(names), *method_names(self.options)]
        for strand in found.strands:
            joined = ["", *(joint.fate.value for joint in strand.joints)]
            for place, fate in zip(strand.places, joined, strict=True):
                special = found.special(place)
                yield [
                    *(strand.name, strand.kind.value, strand.contact, strand.period, found.value(place)),
                    *(_branch_name(found, place), special.value, special.uncertainty),
                    *(special.before.total, special.after.total, special.nature, special.orbit.pattern, fate),
                    *measure_values(special.point),
                    *method_values(special.orbit),
                ]

    def _joint_rows(self) -> Iterator[list[object]]:
        """What becomes of special points between members, but for those that just go on: births, meetings, ends."""
        found = self.family
        yield ["strand", "kind", "contact", "side", "fate", "event", *self._headings, "with", "detail"]
        strands = {place: strand.name for strand in found.strands for place in strand.places}
        for strand in found.strands:
            for side, joint in (("before", strand.before), ("after", strand.after)):
                if joint is None:
                    continue
                places = (joint.begin, joint.end)
                others = {strands[place] for place in places if place is not None} - {strand.name}
                at = ("", "") if joint.at is None else joint.at
                about = (strand.name, strand.kind.value, strand.contact, side, joint.fate.value, joint.event)
                yield [*about, *at, " ".join(others), joint.detail]
            for joint in strand.joints:
                for passage in joint.passages:
                    about = (strand.name, strand.kind.value, passage.contact, "between", "passes", passage.kind)
                    yield [*about, passage.first, passage.value, "", ""]

    def _point_rows(self) -> Iterator[list[object]]:
        found, names = self.family, self.family.system.coordinates
        states = [*(f"{q}(0)" for q in names), *(f"{q}'(0)" for q in names)]
        first, second = self._headings
        header = [second, "branch", "period", first, "stable", "instability", "contacts"]
        yield [*header, *measure_names(names), *states, *method_names(self.options)]
        for member in found.members:
            for name, branch in member.named:
                for point in branch.points:
                    yield [
                        *(member.value, name, branch.period, point.value),
                        *(point.stable, point.instability.label, point.orbit.pattern),
                        *measure_values(point),
                        *point.orbit.state.tolist(),
                        *method_values(point.orbit),
                    ]

    @property
    def _headings(self) -> list[str]:
        """The headings of the parameter of the members, and of what differs."""
        return parameter_headings([self.family.parameter, self.family.over.name], self.family.system.coordinates)


def _member_document(member: Member, points: bool) -> dict[str, Any]:
    branches = []
    for number, (name, branch) in enumerate(member.named, start=1):
        branches.append({"name": name, **branch_document(branch, number, points)})
    return {"number": member.number, "value": member.value, "branches": branches}


def _special_document(found: Family, place: Place) -> dict[str, Any]:
    member = next(member for member in found.members if member.number == place.member)
    return special_document(found.special(place), member.branches[place.branch], place.branch + 1)


def _branch_name(found: Family, place: Place) -> str:
    member = next(member for member in found.members if member.number == place.member)
    return list(member.named)[place.branch][0]


def _joint_document(joint: Joint) -> dict[str, Any]:
    return {
        "fate": joint.fate.value,
        "event": joint.event or None,
        "at": None if joint.at is None else list(joint.at),
        "text": joint.text,
        "passages": [asdict(passage) for passage in joint.passages],
    }
