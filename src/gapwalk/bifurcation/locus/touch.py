"""Grazing in two parameters: a periodic orbit on which a contact just touches a breakpoint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.locus.plane import OrbitPlane
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, StageSlots, layout_of
from gapwalk.motion.forces import accelerations
from gapwalk.orbit.equation import Evaluation
from gapwalk.orbit.orbit import Orbit

MARGIN = 1e-11
"""How far, in units of the state, a grazing orbit stays from the breakpoint, on the side without the extra event.

So small, and yet so large that the touch itself leaves no event and no trace in the multipliers, which change like the
square root of its depth.
"""


@dataclass(frozen=True)
class TouchEquation:
    """``Phi(u; a, b) - u = 0``, and at ``theta*`` a deflection past a breakpoint has the value `depth` and turns.

    The unknowns are the state at theta = 0, ``theta*`` and the first parameter; the second is the one to follow.

    Parameters
    ----------
    plane
        The orbits among which to look.
    switch
        Which stage on which side: index into `Equations.switches`.
    depth
        How far past the breakpoint the deflection turns.
    tolerance
        Largest residual, relative to the size of the unknowns.
    """

    plane: OrbitPlane
    switch: int
    depth: float
    tolerance: float

    @property
    def system(self):
        """The system at the start."""
        return self.plane.system

    @property
    def parameter(self) -> str:
        """The second parameter."""
        return self.plane.names[1]

    @property
    def period(self) -> int:
        """m, forcing periods of the orbits."""
        return self.plane.period

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Residual and derivatives; see `Equation.evaluate`. Errors as in `Flow.integrate`."""
        state, size = unknowns[:-2], len(unknowns) - 2
        coefficients, slopes = self.plane.coefficients(float(unknowns[-1]), value)
        arc = self.plane.full_turn(coefficients, state, slopes)
        jacobian = np.zeros((size + 2, size + 3))
        jacobian[:size, :size], jacobian[:size, size + 1 :] = arc.transition, arc.sensitivity
        jacobian[:size, :size].flat[:: size + 1] -= 1.0
        turning, jacobian[size:] = self._turning(coefficients, slopes, state, float(unknowns[-2]))
        residual = np.concatenate((arc.state - state, turning))
        return Evaluation(residual, jacobian[:, :-1], jacobian[:, -1], arc)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """The orbit of a solution."""
        return self.plane.orbit(unknowns[:-2], float(unknowns[-1]), value, evaluation)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """State, angle of the turning point that comes nearest to the breakpoint, and first parameter of an orbit."""
        thetas, depths = orbit.turning_depths[self.switch]
        theta = thetas[int(np.argmin(np.abs(depths)))]
        return np.concatenate((orbit.state, [theta, orbit.system[self.plane.names[0]]]))

    def is_highest(self, unknowns: NDArray[np.float64], value: float) -> bool:
        """Whether the deflection turns from rising to falling, seen from outside the breakpoint."""
        coefficients, slopes = self.plane.coefficients(float(unknowns[-1]), value)
        _, derivatives = self._turning(coefficients, slopes, unknowns[:-2], float(unknowns[-2]))
        return bool(derivatives[1, -3] < 0.0)

    def _turning(self, coefficients, slopes, state: NDArray[np.float64], theta: float):
        """Depth (less the one wanted) and its rate at an angle, and their derivatives, shape (2, 2n + 3)."""
        n, size, stage = len(state) // 2, len(state), self._stage
        angle = theta % self.plane.length
        there, by_all = state, np.eye(size, size + 2)
        if angle > 0.0:
            arc = self.plane.turn(coefficients, state, slopes, angle)
            there, by_all = arc.state, self.plane.derivatives(arc)
        q, v = there[:n], there[n:]
        vector, vector_slopes = coefficients[self._slots.deflection], slopes[:, self._slots.deflection]
        acceleration = accelerations(self._layout, coefficients, angle, q, v)
        derivatives = np.empty((2, size + 3))
        by_all = np.stack((vector @ by_all[:n], vector @ by_all[n:]))
        by_all[:, size:] += np.stack((vector_slopes @ q, vector_slopes @ v))
        derivatives[:, :size], derivatives[:, size + 1 :] = by_all[:, :size], by_all[:, size:]
        derivatives[:, size] = coefficients[0] * vector @ v, coefficients[0] * vector @ acceleration
        derivatives *= stage.sign
        derivatives[0, size + 1 :] -= slopes[:, stage.clearance]
        depth = stage.sign * float(vector @ q) - float(coefficients[stage.clearance])
        return np.array([depth - self.depth, stage.sign * float(vector @ v)]), derivatives

    @cached_property
    def _layout(self) -> CoefficientLayout:
        return layout_of(self.plane.system.structure)

    @property
    def _slots(self) -> ContactSlots:
        return self._layout.contacts[self.plane.flow.equations.switches[self.switch][0]]

    @property
    def _stage(self) -> StageSlots:
        return self._slots.stages[self.plane.flow.equations.switches[self.switch][1]]
