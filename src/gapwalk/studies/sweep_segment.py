"""A segment of a sweep: some values of the parameter, each from the state in which the last motion settled.

Whether a transient has died away is seen from its returns. Motions that do not repeat are quasi-periodic, chaotic, or
locked to a long period; each value gets a regime, and equal regimes next to each other are a band.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.convergence import has_settled, period_of
from gapwalk.attractors.many_motions import BatchMotions, motions_of
from gapwalk.attractors.regime_judge import RegimeOptions, judge, settle_doubts
from gapwalk.attractors.regimes import Regime, regime_word
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.system import System

_GROWTH = 1.25  # of the length of a transient from one look at it to the next


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a transient is followed.

    Parameters
    ----------
    shortest, longest
        Forcing periods at least and at most.
    tolerance
        Distance from the periodic motion that it comes to, at which it has settled; in half-widths of the box of
        states.
    """

    shortest: int = 48
    longest: int = 2000
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("shortest", "longest"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 1 (forcing periods of a transient)")
        if self.longest < self.shortest:
            raise ModelError(f"longest is {self.longest}; it must be at least {self.shortest}, the shortest transient")
        if not 1e-12 <= self.tolerance <= 1e-2:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-12 and 1e-2 (half-widths)")


class Settled(NamedTuple):
    """What has become of a transient.

    Attributes
    ----------
    state : shape (2n,)
        Its last state.
    periods
        Forcing periods that it took.
    is_settled
        False if it was still changing when the patience ended.
    """

    state: NDArray[np.float64]
    periods: int
    is_settled: bool


def let_settle(
    flow: Flow,
    coefficients: NDArray[np.float64],
    state: NDArray[np.float64],
    box: NDArray[np.float64],
    max_period: int,
    patience: Patience,
) -> Settled:
    """Follow the transient from a state until it has settled.

    `gapwalk.attractors.convergence` judges it: its nearest returns shrink towards an orbit that is closer than the
    tolerance, or they neither shrink nor grow and its averages do not drift, as on a torus or in chaos.

    Parameters
    ----------
    flow, coefficients
        What moves.
    state : shape (2n,)
        Where it begins, at theta = 0.
    box : shape (2n,)
        Half-widths of the box of states: the unit of all distances.
    max_period
        Longest period, in forcing periods, for which a return is looked for.
    patience
        How long to follow it.

    Raises
    ------
    FlowError
        If the motion diverges or chatters without end.
    """
    states, length = np.asarray(state, dtype=float)[None, :], max(patience.shortest, 2 * max_period + 8)
    length = min(length, patience.longest)
    while True:
        more = length - (len(states) - 1)
        path, _ = flow.sample(coefficients, states[-1], PERIOD * np.arange(more + 1.0))
        states = np.vstack((states, path[1:]))
        if has_settled(states / box, max_period, patience.tolerance):
            return Settled(states[-1], length, True)
        if length >= patience.longest:
            return Settled(states[-1], length, False)
        length = min(math.ceil(_GROWTH * length), patience.longest)


NOT_PERIODIC, RUNS_AWAY = "not periodic", Regime.RUNAWAY.text


@dataclass(frozen=True, slots=True)
class Band:
    """A range of the parameter in which the regime is the same.

    Attributes
    ----------
    regime
        In words, such as ``period 3``.
    low, high
        Its ends, halfway to the next values of another regime.
    count
        Number of values in it.
    """

    regime: str
    low: float
    high: float
    count: int


def regime_of(section: NDArray[np.float64], box: NDArray[np.float64], max_period: int) -> str:
    """The regime of section points in a row: ``period m``, the smallest m after which all return, or not periodic.

    Parameters
    ----------
    section : shape (points, 2n)
        States a forcing period apart, on a motion that has settled.
    box : shape (2n,)
        Half-widths of the box of states.
    max_period
        Longest period in question, in forcing periods.
    """
    period = period_of(section / box, max_period)
    return regime_word(Regime.PERIODIC, period) if period else NOT_PERIODIC


def bands_of(values: NDArray[np.float64], regimes: Sequence[str]) -> tuple[Band, ...]:
    """The bands of equal regimes along increasing values; where a regime is empty, nothing is known and no band is."""
    edges = np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]))
    bands, first = [], 0
    for regime, group in groupby(regimes):
        count = len(list(group))
        if regime:
            bands.append(Band(regime, float(edges[first]), float(edges[first + count]), count))
        first += count
    return tuple(bands)


_RETURNS = 64  # forcing periods in which a motion may still become periodic: it has settled already


def wandering_words(
    system: System, parameter: str, values: NDArray[np.float64], states: NDArray[np.float64], max_period: int
) -> Sequence[str]:
    """What motions are, in words, all of them judged side by side as those of a regime map are.

    Parameters
    ----------
    system
        The system; its own value of the parameter plays no role.
    parameter
        Name of the parameter.
    values : shape (count,)
        Its values, one for each motion.
    states : shape (count, 2n)
        Where the motions are, at theta = 0.
    max_period
        Longest period, in forcing periods, that was looked for.

    Returns
    -------
    list of str
        ``quasi-periodic``, ``chaotic``, ``period 18``, ...; ``not periodic``, which says less, where the batch
        integrator cannot follow the system: the exact flow would take minutes for each motion of a large one.
    """
    if not len(values):
        return []
    motions = motions_of(system, states, {parameter: values})
    if not isinstance(motions, BatchMotions):
        return [NOT_PERIODIC] * len(values)
    systems = [partial(system.at, {parameter: value}) for value in values.tolist()]
    frequencies = np.array([system().frequency for system in systems])
    options = RegimeOptions(longest=_RETURNS, max_period=max_period, forces=False)
    found = settle_doubts(judge(motions, states, frequencies, options), systems)
    return [regime_word(*pair) for pair in zip(found.regimes.tolist(), found.periods.tolist(), strict=True)]


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
        States a forcing period apart; nan where the motion has diverged, and after that if the state is carried over.
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
