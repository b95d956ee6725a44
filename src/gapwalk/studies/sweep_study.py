"""The study of a sweep: the state is carried over a range of a parameter, segment by segment of its values."""

from __future__ import annotations

import math
import os
from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ValidationInfo

from gapwalk.bifurcation.isolated.search_options import spread_starts, state_box, with_extensions
from gapwalk.errors import ModelError, WorkError
from gapwalk.flow.motion import check_state
from gapwalk.model.system import System, check_system
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import shows_progress
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import Finding, Found, Work, plain_numbers, values_of
from gapwalk.studies.study_registry import OPEN
from gapwalk.studies.sweep import BLOCK, Lane, Sweep, SweepOptions, SweepSegment, blank_sweep, enter, places_of
from gapwalk.studies.sweep_segment import Task, sweep_stretch
from gapwalk.studies.tables import CountOrStates, Surroundings, check_signal
from gapwalk.summary import SummaryParts, Tables, summarizes

if TYPE_CHECKING:
    from typing import Self


_BANDS = 40  # bands of equal motions that a summary lists


@dataclass(frozen=True)
class SweepFinding(Finding):
    """Finding of a sweep, complete or not."""

    sweep: Sweep

    @property
    def record(self) -> Sweep:
        """The sweep."""
        return self.sweep

    @property
    def stored(self) -> str:
        """Describe how many values are stored."""
        done = int(np.count_nonzero(self.sweep.regimes != ""))
        return f"{done} of {self.sweep.regimes.size} values are stored"

    @property
    def can_be_drawn(self) -> bool:
        """True if there is a section point; there is none if all motions have diverged."""
        return not np.isnan(self.sweep.sections).all()

    @property
    def notes(self) -> tuple[str, ...]:
        """Empty, because all notes of a sweep are failures."""
        return ()

    @property
    def failures(self) -> tuple[str, ...]:
        """Failures to follow motions, in sentences."""
        return self.sweep.notes

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the bands of equal motions for each direction and start."""
        sweep = self.sweep
        symbol = parameter_symbol(sweep.parameter, sweep.system.units)
        yield f"{symbol} from {sweep.values[0]:.10g} to {sweep.values[-1]:.10g}: {len(sweep.values)} values"
        for number, lane in enumerate(sweep.lanes):
            bands = sweep.bands(number)
            unsettled = int((~sweep.settled[number] & (sweep.regimes[number] != "")).sum())
            text = f"{lane.way.value}, start {lane.start}: {len(bands)} bands of equal motions"
            if unsettled:
                text += f"; at {unsettled} values the transient had not settled within the allowed time"
            yield text
            for band in bands[:_BANDS]:
                yield f"  {band.low:.8g} to {band.high:.8g}: {band.regime}, {band.count} values"
            if len(bands) > _BANDS:
                yield f"  and {len(bands) - _BANDS} more: see the table of regimes"

    def document(self, points: bool) -> dict[str, Any]:
        """Return the lanes with their bands of equal regimes; with the section points if wanted."""
        sweep = self.sweep
        document: dict[str, Any] = {
            "parameter": sweep.parameter,
            "values": sweep.values.tolist(),
            "lanes": [self._lane_document(number) for number in range(len(sweep.lanes))],
        }
        if points:
            for number, lane in enumerate(document["lanes"]):
                lane["sections"] = plain_numbers(sweep.sections[number].tolist())
        return document

    def tables(self) -> Tables:
        """Return the tables of section points and of the regime of each motion."""
        return self.sweep.tables()

    def _lane_document(self, number: int) -> dict[str, Any]:
        sweep, lane = self.sweep, self.sweep.lanes[number]
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


STRETCH = Part("segment", SweepSegment, numbered=True)


def _is_a_signal(signal: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    system = info.context.system
    return signal and check_signal(signal, system.state_names if system else [])


@dataclass(frozen=True)
class SweepStudy(SweepOptions, RangeStudy):
    """A sweep: settled motions over one parameter.

    Parameters
    ----------
    parameter, begin, end
        The parameter, and its range.
    steps, ways, points, starts, seed, max_period, patience, kick, workers
        Options of the sweep, as in `gapwalk.SweepOptions`.

    Examples
    --------
    >>> gw.studies.SweepStudy(parameter="frequency", begin=0.6, end=1.0, steps=9, points=13).plan
    'sweep over frequency from 0.6 to 1 at 9 values, up and down, showing '
    """

    kind: ClassVar[str] = "sweep"
    table_types: ClassVar[Mapping[str, Any]] = {"starts": key_type(CountOrStates), "block": None}

    #: Signal in the picture: a coordinate, or its velocity (``q1'``). By default the first coordinate.
    signal: Annotated[str, OPEN, AfterValidator(_is_a_signal)] = ""
    block: int = BLOCK  #: Values in a segment; not a key of a table. A file with other segments cannot be continued.

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

    def work(self, system: System) -> SweepWork:
        """Return the work on the sweep."""
        return SweepWork(system, self)


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
            starts = [np.zeros(len(self.box)), *spread_starts(at_ends, box, asked.starts, asked.seed, 0.0)[1:]]
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

    def finding(self) -> SweepFinding:
        """Return the sweep as the finding of a study."""
        return SweepFinding(self.record)

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
        return Task(self.system, asked.parameter, asked.limits, self.box, *where, state)


@shows_progress(lambda count, part, pace: str(pace))
def sweep(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    options: SweepOptions | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Sweep:
    """Compute a sweep over a range of one parameter.

    At each value the transient is followed until it has settled; then section points are recorded. The state is
    carried over exactly to the next value, up to a tiny kick.

    Parameters
    ----------
    system
        The system; its own value of the parameter plays no role.
    parameter, to
        Name of the parameter, and the range.
    options
        Options of the sweep.
    workers
        Workers; by default as many local processes as the options say, or a cluster inside of
        `gapwalk.parallel.on_cluster`. The result does not depend on it.
    report
        Called with each segment of values once it is done and written to the file.
    output
        A file to write during the work; `gapwalk.load` reads it. If it holds a part of the same sweep, that is
        continued to the same result.

    Returns
    -------
    Sweep
        The section points at each value.

    Raises
    ------
    ModelError
        For an unknown parameter, an empty range, or starts that are no states.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is the result so far, with ``complete`` False.

    Examples
    --------
    >>> found = gw.sweep(system, "frequency", (0.6, 1.0), options=gw.SweepOptions(steps=9, points=13))
    >>> [(band.regime, round(band.low, 3), round(band.high, 3)) for band in found.bands()]
    [('period 1', 0.6, 0.725), ('period 2', 0.725, 0.875), ('period 1', 0.875, 1.0)]
    """
    check_system(system, "sweep")
    low, high = sorted((float(to[0]), float(to[1])))
    asked = SweepStudy(parameter, low, high, **values_of(options or SweepOptions()))
    work = asked.work(system)
    return call(asked, work, asked.first_system(system), workers=workers, report=report, output=output).record
