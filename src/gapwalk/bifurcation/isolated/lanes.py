"""Many motions of one system at once, by the batch integrator: transients of a search, and Newton's method.

The map over a forcing period of the batch integrator differs from that of the exact flow by about 1e-5 of the motion.
It is as smooth: its derivatives are differences over a hundredth of that error. So Newton's method converges to a
periodic motion of the batch integrator as it does to one of the flow, and a few exact steps lead from one to the other.

Method: docs/numerics/isolated-branches.md
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.isolated.orbit_catalogue import Deflation
from gapwalk.ensemble.batch import MOST_STEPS, batch_of
from gapwalk.ensemble.batch_flow import LIMIT, BlockPlan, Blocks, Trial, first_guess, judge, revised
from gapwalk.errors import UnfitError
from gapwalk.model.system import System

_ERROR = 1e-5  # over a forcing period, relative to the motion; with 1e-4 a few orbits fewer are found
_LOOKS = 4  # motions that are compared with the exact flow over one forcing period
_MOST = MOST_STEPS // 10  # steps per forcing period above which the exact flow is as fast
_TRIALS = 6  # largest number of revisions of the steps
_SHIFT = 1e-7  # displacement for derivatives, in half-widths of the box
_SOLVED = 1e-5  # residual, in half-widths of the box, of a periodic motion of the batch integrator


@dataclass(frozen=True, eq=False)
class Lanes:
    """Map over forcing periods of many motions at once."""

    plan: BlockPlan  #: The system and the steps per forcing period.
    box: NDArray[np.float64]  #: shape (state_size,): Half-widths of the box of states.

    def strobes(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """Return the states after each of some forcing periods, shape (periods, count, state_size); nan if diverged."""
        count = len(states)
        if count == 1:  # a single lane would need another compiled kernel
            states = np.repeat(states, 2, axis=0)
        blocks = Blocks(self.plan, states, periods, 1, False, 1)
        blocks.advance(periods)
        strobes = blocks.strobes
        assert strobes is not None
        return strobes[:, :count]

    def paths(self, states: NDArray[np.float64], periods: int) -> list[NDArray[np.float64]]:
        """Return the states at the start of each forcing period, and at the end, of each motion until it diverges."""
        all_states = np.concatenate((states[None], self.strobes(states, periods))).transpose(1, 0, 2)
        return [path[np.isfinite(path).all(axis=1)] for path in all_states]

    def evaluate(
        self, states: NDArray[np.float64], periods: NDArray[np.intp]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residuals of states as periodic motions, each with its number of forcing periods, and derivatives.

        Both are in half-widths of the box; their shapes are (count, state_size) and (count, state_size, state_size).
        """
        count, size = states.shape
        shifts = np.vstack((np.zeros(size), _SHIFT * np.diag(self.box)))
        begun = (states + shifts[:, None]).reshape(-1, size)
        strobes = self.strobes(begun, int(periods.max())).reshape(-1, size + 1, count, size)
        ends = strobes[periods - 1, :, np.arange(count)].transpose(1, 0, 2)
        residuals = (ends[0] - states) / self.box
        moved = (ends[1:] - ends[0]) / (_SHIFT * self.box)
        return residuals, moved.transpose(1, 2, 0) - np.eye(size)


def lanes_of(system: System, states: NDArray[np.float64], box: NDArray[np.float64]) -> Lanes | None:
    """Return the map of many motions; None where the exact flow is needed, or is as fast.

    It is needed where friction sticks and stops rebound: derivatives by differences say nothing of motions that touch
    a rigid stop, or stick, for the first time.

    Shapes: `states` (count, state_size); `box` (state_size,).
    """
    if any(contact.law.is_dry or contact.law.rebounds for contact in system.structure.contacts):
        return None
    try:
        batch = batch_of(system, np.repeat(states, 2, axis=0) if len(states) == 1 else states, {})
        plan = BlockPlan(
            batch.linear, batch.pattern, first_guess(batch.linear, _ERROR, batch.states), begins_often=True
        )
        looked_at = np.unique(np.linspace(0, len(batch.states) - 1, _LOOKS).astype(int))
        for _ in range(_TRIALS):
            if plan.steps > _MOST:
                return None
            ends = Lanes(plan, box).strobes(batch.states, 1)[0]
            trials = [Trial(0, batch.states[each], ends[each]) for each in looked_at]
            verdict = judge(trials, lambda _: system, LIMIT)
            if not verdict.trials:
                return None  # all of them diverge: nothing shows how many steps the others need
            if verdict.error <= _ERROR:
                return Lanes(plan, box)
            plan = replace(plan, steps=max(revised(plan.steps, verdict.error, _ERROR), plan.steps + 4))
    except UnfitError:
        return None
    return None


