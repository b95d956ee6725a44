"""Fourier lines of the contact forces along a motion given by its lines, exact to rounding, with all derivatives.

Each stage on each side acts while its penetration ``xi = sign * x - clearance`` is positive. Whatever the damping law,
the force of a contact is

    f = g(x) + d/dt P(x)

with functions g and P that are polynomials of the penetrations, read from the closed form of the law: Hunt and
Crossley's ``beta |g| x'`` is the time derivative of the integral of ``beta |g|`` over x, and the viscous ``c x'`` while
touching that of ``c xi``. So neither velocities nor jumps of the force need to be integrated.

The function that is 1 while a stage is closed has its spectrum in closed form, from the angles at which the breakpoint
is passed. Every term of the force is that function times a power of the penetration, and a product of functions is a
convolution of their spectra. So nothing is sampled and nothing aliases.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.spring import ForcePolynomials, polynomials_of
from gapwalk.orbit.harmonic_balance.kernels import contact_forces
from gapwalk.orbit.harmonic_balance.series import grid

_STEP = 1e-150  # of the complex step


@dataclass(frozen=True, eq=False)
class Laws:
    """Polynomials of every stage on every side ("switch"), in the order of the flow's switches.

    Attributes
    ----------
    contact : shape (switches,)
        Contact of each switch.
    sign, clearance : shape (switches,)
        The stage is closed where ``sign * x > clearance``.
    polynomials : shape (switches, 2, degree + 1)
        Coefficients of 1, xi, ... of its part of g and of P.
    clearance_slope, slopes
        Derivatives of the clearances and of the polynomials by the parameter.
    """

    contact: NDArray[np.intp]
    sign: NDArray[np.float64]
    clearance: NDArray[np.float64]
    polynomials: NDArray[np.float64]
    clearance_slope: NDArray[np.float64]
    slopes: NDArray[np.float64]

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """Absolute change of the slope of the force where each stage begins, shape (switches,)."""
        return np.abs(self.polynomials[:, 0, 1])

    @cached_property
    def rates(self) -> NDArray[np.float64]:
        """Coefficients of each switch's part of g' and P', derivatives by x; shape (switches, 2, degree + 1)."""
        return self.sign[:, None, None] * self._by_depth

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Coefficients of each switch's part of g, g', P and P', shape (switches, 4, degree + 1)."""
        switches, _, powers = self.polynomials.shape
        return np.stack((self.polynomials, self.rates), axis=2).reshape(switches, 4, powers)

    @cached_property
    def switches(self) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
        """Contact, sign and clearance of each switch."""
        return self.contact, self.sign, self.clearance

    @cached_property
    def slope_table(self) -> NDArray[np.float64]:
        """Coefficients of the derivatives of g and P by the parameter, x constant; shape (switches, 2, degree + 1)."""
        return self.slopes - self.clearance_slope[:, None, None] * self._by_depth

    @cached_property
    def _by_depth(self) -> NDArray[np.float64]:
        """Coefficients of the derivatives of g and P by the penetration, of the same shape."""
        found = np.zeros_like(self.polynomials)
        found[..., :-1] = self.polynomials[..., 1:] * np.arange(1.0, self.polynomials.shape[2])
        return found

    def tangents(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ``g'(x)`` and ``P'(x)`` at deflections of shape (..., contacts), of the same shape."""
        # sign of each switch in the column of its contact
        select = (self.contact[:, None] == np.arange(self.contact.max(initial=-1) + 1)) * self.sign[:, None]
        depth = np.maximum(self.sign * x[..., self.contact] - self.clearance, 0.0)
        found = []
        for rates in (self._by_depth[:, 0], self._by_depth[:, 1]):
            value = rates[:, -1]
            for power in range(rates.shape[1] - 2, -1, -1):
                value = value * depth + rates[:, power]
            found.append((value * (depth > 0.0)) @ select)
        return found[0], found[1]


class Forces(NamedTuple):
    """Contact forces ``g(x) + d/dt P(x)`` of a motion with K lines.

    Attributes
    ----------
    parts : shape (contacts, 4, 2K + 1)
        Lines of g, the spectrum (k = 0 ... 2K) of ``g'(x)``, and the same of P.
    slopes : shape (contacts, 2, K + 1)
        Derivatives of the lines of g and P by the parameter, with the motion constant.
    crossings : shape (4, crossings)
        Crossings of breakpoints: angles ``0 <= phi < 2 pi`` in their order, derivatives of the deflection by
        phi, 1 where the stage closes, and its switch.
    """

    parts: NDArray[np.complex128]
    slopes: NDArray[np.complex128]
    crossings: NDArray[np.float64]


def laws_of(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None = None
) -> Laws:
    """Return the laws of all contacts for the coefficients of the flow, and their derivatives along `slope`.

    Raises
    ------
    ModelError
        If a law does not have this form.
    """
    plan = _plan_of(layout)
    moved: NDArray[Any] = coefficients if slope is None else coefficients + 1j * _STEP * slope
    table, clearance = plan.table(moved), moved[plan.clearances]
    used = np.flatnonzero((table != 0.0).any(axis=(0, 1)))
    table = table[:, :, : 1 + int(used.max(initial=1))]  # 1 and xi at least: a contact may have no force at all
    contacts, signs = plan.contacts, plan.signs
    if slope is None:
        return Laws(contacts, signs, clearance, table.copy(), np.zeros(clearance.shape), np.zeros(table.shape))
    slopes = np.imag(clearance) / _STEP, np.imag(table) / _STEP
    return Laws(contacts, signs, np.real(clearance).copy(), np.real(table).copy(), *slopes)


@lru_cache(maxsize=256)
def _plan_of(layout: CoefficientLayout) -> ForcePolynomials:
    """Return the polynomials g and P of all contacts, as functions of the coefficients.

    Raises
    ------
    ModelError
        If the force of a contact is not a polynomial of the penetration, linear in the rate, or if it jumps.
    """
    backend = "harmonic balance"
    for slots in layout.contacts:
        for term in slots.form.closed_form(backend):
            if term.rate > 1 or term.power == term.rate == 0:
                reason = "is not linear in the rate" if term.rate else "jumps at a breakpoint whatever the rate"
                law = slots.form.law.name
                raise ModelError(f"{backend} cannot include {slots.form.name!r}: its force law {law!r} {reason}")
    return polynomials_of(layout, backend).integrated()


def contact_forces_of(lines: NDArray[np.complex128], laws: Laws) -> Forces:
    """Compute the forces along deflections with lines of shape (contacts, K + 1)."""
    return Forces(*contact_forces(lines, *laws.switches, laws.table, laws.slope_table, *grid(lines.shape[1] - 1)))
