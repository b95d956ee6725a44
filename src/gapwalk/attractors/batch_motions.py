"""Many motions with the batch integrator, as used for basins and regime maps.

A regime map calls the flow a thousand times for the same systems, so the steps (one scheme for each system) are chosen
once. The error is monitored in each call: the first period of a few motions is compared with the exact flow.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.many_motions import ContactFigures, ExactMotions, ManyMotions, finite_rows
from gapwalk.ensemble.accuracy_trial import Trial, judge
from gapwalk.ensemble.batch import Batch, batch_of
from gapwalk.ensemble.batch_flow import batch_flow_of
from gapwalk.ensemble.batch_options import BatchOptions
from gapwalk.ensemble.blocks import LIMIT, BlockPlan, Blocks
from gapwalk.errors import FlowError
from gapwalk.model.system import System

_PILOT = 256  # motions for which the steps are chosen
_PILOT_PERIODS = 64
_LOOKS = 2  # motions per call that are compared with the exact flow
_SEED = 1995


class BatchMotions:
    """The flow of many motions by the batch integrator, in one thread.

    Parameters
    ----------
    batch
        The systems: one for all motions, or one for each motion.
    block_plan
        Steps of the systems.
    lanes
        Index of the system of each motion; None if one system serves all.
    trials
        Comparisons with the exact flow, each with its system; shared by all parts of this object.
    """

    def __init__(
        self, batch: Batch, block_plan: BlockPlan, lanes: NDArray[np.intp] | None, trials: list[tuple[Trial, System]]
    ) -> None:
        self._batch, self._block_plan, self._lanes, self._trials = batch, block_plan, lanes, trials
        self._random = np.random.default_rng(_SEED)

    @property
    def error(self) -> float:
        """See `ManyMotions.error`."""
        systems = [system for _, system in self._trials]
        numbered = [trial._replace(lane=index) for index, (trial, _) in enumerate(self._trials)]
        return judge(numbered, systems.__getitem__, LIMIT).error

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """See `ManyMotions.advance`."""
        ends = np.full(states.shape, np.nan)
        finite = finite_rows(states)
        if finite.any():
            ends[finite] = self._run(states, finite, periods).states
        return ends

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """See `ManyMotions.strobes`; computed in one run, because each run starts with a small error of its own."""
        track = np.full((periods, *states.shape), np.nan)
        finite = finite_rows(states)
        if not finite.any():
            return track
        blocks = self._run(states, finite, after + 1)
        for row in track[:-1]:
            row[finite] = blocks.states
            blocks.advance(1)
        track[-1, finite] = blocks.states
        return track

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """See `ManyMotions.contacts`."""
        ends = np.full(states.shape, np.nan)
        peaks = np.full((len(states), len(self._batch.systems[0].structure.contacts)), np.nan)
        impacts = peaks.copy()
        finite = finite_rows(states)
        if finite.any():
            ends[finite], peaks[finite], impacts[finite] = self._run(states, finite, periods, True).figures(periods)
        return ContactFigures(ends, peaks, impacts)

    def part(self, which: NDArray[np.intp]) -> BatchMotions:
        """See `ManyMotions.part`."""
        lanes = None if self._lanes is None else self._lanes[which]
        return BatchMotions(self._batch, self._block_plan, lanes, self._trials)

    def _run(
        self, states: NDArray[np.float64], finite: NDArray[np.bool_], periods: int, survey: bool = False
    ) -> _Blocks:
        """Advance the motions that have not diverged; compare some of them with the exact flow in the first period."""
        which = np.flatnonzero(finite)
        lanes = np.zeros(len(which), dtype=np.intp) if self._lanes is None else self._lanes[which]
        blocks = _Blocks(self._block_plan, lanes, states[which], survey)
        blocks.advance(1)
        after = blocks.states
        for index in self._random.choice(len(which), min(_LOOKS, len(which)), replace=False):
            trial = Trial(0, states[which[index]], after[index])
            self._trials.append((trial, self._batch.system(int(lanes[index]))))
        if periods > 1:
            blocks.advance(periods - 1)
        return blocks


class _Blocks:
    """The run of some lanes; a single lane is duplicated, because one lane would need another compiled kernel."""

    def __init__(
        self, block_plan: BlockPlan, lanes: NDArray[np.intp], states: NDArray[np.float64], survey: bool
    ) -> None:
        self.count = len(states)
        if self.count == 1:
            lanes, states = np.repeat(lanes, 2), np.repeat(states, 2, axis=0)
        self._blocks = Blocks(block_plan if block_plan.shared else block_plan.some(lanes), states, 0, 0, survey, 1)
        if survey:
            self._blocks.begin_survey()

    @property
    def states(self) -> NDArray[np.float64]:
        return self._blocks.states[: self.count]

    def advance(self, periods: int) -> None:
        self._blocks.advance(periods)

    def figures(self, periods: int) -> ContactFigures:
        survey = self._blocks.survey(periods)
        impacts = survey.impacts.sum(axis=2)
        return ContactFigures(self.states, survey.peak_force[: self.count], impacts[: self.count])


def motions_of(
    system: System,
    states: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]] | None = None,
    error: float = 1e-4,
) -> ManyMotions:
    """Create the flow of many motions: the batch integrator, or the exact flow where that would be faster.

    Parameters
    ----------
    system
        The system.
    states : shape (count, 2n)
        Initial states of the motions; the steps are chosen on some of them.
    values
        Parameter values by name, each of shape (count,), one for each motion; without any, the number of motions may
        vary.
    error
        The allowed error, as in `BatchOptions`.
    """
    batch = batch_of(system, states, values or {})
    pilot = batch.some(np.unique(np.linspace(0, batch.count - 1, _PILOT).astype(int)))
    parameters = {name: np.array([pilot.system(lane)[name] for lane in range(pilot.count)]) for name in values or {}}
    try:
        flow = batch_flow_of(system, BatchOptions(error=error, threads=1))
        steps = flow.run(pilot.states, _PILOT_PERIODS, parameters=parameters).steps
    except FlowError:
        return ExactMotions(system, values)
    block_plan = BlockPlan(batch.linear, batch.pattern, steps)
    return BatchMotions(batch, block_plan, None if block_plan.shared else np.arange(batch.count), [])
