"""Free vibrations as equations: motions that start at rest and come to rest again after half a period.

Without losses a motion runs backwards as well as forwards. One that is at rest at two instants half a period apart
repeats: it swings from one place of rest to the other and back the same way (a "brake orbit"; Vakakis et al. 1996,
Normal Modes and Localization in Nonlinear Systems; Kerschen et al. 2009, Mech. Syst. Signal Process. 23, 170-194). So
n positions at rest and the frequency satisfy n equations, without a phase to fix or a multiplier 1 to remove:

    v(T/2; q0, W) = 0

Method: docs/numerics/backbones.md
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.length_unit import smallness
from gapwalk.free.backbone_record import BackbonePoint
from gapwalk.free.conservative import potential_of
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.system import System
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.sticking import transition_of


@dataclass(frozen=True, eq=False)
class BackboneEquation:
    """Equations of free vibrations in n positions at rest, along the frequency.

    The residual is the velocity after half a period, divided by the frequency.

    Parameters
    ----------
    system
        A system without losses, from `without_losses`.
    tolerance
        Largest residual of a free vibration, relative to its positions.
    """

    system: System
    tolerance: float = 1e-12

    @property
    def parameter(self) -> str:
        """Name of the frequency among the parameters."""
        return self.system.structure.pace

    @cached_property
    def _line(self) -> ParameterLine:
        return ParameterLine(self.system, self.parameter)

    @cached_property
    def _flow(self) -> Flow:
        return flow_of(self.system, self.parameter, transition=True)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives at positions of rest and a frequency; the evidence is the half of the motion.

        Raises
        ------
        FlowError
            If the motion diverges.
        """
        size = self.system.size
        coefficients, direction = self._line.coefficients(value)
        state = np.append(unknowns, np.zeros(size))
        arc = self._flow.integrate(coefficients, state, 0.0, 0.5 * PERIOD, direction)
        frequency = self._line.system_at(value).frequency
        pace = frequency / value  # of the parameter, which may have another unit
        residual = arc.state[size:] / frequency
        assert arc.sensitivity is not None
        by_frequency = arc.sensitivity[size:] / frequency - residual * pace / frequency
        return Evaluation(residual, transition_of(arc)[size:, :size] / frequency, by_frequency, arc)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BackbonePoint:
        """Return the free vibration of a solution.

        The second half of a motion is the first, backwards, so that the monodromy matrix is ``R A^-1 R A`` with the
        transition matrix A of the first half, and R, which turns velocities round.
        """
        arc, size = evaluation.evidence, self.system.size
        half = transition_of(arc)
        turn = np.diag(np.repeat([1.0, -1.0], size))
        multipliers = np.linalg.eigvals(turn @ np.linalg.solve(half, turn @ half)).astype(complex)
        energy = potential_of(self.system, unknowns) - potential_of(self.system, np.zeros(size))
        order = np.argsort(-np.abs(multipliers))
        return BackbonePoint(
            value, unknowns.copy(), arc.state[:size].copy(), energy, multipliers[order], 2 * len(arc.contacts)
        )

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the positions."""
        return np.full(self.system.size, max(length, smallness(self.system)) * np.sqrt(self.system.size))
