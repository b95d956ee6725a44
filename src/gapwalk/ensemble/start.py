"""The start of a run of the batch integrator: what the first steps need of the time before it.

A step needs the contact forces at earlier steps, so the motion is integrated backwards. Where a level of a variation
jumps, the samples of the force around the jump are smoothed: their sum is right two steps after it. The state of the
kernel differs from that of the motion until then. `lag` is this difference at theta = 0, where motions start and end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.kernel_source import HISTORY, Linear, deflections_of, rigid_stops
from gapwalk.ensemble.source_text import share_at, smooth_step
from gapwalk.errors import ModelError
from gapwalk.flow.forces import Angles, contact_force, is_at_high, stages_of
from gapwalk.model.coefficients import ContactSlots, CycleSlots, coefficients_of, layout_of
from gapwalk.model.laws import Friction, Host, Stages, StageTerms
from gapwalk.model.system import System

_STEP = 1e-150  # of the complex step
_BEYOND = 1e-2  # share of its size by which a motion may begin beyond a rigid stop, as in the exact flow
_RESTS = 1e-9  # share of a clearance by which a deflection that rests on the breakpoint may miss it
_ROUNDING = 1e-9  # of the limit of friction: so close to it, an element slips
_Moves = list[tuple[NDArray[np.float64], NDArray[np.float64]]]


def history_of(linear: Linear, states: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Compute the contact forces at theta = 0 and at the steps before it, shape (HISTORY, contacts, lanes).

    The motion is integrated backwards by the classical Runge-Kutta method, which is accurate enough for two steps.

    Shapes: `states` (lanes, state size).

    Notes
    -----
    Dry friction keeps its mode, stick or slip, as the forces before theta = 0 only continue those after it.
    """
    turn = -2.0 * np.pi / steps
    h = (turn * linear.rate)[:, None]
    levels: list[Any] = [is_at_high(cycle, linear.coefficients, 0.0) * 1.0 for cycle in linear.layout.cycles]
    slips = slips_of(linear, states)
    forces = [_contact_forces(linear, 0.0, states, _shares(linear, 0.0, steps), slips)]
    for number in range(HISTORY - 1):
        theta = number * turn
        k1 = _slopes(linear, theta, states, levels, slips)
        k2 = _slopes(linear, theta + turn / 2, states + h / 2 * k1, levels, slips)
        k3 = _slopes(linear, theta + turn / 2, states + h / 2 * k2, levels, slips)
        k4 = _slopes(linear, theta + turn, states + h * k3, levels, slips)
        states = states + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        forces.append(_contact_forces(linear, theta + turn, states, _shares(linear, theta + turn, steps), slips))
    return np.array(forces).transpose(0, 2, 1)


