"""Tori as equations: a closed curve that the m-th stroboscopic map carries into itself.

    u(psi + 2 pi rho) = P^m(u(psi))

The unknowns are N states of the curve, at equally spaced phases, and the rotation number rho. The same curve with
another beginning of the phase is a solution too; a phase condition selects one (Schilder, Osinga and Vogt 2005, SIAM J.
Appl. Dyn. Syst. 4, 459-488). With two parameters, rho may be kept, and the second parameter is the unknown.

Method: docs/numerics/tori.md
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.dry_motion import is_dry
from gapwalk.flow.flow import PERIOD, Arc, flow_of
from gapwalk.flow.length_unit import smallness
from gapwalk.model.angle_dependence import loads_act, numbers_vary
from gapwalk.model.coefficients import ParameterPlane
from gapwalk.model.system import System
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.sticking import transition_of
from gapwalk.tori.closed_curve import rotation_matrices, tangents
from gapwalk.tori.tone_clock import has_tone


@dataclass(frozen=True, eq=False)
class TorusLinearisation:
    """Residual and derivatives of a `TorusEquation` at some unknowns, without the zeros of its Jacobian."""

    arcs: list[Arc]  #: The arcs over m forcing periods from each state.
    residual: NDArray[np.float64]  #: shape (N * size + 1,): The residual, and that of the phase condition.
    transitions: NDArray[np.float64]  #: shape (N, size, size): The transition matrices of the arcs.
    rotation: NDArray[np.float64]  #: shape (N, N): The matrix that rotates the samples.
    #: shape (N * size + 1, 2): Derivatives of the residual by the last unknown and by the parameter.
    columns: NDArray[np.float64]
    phase_row: NDArray[np.float64]  #: shape (N * size,): Derivatives of the phase condition.

    def dense(self) -> NDArray[np.float64]:
        """Return the Jacobian by the unknowns, without the parameter."""
        count, size = self.transitions.shape[:2]
        jacobian = np.zeros((count * size + 1, count * size + 1))
        blocks = jacobian[:-1, :-1].reshape(count, size, count, size)
        for entry in range(size):
            blocks[:, entry, :, entry] = -self.rotation
        places = np.arange(count)
        blocks[places, :, places, :] += self.transitions
        jacobian[:, -1] = self.columns[:, 0]
        jacobian[-1, :-1] = self.phase_row
        return jacobian

    def product(self, changes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the changes of the residual with some changes of all unknowns and the parameter, in columns."""
        count, size = self.transitions.shape[:2]
        curves = changes[:-2].reshape(count, size, -1)
        rotated = (self.rotation @ curves.reshape(count, -1)).reshape(curves.shape)
        moved = (self.transitions @ curves - rotated).reshape(count * size, -1)
        return np.vstack((moved, self.phase_row @ changes[:-2])) + self.columns @ changes[-2:]


