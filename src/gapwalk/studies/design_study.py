"""The study of a design: the least change of some parameters that reaches all goals, and its proof."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from statistics import mean
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from annotated_types import Ge, Le
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from gapwalk.answers.design import Design, proved
from gapwalk.answers.goals import AnyGoal, NoPoint, PeakBelow, Quiet, Resonance, peak_signal
from gapwalk.answers.least_change import Change, DesignProblem, LeastChangeOptions, Route, Tried, first_orbit
from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind, read_quantity
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.options import SEARCH_KEYS, RangeStudy, is_allowed, known_parameter, with_search
from gapwalk.studies.rattle_study import listed
from gapwalk.studies.study_kind import INLINE, Found, Job
from gapwalk.studies.study_schema import (
    WITH_UNIT,
    Start,
    StartOrState,
    Surroundings,
    key_type,
    number_in_unit,
    plain_number,
)

if TYPE_CHECKING:
    from typing import Self


ROUTE = Part("search", Route, numbered=True)
TRIED = Part("tried", Tried, numbered=True)
_USUAL, _PROOF = 8, 3  # designs that a search tries as a rule; as many take as long as the proof


@dataclass(frozen=True, slots=True)
class ChangeTable:
    """Table of a parameter that may change; fields as those of `gapwalk.ask.Change`."""

    parameter: Annotated[
        str,
        Field(description='write what may change, as in parameter = "stage2.clearance"'),
        AfterValidator(known_parameter),
    ]
    by: float = 0.5
    low: Annotated[float | None, Field(alias="from"), WITH_UNIT, AfterValidator(is_allowed)] = None
    high: Annotated[float | None, Field(alias="to"), WITH_UNIT, AfterValidator(is_allowed)] = None
    weight: float = 1.0

    @property
    def change(self) -> Change:
        """The change that it describes."""
        return Change(self.parameter, self.by, self.low, self.high, self.weight)


@dataclass(frozen=True, slots=True)
class GoalTable:
    """Table of a goal: one of `no`, `quiet`, `peak` and `resonance`, with its band or its limits."""

    no: str | None = None  #: A kind of special point that may not lie in the band.
    #: A gap that may not rattle in the band, or several: each is a goal.
    quiet: Annotated[list[str] | None, BeforeValidator(listed)] = None
    #: A contact, shaft or gear whose peak force or torque is to stay below `below` in the band; or another signal.
    peak: str | None = None
    #: Number of a natural frequency, which `order` is to meet below `below` or above `above`.
    resonance: int | None = None
    #: begin, end: The band; by default the whole range of the study.
    begin: Annotated[Any, Field(alias="from")] = None
    end: Annotated[Any, Field(alias="to")] = None
    #: below, above, order, at: The limits, the order of the excitation, and the linearisation: ``rest``, ``closed`` or
    #: ``open``.
    below: Any = None
    above: Any = None
    order: float = 1.0
    at: str = "rest"

    def __post_init__(self) -> None:
        named = [name for name in ("no", "quiet", "peak", "resonance") if getattr(self, name) not in (None, [])]
        if len(named) != 1:
            given = " and ".join(named) or "nothing"
            raise ModelError(
                f'a goal names {given}; write one of them, as in {{ no = "fold", from = 0.6, to = 0.66 }}, '
                '{ quiet = "mesh" }, { peak = "mesh", below = "40 N m" } or { resonance = 1, below = "600 rpm" }'
            )

    def goals(self, system: System, parameter: str, ends: tuple[float, float]) -> list[AnyGoal]:
        """Return the goals that it describes."""

        def read(name: str, value: object, otherwise: Any) -> Any:
            return otherwise if value is None else number_in_unit(system, name, value, " in a goal")

        if self.resonance is not None:
            below, above = (read(system.structure.pace, each, None) for each in (self.below, self.above))
            return [Resonance(self.resonance, below, above, self.order, self.at)]
        low, high = read(parameter, self.begin, ends[0]), read(parameter, self.end, ends[1])
        if self.no is not None:
            return [NoPoint(self.no, (low, high))]  # pyright: ignore[reportArgumentType, reportReturnType]
        if self.quiet:
            return [Quiet(gap, (low, high)) for gap in self.quiet]
        assert self.peak is not None
        if self.below is None:
            unit = '"40 N m"' if system.units else "2.0"
            raise ModelError(f"the goal for the peak of {self.peak} has no limit; write below = {unit}")
        return [PeakBelow(self.peak, _size(system, self.peak, self.below), (low, high))]


def _size(system: System, signal: str, value: object) -> float:
    """Return the limit of a signal in its unit."""
    if system.units is None:
        return plain_number(value, f"{signal} in a goal")
    unit = system.units.signal(peak_signal(system, signal))[1]
    if unit != "N m":
        number = str(value).removesuffix(unit).strip()
        try:
            return float(number)
        except ValueError:
            raise ModelError(f'the limit of {signal} in a goal is {value!r}; write "10 {unit}", say') from None
    try:
        quantity = read_quantity(value, QuantityKind.TORQUE)
    except ValueError as error:
        raise ModelError(f"the limit of {signal} in a goal {error}") from None
    return float(quantity.number * quantity.factor)


def _changes(tables: Iterable[ChangeTable]) -> tuple[Change, ...]:
    return tuple(table.change for table in tables)


def _suit(changes: tuple[Change, ...], info: ValidationInfo[Surroundings]) -> tuple[Change, ...]:
    """Refuse limits that do not suit the system."""
    system = None if info.context.guessed else info.context.system
    if system:
        for change in changes:
            change.bounds(system)
    return changes


@dataclass(frozen=True)
class DesignStudy(RangeStudy):
    """A design: the least change of some parameters with which the response reaches all goals, and its proof.

    The response over a range of one parameter is walked at each design. Gradients of its special points, and of the
    extremes of its measures, lead to the least weighted sum of squares of relative changes. All ways in which a goal
    may be reached are tried, and some further starts.

    Raises
    ------
    ModelError
        For unknown parameters, limits that do not contain the present values, or goals that are none of the system.
    NumericalError
        If no response of the present system is found.

    Examples
    --------
    >>> goal, nearby = gw.ask.Resonance(1, above=1.1, at="open"), {"stiffness.x.x": 0.5}
    >>> found = gw.ask.design(system, nearby, goal, "frequency", (0.6, 0.65), search_values=0, starts=0)
    >>> found.is_reached, round(found.system.parameters["stiffness.x.x"], 4)
    (True, 1.2124)
    """

    kind: ClassVar[str] = "design"
    stored: ClassVar[tuple[Part, ...]] = (ROUTE, TRIED)
    answer: ClassVar[Part | None] = Part("design", Design)
    arguments: ClassVar[tuple[str, ...]] = ("changes", "goals", "parameter", "to")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {
        "changes": (
            Mapping[str, float] | Sequence[Change],
            MISSING,
            "The parameters that may change: largest relative changes by name, or `Change` for limits and weights.",
        ),
        "goals": (AnyGoal | Sequence[AnyGoal], MISSING, "The goals: `NoPoint`, `Quiet`, `PeakBelow`, `Resonance`."),
    }
    table_types: ClassVar[Mapping[str, Any]] = {
        "changes": Annotated[
            list[key_type(ChangeTable)],
            Field(min_length=1, description='write what may change, as in changes = [{ parameter = "mean.q1" }]'),
            AfterValidator(_changes),
            AfterValidator(_suit),
        ],
        "goals": Annotated[
            list[key_type(GoalTable)],
            Field(min_length=1, description='write the goals, as in goals = [{ no = "fold", from = 0.6, to = 0.66 }]'),
        ],
        **SEARCH_KEYS,
    }

    changes: tuple[Change, ...] = field(kw_only=True)  #: The parameters that may change.
    goals: tuple[AnyGoal, ...] = field(kw_only=True)  #: The goals.
    #: period, start: Period and start of the motion at the beginning of the range, as in `gapwalk.find_orbit`.
    period: Annotated[int, Ge(1), Le(MAX_PERIOD)] = 1
    start: StartOrState = Start.SETTLE
    #: Options of the search for the least change.
    finding: Annotated[LeastChangeOptions, INLINE] = field(default_factory=LeastChangeOptions)
    #: Number of values in the bands of the goals at which isolated branches of the new design are searched for, or the
    #: values; 0: none.
    search_values: Natural | tuple[float, ...] = 6
    search: SearchOptions = SearchOptions()  #: Options of this search.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table."""
        found = with_search(values)
        begin = found.get("begin", system[found["parameter"]])
        ends = min(begin, found["end"]), max(begin, found["end"])
        for change in found["changes"]:
            if change.parameter == found["parameter"]:
                raise ModelError(f"changes names {change.parameter}, over which the response is walked; leave it out")
        try:
            goals = tuple(goal for table in found["goals"] for goal in table.goals(system, found["parameter"], ends))
            for goal in goals:
                goal.check(system, ends)
        except ModelError as error:
            raise ModelError(f"goals has one that is not possible: {error}") from None
        return super().of_table({**found, "goals": goals}, system)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call."""
        changes, goals = values["changes"], values["goals"]
        if isinstance(changes, Mapping):
            changes = [Change(name, by) for name, by in changes.items()]
        return cls(
            **{**values, "changes": tuple(changes), "goals": (goals,) if isinstance(goals, AnyGoal) else tuple(goals)}
        )

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        named = ((self.changes, "parameter"), (self.goals, "goal"))
        changes, goals = (f"{len(each)} {word}{'s' * (len(each) > 1)}" for each, word in named)
        return f"design over {self.range_words}: least change of {changes} for {goals}"

    def refuse_invalid(self, system: System) -> None:
        """Refuse changes and goals that are none of the system."""
        super().refuse_invalid(system)
        for change in self.changes:
            change.bounds(system)
        for goal in self.goals:
            goal.check(system, self.ends)

    def work(self, system: System) -> Job:
        """Return the work on the design."""
        self.refuse_invalid(system)
        return Job(self.first_system(system), self)

    def do(self, job: Job) -> Generator[Found]:
        """Do the remaining searches; then prove the best."""
        problem = self._problem(job)
        for found in problem.routes(job.all(ROUTE), dict(job.known[TRIED])):
            part, number, value = (ROUTE, len(job.known[ROUTE]), found) if isinstance(found, Route) else (TRIED, *found)
            yield job.keep(part, value, number)
        yield job.end(proved(problem, job.all(ROUTE), self.search_values, self.search))

    def _problem(self, job: Job) -> DesignProblem:
        """Return the problem, with the orbit at the beginning of the range."""
        lead = job.cached("lead", lambda: first_orbit(job.system, self.goals, self.period, self.start))
        return job.cached(
            "problem", lambda: DesignProblem(lead, self.parameter, self.end, self.changes, self.goals, self.finding)
        )

    def _steps(self, job: Job) -> list[int]:
        """Return the designs that each search has tried, those of finished searches first."""
        ended, begun = job.all(ROUTE), Counter(number // self.finding.steps for number in job.known[TRIED])
        return [*(route.steps for route in ended), *(begun[k] for k in range(len(ended), max(begun, default=0) + 1))]

    def done(self, job: Job) -> int:
        """Return the number of designs that were tried."""
        return sum(self._steps(job))

    def total(self, job: Job) -> int:
        """Return the number of designs to be tried and proved; of a search that goes on, as many as of others."""
        if self.is_complete(job):
            return self.done(job) + _PROOF
        ended, ways = job.all(ROUTE), len(self._problem(job).ways())
        usual = max(1, round(mean([route.steps for route in ended]))) if ended else _USUAL
        left = ways + min(ways, 2) * self.finding.starts - len(ended)
        going = self._steps(job)[len(ended) :]
        ahead = sum(max(usual, steps + 2) for steps in going) + usual * max(left - len(going), 0)
        return sum(route.steps for route in ended) + (ahead if left else 0) + _PROOF

    def words_so_far(self, parts: Sequence[Any], total: int) -> str:
        """See `StudyKind.words_so_far`."""
        routes = [each for each in parts if isinstance(each, Route)]
        is_last = total == sum(route.steps for route in routes) + _PROOF
        doing = "proof of the best design" if is_last else f"search {len(routes) + 1}"
        best = min((each for each in routes if each.is_reached), key=lambda each: each.change, default=None)
        if best is not None:
            return f"{doing}; best so far: norm of the relative changes {best.change:.3g}"
        near = min(routes, key=lambda each: each.missing, default=None)
        return f"{doing}; not all goals are reached so far{f': {near.words}' if near.words else ''}" if near else doing

    def so_far(self, job: Job) -> Design | None:
        """Return the best design so far, without its proof; None before the first search is done."""
        routes = job.all(ROUTE)
        return proved(self._problem(job), routes, 0, self.search, complete=False) if routes else None

    def document(self, found: Design, points: bool) -> dict[str, Any]:
        """Return the changes, goals and searches as JSON values; with the responses if wanted."""
        document: dict[str, Any] = {
            "answer": found.sentence,
            "reached": found.is_reached,
            "parameter": found.parameter,
            "within": list(found.within),
            "change": found.change,
            "changes": [plain(each) | {"percent": plain(each.percent)} for each in found.changes],
            "goals": [plain(each) | {"reached": each.verdict == "reached"} for each in found.judged],
            "searches": [plain(each) for each in found.routes],
            "proof": {
                "special_points": [special.to_dict() for special in getattr(found.response, "special_points", ())],
                "isolated": len(found.isolated),
                "searched": list(found.searched),
            },
        }
        if points:
            for name, branch in (("response", found.response), ("response_before", found.response_before)):
                along = branch.points if branch else ()
                document[name] = {"values": [each.value for each in along], "stable": [each.stable for each in along]}
        return document
