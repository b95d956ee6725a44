"""Reduction of a system with many degrees of freedom to those at its contacts and its lowest modes.

Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Optional

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import eigsh, splu

from gapwalk.errors import ModelError
from gapwalk.flow.motion import Motion
from gapwalk.model.bounds import Natural, Positive, check
from gapwalk.model.modes import is_symmetric, whirls
from gapwalk.model.problems import did_you_mean
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.reduction.reduction_error import Matrices, matrices_of

if TYPE_CHECKING:
    from gapwalk.bifurcation.branch import Branch
    from gapwalk.orbit.harmonic_balance import Balance
    from gapwalk.reduction.reduction_error import BranchCheck, OrbitCheck


# The basis of a reduction: Craig and Bampton's, with static responses to distributed forces in addition to the modes.
#
# With q_b the retained coordinates (those of contacts and loads, and those that the user names) and q_i the others,
#
#     [ q_b ]   [  I    0  ] [ q_b ]
#     [ q_i ] = [ Psi  Phi ] [ eta ]
#
# where Psi are the static shapes in which the interior follows the retained coordinates, and Phi its lowest modes with
# these coordinates fixed (Craig and Bampton 1968, AIAA Journal 6, 1313-1319). So the reduced system is exact in static
# equilibrium, under all contact forces and loads, and the error of its flexibility grows with the square of the
# frequency over that of the first omitted mode. For forces that act on many coordinates, their static response (made
# orthogonal to the modes) is included instead of retained coordinates. For high accuracy, the response to the inertia
# of the shapes Psi is more effective than the same number of additional modes: the error then grows with the fourth
# power.
#
# The accuracy of a basis is the error of the flexibility of the contacts under harmonic forces.
#
# Method: docs/numerics/notes/models.md

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
    """The vectors that span the motions of a reduced system."""

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
            small, mass=sp.csc_array(0.5 * (mass + mass.T)), stiffness=sp.csc_array(0.5 * (stiffness + stiffness.T))
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
        """Return the lowest modes and the static responses to distributed forces: squared frequencies, and vectors."""
        # The responses are made orthogonal to the modes and to one another, so that all vectors have unit modal mass
        # and no coupling.
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
        """Compute the largest error of the flexibility, contacts open or closed, relative to its size."""
        # The size is that at the same frequency, or the median over the excitation range if that is larger, because the
        # flexibility may vanish between two resonances. Above the range, at its k-th multiple, an error has the weight
        # 1/k^2: the forces of springs that close decrease like this, or faster.
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


_MODES = "mode"
_ROUNDING = 1e-13  # relative change of a parameter below which it is only rounding
MATRICES = ("mass", "damping", "stiffness")
_ERROR = 1e-2
_REFERENCE = 2.0  # highest frequency, in highest harmonics, of the modes that approximate the resonances


@dataclass(frozen=True)
class Reduction:
    """A system of many degrees of freedom reduced to few, as returned by `reduce`.

    The reduced system has every parameter of contacts and of the excitation, and those of the retained coordinates,
    under their own names. It has no parameters of other coordinates (``stiffness.q7.q8``, ``mean.q7``). A matrix entry
    of retained coordinates includes the static contribution of the others. So its value differs from that in the full
    system, but a change of it is the same change in both.
    """

    #: full, system: The full system, and the reduced one.
    full: System
    system: System
    basis: Basis  #: The vectors that span the motions.
    up_to: float  #: Highest frequency of the excitation for which it was made.
    #: Largest relative error of the deflections of contacts under harmonic forces of the contacts and under the loads:
    #: up to that frequency, and, with the k-th multiple weighted by 1/k^2, up to ten times that. `check` estimates the
    #: resulting error of a motion and of special points.
    error: float

    @property
    def kept(self) -> tuple[str, ...]:
        """The retained coordinates, which belong to the reduced system too."""
        return self.system.coordinates[: len(self.basis.kept)]

    @property
    def modes(self) -> int:
        """The number of modes."""
        return len(self.basis.squares)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Natural frequencies (angular) of the modes, with the retained coordinates fixed; shape (modes,)."""
        return np.sqrt(np.maximum(self.basis.squares, 0.0))

    def full_at(self, reduced: System) -> System:
        """Return the full system with the parameter values of the reduced one, such as `orbit.system`."""
        if reduced.structure != self.system.structure:
            raise ModelError("the system is not the reduced one at some values; make it by `reduction.system.at(...)`")
        ours, theirs = self._shared
        values = self.full.values.copy()
        values[theirs] = reduced.values[ours]
        change = reduced.values - self.system.values
        change[np.abs(change) <= _ROUNDING * np.abs(self.system.values)] = 0.0
        change[ours] = 0.0
        ours, theirs = self._retained
        values[theirs] += change[ours]
        change[ours] = 0.0
        if change.any():
            name = reduced.structure.names[int(np.flatnonzero(change)[0])]
            raise ModelError(
                f"{name} was changed, but belongs to a mode: the full system has no such parameter; change the full "
                "system and reduce it again"
            )
        return System.from_values(self.full.structure, values)

    def expand(self, motion: Orbit | Motion, samples: int | None = None) -> Motion:
        """Expand a motion of the reduced system, sampled or an orbit over one period, to all coordinates."""
        sampled = motion.motion(samples) if isinstance(motion, Orbit) else motion
        full, back = self.full_at(sampled.system), self.basis.vectors.T
        moved = sampled.q @ back, sampled.v @ back, sampled.events, sampled.z
        return Motion(full, sampled.theta, *moved, sampled.slips, sampled.holds)

    def expand_state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Expand a state of the reduced system, shape (..., state_size), to all coordinates."""
        given, r = np.asarray(state, dtype=float), self.system.size
        if given.ndim == 0 or given.shape[-1] != self.system.state_size:
            raise ModelError(
                f"the state has shape {given.shape}; it must have {self.system.state_size} numbers: positions, "
                "then velocities, then extensions"
            )
        back = self.basis.vectors.T
        return np.concatenate((given[..., :r] @ back, given[..., r : 2 * r] @ back, given[..., 2 * r :]), axis=-1)

    def check(self, found: Orbit | Branch, method: Balance | None = None) -> OrbitCheck | BranchCheck:
        """Estimate the error of an orbit, or of a branch with its special points, compared with the full system."""
        # Both are inserted in the full system's own equations, in harmonic balance, where its linear part is exact:
        # with 15 harmonics by default, or as many as the orbits were found with.
        from gapwalk.reduction.reduction_error import check_branch, check_orbit  # imported late: few need it

        return check_orbit(self, found, method) if isinstance(found, Orbit) else check_branch(self, found, method)

    @cached_property
    def _shared(self) -> tuple[list[int], list[int]]:
        """Indices of the parameters that belong to no coordinate, in the reduced and in the full system."""
        names = scalars_of(self.system.structure)
        structures = (self.system.structure, self.full.structure)
        ours, theirs = ([structure.place(name) for name in names] for structure in structures)
        return ours, theirs

    @cached_property
    def _retained(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the parameters of retained coordinates alone, in both systems; a change is the same in both."""
        kept, sides = self.basis.kept, []
        for structure, at in ((self.system.structure, np.arange(len(kept))), (self.full.structure, kept)):
            n = structure.size
            squares = [structure.block(which, n, n)[np.ix_(at, at)].ravel() for which in MATRICES]
            sides.append(np.concatenate(squares + [structure.block(prefix, n)[at] for prefix in vectors_of(structure)]))
        return sides[0], sides[1]

    def __repr__(self) -> str:
        return (
            f"Reduction({self.full.size} degrees of freedom to {self.system.size}: {len(self.kept)} retained, "
            f"{self.modes} modes; contacts deflect within {self.error:.2g} up to frequency {self.up_to:.6g})"
        )


