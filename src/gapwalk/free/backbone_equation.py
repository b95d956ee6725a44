"""Free vibrations as equations: motions that start at rest and come to rest again after half a period.

Without losses a motion runs backwards as well as forwards. One that is at rest at two instants half a period apart
repeats: it swings from one place of rest to the other and back the same way (a "brake orbit"; Vakakis et al. 1996,
Normal Modes and Localization in Nonlinear Systems; Kerschen et al. 2009, Mech. Syst. Signal Process. 23, 170-194). So
n positions at rest and the frequency satisfy n equations, without a phase to fix or a multiplier 1 to remove:

    v(T/2; q0, W) = 0

With gyroscopic terms a motion that runs backwards is one of the rotor that turns the other way, and vibrations whirl
without coming to rest. They are periodic motions of the system with a damping that is an unknown too, and comes out as
zero, because the energy returns (Munoz-Almaraz et al. 2003, Physica D 181, 1-38).

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
from gapwalk.free.conservative import damping_values, potential_of
from gapwalk.free.free_shooting import FreeEquation, FreeShooting
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.parameter_homotopy import WAY, on_the_way
from gapwalk.model.system import System
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.sticking import transition_of


@dataclass(frozen=True, eq=False)
class BackboneEquation:
    """Equations of free vibrations in n positions at rest, along the frequency.

    The residual is the velocity after half a period, divided by the frequency.
    """

    system: System  #: A system without losses, from `without_losses`.
    tolerance: float = 1e-12  #: Largest residual of a free vibration, relative to its positions.

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
        """Return residual and derivatives at positions of rest and a frequency; the evidence is half of the motion."""
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
        half = 0.5 * np.abs(unknowns - arc.state[:size])
        still = np.zeros(size)
        return BackbonePoint(value, unknowns.copy(), still, half, energy, multipliers[order], 2 * len(arc.contacts))

    def unknowns(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of a motion that begins at a state."""
        return state[: self.system.size]

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the positions."""
        return np.full(self.system.size, max(length, smallness(self.system)) * np.sqrt(self.system.size))


@dataclass(frozen=True, eq=False)
class WhirlEquation:
    """Equations of free vibrations with gyroscopic terms, in their states and a damping, along the frequency."""

    system: System  #: A system without losses, from `without_losses`.
    coordinate: int  #: Number of the coordinate that is at rest at the start.
    tolerance: float = 1e-11  #: Largest residual of a free vibration, relative to its state.

    @property
    def parameter(self) -> str:
        """Name of the frequency among the parameters."""
        return self.system.structure.pace

    @cached_property
    def _free(self) -> FreeEquation:
        """The equation of the motions damped in proportion to the mass; the parameter is a damping ratio."""
        system = self.system
        damping = system.matrix("damping") + 2.0 * system.frequency * system.matrix("mass")
        damped = on_the_way(system, damping_values(system, damping))
        return FreeShooting(system.coordinates[self.coordinate]).pose(damped, WAY)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives at a state with a damping and a frequency; see `FreeEquation.evaluate`."""
        found = self._free.evaluate(np.append(unknowns[:-1], value), float(unknowns[-1]))
        assert found.by_parameter is not None
        by_unknowns = np.column_stack((found.by_unknowns[:, :-1], found.by_parameter))
        return found._replace(by_unknowns=by_unknowns, by_parameter=found.by_unknowns[:, -1])

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BackbonePoint:
        """Return the free vibration of a solution."""
        size, system = self.system.size, self.system
        orbit = self._free.orbit(np.append(unknowns[:-1], value), float(unknowns[-1]), evaluation)
        q, v = np.split(unknowns[:-1].copy(), [size])
        energy = (
            potential_of(system, q) - potential_of(system, np.zeros(size)) + 0.5 * float(v @ system.matrix("mass") @ v)
        )
        half = 0.5 * np.ptp(orbit.extremes[:size, :2], axis=1)
        return BackbonePoint(value, q, v, half, energy, orbit.multipliers, len(orbit.events))

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the states and of the damping."""
        size = max(length, smallness(self.system))
        return np.append(self.system.state_scales(size) * np.sqrt(self.system.size), 1.0)

    def unknowns(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of a motion that begins at a state."""
        return np.append(state, 0.0)


def free_equation(system: System, coordinate: int) -> BackboneEquation | WhirlEquation:
    """Return the equation of free vibrations of a system without losses."""
    return WhirlEquation(system, coordinate) if system.matrix("damping").any() else BackboneEquation(system)
