"""Computations of their own for the tests of this room: figure 15's system written out once more, for SciPy."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

# figure 15 of the paper: K11 K12 K21 K22, C11 C12 C21 C22, beta, n1 n2, Tm1 Tm2, Te1
K, C, BETA, N, MEAN, FORCE = (0.1, 0.6, 0.06, 1.1), (0.04, 0.04, 0.04, 0.06), 0.05, (0.9, 0.54), (0.25, 0.25), 0.5


def figure15(frequency: float):
    """Right-hand side for states of shape (4,) or (4, many): q1, q3, q1', q3'."""

    def rhs(t, y):
        if y.ndim == 1:
            return alone(t, *y.tolist())
        q1, q3, v1, v3 = y
        g = np.maximum(q1 - 1.0, 0.0) + np.minimum(q1 + 1.0, 0.0)
        f = g + BETA * np.abs(g) * v1
        a1 = -K[0] * q1 - C[0] * v1 + K[1] * q3 + C[1] * v3 - N[0] * f + MEAN[0] + FORCE * np.cos(frequency * t)
        a3 = K[2] * q1 + C[2] * v1 - K[3] * q3 - C[3] * v3 + N[1] * f + MEAN[1]
        return np.stack((v1, v3, a1, a3))

    def alone(t, q1, q3, v1, v3):
        """The same in plain numbers, which is several times as fast for a single state."""
        g = q1 - 1.0 if q1 > 1.0 else q1 + 1.0 if q1 < -1.0 else 0.0
        f = g + BETA * abs(g) * v1
        a1 = -K[0] * q1 - C[0] * v1 + K[1] * q3 + C[1] * v3 - N[0] * f + MEAN[0] + FORCE * math.cos(frequency * t)
        a3 = K[2] * q1 + C[2] * v1 - K[3] * q3 - C[3] * v3 + N[1] * f + MEAN[1]
        return v1, v3, a1, a3

    return rhs


def ueda(damping: float, force: float):
    """``x'' + k x' + x^3 = B cos t`` (Ueda 1979), states of shape (2,) or (2, many)."""

    def rhs(t, y):
        return np.stack((y[1], force * np.cos(t) - damping * y[1] - y[0] ** 3))

    return rhs


def strobes(rhs, frequency: float, state, periods: int, max_step: float = 0.02):
    """States a forcing period apart, by SciPy's DOP853 with steps too short to miss a contact; shape (periods, 2n)."""
    span = 2 * np.pi / frequency
    times = span * np.arange(1, periods + 1)
    found = solve_ivp(rhs, (0.0, times[-1]), state, "DOP853", times, rtol=1e-10, atol=1e-12, max_step=max_step)
    assert found.success
    return found.y.T


def next_strobes(rhs, frequency: float, states, periods: int = 1, steps: int = 400):
    """States some forcing periods after many others, shape (many, 2n), by SciPy's DOP853 with equal short steps."""
    span = 2 * np.pi / frequency
    shape = states.T.shape

    def flat(t, y):
        return rhs(t, y.reshape(shape)).ravel()

    found = solve_ivp(
        flat, (0.0, periods * span), states.T.ravel(), "DOP853", rtol=1e-2, atol=1.0, max_step=span / steps
    )
    assert found.success
    return found.y[:, -1].reshape(shape).T


def largest_exponent(rhs, frequency: float, states, periods: int, steps: int, apart: float = 1e-7):
    """Largest Lyapunov exponent by pairs of neighbouring motions, all at once, brought together every period.

    `states` has the shape (2n, pairs). Returns mean and standard error over the pairs, per unit of time.
    """
    size, pairs = states.shape
    span = 2 * np.pi / frequency
    random = np.random.default_rng(3)
    shift = random.normal(size=(size, pairs))
    shift *= apart / np.linalg.norm(shift, axis=0)
    logs = []

    def flat(t, y):
        return rhs(t, y.reshape(size, -1)).ravel()

    for k in range(periods):
        both = np.hstack((states, states + shift))
        # tolerances that never shorten a step: all motions take the same short ones, kinks or not
        found = solve_ivp(
            flat, (k * span, (k + 1) * span), both.ravel(), "DOP853", rtol=1e-2, atol=1.0, max_step=span / steps
        )
        end = found.y[:, -1].reshape(size, 2 * pairs)
        states, shift = end[:, :pairs], end[:, pairs:] - end[:, :pairs]
        length = np.linalg.norm(shift, axis=0)
        logs.append(np.log(length / apart) / span)
        shift *= apart / length
    means = np.mean(logs[5:], axis=0)  # the first periods turn the shifts into the direction that grows
    return means.mean(), means.std(ddof=1) / np.sqrt(pairs)
