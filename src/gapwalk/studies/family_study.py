"""The study of a family: branches for several values of one parameter, with their special points joined.

Method: docs/numerics/families.md
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from gapwalk.bifurcation.branch_start import directions
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.both_directions import point_row
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model.schema import Number, Text
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import shows_progress
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import parameter_headings
from gapwalk.orbit.shooting import Shooting
from gapwalk.parallel.workers import Workers
from gapwalk.results.plain import plain
from gapwalk.studies.columns import table_rows
from gapwalk.studies.family import (
    Connection,
    Family,
    FamilyOptions,
    FamilyWork,
    Member,
    MemberParameter,
    Place,
    SpecialPointPath,
)
from gapwalk.studies.options import BranchOptions, kinds_key
from gapwalk.studies.runner import Report, branch_document, call
from gapwalk.studies.set_values import leaves_of
from gapwalk.studies.study_kind import Finding, Rows, values_of
from gapwalk.studies.tables import Surroundings
from gapwalk.summary import SummaryParts, Table, summarizes

if TYPE_CHECKING:
    from typing import Self


@dataclass(frozen=True)
class FamilyFinding(Finding):
    """Finding of a family, complete or not."""

    options: BranchOptions  #: The request.
    family: Family  #: The family.

    @property
    def record(self) -> Family | None:
        """The family; None before its first member."""
        return self.family if self.family.members else None

    @property
    def stored(self) -> str:
        """Describe how many members are done, and between how many of them special points are joined."""
        found, connections = self.family, self.family.connections or {}
        return f"{len(found.members)} of {len(found.over.axis)} members are stored, joined at {len(connections)} places"

    @property
    def can_be_drawn(self) -> bool:
        """True if a member has a branch."""
        return bool(self.family.branches)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the members, then the special points, each followed through the family."""
        found = self.family
        (low, high), symbol, name = found.within, parameter_symbol(found.parameter), parameter_symbol(found.over.name)
        yield f"{symbol} from {low:.10g} to {high:.10g}, {len(found.over.axis)} values of {name}"
        for member in found.members:
            branches = ", ".join(f"{label} with {len(branch.points)} points" for label, branch in member.named)
            special = sum(len(branch.special_points) for branch in member.branches)
            text = f"{branches}; {special} special points" if member.branches else "no branch"
            yield f"  {name} = {member.value:.8g}: {text}"
        if found.point_paths:
            columns = ("period", "members", f"from {name}", f"at {symbol}", f"to {name}", f"at {symbol}")
            rows = [self._path_cells(point_path) for point_path in found.point_paths]
            yield Table(["special point", *(f">{each}" for each in columns), "joined", "contact"], rows)
        for point_path in found.point_paths:
            yield from (f"  {point_path.name} {text}" for text in _path_lines(point_path))

    def _path_cells(self, point_path: SpecialPointPath) -> list[str]:
        """Return the row of a special point in the table: its first and its last place, and how they are joined."""
        found, places = self.family, point_path.places
        numbers = [
            text
            for place in (places[0], places[-1])
            for text in (f"{found.value(place):.6g}", f"{found.special(place).value:#.10g}")
        ]
        joined = "" if not point_path.connections else "exactly" if point_path.exact else "by nearness"
        return [point_path.name, str(point_path.period), str(len(places)), *numbers, joined, point_path.contact]

    def document(self, points: bool) -> dict[str, Any]:
        """Return members with branches, and paths of special points; with all points and connections if wanted."""
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
        """Return the tables of special points, path by path, of their connections, and of all points."""
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

    def _special_rows(self) -> Rows:
        found = self.family
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

    def _connection_rows(self) -> Iterator[list[object]]:
        """Yield the connections of special points that do not simply continue: births, meetings, ends."""
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

    def _point_rows(self) -> Rows:
        found, states = self.family, [f"{name}(0)" for name in self.family.system.state_names]
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

    @property
    def _headings(self) -> list[str]:
        """Return the headings of the parameter of the members, and of the quantity that differs."""
        return parameter_headings([self.family.parameter, self.family.over.name], self.family.system.coordinates)


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
class FamilyStudy(FamilyOptions, BranchOptions):
    """A family: the branches over one parameter, for several values of another one.

    Parameters
    ----------
    parameter, begin, end, measure, period, start, walk, method
        As `BranchOptions`, for each member.
    max_period, kinds, exact, workers
        Extent of the members, and how their special points are joined; as `FamilyOptions`.

    Examples
    --------
    >>> over = gw.studies.MemberParameter.of({"stop.clearance": [0.9, 1.0]})
    >>> asked = gw.studies.FamilyStudy(parameter="frequency", begin=1.0, end=1.6, measure="half.x", over=over)
    >>> asked.plan
    'family over frequency from 1 to 1.6 at 2 values of stop.clearance from 0.9 to 1, period 1, showing half.x'
    """

    kind: ClassVar[str] = "family"
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

    def work(self, system: System) -> FamilyWork:
        """Return the work on the family."""
        return FamilyWork(system, self, lambda found: FamilyFinding(self, found))