def newton_in_lanes(
    lanes: Lanes,
    starts: NDArray[np.float64],
    periods: NDArray[np.intp],
    is_enough: Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.bool_]],
    options: Deflation = Deflation(),
) -> NDArray[np.float64]:
    """Apply Newton's method from many starts, with damping and bounds as `newton_aside`; nan where it finds nothing.

    Shapes: `starts` (count, state_size); `periods` (count,).
    """
    found, x = np.full(starts.shape, np.nan), starts.copy()
    residuals, jacobians = lanes.evaluate(x, periods)
    active = np.flatnonzero(_within(lanes, x, options) & np.isfinite(residuals).all(axis=1))
    for _ in range(options.iterations + 1):
        solved = np.abs(residuals[active]).max(axis=1) <= _SOLVED
        found[active[solved]] = x[active[solved]]
        active = active[~solved]
        if not len(active):
            break
        steps = _newton_steps(jacobians[active], residuals[active], options.longest)
        there, beyond, derivatives = _shortened(lanes, x[active], periods[active], residuals[active], steps, options)
        moves = np.isfinite(beyond).all(axis=1)
        active = active[moves]
        x[active], residuals[active], jacobians[active] = there[moves], beyond[moves], derivatives[moves]
        if len(active):
            active = active[~is_enough(active, x[active])]
    return found


def _within(lanes: Lanes, x: NDArray[np.float64], options: Deflation) -> NDArray[np.bool_]:
    return np.asarray(np.abs(x / lanes.box).max(axis=1) <= options.farthest)


def _newton_steps(
    jacobians: NDArray[np.float64], residuals: NDArray[np.float64], longest: float
) -> NDArray[np.float64]:
    """Return the steps of limited length, in half-widths of the box; nan where the derivatives are singular or nan."""
    steps = np.full(residuals.shape, np.nan)
    regular = np.flatnonzero(np.isfinite(jacobians).all(axis=(1, 2)))
    regular = regular[np.linalg.det(jacobians[regular]) != 0.0]
    steps[regular] = np.linalg.solve(jacobians[regular], -residuals[regular, :, None])[:, :, 0]
    return steps * np.minimum(1.0, longest / np.maximum(np.linalg.norm(steps, axis=1), longest))[:, None]


def _shortened(
    lanes: Lanes,
    x: NDArray[np.float64],
    periods: NDArray[np.intp],
    residuals: NDArray[np.float64],
    steps: NDArray[np.float64],
    options: Deflation,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return where the first of the halved steps leads that reduces the residual, with residual and derivatives there.

    The residual is nan where none does.
    """
    there, beyond = x.copy(), np.full(residuals.shape, np.nan)
    derivatives = np.full((*residuals.shape, residuals.shape[1]), np.nan)
    sizes, waiting = np.linalg.norm(residuals, axis=1), np.flatnonzero(np.isfinite(steps).all(axis=1))
    halves = 0.5 ** np.arange(1.0, options.halvings + 1.0)
    for factors in (np.ones(1), halves):  # all halves at once: the start of a run takes longer than the run
        which, shares = np.repeat(waiting, len(factors)), np.tile(factors, len(waiting))
        trials = x[which] + shares[:, None] * steps[which] * lanes.box
        inside = _within(lanes, trials, options)
        which, trials = which[inside], trials[inside]
        if len(which):
            ends, slopes = lanes.evaluate(trials, periods[which])
            less = np.flatnonzero(np.linalg.norm(ends, axis=1) < sizes[which])[::-1]  # the longest is written last
            there[which[less]], beyond[which[less]], derivatives[which[less]] = trials[less], ends[less], slopes[less]
            waiting = np.setdiff1d(waiting, which[less])
    return there, beyond, derivatives
