"""The equations linearised about a balanced motion, as a matrix that varies with the angle and jumps at breakpoints.

The unknowns are the changes of the positions and of the momenta ``p = v + sum_k D_k P_k(x)`` (over mass), where
``g + dP/dt`` is the force of a contact (see `laws`). Unlike velocities, momenta do not jump where a viscous contact
closes, and their equations

    q' = p - sum_k D_k P_k'(x) e_k q,    p' = -(A + sum_k D_k g_k'(x) e_k) q - B q'

need no velocity of the motion. At any one time the two kinds of unknowns differ by a fixed matrix, so the multipliers
are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.laws import Laws
from gapwalk.orbit.harmonic_balance.linear_part import Linear


@dataclass(frozen=True)
class Linearised:
    """The generator of the linearised equations over time, ``steady + sum_k g_k' springs_k + P_k' dampers_k``.

    Parameters
    ----------
    linear, laws
        The system.
    """

    linear: Linear
    laws: Laws

    @cached_property
    def steady(self) -> NDArray[np.float64]:
        """What does not vary, shape (2n, 2n)."""
        n = len(self.linear.stiffness)
        return np.block([[np.zeros((n, n)), np.eye(n)], [-self.linear.stiffness, -self.linear.damping]])

    @cached_property
    def parts(self) -> NDArray[np.float64]:
        """The matrices of the springs, then of the dampers, shape (2 contacts, 2n, 2n)."""
        linear, n = self.linear, len(self.linear.stiffness)
        contacts = linear.contacts.shape[1]
        parts = np.zeros((2 * contacts, 2 * n, 2 * n))
        for k in range(contacts):
            along = np.outer(linear.contacts[:, k], linear.deflections[k])
            parts[k, n:, :n] = -along
            parts[contacts + k, :n, :n] = -along
            parts[contacts + k, n:, :n] = linear.damping @ along
        return parts

    @cached_property
    def rate(self) -> float:
        """Roughly the highest frequency while every contact is closed."""
        linear = self.linear
        contacts = np.abs(linear.contacts) @ (self._slopes[:, None] * np.abs(linear.deflections))
        stiffness, damping = np.abs(linear.stiffness) + contacts, np.abs(linear.damping)
        return float(np.sqrt(stiffness.sum(axis=1).max()) + damping.sum(axis=1).max())

    @property
    def _slopes(self) -> NDArray[np.float64]:
        """Sum of the slopes of each contact's stages on one side, at small penetration."""
        slopes = np.bincount(self.laws.contact, np.abs(self.laws.spring[:, 1]), self.linear.contacts.shape[1])
        return 0.5 * slopes.astype(float)
