"""The study of a sweep: the state is carried over a range of a parameter, segment by segment of its values."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray
from pydantic import AfterValidator, ValidationInfo

from gapwalk.attractors.many_motions import BatchMotions, enough, motions_of
from gapwalk.attractors.regimes import Regime, RegimeOptions, judge, regime_word, settle_doubts
from gapwalk.attractors.settle import has_settled, period_of
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box, with_extensions
from gapwalk.ensemble.batch_flow import state_at_rest, within_stops
from gapwalk.errors import FlowError, ModelError, WorkError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.motion import check_state
from gapwalk.model.bounds import Bounded, Counted, Natural, check_fields
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import parameter_headings
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_kind import INLINE, OPEN, AnswerFinding, Found, Work
from gapwalk.studies.study_schema import CountOrStates, Surroundings, check_signal, key_type
from gapwalk.summary import Rows, SummaryParts, Tables

if TYPE_CHECKING:
    from typing import Self


# Record and options of a sweep: settled motions over a parameter, sampled once every forcing period.

_MOST = 100_000_000  # states that are kept


class Way(StrEnum):
    """Order in which the values are visited."""

    UP = "up"
    """From the lowest to the highest, the state carried over."""
    DOWN = "down"
    """From the highest to the lowest, the state carried over."""
    AGAIN = "again"
    """At each value from the start again."""

    @classmethod
    def _missing_(cls, value: object) -> Way | None:
        """Read its earlier name, which older files have."""
        return cls.AGAIN if value == "afresh" else None

    @property
    def number(self) -> int:
        """A fixed number of this order, which does not depend on the other orders used."""
        return list(Way).index(self)


@dataclass(frozen=True, slots=True)
class Patience(Bounded):
    """Limits on the length of a transient."""

    #: shortest, longest: Least and largest number of forcing periods of a transient.
    shortest: Counted = 48
    longest: Counted = 2000
    #: Distance from the limiting periodic motion below which it has settled; in half-widths of the box of states.
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        check_fields(self)
        if self.longest < self.shortest:
            raise ModelError(f"longest is {self.longest}; it must be at least {self.shortest}, the shortest transient")
        if not 1e-12 <= self.tolerance <= 1e-2:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-12 and 1e-2 (half-widths)")


BLOCK = 20
"""Values in a segment: one piece of work, and what a killed run loses at most of each lane."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One start of a sweep, with one order of the values."""

    way: Way  #: Order in which the values are visited.
    start: int  #: Number of the start, from 1.
    state: NDArray[np.float64]  #: shape (state_size,): The start.

    @property
    def is_carried(self) -> bool:
        """True if the state is carried over from one value to the next; otherwise each begins at the start."""
        return self.way is not Way.AGAIN

    def __repr__(self) -> str:
        return f"Lane({self.way}, start {self.start})"


@dataclass(frozen=True, eq=False)
class SweepSegment:
    """Motions at the values of a segment, in the order in which they were visited."""

    #: lane, number: Index of the lane in the sweep, and of the segment in the lane.
    lane: int
    number: int
    #: shape (count, points, state_size): States a forcing period apart; nan where the motion has diverged, and later if
    #: the state is carried over.
    sections: NDArray[np.float64]
    transients: NDArray[np.intp]  #: shape (count,): Forcing periods before the section points.
    settled: NDArray[np.bool_]  #: shape (count,), bool: True if the transient had settled.
    regimes: tuple[str, ...]  #: Regimes in words; empty where there are no points.
    note: str = ""  #: Reason why it ended before its last value; empty if it did not.

    @property
    def last(self) -> NDArray[np.float64]:
        """The state with which the next segment continues, shape (state_size,)."""
        return self.sections[-1, -1]


@dataclass(frozen=True, slots=True)
class Band:
    """A range of the parameter in which the regime is the same."""

    regime: str  #: In words, such as ``period 3``.
    #: low, high: Its ends, halfway to the next values of another regime.
    low: float
    high: float
    count: int  #: Number of values in it.


def bands_of(values: NDArray[np.float64], regimes: Sequence[str]) -> tuple[Band, ...]:
    """Return the bands of equal regimes along increasing values; empty regimes belong to no band."""
    edges = np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]))
    bands, first = [], 0
    for regime, group in groupby(regimes):
        count = len(list(group))
        if regime:
            bands.append(Band(regime, float(edges[first]), float(edges[first + count]), count))
        first += count
    return tuple(bands)


