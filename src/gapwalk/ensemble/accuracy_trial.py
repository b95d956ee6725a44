"""Trials: one forcing period each of trajectories of the batch integrator, compared with the exact flow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System

_SAMPLES = 33  # samples of an exact motion over a forcing period, which give the size of each component
_FAR = 1e-3  # fraction of the limit that an exact motion must reach if the batch integrator has exceeded the limit
_SMALL = 1e-12  # smallest scale of a component, relative to the largest component of its kind


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
