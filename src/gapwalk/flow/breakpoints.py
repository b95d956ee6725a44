"""The depth of a motion beyond the breakpoint of a switch, with its derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import Angles
from gapwalk.flow.motion import acceleration_at
from gapwalk.model.coefficients import CoefficientLayout


class Gauge:
    """Gauge of the depth of a motion beyond the breakpoint of a switch: positive where the stage is closed.

    The deflection may contain a prescribed displacement, so the depth depends on the angle too.
    """

    def __init__(self, layout: CoefficientLayout, switch: int) -> None:
        stages = [(contact, stage) for contact in layout.contacts for stage in contact.stages]
        self._layout = layout
        self._contact, stage = stages[switch]
        self._clearance, self._sign = stage.clearance, stage.sign

    @property
    def sways(self) -> bool:
        """True if the deflection contains a prescribed displacement."""
        return self._contact.sway is not None

    def vector(self, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the depth by the positions, shape (n,)."""
        return self._sign * coefficients[self._contact.deflection]

    def read(
        self, coefficients: NDArray[np.float64], theta: float, state: NDArray[np.float64]
    ) -> tuple[float, float, float]:
        """Return the depth beyond the breakpoint, and its first and second derivatives over time."""
        turning = float(self.vector(coefficients) @ acceleration_at(self._layout, coefficients, theta, state))
        return *self.depth(coefficients, theta, state), turning + self._sway(coefficients, theta, 2)

    def depth(self, coefficients: NDArray[np.float64], theta: float, state: NDArray[np.float64]) -> tuple[float, float]:
        """Return the depth beyond the breakpoint, and its derivative over time."""
        n, vector = self._layout.structure.size, self.vector(coefficients)
        depth, rate = (float(vector @ each) for each in (state[:n], state[n : 2 * n]))
        depth, rate = (each + self._sway(coefficients, theta, order) for order, each in enumerate((depth, rate)))
        return depth - float(coefficients[self._clearance]), rate

    def _sway(self, coefficients: NDArray[np.float64], theta: float, order: int) -> float:
        """Return the contribution of a prescribed displacement to the derivative of some order."""
        if self._contact.sway is None:
            return 0.0
        return self._sign * float(Angles(self._layout, coefficients, theta).sway(self._contact, 0, order))

    def slopes(
        self,
        coefficients: NDArray[np.float64],
        direction: NDArray[np.float64],
        theta: float,
        state: NDArray[np.float64],
    ) -> tuple[float, float]:
        """Return the derivatives of the depth and of its rate along a direction of the coefficients, at one state."""
        n, vector = self._layout.structure.size, self.vector(direction)
        depth, rate = float(vector @ state[:n]), float(vector @ state[n : 2 * n])
        if (sway := self._contact.sway) is not None:
            count, orders = len(self._layout.orders), np.array(self._layout.orders, dtype=float)
            waves, (cosines, sines) = Angles(self._layout, coefficients, theta).waves, np.split(coefficients[sway], 2)
            by_time = np.concatenate((-orders * waves[count:], orders * waves[:count])) / coefficients[0]
            depth += self._sign * float(direction[sway] @ waves)
            # the rate over time is that over theta times the frequency, which may be along the direction
            over_theta = orders @ (sines * waves[:count] - cosines * waves[count:])
            by_frequency = -float(over_theta) * direction[0] / coefficients[0] ** 2
            rate += self._sign * (float(direction[sway] @ by_time) + by_frequency)
        return depth - float(direction[self._clearance]), rate
