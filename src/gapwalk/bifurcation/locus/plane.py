"""The orbits of one system in the plane of two parameters: what the equations of all loci have in common."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import ParameterPlane
from gapwalk.model.system import System
from gapwalk.motion.flow import PERIOD, Arc, Flow, flow_of
from gapwalk.orbit.equation import Evaluation
from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True)
class OrbitPlane:
    """Orbits of m forcing periods at all values of two parameters, by shooting in one segment.

    Parameters
    ----------
    system
        The system at the start.
    names
        The two parameters.
    period
        m, forcing periods.
    """

    system: System
    names: tuple[str, str]
    period: int

    @property
    def length(self) -> float:
        """Length of the orbits over theta."""
        return PERIOD * self.period

    def coefficients(self, first: float, second: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The coefficients of the flow at a point of the plane, and their derivatives by both parameters."""
        return self._parameters.coefficients(first, second)

    def turn(self, coefficients, state: NDArray[np.float64], slopes, stop: float) -> Arc:
        """The motion from a state at theta = 0 up to `stop`, with all sensitivities."""
        return self.flow.integrate(coefficients, state, 0.0, stop, slopes)

    def full_turn(self, coefficients, state: NDArray[np.float64], slopes) -> Arc:
        """The motion from a state over the whole length."""
        return self.flow.integrate(coefficients, state, 0.0, self.length, slopes)

    @staticmethod
    def derivatives(arc: Arc) -> NDArray[np.float64]:
        """Derivatives of the final state by the initial one and by both parameters, shape (2n, 2n + 2)."""
        assert arc.transition is not None
        assert arc.sensitivity is not None
        return np.concatenate((arc.transition, arc.sensitivity), axis=1)

    def orbit(self, state: NDArray[np.float64], first: float, second: float, evaluation: Evaluation) -> Orbit:
        """The orbit from a state at a point of the plane, from an evaluation whose evidence is its arc."""
        arc: Arc = evaluation.evidence
        assert arc.transition is not None
        return Orbit(
            self._parameters.system_at(first, second),
            self.period,
            state.copy(),
            multipliers([arc.transition]),
            tuple(arc.contacts),
            float(np.abs(evaluation.residual).max()),
            arc.steps,
        )

    @cached_property
    def flow(self) -> Flow:
        """The compiled flow with the sensitivities to both parameters."""
        return flow_of(self.system, *self.names, transition=True)

    @cached_property
    def _parameters(self) -> ParameterPlane:
        return ParameterPlane(self.system, self.names)
