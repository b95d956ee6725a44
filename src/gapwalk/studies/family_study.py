"""The study of a family: branches for several values of one parameter, with their special points joined.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from gapwalk.bifurcation.branch_start import directions
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve_points import point_row
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Counted
from gapwalk.model.schema import Number, Text
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.orbit.orbit import parameter_headings
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.branch_family import (
    Connection,
    Family,
    FamilyWork,
    Member,
    MemberParameter,
    Place,
    SpecialPointPath,
)
from gapwalk.studies.options import BranchOptions, kinds_key, table_rows
from gapwalk.studies.result import branch_document
from gapwalk.studies.set_values import leaves_of
from gapwalk.studies.study_kind import AnswerFinding, Rows
from gapwalk.studies.study_schema import Surroundings
from gapwalk.summary import SummaryParts, Table

if TYPE_CHECKING:
    from typing import Self


def _member_document(member: Member, points: bool) -> dict[str, Any]:
    branches = []
    for number, (name, branch) in enumerate(member.named, start=1):
        branches.append({"name": name, **branch_document(branch, number, points)})
    return {"number": member.number, "value": member.value, "branches": branches}


def _special_document(found: Family, place: Place) -> dict[str, Any]:
    special = found.special(place)
    return plain({"branch": place.branch + 1, "period": special.orbit.period, **point_row(special)})


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


def _path_lines(point_path: SpecialPointPath) -> Iterator[str]:
    """Describe, if known, what happens to a special point before its first and after its last member."""
    if point_path.before is not None:
        yield f"before: {point_path.before.text}"
    for connection in point_path.connections:
        for passage in connection.passages:
            yield f"passes a {passage.kind} at ({passage.first:.8g}, {passage.value:.8g})"
    if point_path.after is not None:
        yield f"after: {point_path.after.text}"


_OVER = 'write what differs from member to member, as in over = { "mean.q1" = [0.25, 0.3, 0.35] }'


def _flat(value: Any) -> Any:
    """Return a table of lists by full names of parameters: ``mean.q1`` may be written with or without quotes."""
    if not isinstance(value, Mapping):
        return value
    return {".".join(str(key) for key in leaf.path): leaf.value for leaf in leaves_of(value, ())}


def _makes_a_family(over: dict[str, list[float]], info: ValidationInfo[Surroundings]) -> MemberParameter:
    given = MemberParameter.of(over, info.data.get("called", ""), info.data.get("values", ()))
    if info.context.system and info.data.get("parameter"):
        given.check(info.context.system, info.data["parameter"], names_only=info.context.guessed)
    return given


@dataclass(frozen=True)
class FamilyStudy(BranchOptions):
    """A family: the branches over one parameter, for several values of another one.

    Between two neighbouring members each special point is followed along its exact locus: to a special point of the
    next member, to another one with which it meets and vanishes, or out of the range.

    Raises
    ------
    ModelError
        For unknown parameters, values that the system cannot have, or an empty range.

    Examples
    --------
    >>> found = gw.family(system, "frequency", (1.0, 1.6), over={"stop.clearance": [0.9, 1.0]})
    >>> [round(found.special(place).value, 9) for place in found.of_kind("grazing")[0].places]
    [1.241573326, 1.218574357]
    """

    kind: ClassVar[str] = "family"
    answer: ClassVar[Part | None] = Part("family", Family)  # made of the members
    arguments: ClassVar[tuple[str, ...]] = ("parameter", "to", "over")
    not_asked: ClassVar[tuple[str, ...]] = ("measure", "verify")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {
        "over": (
            MemberParameter | Mapping[str, Sequence[float]],
            MISSING,
            'Values in which members differ: those of a parameter, as in ``{"mean.q1": [0.25, 0.3, 0.35]}``, or of '
            "several that move together. With a name of its own: `MemberParameter`.",
        )
    }
    table_types: ClassVar[Mapping[str, Any]] = {
        **BranchOptions.table_types,
        "kinds": kinds_key(Kind.known),
        "called": (Text, ""),
        "values": (list[Number], Field(default_factory=list)),
        "over": (
            Annotated[dict[str, list[Number]], BeforeValidator(_flat), AfterValidator(_makes_a_family)],
            Field(description=_OVER),
        ),
    }

    #: Parameters in which members differ. In a table, ``over`` has the parameters with their values, and ``called`` and
    #: ``values`` are keys next to it.
    over: MemberParameter = field(kw_only=True)
    #: Longest period, in forcing periods, of further branches that are followed, as in a diagram; None: only the first
    #: branch.
    max_period: Counted | None = None
    kinds: tuple[Kind, ...] = field(default_factory=Kind.known)  #: Kinds of special points that are joined.
    #: True to join special points by the exact loci that lead from member to member; otherwise each to the nearest of
    #: its kind, which is a guess.
    exact: bool = True
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.kinds or not set(self.kinds) <= set(Kind.known()):
            names = ", ".join(kind.value for kind in Kind.known())
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Make the study of a table, whose `over` contains the keys next to it."""
        return super().of_table({key: values[key] for key in values.keys() - {"called", "values"}}, system)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        axis = self.over.axis
        far = "" if self.max_period is None else f", to period {self.max_period}"
        return (
            f"{self.kind} over {self.range_words} at {len(axis)} values of {self.over.name} from {axis[0]:g} to "
            f"{axis[-1]:g}, period {self.period}{far}, showing {self.measure}"
        )

    def first_system(self, system: System) -> System:
        """Return the system of the first member, at the first value of the parameter."""
        return super().first_system(system).at(self.over.at(0))

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call."""
        asked = cls(**{"measure": "", **values, "over": MemberParameter.of(values["over"])})
        asked.refuse_invalid(system)
        directions(asked.begin, asked.end)  # refuses an empty range
        asked.over.check(system, asked.parameter)
        if asked.exact and set(asked.kinds) == {Kind.BRANCH_POINT}:
            raise ModelError("branch points have no locus; write exact=False to join them by nearness")
        return asked

    def work(self, system: System) -> FamilyWork:
        """Return the work on the family."""
        return FamilyWork(system, self)

    def stored_words(self, finding: AnswerFinding) -> str:
        """Describe how many members are done, and between how many of them special points are joined."""
        found: Family | None = finding.found
        members, connections = (0, 0) if found is None else (len(found.members), len(found.connections or {}))
        return f"{members} of {len(self.over.axis)} members are stored, joined at {connections} places"

    def can_be_drawn(self, found: Family) -> bool:
        """Return True if a member has a branch."""
        return bool(found.branches)

    def summary(self, found: Family) -> SummaryParts:
        """Return the members, then the special points, each followed through the family."""
        (low, high), symbol, name = found.within, parameter_symbol(found.parameter), parameter_symbol(found.over.name)
        yield f"{symbol} from {low:.10g} to {high:.10g}, {len(found.over.axis)} values of {name}"
        for member in found.members:
            branches = ", ".join(f"{label} with {len(branch.points)} points" for label, branch in member.named)
            special = sum(len(branch.special_points) for branch in member.branches)
            text = f"{branches}; {special} special points" if member.branches else "no branch"
            yield f"  {name} = {member.value:.8g}: {text}"
        if found.point_paths:
            columns = ("period", "members", f"from {name}", f"at {symbol}", f"to {name}", f"at {symbol}")
            rows = [_path_cells(found, point_path) for point_path in found.point_paths]
            yield Table(["special point", *(f">{each}" for each in columns), "joined", "contact"], rows)
        for point_path in found.point_paths:
            yield from (f"  {point_path.name} {text}" for text in _path_lines(point_path))

    def document(self, found: Family, points: bool) -> dict[str, Any]:
        """Return members with branches, and paths of special points; with all points and connections if wanted."""
        return {
            "parameter": found.parameter,
            "over": {
                "name": found.over.name,
                "values": list(found.over.axis),
                "parameters": {name: list(values) for name, values in found.over.moved},
            },
            "members": [_member_document(member, points) for member in found.members],
            "point_paths": [_path_document(found, point_path, points) for point_path in found.point_paths],
        }

    def tables(self, found: Family) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of special points, path by path, of their connections, and of all points."""
        rows = {"special-points": _special_rows, "connections": _connection_rows, "points": _point_rows}
        return {name: partial(each, found) for name, each in rows.items()}


