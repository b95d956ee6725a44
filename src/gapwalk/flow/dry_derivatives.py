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

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.dry_state import DryState, Readings
from gapwalk.flow.forces import Angles, Dry, balance, contact_forces, stages_of
from gapwalk.model.laws import Host

_NOTHING = 1e-13  # share of the accelerations below which their jump is rounding
_STEP = 1e-150  # of the complex step

Array = NDArray[np.float64]


def rate_changes(state: DryState, contact: int, theta: float) -> Array:
    """Return the change, along each column, of the rate of a deflection, less that of its base."""
    slots, part = state.layout.contacts[contact], slice(state.n, 2 * state.n)
    changes = state.rows()[:, part] @ state.base[slots.deflection]
    if len(directions := state.directions):
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
    changes = state.rows()[:, : state.n] @ state.base[slots.deflection]
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
    slots, law, along = state.slots[place], state.laws[place], state.along()
    if law.by == "limit" and not slots.varies:
        limit, stiffness = (float(state.base[slots.numbers[name]]) for name in ("limit", "stiffness"))
        by_limit, by_stiffness = (along[:, slots.numbers[name]] for name in ("limit", "stiffness"))
        return by_limit / stiffness - limit * by_stiffness / stiffness**2
    step, found = 1j * _STEP, []
    for row, change in zip(state.rows(), along, strict=True):
        coefficients = state.base + step * change
        angles = Angles(state.layout, coefficients, theta)
        stages = stages_of(slots, angles, [(0.0, 0.0)])
        if law.host:
            stages.host = _host(state, place, coefficients, angles, state.state[: state.size] + step * row)
        numbers = angles.named(slots.numbers, slots.waves)
        found.append(complex(law.limit(stages, numbers) / numbers["stiffness"]).imag / _STEP)
    return np.array(found)


def margin_changes(state: DryState, place: int, now: Readings, theta: float) -> tuple[Array, float]:
    """Return the change of a reaction less its bound along each column, and its rate over time."""
    slots, law, n, layout, step = state.slots[place], state.laws[place], state.n, state.layout, 1j * _STEP
    number = state.reaction_of[place]
    assert number is not None
    side = 1.0 if now.reactions[number] > 0.0 else -1.0

    def margin(y: NDArray, coefficients: NDArray, angle: Any) -> Any:
        held, angles = Constraint(layout, coefficients, state.held).coefficients(), Angles(layout, coefficients, angle)
        dry, q, v = Dry(np.array(state.slips, dtype=float), y[2 * n :]), y[:n], y[n : 2 * n]
        forces = contact_forces(layout, coefficients, angle, q, v, state.closed, angles, dry)
        reaction = balance(held[layout.reactions[[number]]], q, v, forces, angles.waves)[0]
        stages = stages_of(slots, angles, [(0.0, 0.0)])
        if law.host:
            stages.host = _host(state, place, coefficients, angles, y)
        return side * reaction - law.breakaway(stages, angles.named(slots.numbers, slots.waves))

    y, base = state.state[: state.size], state.base
    shifts = [
        complex(margin(y + step * row, base + step * along, theta)).imag / _STEP
        for row, along in zip(state.rows(), state.along(), strict=True)
    ]
    rates = np.concatenate((now.velocities, now.accelerations, now.extending))
    moved = margin(y + step * rates, base.astype(complex), theta + step / float(base[0]))
    return np.array(shifts), complex(moved).imag / _STEP


def _host(state: DryState, place: int, coefficients: NDArray, angles: Angles, y: NDArray) -> Host:
    """Return the host of friction at a state, real or complex, with the present modes of its stages."""
    host, n = state.layout.structure.host(state.equations.dry[place]), state.n
    assert host is not None
    slots = state.layout.contacts[host]
    vector = coefficients[slots.deflection]
    moves = [(y[:n] @ vector + angles.sway(slots), y[n : 2 * n] @ vector + angles.sway(slots, 0, 1))]
    stages = stages_of(slots, angles, moves, state.closed[host])
    return Host(stages, slots.form.law.force(moves[0][1], stages, angles.named(slots.numbers, slots.waves)))


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
    stops = [place for place, number in enumerate(constraint.independent) if number in state.sign_of]
    if state.columns:
        rows = state.rows()
        rates = np.array([rate_changes(state, contact, theta) for contact in constraint.contacts])
        if stops:
            depths = np.array([depth_changes(state, constraint.independent[place], theta) for place in stops])
            moved = -depths.T @ constraint.impulses[:, stops].T
            rows[:, :n] += moved
            rows[:, n : 2 * n] += _dragged(state, moved, theta)
            for slots, memory in zip(state.slots, state.memory_of, strict=True):
                if memory is not None:
                    rows[:, memory] += moved @ state.base[slots.deflection]
        rows[:, n : 2 * n] -= rates.T @ constraint.impulses.T
    for place, contact in enumerate(constraint.contacts):
        slots = state.layout.contacts[contact]
        rate = float(constraint.vectors[place] @ y[n : 2 * n])
        if slots.sway is not None:
            rate += float(Angles(state.layout, state.base, theta).sway(slots, 0, 1))
        rate -= float(state.base[slots.numbers["speed"]]) if "speed" in slots.numbers else 0.0
        y[n : 2 * n] -= rate * constraint.impulses[:, place]
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

    Parameters
    ----------
    state
        The state after the event.
    before
        The values before the event; those after it are those of now.
    theta
        The angle.
    shifts : shape (columns,)
        Change of the guard along each column.
    speed
        Rate of the guard over time before the event.
    forgotten
        Places of the state that the event resets: to a constant, or (True) to a limit that they follow.
    after
        The values after the event, if they are known.
    """
    n, now = state.n, after or state.read(theta)
    size = max(float(np.abs(each.accelerations).max()) for each in (before, now))
    jump, constraint = np.zeros(state.size), state.entry.constraint
    jump[n : 2 * n] = now.accelerations - before.accelerations
    for place, contact in enumerate(constraint.contacts):  # R_y F- + R_theta
        jump[n : 2 * n] += constraint.impulses[:, place] * state.acceleration(contact, before, theta)
    if state.size > 2 * n:
        kept = before.extending.copy()
        for place, follows in forgotten.items():
            kept[place - 2 * n] = now.extending[place - 2 * n] if follows else 0.0
        jump[2 * n :] = now.extending - kept
        size = max(size, float(np.abs(kept).max()), float(np.abs(now.extending).max()))
    jump[np.abs(jump) <= _NOTHING * size] = 0.0
    if speed and jump.any():
        state.rows()[:] += np.outer(shifts / speed, jump)
