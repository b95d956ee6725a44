"""Changes of a motion with Jenkins elements: places of sliders among the unknowns of the variational equations.

While an element sticks, its slider keeps its place, and a change of that place pushes the momenta by the stiffness. In
slip it follows a bound, and what it was before is forgotten. So it suffices to set its change where it comes to rest,
at its pins: to that of the bound, a function of the changes of positions and momenta. Where the limit falls below the
force, the force jumps; the angle of that event moves with the host, and so the momenta jump with the positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.contact_forces import Laws
from gapwalk.orbit.harmonic_balance.dry_forces import TURN, Change, DryForce, Memory
from gapwalk.orbit.harmonic_balance.linear_part import Linear, waves

Array = NDArray[np.float64]

_ASIDE = 1e-9  # radians from a break, at which dampers beside it are read


@dataclass(frozen=True, eq=False)
class SliderChanges:
    """The changes of the sliders of all elements along a motion."""

    #: memory, linear, laws: The elements, the linear part, and the contacts.
    memory: Memory
    linear: Linear
    laws: Laws
    lines: NDArray[np.complex128]  #: shape (deflections, K + 1): The motion.
    period: int  #: m.

    def wider(self, matrices: Array) -> Array:
        """Add the places of the sliders to matrices of shape (..., 2n, 2n), as rows and columns of zeros."""
        more = len(self.memory)
        return np.pad(matrices, [(0, 0)] * (matrices.ndim - 2) + [(0, more), (0, more)])

    def pushes(self) -> Array:
        """Return the matrix of what the place of each slider adds to the momenta in stick, shape (elements, ...)."""
        n, found = len(self.linear.stiffness), []
        for number, force in enumerate(self.memory.forces):
            matrix = np.zeros((2 * n + len(self.memory),) * 2)
            matrix[n : 2 * n, 2 * n + number] = force.stiffness[0] * self.linear.contacts[:, force.slider.element.place]
            found.append(matrix)
        return np.array(found)

    def resets(self) -> tuple[Array, Array]:
        """Return angles at which changes of the motion change at once, and the differences of the matrices from 1."""
        n, found = len(self.linear.stiffness), []
        size = 2 * n + len(self.memory)
        for number, force in enumerate(self.memory.forces):
            if force.never_slips:  # its place is kept: that is no change of the motion
                matrix = np.zeros((size, size))
                matrix[2 * n + number, 2 * n + number] = -1.0
                found.append((TURN, 2, matrix))
                continue
            for pin in (force.pins[each] for each in {stick.pin for stick in force.sticks}):
                change, matrix = force.change_of(pin), np.zeros((size, size))
                aside = 0.0 if pin.place < 0 else -_ASIDE if pin.is_before else _ASIDE
                matrix[2 * n + number, : 2 * n] = self._row(force, change, aside)
                matrix[2 * n + number, 2 * n + number] = -1.0
                found.append((pin.phi % TURN or TURN, 0 if pin.is_before else 2, matrix))
            for leap in force.leaps:
                change, matrix = force.shift_of(leap.place), np.zeros((size, size))
                late = self._row(force, change, -_ASIDE) / force.slider.motion.frequency  # over time
                pushed = self.linear.contacts[:, force.slider.element.place] * (-force.stiffness[0] * leap.change)
                matrix[n : 2 * n, : 2 * n] = np.outer(pushed, late)
                found.append((change.phi % TURN or TURN, 1, matrix))
        found.sort(key=lambda each: each[:2])
        return np.array([each[0] for each in found]), np.array([each[2] for each in found]).reshape(
            len(found), size, size
        )

    def _row(self, force: DryForce, change: Change, aside: float) -> Array:
        """Return a change as a function of the changes of positions and momenta, shape (2n,)."""
        n, element, linear = len(self.linear.stiffness), force.slider.element, self.linear
        row = np.zeros(2 * n)
        row[:n] = change.own * linear.deflections[element.place]
        if element.host >= 0:
            other = linear.deflections[element.host_place]
            row[:n] += change.host * other
            if change.host_rate:
                row[n:] += change.host_rate * other
                row[:n] -= change.host_rate * (other @ self._dampers(change.phi + aside))
        return row

    def _dampers(self, phi: float) -> Array:
        """Return the sum of ``D_k P_k' e_k`` at an angle, with which velocities follow from momenta; shape (n, n)."""
        x = (waves(np.array([phi]), self.lines.shape[1] - 1) @ self.lines.T).real
        dampers = self.laws.tangents(x, np.array([phi % TURN]), self.period)[1][0]
        return (self.linear.contacts * dampers) @ self.linear.deflections
