"""The start of a run of the batch integrator: what the first steps need of the time before it.

A step needs the contact forces at earlier steps. The motion is therefore integrated backwards, as if no level of a
variation had jumped before the start. Where one jumps within the first two steps, the samples of the force near the
jump lie partly before the start, and do not count in full; the earlier values are chosen so that the sum is right.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.excitation import smooth_step
from gapwalk.ensemble.scheme import HISTORY, Linear, deflections_of
from gapwalk.flow.forces import Angles, contact_force, is_at_high, stages_of
from gapwalk.model.coefficients import ContactSlots, CycleSlots
from gapwalk.model.laws import Stages, StageTerms

_STEP = 1e-150  # of the complex step
_Moves = list[tuple[NDArray[np.float64], NDArray[np.float64]]]


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
    levels: list[Any] = [is_at_high(cycle, linear.coefficients, 0.0) * 1.0 for cycle in linear.layout.cycles]
    near = [_starting_shares(cycle, linear.coefficients, steps) for cycle in linear.layout.cycles]
    forces = [_contact_forces(linear, 0.0, states, [level + part[0] for level, part in zip(levels, near, strict=True)])]
    for number in range(HISTORY - 1):
        theta = number * turn
        k1 = _slopes(linear, theta, states, levels)
        k2 = _slopes(linear, theta + turn / 2, states + h / 2 * k1, levels)
        k3 = _slopes(linear, theta + turn / 2, states + h / 2 * k2, levels)
        k4 = _slopes(linear, theta + turn, states + h * k3, levels)
        states = states + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        shares = [level + part[number + 1] for level, part in zip(levels, near, strict=True)]
        forces.append(_contact_forces(linear, theta + turn, states, shares))
    return np.array(forces).transpose(0, 2, 1)


def guards_of(linear: Linear, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the guards of all modes of laws at theta = 0, shape (modes, lanes)."""
    angles, found = Angles(linear.layout, linear.coefficients, 0.0), []
    for slots, moves in zip(linear.layout.contacts, _moves(linear, angles, states), strict=True):
        if slots.form.law.mode_count:
            numbers = angles.named(slots.numbers, slots.waves)
            guards = slots.form.law.guards(moves[0][1], stages_of(slots, angles, moves), numbers)
            found += [np.broadcast_to(each, len(states)) for each in guards]
    return np.array(found).reshape(len(found), len(states))


