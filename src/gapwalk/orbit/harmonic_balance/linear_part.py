"""The matrices of the linear part of the equations of motion, read from the coefficients of the flow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout


@dataclass(frozen=True, eq=False, slots=True)
class Linear:
    """The matrices of the equations of motion, or their derivatives by a parameter.

    Attributes
    ----------
    stiffness, damping : shape (n, n)
        A and B.
    contacts : shape (n, contacts)
        The D_k.
    loads : shape (n, orders + 1)
        The constant load, and the complex amplitudes of each order of the excitation.
    deflections : shape (contacts, n)
        The e_k.
    """

    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    contacts: NDArray[np.float64]
    loads: NDArray[np.complex128]
    deflections: NDArray[np.float64]

    def shifted(self, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add a share of the stiffness of each contact to the stiffness matrix, shape (n, n)."""
        return self.stiffness + (self.contacts * shift) @ self.deflections

    @property
    def is_zero(self) -> bool:
        """True if all entries are zero: as derivatives, nothing changes with the parameter."""
        return not any(
            part.any() for part in (self.stiffness, self.damping, self.contacts, self.loads, self.deflections)
        )


def linear_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> Linear:
    """Read the matrices from a vector of coefficients (or of their derivatives)."""
    n, contacts, orders = layout.structure.size, len(layout.contacts), len(layout.orders)
    table = coefficients[layout.accelerations]
    mean = 2 * n + contacts
    cosines, sines = table[:, mean + 1 : mean + 1 + orders], table[:, mean + 1 + orders :]
    loads: NDArray[np.complex128] = np.hstack((table[:, mean : mean + 1].astype(complex), cosines - 1j * sines))
    deflections = np.array([coefficients[slots.deflection] for slots in layout.contacts]).reshape(contacts, n)
    return Linear(table[:, :n], table[:, n : 2 * n], table[:, 2 * n : mean], loads, deflections)
