"""Contact forces and accelerations evaluated from coefficients and states, one or many at a time.

All of it takes complex numbers too, for derivatives by a complex step: on which side of a breakpoint a deflection lies
is decided by its real part.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.model.contact import DampingLaw
from gapwalk.model.structure import ContactForm


def contact_deflections(layout: CoefficientLayout, coefficients: NDArray, q: NDArray) -> NDArray:
    """Deflections ``e_k . q``, shape (..., contacts), for positions or velocities of shape (..., n)."""
    if not layout.contacts:
        return np.zeros((*q.shape[:-1], 0))
    return np.stack([q @ coefficients[slots.deflection] for slots in layout.contacts], axis=-1)


def contact_forces(layout: CoefficientLayout, coefficients: NDArray, q: NDArray, v: NDArray) -> NDArray:
    """Contact forces ``f_k``, shape (..., contacts), for positions and velocities of shape (..., n)."""
    x, rate = contact_deflections(layout, coefficients, q), contact_deflections(layout, coefficients, v)
    forces = [
        contact_force(slots, form, coefficients, x[..., index], rate[..., index])
        for index, (slots, form) in enumerate(zip(layout.contacts, layout.structure.contacts, strict=True))
    ]
    return np.stack(forces, axis=-1) if forces else np.zeros_like(x)


def contact_force(slots: ContactSlots, form: ContactForm, coefficients: NDArray, x: NDArray, rate: NDArray) -> NDArray:
    """The force ``f(x, x')`` of one contact at deflections `x` that change at `rate`; any equal shapes."""
    g, touching = _spring_force(slots, coefficients, x)
    c = 0.0 if slots.damping is None else coefficients[slots.damping]
    match form.damping:
        case DampingLaw.NONE:
            return g
        case DampingLaw.VISCOUS:
            return g + c * touching * rate
        case DampingLaw.HUNT_CROSSLEY:
            return g + c * np.where(np.real(g) < 0.0, -g, g) * rate
        case DampingLaw.HUNT_CROSSLEY_AS_PRINTED:
            return g + c * g * rate


def accelerations(
    layout: CoefficientLayout, coefficients: NDArray, theta: NDArray | float, q: NDArray, v: NDArray
) -> NDArray:
    """Accelerations ``q''`` over time (not theta), shape (..., n)."""
    n, n_contacts, orders = layout.structure.size, len(layout.contacts), np.array(layout.orders, dtype=float)
    table = coefficients[layout.accelerations]
    angles = np.multiply.outer(np.asarray(theta), orders)
    forces = contact_forces(layout, coefficients, q, v)
    mean = 2 * n + n_contacts
    return (
        table[:, mean]
        + np.cos(angles) @ table[:, mean + 1 : mean + 1 + len(orders)].T
        + np.sin(angles) @ table[:, mean + 1 + len(orders) :].T
        - q @ table[:, :n].T
        - v @ table[:, n : 2 * n].T
        - forces @ table[:, 2 * n : mean].T
    )


def _spring_force(slots: ContactSlots, coefficients: NDArray, x: NDArray) -> tuple[NDArray, NDArray]:
    """Spring force of a contact at deflections `x`, and whether it touches."""
    force, touching = np.zeros_like(x), np.zeros(np.shape(x), dtype=bool)
    for stage in slots.stages:
        depth = x - stage.sign * coefficients[stage.clearance]
        inside = stage.sign * np.real(depth) > 0
        depth = np.where(inside, depth, 0.0)
        force = force + coefficients[stage.stiffness] * depth + coefficients[stage.cubic] * depth**3
        touching = touching | inside
    return force, touching
