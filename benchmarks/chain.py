"""A chain of masses of any length that ends at a stop, for gapwalk and for SciPy."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from benchmarks.stages import Exit, Stage, integrate
from gapwalk import Contact, Harmonic, Side, System
from gapwalk import Stage as Spring

FREQUENCY = 0.8
_GAP, _STOP, _FORCE = 0.2, 4.0, 0.5


def chain(size: int) -> System:
    """Return `size` masses between two walls with springs and dampers; the last is excited, and meets a stop."""
    stiffness = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    names = [f"x{index + 1}" for index in range(size)]
    last = {names[-1]: 1.0}
    return System(
        names,
        stiffness,
        0.05 * stiffness,
        contacts=[Contact("stop", last, (Spring(_GAP, _STOP, side=Side.POSITIVE),))],
        harmonics=[Harmonic(_FORCE, last)],
        frequency=FREQUENCY,
    )


class ScipyChain:
    """The same chain for SciPy: one matrix product for all masses, and the force of the stop on the last.

    Parameters
    ----------
    size
        Number of masses.
    """

    def __init__(self, size: int) -> None:
        system, self.size = chain(size), size
        r = 1.0 / FREQUENCY
        self.matrix = np.zeros((2 * size, 2 * size))
        self.matrix[:size, size:] = r * np.eye(size)
        self.matrix[size:, :size] = -r * system.matrix("stiffness")
        self.matrix[size:, size:] = -r * system.matrix("damping")
        self.closed = self.matrix.copy()
        self.closed[-1, size - 1] -= r * _STOP

    def period(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the state after one forcing period."""
        last, r = self.size - 1, 1.0 / FREQUENCY

        def free(theta: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            rates = self.matrix @ y
            rates[-1] += r * _FORCE * math.cos(theta)
            return rates

        def closed(theta: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            rates = self.closed @ y
            rates[-1] += r * (_FORCE * math.cos(theta) + _STOP * _GAP)
            return rates

        def gap(_: float, y: NDArray[np.float64]) -> float:
            return y[last] - _GAP

        closing, opening = Exit(gap, rising=True, leads_to=1), Exit(gap, rising=False, leads_to=0)
        stages = [Stage(free, [closing]), Stage(closed, [opening])]
        return integrate(stages, int(state[last] > _GAP), state, 2.0 * math.pi)
