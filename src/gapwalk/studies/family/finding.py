"""What the study of a family has found, as JSON values and as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from gapwalk.studies.columns import measure_names, measure_values, method_names, method_values, parameter_headings
from gapwalk.studies.document import branch_document, special_document
from gapwalk.studies.family.connection import Connection
from gapwalk.studies.family.member import Member, Place
from gapwalk.studies.family.record import Family, SpecialPointPath
from gapwalk.studies.family.study_options import FamilyStudyOptions
from gapwalk.studies.finding import Finding, Rows


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
        found, connections = self.family, self.family.connections or {}
        return f"{len(found.members)} of {len(found.over.axis)} members are stored, joined at {len(connections)} places"

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
        """Members with their branches, and point_paths; with all points, and the ways between members, if wanted."""
        found = self.family
        return {
            "parameter": found.parameter,
            "over": {
                "name": found.over.name,
                "values": list(found.over.axis),
                "parameters": {name: list(values) for name, values in found.over.moved},
            },
            "members": [_member_document(member, points) for member in found.members],
            "point_paths": [self._path_document(point_path, points) for point_path in found.point_paths],
        }

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The special points, path by path; what becomes of them between members; the points of all branches."""
        return {"special-points": self._special_rows, "connections": self._connection_rows, "points": self._point_rows}

    def _path_document(self, point_path: SpecialPointPath, points: bool) -> dict[str, Any]:
        found = self.family
        document: dict[str, Any] = {
            "name": point_path.name,
            "kind": point_path.kind.value,
            "contact": point_path.contact or None,
            "period": point_path.period,
            "exact": point_path.exact,
            "before": None if point_path.before is None else _connection_document(point_path.before),
            "after": None if point_path.after is None else _connection_document(point_path.after),
            "special_points": [
                {"member": place.member, "value": found.value(place), **_special_document(found, place)}
                for place in point_path.places
            ],
            "passages": [asdict(passage) for connection in point_path.connections for passage in connection.passages],
        }
        if points:
            document["ways"] = [[list(pair) for pair in connection.curve] for connection in point_path.connections]
        return document

    def _special_rows(self) -> Iterator[list[object]]:
        found, names = self.family, self.family.system.coordinates
        first, second = self._headings
        header = ["point_path", "kind", "contact", "period", second, "branch", first, "uncertainty"]
        header += ["unstable.before", "unstable.after", "nature", "contacts", "joined"]
        yield [*header, *measure_names(names), *method_names(self.options)]
        for point_path in found.point_paths:
            joined = ["", *(connection.fate.value for connection in point_path.connections)]
            for place, fate in zip(point_path.places, joined, strict=True):
                special = found.special(place)
                yield [
                    *(
                        point_path.name,
                        point_path.kind.value,
                        point_path.contact,
                        point_path.period,
                        found.value(place),
                    ),
                    *(_branch_name(found, place), special.value, special.uncertainty),
                    *(special.before.total, special.after.total, special.nature, special.orbit.pattern, fate),
                    *measure_values(special.point),
                    *method_values(special.orbit),
                ]

    def _connection_rows(self) -> Iterator[list[object]]:
        """What becomes of special points between members, but for those that just go on: births, meetings, ends."""
        found = self.family
        yield ["point_path", "kind", "contact", "side", "fate", "event", *self._headings, "with", "detail"]
        point_paths = {place: point_path.name for point_path in found.point_paths for place in point_path.places}
        for point_path in found.point_paths:
            for side, connection in (("before", point_path.before), ("after", point_path.after)):
                if connection is None:
                    continue
                places = (connection.begin, connection.end)
                others = {point_paths[place] for place in places if place is not None} - {point_path.name}
                at = ("", "") if connection.at is None else connection.at
                about = (
                    point_path.name,
                    point_path.kind.value,
                    point_path.contact,
                    side,
                    connection.fate.value,
                    connection.event,
                )
                yield [*about, *at, " ".join(others), connection.detail]
            for connection in point_path.connections:
                for passage in connection.passages:
                    about = (point_path.name, point_path.kind.value, passage.contact, "between", "passes", passage.kind)
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


def _connection_document(connection: Connection) -> dict[str, Any]:
    return {
        "fate": connection.fate.value,
        "event": connection.event or None,
        "at": None if connection.at is None else list(connection.at),
        "text": connection.text,
        "passages": [asdict(passage) for passage in connection.passages],
    }
