"""Flexibility of contacts under harmonic forces, and its error in a reduced system."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gapwalk.reduction.sparse_matrices import Matrices

_SMALL = 60  # degrees of freedom up to which matrices are factored as dense ones
_AT_ONCE = 1_000_000  # entries of matrices that are factored together
_ASIDE = 0.005  # relative shift of the frequency into the complex plane, for resonances of an undamped system
_FINE, _COARSE = 48, 16  # frequencies up to the highest excitation, and above it
Complex = NDArray[np.complex128]
HARMONICS = 10
"""Harmonics of the highest excitation frequency that are considered; the k-th has the weight 1/k^2."""


@dataclass(frozen=True, eq=False)
class Flexibility:
    """Deflections of the contacts under unit forces, at some frequencies.

    Attributes
    ----------
    contacts : shape (frequencies, contacts, contacts)
        Deflections under a force of each contact.
    loads : shape (frequencies, contacts, loads)
        Deflections under each load.
    """

    contacts: NDArray[np.complex128]
    loads: NDArray[np.complex128]

    def closed(self, springs: NDArray[np.float64]) -> Flexibility:
        """Return the flexibility with contacts closed with these stiffnesses: ``(1 + G s)^-1 G``."""
        matrix = np.eye(len(springs)) + self.contacts * springs
        contacts, loads = (
            np.asarray(np.linalg.solve(matrix, each), dtype=np.complex128) for each in (self.contacts, self.loads)
        )
        return Flexibility(contacts, loads)

    def blocks(self) -> list[NDArray[np.complex128]]:
        """Return the flexibility of the contacts, and that of each load; each is compared with its own size."""
        return [self.contacts, *np.split(self.loads, self.loads.shape[2], axis=2)]


def flexibility_of(matrices: Matrices, frequencies: NDArray[np.float64]) -> Flexibility:
    """Compute the flexibility of a system with open contacts."""
    s = frequencies * (1j + (0.0 if matrices.damping.nnz else _ASIDE))
    forces = np.hstack((matrices.forces, matrices.loads)).astype(complex)
    solve = _by_dense_matrices if matrices.size <= _SMALL or not matrices.is_sparse else _by_sparse_matrices
    found = solve(matrices, np.asarray(s, dtype=np.complex128), forces)
    contacts = len(matrices.deflections)
    return Flexibility(found[:, :, :contacts], found[:, :, contacts:])


def _by_sparse_matrices(matrices: Matrices, s: Complex, forces: Complex) -> Complex:
    """Compute deflections under the forces, one frequency after the other."""
    found = np.empty((len(s), len(matrices.deflections), forces.shape[1]), dtype=np.complex128)
    for index, at in enumerate(s.tolist()):
        dynamic = matrices.stiffness + at * matrices.damping + at**2 * matrices.mass
        found[index] = matrices.deflections @ splu(sp.csc_array(dynamic)).solve(forces)
    return found


def _by_dense_matrices(matrices: Matrices, s: Complex, forces: Complex) -> Complex:
    """Compute deflections under the forces, many frequencies at a time."""
    stiffness, damping, mass = (each.toarray() for each in (matrices.stiffness, matrices.damping, matrices.mass))
    parts = []
    for some in np.array_split(s, -(-len(s) * matrices.size**2 // _AT_ONCE)):
        dynamic = stiffness + some[:, None, None] * damping + some[:, None, None] ** 2 * mass
        parts.append(matrices.deflections @ np.linalg.solve(dynamic, forces))
    return np.asarray(np.concatenate(parts), dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class Accuracy:
    """The error of the flexibility of reduced systems, compared with the full one.

    Parameters
    ----------
    full
        The full system.
    highest
        The highest frequency of the excitation.
    resonances : shape (any,)
        Additional frequencies, at which errors are largest.
    """

    full: Matrices
    highest: float
    resonances: NDArray[np.float64]

    @cached_property
    def frequencies(self) -> NDArray[np.float64]:
        """Frequencies of the comparison: up to the highest excitation, then up to its harmonics."""
        below = np.linspace(0.0, self.highest, _FINE + 1)[1:]
        above = np.geomspace(self.highest, HARMONICS * self.highest, _COARSE + 1)[1:]
        within = self.resonances[(self.resonances > 0.0) & (self.resonances <= above[-1])]
        return np.unique(np.concatenate((below, above, within)))

    def error(self, reduced: Matrices) -> float:
        """Compute the largest error of the flexibility, contacts open or closed, relative to its size.

        The size is that at the same frequency, or the median over the excitation range if that is larger, because the
        flexibility may vanish between two resonances. Above the range, at its k-th multiple, an error has the weight
        1/k^2: the forces of springs that close decrease like this, or faster.
        """
        if not len(self.full.deflections):
            return 0.0
        other = flexibility_of(reduced, self.frequencies)
        pairs = zip(self._full, (other, other.closed(self.full.springs)), strict=True)
        weights = np.minimum(1.0, (self.highest / self.frequencies) ** 2)
        within = self.frequencies <= self.highest
        worst = 0.0
        for exact, approximate in pairs:
            for one, two in zip(exact.blocks(), approximate.blocks(), strict=True):
                size = np.linalg.norm(one, axis=(1, 2))
                against = np.maximum(size, np.median(size[within]))
                off = np.linalg.norm(two - one, axis=(1, 2))
                worst = max(worst, float((weights * off / np.where(against > 0.0, against, 1.0)).max()))
        return worst

    @cached_property
    def _full(self) -> tuple[Flexibility, Flexibility]:
        found = flexibility_of(self.full, self.frequencies)
        return found, found.closed(self.full.springs)


def resonances_of(reduced: Matrices) -> NDArray[np.float64]:
    """Return the undamped natural frequencies with all contacts open, then with all closed; sorted within each."""
    mass, stiffness = reduced.mass.toarray(), reduced.stiffness.toarray()
    held = stiffness + (reduced.deflections.T * reduced.springs) @ reduced.deflections
    squares = [scipy.linalg.eigvalsh(each, mass) for each in (stiffness, held)]
    return np.sqrt(np.maximum(np.concatenate(squares), 0.0))