@dataclass(frozen=True, eq=False)
class Sweep(Shown):
    """The settled motions over a parameter.

    Examples
    --------
    >>> sweep.values.shape, [band.regime for band in sweep.bands(lane=0)]
    ((9,), ['period 1', 'period 2', 'period 1'])
    """

    system: System  #: The system; its own value of the parameter plays no role.
    parameter: str  #: Name of the parameter.
    values: NDArray[np.float64]  #: shape (steps,): Its values, increasing.
    lanes: tuple[Lane, ...]  #: The starts and orders of values, in the order of the first axis of the arrays below.
    #: shape (lanes, steps, points, state_size): The states at the start of forcing periods, one after the other; nan
    #: where there is nothing.
    sections: NDArray[np.float64]
    transients: NDArray[np.intp]  #: shape (lanes, steps): Forcing periods before the section points.
    #: shape (lanes, steps), bool: True if the transient had settled; False if it reached its longest length.
    settled: NDArray[np.bool_]
    #: shape (lanes, steps), str: Regime of each motion in words: ``period 3``, ``quasi-periodic``, ``chaotic``,
    #: ``undecided``, ``diverges``, or ``not periodic`` where no more can be said of a large system; empty where there
    #: is nothing.
    regimes: NDArray[np.str_]
    complete: bool = False  #: False if the work was stopped before its end.
    notes: tuple[str, ...] = ()  #: Failures: what could not be done, in sentences.

    def bands(self, lane: int = 0) -> tuple[Band, ...]:
        """Return the bands of equal regimes along a lane, in the order of the parameter."""
        return bands_of(self.values, self.regimes[lane].tolist())

    def section(self, coordinate: str | None = None, lane: int | None = None) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return all section points of a coordinate or of its velocity: the values of the parameter, and its own.

        Parameters
        ----------
        coordinate
            Its name, or that with a dash for its velocity: ``q1'``. By default the first one.
        lane
            Index of the lane; by default all lanes.

        Returns
        -------
        values : array, shape (count,)
            Values of the parameter, one for each section point.
        points : array, shape (count,)
            The coordinate or velocity at each.
        """
        place = self.place(coordinate)
        sections = self.sections if lane is None else self.sections[lane : lane + 1]
        y = sections[..., place]
        x = np.broadcast_to(self.values[:, None], y.shape)
        seen = ~np.isnan(y)
        return x[seen], y[seen]

    def place(self, coordinate: str | None) -> int:
        """Return the place of a coordinate or a velocity in a state; errors as `section`.

        Parameters
        ----------
        coordinate
            Its name, or that with a dash for its velocity; None for the first one.
        """
        names = self.system.state_names
        name = names[0] if coordinate is None else coordinate
        if name not in names:
            raise ModelError(f"there is no coordinate {name!r}; there are {', '.join(names)}")
        return names.index(name)

    def tables(self) -> Tables:
        """Return the tables of section points and of the regime of each motion."""
        return {"points": self._point_rows, "regimes": self._regime_rows}

    def _point_rows(self) -> Rows:
        headings = parameter_headings([self.parameter], self.system.coordinates)
        yield ["way", "start", *headings, "point", *self.system.state_names]
        sections = self.sections.reshape(-1, *self.sections.shape[2:])
        for head, section in zip(self._heads(), sections, strict=True):
            for number, state in enumerate(section[~np.isnan(section[:, 0])].tolist(), start=1):
                yield [*head, number, *state]

    def _regime_rows(self) -> Rows:
        names = self.system.coordinates
        yield ["way", "start", *parameter_headings([self.parameter], names), "regime", "transient", "settled"]
        flat = (self.regimes.ravel(), self.transients.ravel(), self.settled.ravel())
        for head, regime, transient, settled in zip(self._heads(), *(part.tolist() for part in flat), strict=True):
            yield [*head, regime, transient, settled]

    def _heads(self) -> Iterator[tuple[object, ...]]:
        values = self.values.tolist()
        return ((lane.way.value, lane.start, value) for lane in self.lanes for value in values)

    def __repr__(self) -> str:
        low, high = self.values[0], self.values[-1]
        seen = int(np.count_nonzero(self.regimes != ""))
        state = "complete" if self.complete else f"{seen} of {self.regimes.size} values"
        return f"Sweep({self.parameter} from {low:g} to {high:g}, {len(self.lanes)} lanes, {state})"


def blank_sweep(
    system: System, parameter: str, values: NDArray[np.float64], lanes: tuple[Lane, ...], points: int
) -> Sweep:
    """Return a sweep in which nothing has been done yet; `enter` fills its arrays."""
    count, steps, size = len(lanes), len(values), system.state_size
    return Sweep(
        system,
        parameter,
        values,
        lanes,
        np.full((count, steps, points, size), np.nan),
        np.zeros((count, steps), dtype=np.intp),
        np.zeros((count, steps), dtype=bool),
        np.full((count, steps), "", dtype="<U16"),
    )


def enter(sweep: Sweep, segment: SweepSegment) -> str:
    """Write a segment into the arrays of a sweep; return a sentence on a failure, or an empty text."""
    # This keeps only one copy of the section points in memory.
    lane = sweep.lanes[segment.lane]
    places = places_of(lane.way, len(sweep.values), segment.number)
    sweep.sections[segment.lane, places] = segment.sections
    sweep.transients[segment.lane, places] = segment.transients
    sweep.settled[segment.lane, places] = segment.settled
    sweep.regimes[segment.lane, places] = segment.regimes
    if not segment.note:
        return ""
    ends = " and ends there" if lane.is_carried else ""
    return f"start {lane.start}, {lane.way}: the motion could not be followed{ends}: {segment.note}"


def places_of(way: Way, steps: int, number: int) -> NDArray[np.intp]:
    """Return the places of the values of a segment, in the order in which they are visited."""
    places = np.arange(number * BLOCK, min((number + 1) * BLOCK, steps))
    return steps - 1 - places if way is Way.DOWN else places


# A segment of a sweep: some values of the parameter, each from the state in which the last motion settled.
#
# The returns of a transient show whether it has died away. Motions that do not repeat are quasi-periodic, chaotic, or
# locked to a long period; each value gets a regime, and equal regimes next to each other are a band.

_GROWTH = 1.25  # of the length of a transient from one look at it to the next


class Settled(NamedTuple):
    """End of a transient."""

    state: NDArray[np.float64]  #: shape (state_size,): Its last state.
    periods: int  #: Forcing periods that it took.
    is_settled: bool  #: False if it was still changing at the limit of its length.


def let_settle(
    flow: Flow,
    coefficients: NDArray[np.float64],
    state: NDArray[np.float64],
    box: NDArray[np.float64],
    max_period: int,
    patience: Patience,
) -> Settled:
    """Follow the transient from a state until it has settled."""
    # `gapwalk.attractors.settle` judges it: its nearest returns shrink towards an orbit that is closer than the
    # tolerance, or they neither shrink nor grow and its averages do not drift, as on a torus or in chaos.
    #
    # Shapes: `state`, `box` (state_size,).
    states, length = np.asarray(state, dtype=float)[None, :], max(patience.shortest, 2 * max_period + 8)
    length = min(length, patience.longest)
    while True:
        more = length - (len(states) - 1)
        path = _strobes(flow, coefficients, states[-1], more)
        states = np.vstack((states, path[1:]))
        if has_settled(states / box, max_period, patience.tolerance):
            return Settled(states[-1], length, True)
        if length >= patience.longest:
            return Settled(states[-1], length, False)
        length = min(math.ceil(_GROWTH * length), patience.longest)


def _strobes(
    flow: Flow, coefficients: NDArray[np.float64], state: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Return a state and those after each of some forcing periods, shape (count + 1, state_size)."""
    if not any(contact.law.rebounds for contact in flow.equations.layout.structure.contacts):
        return flow.sample(coefficients, state, PERIOD * np.arange(count + 1.0)).states
    # the rounding of an angle grows with it, and then the last impacts before a stop is held are lost in it
    path = [state]
    for _ in range(count):
        path.append(flow.integrate(coefficients, path[-1]).state)
    return np.array(path)


