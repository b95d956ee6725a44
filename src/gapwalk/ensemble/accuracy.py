"""The number of steps per forcing period: a first estimate from the system, revised after a trial.

In a trial, one forcing period of some trajectories of the batch integrator is compared with the exact flow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.batch import MOST_STEPS
from gapwalk.ensemble.scheme import Linear
from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.spring import polynomials_of
from gapwalk.model.system import System

_SAMPLES = 33  # samples of an exact motion over a forcing period, which give the size of each component
_FAR = 1e-3  # fraction of the limit that an exact motion must reach if the batch integrator has exceeded the limit
_SMALL = 1e-12  # smallest scale of a component, relative to the largest component of its kind
_ORDER = 3  # order of the error, which the kinks of the forces limit
_TURN = 0.18  # radians per step of the fastest vibration for which the clutch of figure 15 has an error of 1e-4
_TURN_ERROR = 1e-4
_LEAST = 24  # fewest steps per period of the highest harmonic
_SPARE = 1.1
_MOST_AT_ONCE = 4.0


class Trial(NamedTuple):
    """One trajectory over one forcing period.

    Attributes
    ----------
    lane
        Index of the trajectory.
    before, after : shape (2n,)
        Its states at the start and at the end; NaN at the end if it diverged.
    """

    lane: int
    before: NDArray[np.float64]
    after: NDArray[np.float64]


@dataclass(frozen=True)
class Verdict:
    """The comparison of the batch integrator with the exact flow.

    Attributes
    ----------
    error
        Root mean square of the errors of all trials; see `BatchOptions.error`.
    worst
        The largest of them.
    trials
        Number of forcing periods that were compared.
    """

    error: float
    worst: float
    trials: int


def judge(trials: Sequence[Trial], system_of: Callable[[int], System], limit: float) -> Verdict:
    """Compare trials with the exact flow.

    Parameters
    ----------
    trials
        The trials to compare.
    system_of
        A function that returns the system of a lane.
    limit
        Size of a state above which a motion has diverged.
    """
    differences: list[NDArray[np.float64]] = []
    sizes: list[NDArray[np.float64]] = []
    false_alarms = 0
    for trial in trials:
        path = _exact(system_of(trial.lane), trial.before)
        gone = not np.all(np.isfinite(trial.after))
        if path is None or gone:
            # both diverge at about the same time, but not in the same forcing period
            far = path is None or np.abs(path).max() > _FAR * limit
            false_alarms += not far
            continue
        differences.append(np.abs(trial.after - path[-1]))
        sizes.append(np.abs(path).max(axis=0))
    if false_alarms:
        return Verdict(math.inf, math.inf, len(trials))
    if not differences:
        return Verdict(0.0, 0.0, 0)
    scale = _scale(np.array(sizes).max(axis=0))
    errors = (np.array(differences) / scale).max(axis=1)
    return Verdict(float(np.sqrt(np.mean(errors**2))), float(errors.max()), len(errors))


def _exact(system: System, state: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Integrate the exact motion over one forcing period, shape (samples, 2n); None if it diverges."""
    try:
        return flow_of(system).sample(coefficients_of(system), state, np.linspace(0.0, PERIOD, _SAMPLES))[0]
    except FlowError:
        return None


def _scale(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the scale of each component: its own size, or a tiny number if it does not move at all."""
    halves = sizes.reshape(2, -1)
    least = np.maximum(halves.max(axis=1, keepdims=True) * _SMALL, np.finfo(float).tiny)
    return np.maximum(halves, least).ravel()


def first_guess(linear: Linear, error: float) -> int:
    """Estimate the steps from the fastest vibration with all stages closed, at the lowest frequency of all systems."""
    turns = 2.0 * math.pi * float(np.max(linear.rate * _fastest(linear)))
    steps = turns / (_TURN * (error / _TURN_ERROR) ** (1.0 / _ORDER))
    return _rounded(max(steps, _LEAST * max(linear.layout.orders, default=1)))


def _fastest(linear: Linear) -> NDArray[np.float64]:
    """Compute the spectral radius with all stages of one side closed, in radians per unit of time, shape (lanes,)."""
    n, matrix, polynomials = linear.n, linear.matrix.copy(), polynomials_of(linear.layout, "the batch integrator")
    springs = np.maximum(polynomials.signs[:, None] * polynomials.table(linear.coefficients.T)[:, 0, 1], 0.0)
    for k in range(len(linear.layout.contacts)):
        slope = np.zeros((len(matrix), 1, 1))
        for sign in (1.0, -1.0):
            closed = springs[(polynomials.contacts == k) & (polynomials.signs == sign)].sum(axis=0)
            slope = np.maximum(slope, closed[:, None, None])
        row = linear.deflections[:, 0, k, None, :n]
        matrix[:, n:, :n] += slope * linear.push[:, n:, k, None] * row
    return np.abs(np.linalg.eigvals(matrix)).max(axis=1)


def _rounded(steps: float) -> int:
    return int(min(4 * math.ceil(steps / 4), MOST_STEPS))


def revised(steps: int, error: float, allowed: float) -> int:
    """Estimate the steps that reach the allowed error, from the measured error; it is inf if the motion was lost."""
    factor = _SPARE * (error / allowed) ** (1.0 / _ORDER) if math.isfinite(error) else _MOST_AT_ONCE
    return max(_rounded(steps * min(factor, _MOST_AT_ONCE)), 8)
