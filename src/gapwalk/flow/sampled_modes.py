"""Accelerations and forces at samples of a motion, where friction slips or sticks and rigid stops are held.

The modes of friction follow from its log. A stop is held where the motion rests on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.dry_state import SlipEvent
from gapwalk.flow.forces import Angles, Dry, accelerations, balance, contact_forces
from gapwalk.model.coefficients import CoefficientLayout

_RESTS = 1e-9  # distance from a stop and rate, relative to the motion, at which it is held


class SampledModes(NamedTuple):
    """Modes of friction and of stops at some samples.

    Attributes
    ----------
    slips : shape (samples, contacts that are friction), or None
        As in `Dry`.
    held : shape (samples, reactions)
        True for the reactions that act.
    """

    slips: NDArray[np.float64] | None
    held: NDArray[np.bool_]


def modes_along(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    theta: NDArray[np.float64],
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    log: Sequence[SlipEvent],
) -> SampledModes:
    """Return the modes at some samples; without a log, friction slips by the sign of its rate.

    Parameters
    ----------
    layout, coefficients
        The coefficients of the flow, with their layout.
    theta : shape (samples,)
        Increasing angles.
    q, v : shape (samples, n)
        Positions and velocities.
    log
        The modes of friction at the first sample, then their changes, in order.
    """
    structure = layout.structure
    dry = [number for number, contact in enumerate(structure.contacts) if contact.law.is_dry]
    slips = np.zeros((len(theta), len(dry))) if log else None
    held = np.zeros((len(theta), len(structure.reactions)), dtype=bool)
    if slips is not None:
        for column, number in enumerate(dry):
            own = [event for event in log if event.contact == number]
            places = np.searchsorted([event.theta for event in own], theta, side="right") - 1
            slips[:, column] = np.array([event.slip for event in own])[np.maximum(places, 0)]
    stages = [(contact, stage) for contact in layout.contacts for stage in contact.stages]
    for number, (contact, switch) in enumerate(structure.reactions):
        if switch < 0:
            held[:, number] = False if slips is None else slips[:, dry.index(contact)] == 0.0
            continue
        slots, stage = stages[switch]
        angles, vector = Angles(layout, coefficients, theta), coefficients[slots.deflection]
        x, u = q @ vector + angles.sway(slots), v @ vector + angles.sway(slots, 0, 1)
        off = np.abs(x - stage.sign * coefficients[stage.clearance])
        held[:, number] = (off <= _RESTS * np.abs(x).max()) & (np.abs(u) <= _RESTS * np.abs(u).max())
    return SampledModes(slips, held)


def forces_along(
    layout: CoefficientLayout,
    coefficients: NDArray,
    theta: NDArray,
    states: tuple[NDArray, NDArray, NDArray],
    modes: SampledModes,
) -> tuple[NDArray, NDArray]:
    """Compute accelerations and contact forces, shapes (samples, n) and (samples, contacts), real or complex.

    The force of friction that sticks, and of a stop that is held, is its reaction.

    Parameters
    ----------
    layout, coefficients
        The coefficients of the flow, with their layout.
    theta : shape (samples,)
        Angles.
    states
        Positions, velocities and extensions, with a row for each sample.
    modes
        The modes.
    """
    structure, (q, v, z) = layout.structure, states
    if not structure.reactions:
        dry = Dry(modes.slips, z)
        forces = contact_forces(layout, coefficients, theta, q, v, dry=dry)
        return accelerations(layout, coefficients, theta, q, v, dry=dry), forces
    kind = np.result_type(coefficients, theta, q)
    a, forces = np.zeros(q.shape, kind), np.zeros((len(q), len(structure.contacts)), kind)
    patterns, which = np.unique(modes.held, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        rows = np.flatnonzero(which.ravel() == number)
        dry = Dry(None if modes.slips is None else modes.slips[rows], z[rows])
        # stops come before friction, as `Constraint` asks
        acting = sorted(np.flatnonzero(pattern).tolist(), key=lambda each: structure.reactions[each][1] < 0)
        held = Constraint(layout, coefficients, acting).coefficients() if acting else coefficients
        own = theta[rows], q[rows], v[rows]
        a[rows] = accelerations(layout, held, *own, dry=dry)
        found = contact_forces(layout, held, *own, dry=dry)
        forces[rows] = found
        if acting:
            waves = Angles(layout, held, theta[rows]).waves
            reactions = balance(held[layout.reactions[acting]], q[rows], v[rows], found, waves)
            for column, each in enumerate(acting):
                forces[rows, structure.reactions[each][0]] += reactions[:, column]
    return a, forces
