"""Contact forces and accelerations evaluated from coefficients and states, one or many at a time.

All functions accept complex numbers too, for derivatives by a complex step: the real part decides on which side of a
breakpoint a deflection lies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.model.laws import Stages, StageTerms


def contact_deflections(layout: CoefficientLayout, coefficients: NDArray, q: NDArray) -> NDArray:
    """Return the deflections ``e_k . q``, shape (..., contacts), for positions or velocities of shape (..., n)."""
    if not layout.contacts:
        return np.zeros((*q.shape[:-1], 0))
    return np.stack([q @ coefficients[slots.deflection] for slots in layout.contacts], axis=-1)


def contact_forces(
    layout: CoefficientLayout,
    coefficients: NDArray,
    q: NDArray,
    v: NDArray,
    closed: Sequence[Sequence[bool] | None] | None = None,
) -> NDArray:
    """Return the contact forces ``f_k``, shape (..., contacts), for positions and velocities of shape (..., n)."""
    x, rate = contact_deflections(layout, coefficients, q), contact_deflections(layout, coefficients, v)
    forces = [
        contact_force(slots, coefficients, x[..., index], rate[..., index], None if closed is None else closed[index])
        for index, slots in enumerate(layout.contacts)
    ]
    # a law may leave all of its force out, as where a stop only rebounds
    return np.stack([np.broadcast_to(force, x.shape[:-1]) for force in forces], axis=-1) if forces else np.zeros_like(x)


def contact_force(
    slots: ContactSlots, coefficients: NDArray, x: NDArray, rate: NDArray, closed: Sequence[bool] | None = None
) -> NDArray:
    """Compute the force ``f(x, x')`` of one contact at deflections `x` that change at `rate`, by its law.

    Parameters
    ----------
    slots
        The contact.
    coefficients : shape (..., number of coefficients)
        Coefficients of one system, or of one system for each deflection.
    x, rate
        Deflections and their rates, of any equal shapes.
    closed
        For each stage on each side whether it acts; by default the deflection decides.
    """
    stages = stages_of(slots, coefficients, x, closed)
    return slots.form.law.force(rate, stages, named(slots.numbers, coefficients))


def stages_of(
    slots: ContactSlots, coefficients: NDArray, x: NDArray | float, closed: Sequence[bool] | None = None
) -> Stages:
    """Return the stages of a contact at deflections, as used in formulas; parameters as in `contact_force`."""
    stages = []
    for number, stage in enumerate(slots.stages):
        values = named(stage.numbers, coefficients)
        depth = x - stage.sign * values["clearance"]
        inside = stage.sign * np.real(depth) > 0.0 if closed is None else np.asarray(closed[number])
        # the formula must not overflow far outside a stage
        stages.append(StageTerms(stage.sign, np.where(inside, depth, 0.0), inside * 1.0, stage.innermost, values))
    return Stages(stages)


def named(slots: Mapping[str, int], coefficients: NDArray) -> dict[str, NDArray]:
    """Return the values of some parameters by name."""
    return {name: coefficients[..., slot] for name, slot in slots.items()}


def accelerations(
    layout: CoefficientLayout,
    coefficients: NDArray,
    theta: NDArray | float,
    q: NDArray,
    v: NDArray,
    closed: Sequence[Sequence[bool] | None] | None = None,
) -> NDArray:
    """Return accelerations ``q''`` over time (not theta), shape (..., n); `closed` as in `contact_forces`."""
    n, n_contacts, orders = layout.structure.size, len(layout.contacts), np.array(layout.orders, dtype=float)
    table = coefficients[layout.accelerations]
    angles = np.multiply.outer(np.asarray(theta), orders)
    forces = contact_forces(layout, coefficients, q, v, closed)
    mean = 2 * n + n_contacts
    return (
        table[:, mean]
        + np.cos(angles) @ table[:, mean + 1 : mean + 1 + len(orders)].T
        + np.sin(angles) @ table[:, mean + 1 + len(orders) :].T
        - q @ table[:, :n].T
        - v @ table[:, n : 2 * n].T
        - forces @ table[:, 2 * n : mean].T
    )
