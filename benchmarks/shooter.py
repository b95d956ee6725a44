"""The baseline's continuation: shooting with SciPy, one point after another at given frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.clutch import ScipyClutch

_TOLERANCE = 1e-7  # residual from which the next Newton step is as exact as the integrator; gapwalk stops there too
_ITERATIONS = 8


class Shot(NamedTuple):
    """A point of the branch: the state at theta = 0, its Floquet multipliers, and the Newton steps it took."""

    state: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    iterations: int


def walk(clutch: ScipyClutch, state: NDArray[np.float64], frequencies: Sequence[float]) -> list[Shot]:
    """Return the orbits at given frequencies, each predicted along the tangent at the previous one.

    It does less than gapwalk: no folds, no step-size control, no special points.
    """
    shots: list[Shot] = []
    tangent, before = np.zeros(4), frequencies[0]
    for frequency in frequencies:
        shot, tangent = _shoot(clutch, state + (frequency - before) * tangent, frequency)
        shots.append(shot)
        state, before = shot.state, frequency
    return shots


def _shoot(clutch: ScipyClutch, state: NDArray[np.float64], frequency: float) -> tuple[Shot, NDArray[np.float64]]:
    """Run Newton's method at one frequency; also return the derivative of the orbit by the frequency."""
    for iteration in range(1, _ITERATIONS + 1):
        period = clutch.period_with_sensitivities(state, frequency)
        residual = period.state - state
        both = np.linalg.solve(period.transition - np.eye(4), np.column_stack((-residual, -period.by_frequency)))
        state = state + both[:, 0]
        if np.abs(residual).max() <= _TOLERANCE:
            return Shot(state, np.linalg.eigvals(period.transition), iteration), both[:, 1]
    raise RuntimeError(f"SciPy's shooting did not converge at W = {frequency:.6g}")
