"""The paper's clutch written for SciPy: plain numbers in the state equations, NumPy in the variational ones."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.stages import Exit, Stage, integrate
from gapwalk import System

PERIOD = 2.0 * math.pi


class Period(NamedTuple):
    """One forcing period: the final state, and its derivatives by the initial state and by the frequency."""

    state: NDArray[np.float64]
    transition: NDArray[np.float64]
    by_frequency: NDArray[np.float64] | None


class ScipyClutch:
    """A two-mass system with one symmetric gap, Hunt and Crossley's damping, and one harmonic.

    It is integrated over theta = Omega t. A stage is the side on which the contact touches: 0 none, 1 positive,
    2 negative. Each stage has its own right-hand sides, without branches.

    Parameters
    ----------
    system
        A system like that of figure 13.
    """

    def __init__(self, system: System) -> None:
        self.stiffness, self.damping = system.matrix("stiffness"), system.matrix("damping")
        self.force = np.array([system["stage2.force.q1"], system["stage2.force.q3"]]) * system["stage2.stiffness"]
        self.beta, self.clearance = system["stage2.impact_damping"], system["stage2.clearance"]
        self.mean = (system["mean.q1"], system["mean.q3"])
        self.amplitude = system["harmonic1.amplitude"]

    def period(self, state: NDArray[np.float64], frequency: float) -> NDArray[np.float64]:
        """Return the state after one forcing period."""
        stages = [Stage(self._slope(frequency, side), self._exits(side)) for side in (0, 1, -1)]
        return integrate(stages, self._stage_of(state), state, PERIOD)

    def period_with_sensitivities(
        self, state: NDArray[np.float64], frequency: float, *, by_frequency: bool = True
    ) -> Period:
        """Return the same with the derivatives by the initial state and, on request, by the frequency."""
        columns = 4 + by_frequency
        stages = [Stage(self._full_slope(frequency, side, columns), self._exits(side)) for side in (0, 1, -1)]
        start = np.concatenate((state, np.eye(4, columns).ravel()))
        final = integrate(stages, self._stage_of(state), start, PERIOD)
        derivatives = final[4:].reshape(4, columns)
        return Period(final[:4], derivatives[:, :4], derivatives[:, 4] if by_frequency else None)

    def _stage_of(self, state: NDArray[np.float64]) -> int:
        if abs(state[0]) <= self.clearance:
            return 0
        return 1 if state[0] > 0 else 2

    def _exits(self, side: int) -> list[Exit]:
        b = self.clearance
        if side:
            return [Exit(lambda _, y: y[0] - side * b, rising=side < 0, leads_to=0)]
        return [
            Exit(lambda _, y: y[0] - b, rising=True, leads_to=1),
            Exit(lambda _, y: y[0] + b, rising=False, leads_to=2),
        ]

    def _slope(self, frequency: float, side: int):
        """Return the right-hand side in plain floats, several times faster than arrays of this size."""
        r, cosine = 1.0 / frequency, math.cos
        (k11, k12), (k21, k22) = self.stiffness.tolist()
        (c11, c12), (c21, c22) = self.damping.tolist()
        (m1, m3), f, (n1, n3), b, beta = self.mean, self.amplitude, self.force.tolist(), self.clearance, self.beta

        def slope(theta: float, y: NDArray[np.float64]) -> tuple[float, ...]:
            q1, q3, v1, v3 = y.tolist()
            a1 = m1 + f * cosine(theta) - k11 * q1 - k12 * q3 - c11 * v1 - c12 * v3
            a3 = m3 - k21 * q1 - k22 * q3 - c21 * v1 - c22 * v3
            if side:
                g = q1 - side * b
                g += beta * side * g * v1
                a1 -= n1 * g
                a3 -= n3 * g
            return r * v1, r * v3, r * a1, r * a3

        return slope

    def _full_slope(self, frequency: float, side: int, columns: int):
        """Return the same with the variational equations, one matrix product for all columns."""
        slope, r = self._slope(frequency, side), 1.0 / frequency
        linear = np.zeros((4, 4))
        linear[:2, 2:] = r * np.eye(2)
        linear[2:, :2], linear[2:, 2:] = -r * self.stiffness, -r * self.damping
        push, b, beta = r * self.force, self.clearance, self.beta

        def full_slope(theta: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            matrix = linear
            if side:
                matrix = linear.copy()
                matrix[2:, 0] -= push * (1.0 + beta * side * y.item(2))
                matrix[2:, 2] -= push * (beta * side * (y.item(0) - side * b))
            rates = np.empty(4 + 4 * columns)
            rates[:4] = slope(theta, y[:4])
            by = rates[4:].reshape(4, columns)
            np.matmul(matrix, y[4:].reshape(4, columns), out=by)
            if columns > 4:
                by[:, 4] -= r * rates[:4]  # every slope is a multiple of r = 1/W, and dr/dW = -r^2
            return rates

        return full_slope
