"""The batch integrator: many trajectories of a system at moderate accuracy, for basins, sweeps and regime maps.

Method: docs/numerics/batch-integrator.md
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from gapwalk.ensemble.accuracy_trial import Trial, judge
from gapwalk.ensemble.batch import Batch, batch_of
from gapwalk.ensemble.batch_options import MOST_STEPS, BatchOptions
from gapwalk.ensemble.batch_run import BatchRun
from gapwalk.ensemble.blocks import LIMIT, BlockPlan, Blocks
from gapwalk.ensemble.kernel_frame import LANES
from gapwalk.ensemble.step_count import first_guess, revised
from gapwalk.errors import FlowError, ModelError
from gapwalk.model.system import System

_PILOT = 64  # forcing periods of the pilot run of a few trajectories that chooses the steps
_PAYS = 4 * LANES  # number of trajectories above which a pilot run is cheaper than running all of them again
_PLENTY = 0.2  # fraction of the allowed error below which fewer steps are tried
_SEED = 1995  # of the random choice of trajectories for comparison, the same in every run


@dataclass(frozen=True)
class BatchFlow:
    """Integrates many trajectories of one system, or of several systems of its structure; see `batch_flow_of`."""

    system: System
    options: BatchOptions = BatchOptions()

    def run(
        self,
        states: ArrayLike,
        periods: int,
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        every: int = 0,
        survey: int = 0,
    ) -> BatchRun:
        """Integrate trajectories from theta = 0 over some forcing periods.

        Parameters
        ----------
        states : array_like, shape (N, 2n)
            Positions, then velocities, of each trajectory.
        periods
            Number of forcing periods.
        parameters
            Parameter values by name, one for each trajectory, if they differ from those of the system.
        every
            If not 0, the states are recorded every so many forcing periods.
        survey
            If not 0, extremes, contacts and largest forces are recorded over that many last periods.

        Raises
        ------
        ModelError
            If the request is invalid.
        FlowError
            If the requested error cannot be reached with 20,000 steps per forcing period.
        """
        batch = batch_of(self.system, states, parameters or {})
        plan = _Plan(periods, every, survey)
        if self.options.steps is not None:
            return self._carry(batch, plan, self.options.steps)
        steps = first_guess(batch.linear, self.options.error)
        if batch.count >= _PAYS:
            steps = self._pilot(batch, periods, steps)
        run = self._carry(batch, plan, steps)
        while run.error > self.options.error:  # false for nan: no comparison was possible, all diverged at once
            steps = self._finer(steps, run.error)
            run = self._carry(batch, plan, steps)
        return run

    def _pilot(self, batch: Batch, periods: int, steps: int) -> int:
        """Choose steps that keep the error within its limit on a few trajectories, but not many more than needed."""
        lanes = np.random.default_rng(_SEED).choice(batch.count, LANES, replace=False)
        few, plan, too_few = batch.some(np.sort(lanes)), _Plan(min(periods, _PILOT)), 0
        while True:
            error = self._carry(few, plan, steps).error
            if error > self.options.error:
                too_few, steps = steps, self._finer(steps, error)
                continue
            fewer = revised(steps, error, self.options.error)
            if not error < _PLENTY * self.options.error or not too_few < fewer < steps:
                return steps
            steps = fewer

    def _carry(self, batch: Batch, plan: _Plan, steps: int) -> BatchRun:
        """Integrate all trajectories over all periods, and compare some of them with the exact flow meanwhile."""
        block_plan = BlockPlan(batch.linear, batch.pattern, steps)
        blocks = Blocks(block_plan, batch.states, plan.noted, plan.every, bool(plan.survey), self.options.hands)
        random = np.random.default_rng(_SEED + 1)
        looked_at = random.choice(batch.count, min(self.options.sample, batch.count), replace=False)
        trials: list[Trial] = []
        for start, stop, look in plan.stretches():
            if plan.survey and start == plan.periods - plan.survey:
                blocks.begin_survey()
            before = blocks.states[looked_at] if look else None
            blocks.advance(stop - start)
            if before is not None:
                after = blocks.states[looked_at]
                trials += [Trial(*each) for each in zip(looked_at, before, after, strict=True)]
        trials = [trial for trial in trials if np.all(np.isfinite(trial.before))]
        gone = np.flatnonzero(blocks.left >= 0)
        nowhere, last = np.full(2 * batch.linear.n, np.nan), blocks.last
        trials += [Trial(int(lane), last[lane], nowhere) for lane in gone[: self.options.sample]]
        verdict = judge(trials, batch.system, LIMIT)
        return BatchRun(
            blocks.states,
            blocks.left >= 0,
            blocks.strobes,
            blocks.survey(plan.survey) if plan.survey else None,
            verdict.error,
            verdict.worst,
            verdict.trials,
            steps,
        )

    def _finer(self, steps: int, error: float) -> int:
        """Return a larger number of steps than the one that left this error."""
        if steps < MOST_STEPS:
            return max(revised(steps, error, self.options.error), steps + 4)
        raise FlowError(
            f"the batch integrator's error is {error:.2g} with {steps} steps per forcing period, but "
            f"{self.options.error:g} was requested: the system is too stiff for it, or a state is so large that its "
            "impact damping is. Allow a larger error (BatchOptions(error=...)), or use the exact flow "
            "(gapwalk.integrate), which is faster in this case"
        )


@dataclass(frozen=True)
class _Plan:
    """The schedule of a run.

    Parameters
    ----------
    periods, every, survey
        See `BatchFlow.run`.
    """

    periods: int
    every: int = 0
    survey: int = 0

    def __post_init__(self) -> None:
        for name, value, least in (("periods", self.periods, 1), ("every", self.every, 0), ("survey", self.survey, 0)):
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}, in forcing periods")
        if self.survey > self.periods:
            raise ModelError(f"survey is {self.survey}, but the run lasts {self.periods} forcing periods only")

    @property
    def noted(self) -> int:
        """Number of times at which all states are recorded."""
        return self.periods // self.every if self.every else 0

    def stretches(self) -> list[tuple[int, int, bool]]:
        """Return start, stop, and True for a comparison: in the first period, the last one, and two in between."""
        looks = {0, self.periods // 8, self.periods // 2, self.periods - 1}
        bounds = sorted({0, self.periods, self.periods - self.survey, *looks, *(look + 1 for look in looks)})
        return [(start, stop, start in looks and stop == start + 1) for start, stop in pairwise(bounds)]


def batch_flow_of(system: System, options: BatchOptions = BatchOptions()) -> BatchFlow:
    """Create the batch integrator of a system.

    The exact flow integrates one trajectory after the other to rounding. The batch integrator integrates many at once
    to a chosen accuracy, compares a sample of each run with the exact flow, and is a hundred times faster.

    Parameters
    ----------
    system
        The system.
    options
        Accuracy and threads.
    """
    return BatchFlow(system, options)
