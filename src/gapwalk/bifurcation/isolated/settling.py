"""Transients that are followed until they repeat, instead of for a fixed number of forcing periods."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.isolated.deflation import Deflation, newton_aside
from gapwalk.bifurcation.isolated.orbit_catalogue import Catalogue, Entry, exact_orbit
from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.shooting import ShootingEquation

_EVERY = 8  # forcing periods between two examinations of the returns
_STROBES = np.array([PERIOD * k for k in range(_EVERY + 1)])  # in one call: a call costs as much as a period
_RETURN = 1e-3  # distance of a return, in half-widths of the box, below which a transient may be settling
_FINEST = 1e-11  # the closest return that is required
_NEAR = 1e-2  # distance from a stable orbit within which a transient that returns has settled on it
_SHRINKING = 0.75  # ratio of the returns, over half the patience, up to which a transient is continued
_LONGEST = 10  # longest transient, as a multiple of the patience; slower decay would not end by then
_DOUBTS = 8  # number of times per patience that the returns of a long transient are examined


@dataclass(frozen=True, eq=False)
class Settling:
    """Outcome of one transient.

    Attributes
    ----------
    path : shape (periods + 1, 2n)
        States at the start of each forcing period.
    entry
        The stable orbit on which it settled, or None.
    ran_away
        True if it could not be followed.
    """

    path: NDArray[np.float64]
    entry: Entry | None
    ran_away: bool = False


class Settler:
    """Integrator that follows the transients of one system until they settle.

    Parameters
    ----------
    system
        The system.
    catalogue
        The orbits found so far; new ones are added, including unstable ones found on the way.
    periods
        Longest period, in forcing periods, for which a return is sought.
    patience
        Forcing periods after which a transient whose returns no longer shrink is given up.
    """

    def __init__(self, system: System, catalogue: Catalogue, periods: int, patience: int) -> None:
        self._system, self._catalogue, self._periods, self._patience = system, catalogue, periods, patience
        self._flow, self._coefficients = flow_of(system), coefficients_of(system)

    def settle(self, state: NDArray[np.float64]) -> Settling:
        """Follow the transient from a state until it has settled, has diverged, or shows no sign of settling.

        It has settled if it returns closely and Newton's method finds a stable orbit there. Earlier than that, it has
        settled if it approaches a known stable orbit from one examination to the next.
        """
        path, finest, beside, before = [state], _RETURN, None, math.inf
        try:
            while self._goes_on(path):
                path += list(self._flow.sample(self._coefficients, path[-1], _STROBES)[0][1:])
                entry, distance = self._catalogue.nearest_stable(path[-1])
                if entry is beside and distance < before <= _NEAR:
                    return Settling(np.array(path), entry)
                beside, before = entry, distance
                period = self._returns(path, finest)
                if period:
                    entry = self._orbit_near(path[-1], period)
                    if entry is not None:
                        return Settling(np.array(path), entry)
                    finest = max(finest / 10.0, _FINEST)
        except FlowError:
            return Settling(np.array(path), None, ran_away=True)
        return Settling(np.array(path), None)

    def _goes_on(self, path: list[NDArray[np.float64]]) -> bool:
        """Return whether to follow a transient further: it is still short, or its returns shrink."""
        length = len(path) - 1
        if length < max(self._patience, 4 * self._periods):  # before that there are no two halves to compare
            return True
        if length >= _LONGEST * self._patience:
            return False
        if (length - self._patience) % max(_EVERY, self._patience // _DOUBTS // _EVERY * _EVERY) >= _EVERY:
            return True  # the next examination is not due yet
        half = max(self._patience // 2, 2 * self._periods)
        last, before = self._closeness(path[-half:]), self._closeness(path[-2 * half : -half])
        return last < _SHRINKING * before

    def _closeness(self, path: list[NDArray[np.float64]]) -> float:
        """Return the median distance of returns in a section of the path, for the period that returns most closely."""
        states = np.array(path) / self._catalogue.scales
        returns = [np.abs(states[m:] - states[:-m]).max(axis=1) for m in range(1, self._periods + 1) if m < len(states)]
        return min(float(np.median(each)) for each in returns)

    def _returns(self, path: list[NDArray[np.float64]], finest: float) -> int:
        """Return the smallest number of forcing periods after which the last state recurs within `finest`, or 0."""
        last = np.array(path[-self._periods - 1 :]) / self._catalogue.scales
        distances = np.abs(last[-1] - last[-2::-1]).max(axis=1)
        close = np.flatnonzero(distances <= finest)
        return int(close[0]) + 1 if len(close) else 0

    def _orbit_near(self, state: NDArray[np.float64], period: int) -> Entry | None:
        """Return the stable orbit on which a state that nearly returns has settled."""
        entry, distance = self._catalogue.nearest(state, period)
        if entry is None or distance > _NEAR or not entry.orbit.stable:
            equation = ShootingEquation(self._system, None, period)
            exact = newton_aside(equation, state, self._catalogue.scales, options=Deflation(iterations=8))
            orbit = None if exact is None else exact_orbit(self._system, period, exact)
            if orbit is None:
                return None
            entry = self._catalogue.add(orbit)
            distance = float(np.abs((entry.states - state) / self._catalogue.scales).max(axis=1).min())
        if entry.orbit.stable and distance <= _NEAR:
            return entry
        entry.newton += 1
        return None