def slopes_of(linear: Linear, states: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Estimate the largest slope of the force by each deflection, shapes (1,) or (lanes,); 0 if it is not positive.

    A contact has all stages of one side closed, each with the slope at its breakpoint. A force without stages has the
    median of its slopes at some states, because those of a formula far outside may be any.
    """
    found, angles = [], Angles(linear.layout, linear.coefficients, 0.0)
    moved = _moves(linear, angles, states)
    for slots, moves in zip(linear.layout.contacts, moved, strict=True):
        if slots.stages:
            found.append(_slope_of_stages(slots, linear.coefficients.T))
            continue
        for place, (x, rate) in enumerate(moves):
            shifted = [*moves[:place], (x + 1j * _STEP, rate), *moves[place + 1 :]]
            with np.errstate(all="ignore"):
                slopes = np.imag(contact_force(slots, angles, shifted)) / _STEP
            slopes = slopes[np.isfinite(slopes)]
            found.append(np.array([max(np.median(slopes), 0.0) if len(slopes) else 0.0]))
    return found


def _slope_of_stages(slots: ContactSlots, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the larger of the sums of the slopes of all stages on either side, for coefficients in columns."""
    law, sums = slots.form.law, {1: np.zeros(coefficients.shape[1]), -1: np.zeros(coefficients.shape[1])}
    own = {name: coefficients[slot] for name, slot in slots.numbers.items()}
    for stage in slots.stages:
        numbers = {name: coefficients[slot] for name, slot in stage.numbers.items()}
        terms = Stages(
            [StageTerms(stage.sign, 1j * _STEP, 1.0, stage.innermost, numbers)], modes=[0.0] * law.mode_count
        )
        sums[stage.sign] += np.maximum(np.imag(law.force(0.0, terms, own)) / _STEP, 0.0)
    return np.maximum(sums[1], sums[-1])


def _moves(linear: Linear, angles: Angles, states: NDArray[np.float64]) -> list[_Moves]:
    """Return the deflections with their rates of each contact."""
    moved = np.einsum("lakz,lz->akl", linear.deflections, states)
    found: list[_Moves] = [[] for _ in linear.layout.contacts]
    for place, (contact, argument) in enumerate(deflections_of(linear.layout)):
        slots = linear.layout.contacts[contact]
        x, rate = (moved[which, place] + angles.sway(slots, argument, which) for which in (0, 1))
        found[contact].append((x, rate))
    return found


def _contact_forces(
    linear: Linear, theta: float, states: NDArray[np.float64], levels: list[Any]
) -> NDArray[np.float64]:
    """Compute contact forces from their definition, shape (lanes, contacts), each lane with its own coefficients."""
    angles = Angles(linear.layout, linear.coefficients, theta, levels)
    forces = [
        np.broadcast_to(contact_force(slots, angles, moves), len(states))
        for slots, moves in zip(linear.layout.contacts, _moves(linear, angles, states), strict=True)
    ]
    return np.stack(forces, axis=1) if forces else np.zeros((len(states), 0))


def _slopes(linear: Linear, theta: float, states: NDArray[np.float64], levels: list[Any]) -> NDArray[np.float64]:
    """Compute the time derivatives of the states, shape (lanes, 2n)."""
    angles = theta * np.array(linear.layout.orders, dtype=float)
    basis = np.ones(linear.loads.shape[2])
    basis[1::2], basis[2::2] = np.cos(angles), np.sin(angles)
    return (
        np.einsum("lij,lj->li", linear.matrix, states)
        + np.einsum("lik,lk->li", linear.push, _contact_forces(linear, theta, states, levels))
        + linear.loads @ basis
    )


def _starting_shares(cycle: CycleSlots, coefficients: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return what is added to the share of the higher level at the start and before, shape (HISTORY, lanes).

    Let `t` be the place of a jump in steps from the start. Zeroth and first moment over the time after the start must
    be those of the jump if `t > 0`, and 0 otherwise. The three unknowns are the smallest that satisfy this.
    """
    per_radian, length = steps / (2.0 * np.pi), 2.0 * np.pi / cycle.order
    total = np.zeros((HISTORY, len(coefficients)))
    ahead = np.arange(1.0, 5.0)[:, None]
    for slot, sign in ((cycle.up, 1.0), (cycle.down, -1.0)):
        angle = coefficients[:, slot]
        t = (angle - length * np.round(angle / length)) * per_radian
        missing = smooth_step(ahead - t, lambda u: np.clip(u, 0.0, 1.0)) - 1.0
        wanted = -np.stack((missing.sum(axis=0), (ahead * missing).sum(axis=0)))
        # sums of 1 and of i over all i >= 1 exceed the integrals from 0 on by zeta(0) and zeta(-1)
        wanted += np.where(t > 0.0, np.stack((0.5 - t, 1.0 / 12.0 - t**2 / 2.0)), 0.0)
        total += sign * np.where((t > -1.0) & (t < 2.0), _PASSED @ wanted, 0.0)
    return total


def _moments() -> NDArray[np.float64]:
    """Compute the integrals, over the time after the start, of the polynomials that each earlier value multiplies.

    Shape (2, HISTORY): multiplied by 1 and by the time in steps.
    """
    nodes = np.arange(1.0, -HISTORY, -1.0)
    lagrange = np.linalg.inv(np.vander(nodes, increasing=True))  # coefficients in columns
    powers = np.arange(1 + HISTORY)
    zeroth, first = lagrange.T @ (1.0 / (powers + 1.0)), lagrange.T @ (1.0 / (powers + 2.0))
    found = np.zeros((2, HISTORY))
    for step in range(HISTORY):
        for earlier in range(HISTORY - step):
            node = 1 + step + earlier
            found[:, earlier] += zeroth[node], first[node] + step * zeroth[node]
    return found


_PASSED = np.linalg.pinv(_moments())
