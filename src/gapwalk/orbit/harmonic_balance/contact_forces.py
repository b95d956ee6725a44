"""Fourier lines of the contact forces along a motion given by its lines, exact to rounding, with all derivatives.

The function that is 1 while a stage is closed has its spectrum in closed form, from the angles at which the breakpoint
is passed. Every term of the force is that function times a power of the penetration, and a product of functions is a
convolution of their spectra. So nothing is sampled and nothing aliases.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.fourier_lines import grid
from gapwalk.orbit.harmonic_balance.kernels import contact_forces
from gapwalk.orbit.harmonic_balance.laws import Laws


class Forces(NamedTuple):
    """Contact forces ``g(x) + d/dt P(x)`` of a motion with K lines.

    Attributes
    ----------
    parts : shape (contacts, 4, 2K + 1)
        Lines of g, the spectrum (k = 0 ... 2K) of ``g'(x)``, and the same of P.
    slopes : shape (contacts, 2, K + 1)
        Derivatives of the lines of g and P by the parameter, with the motion held.
    crossings : shape (4, crossings)
        Where deflections pass breakpoints: angles ``0 <= phi < 2 pi`` in their order, derivatives of the deflection by
        phi, 1 where the stage closes, and its switch.
    """

    parts: NDArray[np.complex128]
    slopes: NDArray[np.complex128]
    crossings: NDArray[np.float64]

    @property
    def spring(self) -> NDArray[np.complex128]:
        """Lines of g, shape (contacts, 2K + 1)."""
        return self.parts[:, 0]

    @property
    def damper(self) -> NDArray[np.complex128]:
        """Lines of P, shape (contacts, 2K + 1)."""
        return self.parts[:, 2]

    @property
    def tangents(self) -> NDArray[np.complex128]:
        """Spectra of ``g'(x)`` and ``P'(x)``, shape (2, contacts, 2K + 1)."""
        return self.parts[:, 1::2].transpose(1, 0, 2)


def contact_forces_of(lines: NDArray[np.complex128], laws: Laws) -> Forces:
    """The forces along deflections with lines of shape (contacts, K + 1)."""
    return Forces(*contact_forces(lines, *laws.switches, laws.table, laws.slope_table, *grid(lines.shape[1] - 1)))
