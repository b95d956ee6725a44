"""The batch integrator: many trajectories of a system at moderate accuracy, for basins, sweeps and regime maps.

Trajectories are divided into blocks, the data of the kernel, which several threads advance over forcing periods. The
number of steps per period is first estimated from the system. Some periods of some trajectories are then compared with
the exact flow, and the run is repeated with more steps if its error is too large.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray

from gapwalk.ensemble.force_source import LANES, share_at, smooth_step
from gapwalk.ensemble.kernel_source import (
    HISTORY,
    Form,
    Kernel,
    Linear,
    Scheme,
    deflections_of,
    kernel_of,
    rigid_stops,
    scheme_of,
)
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import Angles, contact_force, is_at_high, stages_of
from gapwalk.model.bounds import Bounded, Counted, Natural, check_fields
from gapwalk.model.coefficients import ContactSlots, CycleSlots, coefficients_of, layout_of
from gapwalk.model.laws import Friction, Host, Stages, StageTerms
from gapwalk.model.system import System

# The start of a run of the batch integrator: what the first steps need of the time before it.
#
# A step needs the contact forces at earlier steps, so the motion is integrated backwards. Where a level of a variation
# jumps, the samples of the force around the jump are smoothed: their sum is right two steps after it. The state of the
# kernel differs from that of the motion until then. `lag` is this difference at theta = 0, where motions start and
# end.

_STEP = 1e-150  # of the complex step
_BEYOND = 1e-2  # share of its size by which a motion may begin beyond a rigid stop, as in the exact flow
_RESTS = 1e-9  # share of a clearance by which a deflection that rests on the breakpoint may miss it
_ROUNDING = 1e-9  # of the limit of friction: so close to it, an element slips
_Moves = list[tuple[NDArray[np.float64], NDArray[np.float64]]]


def history_of(linear: Linear, states: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Compute the contact forces at theta = 0 and at the steps before it, shape (HISTORY, contacts, lanes)."""
    # The motion is integrated backwards by the classical Runge-Kutta method, which is accurate enough for two steps.
    #
    # Shapes: `states` (lanes, state size).
    #
    # Dry friction keeps its mode, stick or slip, as the forces before theta = 0 only continue those after it.
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
    """Compute what `history_of` does from one step backwards, to the order of the scheme and in a fifth of the time."""
    # It is for runs of a few periods of a few hundred motions, which begin a thousand times: there the start would take
    # most of the time.
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
    """Compute the numbers of all contacts at theta = 0 that the first step needs, shape (numbers, lanes)."""
    # They are those which `gapwalk.ensemble.force_source.past_of` names.
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


