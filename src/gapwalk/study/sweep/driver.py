"""The driver of a sweep: which stretches are to be done, in what order, and what they make together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.search.starts import spread_starts, state_box
from gapwalk.errors import ModelError, WorkError
from gapwalk.model.system import System
from gapwalk.motion.motion import check_state
from gapwalk.study.sweep.options import SweepOptions, Way
from gapwalk.study.sweep.record import Lane, Sweep, assemble, places_of, stretches_of
from gapwalk.study.sweep.stretch import Stretch, Task, sweep_stretch
from gapwalk.study.work.pace import Pace
from gapwalk.study.work.workers import Workers

Report = Callable[[Stretch, Pace], object]
"""Called with each stretch when it is done, and how far the sweep has come."""


class Driver:
    """Drives one sweep, stretch by stretch.

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
        self._done: dict[tuple[int, int], Stretch] = {}

    @property
    def total(self) -> int:
        """Number of stretches of the whole sweep."""
        return len(self.lanes) * stretches_of(self.options.steps)

    def take(self, done: Iterable[Stretch]) -> None:
        """Take in stretches that have been done already; a ModelError if they are not of this sweep."""
        for stretch in done:
            lane, number = stretch.lane, stretch.number
            if not (0 <= lane < len(self.lanes) and 0 <= number < stretches_of(self.options.steps)):
                raise ModelError(f"stretch {number} of lane {lane} is none of this sweep")
            count = len(places_of(self.lanes[lane].way, self.options.steps, number))
            shape = (count, self.options.points, 2 * self.system.size)
            if not stretch.sections.shape == shape or not (
                len(stretch.regimes) == len(stretch.transients) == len(stretch.settled) == count
            ):
                raise ModelError(f"stretch {number} of lane {lane} has another size than those of this sweep")
            self._done[lane, number] = stretch

    def drive(self, hands: Workers, report: Report | None = None) -> None:
        """Do all that has not been done yet; a lane that is carried over becomes a chain of tasks."""
        tasks = self._first_tasks()
        begun, before = time.monotonic(), self._count()

        def accept(index: int, stretch: Stretch) -> None:
            self._done[stretch.lane, stretch.number] = stretch
            if self.lanes[stretch.lane].way is not Way.AFRESH:
                tasks.extend(self._next_task(stretch))
            if report is not None:
                report(stretch, Pace(self._count(), self.total, before, time.monotonic() - begun))

        try:
            hands.run(sweep_stretch, tasks, accept, in_order=False)
        except WorkError as error:
            names = {str(self.lanes[tasks[index].lane]) for index in error.pieces}
            raise WorkError(f"{', '.join(sorted(names))}: {error}" if names else str(error), error.pieces) from None

    def sweep(self) -> Sweep:
        """The sweep, as far as it has been driven."""
        lanes, steps, size = len(self.lanes), self.options.steps, 2 * self.system.size
        empty = Sweep(
            self.system,
            self.parameter,
            self.values,
            self.lanes,
            np.full((lanes, steps, self.options.points, size), np.nan),
            np.zeros((lanes, steps), dtype=np.intp),
            np.zeros((lanes, steps), dtype=bool),
            np.full((lanes, steps), "", dtype="<U16"),
        )
        return assemble(empty, list(self._done.values()), complete=self.is_complete)

    @property
    def is_complete(self) -> bool:
        """Whether nothing is left to do."""
        return self._count() == self.total

    def _count(self) -> int:
        """Stretches that are done; those after the end of a lane that could not be carried on are not to be done."""
        last = stretches_of(self.options.steps) - 1
        ended = sum(last - stretch.number for stretch in self._done.values() if self._ends(stretch))
        return len(self._done) + ended

    def _ends(self, stretch: Stretch) -> bool:
        return bool(stretch.note) and self.lanes[stretch.lane].way is not Way.AFRESH

    def _first_tasks(self) -> list[Task]:
        tasks = []
        for index, lane in enumerate(self.lanes):
            if lane.way is Way.AFRESH:
                numbers = range(stretches_of(self.options.steps))
                tasks += [self._task(index, n, lane.state) for n in numbers if (index, n) not in self._done]
                continue
            known = [stretch for (owner, _), stretch in self._done.items() if owner == index]
            if not known:
                tasks.append(self._task(index, 0, lane.state))
            else:
                tasks += self._next_task(max(known, key=lambda each: each.number))
        return tasks

    def _next_task(self, stretch: Stretch) -> list[Task]:
        """What follows a stretch of a lane that is carried over; nothing at its end."""
        number = stretch.number + 1
        if self._ends(stretch) or number == stretches_of(self.options.steps):
            return []
        return [self._task(stretch.lane, number, stretch.last)]

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
