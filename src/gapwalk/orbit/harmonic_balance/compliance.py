"""The linear part of a system, solved exactly in each harmonic: only contact deflections are left as unknowns.

With the forces of the contacts on the right-hand side, the lines of the motion obey, for each frequency ``w = k W/m``,

    (A + sum_k D_k s_k e_k - w^2 + i w B) q = loads - sum_k D_k s_k u_k - sum_k D_k (f_k - s_k x_k)

where a share s_k of each contact's stiffness is moved to the left, so that a system that only its contacts
restrain can be solved too, and ``x_k = e_k q + u_k`` with the prescribed displacement u_k. The matrices are read from
the coefficients of the flow (`Linear`).

There are two ways to solve it, with the same members. `DirectCompliance` factors the matrix of each line. Where the
matrices stay the same along the branch, `PoleCompliance` sums over the eigenvalues of the linear system (`Poles`),
found once: after that a line costs as many operations as there are eigenvalues.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.orbit.harmonic_balance.kernels import kernel, part, real_form
from gapwalk.orbit.harmonic_balance.linear_part import Linear

_DEFECTIVE = 1e7  # condition of the eigenvectors beyond which the sum over eigenvalues loses digits
_PROPORTIONAL = 1e-10  # relative size of the couplings below which the damping does not couple the modes
_DOUBLE = 1e-6  # relative distance of a mode's two eigenvalues below which they count as one
Eigen = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]
"""Eigenvalues, how forces act on the eigenvectors, and the positions of these."""


@dataclass(frozen=True, eq=False)
class Poles:
    """The linear part as a sum over its 2n eigenvalues, or over some of them and the static response of the others."""

    values: NDArray[np.complex128]  #: shape (poles,): Eigenvalues.
    #: inputs, loads: shapes (poles, contacts), (poles, orders + 1): Force of the contacts and of the loads on each
    #: eigenvector.
    inputs: NDArray[np.complex128]
    loads: NDArray[np.complex128]
    outputs: NDArray[np.complex128]  #: shape (n, poles): Positions of each eigenvector.
    deflections: NDArray[np.complex128]  #: shape (contacts, poles): Deflections of each eigenvector.
    residual: NDArray[np.float64]  #: shape (contacts, contacts): Static flexibility of the omitted eigenvectors.
    sways: NDArray[np.complex128]  #: shape (contacts, orders + 1): Prescribed displacements of the deflections.

    @cached_property
    def residues(self) -> NDArray[np.complex128]:
        """Contribution of each eigenvalue to the flexibility, shape (poles, contacts, contacts)."""
        return np.ascontiguousarray(self.deflections.T[:, :, None] * self.inputs[:, None, :])

    @cached_property
    def are_displaced(self) -> bool:
        """True if there are prescribed displacements."""
        return bool(self.sways.any())

    def below(self, rate: float) -> Poles:
        """Return the eigenvalues up to a size; the others respond statically."""
        kept = np.abs(self.values) <= rate
        flexibility = -(self.residues[~kept] / self.values[~kept, None, None]).sum(axis=0).real
        return Poles(
            self.values[kept],
            self.inputs[kept],
            self.loads[kept],
            self.outputs[:, kept],
            self.deflections[:, kept],
            self.residual + flexibility,
            self.sways,
        )


class Lines(NamedTuple):
    """The lines of a motion."""

    #: frequencies, slopes: shape (lines,): Frequencies, and their derivatives by the parameter.
    frequencies: NDArray[np.float64]
    slopes: NDArray[np.float64]
    loads: NDArray[np.intp]  #: shape (orders + 1,): Line on which each load acts, and each displacement.


@dataclass(frozen=True, eq=False)
class DirectCompliance:
    """The linear part solved line by line."""

    #: linear, change: The matrices, and their derivatives by the parameter (None for none).
    linear: Linear
    change: Linear | None
    lines: Lines  #: The lines.
    #: shape (contacts,): Stiffness of each contact that is counted as part of the linear system.
    shift: NDArray[np.float64]

    @cached_property
    def _dynamic(self) -> NDArray[np.complex128]:
        """Dynamic stiffness of each line, shape (lines, n, n)."""
        w, linear = self.lines.frequencies, self.linear
        matrix = np.array(1j * w[:, None, None] * linear.damping + linear.shifted(self.shift), dtype=np.complex128)
        n = matrix.shape[-1]
        matrix[:, np.arange(n), np.arange(n)] -= w[:, None] ** 2
        return matrix

    @cached_property
    def _solved(self) -> NDArray[np.complex128]:
        """Motions under a unit force of each contact and under the loads, shape (lines, n, contacts + 1)."""
        forces = np.broadcast_to(self.linear.contacts, (len(self._dynamic), *self.linear.contacts.shape))
        return self._solve(np.concatenate((forces.astype(complex), self._loads()[:, :, None]), axis=2))

    @cached_property
    def flexibility(self) -> NDArray[np.complex128]:
        """Deflections under a unit force of each contact (opposing it), shape (lines, contacts, contacts)."""
        return self.linear.deflections @ self._solved[:, :, :-1]

    @cached_property
    def free(self) -> NDArray[np.complex128]:
        """Deflections under the loads only, shape (lines, contacts)."""
        return self._solved[:, :, -1] @ self.linear.deflections.T + self._on_lines(self.linear.sways)

    def motion(self, forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the lines of all coordinates, shape (lines, n), under loads and contact forces (lines, contacts)."""
        return self._solved[:, :, -1] - (self._solved[:, :, :-1] @ forces[:, :, None])[:, :, 0]

    def answer(self, frequencies: NDArray[np.float64], forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return deflections on other lines under contact forces alone (opposing them), shapes (lines, contacts)."""
        others = replace(self, lines=Lines(frequencies, np.zeros_like(frequencies), self.lines.loads[:0]))
        return others._solve((forces @ self.linear.contacts.T)[:, :, None])[:, :, 0] @ self.linear.deflections.T

    def slope(self, forces: NDArray[np.complex128], force_slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the derivatives of the deflections by the parameter, in real forms, from the forces and their own."""
        linear, change = self.linear, self.change
        motion = self.motion(forces)
        w, rate = self.lines.frequencies[:, None], self.lines.slopes[:, None]
        right = (2.0 * w * rate) * motion - 1j * rate * (motion @ linear.damping.T)
        right -= force_slopes @ linear.contacts.T
        if change is None:
            return real_form((self._solve(right[:, :, None])[:, :, 0] @ linear.deflections.T).T).ravel()
        shifted = change.stiffness + (change.contacts * self.shift) @ linear.deflections
        shifted += (linear.contacts * self.shift) @ change.deflections
        right += self._load_slopes(change) - forces @ change.contacts.T
        right -= motion @ shifted.T + 1j * w * (motion @ change.damping.T)
        moved = self._solve(right[:, :, None])[:, :, 0]
        found = moved @ linear.deflections.T + motion @ change.deflections.T + self._on_lines(change.sways)
        return real_form(found.T).ravel()

    def _loads(self) -> NDArray[np.complex128]:
        return self._on_lines(self.linear.pushed(self.shift))

    def _load_slopes(self, change: Linear) -> NDArray[np.complex128]:
        linear, shift = self.linear, self.shift
        shares = (change.contacts * shift) @ linear.sways + (linear.contacts * shift) @ change.sways
        return self._on_lines(change.loads - shares)

    def _on_lines(self, loads: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return amplitudes of shape (rows, orders + 1) on all lines, shape (lines, rows)."""
        found = np.zeros((len(self.lines.frequencies), len(loads)), dtype=complex)
        found[self.lines.loads] = loads.T
        return found

    def _solve(self, right: NDArray[np.complex128]) -> NDArray[np.complex128]:
        try:
            return np.asarray(np.linalg.solve(self._dynamic, right), dtype=np.complex128)
        except np.linalg.LinAlgError:
            raise _singular() from None


def _singular() -> NumericalError:
    return NumericalError(
        "the linear part of the system has an undamped resonance, or can move as a whole, at a harmonic of the "
        "excitation; give it damping, or a spring that holds it"
    )


class PoleCompliance(NamedTuple):
    """The linear part as a sum over its eigenvalues, on some lines."""

    poles: Poles  #: The eigenvalues.
    lines: Lines  #: The lines; the poles do not change with the parameter.
    gains: NDArray[np.complex128]  #: shape (lines, poles): Amplitude of each eigenvector under a unit load.
    #: free, flexibility: See `DirectCompliance`.
    free: NDArray[np.complex128]
    flexibility: NDArray[np.complex128]

    @classmethod
    def on(cls, lines: Lines, poles: Poles) -> PoleCompliance:
        """Return the linear part on some lines."""
        applied = poles.loads, lines.loads, poles.deflections, poles.residues
        try:
            gains, free, flexibility = gains_of(lines.frequencies, poles.values, *applied)
        except ZeroDivisionError:
            raise _singular() from None
        if poles.are_displaced:
            free[lines.loads] += poles.sways.T
        return cls(poles, lines, gains, free, flexibility)

    def motion(self, forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `DirectCompliance.motion`."""
        poles = self.poles
        amplitudes = amplitudes_of(self.gains, poles.loads, self.lines.loads, poles.inputs, forces)
        return amplitudes @ poles.outputs.T

    def slope(self, forces: NDArray[np.complex128], force_slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """See `DirectCompliance.slope`."""
        poles, lines = self.poles, self.lines
        applied = poles.loads, lines.loads, poles.inputs, forces
        return slopes_of(self.gains, *applied, lines.slopes, poles.deflections, force_slopes)

    def answer(self, frequencies: NDArray[np.float64], forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `DirectCompliance.answer`."""
        return answers_of(frequencies, self.poles.values, self.poles.inputs, self.poles.deflections, forces)


def poles_of(linear: Linear, shift: NDArray[np.float64]) -> Poles | None:
    """Compute the eigenvalues of the linear part; None if its eigenvectors do not span the space."""
    stiffness = linear.shifted(shift)
    found = _of_modes(stiffness, linear.damping) or _of_state(stiffness, linear.damping)
    if found is None:
        return None
    values, left, outputs = (np.asarray(each, dtype=np.complex128) for each in found)
    inputs, deflections = left @ linear.contacts, linear.deflections @ outputs
    contacts = len(deflections)
    residual = np.zeros((contacts, contacts))
    return Poles(values, inputs, left @ linear.pushed(shift), outputs, deflections, residual, linear.sways)


def _of_modes(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> Eigen | None:
    """Compute them from the undamped modes; None if the damping couples these."""
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
    return values, np.concatenate((left, left)), np.concatenate((half, -half), axis=1)


def _of_state(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> Eigen | None:
    """Compute the eigenvalues from the state matrix, for any damping; None if it has too few eigenvectors."""
    n = len(stiffness)
    generator = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    values, vectors = np.linalg.eig(generator)
    if not np.linalg.cond(vectors, 1) < _DEFECTIVE:
        return None
    return values, np.linalg.inv(vectors.astype(np.complex128))[:, n:], vectors[:n]


@kernel(
    "Tuple((c16[:, ::1], c16[:, ::1], c16[:, :, ::1]))"
    "(f8[::1], c16[::1], c16[:, ::1], i8[::1], c16[:, ::1], c16[:, :, ::1])"
)
def gains_of(frequencies, values, loads, load_lines, deflections, residues):
    """Return three arrays on the given lines: amplitudes of eigenvectors, deflections by loads, and flexibility."""
    # Amplitudes are under a unit load, shape (lines, poles); the flexibility has the shape (lines, contacts, contacts).
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
    """Return the amplitude of each eigenvector under loads and contact forces (opposing them), shape (lines, poles)."""
    result = np.empty(gains.shape, np.complex128)
    _amplitudes(gains, loads, load_lines, inputs, forces, result)
    return result


@kernel("f8[::1](c16[:, ::1], c16[:, ::1], i8[::1], c16[:, ::1], c16[:, ::1], f8[::1], c16[:, ::1], c16[:, ::1])")
def slopes_of(gains, loads, load_lines, inputs, forces, slopes, deflections, force_slopes):
    """Return the derivatives of the deflections by the parameter, in real forms one after the other."""
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
    """Return the deflections under contact forces alone (opposing them), both of shape (lines, contacts)."""
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
