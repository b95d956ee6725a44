"""The linear part of a system in sparse matrices, with the vectors by which contacts and loads act on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.spring import Spring, springs_of
from gapwalk.model.static_force import static_forces_of
from gapwalk.model.system import System

_SPARSE = 0.1  # fraction of nonzero entries below which a matrix counts as sparse
_ROUNDING = 1e-10  # relative asymmetry of a matrix that counts as rounding


@dataclass(frozen=True, eq=False)
class Matrices:
    """The linear part of a system of n degrees of freedom."""

    #: mass, damping, stiffness: sparse, shape (n, n): M, C and K; M and K are symmetric.
    mass: Any
    damping: Any
    stiffness: Any
    #: shape (contacts, n): Deflection vectors e_k: each of a force by a formula of several deflections counts as a
    #: contact of its own.
    deflections: NDArray[np.float64]
    forces: NDArray[np.float64]  #: shape (n, contacts): Force vectors d_k.
    #: shape (n, loads): The constant load, and the shape of each harmonic, unless they are zero.
    loads: NDArray[np.float64]
    #: shape (contacts,): Stiffness of each contact with all stages of one side closed; of formulas at zero deflection.
    springs: NDArray[np.float64]

    @property
    def size(self) -> int:
        """Number n of degrees of freedom."""
        return self.deflections.shape[1]

    @cached_property
    def ports(self) -> NDArray[np.float64]:
        """All vectors by which contacts and loads act, shape (n, ports)."""
        return np.hstack((self.deflections.T, self.forces, self.loads))

    @cached_property
    def scale(self) -> float:
        """Largest ratio of stiffness to inertia of a coordinate: about the square of the highest frequency."""
        return float(np.abs(self.stiffness.diagonal() / self.mass.diagonal()).max())

    @cached_property
    def is_sparse(self) -> bool:
        """True if sparse factorisation is faster."""
        return max(self.mass.nnz, self.damping.nnz, self.stiffness.nnz) < _SPARSE * self.size**2

    def projected(self, basis: NDArray[np.float64]) -> Matrices:
        """Project the matrices on motions ``q = basis z``."""
        mass, damping, stiffness = (
            sp.csc_array(basis.T @ (each @ basis)) for each in (self.mass, self.damping, self.stiffness)
        )
        deflections, forces, loads = self.deflections @ basis, basis.T @ self.forces, basis.T @ self.loads
        return Matrices(mass, damping, stiffness, deflections, forces, loads, self.springs)


def matrices_of(system: System) -> Matrices:
    """Extract the linear part of a system."""
    n, structure, values = system.size, system.structure, system.values
    for which in ("mass", "stiffness"):
        matrix = system.matrix(which)
        if not np.allclose(matrix, matrix.T, rtol=0.0, atol=_ROUNDING * np.abs(matrix).max()):
            raise ModelError(
                f"the {which} matrix is not symmetric, but a modal reduction requires symmetry; write the equations "
                "of motion in Lagrange's form, or solve the system without reduction, with "
                "method=Balance()"
            )

    def vector(prefix: str) -> NDArray[np.float64]:
        return values[structure.block(prefix, n)]

    deflections, forces, springs = [], [], []
    for spring, force in zip(springs_of(system), static_forces_of(system), strict=True):
        stiffness = force.at(np.zeros(n)).stiffness if force.is_formula else [_stiffness(spring)]
        for deflection, slope in zip(force.deflections, stiffness, strict=True):
            deflections.append(deflection)
            forces.append(force.direction)
            springs.append(slope if np.isfinite(slope) else 0.0)
    shapes = [vector(load.shape) for load in structure.driving]
    loads = [load for load in (vector("mean"), *shapes) if load.any()]
    mass, damping, stiffness = (sp.csc_array(system.matrix(which)) for which in ("mass", "damping", "stiffness"))
    return Matrices(
        mass,
        damping,
        stiffness,
        np.array(deflections).reshape(-1, n),
        np.array(forces).reshape(-1, n).T,
        np.array(loads).reshape(-1, n).T,
        np.array(springs),
    )


def _stiffness(spring: Spring) -> float:
    """Return the stiffness of one contact with all stages of its stiffer side closed."""
    sides = {1: 0.0, -1: 0.0}
    for slope in spring.slopes:
        sides[slope.sign] += slope.stiffness
    return max(sides.values(), key=abs)
