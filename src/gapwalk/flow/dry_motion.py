"""Forces and accelerations along a motion with dry friction and rigid stops, from the modes of the flow.

What sticks rigidly, or is held at a stop, has a force that is no function of the state alone: it follows from the
constraints of all that are held together (`gapwalk.flow.constraints`). Which are held is in the log of the flow; for a
state without a log, they are those with which a motion from that state begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.dry_state import Hold, SlipEvent
from gapwalk.flow.flow import flow_with
from gapwalk.flow.forces import Angles, Dry, accelerations, balance, contact_forces
from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.structure import Structure

_MOMENT = 1e-9  # radians over which a motion is begun to learn its modes
_AT = 1e-9  # radians within which an event is at an instant


class DryModes(NamedTuple):
    """Modes of dry friction and of rigid stops, at one instant or at some.

    Examples
    --------
    >>> gw.records.DryModes(slips=np.array([1]), held=np.array([False])).slips
    array([1])
    """

    #: shape (..., contacts that are friction): 1 or -1 in slip, by its direction; 0 in stick. The order is that of
    #: `Structure.friction`.
    slips: NDArray[np.int8]
    #: shape (..., reactions): True for each reaction of `Structure.reactions` that is held: rigid friction in stick,
    #: and stops.
    held: NDArray[np.bool_]

    def at(self, sample: int) -> DryModes:
        """Return the modes at one of the instants."""
        return DryModes(self.slips[sample], self.held[sample])

    def order(self, structure: Structure) -> list[int]:
        """Return the numbers of the reactions held at one instant: stops first.

        Where they depend on each other, friction has no reaction.
        """
        reactions = structure.reactions
        return sorted(np.flatnonzero(self.held).tolist(), key=lambda each: (reactions[each][1] < 0, each))


def is_dry(structure: Structure) -> bool:
    """Return True if a system has dry friction or rigid stops, whose forces depend on modes of the flow."""
    return bool(structure.memories or structure.reactions)


def modes_along(
    structure: Structure,
    theta: NDArray[np.float64],
    slips: Sequence[SlipEvent],
    holds: Sequence[Hold],
    *,
    before: bool = False,
) -> DryModes:
    """Return the modes at some angles of a motion, from its logs."""
    edges = theta - _AT if before else np.maximum(theta, min((hold.theta for hold in holds), default=-np.inf))
    found = np.zeros((len(theta), len(structure.friction)), dtype=np.int8)
    for place, contact in enumerate(structure.friction):
        own = [event for event in slips if event.contact == contact]
        if own:
            found[:, place] = np.array([event.slip for event in own])[_latest([event.theta for event in own], edges)]
    if not structure.reactions:
        return DryModes(found, np.zeros((len(theta), 0), dtype=bool))
    patterns = np.zeros((len(holds), len(structure.reactions)), dtype=bool)
    for row, hold in zip(patterns, holds, strict=True):
        row[list(hold.reactions)] = True
    return DryModes(found, patterns[_latest([hold.theta for hold in holds], edges)])


def _latest(times: Sequence[float], theta: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return for each angle the index of the last of some increasing times that is not after it; -1 before all."""
    return np.searchsorted(np.array(times), theta, side="right") - 1


def modes_at(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    theta: NDArray[np.float64],
    states: NDArray[np.float64],
) -> DryModes:
    """Return the modes with which motions begin in some states, shape (samples, state_size)."""
    structure, flow, rows = layout.structure, flow_with(layout, coefficients), []
    for angle, state in zip(theta.tolist(), states, strict=True):
        begun = flow.sample(coefficients, state, np.array([angle, angle + _MOMENT]))
        rows.append(modes_along(structure, np.array([angle]), begun.slips, begun.holds))
    slips = np.array([row.slips[0] for row in rows]).reshape(len(rows), len(structure.friction))
    return DryModes(slips, np.array([row.held[0] for row in rows]).reshape(len(rows), len(structure.reactions)))


def acceleration_at(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], theta: float, state: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the acceleration in one state, with the modes with which a motion begins there, shape (n,)."""
    n = layout.structure.size
    if not is_dry(layout.structure):
        return accelerations(layout, coefficients, theta, state[:n], state[n : 2 * n])
    angle, states = np.array([theta]), state[None]
    modes, (q, v, z) = modes_at(layout, coefficients, angle, states), np.split(states, (n, 2 * n), axis=1)
    return forces_and_accelerations(layout, coefficients, angle, q, v, z, modes)[1][0]


def forces_and_accelerations(
    layout: CoefficientLayout,
    coefficients: NDArray,
    theta: NDArray,
    q: NDArray,
    v: NDArray,
    z: NDArray,
    modes: DryModes | None,
) -> tuple[NDArray, NDArray]:
    """Compute the forces of all contacts, reactions included, and the accelerations; real or complex.

    Shapes: `theta` (samples,); `q`, `v` (samples, n); `z` (samples, memories).
    """
    angles = Angles(layout, coefficients, theta)
    if modes is None:
        forces = contact_forces(layout, coefficients, theta, q, v, angles=angles)
        return forces, accelerations(layout, coefficients, theta, q, v)
    forces = contact_forces(layout, coefficients, theta, q, v, angles=angles, dry=Dry(modes.slips.astype(float), z))
    turning, total = np.zeros_like(forces, shape=q.shape), forces.copy()
    patterns, which = np.unique(modes.held, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        rows = np.flatnonzero(which.ravel() == number)
        moved = q[rows], v[rows], forces[rows], angles.waves[rows]
        constraint = Constraint(layout, coefficients, DryModes(modes.slips[rows[0]], pattern).order(layout.structure))
        held = constraint.coefficients()
        turning[rows] = balance(held[layout.accelerations], *moved)
        found = balance(held[layout.reactions[constraint.independent]], *moved)
        for contact, reaction in zip(constraint.contacts, found.T, strict=True):
            total[rows, contact] += reaction
    return total, turning
