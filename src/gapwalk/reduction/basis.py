"""The basis of a reduction: Craig and Bampton's, with static responses to distributed forces in addition to the modes.

With q_b the retained coordinates (those of contacts and loads, and those that the user names) and q_i the others,

    [ q_b ]   [  I    0  ] [ q_b ]
    [ q_i ] = [ Psi  Phi ] [ eta ]

where Psi are the static shapes in which the interior follows the retained coordinates, and Phi its lowest modes with
these coordinates fixed (Craig and Bampton 1968, AIAA Journal 6, 1313-1319). So the reduced system is exact in static
equilibrium, under all contact forces and loads, and the error of its flexibility grows with the square of the frequency
over that of the first omitted mode. For forces that act on many coordinates, their static response (made orthogonal to
the modes) is included instead of retained coordinates. For high accuracy, the response to the inertia of the shapes Psi
is more effective than the same number of additional modes: the error then grows with the fourth power.

The accuracy of a basis is the error of the flexibility of the contacts under harmonic forces.

Method: docs/numerics/reduction.md
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh, splu

from gapwalk.errors import ModelError
from gapwalk.model.gyroscopic import is_symmetric, whirls
from gapwalk.model.problems import did_you_mean
from gapwalk.reduction.sparse_matrices import Matrices

_DENSE = 1500  # degrees of freedom up to which all modes are computed at once
_LOOSE = 1e-12  # square of a frequency, relative to the largest, that counts as zero
_AGAIN = 1e-8  # fraction of a static response outside the modes below which it adds no new vector
_ASIDE = 1e-6  # shift of an iterative solver below the lowest mode, relative to the mean stiffness per inertia
_SMALL = 60  # degrees of freedom up to which matrices are factored as dense ones
_AT_ONCE = 1_000_000  # entries of matrices that are factored together
_DETUNED = 0.005  # relative shift of the frequency into the complex plane, for resonances of an undamped system
_FINE, _COARSE = 48, 16  # frequencies up to the highest excitation, and above it
Complex = NDArray[np.complex128]
HARMONICS = 10
"""Harmonics of the highest excitation frequency that are considered; the k-th has the weight 1/k^2."""
_FEW = 2  # most coordinates of a contact or load that are retained; for more, its static response is used instead


@dataclass(frozen=True, eq=False)
class Basis:
    """The vectors that span the motions of a reduced system.

    Examples
    --------
    >>> small = gw.reduce(gw.train.chain(9, 1.0, 100.0, held=True).system(), modes=3, keep=["shaft1"])
    >>> small.basis.size, small.basis.vectors.shape
    (4, (9, 4))
    """

    kept: NDArray[np.intp]  #: shape (kept,): Indices of the retained coordinates.
    #: shape (modes,): Squares of the frequencies of the modes, with the retained coordinates fixed.
    squares: NDArray[np.float64]
    #: shape (n, kept + modes): ``q = vectors z``, z being the retained coordinates and the amplitudes of the modes.
    vectors: NDArray[np.float64]

    @property
    def size(self) -> int:
        """The number of vectors."""
        return self.vectors.shape[1]

    def reduce(self, matrices: Matrices) -> Matrices:
        """Project the system on this basis; entries that are zero or one by construction are set exactly."""
        small = matrices.projected(self.vectors)
        b = len(self.kept)
        mass, stiffness = small.mass.toarray(), small.stiffness.toarray()
        stiffness[b:, :b] = stiffness[:b, b:] = 0.0
        stiffness[b:, b:] = np.diag(self.squares)
        mass[b:, b:] = np.eye(len(self.squares))
        return replace(
            small,
            mass=sp.csc_array(0.5 * (mass + mass.T)),
            stiffness=sp.csc_array(0.5 * (stiffness + stiffness.T)),
        )


@dataclass(frozen=True, eq=False)
class Bases:
    """The bases of a system with different numbers of modes."""

    matrices: Matrices  #: The full system.
    #: shape (kept,): Indices of the coordinates that are retained, in the order of the full system.
    kept: NDArray[np.intp]
    #: shape (n, spread): Forces that act on more than a few coordinates: their static response is included instead.
    spread: NDArray[np.float64]

    @classmethod
    def of(cls, matrices: Matrices, coordinates: Sequence[str], names: Sequence[str] = ()) -> Bases:
        """Create the bases of a system with these coordinates, which retain also those of the given `names`."""
        if isinstance(names, str):
            raise ModelError(f'keep is {names!r}; it must be a list of coordinates: write keep=["{names}"]')
        for name in names:
            if name not in coordinates:
                known = did_you_mean(str(name), coordinates)
                raise ModelError(f"keep names {name!r}, which is not a coordinate; {known}")
        ports = matrices.ports
        counts = np.count_nonzero(ports, axis=0)
        near = np.flatnonzero(ports[:, counts <= _FEW].any(axis=1)).tolist()
        asked = [coordinates.index(name) for name in names]
        return cls(matrices, np.array(sorted({*near, *asked}), dtype=np.intp), ports[:, counts > _FEW])

    @cached_property
    def interior(self) -> Interior:
        """The system with the retained coordinates fixed, including any in which it could still move rigidly."""
        interior = Interior(self.matrices, self.kept)
        while (loose := interior.loose_coordinate()) is not None:
            interior = Interior(self.matrices, np.sort(np.append(interior.kept, loose)))
        return interior

    def with_modes(self, count: int, *, inertia: bool = False) -> Basis:
        """Return the basis with the lowest modes and, if `inertia`, the response to the inertia of the shapes Psi."""
        interior = self.interior
        forces = np.hstack((self.spread, interior.inertial_forces)) if inertia else self.spread
        squares, shapes = interior.enriched(count, forces)
        b = len(interior.kept)
        vectors = np.zeros((self.matrices.size, b + len(squares)))
        vectors[interior.kept, np.arange(b)] = 1.0
        vectors[interior.places, :b] = interior.constraint_shapes
        vectors[interior.places, b:] = shapes
        return Basis(interior.kept, squares, vectors)

    def modes_up_to(self, frequency: float) -> int:
        """Count the modes below a frequency."""
        interior, wanted = self.interior, 40
        while True:
            squares, _ = interior.modes(wanted)
            below = int(np.count_nonzero(squares <= frequency**2))
            if below < len(squares) or len(squares) < wanted or len(squares) == interior.size:
                return below
            wanted *= 2


@dataclass(frozen=True, eq=False)
class Interior:
    """The system with its retained coordinates fixed."""

    matrices: Matrices  #: The full system.
    kept: NDArray[np.intp]  #: shape (kept,): Indices of the fixed coordinates.

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
        known = self.__dict__.get("_known_modes")
        if known is None or len(known[0]) < count:
            shift = -_ASIDE * float(self._stiffness.diagonal().sum() / self._mass.diagonal().sum())
            wanted = min(self.size - 1, max(count, 20))
            start = np.random.default_rng(0).normal(size=self.size)  # the same in every run
            known = eigsh(sp.csc_array(self._stiffness), wanted, self._mass, sigma=shift, v0=start)
            order = np.argsort(known[0])
            known = self.__dict__["_known_modes"] = (known[0][order], known[1][:, order])
        return known


@dataclass(frozen=True, eq=False)
class Flexibility:
    """Deflections of the contacts under unit forces, at some frequencies."""

    #: shape (frequencies, contacts, contacts): Deflections under a force of each contact.
    contacts: NDArray[np.complex128]
    loads: NDArray[np.complex128]  #: shape (frequencies, contacts, loads): Deflections under each load.

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


@dataclass(frozen=True, eq=False)
class Accuracy:
    """The error of the flexibility of reduced systems, compared with the full one."""

    full: Matrices  #: The full system.
    highest: float  #: The highest frequency of the excitation.
    resonances: NDArray[np.float64]  #: shape (any,): Additional frequencies, at which errors are largest.

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
    mass, stiffness, damping = (each.toarray() for each in (reduced.mass, reduced.stiffness, reduced.damping))
    held = stiffness + (reduced.deflections.T * reduced.springs) @ reduced.deflections
    if not is_symmetric(damping):
        turning = 0.5 * (damping - damping.T)
        found = [whirls(mass, turning, each, np.zeros_like(mass))[0].real for each in (stiffness, held)]
        return np.sqrt(np.maximum(np.concatenate(found), 0.0))
    squares = [scipy.linalg.eigvalsh(each, mass) for each in (stiffness, held)]
    return np.sqrt(np.maximum(np.concatenate(squares), 0.0))


def flexibility_of(matrices: Matrices, frequencies: NDArray[np.float64]) -> Flexibility:
    """Compute the flexibility of a system with open contacts."""
    s = frequencies * (1j + (0.0 if matrices.damping.nnz else _DETUNED))
    forces = np.hstack((matrices.forces, matrices.loads)).astype(complex)
    solve = _by_dense_matrices if matrices.size <= _SMALL or not matrices.is_sparse else _by_sparse_matrices
    found = solve(matrices, np.asarray(s, dtype=np.complex128), forces)
    contacts = len(matrices.deflections)
    return Flexibility(found[:, :, :contacts], found[:, :, contacts:])


def _by_dense_matrices(matrices: Matrices, s: Complex, forces: Complex) -> Complex:
    """Compute deflections under the forces, many frequencies at a time."""
    stiffness, damping, mass = (each.toarray() for each in (matrices.stiffness, matrices.damping, matrices.mass))
    parts = []
    for some in np.array_split(s, -(-len(s) * matrices.size**2 // _AT_ONCE)):
        dynamic = stiffness + some[:, None, None] * damping + some[:, None, None] ** 2 * mass
        parts.append(matrices.deflections @ np.linalg.solve(dynamic, forces))
    return np.asarray(np.concatenate(parts), dtype=np.complex128)


def _by_sparse_matrices(matrices: Matrices, s: Complex, forces: Complex) -> Complex:
    """Compute deflections under the forces, one frequency after the other."""
    found = np.empty((len(s), len(matrices.deflections), forces.shape[1]), dtype=np.complex128)
    for index, at in enumerate(s.tolist()):
        dynamic = matrices.stiffness + at * matrices.damping + at**2 * matrices.mass
        found[index] = matrices.deflections @ splu(sp.csc_array(dynamic)).solve(forces)
    return found