@shows_progress(lambda count, part, pace: str(pace))
def family(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: MemberParameter | Mapping[str, Sequence[float]],
    *,
    start: str | Sequence[float] = "settle",
    period: int = 1,
    options: FamilyOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Family:
    """The response of one system, repeated for several values of a parameter, with the special points joined.

    Between two neighbouring members each special point is followed along its exact locus: to a special point of the
    next member, to another one with which it meets and vanishes, or out of the range.

    Parameters
    ----------
    system
        The system; its own values of the parameters that are walked or differ have no effect.
    parameter, to
        The parameter along which each member is walked, from the first value to the second.
    over
        Values in which members differ: those of a parameter, as in ``{"mean.q1": [0.25, 0.3, 0.35]}``, or of
        several that move together. With a name of its own: `MemberParameter`.
    start, period
        Start of the branches, as in `find_orbit`.
    options, walk, method
        Options of the family, of the walk and of the method.
    workers
        Number of local processes, or workers that were started before (`gapwalk.parallel`); by default as the options
        say. The result does not depend on them.
    report
        Called with each part once it is done and written to the file.
    output
        A file to write while the work is done; `gapwalk.open_result` reads it. If it holds a part of the same family,
        that is continued to the same result.

    Returns
    -------
    Family
        The members, and the paths of their special points.

    Raises
    ------
    ModelError
        For unknown parameters, values that the system cannot have, or an empty range.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is the result so far, with ``complete`` False.

    Examples
    --------
    >>> found = gw.family(system, "frequency", (1.0, 1.6), over={"stop.clearance": [0.9, 1.0]})
    >>> [round(found.special(place).value, 9) for place in found.of_kind("grazing")[0].places]
    [1.241573326, 1.218574357]
    """
    over, options = MemberParameter.of(over), options or FamilyOptions()
    begin, end = (float(value) for value in to)
    for value in (begin, end):
        system.at({parameter: value})
    directions(begin, end)  # refuses an empty range
    over.check(system, parameter)
    if options.exact and set(options.kinds) == {Kind.BRANCH_POINT}:
        raise ModelError("branch points have no locus; write exact=False to join them by nearness")
    method = method or Shooting()
    if output is not None and not isinstance(method, Method):
        raise ModelError(f"{method!r:.60} cannot be kept in a file; leave output out, or derive it from Method")
    asked = FamilyStudy(
        parameter,
        begin,
        end,
        "",
        period,
        start if isinstance(start, str) else tuple(float(each) for each in start),  # pyright: ignore[reportArgumentType]
        walk or WalkOptions(),
        method,  # pyright: ignore[reportArgumentType]
        **values_of(options),
        over=over,
    )
    return call(asked, asked.work(system), system, workers=workers, report=report, output=output).record
