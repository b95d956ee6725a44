"""Identity of orbits: the same motion up to a shift after which the forcing repeats, or repeated several times."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

SAME = 1e-6
"""Distance of two states, relative to their size, within which they count as equal."""


def stroboscopic(orbit: Orbit) -> NDArray[np.float64]:
    """Return the states of an orbit at the start of each of its m forcing periods, shape (m, 2n)."""
    return orbit.strobes(orbit.period)


def repeats(system: System) -> int:
    """Return how often the excitation repeats within a forcing period: three times for orders 3 and 6 alone."""
    return math.gcd(*(harmonic.order for harmonic in system.structure.harmonics)) or 1


def phases(orbit: Orbit) -> NDArray[np.float64]:
    """Return the states at theta = 0 of all orbits that are this motion with another phase; shape (m * `repeats`, 2n).

    If the excitation repeats three times in a forcing period, shifting a motion by a third of it gives another orbit
    that is the same motion.
    """
    count = repeats(orbit.system)
    return orbit.strobes(orbit.period * count, PERIOD / count)


def true_period(orbit: Orbit, tolerance: float = SAME) -> int:
    """Return the smallest number of forcing periods after which an orbit repeats; it divides `orbit.period`."""
    states = stroboscopic(orbit)
    near = _distances(states, orbit) <= tolerance
    return next((k for k in range(1, orbit.period) if orbit.period % k == 0 and near[k]), orbit.period)


def is_same(a: Orbit, b: Orbit, tolerance: float = SAME) -> bool:
    """Return whether two orbits of a system are the same motion, possibly with another phase; see `phases`."""
    if a.period != b.period:
        return False
    return bool(np.any(_distances(phases(a), b) <= tolerance))


def _distances(states: NDArray[np.float64], orbit: Orbit) -> NDArray[np.float64]:
    return np.abs(states - orbit.state).max(axis=1) / magnitude(orbit.state, orbit.system)
