"""The linear part of a system, solved exactly in each harmonic: only contact deflections are left as unknowns.

With the forces of the contacts on the right-hand side, the lines of the motion obey, for each frequency ``w = k W/m``,

    (A + sum_k D_k s_k e_k - w^2 + i w B) q = loads - sum_k D_k (f_k - s_k x_k)

where a share s_k of each contact's stiffness is moved to the left, so that a system that only its contacts hold in
place can be solved too.

There are two ways to solve it, with the same members. `DirectCompliance` factors the matrix of each line. Where the
matrices stay the same along the branch, `PoleCompliance` sums over the eigenvalues of the linear system, found once:
after that a line costs as many operations as there are eigenvalues.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.orbit.harmonic_balance.kernels import real_form
from gapwalk.orbit.harmonic_balance.linear_part import Linear
from gapwalk.orbit.harmonic_balance.poles import Poles, amplitudes_of, answers_of, gains_of, slopes_of


class Lines(NamedTuple):
    """The lines of a motion.

    Attributes
    ----------
    frequencies, slopes : shape (lines,)
        Frequencies, and their derivatives by the parameter.
    loads : shape (orders + 1,)
        Which line each load acts on, one each.
    """

    frequencies: NDArray[np.float64]
    slopes: NDArray[np.float64]
    loads: NDArray[np.intp]


class Compliance(Protocol):
    """The linear part on some lines."""

    @property
    def flexibility(self) -> NDArray[np.complex128]:
        """Deflections under a unit force of each contact (against it), shape (lines, contacts, contacts)."""
        ...

    @property
    def free(self) -> NDArray[np.complex128]:
        """Deflections under the loads alone, shape (lines, contacts)."""
        ...

    def motion(self, forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Lines of all coordinates, shape (lines, n), under the loads and contact forces of shape (lines, contacts)."""
        ...

    def answer(self, frequencies: NDArray[np.float64], forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Deflections on other lines under contact forces alone (against them), both of shape (lines, contacts)."""
        ...

    def slope(self, forces: NDArray[np.complex128], force_slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Derivatives of the deflections by the parameter, in real forms, from the forces and theirs."""
        ...


@dataclass(frozen=True, eq=False)
class DirectCompliance:
    """The linear part solved line by line.

    Parameters
    ----------
    linear, change
        The matrices, and their derivatives by the parameter (None for none).
    lines
        The lines.
    shift : shape (contacts,)
        Stiffness of each contact that is counted as part of the linear system.
    """

    linear: Linear
    change: Linear | None
    lines: Lines
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
        return self._solve(np.concatenate((forces.astype(complex), self._loads(self.linear)[:, :, None]), axis=2))

    @cached_property
    def flexibility(self) -> NDArray[np.complex128]:
        """See `Compliance.flexibility`."""
        return self.linear.deflections @ self._solved[:, :, :-1]

    @cached_property
    def free(self) -> NDArray[np.complex128]:
        """See `Compliance.free`."""
        return self._solved[:, :, -1] @ self.linear.deflections.T

    def motion(self, forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `Compliance.motion`."""
        return self._solved[:, :, -1] - (self._solved[:, :, :-1] @ forces[:, :, None])[:, :, 0]

    def answer(self, frequencies: NDArray[np.float64], forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `Compliance.answer`."""
        others = replace(self, lines=Lines(frequencies, np.zeros_like(frequencies), self.lines.loads[:0]))
        return others._solve((forces @ self.linear.contacts.T)[:, :, None])[:, :, 0] @ self.linear.deflections.T

    def slope(self, forces: NDArray[np.complex128], force_slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """See `Compliance.slope`."""
        linear, change = self.linear, self.change
        motion = self.motion(forces)
        w, rate = self.lines.frequencies[:, None], self.lines.slopes[:, None]
        right = (2.0 * w * rate) * motion - 1j * rate * (motion @ linear.damping.T)
        right -= force_slopes @ linear.contacts.T
        if change is None:
            return real_form((self._solve(right[:, :, None])[:, :, 0] @ linear.deflections.T).T).ravel()
        shifted = change.stiffness + (change.contacts * self.shift) @ linear.deflections
        shifted += (linear.contacts * self.shift) @ change.deflections
        right += self._loads(change) - forces @ change.contacts.T
        right -= motion @ shifted.T + 1j * w * (motion @ change.damping.T)
        moved = self._solve(right[:, :, None])[:, :, 0]
        return real_form((moved @ linear.deflections.T + motion @ change.deflections.T).T).ravel()

    def _loads(self, linear: Linear) -> NDArray[np.complex128]:
        loads = np.zeros((len(self.lines.frequencies), len(linear.loads)), dtype=complex)
        loads[self.lines.loads] = linear.loads.T
        return loads

    def _solve(self, right: NDArray[np.complex128]) -> NDArray[np.complex128]:
        try:
            return np.asarray(np.linalg.solve(self._dynamic, right), dtype=np.complex128)
        except np.linalg.LinAlgError:
            raise NumericalError(
                "the linear part of the system has an undamped resonance, or can move as a whole, at a harmonic of "
                "the excitation; give it damping, or a spring that holds it"
            ) from None


class PoleCompliance(NamedTuple):
    """The linear part as a sum over its eigenvalues, on some lines.

    Attributes
    ----------
    poles
        The eigenvalues.
    lines
        The lines; the poles do not change with the parameter.
    gains : shape (lines, poles)
        Amplitude of each eigenvector under a unit load.
    free, flexibility
        See `Compliance`.
    """

    poles: Poles
    lines: Lines
    gains: NDArray[np.complex128]
    free: NDArray[np.complex128]
    flexibility: NDArray[np.complex128]

    def motion(self, forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `Compliance.motion`."""
        poles = self.poles
        amplitudes = amplitudes_of(self.gains, poles.loads, self.lines.loads, poles.inputs, forces)
        return amplitudes @ poles.outputs.T

    def slope(self, forces: NDArray[np.complex128], force_slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """See `Compliance.slope`."""
        poles, lines = self.poles, self.lines
        applied = poles.loads, lines.loads, poles.inputs, forces
        return slopes_of(self.gains, *applied, lines.slopes, poles.deflections, force_slopes)

    def answer(self, frequencies: NDArray[np.float64], forces: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `Compliance.answer`."""
        return answers_of(frequencies, self.poles.values, self.poles.inputs, self.poles.deflections, forces)


def pole_compliance(poles: Poles, lines: Lines) -> PoleCompliance:
    """The linear part on some lines, from its eigenvalues."""
    applied = poles.loads, lines.loads, poles.deflections, poles.residues
    return PoleCompliance(poles, lines, *gains_of(lines.frequencies, poles.values, *applied))
