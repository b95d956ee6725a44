"""One pass over an orbit: extremes and means of each coordinate, and where each contact's deflection turns."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.motion.flow import PERIOD
from gapwalk.motion.motion import Motion, sample

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit


class Survey(NamedTuple):
    """What one pass over an orbit shows.

    Attributes
    ----------
    extremes : shape (n, 4)
        Maximum, minimum, mean and root mean square of each coordinate.
    turns
        For each contact the angles at which its deflection turns, and its values there; shape (2, turns).
    """

    extremes: NDArray[np.float64]
    turns: tuple[NDArray[np.float64], ...]


def survey(orbit: Orbit) -> Survey:
    """Sample an orbit at even angles and at each of its contacts, so that it is smooth between neighbours.

    What lies between the samples comes from the quintic through positions, velocities and accelerations on either
    side; its error is about 1e-10 of the amplitude.
    """
    n, structure = orbit.system.size, orbit.system.structure
    count = orbit.samples * orbit.period
    even = PERIOD * orbit.period * np.arange(count + 1) / count
    theta, is_even = _with_contacts(even, orbit)
    motion = sample(orbit.system, orbit.state, theta)
    directions = [orbit.system.values[structure.block(f"{c.name}.deflection", n)] for c in structure.contacts]
    turns = turning_points(motion, np.vstack((np.eye(n), *directions)))
    high, low = motion.q.max(axis=0), motion.q.min(axis=0)
    for i, (_, values) in enumerate(turns[:n]):
        if len(values):
            high[i], low[i] = max(high[i], values.max()), min(low[i], values.min())
    steady = motion.q[is_even][:-1]
    extremes = np.column_stack((high, low, steady.mean(axis=0), np.sqrt((steady * steady).mean(axis=0))))
    return Survey(extremes, tuple(turns[n:]))


def turning_points(motion: Motion, directions: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Where combinations of the coordinates turn: for each row of `directions` angles and values, shape (2, turns)."""
    x, v, a = motion.q @ directions.T, motion.v @ directions.T, motion.a @ directions.T
    crossing = (v[:-1] * v[1:] <= 0.0) & (v[:-1] != 0.0)
    which, k = np.nonzero(crossing.T)
    h = (motion.theta[k + 1] - motion.theta[k]) / motion.system.frequency
    start, stop = (k, which), (k + 1, which)
    share, rise = _turn(x[stop] - x[start], h * v[start], h * v[stop], h * h * a[start] / 2, h * h * a[stop] / 2)
    thetas = motion.theta[k] + share * (motion.theta[k + 1] - motion.theta[k])
    both = np.vstack((thetas, x[start] + rise))
    return [both[:, which == i] for i in range(len(directions))]


def _with_contacts(even: NDArray[np.float64], orbit: Orbit) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The angles `even` and those of the contacts that do not coincide with one of them, and which of all are even."""
    touches = np.array([event.theta for event in orbit.events])
    spacing = even[1]
    touches = touches[np.abs(touches / spacing - np.round(touches / spacing)) > 1e-6]
    theta = np.concatenate((even, touches))
    order = np.argsort(theta, kind="stable")
    theta = theta[order]
    fresh = np.append(True, np.diff(theta) > 1e-9 * spacing)  # two contacts at once, as in a symmetric system
    return theta[fresh], (order < len(even))[fresh]


def _turn(jump, c1, d1, c2, d2) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where, in [0, 1], the quintics turn whose slopes have opposite signs at the ends, and how far they rise there.

    ``c1``, ``d1`` are the slopes at the ends, ``c2``, ``d2`` half the curvatures.
    """
    c3 = 10 * jump - 6 * c1 - 4 * d1 - 3 * c2 + d2
    c4 = -15 * jump + 8 * c1 + 7 * d1 + 3 * c2 - 2 * d2
    c5 = 6 * jump - 3 * c1 - 3 * d1 - c2 + d2
    u = c1 / (c1 - d1)
    for _ in range(3):
        slope = c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
        bend = 2 * c2 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))
        u = np.minimum(1.0, np.maximum(0.0, u - slope / np.where(bend == 0.0, np.inf, bend)))
    return u, u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
