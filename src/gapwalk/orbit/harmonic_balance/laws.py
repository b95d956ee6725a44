"""The contact laws as polynomials of the penetration, with their derivatives by a parameter.

Each stage on each side acts while its penetration ``xi = sign * x - clearance`` is positive. Whatever the damping law,
the force of a contact is

    f = g(x) + d/dt P(x)

with functions g and P that are polynomials of the penetrations: Hunt and Crossley's ``beta |g| x'`` is the time
derivative of the integral of ``beta |g|`` over x, and the viscous ``c x'`` while touching that of ``c xi``. So neither
velocities nor jumps of the force need to be integrated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.model.contact import DampingLaw

_STEP = 1e-150  # of the complex step
_POWERS = np.arange(5)


@dataclass(frozen=True, eq=False)
class Laws:
    """Polynomials of every stage on every side ("switch"), in the order of the flow's switches.

    Attributes
    ----------
    contact : shape (switches,)
        Contact of each switch.
    sign, clearance : shape (switches,)
        The stage is closed where ``sign * x > clearance``.
    spring, damper : shape (switches, 5)
        Coefficients of 1, xi ... xi^4 of its part of g and of P.
    clearance_slope, spring_slope, damper_slope
        Their derivatives by the parameter.
    degree
        Highest power that occurs.
    damped
        Whether any P is not zero.
    """

    contact: NDArray[np.intp]
    sign: NDArray[np.float64]
    clearance: NDArray[np.float64]
    spring: NDArray[np.float64]
    damper: NDArray[np.float64]
    clearance_slope: NDArray[np.float64]
    spring_slope: NDArray[np.float64]
    damper_slope: NDArray[np.float64]
    degree: int
    damped: bool

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Coefficients of each switch's part of g, g', P and P', derivatives by x; shape (switches, 4, degree + 1)."""
        rows = (
            self.spring,
            self.sign[:, None] * _rate(self.spring),
            self.damper,
            self.sign[:, None] * _rate(self.damper),
        )
        return np.ascontiguousarray(np.stack(rows, axis=1)[:, :, : self.degree + 1])

    @cached_property
    def switches(self) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
        """Contact, sign and clearance of each switch."""
        return self.contact, self.sign, self.clearance

    @cached_property
    def rates(self) -> NDArray[np.float64]:
        """Coefficients of each switch's part of g' and P', shape (switches, 2, degree + 1)."""
        return np.ascontiguousarray(self.table[:, 1::2])

    @cached_property
    def slope_table(self) -> NDArray[np.float64]:
        """Coefficients of the derivatives of g and P by the parameter, x held; shape (switches, 2, degree + 1)."""
        inwards = self.clearance_slope[:, None]
        rows = (self.spring_slope - inwards * _rate(self.spring), self.damper_slope - inwards * _rate(self.damper))
        return np.ascontiguousarray(np.stack(rows, axis=1)[:, :, : self.degree + 1])

    @cached_property
    def _rates(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coefficients of the derivatives of g and P by the penetration."""
        return _rate(self.spring), _rate(self.damper)

    @cached_property
    def _select(self) -> NDArray[np.float64]:
        """Sign of each switch in the column of its contact, shape (switches, contacts)."""
        return (self.contact[:, None] == np.arange(self.contact.max(initial=-1) + 1)) * self.sign[:, None]

    def tangents(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """``g'(x)`` and ``P'(x)`` at deflections of shape (..., contacts), of the same shape."""
        depth = np.maximum(self.sign * x[..., self.contact] - self.clearance, 0.0)
        inside = depth > 0.0
        spring, damper = ((_horner(rate, depth, self.degree) * inside) @ self._select for rate in self._rates)
        return spring, damper


def _rate(polynomials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of the derivatives of polynomials of degree 4, of the same shape."""
    return np.hstack((polynomials[:, 1:] * _POWERS[1:], np.zeros((len(polynomials), 1))))


def _horner(polynomials: NDArray[np.float64], x: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Values of one polynomial, of `count` coefficients, for each last index of x."""
    value = polynomials[:, count - 1]
    for power in range(count - 2, -1, -1):
        value = value * x + polynomials[:, power]
    return value


def laws_of(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None = None
) -> Laws:
    """The laws of all contacts for the coefficients of the flow, and their derivatives along `slope`."""
    moved = coefficients.astype(complex)
    if slope is not None:
        moved += 1j * _STEP * slope
    contacts, signs, clearances, springs, dampers = [], [], [], [], []
    for index, (slots, form) in enumerate(zip(layout.contacts, layout.structure.contacts, strict=True)):
        met: set[int] = set()
        for stage in slots.stages:
            k, cubic = moved[stage.stiffness], moved[stage.cubic]
            contacts.append(index)
            signs.append(float(stage.sign))
            clearances.append(moved[stage.clearance])
            springs.append(stage.sign * np.array([0.0, k, 0.0, cubic, 0.0]))
            innermost = stage.sign not in met
            dampers.append(_damper(form.damping, slots, moved, stage.sign, k, cubic, innermost))
            met.add(stage.sign)
    spring: NDArray[np.complex128] = np.array(springs, dtype=np.complex128).reshape(-1, 5)
    damper: NDArray[np.complex128] = np.array(dampers, dtype=np.complex128).reshape(-1, 5)
    clearance: NDArray[np.complex128] = np.array(clearances, dtype=np.complex128)
    used = np.flatnonzero((spring != 0.0).any(axis=0) | (damper != 0.0).any(axis=0))
    return Laws(
        np.array(contacts, dtype=np.intp),
        np.array(signs),
        clearance.real.copy(),
        spring.real.copy(),
        damper.real.copy(),
        clearance.imag / _STEP,
        spring.imag / _STEP,
        damper.imag / _STEP,
        int(used.max(initial=1)),
        bool((damper != 0.0).any()),
    )


def _damper(law: DampingLaw, slots: ContactSlots, values, sign: int, k, cubic, innermost: bool):
    """Coefficients of P of one stage on one side."""
    c = 0.0 if slots.damping is None else values[slots.damping]
    match law:
        case DampingLaw.VISCOUS:
            return np.array([0.0, sign * c * innermost, 0.0, 0.0, 0.0], dtype=complex)
        case DampingLaw.HUNT_CROSSLEY:
            return sign * c * np.array([0.0, 0.0, k / 2.0, 0.0, cubic / 4.0])
        case DampingLaw.HUNT_CROSSLEY_AS_PRINTED:
            return c * np.array([0.0, 0.0, k / 2.0, 0.0, cubic / 4.0])
        case DampingLaw.NONE:
            return np.zeros(5, dtype=complex)