def extrapolated_history(linear: Linear, states: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Compute what `history_of` does from one step backwards, to the order of the scheme and in a fifth of the time.

    It is for runs of a few periods of a few hundred motions, which begin a thousand times: there the start would take
    most of the time.
    """
    turn = -2.0 * np.pi / steps
    levels: list[Any] = [is_at_high(cycle, linear.coefficients, 0.0) * 1.0 for cycle in linear.layout.cycles]
    slips = slips_of(linear, states)
    now = _contact_forces(linear, 0.0, states, _shares(linear, 0.0, steps), slips)
    states = states + (turn * linear.rate)[:, None] * _slopes(
        linear, 0.0, states, levels, slips, None if levels else now
    )
    before = _contact_forces(linear, turn, states, _shares(linear, turn, steps), slips)
    return np.array([now + number * (before - now) for number in range(HISTORY)]).transpose(0, 2, 1)


def _shares(linear: Linear, theta: float, steps: int) -> list[NDArray[np.float64]]:
    return [share_at(linear.coefficients, cycle, theta, steps) for cycle in linear.layout.cycles]


def past_numbers(linear: Linear, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the numbers of all contacts at theta = 0 that the first step needs, shape (numbers, lanes).

    They are those which `gapwalk.ensemble.force_source.past_of` names.
    """
    angles, found = Angles(linear.layout, linear.coefficients, 0.0), []
    moved = _moves(linear, angles, states)
    for index, (slots, moves) in enumerate(zip(linear.layout.contacts, moved, strict=True)):
        law = slots.form.law
        numbers = angles.named(slots.numbers, slots.waves)
        if law.is_dry:
            host = linear.layout.structure.host(index)
            limit, rate = _limit(linear, index, angles, moved), moves[0][1] - numbers["speed"]
            found += [moves[0][0], rate, limit / numbers["stiffness"], *([] if host is None else [moved[host][0][0]])]
        elif law.rebounds:
            found.append(np.zeros(len(states)))
        elif law.mode_count:
            with np.errstate(all="ignore"):
                guards = law.guards(moves[0][1], stages_of(slots, angles, moves), numbers)
            found += guards
    return np.array([np.broadcast_to(each, len(states)) for each in found]).reshape(len(found), len(states))


def check_stops(linear: Linear, states: NDArray[np.float64]) -> None:
    """Refuse states at theta = 0 that are beyond a rigid stop."""
    for slots, beyond, lanes in _beyond_stops(linear, states):
        if len(lanes):
            raise ModelError(
                f"state {lanes[0]} is {beyond[lanes[0]]:.3g} beyond the rigid stop {slots.form.name!r}, and "
                f"{len(lanes)} of {len(states)} states are beyond it; begin them where the deflection is within "
                "the clearance"
            )


def within_stops(system: System, states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the states at theta = 0, shape (count, state_size), that are not beyond a rigid stop."""
    linear, found = Linear(layout_of(system.structure), coefficients_of(system)[None]), np.ones(len(states), dtype=bool)
    for _, _, lanes in _beyond_stops(linear, states):
        found[lanes] = False
    return found


def closed_in(linear: Linear, states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the contacts that are closed, or rest on a breakpoint, at theta = 0, shape (count, contacts)."""
    moved = _moves(linear, Angles(linear.layout, linear.coefficients, 0.0), states)
    closed = np.zeros((len(states), len(moved)), dtype=bool)
    for index, slots in enumerate(linear.layout.contacts):
        for stage in (stage for stage in slots.stages if stage.innermost):
            x, clearance = stage.sign * moved[index][0][0], linear.coefficients[:, stage.clearance]
            closed[:, index] |= x >= clearance - _RESTS * np.maximum(np.abs(x), np.abs(clearance))
    return closed


def state_at_rest(system: System) -> NDArray[np.float64]:
    """Return the state at rest at theta = 0, shape (state_size,): zeros, or as near to them as rigid stops allow.

    A prescribed displacement may carry the zero position beyond a stop. There the deflection is 0, which is within the
    clearance of every stop.
    """
    state, layout = np.zeros(system.state_size), layout_of(system.structure)
    if not any(slots.form.law.rebounds for slots in layout.contacts):
        return state
    coefficients = coefficients_of(system)
    linear, held = Linear(layout, coefficients[None]), list[int]()
    moved = _moves(linear, Angles(layout, linear.coefficients, 0.0), state[None])
    for _ in layout.contacts:
        beyond = [slots for slots, _, lanes in _beyond_stops(linear, state[None]) if len(lanes)]
        held += [index for index, slots in enumerate(layout.contacts) if slots in beyond and index not in held]
        if beyond:
            vectors = coefficients[[layout.contacts[index].deflection for index in held]]
            offsets = np.array([float(np.squeeze(moved[index][0][0])) for index in held])
            state[: system.size] = np.linalg.lstsq(vectors, -offsets, rcond=None)[0]
    return state


def _beyond_stops(
    linear: Linear, states: NDArray[np.float64]
) -> Iterator[tuple[ContactSlots, NDArray[np.float64], NDArray[np.intp]]]:
    """Yield each side of a rigid stop: its contact, how far all states are beyond it, and those that are too far."""
    stops = rigid_stops(linear.layout)
    angles = Angles(linear.layout, linear.coefficients, 0.0)
    moved = _moves(linear, angles, states) if stops else []
    size = np.abs(states[:, : linear.n]).max(axis=1)
    for index in stops:
        slots = linear.layout.contacts[index]
        for stage in slots.stages:
            clearance = linear.coefficients[:, stage.clearance]
            beyond = stage.sign * moved[index][0][0] - clearance
            lanes = np.flatnonzero(beyond > _BEYOND * (clearance + size))
            if stage.innermost:
                yield slots, beyond, lanes


def admissible(linear: Linear, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return states at theta = 0 with the extensions of all Jenkins elements within their limits."""
    if not linear.layout.structure.memories:
        return states
    angles, states = Angles(linear.layout, linear.coefficients, 0.0), states.copy()
    moved = _moves(linear, angles, states)
    for place, index in enumerate(linear.layout.structure.memories, start=2 * linear.n):
        slots = linear.layout.contacts[index]
        most = _limit(linear, index, angles, moved) / angles.named(slots.numbers, slots.waves)["stiffness"]
        states[:, place] = np.clip(states[:, place], -most, most)
    return states


def slips_of(linear: Linear, states: NDArray[np.float64]) -> dict[int, NDArray[np.float64]]:
    """Return the mode of each Jenkins element at theta = 0, shape (lanes,): 1 or -1 in slip, 0 in stick."""
    angles, found = Angles(linear.layout, linear.coefficients, 0.0), {}
    moved = _moves(linear, angles, states)
    for place, index in enumerate(linear.layout.structure.memories, start=2 * linear.n):
        slots = linear.layout.contacts[index]
        numbers, extension = angles.named(slots.numbers, slots.waves), states[:, place]
        rate, limit = moved[index][0][1] - numbers["speed"], _limit(linear, index, angles, moved)
        full = numbers["stiffness"] * np.abs(extension) >= limit * (1.0 - _ROUNDING)
        found[index] = np.where(full & (extension * rate >= 0.0), np.where(rate < 0.0, -1.0, 1.0), 0.0)
    return found


def _limit(linear: Linear, index: int, angles: Angles, moved: list[_Moves]) -> NDArray[np.float64]:
    """Compute the limit of friction."""
    slots, host = linear.layout.contacts[index], linear.layout.structure.host(index)
    law, stages = slots.form.law, Stages([])
    assert isinstance(law, Friction)
    if host is not None:
        hosting = linear.layout.contacts[host]
        pressed = stages_of(hosting, angles, moved[host])
        stages.host = Host(pressed, contact_force(hosting, angles, moved[host]))
    return np.maximum(law.limit(stages, angles.named(slots.numbers, slots.waves)), 0.0)


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
        if slots.form.law.has_memory:
            found.append(linear.coefficients[:, slots.numbers["stiffness"]])
            continue
        if slots.form.law.is_dry:  # its force does not depend on the deflection
            found.append(np.zeros(1))
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
    moved = np.einsum("lakz,lz->akl", linear.deflections, states[:, : 2 * linear.n])
    found: list[_Moves] = [[] for _ in linear.layout.contacts]
    for place, (contact, argument) in enumerate(deflections_of(linear.layout)):
        slots = linear.layout.contacts[contact]
        x, rate = (moved[which, place] + angles.sway(slots, argument, which) for which in (0, 1))
        found[contact].append((x, rate))
    return found


def _contact_forces(
    linear: Linear,
    theta: float,
    states: NDArray[np.float64],
    levels: list[Any],
    slips: Mapping[int, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Compute contact forces from their definition, shape (lanes, contacts), each lane with its own coefficients."""
    angles = Angles(linear.layout, linear.coefficients, theta, levels)
    moved, forces = _moves(linear, angles, states), []
    for index, (slots, moves) in enumerate(zip(linear.layout.contacts, moved, strict=True)):
        law = slots.form.law
        if not isinstance(law, Friction):
            with np.errstate(all="ignore"):  # a formula may overflow far outside
                forces.append(contact_force(slots, angles, moves))
            continue
        numbers, place = angles.named(slots.numbers, slots.waves), linear.layout.structure.memories.index(index)
        strained = numbers["stiffness"] * states[:, 2 * linear.n + place]
        limit = _limit(linear, index, angles, moved)
        forces.append(np.where(slips[index] == 0.0, strained, slips[index] * limit))
    forces = [np.broadcast_to(force, len(states)) for force in forces]
    return np.stack(forces, axis=1) if forces else np.zeros((len(states), 0))


def _slopes(
    linear: Linear,
    theta: float,
    states: NDArray[np.float64],
    levels: list[Any],
    slips: Mapping[int, NDArray[np.float64]],
    forces: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Compute the time derivatives of the states, shape (lanes, state size), with contact forces if they are known."""
    forces = _contact_forces(linear, theta, states, levels, slips) if forces is None else forces
    orders = theta * np.array(linear.layout.orders, dtype=float)
    basis = np.ones(linear.loads.shape[2])
    basis[1::2], basis[2::2] = np.cos(orders), np.sin(orders)
    found = (
        np.einsum("lij,lj->li", linear.matrix, states[:, : 2 * linear.n])
        + np.einsum("lik,lk->li", linear.push, forces)
        + linear.loads @ basis
    )
    if not slips:
        return found
    angles = Angles(linear.layout, linear.coefficients, theta, levels)
    moved, rates = _moves(linear, angles, states), []
    for index, slip in slips.items():
        speed = linear.coefficients[:, linear.layout.contacts[index].numbers["speed"]]
        rates.append((slip == 0.0) * (moved[index][0][1] - speed))
    return np.hstack((found, np.stack(rates, axis=1)))


def lag(linear: Linear, states: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return the state of the motion less that of the kernel at theta = 0, shape (lanes, state size) or (1, ...).

    It is 0 unless a level of a variation jumps a few steps before or after theta = 0. The force of the motion jumps;
    that of the kernel is the polynomial through samples. The zeroth and the first moment of their difference over all
    time vanish, but not those over the time before theta = 0.

    Shapes: `states` (lanes, state size).
    """
    total = np.zeros((1, states.shape[1]))
    own, slips = 2 * linear.n, slips_of(linear, states)
    shares, h = _shares(linear, 0.0, steps), (2.0 * np.pi / steps * linear.rate)[:, None]
    for number, cycle in enumerate(linear.layout.cycles):
        zeroth, first, sampled = (each[:, None] for each in _later_moments(cycle, linear.coefficients, steps))
        if not np.any(zeroth) and not np.any(first):
            continue
        high, low = ([*shares[:number], level, *shares[number + 1 :]] for level in (1.0, 0.0))

        def jump(theta: float, states: NDArray[np.float64], high: list[Any] = high, low: list[Any] = low) -> Any:
            forces = _contact_forces(linear, theta, states, high, slips) - _contact_forces(
                linear, theta, states, low, slips
            )
            return np.einsum("lik,lk->li", linear.push, forces)

        now, later = (
            jump(0.0, states),
            jump(2.0 * np.pi / steps, states + h * _slopes(linear, 0.0, states, shares, slips)),
        )
        turned = h * np.einsum("lij,lj->li", linear.matrix, now)
        change = h * (first * turned - sampled * (later - now) - zeroth * now)
        total = total + np.pad(change, ((0, 0), (0, states.shape[1] - own)))
    return total


def _later_moments(cycle: CycleSlots, coefficients: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return moments, over the time after theta = 0, of the share of the high level less that of the kernel.

    Shape (3, lanes): the zeroth moment; the first; the zeroth of the share times a force that grows with the time, of
    which the kernel interpolates the samples too. The unit of time is a step.
    """
    per_radian, length = steps / (2.0 * np.pi), 2.0 * np.pi / cycle.order
    # sums of 1 and of i over all i >= 1 exceed the integrals from 0 on by zeta(0) and zeta(-1)
    total, weights = np.zeros((3, len(coefficients))), np.stack((*_MOMENTS, -np.arange(HISTORY) * _MOMENTS[0]))
    ahead, behind = np.arange(1.0, 5.0)[:, None], -np.arange(0.0, HISTORY)[:, None]
    for slot, sign in ((cycle.up, 1.0), (cycle.down, -1.0)):
        angle = coefficients[:, slot]
        # place of the jump, in steps from theta = 0
        t = (angle - length * np.round(angle / length)) * per_radian
        missing, early = (smooth_step(each - t, lambda u: np.clip(u, 0.0, 1.0)) for each in (ahead, behind))
        missing, early = missing - 1.0, early - (t <= 0.0)
        found = -np.stack((np.ones_like(ahead), ahead, ahead))[:, :, 0] @ missing - weights @ early
        found += np.where(t > 0.0, np.stack((0.5 - t, 1.0 / 12.0 - t**2 / 2.0, 1.0 / 12.0 - t**2 / 2.0)), 0.0)
        total += sign * np.where((t > -4.0) & (t < 2.0), found, 0.0)
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


_MOMENTS = _moments()
