"""Options that kinds of study share: ranges of one or two parameters, a first orbit, and a search for branches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, ValidationInfo

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.isolated import SearchOptions, SearchResult, unseen_share
from gapwalk.bifurcation.loci import LocusPoint
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve_points import BranchPoint, point_row
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.flow.motion import signal_names
from gapwalk.model.measures import EXAMPLES, IMPACTS, parsed
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import one_of
from gapwalk.model.system import System
from gapwalk.model.units import PACES
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import measure_names, parameter_headings
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.orbit.shooting import Shooting
from gapwalk.studies.study_kind import INLINE, OPEN, StudyKind
from gapwalk.studies.study_schema import (
    WITH_UNIT,
    CountOrValues,
    Start,
    StartOrState,
    Surroundings,
    check_inside,
    check_parameter,
    check_value,
    key_type,
    table_schema,
)
from gapwalk.summary import Rows, rows_of

if TYPE_CHECKING:
    from typing import Self


def known_parameter(parameter: str, info: ValidationInfo[Surroundings]) -> str:
    """Refuse a parameter that the system does not have."""
    return check_parameter(parameter, info.context)


def _begins(value: float | None, info: ValidationInfo[Surroundings]) -> float | None:
    if value is None:
        if info.data.get("parameter") in PACES and not info.context.frequency_given:
            raise ValueError("is missing, and the file gives no frequency to start at; write one of the two")
        return None
    return check_value(value, info.data.get("parameter"), info.context)


def _ends(end: float, info: ValidationInfo[Surroundings]) -> float:
    parameter, around = info.data.get("parameter"), info.context
    check_value(end, parameter, around)
    begin, system = info.data.get("begin"), around.system
    if begin is None and "begin" in info.data and parameter and system and not around.guessed:
        begin = system[parameter]
    if begin == end:
        raise ValueError(f"is {end:g}, where the walk begins; choose another end")
    return end


@dataclass(frozen=True)
class RangeStudy(StudyKind):
    """A study over a range of one parameter.

    Examples
    --------
    >>> import io
    >>> gw.read_study(io.StringIO(file.replace('"response"', '"sweep"'))).options.ends
    (1.1, 1.5)
    """

    arguments: ClassVar[tuple[str, ...]] = ("parameter", "to")

    #: Any parameter of the system, for example ``"frequency"``.
    parameter: Annotated[
        str, Field(description='write what is walked, as in parameter = "frequency"'), AfterValidator(known_parameter)
    ]
    #: begin, end: The range: the study goes from the first value to the second. In a table they are called ``from`` and
    #: ``to``; by default it begins at the value of the system.
    begin: Annotated[float, OPEN, Field(alias="from", validate_default=True), WITH_UNIT, AfterValidator(_begins)]
    end: Annotated[
        float, Field(alias="to", description="write the value at which the walk ends"), WITH_UNIT, AfterValidator(_ends)
    ]

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table; it begins at the value of the system if the table says nothing else."""
        return cls(**{"begin": system[values["parameter"]], **values})

    def refuse_invalid(self, system: System) -> None:
        """Refuse ends of the range that no system can have."""
        for value in self.ends:
            system.at({self.parameter: value})

    def first_system(self, system: System) -> System:
        """Return the system at the first value of the parameter."""
        return system if system[self.parameter] == self.begin else system.at({self.parameter: self.begin})

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the range, the smaller one first."""
        return min(self.begin, self.end), max(self.begin, self.end)

    @property
    def range_words(self) -> str:
        """The parameter and its range in words."""
        return f"{self.parameter} from {self.begin:g} to {self.end:g}"


def is_allowed(value: float | None, info: ValidationInfo[Surroundings]) -> float | None:
    """Refuse a value that the parameter of the same table cannot have."""
    return None if value is None else check_value(value, info.data.get("parameter"), info.context)


def _differs(end: float, info: ValidationInfo[Surroundings]) -> float:
    if info.data.get("begin") == end:
        raise ValueError(f"is {end:g}, where the range begins; make it wider")
    return end


@dataclass(frozen=True, slots=True)
class ParameterRange:
    """A parameter of the model, and its range.

    Examples
    --------
    >>> gw.studies.ParameterRange("frequency", 1.6, 0.6).ends
    (0.6, 1.6)
    """

    #: Its name.
    parameter: Annotated[
        str, Field(description='write its name, as in parameter = "mean.q1"'), AfterValidator(known_parameter)
    ]
    #: begin, end: The range; in a table they are called ``from`` and ``to``.
    begin: Annotated[
        float, Field(alias="from", description="write where its range begins"), WITH_UNIT, AfterValidator(is_allowed)
    ]
    end: Annotated[
        float,
        Field(alias="to", description="write where its range ends"),
        WITH_UNIT,
        AfterValidator(is_allowed),
        AfterValidator(_differs),
    ]

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the range, the smaller one first."""
        return min(self.begin, self.end), max(self.begin, self.end)

    @property
    def words(self) -> str:
        """Name and range in words."""
        return f"{self.parameter} from {self.begin:g} to {self.end:g}"


