"""The interior of a system with fixed retained coordinates: its static responses and its modes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh, splu

from gapwalk.reduction.sparse_matrices import Matrices

_DENSE = 1500  # degrees of freedom up to which all modes are computed at once
_LOOSE = 1e-12  # square of a frequency, relative to the largest, that counts as zero
_AGAIN = 1e-8  # fraction of a static response outside the modes below which it adds no new vector
_ASIDE = 1e-6  # shift of an iterative solver below the lowest mode, relative to the mean stiffness per inertia


@dataclass(frozen=True, eq=False)
class Interior:
    """The system with its retained coordinates fixed.

    Parameters
    ----------
    matrices
        The full system.
    kept : shape (kept,)
        Indices of the fixed coordinates.
    """

    matrices: Matrices
    kept: NDArray[np.intp]

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """Indices of the coordinates that can move."""
        return np.setdiff1d(np.arange(self.matrices.size), self.kept)

    @property
    def size(self) -> int:
        """Number of coordinates that can move."""
        return self.matrices.size - len(self.kept)

    @cached_property
    def constraint_shapes(self) -> NDArray[np.float64]:
        """Static shapes of the interior for a unit displacement of each retained coordinate, shape (size, kept)."""
        coupling = self.matrices.stiffness[:, self.kept][self.places]
        return -self.response(coupling.toarray())

    def response(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the static response to forces of shape (size, any)."""
        if not self.size or not forces.shape[1]:
            return np.zeros(forces.shape)
        return np.asarray(self._factors.solve(np.ascontiguousarray(forces)))

    @cached_property
    def inertial_forces(self) -> NDArray[np.float64]:
        """Inertial forces on the interior due to the retained coordinates, to first order; shape (n, kept)."""
        forces = np.zeros((self.matrices.size, len(self.kept)))
        coupling = self.matrices.mass[:, self.kept][self.places]
        forces[self.places] = coupling.toarray() + self._mass @ self.constraint_shapes
        return forces

    def modes(self, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the squares of the lowest frequencies, and the modes (unit modal mass) in columns."""
        count = min(count, self.size)
        if self.size <= _DENSE:
            squares, shapes = self._all_modes
        else:
            squares, shapes = self._few_modes(count)
        return squares[:count], shapes[:, :count]

    def loose_coordinate(self) -> int | None:
        """Return the coordinate that moves most if the interior can move without stiffness; None if it cannot."""
        if not self.size:
            return None
        squares, shapes = self.modes(1)
        if squares[0] > _LOOSE * self.matrices.scale:
            return None
        return int(self.places[np.argmax(np.abs(shapes[:, 0]))])

    def enriched(self, count: int, spread: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lowest modes and the static responses to distributed forces: squared frequencies, and vectors.

        The responses are made orthogonal to the modes and to one another, so that all vectors have unit modal mass and
        no coupling.
        """
        squares, shapes = self.modes(count)
        mass, stiffness = self._mass, self._stiffness
        rest = self.response(spread[self.places])
        sizes = np.sqrt(np.einsum("ij,ij->j", rest, mass @ rest))
        rest = rest[:, sizes > 0.0] / sizes[sizes > 0.0]
        for _ in range(2):  # twice suffices for orthogonality to rounding
            rest = rest - shapes @ (shapes.T @ (mass @ rest))
        norms, mixed = np.linalg.eigh(rest.T @ (mass @ rest))
        new = norms > _AGAIN
        rest = rest @ (mixed[:, new] / np.sqrt(norms[new]))
        more, turned = np.linalg.eigh(rest.T @ (stiffness @ rest))
        order = np.argsort(np.concatenate((squares, more)), kind="stable")
        return np.concatenate((squares, more))[order], np.hstack((shapes, rest @ turned))[:, order]

    @cached_property
    def _mass(self) -> Any:
        return self.matrices.mass[:, self.places][self.places].tocsc()

    @cached_property
    def _stiffness(self) -> Any:
        return self.matrices.stiffness[:, self.places][self.places].tocsc()

    @cached_property
    def _factors(self) -> Any:
        return splu(self._stiffness)

    @cached_property
    def _all_modes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if not self.size:
            return np.empty(0), np.empty((0, 0))
        squares, shapes = scipy.linalg.eigh(self._stiffness.toarray(), self._mass.toarray())
        return squares, shapes

    def _few_modes(self, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute modes by the Lanczos method, from just below zero upwards."""
        known = self._found.get("modes")
        if known is None or len(known[0]) < count:
            shift = -_ASIDE * float(self._stiffness.diagonal().sum() / self._mass.diagonal().sum())
            wanted = min(self.size - 1, max(count, 20))
            start = np.random.default_rng(0).normal(size=self.size)  # the same in every run
            known = eigsh(sp.csc_array(self._stiffness), wanted, self._mass, sigma=shift, v0=start)
            order = np.argsort(known[0])
            known = self._found["modes"] = (known[0][order], known[1][:, order])
        return known

    @cached_property
    def _found(self) -> dict[str, Any]:
        return {}