NOT_PERIODIC, RUNS_AWAY = "not periodic", Regime.RUNAWAY.text


def regime_of(section: NDArray[np.float64], box: NDArray[np.float64], max_period: int) -> str:
    """Return the regime of section points: ``period m`` with the smallest m after which all return, or not periodic."""
    # Shapes: `section` (points, state_size); `box` (state_size,).
    period = period_of(section / box, max_period)
    return regime_word(Regime.PERIODIC, period) if period else NOT_PERIODIC


_RETURNS = 64  # forcing periods in which a motion may still become periodic: it has settled already


def wandering_words(
    system: System, parameter: str, values: NDArray[np.float64], states: NDArray[np.float64], max_period: int
) -> Sequence[str]:
    """Return the regimes of motions in words; all are judged together, as for a regime map."""
    # Shapes: `values` (count,); `states` (count, state_size).
    if not len(values):
        return []
    motions = motions_of(system, states, {parameter: values})
    if not isinstance(motions, BatchMotions):
        return [NOT_PERIODIC] * len(values)
    systems = [partial(system.at, {parameter: value}) for value in values.tolist()]
    scales = np.array([system().state_scales() for system in systems])
    options = RegimeOptions(longest=_RETURNS, max_period=max_period, forces=False)
    verdicts, _ = enough(motions, partial(judge, states=states, scales=scales, options=options))
    found = settle_doubts(verdicts, systems)
    return [regime_word(*pair) for pair in zip(found.regimes.tolist(), found.periods.tolist(), strict=True)]


