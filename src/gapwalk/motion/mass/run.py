"""What a mass flow brings back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class MassSurvey:
    """What the trajectories did over the last forcing periods of a run; NaN where one ran away.

    Attributes
    ----------
    periods
        How many forcing periods were surveyed.
    low, high : shape (N, n)
        Smallest and largest value of each coordinate.
    peak_force : shape (N, contacts)
        Largest size of each contact force.
    impacts : shape (N, contacts, 2)
        Contacts a forcing period: how often the innermost stage of each contact is entered on the positive and on the
        negative side. A touch that is over within a step may be missed.
    """

    periods: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    peak_force: NDArray[np.float64]
    impacts: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MassRun:
    """Many trajectories after some forcing periods, at a stated accuracy.

    Attributes
    ----------
    states : shape (N, 2n)
        Positions, then velocities, at the end; NaN where a trajectory ran away.
    ran_away : shape (N,), bool
        Which trajectories ran away to infinity.
    strobes : shape (noted, N, 2n), or None
        The states every so many forcing periods, if they were asked for.
    survey
        Extremes, contacts and largest forces, if they were asked for.
    error
        The error over one forcing period, as seen beside the exact flow on trajectories of this run; see `MassOptions`.
    worst
        The largest error of any trajectory and period that was compared: near-grazing and unstable motions amplify it.
    trials
        How many trajectories and periods were compared.
    steps
        Steps a forcing period.
    """

    states: NDArray[np.float64]
    ran_away: NDArray[np.bool_]
    strobes: NDArray[np.float64] | None
    survey: MassSurvey | None
    error: float
    worst: float
    trials: int
    steps: int
