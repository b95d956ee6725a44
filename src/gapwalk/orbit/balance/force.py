"""Fourier lines of the contact forces along a motion given by its lines, exact to rounding, with all derivatives.

The function that is 1 while a stage is closed has its spectrum in closed form, from the angles at which the breakpoint
is passed. Every term of the force is that function times a power of the penetration, and a product of functions is a
convolution of their spectra. So nothing is sampled and nothing aliases.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.balance.laws import Laws
from gapwalk.orbit.balance.lines import spectrum, two_sided
from gapwalk.orbit.balance.visits import Visits, find_visits


class Forces(NamedTuple):
    """Contact forces ``g(x) + d/dt P(x)`` of a motion with K lines.

    Attributes
    ----------
    spring, damper : shape (contacts, 2K + 1)
        Lines of g and P.
    tangents : shape (2, contacts, 2K + 1)
        Spectra, k = 0 ... 2K, of ``g'(x)`` and ``P'(x)``.
    spring_slope, damper_slope : shape (contacts, K + 1)
        Derivatives of the lines of g and P by the parameter, with the motion held.
    visits
        When the stages are closed.
    """

    spring: NDArray[np.complex128]
    damper: NDArray[np.complex128]
    tangents: NDArray[np.complex128]
    spring_slope: NDArray[np.complex128]
    damper_slope: NDArray[np.complex128]
    visits: Visits


def contact_forces_of(lines: NDArray[np.complex128], laws: Laws) -> Forces:
    """The forces along deflections with lines of shape (contacts, K + 1)."""
    count = lines.shape[-1] - 1
    visits = find_visits(lines, laws.contact, laws.sign, laws.clearance)
    longest = (2 + laws.degree) * count
    indicators = visits.indicators(longest)
    full = spectrum(lines)
    forces = np.zeros((4, len(lines), 2 * count + 1), dtype=complex)
    slopes = np.zeros((2, len(lines), count + 1), dtype=complex)
    for switch in np.flatnonzero(indicators[:, 0].real != 0.0).tolist():
        contact, sign = int(laws.contact[switch]), laws.sign[switch]
        depth = sign * full[contact]
        depth[count] -= laws.clearance[switch]
        powers = _powers(indicators[switch], depth, laws.degree, 2 * count)
        forces[:, contact] += laws.table[switch] @ powers
        if laws.moves:
            slopes[:, contact] += laws.slope_table[switch] @ powers[:, : count + 1]
    forces[0::2, :, 1:] *= 2.0  # from spectra to lines
    slopes[:, :, 1:] *= 2.0
    return Forces(forces[0], forces[2], forces[1::2], slopes[0], slopes[1], visits)


def _powers(indicator, depth, degree: int, kept: int) -> NDArray[np.complex128]:
    """Spectra, k = 0 ... kept, of the indicator times 1, xi ... xi^degree."""
    result = np.empty((degree + 1, kept + 1), dtype=complex)
    result[0] = indicator[: kept + 1]
    power = two_sided(indicator)
    for exponent in range(1, degree + 1):
        power = np.convolve(power, depth, "valid")
        middle = len(power) // 2
        result[exponent] = power[middle : middle + kept + 1]
    return result
