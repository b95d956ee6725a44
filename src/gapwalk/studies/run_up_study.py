"""The study of run-ups: one exact motion while the speed changes, or many at different rates and from many starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial, reduce
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, ValidationInfo

from gapwalk.answers.gap_states import SweepBy
from gapwalk.answers.lane_run_up import is_by_steps
from gapwalk.answers.order_map import OrderMap, order_map
from gapwalk.answers.run_up import JumpDelay, RunUp, run_up
from gapwalk.answers.run_ups import LEVELS, RunUps, run_ups, starts_of
from gapwalk.answers.speed_course import SpeedCourse
from gapwalk.attractors.spectrum import BAND, turns_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.walk import EndReason
from gapwalk.ensemble.batch_flow import BatchOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.ramp import Ramped
from gapwalk.model.bounds import Counted
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import parameter_headings
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.study_kind import Finding, Found, Job, Rows, StudyKind
from gapwalk.studies.study_schema import Surroundings
from gapwalk.summary import SummaryParts, TableRows, summarizes

if TYPE_CHECKING:
    from typing import Self


# The finding of run-ups: largest forces, jumps beside those of the response, and tables of one motion or of many.


@dataclass(frozen=True, eq=False)
class SlowResponse:
    """The response over the speeds of a run-up, as a slow sweep meets it; or the reason why there is none."""

    #: The response, walked from the first speed to the last one; None if no periodic motion was found there.
    branch: Branch | None
    note: str = ""  #: A sentence where the response is not known over the whole range; else empty.


@dataclass(frozen=True, eq=False)
class RunUpFinding(Finding):
    """Finding of run-ups: a single motion, or the largest forces of many."""

    asked: RunUpStudy
    found: RunUp | RunUps | None
    done: int
    response: SlowResponse | None = None

    @property
    def record(self) -> RunUp | RunUps | None:
        """The run-up, or the run-ups so far."""
        return self.found

    @property
    def complete(self) -> bool:
        """True if all run-ups are done, and the response if it is wanted."""
        return self.done == self.asked.count and not (self.asked.with_response and self.response is None)

    @property
    def stored(self) -> str:
        """Describe how many run-ups are stored."""
        text = f"{self.done} of {self.asked.count} run-ups are stored"
        if not self.asked.with_response:
            return text
        return f"{text}; their response is {'stored too' if self.response else 'not computed yet'}"

    @property
    def notes(self) -> tuple[str, ...]:
        """The reasons why a part of the response, or the level of rattle, is not known."""
        found = [self.response.note] if self.response is not None and self.response.note else []
        needed = self.asked.for_level(self.found.system) if isinstance(self.found, RunUp) else 0
        if self._map and needed and not np.isfinite(self._map.spectra.band).all():
            level = f"the level from {BAND[0]:.0f} to {BAND[1]:.0f} Hz"
            found.append(f"{level} is not known at all speeds: it needs samples = {needed} or more")
        return tuple(found)

    @property
    def drawn(self) -> dict[str, Any]:
        """Options of the picture: the response that lies below, and the orders of the waterfall."""
        options: dict[str, Any] = {"branch": self.response.branch if self.response else None}
        if isinstance(self.found, RunUp):
            options |= {"signal": self.signal, "orders": self.asked.orders, "window": self.asked.window}
        return options

    @property
    def signal(self) -> str:
        """Signal of the table and of the picture of a single run-up."""
        return self.asked.signal or (self.found.loudest if isinstance(self.found, RunUp) else "")

    @cached_property
    def _map(self) -> OrderMap | None:
        """The order map of a single run-up, if its study asks for orders."""
        if not (isinstance(self.found, RunUp) and self.asked.orders):
            return None
        return order_map(self.found, self.signal, self.asked.orders, turns=self.asked.window)

    @cached_property
    def delays(self) -> tuple[JumpDelay, ...]:
        """Jumps of a single run-up beside those of the response; none while the speed changes its direction."""
        found, response = self.found, self.response
        if not isinstance(found, RunUp) or response is None or response.branch is None or not found.course.is_one_way:
            return ()
        return found.delays(response.branch, found.coordinate_of(self.signal))

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the largest forces, with their spread for many run-ups, and the jumps beside those of the response."""
        if self.found is None:
            return
        yield from self.found.summary()
        yield from (each.words(self.found.system) for each in self.delays)
        yield from self._map.summary() if self._map else ()

    def document(self, points: bool) -> dict[str, Any]:
        """Return the largest forces; for a single run-up with the history of its signal if points are wanted."""
        found = self.found
        if found is None:
            return {}
        document: dict[str, Any] = {"run_ups": self.done, "sentences": list(found.sentences)}
        if isinstance(found, RunUp):
            document["peaks"] = [each._asdict() for each in found.peaks]
            if self.response is not None:
                document["jumps"] = [plain(each._asdict()) for each in self.delays]
            if self._map is not None:
                document["order_peaks"] = [plain(each._asdict()) for each in self._map.peaks]
            if points:
                signal = self.signal
                document["history"] = {
                    "signal": signal, "time": found.time.tolist(), "speed": found.speed.tolist(),
                    "values": found.signal(signal).tolist(),
                }  # fmt: skip
            return document
        document |= {"error": found.error, "worst": found.worst, "rates": found.rates.tolist()}
        document["contacts"] = {
            name: {"peaks": plain(found.peaks(name)), "speeds": found.places(name).tolist()} for name in found.touching
        }
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the largest forces; and the history and events of one run-up, or quantiles over the rate of many."""
        found = self.found
        if found is None:
            return {}
        if isinstance(found, RunUp):
            tables: dict[str, Callable[[], Rows]] = {
                "peaks": TableRows(lambda: _peak_rows(found), units={"force": ".force", "fastest": "'"}),
                "history": TableRows(lambda: self._history_rows(found), 1, self.signal),
                "envelope": lambda: self._envelope_rows(found),
            }
            if self.response is not None:
                pace = found.system.structure.pace
                tables["jumps"] = TableRows(self._jump_rows, units=dict.fromkeys(("fold", "jump", "delay"), pace))
            if self._map is not None:
                names = {"amplitudes": "orders", "cuts": "order-cuts", "peaks": "order-peaks"}
                tables |= {names[name]: rows for name, rows in self._map.tables().items()}
            return tables
        system, pace = found.system, found.system.structure.pace
        rate = f"{system.units.parameter(pace)}/s" if system.units else ""
        shares = {f"{name} {level:.0%}": ".force" for name in found.touching for level in LEVELS}
        return {
            "peaks": TableRows(
                lambda: _run_rows(found), units={"rate": rate, "phase": "rad", "peak.": ".force", f"{pace}.": pace}
            ),
            "rates": TableRows(lambda: _rate_rows(found), 1, units={"rate": rate, **shares}),
        }

    def _history_rows(self, found: RunUp) -> Iterator[list[object]]:
        signal = self.signal
        yield ["time", *_pace_heading(found.system), "theta", signal]
        columns = (found.time, found.speed, found.theta, found.signal(signal))
        yield from map(list, np.stack(columns, axis=1).tolist())

    def _envelope_rows(self, found: RunUp) -> Iterator[list[object]]:
        signal = self.signal
        yield [*_pace_heading(found.system), f"min.{signal}", f"max.{signal}"]
        yield from map(list, np.stack(found.envelope(signal), axis=1).tolist())

    def _jump_rows(self) -> Iterator[list[object]]:
        yield ["fold", "jump", "delay"]
        yield from plain(self.delays)


def _pace_heading(system: System) -> list[str]:
    return [*parameter_headings([system.structure.pace], system.coordinates)]


def _peak_rows(found: RunUp) -> Rows:
    yield ["contact", "force", *_pace_heading(found.system), "time", "theta", "impacts", "fastest"]
    yield from found.peaks


def _run_rows(found: RunUps) -> Iterator[list[object]]:
    names = found.touching
    pace = found.system.structure.pace
    yield ["rate", "phase", *(f"{what}.{name}" for name in names for what in ("peak", pace, "impacts"))]
    columns = [found.rates, found.phases]
    for name in names:
        impacts = found.impacts[:, :, found.contacts.index(name)].sum(axis=(1, 2))
        columns += [found.peaks(name), found.places(name), impacts]
    yield from plain(np.stack(columns, axis=1))


def _rate_rows(found: RunUps) -> Iterator[list[object]]:
    names = found.touching
    yield ["rate", *(f"{name} {level:.0%}" for name in names for level in LEVELS)]
    tables = [found.quantiles(name) for name in names]
    if tables:
        yield from map(list, np.vstack([tables[0][0], *(values for _, values in tables)]).T.tolist())


CHUNK = 64
"""Run-ups in a chunk: one part of a file, and what a killed run loses at most."""
_MOST = 1_000_000
_SAMPLES, _MOST_SAMPLES = 512, 65_536  # per forcing period, by default and at most


def _speed(value: object, info: ValidationInfo[Surroundings]) -> object:
    """Convert a text with a unit to a number in the unit of the speed."""
    system = info.context.system
    if system and system.units and value is not None:
        return system.units.read(system.structure.pace, value)
    return value


def _rates(value: object, info: ValidationInfo[Surroundings]) -> tuple[float, ...]:
    """Read one rate, or a list of them: numbers, or texts such as ``"100 rpm/s"``."""
    rows = value if isinstance(value, list | tuple) else [value]
    system, found = info.context.system, []
    for each in rows:
        if system and system.units:
            text = each.strip().replace(" / ", "/") if isinstance(each, str) else ""
            if not text.endswith("/s"):
                unit = system.units.parameter(system.structure.pace)
                raise ValueError(f'is {given(each)}; write the change of the speed per second, as in "100 {unit}/s"')
            number = float(system.units.read(system.structure.pace, text.removesuffix("/s").rstrip()))
        elif isinstance(each, bool) or not isinstance(each, int | float):
            raise ValueError(f"is {given(each)}; it must be a number, or a list of them")
        else:
            number = float(each)
        if not (number > 0.0 and math.isfinite(number)):
            raise ValueError(f"is {given(each)}; it must be positive: from and to give the direction")
        found.append(number)
    if not found:
        raise ValueError("is an empty list; write at least one rate")
    return tuple(found)


def _trace(value: object, info: ValidationInfo[Surroundings]) -> SpeedCourse | None:
    """Read a measured trace from a file beside the model file."""
    context = info.context
    if not isinstance(value, str) or not value:
        raise ValueError(f'is {given(value)}; write the name of a CSV file, as in trace = "run-up.csv"')
    if context.system is None or context.read is None:
        return None
    try:
        return SpeedCourse.read(context.read(value), context.system)
    except ModelError as error:
        raise ValueError(f"is {given(value)}, but {error}") from None
    except ValueError as error:
        raise ValueError(f"is {given(value)}, {error}") from None


def _time(value: object, info: ValidationInfo[Surroundings]) -> object:
    from gapwalk.model.units import QuantityKind, read_quantity

    system = info.context.system
    if system and system.units and isinstance(value, str):
        return read_quantity(value, QuantityKind.TIME).number
    return value


def _is_positive(value: float | None) -> float | None:
    if value is not None and not value > 0.0:
        raise ValueError(
            f"is {value:g}; it must be > 0: the excitation is given over its angle, which stands still at 0"
        )
    return value


Speed = Annotated[float | None, BeforeValidator(_speed), AfterValidator(_is_positive)]


RUN = Part("run", RunUp)
RESPONSE = Part("response", SlowResponse)
RUNS = Part("runs", RunUps, numbered=True)


@dataclass(frozen=True)
class RunUpStudy(StudyKind):
    """A run-up: the exact motion while the speed changes; or many at several rates or from several starts."""

    kind: ClassVar[str] = "run-up"
    gives_frequency: ClassVar[bool] = True
    stored: ClassVar[tuple[Part, ...]] = (RUN, RESPONSE, RUNS)
    table_types: ClassVar[Mapping[str, Any]] = {
        "rate": Annotated[Any, PlainValidator(_rates)],
        "times": None,
        "speeds": None,
        "trace": (Annotated[Any, PlainValidator(_trace)], None),
    }

    #: begin, end: Speeds between which the ramp goes, called ``from`` and ``to`` in a table.
    begin: Annotated[Speed, Field(alias="from")] = None
    end: Annotated[Speed, Field(alias="to")] = None
    #: Change of the speed per second (per unit of time without units), or several. With several rates or starts, the
    #: run-ups are computed by the batch integrator.
    rate: tuple[float, ...] = ()
    #: If not 0: number of rates, evenly spaced from the smallest `rate` to the largest one.
    steps: Annotated[int, Ge(0), Le(_MOST)] = 0
    hold: Annotated[float, BeforeValidator(_time)] = 0.0  #: Time for which the last speed is held.
    #: times, speeds: Points of a measured trace in place of the ramp; in a table, ``trace`` names a CSV file with
    #: columns of time and speed.
    times: tuple[float, ...] = ()
    speeds: tuple[float, ...] = ()
    #: Number of starts at each rate: angles of the excitation that divide its period evenly.
    starts: Annotated[int, Ge(1), Le(_MOST)] = 1
    #: Signal of the table and the picture of a single run-up, as in `RunUp.signal`; by default the coordinate of the
    #: contact with the largest force.
    signal: str = ""
    #: Samples per forcing period of a single run-up; by default 512, or with `orders` as many as the level from 500 to
    #: 5,000 Hz needs.
    samples: Annotated[int, Ge(16), Le(_MOST_SAMPLES)] | None = None
    #: True to walk the response from the first speed to the last, as a slow sweep meets it: the run-up is laid over it,
    #: with the delay of each jump.
    with_response: bool = False
    #: Highest order of the spectra of `signal` along a single run-up, shown as a waterfall; 0: none.
    orders: Annotated[float, Ge(0.0), Le(1000.0)] = 0.0
    #: Length of these spectra in turns of the reference shaft (in forcing periods without a speed): with 8, orders are
    #: 1/8 apart.
    window: Annotated[int, Ge(1), Le(10_000)] = 8
    bins: Annotated[int, Ge(2), Le(10_000)] = 100  #: Equal times into which each of many run-ups is divided.
    #: How: ``"curves"`` exactly, or in batch within `error`; ``"steps"`` by equal steps, which carry dry friction and
    #: many contacts; ``"chosen"`` by steps if there is friction, or more than one gap with more than three coordinates.
    by: SweepBy = SweepBy.CHOSEN
    error: float = 1e-4  #: Allowed error of many run-ups, as in `gapwalk.analysis.BatchOptions`.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        BatchOptions(self.error)
        if self.times:
            SpeedCourse(np.array(self.times), np.array(self.speeds))
            return
        if self.steps and len(self.rate) < 2:
            raise ModelError("steps needs the lowest and the highest rate: write rate = [lowest, highest]")
        for rate in self.rate[:1]:
            if self.begin is not None and self.end is not None:
                SpeedCourse.ramp(self.begin, self.end, rate, self.hold)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table, with a ramp or a trace."""
        trace = values.pop("trace", None)
        ramp = [key for key in ("begin", "end", "rate") if values.get(key) in (None, ())]
        if trace is not None:
            if len(ramp) < 3 or values.get("hold") or values.get("steps"):
                raise ModelError("trace already gives the speed; leave out from, to, rate, steps and hold")
            values |= {"times": tuple(trace.time.tolist()), "speeds": tuple(trace.speed.tolist())}
        elif ramp:
            names = {"begin": "from", "end": "to", "rate": "rate"}
            example = f'"100 {system.units.parameter(system.structure.pace)}/s"' if system.units else "0.01"
            missing = " and ".join(names[key] for key in ramp)
            raise ModelError(
                f"{missing} {'is' if len(ramp) == 1 else 'are'} missing: write from, to and rate = {example} for a "
                'ramp, or trace = "run-up.csv" for a measured trace'
            )
        asked = cls(**values)
        Ramped(system)  # refuses what cannot run up
        is_by_steps(system, asked.by, asked.count > 1)
        if asked.signal and (names := _signal_names(system)) and asked.signal not in names:
            raise ModelError(f"signal is {given(asked.signal)}; signals of a run-up are {', '.join(names)}")
        if asked.orders:
            asked._check_orders(system)
        for each in asked.courses[:1]:
            for end in (each.speed.min(), each.speed.max()):
                system.at({system.structure.pace: float(end)})
        return asked

    def _check_orders(self, system: System) -> None:
        """Raise a ModelError if a run-up has no spectra of these orders."""
        if self.count > 1:
            raise ModelError(
                f"orders needs a single run-up, but there are {self.count}; write one rate and leave starts and steps "
                "out, or leave orders out"
            )
        samples = self.sampling(system)
        highest = samples / 2.0 * float(system.turns or 1)
        if self.orders > highest:
            raise ModelError(
                f"orders is {self.orders:g}; with samples = {samples} there are orders up to {highest:g}: write "
                f"samples = {math.ceil(2.0 * self.orders / float(system.turns or 1))} or more"
            )
        periods = float(self.courses[0].turned[-1]) * system.structure.frequency / PERIOD
        if periods < turns_of(system, self.window):
            turns, what = (float(system.turns), "turns") if system.turns else (1.0, "forcing periods")
            raise ModelError(
                f"window is {self.window}, but the run-up lasts only {periods / turns:.3g} {what}; write a shorter one"
            )

    def sampling(self, system: System) -> int:
        """Return the samples per forcing period: as asked, or as many as are needed."""
        if self.samples is not None or not self.orders:
            return self.samples or _SAMPLES
        needed = max(2.0 * self.orders / float(system.turns or 1), self.for_level(system))
        return int(min(max(_SAMPLES, 1 << (math.ceil(needed) - 1).bit_length()), _MOST_SAMPLES))

    def for_level(self, system: System) -> int:
        """Return the samples per forcing period that the level of rattle needs at the lowest speed; 0 without units."""
        lowest = float(self.courses[0].speed.min()) * system.structure.frequency / PERIOD
        return math.ceil(2.0 * BAND[1] / lowest) if system.units else 0

    @property
    def rates(self) -> tuple[float, ...]:
        """The rates of the ramps."""
        if self.steps:
            return tuple(np.linspace(min(self.rate), max(self.rate), self.steps).tolist())
        return self.rate

    @property
    def courses(self) -> list[SpeedCourse]:
        """Speed over time at each rate."""
        if self.times:
            return [SpeedCourse(np.array(self.times), np.array(self.speeds))]
        first, last = self.begin or 0.0, self.end or 0.0  # both are given where there is no trace
        return [SpeedCourse.ramp(first, last, rate, self.hold) for rate in self.rates]

    @property
    def count(self) -> int:
        """Number of run-ups."""
        return self.starts * (1 if self.times else len(self.rates))

    @property
    def most_workers(self) -> int:
        """One for each chunk of run-ups."""
        return self.chunks

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        many = f", {self.count} of them" if self.count > 1 else ""
        return f"run-up {self.courses[0].words}{many}"

    def first_system(self, system: System) -> System:
        """Return the system at the first speed."""
        return system.at({system.structure.pace: float(self.courses[0].speed[0])})

    def do(self, job: Job) -> Generator[Found]:
        """Compute the run-ups that are left, chunk by chunk; then the response."""
        if self.count > 1:
            yield from self._many(job)
        elif job.one(RUN) is None:
            run = job.keep(RUN, run_up(job.system, self.courses[0], samples=self.sampling(job.system), by=self.by))
            yield run._replace(news=())
        if self.with_response and job.one(RESPONSE) is None:
            yield job.keep(RESPONSE, _slow_response(job.system, self.courses))._replace(news=())

    def _many(self, job: Job) -> Generator[Found]:
        courses = self.courses
        phases = PERIOD * np.arange(self.starts) / self.starts
        runs = [(course, phase) for course in courses for phase in phases.tolist()]
        free = Ramped(job.system) if is_by_steps(job.system, self.by, many=True) else None
        states = starts_of(job.system, courses[:1] * self.starts, phases, free)  # all begin at one speed
        lanes = {number: self._lanes(number) for number in range(self.chunks)}
        pieces = {
            number: ([runs[lane] for lane in some], states[[lane % self.starts for lane in some]])
            for number, some in lanes.items()
        }
        yield from job.each(RUNS, partial(_runs, job.system, self.bins, self.error, self.by), pieces)

    def _lanes(self, number: int) -> range:
        return range(number * CHUNK, min((number + 1) * CHUNK, self.count))

    def check_read(self, job: Job) -> None:
        """Raise a ValueError if the run-ups are not of this study."""
        for number, chunk in job.known[RUNS].items():
            if not 0 <= number < self.chunks or len(chunk.courses) != len(self._lanes(number)):
                raise ValueError(f"chunk {number} does not belong to these run-ups")

    def total(self, job: Job) -> int:
        """Return the number of all parts: chunks of run-ups, and the response."""
        return self.chunks + self.with_response

    @property
    def chunks(self) -> int:
        """Number of chunks of run-ups."""
        return math.ceil(self.count / CHUNK)

    def so_far(self, job: Job) -> RunUp | RunUps | None:
        """Return the run-up, or the run-ups so far."""
        if self.count == 1 or not job.known[RUNS]:
            return job.one(RUN)
        found = job.all(RUNS)
        return reduce(RunUps.joined, found[1:], replace(found[0]))

    def finding_of(self, job: Job) -> RunUpFinding | None:
        """Return the run-ups so far; None before the first are done."""
        found = job.record
        if found is None:
            return None
        return RunUpFinding(self, found, 1 if isinstance(found, RunUp) else len(found.courses), job.one(RESPONSE))


