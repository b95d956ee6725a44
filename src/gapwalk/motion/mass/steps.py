"""How many steps a forcing period takes: a first guess from the system, and what a trial makes of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gapwalk.motion.mass.options import MOST_STEPS
from gapwalk.motion.mass.scheme import Linear

_ORDER = 3  # of the error, which the kinks of the forces set
_TURN = 0.18  # radians a step of the fastest vibration, at which the clutch of figure 15 has an error of 1e-4
_TURN_ERROR = 1e-4
_LEAST = 24  # steps a period of the highest harmonic
_SPARE = 1.1
_MOST_AT_ONCE = 4.0


def first_guess(linear: Linear, error: float) -> int:
    """Steps a forcing period from the fastest vibration, all stages closed, at the lowest frequency of all systems."""
    turns = 2.0 * math.pi * float(np.max(linear.rate * _fastest(linear)))
    steps = turns / (_TURN * (error / _TURN_ERROR) ** (1.0 / _ORDER))
    return _rounded(max(steps, _LEAST * max(linear.layout.orders, default=1)))


def revised(steps: int, error: float, allowed: float) -> int:
    """Steps that should hold the error allowed, from the error that was seen; inf where the motion was lost."""
    factor = _SPARE * (error / allowed) ** (1.0 / _ORDER) if math.isfinite(error) else _MOST_AT_ONCE
    return max(_rounded(steps * min(factor, _MOST_AT_ONCE)), 8)


def _fastest(linear: Linear) -> NDArray[np.float64]:
    """Largest eigenvalue of each system with all stages of one side closed, in radians a unit of time; (lanes,)."""
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
