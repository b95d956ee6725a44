"""Folds, flips and Neimark-Sacker points in two parameters: a periodic orbit with a critical multiplier."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.locus.condition import CONDITIONS, Criticality
from gapwalk.bifurcation.locus.plane import OrbitPlane
from gapwalk.continuation.branch import Kind
from gapwalk.motion.flow import Arc
from gapwalk.orbit.equation import Evaluation
from gapwalk.orbit.orbit import Orbit

_STEP = 1e-9
"""Step of the forward difference, in units of the state.

With exact matrices to take the difference of, rounding leaves about 1e-7 of the derivative at this step, and so does
curvature. Larger steps would reach over to the other side of a grazing contact nearby, where the derivative of the
monodromy matrix grows like one over the square root of the depth.
"""


@dataclass(frozen=True)
class MultiplierEquation:
    """``Phi(u; a, b) - u = 0`` and ``g(B(u; a, b)) = 0``, with B the monodromy matrix and g a condition on it.

    The unknowns are the state at theta = 0 and the first parameter; the second is the one to follow. The residual and
    the derivatives of Phi are exact. Those of g need second derivatives of Phi, along the critical vectors only: as
    those are symmetric, differences of the first derivatives along each vector give them all.

    Parameters
    ----------
    plane
        The orbits among which to look.
    kind
        The bifurcation: a fold, a flip or a Neimark-Sacker point.
    units : shape (2n,)
        Units of the state, so that the condition does not depend on those of the user.
    tolerance
        Largest residual, relative to the size of the unknowns.
    """

    plane: OrbitPlane
    kind: Kind
    units: NDArray[np.float64]
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
        state, size = unknowns[:-1], len(unknowns) - 1
        coefficients, slopes = self.plane.coefficients(float(unknowns[-1]), value)
        arc = self.plane.full_turn(coefficients, state, slopes)
        critical = self.criticality(arc)
        jacobian = np.empty((size + 1, size + 2))
        jacobian[:size] = self.plane.derivatives(arc)
        by_all = np.zeros(size + 2)
        for direction, covector in zip(critical.directions, critical.covectors, strict=True):
            beside = self.plane.full_turn(coefficients, state + _STEP * self.units * direction, slopes)
            by_all += (covector / self.units) @ (self.plane.derivatives(beside) - jacobian[:size])
        by_all /= _STEP
        # beside a grazing contact g is so steep that rounding alone would exceed the tolerance: g over its slope is not
        slope = max(1.0, float(np.linalg.norm(by_all[:size] * self.units)))
        jacobian[size] = by_all / slope
        jacobian[:size, :size].flat[:: size + 1] -= 1.0
        residual = np.append(arc.state - state, critical.value / slope)
        return Evaluation(residual, jacobian[:, :-1], jacobian[:, -1], arc)

    def criticality(self, arc: Arc) -> Criticality:
        """How far the orbit of an arc is from the bifurcation."""
        return self._condition(self.scaled(arc))

    def scaled(self, arc: Arc) -> NDArray[np.float64]:
        """The monodromy matrix of an arc, in units of the state."""
        assert arc.transition is not None
        return arc.transition * self.units / self.units[:, None]

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """The orbit of a solution."""
        return self.plane.orbit(unknowns[:-1], float(unknowns[-1]), value, evaluation)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """State and first parameter of an orbit."""
        return np.append(orbit.state, orbit.system[self.plane.names[0]])

    @cached_property
    def _condition(self):
        return CONDITIONS[self.kind]
