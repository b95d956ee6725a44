"""A segment of a sweep: some values of the parameter, each from the state in which the last motion settled.

The returns of a transient show whether it has died away. Motions that do not repeat are quasi-periodic, chaotic, or
locked to a long period; each value gets a regime, and equal regimes next to each other are a band.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.many_motions import BatchMotions, enough, motions_of
from gapwalk.attractors.regime_judge import RegimeOptions, judge, settle_doubts
from gapwalk.attractors.regimes import Regime, regime_word
from gapwalk.attractors.settling_judge import has_settled, period_of
from gapwalk.ensemble.start import within_stops
from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.system import System
from gapwalk.studies.sweep import Lane, Patience, SweepOptions, SweepSegment

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
    """Follow the transient from a state until it has settled.

    `gapwalk.attractors.settling_judge` judges it: its nearest returns shrink towards an orbit that is closer than the
    tolerance, or they neither shrink nor grow and its averages do not drift, as on a torus or in chaos.

    Shapes: `state`, `box` (state_size,).
    """
    states, length = np.asarray(state, dtype=float)[None, :], max(patience.shortest, 2 * max_period + 8)
    length = min(length, patience.longest)
    while True:
        more = length - (len(states) - 1)
        path = flow.sample(coefficients, states[-1], PERIOD * np.arange(more + 1.0)).states
        states = np.vstack((states, path[1:]))
        if has_settled(states / box, max_period, patience.tolerance):
            return Settled(states[-1], length, True)
        if length >= patience.longest:
            return Settled(states[-1], length, False)
        length = min(math.ceil(_GROWTH * length), patience.longest)


NOT_PERIODIC, RUNS_AWAY = "not periodic", Regime.RUNAWAY.text


def regime_of(section: NDArray[np.float64], box: NDArray[np.float64], max_period: int) -> str:
    """Return the regime of section points: ``period m`` with the smallest m after which all return, or not periodic.

    Shapes: `section` (points, state_size); `box` (state_size,).
    """
    period = period_of(section / box, max_period)
    return regime_word(Regime.PERIODIC, period) if period else NOT_PERIODIC


_RETURNS = 64  # forcing periods in which a motion may still become periodic: it has settled already


def wandering_words(
    system: System, parameter: str, values: NDArray[np.float64], states: NDArray[np.float64], max_period: int
) -> Sequence[str]:
    """Return the regimes of motions in words; all are judged together, as for a regime map.

    Shapes: `values` (count,); `states` (count, state_size).
    """
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
    options: SweepOptions
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
            path = flow.sample(coefficients, found.state, PERIOD * np.arange(options.points + 1.0)).states
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
    kick, lane = task.options.kick, task.lane
    if kick == 0.0:
        return state
    seed = np.random.SeedSequence(task.options.seed, spawn_key=(lane.way.number, lane.start, place))
    size, moved = 2 * task.system.size, np.zeros(len(state))  # an extension stays: friction would not let it be larger
    moved[:size] = kick * task.box[:size] * np.random.default_rng(seed).uniform(-1.0, 1.0, size)
    # a motion that rests on a rigid stop cannot be pushed through it, but away from it
    ways = np.array([state + moved, state - moved, state])
    if not any(contact.law.rebounds for contact in task.system.structure.contacts):
        return ways[0]
    return ways[int(np.argmax(within_stops(task.system.at({task.parameter: float(value)}), ways)))]
