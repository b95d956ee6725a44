"""Catalogue of the distinct orbits of one system, with the number of times each was found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.identity import phases, true_period
from gapwalk.orbit.newton import Newton
from gapwalk.orbit.orbit import Orbit

_SAME = 1e-6
"""Distance of two states, in half-widths of the box, within which they count as equal."""


@dataclass(eq=False)
class Entry:
    """One orbit, its `phases`, and the numbers of transients and of Newton iterations that reached it."""

    orbit: Orbit
    states: NDArray[np.float64]
    settled: int = 0
    newton: int = 0


class Catalogue:
    """Catalogue of the orbits of one system, which holds no motion twice, whatever its phase.

    Parameters
    ----------
    scales : shape (2n,)
        Half-widths of the box of states, by which distances are scaled.
    """

    def __init__(self, scales: NDArray[np.float64]) -> None:
        self.scales = scales
        self.entries: list[Entry] = []
        # a row for each state of each entry
        self._states = np.zeros((0, len(scales)))
        self._owners: list[Entry] = []
        self._periods = np.zeros(0, dtype=int)
        self._stable = np.zeros(0, dtype=bool)

    def add(self, orbit: Orbit) -> Entry:
        """Add an orbit and return its entry, which may exist already."""
        known = self.at(orbit.state, orbit.period)
        if known is None:
            known = Entry(orbit, phases(orbit))
            self.entries.append(known)
            self._states = np.concatenate((self._states, known.states))
            self._owners += [known] * len(known.states)
            self._periods = np.append(self._periods, [orbit.period] * len(known.states))
            self._stable = np.append(self._stable, [orbit.stable] * len(known.states))
        return known

    def at(self, state: NDArray[np.float64], period: int) -> Entry | None:
        """Return the entry that passes through a state and repeats after `period` forcing periods."""
        entry, distance = self.nearest(state, period)
        return entry if distance <= _SAME else None

    def nearest(self, state: NDArray[np.float64], period: int) -> tuple[Entry | None, float]:
        """Return the nearest entry to a state of those that repeat after `period` forcing periods, and its distance."""
        return self._nearest(state, period % self._periods == 0)

    def nearest_stable(self, state: NDArray[np.float64]) -> tuple[Entry | None, float]:
        """Return the stable entry nearest to a state, whatever its period, and its distance."""
        return self._nearest(state, self._stable)

    def _nearest(self, state: NDArray[np.float64], asked: NDArray[np.bool_]) -> tuple[Entry | None, float]:
        if not asked.any():
            return None, math.inf
        distances = np.abs((self._states - state) / self.scales).max(axis=1)
        distances[~asked] = math.inf
        nearest = int(distances.argmin())
        return self._owners[nearest], float(distances[nearest])

    def states(self, period: int) -> NDArray[np.float64]:
        """Return all phases of orbits that repeat after `period` forcing periods; shape (K, 2n)."""
        return self._states[period % self._periods == 0]


def exact_orbit(system: System, period: int, state: NDArray[np.float64]) -> Orbit | None:
    """Return the exact orbit, with its true period, through a state that nearly repeats; None if there is none."""
    try:
        orbit = find_orbit(system, period, state, newton=Newton(iterations=10))
        shortest = true_period(orbit)
        if shortest < period:
            orbit = find_orbit(system, shortest, orbit.state, newton=Newton(iterations=10))
    except NumericalError:
        return None
    return orbit
