"""The number of steps per forcing period: a first estimate from the system, and its revision after a trial."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.batch_options import MOST_STEPS
from gapwalk.ensemble.scheme import Linear

_ORDER = 3  # order of the error, which the kinks of the forces limit
_TURN = 0.18  # radians per step of the fastest vibration for which the clutch of figure 15 has an error of 1e-4
_TURN_ERROR = 1e-4
_LEAST = 24  # fewest steps per period of the highest harmonic
_SPARE = 1.1
_MOST_AT_ONCE = 4.0


def first_guess(linear: Linear, error: float) -> int:
    """Estimate the steps from the fastest vibration with all stages closed, at the lowest frequency of all systems."""
    turns = 2.0 * math.pi * float(np.max(linear.rate * _fastest(linear)))
    steps = turns / (_TURN * (error / _TURN_ERROR) ** (1.0 / _ORDER))
    return _rounded(max(steps, _LEAST * max(linear.layout.orders, default=1)))


def revised(steps: int, error: float, allowed: float) -> int:
    """Estimate the steps that reach the allowed error, from the measured error; it is inf if the motion was lost."""
    factor = _SPARE * (error / allowed) ** (1.0 / _ORDER) if math.isfinite(error) else _MOST_AT_ONCE
    return max(_rounded(steps * min(factor, _MOST_AT_ONCE)), 8)


def _fastest(linear: Linear) -> NDArray[np.float64]:
    """Compute the spectral radius with all stages of one side closed, in radians per unit of time, shape (lanes,)."""
    n, matrix = linear.n, linear.matrix.copy()
    for k, slots in enumerate(linear.layout.contacts):
        slope = np.zeros((len(matrix), 1, 1))
        for sign in (1, -1):
            mine = [stage.stiffness for stage in slots.stages if stage.sign == sign]
            closed = np.maximum(linear.coefficients[:, mine], 0.0).sum(axis=1)
            slope = np.maximum(slope, closed[:, None, None])
        row = linear.deflections[:, 0, k, None, :n]
        matrix[:, n:, :n] += slope * linear.push[:, n:, k, None] * row
    return np.abs(np.linalg.eigvals(matrix)).max(axis=1)


def _rounded(steps: float) -> int:
    return int(min(4 * math.ceil(steps / 4), MOST_STEPS))
