"""The stroboscopic map: states of a motion once per forcing period."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, Arc, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System


class Strobe:
    """Advances states of one system by one forcing period, or several.

    Parameters
    ----------
    system
        The system.
    phase
        Angle of the excitation at the states, in radians.
    transition
        True if the state transition matrix is computed too.
    """

    def __init__(self, system: System, phase: float = 0.0, *, transition: bool = False) -> None:
        self.system, self.phase = system, float(phase)
        self._flow, self._coefficients = flow_of(system, transition=transition), coefficients_of(system)

    def arc(self, state: NDArray[np.float64], periods: int = 1) -> Arc:
        """Integrate the motion over some forcing periods, with its transition matrix if requested."""
        return self._flow.integrate(self._coefficients, state, self.phase, self.phase + PERIOD * periods)

    def run(self, state: NDArray[np.float64], count: int, every: int = 1) -> NDArray[np.float64]:
        """Return the next `count` states, `every` forcing periods apart, shape (count, 2n), without the given one."""
        states = np.empty((count, len(state)))
        for k in range(count):
            state = self.arc(state, every).state
            states[k] = state
        return states


def at_phase(system: System, state: NDArray[np.float64], phase: float) -> NDArray[np.float64]:
    """Return the state at the angle `phase` (0 to one period, in radians) on the motion from `state` at 0."""
    if phase == 0.0:
        return np.asarray(state, dtype=float)
    return flow_of(system).integrate(coefficients_of(system), state, 0.0, phase).state


def check_count(what: str, value: object, least: int = 1) -> None:
    """Check that a value is an integer of at least `least`; raise an error that states what is allowed."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ModelError(f"{what} is {value!r}; it must be an integer >= {least}")


def size_of(system: System, states: NDArray[np.float64], least: float = 0.0) -> NDArray[np.float64]:
    """Compute the size of a motion as a scale for each state component, shape (2n,), independent of the user's units.

    The scale of positions is the largest position, or the largest velocity over W if that is larger, and at least
    `least`; the scale of velocities is W times that.
    """
    n, w = system.size, system.frequency
    largest = max(float(np.abs(states[..., :n]).max()), float(np.abs(states[..., n:]).max()) / w)
    size = max(largest, least, np.finfo(float).tiny)
    return size * np.concatenate((np.ones(n), np.full(n, w)))
