"""Results of the batch integrator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class BatchSurvey:
    """Extremes, forces and impacts of trajectories over the last forcing periods of a run; NaN if one diverged.

    Attributes
    ----------
    periods
        Number of surveyed forcing periods.
    low, high : shape (N, n)
        Smallest and largest value of each coordinate.
    peak_force : shape (N, contacts)
        Largest magnitude of each contact force.
    impacts : shape (N, contacts, 2)
        Contacts per forcing period: entries into the innermost stage of each contact on the positive and on the
        negative side. A contact that lasts less than a step may be missed.
    """

    periods: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    peak_force: NDArray[np.float64]
    impacts: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BatchRun:
    """Many trajectories after some forcing periods, at a stated accuracy.

    Attributes
    ----------
    states : shape (N, 2n)
        Positions, then velocities, at the end; NaN for trajectories that diverged.
    ran_away : shape (N,), bool
        True for trajectories that diverged.
    strobes : shape (noted, N, 2n), or None
        States every so many forcing periods, if requested.
    survey
        Extremes, contacts and largest forces, if requested.
    error
        Error over one forcing period, from comparison with the exact flow on trajectories of this run; see
        `BatchOptions`.
    worst
        The largest error of a compared trajectory and period: near-grazing and unstable motions amplify it.
    trials
        Number of comparisons (one trajectory over one period each).
    steps
        Steps per forcing period.
    """

    states: NDArray[np.float64]
    ran_away: NDArray[np.bool_]
    strobes: NDArray[np.float64] | None
    survey: BatchSurvey | None
    error: float
    worst: float
    trials: int
    steps: int
