"""A segment of a sweep: some values of the parameter, one after the other, from the state that the last one left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.system import System
from gapwalk.studies.sweep.regime import NOT_PERIODIC, RUNS_AWAY, regime_of
from gapwalk.studies.sweep.transient import Patience, let_settle
from gapwalk.studies.sweep.wandering import wandering_words


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be done: one piece of work.

    Attributes
    ----------
    lane, number
        Which lane of the sweep, and which of its segments.
    system
        The system; its own value of the parameter plays no role.
    parameter
        Name of the parameter.
    places : shape (count,)
        Places of the values among those of the sweep, in the order in which they are visited.
    values : shape (count,)
        The values.
    state : shape (2n,)
        Where the first transient begins.
    carried
        Whether the state is carried over from one value to the next; otherwise each begins at `state`.
    box : shape (2n,)
        Half-widths of the box of states.
    points, max_period, patience
        As in `SweepOptions`.
    kick
        As there.
    seed
        Of the kicks: that of the sweep, and numbers of its own for each lane.
    """

    lane: int
    number: int
    system: System
    parameter: str
    places: NDArray[np.intp]
    values: NDArray[np.float64]
    state: NDArray[np.float64]
    carried: bool
    box: NDArray[np.float64]
    points: int
    max_period: int
    patience: Patience
    kick: float
    seed: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class SweepSegment:
    """What was seen at the values of a segment, in the order in which they were visited.

    Attributes
    ----------
    lane, number
        As in `Task`.
    sections : shape (count, points, 2n)
        States a forcing period apart; nan where the motion ran away, and after that if the state is carried over.
    transients : shape (count,)
        Forcing periods that were let pass before.
    settled : shape (count,), bool
        Whether the transient had settled by then.
    regimes
        In words; empty where there is nothing.
    note
        Why it ended before its last value; empty if it did not.
    """

    lane: int
    number: int
    sections: NDArray[np.float64]
    transients: NDArray[np.intp]
    settled: NDArray[np.bool_]
    regimes: tuple[str, ...]
    note: str = ""

    @property
    def last(self) -> NDArray[np.float64]:
        """The state with which the next segment goes on, shape (2n,)."""
        return self.sections[-1, -1]


def sweep_stretch(task: Task) -> SweepSegment:
    """Visit the values of a segment. The result depends on the task alone, so it may be done by any process."""
    count, size = len(task.values), len(task.state)
    sections = np.full((count, task.points, size), np.nan)
    transients, settled = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=bool)
    regimes, note = [""] * count, ""
    line = ParameterLine(task.system, task.parameter)
    state, flow, pattern = task.state, None, np.empty(0)
    for row, value in enumerate(task.values.tolist()):
        coefficients = line.coefficients(value)[0]
        if flow is None or not np.array_equal(pattern, coefficients != 0.0):
            flow, pattern = flow_of(line.system_at(value)), coefficients != 0.0
        start = _kicked(state if task.carried else task.state, task, int(task.places[row]))
        try:
            found = let_settle(flow, coefficients, start, task.box, task.max_period, task.patience)
            sections[row] = _section(flow, coefficients, found.state, task.points)
        except FlowError as error:
            regimes[row] = RUNS_AWAY
            note = note or f"{task.parameter} = {value:.10g}: {error}"
            if task.carried:
                break
            continue
        transients[row], settled[row] = found.periods, found.is_settled
        regimes[row] = regime_of(sections[row], task.box, task.max_period)
        state = sections[row, -1]
    rest = [row for row, regime in enumerate(regimes) if regime == NOT_PERIODIC]
    words = wandering_words(task.system, task.parameter, task.values[rest], sections[rest, -1], task.max_period)
    for row, word in zip(rest, words, strict=True):
        regimes[row] = word
    return SweepSegment(task.lane, task.number, sections, transients, settled, tuple(regimes), note)


def _section(flow: Flow, coefficients: NDArray[np.float64], state: NDArray[np.float64], points: int):
    """The states at the end of each of the next forcing periods, shape (points, 2n)."""
    return flow.sample(coefficients, state, PERIOD * np.arange(points + 1.0))[0][1:]


def _kicked(state: NDArray[np.float64], task: Task, place: int) -> NDArray[np.float64]:
    """The state with a small disturbance that depends on the seed, the lane and the value alone."""
    if task.kick == 0.0:
        return state
    seed = np.random.SeedSequence(task.seed[0], spawn_key=(*task.seed[1:], place))
    return state + task.kick * task.box * np.random.default_rng(seed).uniform(-1.0, 1.0, len(state))
