"""Equilibria along a parameter as n equations for n positions, with the eigenvalues of small motions about them.

The accelerations at rest vanish: ``q''(q, 0; a) = 0``. Their derivatives by positions, rates and the parameter are
taken by a complex step of the same formulas, exact to rounding, for any law. At a breakpoint of a contact the
derivatives are one-sided.

Method: docs/numerics/self-excited.md
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.forces import accelerations
from gapwalk.flow.length_unit import smallness
from gapwalk.free.rest_record import RestPoint
from gapwalk.free.small_motions import companion, tangents
from gapwalk.model.coefficients import ParameterLine, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit_equation import Evaluation

_STEP = 1e-150  # complex step
_LEAST = 1e-300  # square of a frequency


@dataclass(frozen=True, eq=False)
class RestEquation:
    """Equations of the equilibria of a system without excitation, along a parameter.

    The residual is the acceleration at rest over the square of a frequency of the system, a length.
    """

    system: System  #: The system.
    parameter: str  #: Name of the parameter.
    start: NDArray[np.float64]  #: shape (n,): Positions at which that frequency is taken.
    tolerance: float = 1e-12  #: Largest residual, relative to the positions.

    @cached_property
    def line(self) -> ParameterLine:
        """Systems along the parameter."""
        return ParameterLine(self.system, self.parameter)

    @cached_property
    def _square(self) -> float:
        stiffness = self.matrices(self.start, self.system[self.parameter])[0]
        return max(float(np.abs(stiffness).max()), _LEAST)

    @property
    def frequency(self) -> float:
        """A typical frequency of the system, by which residuals and rates are scaled."""
        return float(np.sqrt(self._square))

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives at positions and a value of the parameter."""
        layout = layout_of(self.system.structure)
        coefficients, slope = self.line.coefficients(value)
        rest = np.zeros(len(unknowns))
        moved = accelerations(layout, coefficients + 1j * _STEP * slope, 0.0, unknowns + 0j, rest)
        stiffness, damping = self.matrices(unknowns, value)
        by_parameter = -np.imag(moved) / _STEP / self._square
        found = Evaluation(
            -np.real(moved) / self._square,
            stiffness / self._square,
            by_parameter,
            (stiffness, damping),
        )
        if not all(np.isfinite(each).all() for each in (found.residual, found.by_unknowns, by_parameter)):
            raise FlowError("a force has no finite value or slope at rest")
        return found

    def matrices(self, positions: NDArray[np.float64], value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stiffness and damping for small motions about positions, per unit of mass, each shape (n, n)."""
        coefficients, _ = self.line.coefficients(value)
        return tangents(layout_of(self.system.structure), coefficients, positions, np.zeros(len(positions)))

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> RestPoint:
        """Return the equilibrium of a solution, with its eigenvalues."""
        system, depths = self.line.system_at(value), self.depths(unknowns, value)
        closed = tuple(bool(depth > 0.0) for depth in depths)
        return RestPoint(value, unknowns.copy(), eigenvalues(*evaluation.evidence), _pattern(system, closed))

    def depths(self, positions: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """Return the depth beyond each breakpoint, shape (switches,)."""
        system = self.line.system_at(value)
        vectors = [system.vector(form.vectors[0]) for form in system.structure.contacts]
        return np.array(
            [side * float(vectors[contact] @ positions) - clearance for contact, side, clearance in system.breakpoints]
        )

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the positions."""
        return np.full(self.system.size, max(length, smallness(self.system)) * np.sqrt(self.system.size))


def eigenvalues(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of small motions, largest real part first, shape (2n,)."""
    found = np.linalg.eigvals(companion(stiffness, damping)).astype(complex)
    return found[np.lexsort((-np.imag(found), -np.real(found)))]


def _pattern(system: System, closed: tuple[bool, ...]) -> str:
    """Return which contacts are closed, in words."""
    texts, breakpoints = [], system.breakpoints
    forms = [(place, form) for place, form in enumerate(system.structure.contacts) if form.stages]
    for place, form in forms:
        sides = [
            side for (contact, side, _), shut in zip(breakpoints, closed, strict=True) if contact == place and shut
        ]
        text = {1: "closed+", -1: "closed-", 0: "open"}[sides[0] if sides else 0]
        texts.append(text if len(forms) == 1 else f"{form.name} {text}")
    return ", ".join(texts)
