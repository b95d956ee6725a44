"""Trials: pieces of a mass flow's own trajectories, each one forcing period long, beside the exact flow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.motion.flow import PERIOD, flow_of

_SAMPLES = 33  # of an exact motion over a forcing period, from which the size of each component is read
_FAR = 1e-3  # share of the limit that an exact motion must reach where the mass flow has left it
_SMALL = 1e-12  # of the largest size of its kind: the least by which a component is measured


class Trial(NamedTuple):
    """One trajectory over one forcing period.

    Attributes
    ----------
    lane
        Which trajectory.
    before, after : shape (2n,)
        Its states at the start and at the end; NaN at the end if it ran away.
    """

    lane: int
    before: NDArray[np.float64]
    after: NDArray[np.float64]


@dataclass(frozen=True)
class Verdict:
    """How a mass flow compares with the exact flow.

    Attributes
    ----------
    error
        Root mean square of the errors of all trials; see `MassOptions.error`.
    worst
        The largest of them.
    trials
        How many forcing periods were compared.
    """

    error: float
    worst: float
    trials: int


def judge(trials: Sequence[Trial], system_of: Callable[[int], System], limit: float) -> Verdict:
    """Compare trials with the exact flow.

    Parameters
    ----------
    trials
        What to compare.
    system_of
        Gives the system of a lane.
    limit
        Size of a state from which a motion has run away.
    """
    differences: list[NDArray[np.float64]] = []
    sizes: list[NDArray[np.float64]] = []
    false_alarms = 0
    for trial in trials:
        path = _exact(system_of(trial.lane), trial.before)
        gone = not np.all(np.isfinite(trial.after))
        if path is None or gone:
            # far out both leave at about the same time, but not in the same forcing period
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
    """The exact motion over one forcing period, shape (samples, 2n), or None if it runs away."""
    try:
        return flow_of(system).sample(coefficients_of(system), state, np.linspace(0.0, PERIOD, _SAMPLES))[0]
    except FlowError:
        return None


def _scale(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """What each component is measured by: its own size, or next to nothing where it does not move at all."""
    halves = sizes.reshape(2, -1)
    least = np.maximum(halves.max(axis=1, keepdims=True) * _SMALL, np.finfo(float).tiny)
    return np.maximum(halves, least).ravel()