@dataclass(frozen=True, eq=False)
class Task:
    """One segment of a sweep, as a piece of work."""

    #: system, parameter, options: As in `gapwalk.sweep`.
    system: System
    parameter: str
    options: SweepStudy
    box: NDArray[np.float64]  #: shape (state_size,): Half-widths of the box of states.
    #: lane, index, number: The lane, its index in the sweep, and the index of the segment in the lane.
    lane: Lane
    index: int
    number: int
    #: places, values: shape (count,): The values in the order in which they are visited, and their places among those
    #: of the sweep.
    places: NDArray[np.intp]
    values: NDArray[np.float64]
    state: NDArray[np.float64]  #: shape (state_size,): State at which the first transient begins.


def sweep_stretch(task: Task) -> SweepSegment:
    """Visit the values of a segment. The result depends only on the task, so any process may do it."""
    options, box, is_carried = task.options, task.box, task.lane.is_carried
    count, size = len(task.values), len(task.state)
    sections = np.full((count, options.points, size), np.nan)
    transients, settled = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=bool)
    regimes, note = [""] * count, ""
    line = ParameterLine(task.system, task.parameter)
    state, flow, pattern = task.state, None, np.empty(0)
    for row, value in enumerate(task.values.tolist()):
        coefficients = line.coefficients(value)[0]
        if flow is None or not np.array_equal(pattern, coefficients != 0.0):
            flow, pattern = flow_of(line.system_at(value)), coefficients != 0.0
        start = _kicked(state if is_carried else task.state, task, int(task.places[row]), value)
        try:
            found = let_settle(flow, coefficients, start, box, options.max_period, options.patience)
            path = _strobes(flow, coefficients, found.state, options.points)
        except FlowError as error:
            regimes[row] = RUNS_AWAY
            note = note or f"{task.parameter} = {value:.10g}: {error}"
            if is_carried:
                break
            continue
        sections[row], state = path[1:], path[-1]
        transients[row], settled[row] = found.periods, found.is_settled
        regimes[row] = regime_of(sections[row], box, options.max_period)
    rest = [row for row, regime in enumerate(regimes) if regime == NOT_PERIODIC]
    words = wandering_words(task.system, task.parameter, task.values[rest], sections[rest, -1], options.max_period)
    for row, word in zip(rest, words, strict=True):
        regimes[row] = word
    return SweepSegment(task.index, task.number, sections, transients, settled, tuple(regimes), note)


def _kicked(state: NDArray[np.float64], task: Task, place: int, value: float) -> NDArray[np.float64]:
    """Return the state with a small disturbance that depends on the seed, the lane and the value alone."""
    kick, lane, here = task.options.kick, task.lane, None
    if any(contact.law.rebounds for contact in task.system.structure.contacts):
        here = task.system.at({task.parameter: float(value)})
        state = state_at_rest(here, state)  # a stop may be elsewhere at this value
    if kick == 0.0:
        return state
    seed = np.random.SeedSequence(task.options.seed, spawn_key=(lane.way.number, lane.start, place))
    size, moved = 2 * task.system.size, np.zeros(len(state))  # an extension stays: friction would not let it be larger
    moved[:size] = kick * task.box[:size] * np.random.default_rng(seed).uniform(-1.0, 1.0, size)
    # a motion that rests on a rigid stop cannot be pushed through it, but away from it
    ways = np.array([state + moved, state - moved, state])
    return ways[0] if here is None else ways[int(np.argmax(within_stops(here, ways)))]


