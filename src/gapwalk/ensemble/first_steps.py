"""Start of the batch integrator: contact forces at the start of a motion and at the two steps before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.scheme import HISTORY, Linear
from gapwalk.model.contact import DampingLaw


def history_of(linear: Linear, states: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Compute the contact forces at theta = 0 and at the steps before it, shape (HISTORY, contacts, lanes).

    The motion is integrated backwards by the classical Runge-Kutta method, which is accurate enough for two steps.

    Parameters
    ----------
    linear
        The systems, one for each state or one for all.
    states : shape (lanes, 2n)
        Positions, then velocities, at theta = 0.
    steps
        Steps per forcing period.
    """
    turn = -2.0 * np.pi / steps
    h = (turn * linear.rate)[:, None]
    forces = [contact_forces(linear, states)]
    for number in range(HISTORY - 1):
        theta = number * turn
        k1 = _slopes(linear, theta, states)
        k2 = _slopes(linear, theta + turn / 2, states + h / 2 * k1)
        k3 = _slopes(linear, theta + turn / 2, states + h / 2 * k2)
        k4 = _slopes(linear, theta + turn, states + h * k3)
        states = states + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        forces.append(contact_forces(linear, states))
    return np.array(forces).transpose(0, 2, 1)


def contact_forces(linear: Linear, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute contact forces from their definition, shape (lanes, contacts), each lane with its own coefficients."""
    deflections = np.einsum("lakz,lz->akl", linear.deflections, states)
    forces = np.zeros((len(states), len(linear.layout.contacts)))
    for k, (slots, form) in enumerate(zip(linear.layout.contacts, linear.layout.structure.contacts, strict=True)):
        x, rate = deflections[:, k]
        spring, size, touching = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x, dtype=bool)
        for stage in slots.stages:
            depth = np.maximum(stage.sign * x - linear.coefficients[:, stage.clearance], 0.0)
            force = depth * (linear.coefficients[:, stage.stiffness] + linear.coefficients[:, stage.cubic] * depth**2)
            spring, size, touching = spring + stage.sign * force, size + force, touching | (depth > 0)
        c = 0.0 if slots.damping is None else linear.coefficients[:, slots.damping]
        share = {
            DampingLaw.NONE: 0.0,
            DampingLaw.VISCOUS: touching,
            DampingLaw.HUNT_CROSSLEY: size,
            DampingLaw.HUNT_CROSSLEY_AS_PRINTED: spring,
        }[form.damping]
        forces[:, k] = spring + c * rate * share
    return forces


def _slopes(linear: Linear, theta: float, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the time derivatives of the states, shape (lanes, 2n)."""
    angles = theta * np.array(linear.layout.orders, dtype=float)
    basis = np.ones(linear.loads.shape[2])
    basis[1::2], basis[2::2] = np.cos(angles), np.sin(angles)
    return (
        np.einsum("lij,lj->li", linear.matrix, states)
        + np.einsum("lik,lk->li", linear.push, contact_forces(linear, states))
        + linear.loads @ basis
    )