def is_another(second: Any, info: ValidationInfo[Surroundings]) -> Any:
    """Refuse a second parameter that is the first one."""
    if second.parameter == info.data.get("parameter"):
        raise ValueError(f"has the parameter {given(second.parameter)}, which is the first one; choose another")
    return second


Second = Annotated[
    ParameterRange,
    Field(description='write the second parameter, as in second = { parameter = "mean.q1", from = 0.1, to = 0.5 }'),
    AfterValidator(is_another),
]
"""The second parameter of a study in a plane of two."""


def check_measure(system: System | None, measure: str) -> None:
    """Raise a ValueError if motions of a system have no such measure."""
    asked = parsed(measure)
    if asked is None:
        raise ValueError(f"is {given(measure)}; it must be one of {EXAMPLES}, a dot and a signal, as in half.q1")
    known = [] if system is None else signal_names(system)
    if system is not None and asked.kind == IMPACTS:
        known = [contact.name for contact in system.structure.contacts]
    for signal in (each for each in asked.signals if known and each not in known):
        raise ValueError(f"is {given(measure)}, but there is no signal {signal}; {did_you_mean(signal, known)}")


def _can_be_measured(measure: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    if measure is not None:
        check_measure(info.context.system, measure)
    return measure


def _has_contacts(method: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    system, needs = info.context.system, Method.named(method).needs_contacts if method else ""
    if needs and system and not system.structure.contacts:
        raise ValueError(f"is {given(method)}, which {needs}, and there is no contact; write {given(Shooting.name)}")
    return method


def _is_meant(balance: object, info: ValidationInfo[Surroundings]) -> object:
    if isinstance(balance, Mapping) and info.data.get("method", "") is None:
        raise ValueError(
            f"is for harmonic balance, but no method is named, which means {given(Shooting.name)}; "
            f"write method = {given(Balance.name)} in the study, or leave the table out"
        )
    return balance


def _suits_the_excitation(balance: Balance, info: ValidationInfo[Surroundings]) -> Balance:
    if info.context.system and info.data.get("method") == Balance.name:
        balance.pose(info.context.system)
    return balance


def _method_names() -> list[str]:
    return [method.name for method in Method.known()]


@dataclass(frozen=True)
class BranchOptions(RangeStudy):
    """Options of all studies of branches: a first orbit, and the range of one parameter."""

    table_types: ClassVar[Mapping[str, Any]] = {
        "method": (
            Annotated[Annotated[str, BeforeValidator(one_of(_method_names))] | None, AfterValidator(_has_contacts)],
            None,
        ),
        "shooting": (key_type(Shooting), Shooting()),
        "balance": (
            Annotated[key_type(Balance), BeforeValidator(_is_meant), AfterValidator(_suits_the_excitation)],
            Field(default_factory=table_schema(Balance), validate_default=True),
        ),
    }

    #: Measure in pictures and tables: ``max``, ``min``, ``half`` (half the peak to peak), ``peak_to_peak``, ``mean``,
    #: ``rms``, or an order such as ``order2`` or ``order2+4+6``; a dot, and a coordinate or another signal, for example
    #: ``"half.q1"``; as `Orbit.measure`.
    measure: Annotated[str, OPEN, AfterValidator(_can_be_measured)]
    period: Annotated[int, Ge(1), Le(MAX_PERIOD)] = 1  #: Number m of forcing periods after which the orbits repeat.
    #: Start of the search for the first orbit; or the state itself at theta = 0: positions, velocities, then
    #: extensions, which are 0 if they are left out.
    start: StartOrState = Start.SETTLE
    walk: WalkOptions = field(default_factory=WalkOptions)  #: Numerical options of the walk.
    #: How orbits are computed: `Shooting`, `Balance`, or another `gapwalk.orbit.method.Method`. In a file, ``method``
    #: names it, and the tables ``shooting`` and ``balance`` have the options of these two.
    method: Method = field(default_factory=Shooting)
    #: True to verify the complete result by other means; see `gapwalk.verify`.
    verify: bool = field(default=False, compare=False)  # it changes nothing of what is found

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table; it shows half of the first coordinate if the table says nothing else."""
        found = {"measure": f"half.{system.coordinates[0]}", **values}
        tables = (found.pop("shooting"), found.pop("balance"))
        method = Method.named(found["method"] or Shooting.name)
        found["method"] = next((table for table in tables if type(table) is method), method())
        return super().of_table(found, system)

    @classmethod
    def unused(cls, table: Mapping[str, object]) -> tuple[str, ...]:
        """Return the tables of other methods, if there are any."""
        name = table.get("method") or Shooting.name
        return tuple(f"study.{other}" for other in (Shooting.name, Balance.name) if other in table and other != name)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return f"{self.kind} over {self.range_words}, period {self.period}, showing {self.measure}"


@dataclass(frozen=True)
class SearchTable:
    """The table of a search: the values of the parameter, and the options."""

    values: Annotated[
        CountOrValues, Field(description="write at how many values of the parameter to search, or a list of them")
    ]
    options: Annotated[SearchOptions, INLINE] = SearchOptions()


def _suits(search: SearchTable | None, info: ValidationInfo[Surroundings]) -> SearchTable | None:
    """Refuse values outside the range of the study, and a box whose size is not that of the state."""
    if search is None:
        return None
    ends, system, box = (info.data.get("begin"), info.data.get("end")), info.context.system, search.options.box
    if isinstance(search.values, tuple) and None not in ends:
        check_inside(search.values, "values", ends)
    if box is not None and system and len(box) != 2 * system.size:
        raise ModelError(
            f"box is a list of {len(box)} numbers; it must have {2 * system.size}: half-widths of the box of starts in "
            "the positions, then in the velocities"
        )
    return search


SEARCH_KEYS: Mapping[str, Any] = {
    "search_values": None,
    "search": (Annotated[key_type(SearchTable) | None, AfterValidator(_suits)], None),
}
"""The keys of a search: a table of its own."""


def with_search(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a table, including those of its table of the search."""
    rest = {name: value for name, value in values.items() if name != "search"}
    search: SearchTable | None = values.get("search")
    return rest if search is None else {**rest, "search_values": search.values, "search": search.options}


def search_words(values: int | tuple[float, ...]) -> str:
    """Describe the values of a search, as part of the line of `plan`."""
    count = values if isinstance(values, int) else len(values)
    return f", with a search at {count} values" if count else ""


def kinds_key(known: Callable[[], Iterable[Kind]]) -> Any:
    """Return the type of a key that lists kinds of special points."""
    return Annotated[
        list[Annotated[Kind, PlainValidator(one_of(known))]],
        Field(min_length=1),
        AfterValidator(lambda kinds: tuple(dict.fromkeys(kinds))),
    ]


# Columns that several tables share: measures of a motion, parameters, the coverage of a search.


def measure_values(point: BranchPoint | LocusPoint) -> list[float]:
    """Return the measures of a point, in the order of `measure_names`."""
    return [point.measure(name) for name in measure_names(point.orbit.system.coordinates)]


def method_names(options: BranchOptions) -> list[str]:
    """Return the headings of method-specific columns: for harmonic balance, harmonics and truncation error."""
    return list(options.method.columns)


def special_rows(
    branches: Iterable[tuple[str, Branch]], diagram: Diagram | None = None, measure: str = ""
) -> Iterator[dict[str, Any]]:
    """Yield the rows of the special points of some named branches, in the order of the walks."""
    # The rows of a diagram name the branches that begin or end at each point.
    for number, (name, branch) in enumerate(branches, start=1):
        for index, special in enumerate(branch.special_points):
            leads = {} if diagram is None else {"leads_to": tuple(m.name for m in diagram.attached(name, index))}
            yield {"branch": number, "name": name, "period": branch.period, **point_row(special, measure), **leads}


def table_rows(rows: Iterable[Mapping[str, Any]], *parameters: str, system: System) -> Rows:
    """Yield the headings and the rows of a table of points; headings of parameters are their names."""
    names = parameter_headings(parameters, system.coordinates)
    known = {"leads_to": "leads.to", **dict(zip(("parameter", "second"), names, strict=False))}
    return rows_of(({known.get(name, name): value for name, value in row.items()} for row in rows), _EMPTY)


_EMPTY = ("branch", "name", "period", "kind")  # headings of a table without any special point


COVERAGE = ("value", "starts", "settled", "not_periodic", "ran_away", "newton_starts", "orbits", "new", "unseen_share")
"""The headings of `coverage_rows`."""


def coverage_rows(result: SearchResult) -> list[list[float]]:
    """Return the coverage of a search at each value of the parameter: starts, orbits found, and what may be missing."""
    # `orbits` counts the orbits found, `new` those that are not on a branch known before. With 95 % confidence, a
    # periodic attractor that was never found attracts no more than `unseen_share` of the box of starts.
    return [
        [
            tally.value,
            tally.starts,
            tally.settled,
            len(tally.unsettled),
            tally.ran_away,
            tally.newton_starts,
            len(result.at(tally.value)),
            sum(found.is_new for found in result.at(tally.value)),
            unseen_share(tally.settled),
        ]
        for tally in result.tallies
    ]


def measure_doubts(system: System, options: StudyKind) -> list[str]:
    """Describe what is wrong with the measure that a study of branches shows, a sentence each."""
    # Beyond the clearance of a rigid stop there is no motion: where the stop is struck, the largest value of its
    # coordinate is that clearance, whatever the motion does.
    if not isinstance(options, BranchOptions):
        return []
    kind, _, coordinate = options.measure.partition(".")
    if coordinate not in system.coordinates:
        return []
    above, below = _stops(system, coordinate)
    held = {"max": above, "min": below, "half": above if below else ""}.get(kind, "")
    if not held:
        return []
    both = f"{above} and {below}" if kind == "half" and above != below else held
    clearance, struck = ("clearances", "they are") if both != held else ("clearance", "it is")
    other = f"rms.{coordinate}" if above and below else f"half.{coordinate}"
    return [
        f"{options.measure} is the {clearance} of {both} wherever {struck} struck, for a rigid stop lets nothing "
        f'beyond; write measure = "{other}", which shows the motion'
    ]


def _stops(system: System, coordinate: str) -> tuple[str, str]:
    """Return the rigid stops that bound a coordinate alone, above and below; empty for none."""
    place, found = system.coordinates.index(coordinate), ["", ""]
    moved = {variation.contact for variation in system.structure.variations if variation.is_deflection}
    for number, form in enumerate(system.structure.contacts):
        vector = system.vector(form.vectors[0])
        if form.law.rebounds and number not in moved and np.flatnonzero(vector).tolist() == [place]:
            for contact, side, _ in system.breakpoints:
                if contact == number:
                    found[0 if side * vector[place] > 0.0 else 1] = form.name
    return found[0], found[1]
