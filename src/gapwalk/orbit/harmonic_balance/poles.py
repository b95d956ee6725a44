"""The linear part of a system as a sum over its eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.compiled import kernel, part
from gapwalk.orbit.harmonic_balance.linear_part import Linear

_DEFECTIVE = 1e7  # condition of the eigenvectors beyond which the sum over eigenvalues loses digits
_PROPORTIONAL = 1e-10  # relative size of the couplings below which the damping leaves the modes apart
_DOUBLE = 1e-6  # relative distance of a mode's two eigenvalues below which they count as one


@dataclass(frozen=True, eq=False)
class Poles:
    """The linear part as a sum over its 2n eigenvalues, or over some of them and what the others give at rest.

    Attributes
    ----------
    values : shape (poles,)
        Eigenvalues.
    inputs, loads : shapes (poles, contacts), (poles, orders + 1)
        How the contacts and the loads act on each eigenvector.
    outputs : shape (n, poles)
        Positions of each eigenvector.
    deflections : shape (contacts, poles)
        Deflections of each eigenvector.
    residual : shape (contacts, contacts)
        Flexibility at rest of the eigenvectors that were left out.
    """

    values: NDArray[np.complex128]
    inputs: NDArray[np.complex128]
    loads: NDArray[np.complex128]
    outputs: NDArray[np.complex128]
    deflections: NDArray[np.complex128]
    residual: NDArray[np.float64]

    @cached_property
    def residues(self) -> NDArray[np.complex128]:
        """What each eigenvalue adds to the flexibility, shape (poles, contacts, contacts)."""
        return np.ascontiguousarray(self.deflections.T[:, :, None] * self.inputs[:, None, :])

    def below(self, rate: float) -> Poles:
        """The eigenvalues up to a size; the others answer at once, as if they were at rest."""
        kept = np.abs(self.values) <= rate
        flexibility = -(self.residues[~kept] / self.values[~kept, None, None]).sum(axis=0).real
        return Poles(
            self.values[kept],
            self.inputs[kept],
            self.loads[kept],
            self.outputs[:, kept],
            self.deflections[:, kept],
            self.residual + flexibility,
        )


def poles_of(linear: Linear, shift: NDArray[np.float64]) -> Poles | None:
    """The eigenvalues of the linear part; None if it has too few eigenvectors to be told by them."""
    stiffness = linear.shifted(shift)
    found = _of_modes(stiffness, linear.damping) or _of_state(stiffness, linear.damping)
    if found is None:
        return None
    values, left, outputs = found
    inputs: NDArray[np.complex128] = np.asarray(left @ linear.contacts, dtype=np.complex128)
    deflections: NDArray[np.complex128] = np.asarray(linear.deflections @ outputs, dtype=np.complex128)
    contacts = len(deflections)
    return Poles(values, inputs, left @ linear.loads, outputs, deflections, np.zeros((contacts, contacts)))


Eigen = tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]
"""Eigenvalues, how forces act on the eigenvectors, and the positions of these."""


def _of_modes(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> Eigen | None:
    """By the undamped modes, where the damping leaves these apart; None where it does not."""
    if np.array_equal(stiffness, stiffness.T):
        squares, vectors = np.linalg.eigh(stiffness)
        left = vectors.T
    else:
        squares, vectors = np.linalg.eig(stiffness)
        if not np.linalg.cond(vectors, 1) < _DEFECTIVE:
            return None
        left = np.linalg.inv(vectors)
    modal = left @ damping @ vectors
    rates = np.diagonal(modal)
    if np.abs(modal - np.diag(rates)).max() > _PROPORTIONAL * (np.abs(rates).max() + 1e-300):
        return None
    root = np.sqrt((0.25 * rates**2 - squares).astype(complex))
    if (np.abs(root) <= _DOUBLE * np.sqrt(np.abs(squares) + rates.real**2)).any():
        return None
    values = np.concatenate((-0.5 * rates + root, -0.5 * rates - root))
    half = vectors / (2.0 * root)
    left = np.concatenate((left, left)).astype(np.complex128)
    return values.astype(np.complex128), left, np.asarray(np.concatenate((half, -half), axis=1), dtype=np.complex128)


def _of_state(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> Eigen | None:
    """By the matrix of the state, whatever the damping; None if it has too few eigenvectors."""
    n = len(stiffness)
    generator = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    values, vectors = np.linalg.eig(generator)
    if not np.linalg.cond(vectors, 1) < _DEFECTIVE:
        return None
    vectors = vectors.astype(np.complex128)
    left = np.asarray(np.linalg.inv(vectors)[:, n:], dtype=np.complex128)
    return values.astype(np.complex128), left, vectors[:n]


@kernel(
    "Tuple((c16[:, ::1], c16[:, ::1], c16[:, :, ::1]))"
    "(f8[::1], c16[::1], c16[:, ::1], i8[::1], c16[:, ::1], c16[:, :, ::1])"
)
def gains_of(frequencies, values, loads, load_lines, deflections, residues):
    """Amplitude of each eigenvector under a unit load, shape (lines, poles); deflections under the loads alone.

    And the flexibility, shape (lines, contacts, contacts).
    """
    contacts = len(deflections)
    gains = np.empty((len(frequencies), len(values)), np.complex128)
    free = np.zeros((len(frequencies), contacts), np.complex128)
    flexibility = np.zeros((len(frequencies), contacts, contacts), np.complex128)
    for line in range(len(frequencies)):
        for p in range(len(values)):
            gains[line, p] = 1.0 / (complex(0.0, frequencies[line]) - values[p])
            for c in range(contacts):
                for d in range(contacts):
                    flexibility[line, c, d] += gains[line, p] * residues[p, c, d]
    for order in range(len(load_lines)):
        line = load_lines[order]
        for c in range(len(deflections)):
            for p in range(len(values)):
                free[line, c] += deflections[c, p] * gains[line, p] * loads[p, order]
    return gains, free, flexibility


@part
def _amplitudes(gains, loads, load_lines, inputs, forces, result):
    """See `amplitudes_of`."""
    for line in range(len(gains)):
        for p in range(gains.shape[1]):
            push = 0.0j
            for c in range(inputs.shape[1]):
                push += inputs[p, c] * forces[line, c]
            result[line, p] = -gains[line, p] * push
    for order in range(len(load_lines)):
        line = load_lines[order]
        for p in range(gains.shape[1]):
            result[line, p] += gains[line, p] * loads[p, order]


@kernel("c16[:, ::1](c16[:, ::1], c16[:, ::1], i8[::1], c16[:, ::1], c16[:, ::1])")
def amplitudes_of(gains, loads, load_lines, inputs, forces):
    """Amplitude of each eigenvector under the loads and contact forces (against them), shape (lines, poles)."""
    result = np.empty(gains.shape, np.complex128)
    _amplitudes(gains, loads, load_lines, inputs, forces, result)
    return result


@kernel("f8[::1](c16[:, ::1], c16[:, ::1], i8[::1], c16[:, ::1], c16[:, ::1], f8[::1], c16[:, ::1], c16[:, ::1])")
def slopes_of(gains, loads, load_lines, inputs, forces, slopes, deflections, force_slopes):
    """Derivatives of the deflections by the parameter, in real forms one after the other."""
    amplitudes, count = np.empty(gains.shape, np.complex128), len(gains) - 1
    result = np.zeros(len(deflections) * (2 * count + 1))
    _amplitudes(gains, loads, load_lines, inputs, forces, amplitudes)
    for line in range(len(gains)):
        for p in range(gains.shape[1]):
            push = complex(0.0, slopes[line]) * amplitudes[line, p]
            for c in range(inputs.shape[1]):
                push += inputs[p, c] * force_slopes[line, c]
            push *= gains[line, p]
            for c in range(len(deflections)):
                place, change = c * (2 * count + 1) + line, deflections[c, p] * push
                result[place] -= change.real
                if line:
                    result[place + count] += change.imag
    return result


@kernel("c16[:, ::1](f8[::1], c16[::1], c16[:, ::1], c16[:, ::1], c16[:, ::1])")
def answers_of(frequencies, values, inputs, deflections, forces):
    """Deflections under contact forces alone (against them), both of shape (lines, contacts)."""
    result = np.zeros(forces.shape, np.complex128)
    for line in range(len(forces)):
        for p in range(len(values)):
            push = 0.0j
            for c in range(inputs.shape[1]):
                push += inputs[p, c] * forces[line, c]
            push /= complex(0.0, frequencies[line]) - values[p]
            for c in range(len(deflections)):
                result[line, c] += deflections[c, p] * push
    return result