_BANDS = 40  # bands of equal motions that a summary lists


STRETCH = Part("segment", SweepSegment, numbered=True)


def _is_a_signal(signal: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    system = info.context.system
    return signal and check_signal(signal, system.state_names if system else [])


@dataclass(frozen=True)
class SweepStudy(RangeStudy):
    """A sweep: settled motions over one parameter.

    At each value the transient is followed until it has settled; then section points are recorded. The state is carried
    over to the next value, with a tiny random disturbance.

    Raises
    ------
    ModelError
        For an unknown parameter, an empty range, or starts that are no states.

    Examples
    --------
    >>> found = gw.sweep(system, "frequency", (0.6, 1.0), steps=9, points=13)
    >>> [(band.regime, round(band.low, 3), round(band.high, 3)) for band in found.bands()]
    [('period 1', 0.6, 0.725), ('period 2', 0.725, 0.875), ('period 1', 0.875, 1.0)]
    """

    kind: ClassVar[str] = "sweep"
    answer: ClassVar[Part | None] = Part("sweep", Sweep)  # made of the segments
    not_asked: ClassVar[tuple[str, ...]] = ("signal", "block")
    table_types: ClassVar[Mapping[str, Any]] = {"starts": key_type(CountOrStates), "block": None}

    #: Signal in the picture: a coordinate, or its velocity (``q1'``). By default the first coordinate.
    signal: Annotated[str, OPEN, AfterValidator(_is_a_signal)] = ""
    block: int = BLOCK  #: Values in a segment; not a key of a table. A file with other segments cannot be continued.

    steps: Annotated[int, Ge(2)] = 500  #: Number of values, spread evenly over the range, both ends included.
    #: ``"up and down"``, ``"up"``, ``"down"``, or ``"again"``: each value begins from the starts. Any of them may be
    #: joined by "and".
    ways: str = "up and down"
    #: Section points at each value: states a forcing period apart, once the transient has settled.
    points: Annotated[int, Ge(2)] = 100
    #: Number of starts: the first one is rest, the others are spread over the box of states. Or the states themselves,
    #: each of 2n numbers, or more with extensions.
    starts: int | tuple[tuple[float, ...], ...] = 1
    seed: Natural = 0  #: Seed of the starts and of the kicks: the same seed gives the same result.
    #: Longest period, in forcing periods, that is distinguished from a motion that is not periodic.
    max_period: Annotated[int, Ge(1)] = 12
    patience: Annotated[Patience, INLINE] = Patience()  #: Limits on the length of the transient at each value.
    #: Size of a random disturbance at each value, in half-widths of the box of states. Like the noise in a test rig, it
    #: prevents motions from staying on an unstable orbit. 0: none.
    kick: float = 1e-7
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.starts, int) and (isinstance(self.starts, bool) or self.starts < 1):
            raise ModelError(f"starts is {self.starts!r}; it must be an integer >= 1, or a list of states")
        starts = self.starts if isinstance(self.starts, int) else len(self.starts)
        if (states := self.steps * self.points * starts) > _MOST:
            raise ModelError(
                f"steps is {self.steps:,}, with {self.points:,} points from {starts:,} starts: that makes {states:,} "
                f"states; {_MOST:,} can be kept"
            )
        if not self.starts:
            raise ModelError("starts is empty; give at least one state, or the number of starts")
        if self.points <= self.max_period:
            raise ModelError(
                f"points is {self.points}; it must be more than max_period, {self.max_period}, so that a return is seen"
            )
        if not 0.0 <= self.kick <= 1e-2:
            raise ModelError(
                f"kick is {self.kick!r}; it must lie between 0 and 1e-2 (half-widths of the box of states)"
            )
        self.each_way()

    def each_way(self) -> tuple[Way, ...]:
        """Return the ways, in the order in which they are written."""
        words = [word.strip() for word in self.ways.split(" and ")]
        words = [str(Way.AGAIN) if word == "afresh" else word for word in words]  # as older files say
        if not set(words) <= set(Way) or len(set(words)) < len(words):
            raise ModelError(
                f'ways is {self.ways!r}; write "up and down", "up", "down" or "again", or several joined by "and"'
            )
        return tuple(Way(word) for word in words)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        starts = self.starts if isinstance(self.starts, int) else len(self.starts)
        many = f", from {starts} starts" if starts > 1 else ""
        return f"sweep over {self.range_words} at {self.steps} values, {self.ways}{many}, showing {self.signal}"

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table; the picture shows the first coordinate if the table says nothing else."""
        values["signal"] = values.get("signal") or system.coordinates[0]
        return super().of_table(values, system)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call; the order of the ends plays no role."""
        low, high = sorted((values["begin"], values["end"]))
        return cls(**{**values, "begin": low, "end": high})

    def work(self, system: System) -> SweepWork:
        """Return the work on the sweep."""
        return SweepWork(system, self)

    def stored_words(self, finding: AnswerFinding) -> str:
        """Describe how many values are stored."""
        regimes = finding.found.regimes
        return f"{int(np.count_nonzero(regimes != ''))} of {regimes.size} values are stored"

    def can_be_drawn(self, found: Sweep) -> bool:
        """Return True if there is a section point; there is none if all motions have diverged."""
        return not np.isnan(found.sections).all()

    def remarks(self, found: Sweep) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return no notes: those of a sweep are failures to follow motions."""
        return (), found.notes

    def summary(self, found: Sweep) -> SummaryParts:
        """Return the bands of equal motions for each direction and start."""
        symbol = parameter_symbol(found.parameter, found.system.units)
        yield f"{symbol} from {found.values[0]:.10g} to {found.values[-1]:.10g}: {len(found.values)} values"
        for number, lane in enumerate(found.lanes):
            bands = found.bands(number)
            unsettled = int((~found.settled[number] & (found.regimes[number] != "")).sum())
            text = f"{lane.way.value}, start {lane.start}: {len(bands)} band{'s' * (len(bands) != 1)} of equal motions"
            if unsettled:
                text += f"; at {unsettled} values the transient had not settled within the allowed time"
            yield text
            for band in bands[:_BANDS]:
                yield f"  {band.low:.8g} to {band.high:.8g}: {band.regime}, {band.count} values"
            if len(bands) > _BANDS:
                yield f"  and {len(bands) - _BANDS} more: see the table of regimes"

    def document(self, found: Sweep, points: bool) -> dict[str, Any]:
        """Return the lanes with their bands of equal regimes; with the section points if wanted."""
        document: dict[str, Any] = {
            "parameter": found.parameter,
            "values": found.values.tolist(),
            "lanes": [_lane_document(found, number) for number in range(len(found.lanes))],
        }
        if points:
            for number, lane in enumerate(document["lanes"]):
                lane["sections"] = plain(found.sections[number])
        return document


def _lane_document(sweep: Sweep, number: int) -> dict[str, Any]:
    lane = sweep.lanes[number]
    return {
        "way": lane.way.value,
        "start": lane.start,
        "state": lane.state.tolist(),
        "bands": [
            {"regime": band.regime, "from": band.low, "to": band.high, "values": band.count}
            for band in sweep.bands(number)
        ],
        "transients": sweep.transients[number].tolist(),
        "settled": sweep.settled[number].tolist(),
        "regimes": sweep.regimes[number].tolist(),
    }


class _Done(NamedTuple):
    """Failure and last state of a segment, which are not in the arrays of the sweep."""

    note: str
    last: NDArray[np.float64]


class SweepWork(Work):
    """The work on one sweep: its segments, their order, and the combined result."""

    def __init__(self, system: System, asked: SweepStudy) -> None:
        parameter, (low, high) = asked.parameter, asked.ends
        at_ends = [system.at({parameter: value}) for value in (low, high)]  # refuses what no system can have
        if not low < high:
            raise ModelError(f"the range of {parameter} is from {low:g} to {high:g}: it is empty")
        self.system, self.asked = system, asked
        self.values = np.linspace(low, high, asked.steps)
        box = np.maximum(*(state_box(end) for end in at_ends))
        self.box = np.maximum(*(with_extensions(end, box) for end in at_ends))
        if isinstance(asked.starts, int):  # the first one is rest
            starts = [state_at_rest(at_ends[0]), *spread_starts(at_ends[:1], box, asked.starts, asked.seed, 0.0)[1:]]
        else:
            starts = [check_state(at_ends[0], start) for start in asked.starts]
        self.lanes = tuple(
            Lane(way, number, state) for way in asked.each_way() for number, state in enumerate(starts, start=1)
        )
        self._sweep = blank_sweep(system, parameter, self.values, self.lanes, asked.points)
        self._done: dict[tuple[int, int], _Done] = {}
        self._never = 0  # segments after the end of a lane that could not be carried on

    def take(self, known: Parts) -> None:
        """Read the segments of a file; raise a ModelError, or another ValueError, if they are not of this sweep."""
        if self.asked.block != BLOCK:
            raise ModelError(f"its segments have {self.asked.block} values, and {BLOCK} are expected")
        for place, segment in known.all(STRETCH):
            lane, number = segment.lane, segment.number
            if not (0 <= lane < len(self.lanes) and 0 <= number < self._per_lane):
                raise ModelError(f"segment {number} of lane {lane} does not belong to this sweep")
            if place != self._place(segment):
                raise ValueError("a segment is stored in the place of another one")
            count = len(places_of(self.lanes[lane].way, self.asked.steps, number))
            shape = (count, self.asked.points, self.system.state_size)
            if not segment.sections.shape == shape or not (
                len(segment.regimes) == len(segment.transients) == len(segment.settled) == count
            ):
                raise ModelError(f"segment {number} of lane {lane} has another size than those of this sweep")
            self._keep(segment)

    def parts(self, workers: Workers) -> Generator[Found]:
        """Compute and yield the remaining segments; where the state is carried over, they form a chain of tasks."""
        tasks = self._first_tasks()
        try:
            for _, segment in workers.each(sweep_stretch, tasks, in_order=False):
                self._keep(segment)
                if self.lanes[segment.lane].is_carried:
                    tasks.extend(self._next_task(segment.lane, segment.number))
                yield Found.part(STRETCH, segment, self._place(segment))
        except WorkError as error:
            names = {str(tasks[index].lane) for index in error.pieces}
            raise WorkError(f"{', '.join(sorted(names))}: {error}" if names else str(error), error.pieces) from None

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self.done == self.total

    @property
    def done(self) -> int:
        """Number of segments that are done or not needed."""
        return len(self._done) + self._never

    @property
    def total(self) -> int:
        """Number of segments of the whole sweep."""
        return len(self.lanes) * self._per_lane

    @property
    def record(self) -> Sweep:
        """The sweep so far."""
        notes = tuple(done.note for _, done in sorted(self._done.items(), key=lambda each: each[0]) if done.note)
        return replace(self._sweep, complete=self.complete, notes=notes)

    def finding(self) -> AnswerFinding:
        """Return the sweep as the finding of a study."""
        return AnswerFinding(self.asked, self.record, self.done, self.total)

    @property
    def _per_lane(self) -> int:
        return math.ceil(self.asked.steps / BLOCK)

    def _place(self, segment: SweepSegment) -> int:
        """Return the number of a segment in a file."""
        return segment.lane * self._per_lane + segment.number

    def _keep(self, segment: SweepSegment) -> None:
        self._done[segment.lane, segment.number] = _Done(enter(self._sweep, segment), segment.last.copy())
        if self._ends(segment.lane, segment.number):
            self._never += self._per_lane - 1 - segment.number

    def _ends(self, lane: int, number: int) -> bool:
        return bool(self._done[lane, number].note) and self.lanes[lane].is_carried

    def _first_tasks(self) -> list[Task]:
        tasks = []
        for index, lane in enumerate(self.lanes):
            known = [number for owner, number in self._done if owner == index]
            if not lane.is_carried:
                numbers = set(range(self._per_lane)) - set(known)
                tasks += [self._task(index, number, lane.state) for number in sorted(numbers)]
            elif known:
                tasks += self._next_task(index, max(known))
            else:
                tasks.append(self._task(index, 0, lane.state))
        return tasks

    def _next_task(self, lane: int, number: int) -> list[Task]:
        """Return the task after a segment of a lane whose state is carried over; None after the last."""
        if self._ends(lane, number) or number + 1 == self._per_lane:
            return []
        return [self._task(lane, number + 1, self._done[lane, number].last)]

    def _task(self, index: int, number: int, state: NDArray[np.float64]) -> Task:
        lane, asked = self.lanes[index], self.asked
        places = places_of(lane.way, asked.steps, number)
        where = (lane, index, number, places, self.values[places])
        return Task(self.system, asked.parameter, asked, self.box, *where, state)
