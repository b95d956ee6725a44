"""The mass flow: many trajectories of a system at moderate accuracy, for basins, sweeps and regime maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from gapwalk.errors import FlowError, ModelError
from gapwalk.model.system import System
from gapwalk.motion.mass.blocks import LIMIT, Blocks, Fleet
from gapwalk.motion.mass.crowd import Crowd, crowd_of
from gapwalk.motion.mass.frame import LANES
from gapwalk.motion.mass.options import MOST_STEPS, MassOptions
from gapwalk.motion.mass.run import MassRun
from gapwalk.motion.mass.steps import first_guess, revised
from gapwalk.motion.mass.trial import Trial, judge

_PILOT = 64  # forcing periods of the few trajectories by which the steps are chosen
_PAYS = 4 * LANES  # trajectories from which such a pilot is cheaper than running all of them a second time
_PLENTY = 0.2  # share of the allowed error from which fewer steps would do
_SEED = 1995  # which trajectories are compared is drawn at random, the same in every run


@dataclass(frozen=True)
class MassFlow:
    """Carries many trajectories of one system, or of as many systems of its structure; see `mass_flow_of`."""

    system: System
    options: MassOptions = MassOptions()

    def run(
        self,
        states: ArrayLike,
        periods: int,
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        every: int = 0,
        survey: int = 0,
    ) -> MassRun:
        """Carry trajectories from theta = 0 over some forcing periods.

        Parameters
        ----------
        states : array_like, shape (N, 2n)
            Positions, then velocities, of each trajectory.
        periods
            How many forcing periods.
        parameters
            Values by parameter name, one for each trajectory, where they differ from the system's.
        every
            If not 0, the states are noted every so many forcing periods.
        survey
            If not 0, extremes, contacts and largest forces are noted over that many last periods.

        Raises
        ------
        ModelError
            If the request makes no sense.
        FlowError
            If the error that is asked for cannot be held within 20,000 steps a forcing period.
        """
        crowd = crowd_of(self.system, states, parameters or {})
        plan = _Plan(periods, every, survey)
        if self.options.steps is not None:
            return self._carry(crowd, plan, self.options.steps)
        steps = first_guess(crowd.linear, self.options.error)
        if crowd.count >= _PAYS:
            steps = self._pilot(crowd, periods, steps)
        run = self._carry(crowd, plan, steps)
        while run.error > self.options.error:  # never for nan, where nothing could be compared: all ran away at once
            steps = self._finer(steps, run.error)
            run = self._carry(crowd, plan, steps)
        return run

    def _pilot(self, crowd: Crowd, periods: int, steps: int) -> int:
        """Steps that hold the error on a few of the trajectories, and not many more than they need."""
        lanes = np.random.default_rng(_SEED).choice(crowd.count, LANES, replace=False)
        few, plan, too_few = crowd.some(np.sort(lanes)), _Plan(min(periods, _PILOT)), 0
        while True:
            error = self._carry(few, plan, steps).error
            if error > self.options.error:
                too_few, steps = steps, self._finer(steps, error)
                continue
            fewer = revised(steps, error, self.options.error)
            if not error < _PLENTY * self.options.error or not too_few < fewer < steps:
                return steps
            steps = fewer

    def _carry(self, crowd: Crowd, plan: _Plan, steps: int) -> MassRun:
        """All trajectories over all periods, with looks at some of them on the way."""
        fleet = Fleet(crowd.linear, crowd.pattern, steps)
        blocks = Blocks(fleet, crowd.states, plan.noted, plan.every, bool(plan.survey), self.options.hands)
        random = np.random.default_rng(_SEED + 1)
        looked_at = random.choice(crowd.count, min(self.options.sample, crowd.count), replace=False)
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
        nowhere, last = np.full(2 * crowd.linear.n, np.nan), blocks.last
        trials += [Trial(int(lane), last[lane], nowhere) for lane in gone[: self.options.sample]]
        verdict = judge(trials, crowd.system, LIMIT)
        return MassRun(
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
        """More steps than those that left this error."""
        if steps < MOST_STEPS:
            return max(revised(steps, error, self.options.error), steps + 4)
        raise FlowError(
            f"the mass flow's error is {error:.2g} with {steps} steps a forcing period, where {self.options.error:g} "
            "was asked for: the system is too stiff for it, or a state is so large that its impact damping is. Ask for "
            "less (MassOptions(error=...)), or use the exact flow (gapwalk.integrate), which is faster there"
        )


@dataclass(frozen=True)
class _Plan:
    """What a run does when.

    Parameters
    ----------
    periods, every, survey
        See `MassFlow.run`.
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
        """How many times all states are noted."""
        return self.periods // self.every if self.every else 0

    def stretches(self) -> list[tuple[int, int, bool]]:
        """Start, stop, and whether to look: at the first period, the last one, and two in between."""
        looks = {0, self.periods // 8, self.periods // 2, self.periods - 1}
        bounds = sorted({0, self.periods, self.periods - self.survey, *looks, *(look + 1 for look in looks)})
        return [(start, stop, start in looks and stop == start + 1) for start, stop in pairwise(bounds)]


def mass_flow_of(system: System, options: MassOptions = MassOptions()) -> MassFlow:
    """The mass flow of a system.

    Where the exact flow takes one trajectory after the other to rounding, this one takes many side by side, as exactly
    as asked, checks that on each run beside the exact flow, and is a hundred times faster.

    Parameters
    ----------
    system
        The system.
    options
        Accuracy and threads.
    """
    return MassFlow(system, options)
