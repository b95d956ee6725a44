"""The baseline of the batch integrator: a Runge-Kutta method for the paper's clutch, written by hand for SIMD."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from gapwalk import System

LANES = 64
STEPS = 200  # a forcing period, with which basins came out right


class SimdClutch:
    """The classical Runge-Kutta method for a two-mass system with one symmetric gap and one harmonic.

    Parameters
    ----------
    system
        A system like that of figure 15.
    """

    def __init__(self, system: System) -> None:
        (k11, k12), (k21, k22) = system.matrix("stiffness").tolist()
        (c11, c12), (c21, c22) = system.matrix("damping").tolist()
        self._numbers = (
            *(k11, k12, k21, k22, c11, c12, c21, c22, system["mean.q1"], system["mean.q3"]),
            *(system["stage2.force.q1"], system["stage2.force.q3"]),
            *(system["stage2.clearance"], system["stage2.impact_damping"]),
        )
        self._h = 2.0 * math.pi / system.frequency / STEPS
        self._force = system["harmonic1.amplitude"] * np.cos(np.pi * np.arange(2 * STEPS + 1) / STEPS)

    def run(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """Return the states, shape (N, 4), after some forcing periods."""
        blocks = np.ascontiguousarray(states.reshape(-1, LANES, 4).transpose(0, 2, 1))
        for block in blocks:
            _advance(block, periods, STEPS, self._h, self._force, *self._numbers)
        return blocks.transpose(0, 2, 1).reshape(-1, 4)


@numba.njit(nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz", "arcp"})
def _advance(
    z, periods, steps, h, force, k11, k12, k21, k22, c11, c12, c21, c22, m1, m3, n1, n3, b, beta
):  # pragma: no cover
    for _ in range(periods):
        for i in range(steps):
            e0, e1, e2 = m1 + force[2 * i], m1 + force[2 * i + 1], m1 + force[2 * i + 2]
            for l in range(LANES):
                q1, q3, v1, v3 = z[0, l], z[1, l], z[2, l], z[3, l]

                g = max(q1 - b, 0.0) - max(-q1 - b, 0.0)
                f = g + beta * abs(g) * v1
                a1 = e0 - k11 * q1 - k12 * q3 - c11 * v1 - c12 * v3 - n1 * f
                a3 = m3 - k21 * q1 - k22 * q3 - c21 * v1 - c22 * v3 - n3 * f
                v1_2, v3_2 = v1 + 0.5 * h * a1, v3 + 0.5 * h * a3

                x1, x3 = q1 + 0.5 * h * v1, q3 + 0.5 * h * v3
                g = max(x1 - b, 0.0) - max(-x1 - b, 0.0)
                f = g + beta * abs(g) * v1_2
                a1_2 = e1 - k11 * x1 - k12 * x3 - c11 * v1_2 - c12 * v3_2 - n1 * f
                a3_2 = m3 - k21 * x1 - k22 * x3 - c21 * v1_2 - c22 * v3_2 - n3 * f
                v1_3, v3_3 = v1 + 0.5 * h * a1_2, v3 + 0.5 * h * a3_2

                x1, x3 = q1 + 0.5 * h * v1_2, q3 + 0.5 * h * v3_2
                g = max(x1 - b, 0.0) - max(-x1 - b, 0.0)
                f = g + beta * abs(g) * v1_3
                a1_3 = e1 - k11 * x1 - k12 * x3 - c11 * v1_3 - c12 * v3_3 - n1 * f
                a3_3 = m3 - k21 * x1 - k22 * x3 - c21 * v1_3 - c22 * v3_3 - n3 * f
                v1_4, v3_4 = v1 + h * a1_3, v3 + h * a3_3

                x1, x3 = q1 + h * v1_3, q3 + h * v3_3
                g = max(x1 - b, 0.0) - max(-x1 - b, 0.0)
                f = g + beta * abs(g) * v1_4
                a1_4 = e2 - k11 * x1 - k12 * x3 - c11 * v1_4 - c12 * v3_4 - n1 * f
                a3_4 = m3 - k21 * x1 - k22 * x3 - c21 * v1_4 - c22 * v3_4 - n3 * f

                z[0, l] = q1 + h / 6.0 * (v1 + 2.0 * (v1_2 + v1_3) + v1_4)
                z[1, l] = q3 + h / 6.0 * (v3 + 2.0 * (v3_2 + v3_3) + v3_4)
                z[2, l] = v1 + h / 6.0 * (a1 + 2.0 * (a1_2 + a1_3) + a1_4)
                z[3, l] = v3 + h / 6.0 * (a3 + 2.0 * (a3_2 + a3_3) + a3_4)
