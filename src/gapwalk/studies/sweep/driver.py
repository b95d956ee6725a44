"""The driver of a sweep: which segments are to be done, in what order, and what they make together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.errors import ModelError, WorkError
from gapwalk.flow.motion import check_state
from gapwalk.model.system import System
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers
from gapwalk.studies.sweep.options import SweepOptions, Way
from gapwalk.studies.sweep.record import Lane, Sweep, blank_sweep, enter, places_of, segments_of
from gapwalk.studies.sweep.segment import SweepSegment, Task, sweep_stretch

Report = Callable[[SweepSegment, Pace], object]
"""Called with each segment when it is done, and how far the sweep has come."""


class _Done(NamedTuple):
    """What is remembered of a segment besides what stands in the sweep: what failed, and where it ended."""

    note: str
    last: NDArray[np.float64]


class Driver:
    """Drives one sweep, segment by segment.

    Parameters
    ----------
    system, parameter, to, options
        As in `gapwalk.sweep`.

    Raises
    ------
    ModelError
        For an unknown parameter, an empty range, or starts that are no states.
    """

    def __init__(self, system: System, parameter: str, to: tuple[float, float], options: SweepOptions) -> None:
        low, high = sorted((float(to[0]), float(to[1])))
        ends = [system.at({parameter: value}) for value in (low, high)]  # refuses what no system can have
        if not low < high:
            raise ModelError(f"the range of {parameter} is from {low:g} to {high:g}: it is empty")
        self.system, self.parameter, self.options = system, parameter, options
        self.values = np.linspace(low, high, options.steps)
        self.box = np.maximum(*(state_box(end) for end in ends))
        starts = _starts(ends[0], options, self.box)
        self.lanes = tuple(
            Lane(way, number, state) for way in options.each_way() for number, state in enumerate(starts, start=1)
        )
        self._sweep = blank_sweep(system, parameter, self.values, self.lanes, options.points)
        self._done: dict[tuple[int, int], _Done] = {}
        self._never = 0  # segments after the end of a lane that could not be carried on

    @property
    def total(self) -> int:
        """Number of segments of the whole sweep."""
        return len(self.lanes) * segments_of(self.options.steps)

    def take(self, done: Iterable[SweepSegment]) -> None:
        """Take in segments that have been done already; a ModelError if they are not of this sweep."""
        for segment in done:
            lane, number = segment.lane, segment.number
            if not (0 <= lane < len(self.lanes) and 0 <= number < segments_of(self.options.steps)):
                raise ModelError(f"segment {number} of lane {lane} is none of this sweep")
            count = len(places_of(self.lanes[lane].way, self.options.steps, number))
            shape = (count, self.options.points, 2 * self.system.size)
            if not segment.sections.shape == shape or not (
                len(segment.regimes) == len(segment.transients) == len(segment.settled) == count
            ):
                raise ModelError(f"segment {number} of lane {lane} has another size than those of this sweep")
            self._keep(segment)

    def drive(self, hands: Workers, report: Report | None = None) -> None:
        """Do all that has not been done yet; a lane that is carried over becomes a chain of tasks."""
        tasks = self._first_tasks()
        begun, before = time.monotonic(), self._count()

        def accept(index: int, segment: SweepSegment) -> None:
            self._keep(segment)
            if self.lanes[segment.lane].way is not Way.AFRESH:
                tasks.extend(self._next_task(segment.lane, segment.number))
            if report is not None:
                report(segment, Pace(self._count(), self.total, before, time.monotonic() - begun))

        try:
            hands.run(sweep_stretch, tasks, accept, in_order=False)
        except WorkError as error:
            names = {str(self.lanes[tasks[index].lane]) for index in error.pieces}
            raise WorkError(f"{', '.join(sorted(names))}: {error}" if names else str(error), error.pieces) from None

    def sweep(self) -> Sweep:
        """The sweep, as far as it has been driven."""
        notes = tuple(done.note for _, done in sorted(self._done.items(), key=lambda each: each[0]) if done.note)
        return replace(self._sweep, complete=self.is_complete, notes=notes)

    @property
    def is_complete(self) -> bool:
        """Whether nothing is left to do."""
        return self._count() == self.total

    def _count(self) -> int:
        """Stretches that are done, or not to be done."""
        return len(self._done) + self._never

    def _keep(self, segment: SweepSegment) -> None:
        self._done[segment.lane, segment.number] = _Done(enter(self._sweep, segment), segment.last.copy())
        if self._ends(segment.lane, segment.number):
            self._never += segments_of(self.options.steps) - 1 - segment.number

    def _ends(self, lane: int, number: int) -> bool:
        return bool(self._done[lane, number].note) and self.lanes[lane].way is not Way.AFRESH

    def _first_tasks(self) -> list[Task]:
        tasks = []
        for index, lane in enumerate(self.lanes):
            if lane.way is Way.AFRESH:
                numbers = range(segments_of(self.options.steps))
                tasks += [self._task(index, n, lane.state) for n in numbers if (index, n) not in self._done]
                continue
            known = [number for owner, number in self._done if owner == index]
            if not known:
                tasks.append(self._task(index, 0, lane.state))
            else:
                tasks += self._next_task(index, max(known))
        return tasks

    def _next_task(self, lane: int, number: int) -> list[Task]:
        """What follows a segment of a lane that is carried over; nothing at its end."""
        if self._ends(lane, number) or number + 1 == segments_of(self.options.steps):
            return []
        return [self._task(lane, number + 1, self._done[lane, number].last)]

    def _task(self, index: int, number: int, state: NDArray[np.float64]) -> Task:
        lane, options = self.lanes[index], self.options
        places = places_of(lane.way, options.steps, number)
        return Task(
            index,
            number,
            self.system,
            self.parameter,
            places,
            self.values[places],
            state,
            lane.way is not Way.AFRESH,
            self.box,
            options.points,
            options.max_period,
            options.patience,
            options.kick,
            (options.seed, lane.way.number, lane.start),
        )


def _starts(system: System, options: SweepOptions, box: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The states from which a sweep starts."""
    if not isinstance(options.starts, int):
        return [check_state(system, start) for start in options.starts]
    rest = np.zeros(len(box))
    return [rest, *spread_starts(box, options.starts, options.seed, 0.0)[1:]]