def _path_cells(found: Family, point_path: SpecialPointPath) -> list[str]:
    """Return the row of a special point in the table: its first and its last place, and how they are joined."""
    places = point_path.places
    numbers = [
        text
        for place in (places[0], places[-1])
        for text in (f"{found.value(place):.6g}", f"{found.special(place).value:#.10g}")
    ]
    joined = "" if not point_path.connections else "exactly" if point_path.exact else "by nearness"
    return [point_path.name, str(point_path.period), str(len(places)), *numbers, joined, point_path.contact]


def _path_document(found: Family, point_path: SpecialPointPath, points: bool) -> dict[str, Any]:
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


def _special_rows(found: Family) -> Rows:
    rows = (
        {
            **{"point_path": point_path.name, "kind": point_path.kind, "contact": point_path.contact},
            **{"period": point_path.period, "second": found.value(place), "branch": _branch_name(found, place)},
            **point_row(found.special(place)),
            "joined": fate,
        }
        for point_path in found.point_paths
        for place, fate in zip(
            point_path.places, ["", *(each.fate.value for each in point_path.connections)], strict=True
        )
    )
    return table_rows(rows, found.parameter, found.over.name, system=found.system)


def _connection_rows(found: Family) -> Iterator[list[object]]:
    """Yield the connections of special points that do not simply continue: births, meetings, ends."""
    headings = parameter_headings([found.parameter, found.over.name], found.system.coordinates)
    yield ["point_path", "kind", "contact", "side", "fate", "event", *headings, "with", "detail"]
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


def _point_rows(found: Family) -> Rows:
    states = [f"{name}(0)" for name in found.system.state_names]
    rows = (
        {
            **{"second": member.value, "branch": name, "period": branch.period, **point_row(point)},
            "state": dict(zip(states, point.orbit.state.tolist(), strict=True)),
        }
        for member in found.members
        for name, branch in member.named
        for point in branch.points
    )
    return table_rows(rows, found.parameter, found.over.name, system=found.system)
