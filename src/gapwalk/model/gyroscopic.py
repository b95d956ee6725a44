"""Gyroscopic terms: the part of the damping matrix that loses no energy, and the masses by which energy is measured.

With the symmetric masses of the kinetic energy, the power that damping takes out is ``v C v``, to which the skew part
of C adds nothing. It belongs to free vibrations as mass and stiffness do: their modes are then complex, and whirl.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System

SYMMETRIC = 1e-9  # relative asymmetry of a matrix that counts as rounding
_LARGE = 40  # coordinates beyond which no other masses are looked for: the equations grow with the fourth power

Array = NDArray[np.float64]


def gyroscopic_part(system: System, stiffness: Array, damping: Array) -> Array | None:
    """Return the part of a damping matrix that loses no energy; None if there is none.

    In the modes of ``M^-1 K`` it lets two modes act on each other with opposite signs. Whether it does is seen in any
    form of the equations; how large it is needs their energy.
    """
    if is_symmetric(damping) or isinstance(system.structure.assembly, TrainAssembly):
        return None
    mass = system.matrix("mass")
    if is_symmetric(mass) and is_symmetric(stiffness) and _are_reciprocal(system):
        return 0.5 * (damping - damping.T)
    shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))[1]
    acting = np.linalg.lstsq(shapes, np.linalg.solve(mass, damping) @ shapes, rcond=None)[0]
    both = np.real(acting * acting.T)
    if both.min() >= -SYMMETRIC * np.abs(both).max():
        return None
    energy = mass_of_energy(system, strict=True)
    moved = energy @ np.linalg.solve(mass, damping)
    return 0.5 * mass @ np.linalg.solve(energy, moved - moved.T)


def whirls(
    mass: Array, gyroscopic: Array, stiffness: Array, losses: Array
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], Array]:
    """Compute the modes of ``M q'' + G q' + K q = 0``."""
    n = len(mass)
    rows = np.linalg.solve(mass, np.hstack((stiffness, gyroscopic, losses)))
    unit = max(np.sqrt(np.abs(rows[:, :n]).max()), np.abs(rows[:, n : 2 * n]).max())  # a frequency
    still = np.zeros((n, n))
    matrix = np.block([[still, np.eye(n)], [-rows[:, :n] / unit**2, -rows[:, n : 2 * n] / unit]])
    values, left, right = _eigen(matrix)
    at_rest = np.abs(values) ** 2 <= 1e-12 * n * np.abs(values).max() ** 2
    # vectors of equal values need not be dual to each other; of those that rest there may be too few
    pairs = left.conj().T @ right
    pairs[at_rest], pairs[:, at_rest] = 0.0, 0.0
    pairs[np.ix_(at_rest, at_rest)] = np.eye(int(at_rest.sum()))
    lost = np.block([[still, still], [still, rows[:, 2 * n :] / unit]])
    decay = np.real(np.diag(np.linalg.solve(pairs, left.conj().T @ lost @ right)))
    ahead = np.flatnonzero((values.imag > 0.0) & ~at_rest)
    rest = np.flatnonzero((values.imag == 0.0) | at_rest)  # in pairs, of which one grows
    rest = rest[np.argsort(-values[rest].real, kind="stable")][: n - len(ahead)]
    chosen = np.concatenate((rest, ahead))
    squares = -(values[chosen] ** 2)
    order = np.argsort(squares.real, kind="stable")
    chosen = chosen[order]
    return squares[order] * unit**2, right[:n, chosen], decay[chosen] * unit


def _eigen(matrix: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    from scipy.linalg import eig  # slow to import

    values, left, right = eig(matrix, left=True, right=True)
    return values, left.astype(complex), right.astype(complex)


def mass_of_energy(system: System, *, strict: bool = False) -> Array:
    """Return the masses of the kinetic energy: the mass matrix, or that for which the contacts act on themselves.

    Equations that were divided by masses, or combined, have matrices that are not symmetric. Their energy has the
    symmetric mass matrix A with ``A M^-1 d = e`` for each contact, and a symmetric ``A M^-1 K``. If `strict`, a
    symmetric mass matrix alone is not taken for it.
    """
    n, mass, stiffness = system.size, system.matrix("mass"), system.matrix("stiffness")
    forms = _single(system)
    known = is_symmetric(mass)
    reciprocal = _are_reciprocal(system) and bool(forms or not strict)
    if known and (reciprocal or is_symmetric(_potential(system, stiffness, mass))):
        return mass
    if strict and n > _LARGE:
        raise ModelError(_NO_GYROSCOPE)
    table = layout_of(system.structure).table(system.values)
    basis = [(i, j) for i in range(n) for j in range(i, n)]
    shapes = np.zeros((len(basis), n, n))
    for shape, (i, j) in zip(shapes, basis, strict=True):
        shape[i, j] = shape[j, i] = 1.0
    rows, wanted = [], []
    for place, form in forms:
        vector = system.vector(form.vectors[0])
        scale = np.abs(vector).max()
        rows.append((shapes @ table[:, 2 * n + place]).T / scale)
        wanted.append(vector / scale)
    moved = shapes @ table[:, :n]
    upper = np.triu_indices(n, 1)
    size = np.abs(table[:, :n]).max() or 1.0
    rows.append((moved - moved.transpose(0, 2, 1))[:, upper[0], upper[1]].T / size)
    wanted.append(np.zeros(len(upper[0])))
    equations, right = np.vstack(rows), np.concatenate(wanted)
    found, _, rank, _ = np.linalg.lstsq(equations, right, rcond=1e-12)
    candidate = np.tensordot(found, shapes, axes=1)
    exact = rank == len(basis) and np.abs(equations @ found - right).max() <= SYMMETRIC
    if exact and np.linalg.eigvalsh(candidate).min() > 0.0:
        return candidate
    if known and not strict:
        return mass
    raise ModelError(_NO_GYROSCOPE if strict else _NO_ENERGY)


_NO_ENERGY = (
    "the mass matrix is not symmetric, and there is no symmetric one for which each contact acts along its own "
    "deflection, so that no energy is known; write the equations of motion as forces on the coordinates"
)
_NO_GYROSCOPE = (
    "the damping matrix has gyroscopic terms, but mass and stiffness matrix are not both symmetric, so that no energy "
    "is known that tells them from losses; write the equations of motion as forces on the coordinates, with "
    "symmetric matrices mass and stiffness"
)


def _single(system: System) -> list[tuple[int, ContactForm]]:
    """Return number and form of each contact with one deflection."""
    return [(place, form) for place, form in enumerate(system.structure.contacts) if not form.vectors[1:]]


def _are_reciprocal(system: System) -> bool:
    """Return True if each contact acts along its own deflection."""
    pairs = ((system.vector(form.push), system.vector(form.vectors[0])) for _, form in _single(system))
    return all(np.allclose(push, vector) for push, vector in pairs)


def _potential(system: System, stiffness: Array, mass: Array) -> Array:
    """Return the stiffness matrix without what leaky coordinates of a train add to it."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return stiffness
    leaks = assembly.numbers(system.values).leaks
    return stiffness - (system.matrix("damping") - mass * leaks) * leaks


def is_symmetric(matrix: Array) -> bool:
    """Return True if a matrix is symmetric but for rounding."""
    return bool(np.abs(matrix - matrix.T).max() <= SYMMETRIC * np.abs(matrix).max())
