"""The stroboscopic map: states of a motion once every forcing period."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.motion.flow import PERIOD, Arc, flow_of


class Strobe:
    """Carries states of one system over one forcing period at a time, or several.

    Parameters
    ----------
    system
        The system.
    phase
        Angle of the excitation, in radians, at which the states are seen.
    transition
        Whether the state transition matrix is wanted too.
    """

    def __init__(self, system: System, phase: float = 0.0, *, transition: bool = False) -> None:
        self.system, self.phase = system, float(phase)
        self._flow, self._coefficients = flow_of(system, transition=transition), coefficients_of(system)

    def arc(self, state: NDArray[np.float64], periods: int = 1) -> Arc:
        """The motion over some forcing periods, with its transition matrix if there is one."""
        return self._flow.integrate(self._coefficients, state, self.phase, self.phase + PERIOD * periods)

    def run(self, state: NDArray[np.float64], count: int, every: int = 1) -> NDArray[np.float64]:
        """The next `count` states, `every` forcing periods apart, shape (count, 2n); the given one is not repeated."""
        states = np.empty((count, len(state)))
        for k in range(count):
            state = self.arc(state, every).state
            states[k] = state
        return states


def at_phase(system: System, state: NDArray[np.float64], phase: float) -> NDArray[np.float64]:
    """The state at the angle `phase` (0 to one period, in radians) on the motion from `state` at 0."""
    if phase == 0.0:
        return np.asarray(state, dtype=float)
    return flow_of(system).integrate(coefficients_of(system), state, 0.0, phase).state


def check_count(what: str, value: object, least: int = 1) -> None:
    """Refuse a number of periods that is none, and say what to write."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ModelError(f"{what} is {value!r}; it must be an integer >= {least}")


def size_of(system: System, states: NDArray[np.float64], least: float = 0.0) -> NDArray[np.float64]:
    """The size of a motion as a scale for each component of its states, shape (2n,): no unit of the user's counts.

    Positions are measured by the largest position, or by the largest velocity over W if that is more; velocities by
    W times that. The size of positions is at least `least`.
    """
    n, w = system.size, system.frequency
    largest = max(float(np.abs(states[..., :n]).max()), float(np.abs(states[..., n:]).max()) / w)
    size = max(largest, least, np.finfo(float).tiny)
    return size * np.concatenate((np.ones(n), np.full(n, w)))