@dataclass(frozen=True, eq=False)
class TorusEquation:
    """Equations of a torus of N samples in N states and the rotation number, or in N states and a second parameter.

    The Jacobian of the residual by the unknowns, with the transition matrices ``DP_j``, the rotation matrix S of the
    samples and the identity I of a state:

        [ DP_1                        |                ]
        [       ...        -  S (x) I |  -dS/drho u    ]
        [            DP_N             |                ]
        [ ------------------------------------------- ]
        [ u_ref'_1   ...    u_ref'_N  |  0             ]
    """

    system: System  #: The system.
    parameter: str  #: The parameter to follow.
    #: m, the number of curves that the strobes visit in turn, or of forcing periods after which they return to one.
    curves: int
    reference: NDArray[np.float64]  #: shape (N, state_size): The curve whose phase a solution has.
    kept: float | None = None  #: Rotation number to keep; None if it is the last unknown.
    second: str = ""  #: The parameter that is the last unknown if the rotation number is kept.
    tolerance: float = 1e-10  #: Largest residual of a torus, relative to the size of its states.
    last_scale: float = 0.5  #: Scale of the last unknown: half a turn, or the range of the second parameter.

    def __post_init__(self) -> None:
        refuse_without_tori(self.system)
        for name in self._names:
            self.system.structure.place(name)

    @property
    def count(self) -> int:
        """N, the number of samples."""
        return len(self.reference)

    @property
    def _names(self) -> tuple[str, ...]:
        return (self.parameter, self.second) if self.second else (self.parameter,)

    @cached_property
    def _plane(self) -> ParameterPlane:
        return ParameterPlane(self.system, self._names)

    @cached_property
    def _flow(self) -> Any:
        return flow_of(self.system, *self._names, transition=True)

    @cached_property
    def _phase_row(self) -> NDArray[np.float64]:
        """Derivatives of the phase condition: the curve does not move along its tangents, on average."""
        unit = self.system.state_scales()
        row = tangents(self.reference / unit) / unit
        return (row / np.abs(row).max() / self.count).ravel()

    def split(
        self, unknowns: NDArray[np.float64], value: float
    ) -> tuple[NDArray[np.float64], float, tuple[float, ...]]:
        """Return the states, the rotation number, and the values of the parameters that belong to unknowns."""
        states, last = unknowns[:-1].reshape(self.count, -1), float(unknowns[-1])
        return (states, last, (value,)) if self.kept is None else (states, self.kept, (value, last))

    def system_at(self, unknowns: NDArray[np.float64], value: float) -> System:
        """Return the system that unknowns and a value of the parameter belong to."""
        return self._plane.system_at(*self.split(unknowns, value)[2])

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; the evidence is the `TorusLinearisation`."""
        found = self.linearise(unknowns, value)
        return Evaluation(found.residual, found.dense(), found.columns[:, 1], found)

    def linearise(self, unknowns: NDArray[np.float64], value: float) -> TorusLinearisation:
        """Return residual and derivatives as they are: blocks along the curve, and a rotation; errors as `evaluate`."""
        states, rotation, point = self.split(unknowns, value)
        coefficients, slopes = self._plane.coefficients(*point)
        stop = PERIOD * self.curves
        arcs: list[Arc] = [self._flow.integrate(coefficients, state, 0.0, stop, slopes) for state in states]
        matrix, slope = rotation_matrices(self.count, rotation)
        residual = (np.array([arc.state for arc in arcs]) - matrix @ states).ravel()
        along = np.array([arc.sensitivity for arc in arcs]).reshape(residual.size, -1)
        last = -(slope @ states).ravel() if self.kept is None else along[:, 1]
        phase = float(self._phase_row @ (states - self.reference).ravel())
        return TorusLinearisation(
            arcs,
            np.append(residual, phase),
            np.array([transition_of(arc) for arc in arcs]),
            matrix,
            np.vstack((np.column_stack((last, along[:, 0])), np.zeros(2))),
            self._phase_row,
        )

    def scales(self, states: NDArray[np.float64], smallest: float) -> NDArray[np.float64]:
        """Return the scales of the unknowns: a motion of its own size counts as 1, whatever the number of samples."""
        unit = self.system.state_scales()
        length = max(float((np.abs(states) / unit).max()), smallest, smallness(self.system))
        return np.append(np.tile(unit * length, self.count) * np.sqrt(self.count), self.last_scale)


def refuse_without_tori(system: System) -> None:
    """Raise a ModelError for a system whose tori are not computed: with friction, rigid stops, or no excitation."""
    if is_dry(system.structure):
        raise ModelError(
            "tori of systems with dry friction or rigid stops are not computed: where the sequence of slip, stick and "
            "impacts changes along a torus, it has corners; settle() and classify() find the stable ones, "
            "lyapunov() their exponents"
        )
    if not (loads_act(system) or numbers_vary(system) or has_tone(system)):
        raise ModelError(
            "nothing excites this system: tori are computed as closed curves of strobes, once in each period of the "
            "excitation, and a free motion has none; gw.free.follow_self_excited(...) follows its periodic motions. "
            "Tori that begin at their Neimark-Sacker points are not computed; settle() shows stable ones"
        )
