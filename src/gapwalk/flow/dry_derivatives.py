"""Derivatives of a motion through the events of dry friction and of rigid stops that are held.

They are the general rule of `gapwalk.flow.event_rule` in its closed form for these events. Where a contact begins to be
held, changes of the motion are projected on the constraint. A Jenkins element that begins to slip forgets how far it
was strained. Where forces jump, an event that comes later contributes what they did in the meantime.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.dry_state import DryState, Readings, largest
from gapwalk.flow.forces import Angles, Dry, balance, contact_forces

_NOTHING = 1e-13  # share of the accelerations below which their jump is rounding
_STEP = 1e-150  # of the complex step

Array = NDArray[np.float64]


def rate_changes(state: DryState, contact: int, theta: float) -> Array:
    """Return the change, along each column, of the rate of a deflection, less that of its base."""
    changes = state.velocity_rows.dot(state.vectors[contact])
    if state.is_moved[contact]:
        slots, part, directions = state.layout.contacts[contact], slice(state.n, 2 * state.n), state.directions
        own = directions[:, slots.deflection] @ state.state[part]
        if "speed" in slots.numbers:
            own = own - directions[:, slots.numbers["speed"]]
        if slots.sway is not None:
            own = own + _varied(state, lambda numbers: Angles(state.layout, numbers, theta).sway(slots, 0, 1))
        changes[state.columns - len(directions) :] += own
    return changes


def depth_changes(state: DryState, number: int, theta: float) -> Array:
    """Return the change, along each column, of the depth beyond a stop, by its reaction."""
    contact, switch = state.layout.structure.reactions[number]
    slots = state.layout.contacts[contact]
    changes = state.rows()[:, : state.n].dot(state.vectors[contact])
    if len(directions := state.directions):
        clearance = slots.stages[state.equations.switches[switch][1]].clearance
        own = directions[:, slots.deflection] @ state.state[: state.n]
        own = own - state.sign_of[number] * directions[:, clearance]
        if slots.sway is not None:
            own = own + _varied(state, lambda numbers: Angles(state.layout, numbers, theta).sway(slots))
        changes[state.columns - len(directions) :] += own
    return changes


def _varied(state: DryState, function: Callable[[NDArray], Any]) -> Array:
    """Return the change of a function of the coefficients along each direction."""
    step = 1j * _STEP
    return np.array([float(np.imag(function(state.base + step * each))) for each in state.directions]) / _STEP


def extension_changes(state: DryState, place: int, theta: float) -> Array:
    """Return the change, along each column, of the extension at which a Jenkins element slips."""
    slots, changes, is_constant = state.slots[place], np.zeros(state.columns), state.has_constant_limit[place]
    stiffness, directions = state.stiffness(place), state.directions
    if is_constant and not state.is_strained[place]:
        return changes
    if is_constant:
        limit, by_limit = float(state.base[slots.numbers["limit"]]), directions[:, slots.numbers["limit"]]
    else:
        limit, by_limit = state.read(theta).friction[place][1], 0.0
        changes = state.tangents(theta, state.rows(), state.along())[1][:, place, 0] / stiffness
    if len(directions):
        by_stiffness = directions[:, slots.numbers["stiffness"]]
        changes[state.columns - len(directions) :] += by_limit / stiffness - limit * by_stiffness / stiffness**2
    return changes


def margin_changes(state: DryState, place: int, now: Readings, theta: float) -> Array:
    """Return the change along each column of a reaction less the force at which slip begins."""
    number = state.reaction_of[place]
    assert number is not None
    columns, limits = state.tangents(theta, state.rows(), state.along())
    table, side = state.entry.table[state.n :], 1.0 if now.reactions[number] > 0.0 else -1.0
    changes = columns @ table[number]
    if len(directions := state.entry.directions):
        rows = directions[:, state.layout.reactions[number]]
        changes[state.columns - len(directions) :] += (rows * state.column_signs) @ now.columns
    return side * changes - limits[:, place, 1]


def margin_growth(state: DryState, place: int, now: Readings, theta: float) -> float:
    """Return the rate over time of a reaction less the force at which slip begins."""
    number = state.reaction_of[place]
    assert number is not None
    motion = np.concatenate((now.velocities, now.accelerations, now.extending))[None]
    still, side = np.zeros((1, len(state.base))), 1.0 if now.reactions[number] > 0.0 else -1.0
    columns, limits = state.tangents(theta, motion, still, 1.0 / float(state.base[0]))
    return side * float(columns[0] @ state.entry.table[state.n + number]) - float(limits[0, place, 1])


def _dragged(state: DryState, moved: Array, theta: float) -> Array:
    """Return the changes of the velocities where a motion comes to its stops from changes of the positions.

    It comes there in no time to leading order, but dampers that it moves on the way give finite impulses.
    """
    n, layout, y, found = state.n, state.layout, state.state[: state.size], np.zeros_like(moved)
    angles, dry = Angles(layout, state.base, theta), Dry(np.array(state.slips, dtype=float), y[2 * n :])
    for row, change in zip(found, moved, strict=True):
        if change.any():
            v = y[n : 2 * n] + 1j * _STEP * change
            forces = contact_forces(layout, state.base, theta, y[:n], v, state.closed, angles, dry)
            table = state.entry.coefficients[layout.accelerations]
            row[:] = np.imag(balance(table, y[:n], v, forces, angles.waves)) / _STEP
    return found


def project(state: DryState, theta: float) -> None:
    """Project the state and its changes on what is held.

    Changes of positions at a stop that is held are those of motions that begin before it, and come to it.
    """
    constraint, n, y = state.entry.constraint, state.n, state.state
    if not constraint.independent:
        return
    if not any(state.is_moved[each] or state.has_base[each] for each in constraint.contacts) and not state.sign_of:
        state.velocity_rows -= state.velocity_rows.dot(constraint.stopping)
        y[n : 2 * n] -= y[n : 2 * n].dot(constraint.stopping)
        return
    stops = [place for place, number in enumerate(constraint.independent) if number in state.sign_of]
    if state.columns:
        rows, part = state.rows(), slice(n, 2 * n)
        rates = rows[:, part].dot(constraint.vectors.T)
        for place, contact in enumerate(constraint.contacts):
            if state.is_moved[contact]:
                rates[:, place] = rate_changes(state, contact, theta)
        if stops:
            depths = np.array([depth_changes(state, constraint.independent[place], theta) for place in stops])
            moved = -depths.T @ constraint.impulses[:, stops].T
            rows[:, :n] += moved
            rows[:, part] += _dragged(state, moved, theta)
            for slots, memory in zip(state.slots, state.memory_of, strict=True):
                if memory is not None:
                    rows[:, memory] += moved @ state.base[slots.deflection]
        rows[:, part] -= rates.dot(constraint.impulses.T)
    rates = constraint.vectors.dot(y[n : 2 * n])
    for place, contact in enumerate(constraint.contacts):
        slots = state.layout.contacts[contact]
        if slots.sway is not None:
            rates[place] += float(Angles(state.layout, state.base, theta).sway(slots, 0, 1))
        if "speed" in slots.numbers:
            rates[place] -= state.base[slots.numbers["speed"]]
    y[n : 2 * n] -= constraint.impulses.dot(rates)
    for place in stops:
        y[:n] -= state.gap(constraint.independent[place], theta)[0] * constraint.impulses[:, place]


def add_delay(
    state: DryState,
    before: Readings,
    theta: float,
    shifts: Array,
    speed: float,
    forgotten: Mapping[int, bool] = MappingProxyType({}),
    after: Readings | None = None,
) -> None:
    """Add what an event contributes that comes earlier or later: ``(F+ - R_y F- - R_theta) (g_y s + g_p) / den``.

    R is the projection on what is held after the event.

    Shapes: `shifts` (columns,).
    """
    n, now, constraint = state.n, after or state.read(theta), state.entry.constraint
    size = max(largest(before.accelerations), largest(now.accelerations))
    turned, moved = now.accelerations - before.accelerations, []
    if constraint.contacts:  # R_y F- + R_theta
        turned += constraint.impulses.dot([state.acceleration(each, before, theta) for each in constraint.contacts])
    if state.size > 2 * n:
        kept = before.extending.copy()
        for place, follows in forgotten.items():
            kept[place - 2 * n] = now.extending[place - 2 * n] if follows else 0.0
        moved = (now.extending - kept).tolist()
        size = max(size, largest(kept), largest(now.extending))
    jump = [each if abs(each) > _NOTHING * size else 0.0 for each in [*turned.tolist(), *moved]]
    if speed and any(jump):
        rows = state.rows()[:, n:]
        rows += (shifts / speed)[:, None] * jump