def _runs(
    system: System,
    bins: int,
    error: float,
    by: SweepBy,
    piece: tuple[list[tuple[SpeedCourse, float]], NDArray[np.float64]],
) -> RunUps:
    """Compute a chunk of run-ups; a piece of work for any process."""
    courses, phases = zip(*piece[0], strict=True)
    options = BatchOptions(error, threads=1)
    return run_ups(system, courses, phases=phases, states=piece[1], bins=bins, options=options, by=by)


def _signal_names(system: System) -> list[str]:
    blank = np.zeros(1)
    states = np.zeros((1, 2 * system.size))
    return RunUp(system, SpeedCourse.ramp(1.0, 2.0, 1.0), 16, blank, blank, blank, states, (), ()).signals


def _slow_response(system: System, courses: list[SpeedCourse]) -> SlowResponse:
    """Walk the response from the first speed of the run-ups to their most distant one."""
    pace, first = system.structure.pace, float(courses[0].speed[0])
    reached = np.concatenate([course.speed for course in courses])
    last = float(max(reached.min(), reached.max(), key=lambda speed: abs(speed - first)))
    try:
        branch = follow(find_orbit(system.at({pace: first})), pace, to=last)
    except NumericalError as error:
        return SlowResponse(None, f"the slow response, with which run-ups are compared, was not found: {error}")
    end = branch.ends[-1]
    reason = "" if end.reason is EndReason.RANGE else f"the response does not reach the last speed: {end}"
    return SlowResponse(branch, reason)