def state_at_rest(system: System, near: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Return the state at rest at theta = 0, or one `near` by, shape (state_size,), moved to within all rigid stops."""
    # A prescribed displacement may carry the zero position beyond a stop. There the deflection is 0, which is within
    # the clearance of every stop.
    state, layout = np.zeros(system.state_size) if near is None else near.copy(), layout_of(system.structure)
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
            first = 0.0 if near is None else near[: system.size]
            state[: system.size] = first + np.linalg.lstsq(vectors, -offsets, rcond=None)[0]
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
    """Estimate the largest slope of the force by each deflection, shapes (1,) or (lanes,); 0 if it is not positive."""
    # A contact has all stages of one side closed, each with the slope at its breakpoint. A force without stages has the
    # median of its slopes at some states, because those of a formula far outside may be any.
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
    """Return the state of the motion less that of the kernel at theta = 0, shape (lanes, state size) or (1, ...)."""
    # It is 0 unless a level of a variation jumps a few steps before or after theta = 0. The force of the motion jumps;
    # that of the kernel is the polynomial through samples. The zeroth and the first moment of their difference over all
    # time vanish, but not those over the time before theta = 0.
    #
    # Shapes: `states` (lanes, state size).
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
    """Return moments, over the time after theta = 0, of the share of the high level less that of the kernel."""
    # Shape (3, lanes): the zeroth moment; the first; the zeroth of the share times a force that grows with the time, of
    # which the kernel interpolates the samples too. The unit of time is a step.
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
    """Compute the integrals, over the time after the start, of the polynomials that each earlier value multiplies."""
    # Shape (2, HISTORY): multiplied by 1 and by the time in steps.
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


# Input and output of the batch integrator: a batch of states with their systems, options, and results.

MOST_STEPS = 20_000
"""Steps per forcing period above which the exact flow is faster."""


@dataclass(frozen=True, eq=False)
class Batch:
    """A batch of states, each with its system."""

    #: shape (N, state size): Positions, then velocities, then extensions of Jenkins elements.
    states: NDArray[np.float64]
    systems: tuple[System, ...]  #: The different systems, of equal structure.
    places: NDArray[np.intp]  #: shape (N,): Index of the system of each state.

    @property
    def count(self) -> int:
        """Number N of states."""
        return len(self.states)

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return np.array([coefficients_of(system) for system in self.systems])

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """The coefficients of each state, shape (N, number of coefficients)."""
        return self._coefficients[self.places]

    @cached_property
    def linear(self) -> Linear:
        """The linear part: one for all if all states have the same system, otherwise one for each state."""
        shared = len(self.systems) == 1
        return Linear(layout_of(self.systems[0].structure), self._coefficients if shared else self.coefficients)

    @cached_property
    def pattern(self) -> bytes:
        """Coefficients that differ from zero in any of the systems, as bytes of an array of bool."""
        return (self._coefficients != 0).any(axis=0).tobytes()

    def system(self, lane: int) -> System:
        """Return the system of one state."""
        return self.systems[self.places[lane]]

    def some(self, lanes: NDArray[np.intp]) -> Batch:
        """Select some of the states."""
        return Batch(self.states[lanes], self.systems, self.places[lanes])


@dataclass(frozen=True, slots=True)
class BatchOptions(Bounded):
    """Accuracy and threads of the batch integrator.

    Examples
    --------
    >>> gw.parallel.BatchOptions(error=1e-6, threads=1).thread_count
    1
    """

    #: Allowed error over one forcing period. For each trajectory and period compared with the exact flow, it is the
    #: largest difference in a component of the state, relative to the largest value of that component; the root mean
    #: square of these errors is limited.
    error: Annotated[float, Ge(1e-10), Le(0.1)] = 1e-4
    #: Steps per forcing period. By default they are chosen for `error`; if given, the error is only reported.
    steps: Annotated[int, Ge(8), Le(MOST_STEPS)] | None = None
    #: Number of trajectories that are compared with the exact flow, at several times of each run.
    sample: Annotated[int, Ge(1), Le(10_000)] = 16
    #: Number of threads; by default all local cores. The result does not depend on it.
    threads: Annotated[int, Ge(1), Le(4096)] | None = None

    @property
    def thread_count(self) -> int:
        """Number of threads."""
        if self.threads is not None:
            return self.threads
        if sys.platform == "linux":
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1


@dataclass(frozen=True, eq=False)
class BatchSurvey:
    """Extremes, forces and impacts of trajectories over the last forcing periods of a run; NaN if one diverged."""

    periods: int  #: Number of surveyed forcing periods.
    #: low, high: shape (N, n): Smallest and largest value of each coordinate.
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    #: shape (N, contacts): Largest magnitude of each contact force; 0 for a rigid stop, whose impacts have no force.
    peak_force: NDArray[np.float64]
    #: shape (N, contacts, 2): Contacts per forcing period: entries into the innermost stage of each contact on the
    #: positive and on the negative side. A contact that lasts less than a step may be missed. Of the impacts of a rigid
    #: stop that follow each other within a step, the first is counted.
    impacts: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BatchRun:
    """Many trajectories after some forcing periods, at a stated accuracy."""

    #: shape (N, state size): Positions, then velocities, then extensions of Jenkins elements, at the end; NaN for
    #: trajectories that diverged.
    states: NDArray[np.float64]
    ran_away: NDArray[np.bool_]  #: shape (N,), bool: True for trajectories that diverged.
    #: shape (noted, N, state size), or None: States every so many forcing periods, if requested.
    strobes: NDArray[np.float64] | None
    survey: BatchSurvey | None  #: Extremes, contacts and largest forces, if requested.
    #: Error over one forcing period, from comparison with the exact flow on trajectories of this run; see
    #: `BatchOptions`.
    error: float
    #: The largest error of a compared trajectory and period: near-grazing and unstable motions amplify it.
    worst: float
    trials: int  #: Number of comparisons (one trajectory over one period each).
    steps: int  #: Steps per forcing period.


def batch_of(system: System, states: ArrayLike, parameters: Mapping[str, ArrayLike]) -> Batch:
    """Create a batch from states of a system, with parameters that may differ from state to state."""
    array = _states(system, states)
    columns = {name: _column(system, name, values, len(array)) for name, values in parameters.items()}
    batch = Batch(array, (system,), np.zeros(len(array), dtype=np.intp))
    if columns:
        rows, places = np.unique(np.stack(list(columns.values()), axis=1), axis=0, return_inverse=True)
        systems = tuple(system.at(dict(zip(columns, row.tolist(), strict=True))) for row in rows)
        batch = Batch(array, systems, places.reshape(-1))
    check_stops(batch.linear, array)
    return batch


def _states(system: System, states: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.array(states, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[-1] != system.state_size or not len(array) or not np.all(np.isfinite(array)):
        extensions = [f"extension of {system.structure.contacts[index].name}" for index in system.structure.memories]
        order = ", ".join([*system.coordinates, *(f"{name}'" for name in system.coordinates), *extensions])
        raise ModelError(
            f"states must be an array of finite numbers, a row for each trajectory with {system.state_size} of them "
            f"({order}), not one of shape {array.shape}"
        )
    return array


def _column(system: System, name: str, values: ArrayLike, count: int) -> NDArray[np.float64]:
    system.structure.place(name)
    try:
        column = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"{name} is {values!r}; it must be numbers, one for each trajectory") from None
    if column.shape not in ((), (count,)):
        raise ModelError(f"{name} has shape {column.shape}; there are {count} trajectories, so it must be ({count},)")
    return np.broadcast_to(column, (count,))


LIMIT = 1e12
"""Size of a state above which a motion has diverged, as in the exact flow."""
_PILOT = 64  # forcing periods of the pilot run of a few trajectories that chooses the steps
_PAYS = 4 * LANES  # number of trajectories above which a pilot run is cheaper than running all of them again
_PLENTY = 0.2  # fraction of the allowed error below which fewer steps are tried
_SEED = 1995  # of the random choice of trajectories for comparison, the same in every run
_SAMPLES = 33  # samples of an exact motion over a forcing period, which give the size of each component
_FAR = 1e-3  # fraction of the limit that an exact motion must reach if the batch integrator has exceeded the limit
_SMALL = 1e-12  # smallest scale of a component, relative to the largest component of its kind
_ORDER = 3  # order of the error, which the kinks of the forces limit
_TURN = 0.18  # radians per step of the fastest vibration for which the clutch of figure 15 has an error of 1e-4
_TURN_ERROR = 1e-4
_LEAST = 24  # fewest steps per period of the highest harmonic
_SPARE = 1.1
_MOST_AT_ONCE = 4.0
_STEPS_AT_ONCE = 50_000  # of a block, between two looks for Ctrl-C: some milliseconds


@dataclass(frozen=True)
class BatchFlow:
    """Integrator of many trajectories of one system, or of several systems of its structure; see `batch_flow_of`."""

    system: System  #: The system.
    options: BatchOptions = BatchOptions()  #: Accuracy and threads.

    def run(
        self,
        states: ArrayLike,
        periods: int,
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        every: int = 0,
        survey: int = 0,
    ) -> BatchRun:
        """Integrate trajectories from theta = 0 over some forcing periods."""
        # Shapes: `states` (N, state size).
        batch = batch_of(self.system, states, parameters or {})
        plan = _Plan(periods, every, survey)
        if self.options.steps is not None:
            return self._carry(batch, plan, self.options.steps)
        steps = first_guess(batch.linear, self.options.error, batch.states)
        if batch.count >= _PAYS:
            steps = self._pilot(batch, periods, steps)
        run = self._carry(batch, plan, steps)
        while run.error > self.options.error:  # false for nan: no comparison was possible, all diverged at once
            steps = self._finer(steps, run.error)
            run = self._carry(batch, plan, steps)
        return run

    def steps_for(self, batch: Batch, periods: int) -> int:
        """Choose the number of steps per forcing period for trajectories, on some of them and over some periods."""
        # They resolve the vibrations on closed contacts even if none closes one. It raises a FlowError as `run` does.
        return self._pilot(batch, periods, first_guess(batch.linear, self.options.error, batch.states))

    def _pilot(self, batch: Batch, periods: int, steps: int) -> int:
        """Choose a number of steps that keeps the error of a few trajectories within its limit."""
        # Those few may close no contact that others close, so that the stiffnesses of all contacts set the least
        # number.
        lanes = np.random.default_rng(_SEED).choice(batch.count, min(LANES, batch.count), replace=False)
        few, plan, too_few = batch.some(np.sort(lanes)), _Plan(min(periods, _PILOT)), 0
        least = first_guess(batch.linear, self.options.error, batch.states, alone=True)
        while True:
            error = self._carry(few, plan, steps).error
            if error > self.options.error:
                too_few, steps = steps, self._finer(steps, error)
                continue
            fewer = max(revised(steps, error, self.options.error), least)
            if not error < _PLENTY * self.options.error or not too_few < fewer < steps:
                return steps
            steps = fewer

    def _carry(self, batch: Batch, plan: _Plan, steps: int) -> BatchRun:
        """Integrate all trajectories over all periods, and compare some of them with the exact flow meanwhile."""
        block_plan = BlockPlan(batch.linear, batch.pattern, steps)
        blocks = Blocks(block_plan, batch.states, plan.noted, plan.every, bool(plan.survey), self.options.thread_count)
        random = np.random.default_rng(_SEED + 1)
        looked_at = random.choice(batch.count, min(self.options.sample, batch.count), replace=False)
        trials: list[Trial] = []
        for start, stop, look in plan.stretches():
            if plan.survey and start == plan.periods - plan.survey:
                blocks.begin_survey()
            before = blocks.states[looked_at] if look else None
            blocks.advance(stop - start)
            if before is not None:
                after = blocks.states[looked_at]
                trials += [Trial(*each) for each in zip(looked_at, before, after, strict=True)]
        trials = [trial for trial in trials if np.all(np.isfinite(trial.before))]
        gone = np.flatnonzero(blocks.left >= 0)
        nowhere, last = np.full(batch.states.shape[1], np.nan), blocks.last
        trials += [Trial(int(lane), last[lane], nowhere) for lane in gone[: self.options.sample]]
        verdict = judge(trials, batch.system, LIMIT)
        return BatchRun(
            blocks.states,
            blocks.left >= 0,
            blocks.strobes,
            blocks.survey(plan.survey) if plan.survey else None,
            verdict.error,
            verdict.worst,
            verdict.trials,
            steps,
        )

    def _finer(self, steps: int, error: float) -> int:
        """Return a larger number of steps than the one that left this error."""
        if steps < MOST_STEPS:
            return max(revised(steps, error, self.options.error), steps + 4)
        raise FlowError(
            f"the batch integrator's error is {error:.2g} with {steps} steps per forcing period, but "
            f"{self.options.error:g} was requested: the system is too stiff for it, or a large state makes impact "
            "damping very strong. Allow a larger error (BatchOptions(error=...)), or use the exact flow "
            "(gapwalk.integrate), which is faster in this case"
        )


@dataclass(frozen=True)
class BlockPlan:
    """Systems of equal structure and the number of steps for their trajectories: the input of a kernel."""

    linear: Linear  #: The systems: one for each trajectory, or one for all.
    pattern: bytes  #: Coefficients that may differ from zero.
    steps: int  #: Number of steps per forcing period.
    #: True to take less time for the start of a run; see `gapwalk.ensemble.batch_flow.extrapolated_history`.
    begins_often: bool = False

    @property
    def shared(self) -> bool:
        """True if all trajectories have the same coefficients."""
        return len(self.linear.coefficients) == 1

    def kernel(self, survey: bool) -> Kernel:
        """Return the kernel for these systems."""
        structure = self.linear.layout.structure
        return kernel_of(Form(structure, self.pattern, self.linear.basis is not None, self.shared, survey))

    @cached_property
    def scheme(self) -> Scheme:
        """The matrices and weights of one step."""
        return scheme_of(self.linear, self.steps)

    def some(self, lanes: NDArray[np.intp]) -> BlockPlan:
        """Select the systems of some trajectories; the steps are reused, not computed again."""
        part = BlockPlan(self.linear.some(lanes), self.pattern, self.steps, self.begins_often)
        part.__dict__["scheme"] = self.scheme.some(lanes)
        return part


def batch_flow_of(system: System, options: BatchOptions = BatchOptions()) -> BatchFlow:
    """Create the batch integrator of a system.

    The exact flow integrates one trajectory after the other to machine precision. The batch integrator integrates many
    at once to a chosen accuracy, about a hundred times faster, and compares a sample of each run with the exact flow.

    Parameters
    ----------
    system
        The system.
    options
        Accuracy and threads.

    Returns
    -------
    BatchFlow
        The integrator.

    Notes
    -----
    Exponential integrators: Hochbruck and Ostermann (2010), Acta Numerica 19, 209-286.

    Examples
    --------
    >>> flow = gw.parallel.batch_flow_of(system, gw.parallel.BatchOptions(error=1e-6))
    >>> flow.run(np.zeros((2, 2)), 10, parameters={"stop.clearance": [0.8, 1.2]}).states.shape
    (2, 2)
    """
    return BatchFlow(system, options)


@dataclass(frozen=True)
class _Plan:
    """The schedule of a run."""

    #: periods, every, survey: See `BatchFlow.run`.
    periods: Counted
    every: Natural = 0
    survey: Natural = 0

    def __post_init__(self) -> None:
        check_fields(self)
        if self.survey > self.periods:
            raise ModelError(f"survey is {self.survey}, but the run lasts {self.periods} forcing periods only")

    @property
    def noted(self) -> int:
        """Number of times at which all states are recorded."""
        return self.periods // self.every if self.every else 0

    def stretches(self) -> list[tuple[int, int, bool]]:
        """Return start, stop, and True for a comparison: in the first period, the last one, and two in between."""
        looks = {0, self.periods // 8, self.periods // 2, self.periods - 1}
        bounds = sorted({0, self.periods, self.periods - self.survey, *looks, *(look + 1 for look in looks)})
        return [(start, stop, start in looks and stop == start + 1) for start, stop in pairwise(bounds)]


class Blocks:
    """Trajectories in blocks of lanes; the last block is padded with copies.

    Shapes: `states` (N, state size).
    """

    def __init__(
        self, block_plan: BlockPlan, states: NDArray[np.float64], noted: int, every: int, survey: bool, threads: int
    ) -> None:
        self.block_plan, self.count, self.threads = block_plan, len(states), threads
        self._size, self._every, self._first, self._surveys = states.shape[1], every, 0, False
        self._lanes = np.minimum(np.arange(-(-self.count // LANES) * LANES), self.count - 1)
        number = len(self._lanes) // LANES
        height = max(block_plan.kernel(kind).source.height for kind in {False, survey})
        # a row between blocks of several threads: what one writes is not fetched ahead by its neighbour
        between = int(min(threads, number) > 1)
        self._data = np.zeros((number, height + between, LANES))[:, :height]
        basis, jumps = block_plan.linear.basis, bool(block_plan.linear.layout.cycles)
        states = admissible(block_plan.linear, states)
        begun = states - lag(block_plan.linear, states, block_plan.steps) if jumps else states
        modal, n2 = begun.copy(), 2 * block_plan.linear.n
        if basis is not None:
            modal[:, :n2] = np.linalg.solve(basis, begun[:, :n2, None])[:, :, 0]
        history = extrapolated_history if block_plan.begins_often else history_of
        forces = history(block_plan.linear, states, block_plan.steps).reshape(-1, self.count)
        rows = np.concatenate((modal.T, forces, past_numbers(block_plan.linear, states)))
        self._data[:, : len(rows)] = self._in_blocks(rows)
        self._record = np.full((number, noted, self._size, LANES), np.nan)
        self._left = np.full((number, LANES), -1, dtype=np.int64)
        self._last = self._data[:, : self._size].copy()
        self._stop = np.zeros(1, dtype=np.int64)

    @property
    def states(self) -> NDArray[np.float64]:
        """The present states of the trajectories, shape (N, state size); NaN for those that diverged."""
        return self._physical(self._data[:, : self._size])

    @property
    def strobes(self) -> NDArray[np.float64] | None:
        """The recorded states, shape (noted, N, state size)."""
        if not self._every:
            return None
        noted = [self._physical(self._record[:, row]) for row in range(self._record.shape[1])]
        return np.array(noted).reshape(len(noted), self.count, self._size)

    @property
    def left(self) -> NDArray[np.int64]:
        """The forcing period in which each trajectory diverged, or -1."""
        return self._left.reshape(-1)[: self.count]

    @property
    def last(self) -> NDArray[np.float64]:
        """State of each trajectory at the start of the last forcing period in which it had not diverged."""
        return self._physical(self._last)

    def begin_survey(self) -> None:
        """Start recording extremes, contacts and largest forces."""
        self._surveys = True
        rows = self.block_plan.kernel(True).source.tally_rows
        self._data[:, rows["low"] : rows["end"]] = 0.0
        self._data[:, rows["low"] : rows["high"]] = np.inf
        self._data[:, rows["high"] : rows["peak"]] = -np.inf

    def survey(self, periods: int) -> BatchSurvey:
        """Return the record of the survey, which began that many forcing periods ago."""
        source = self.block_plan.kernel(True).source
        values = self._data.transpose(0, 2, 1).reshape(-1, source.height)[: self.count].copy()
        values[self.left >= 0] = np.nan
        rows = source.tally_rows
        low, high, peak, contacts = (values[:, first:stop] for first, stop in pairwise(rows.values()))
        return BatchSurvey(periods, low, high, peak, contacts.reshape(self.count, -1, 2) / periods)

    def advance(self, periods: int) -> None:
        """Advance all trajectories over some forcing periods."""
        kernel = self.block_plan.kernel(self._surveys)
        numbers = kernel.source.numbers(self.block_plan.scheme, self.block_plan.linear)
        times = kernel.source.times(self.block_plan.scheme, self.block_plan.linear, self.block_plan.steps).ravel()

        def work(block: int, periods: Sequence[int]) -> None:
            lanes = slice(None) if self.block_plan.shared else self._lanes[block * LANES : (block + 1) * LANES]
            own = np.ascontiguousarray(numbers[:, lanes]).ravel()
            first = self._first
            for number in periods:
                kernel.advance(
                    self._data[block].reshape(-1), own, times, first, number, self.block_plan.steps, self._every,
                    self._record[block], self._left[block], self._last[block], LIMIT, self._stop,
                )  # fmt: skip
                first += number

        self._share_out(work, periods)
        self._first += periods

    def _share_out(self, work: Callable[[int, Sequence[int]], None], periods: int) -> None:
        """Process all blocks, several at a time. Ctrl-C stops them within a forcing period, or some milliseconds."""
        # What one thread does is done by this one: threads that are started for a millisecond, and waited for, have the
        # scheduler move processes about, so that two of them on two cores take as long as on one and a half.
        blocks = range(len(self._data))
        if min(self.threads, len(blocks)) == 1:
            portion = max(1, _STEPS_AT_ONCE // self.block_plan.steps)  # this thread hears of Ctrl-C between calls
            for block in blocks:
                work(block, [min(portion, periods - start) for start in range(0, periods, portion)])
            return
        with ThreadPoolExecutor(min(self.threads, len(blocks))) as pool:
            try:
                list(pool.map(lambda block: work(block, [periods]), blocks))
            except BaseException:
                self._stop[0] = 1
                raise

    def _in_blocks(self, rows: NDArray) -> NDArray[np.float64]:
        """Arrange rows of N numbers in blocks, shape (blocks, rows, LANES)."""
        return rows[:, self._lanes].reshape(len(rows), len(self._lanes) // LANES, LANES).transpose(1, 0, 2)

    def _physical(self, blocks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states in the user's coordinates, from blocks of shape (blocks, state size, LANES)."""
        states = blocks.transpose(0, 2, 1).reshape(-1, self._size)[: self.count]
        basis, n2 = self.block_plan.linear.basis, 2 * self.block_plan.linear.n
        states = states.copy()
        if basis is not None:
            states[:, :n2] = (basis @ states[:, :n2, None])[:, :, 0]
        if self.block_plan.linear.layout.cycles:
            states += lag(self.block_plan.linear, states, self.block_plan.steps)
        return states


class Trial(NamedTuple):
    """One trajectory over one forcing period."""

    lane: int  #: Index of the trajectory.
    #: before, after: shape (state size,): Its states at the start and at the end; NaN at the end if it diverged.
    before: NDArray[np.float64]
    after: NDArray[np.float64]


@dataclass(frozen=True)
class Verdict:
    """The comparison of the batch integrator with the exact flow."""

    error: float  #: Root mean square of the errors of all trials; see `BatchOptions.error`.
    worst: float  #: The largest of them.
    trials: int  #: Number of forcing periods that were compared.


def judge(trials: Sequence[Trial], system_of: Callable[[int], System], limit: float) -> Verdict:
    """Compare trials with the exact flow."""
    differences: list[NDArray[np.float64]] = []
    sizes: list[NDArray[np.float64]] = []
    false_alarms = 0
    for trial in trials:
        path = _exact(system_of(trial.lane), trial.before)
        gone = not np.all(np.isfinite(trial.after))
        if path is None or gone:
            # both diverge at about the same time, but not in the same forcing period
            far = path is None or np.abs(path).max() > _FAR * limit
            false_alarms += not far
            continue
        differences.append(np.abs(trial.after - path[-1]))
        sizes.append(np.abs(path).max(axis=0))
    if false_alarms:
        return Verdict(math.inf, math.inf, len(trials))
    if not differences:
        return Verdict(0.0, 0.0, 0)
    scale = _scale(np.array(sizes).max(axis=0), system_of(trials[0].lane).size)
    errors = (np.array(differences) / scale).max(axis=1)
    return Verdict(float(np.sqrt(np.mean(errors**2))), float(errors.max()), len(errors))


def _exact(system: System, state: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Integrate the exact motion over one forcing period, shape (samples, state size); None if it diverges."""
    try:
        return flow_of(system).sample(coefficients_of(system), state, np.linspace(0.0, PERIOD, _SAMPLES)).states
    except FlowError:
        return None


def _scale(sizes: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Return the scale of each component: its own size, or a tiny number if it does not move at all."""
    # The extension of a Jenkins element may be as large as a position.
    kinds = [sizes[:n], sizes[n : 2 * n], sizes[2 * n :]]
    least = [max(float(kind.max()) * _SMALL, np.finfo(float).tiny) for kind in kinds[:2]]
    return np.concatenate([np.maximum(kind, least[place % 2]) for place, kind in enumerate(kinds)])


def first_guess(linear: Linear, error: float, states: NDArray[np.float64], *, alone: bool = False) -> int:
    """Estimate the steps from the fastest vibration with all stages closed, at the lowest frequency of all systems."""
    # A force without stages has its slopes at the states. With `alone`, the contacts hold the masses alone: the linear
    # part is propagated exactly, however fast it vibrates.
    turns = 2.0 * math.pi * float(np.max(linear.rate * fastest(linear, states, alone)))
    steps = turns / (_TURN * (error / _TURN_ERROR) ** (1.0 / _ORDER))
    orders = [*linear.layout.orders, *(cycle.order for cycle in linear.layout.cycles)]
    return _rounded(max(steps, _LEAST * max(orders, default=1)))


def fastest(linear: Linear, states: NDArray[np.float64], alone: bool = False) -> NDArray[np.float64]:
    """Compute the spectral radius with all stages of one side closed, in radians per unit of time, shape (lanes,)."""
    n, matrix, slopes = linear.n, linear.matrix.copy(), slopes_of(linear, states)
    if alone:
        matrix[:, n:] = 0.0
    for place, (contact, _) in enumerate(deflections_of(linear.layout)):
        row = linear.deflections[:, 0, place, None, :n]
        matrix[:, n:, :n] += slopes[place][:, None, None] * linear.push[:, n:, contact, None] * row
    return np.abs(np.linalg.eigvals(matrix)).max(axis=1)


def _rounded(steps: float) -> int:
    return int(min(4 * math.ceil(steps / 4), MOST_STEPS))


def revised(steps: int, error: float, allowed: float) -> int:
    """Estimate the steps that reach the allowed error, from the measured error; it is inf if the motion was lost."""
    factor = _SPARE * (error / allowed) ** (1.0 / _ORDER) if math.isfinite(error) else _MOST_AT_ONCE
    return max(_rounded(steps * min(factor, _MOST_AT_ONCE)), 8)