def reduced_system(full: System, basis: Basis, small: Matrices) -> System:
    """Build the reduced system with all values of the full one."""
    structure = structure_of(full.structure, basis)
    n, r = full.size, basis.size
    values = np.zeros(len(structure.names))
    for which in MATRICES:
        values[structure.block(which, r, r)] = getattr(small, which).toarray()
    for prefix in vectors_of(structure):
        values[structure.block(prefix, r)] = full.values[full.structure.block(prefix, n)] @ basis.vectors
    for name in scalars_of(structure):
        values[structure.place(name)] = full[name]
    return System.from_values(structure, values).at()  # `at` checks what `from_values` does not


def structure_of(full: Structure, basis: Basis) -> Structure:
    """Return the structure of the reduced system: the retained coordinates by name, then mode1, mode2, ..."""
    kept = tuple(full.coordinates[place] for place in basis.kept)
    taken = {*kept, *(contact.name for contact in full.contacts), *(harmonic.name for harmonic in full.harmonics)}
    prefix, count = _MODES, basis.size - len(kept)
    while any(f"{prefix}{number}" in taken for number in range(1, count + 1)):
        prefix += "_"
    names = (*kept, *(f"{prefix}{number}" for number in range(1, count + 1)))
    return Structure(names, full.contacts, full.harmonics)


def vectors_of(structure: Structure) -> list[str]:
    """Return the prefixes of the names of parameters that belong to one coordinate each."""
    found = ["mean", *(load.shape for load in structure.driving)]
    for contact in structure.contacts:
        found += [*contact.vectors, *([] if contact.reciprocal else [contact.push])]
    return found


