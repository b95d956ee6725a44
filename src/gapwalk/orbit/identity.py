"""When two orbits are the same motion: equal up to a shift by whole forcing periods, or by traversing it twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.motion.unit import magnitude
from gapwalk.orbit.orbit import Orbit

SAME = 1e-6
"""Distance of two states, relative to their size, within which they count as equal."""


def stroboscopic(orbit: Orbit) -> NDArray[np.float64]:
    """The states of an orbit at the start of each of its m forcing periods, shape (m, 2n)."""
    return orbit.strobes(orbit.period)


def true_period(orbit: Orbit, tolerance: float = SAME) -> int:
    """The smallest number of forcing periods after which an orbit repeats; it divides `orbit.period`."""
    states = stroboscopic(orbit)
    near = _distances(states, orbit) <= tolerance
    return next((k for k in range(1, orbit.period) if orbit.period % k == 0 and near[k]), orbit.period)


def is_same(a: Orbit, b: Orbit, tolerance: float = SAME) -> bool:
    """Whether two orbits of the same system are the same motion, begun at different forcing periods perhaps."""
    if a.period != b.period:
        return False
    return bool(np.any(_distances(stroboscopic(a), b) <= tolerance))


def _distances(states: NDArray[np.float64], orbit: Orbit) -> NDArray[np.float64]:
    return np.abs(states - orbit.state).max(axis=1) / magnitude(orbit.state, orbit.system)