def scalars_of(structure: Structure) -> list[str]:
    """Return the names of the parameters that belong to no coordinate: they are the same in both systems."""
    found = ["frequency"]
    for harmonic in structure.harmonics:
        found += harmonic.parameters
    for contact in structure.contacts:
        found += contact.parameters
    return found


def reduce(
    system: System,
    *,
    modes: int | None = None,
    error: float | None = None,
    up_to: float | None = None,
    keep: Sequence[str] = (),
) -> Reduction:
    """Reduce a system by Craig and Bampton's method, retaining its contact coordinates.

    The reduced system is an ordinary system, to which all methods apply. The coordinates at which contacts act, and
    loads on one or two coordinates, are retained under their own names. All other coordinates are replaced by
    ``mode1``, ``mode2``, ...

    Parameters
    ----------
    system
        The system; its mass and stiffness matrices are symmetric, its damping is arbitrary.
    modes
        The number of modes; or None for as many as the `error` requires.
    error
        Largest relative error of the deflections of contacts under harmonic forces; 0.01 by default. See
        `Reduction.error`.
    up_to
        The highest excitation frequency W for which the reduced system is intended; by default that of the system.
    keep
        Further coordinates to retain, for example for measurements or loads.

    Returns
    -------
    Reduction
        The reduced system, and its error.

    Raises
    ------
    ModelError
        If the matrices are not symmetric, or an option is invalid.
    NumericalError
        If the modes cannot be computed.

    Notes
    -----
    Craig and Bampton (1968), AIAA Journal 6, 1313-1319. The reduced system is exact in static equilibrium.

    Examples
    --------
    >>> chain = gw.train.chain(9, 1.0, 100.0, held=True).system()
    >>> small = gw.reduce(chain.at(frequency=1.0), modes=3, keep=["shaft1"])
    >>> small.system.coordinates
    ('shaft1', 'mode1', 'mode2', 'mode3')
    """
    _check(system, modes, error, up_to)
    system = system.equations  # of a drive train: its machine elements do not exist in the reduced system
    highest = system.frequency if up_to is None else float(up_to)
    matrices = matrices_of(system)
    bases = Bases.of(matrices, system.coordinates, keep)
    accuracy = _accuracy(matrices, bases, highest)
    basis, small = _best(bases, accuracy, _ERROR if error is None else error) if modes is None else _of(bases, modes)
    return Reduction(system, reduced_system(system, basis, small), basis, highest, accuracy.error(small))


def _check(system: System, modes: int | None, error: float | None, up_to: float | None) -> None:
    if not isinstance(system, System):
        raise ModelError(f"{system!r} is not a System; write reduce(gw.System(...), ...)")
    if modes is not None and error is not None:
        raise ModelError("modes and error are both given; give one of them: the error decides the number of modes")
    check("modes", modes, Natural | None)
    check("error", error, Optional[Annotated[float, Ge(1e-8), Le(1)]])  # noqa: UP045 (what | does not take)
    check("up_to", up_to, Positive | None)


def _accuracy(matrices: Matrices, bases: Bases, highest: float) -> Accuracy:
    """Compute the resonances of a reference basis with many modes, at which smaller bases are compared."""
    reference = bases.with_modes(bases.modes_up_to(_REFERENCE * HARMONICS * highest) + 2)
    return Accuracy(matrices, highest, resonances_of(reference.reduce(matrices)))


def _of(bases: Bases, modes: int, *, inertia: bool = False) -> tuple[Basis, Matrices]:
    basis = bases.with_modes(modes, inertia=inertia)
    return basis, basis.reduce(bases.matrices)


def _best(bases: Bases, accuracy: Accuracy, error: float) -> tuple[Basis, Matrices]:
    """Return the smallest basis whose error is small enough: modes alone, or modes and the response to inertia."""
    found = [_fewest(bases, accuracy, error, inertia=inertia) for inertia in (False, True)]
    return min(found, key=lambda each: each[0].size)


def _fewest(bases: Bases, accuracy: Accuracy, error: float, *, inertia: bool) -> tuple[Basis, Matrices]:
    """Find the fewest modes whose error is small enough, by bisection."""

    def is_enough(modes: int) -> bool:
        return accuracy.error(_of(bases, modes, inertia=inertia)[1]) <= error

    few, many = -1, max(1, bases.modes_up_to(accuracy.highest))
    while many < bases.interior.size and not is_enough(many):
        few, many = many, min(2 * many, bases.interior.size)
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (few, middle) if is_enough(middle) else (middle, many)
    return _of(bases, many, inertia=inertia)
