"""Contact forces and accelerations evaluated from coefficients and states, one or many at a time.

All functions accept complex numbers too, for derivatives by a complex step: the real part decides on which side of a
breakpoint a deflection lies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.equations import Equations
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, CycleSlots, Wave
from gapwalk.model.laws import Host, Stages, StageTerms
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS
from gapwalk.taylor.integrator import Evaluator
from gapwalk.taylor.symbols import ANGLE, ZERO, Symbol, parameter, parameters_of, replaced, variable

# Compiled functions of a state by which friction and held stops are decided, and derivatives of them.

Array = NDArray[np.float64]


class CompiledReadings:
    """The compiled readings of some equations, which all their integrators share, and derivatives of them."""

    def __init__(self, equations: Equations) -> None:
        self._equations = equations
        self._tables = b"", dict[tuple[int, ...], Array]()  # the last system, and its tables by what is held
        self.state = [*equations.positions, *equations.velocities, *equations.extensions]
        self.readings, self.used = self._of_one_array(
            [*self.state[: 2 * equations.layout.structure.size], *equations.readings], self.state
        )
        """The readings, and the run-time parameters on which they depend."""
        memories = equations.layout.structure.memories
        self.follows = any(equations.creep(contact) is not ZERO for contact in memories)
        """True if a spring follows a limit that is not constant: its rate depends on the modes of all friction."""

    @staticmethod
    def _of_one_array(functions: list[Symbol], variables: list[Symbol]) -> tuple[Evaluator, slice]:
        """Return functions of some variables, the angle and parameters, in one array; and which parameters."""
        used = set[int]().union(*map(parameters_of, functions))
        places = range(min(used, default=0), max(used, default=-1) + 1)
        angle, numbers = variable("angle"), {parameter(k): variable(f"number{k}") for k in places}
        given = replaced(functions, {ANGLE: angle, **numbers})
        return Evaluator(given, [*variables, angle, *numbers.values()]), slice(places.start, places.stop)

    @cached_property
    def decisions(self) -> tuple[Any, slice]:
        """The function of `Equations.decisions`, and the run-time parameters on which it depends."""
        return self._of_one_array(self._equations.decisions, self.state)

    @cached_property
    def _is_plain(self) -> bool:
        """True if deflections alone decide which stages are closed, and nothing else has a mode."""
        layout = self._equations.layout
        varies = any(slots.sway is not None or any(stage.waves for stage in slots.stages) for slots in layout.contacts)
        return not (self._equations.modes or layout.cycles or self._equations.formulas or varies)

    def along(self, coefficients: Array, states: Array, thetas: Array, slips: Array) -> Array | None:
        """Return the columns of the accelerations, then `Readings.friction` of all contacts, at samples of a motion."""
        # Shapes: `states`, `thetas` (samples, state_size), (samples,); `slips` (contacts that are friction,).
        if not self._is_plain:
            return None
        equations, n, size = self._equations, self._equations.layout.structure.size, states.shape[1]
        numbers = np.zeros(equations.first_coefficient + len(equations.active))
        numbers[equations.first_slip : equations.first_slip + len(slips)] = slips
        numbers[equations.first_stick : equations.first_stick + len(slips)] = slips == 0
        numbers[equations.length] = 1.0
        numbers[equations.first_coefficient :] = coefficients[equations.active]
        given = np.empty((size + 1 + self.used.stop - self.used.start, len(states)))
        given[:size], given[size], given[size + 1 :] = states.T, thetas, numbers[self.used][:, None]
        first = size + 1 - self.used.start + equations.first_switch
        for row, (contact, place) in enumerate(equations.switches, start=first):
            if size < row < len(given):
                slots = equations.layout.contacts[contact]
                stage = slots.stages[place]
                deflections = states[:, :n] @ coefficients[slots.deflection]
                given[row] = stage.sign * deflections > coefficients[stage.clearance]
        return self.readings(given)[: equations.layout.accelerations.shape[1] + 3 * len(slips)].T

    def slipping(self, columns: Array, slips: NDArray[Any]) -> Array:
        """Return the columns of `along` for other modes: rigid friction that slips has the force of its limit."""
        found, structure = columns.copy(), self._equations.layout.structure
        first = 2 * structure.size
        limits = columns.shape[1] - 3 * len(slips) + 1
        for place, contact in enumerate(structure.friction):
            if contact not in structure.memories:
                found[:, first + contact] = slips[place] * columns[:, limits + 3 * place]
        return found

    def table(self, coefficients: Array, held: Sequence[int]) -> Array:
        """Return the rows by which accelerations, then reactions, follow from the columns of `along`."""
        numbers, key = coefficients[1:].tobytes(), tuple(held)
        known, tables = self._tables
        if known != numbers:
            self._tables = _, tables = numbers, {}
        if key not in tables:
            layout = self._equations.layout
            own = Constraint(layout, coefficients, held).coefficients()
            found = np.vstack((own[layout.accelerations], own[layout.reactions]))
            found[:, : 2 * layout.structure.size + len(layout.contacts)] *= -1.0
            tables[key] = found
        return tables[key]

    @cached_property
    def _tangents(self) -> tuple[Evaluator, slice]:
        variables, functions = self._equations.tangents
        return self._of_one_array(functions, variables)

    def tangents(self, state: Array, parameters: Array, theta: float, changes: Sequence[Array]) -> Array:
        """Return the derivatives of what the accelerations consist of, and of the limits, along some changes."""
        function, used = self._tangents
        numbers = parameters[used]
        given = [np.concatenate((state, each, [theta], numbers)) for each in changes]
        return function(np.array(given).T).T


class Angles:
    """The angle of the excitation, one or many, with what varies over it.

    Shapes: `coefficients` (..., number of coefficients).
    """

    def __init__(
        self,
        layout: CoefficientLayout,
        coefficients: NDArray,
        theta: NDArray | float,
        levels: Sequence[Any] | None = None,
        unit: float = 1.0,
    ) -> None:
        self.unit = unit
        self.layout, self.coefficients, self.theta = layout, coefficients, np.asarray(theta)
        self._levels = levels

    @cached_property
    def _orders(self) -> NDArray[np.float64]:
        return np.array(self.layout.orders, dtype=float)

    @cached_property
    def waves(self) -> NDArray:
        """Cosines, then sines, of all orders, shape (..., 2 orders)."""
        angles = np.multiply.outer(self.theta, self._orders)
        return np.concatenate((np.cos(angles), np.sin(angles)), axis=-1)

    def wave(self, wave: Wave, derivative: int = 0) -> NDArray:
        """Return the variation of a number, or a derivative of it by theta, shape (...)."""
        lines, count = self.coefficients[..., wave.lines], len(self._orders)
        for _ in range(derivative):
            cosines, sines = lines[..., :count], lines[..., count:]
            lines = np.concatenate((sines * self._orders, -cosines * self._orders), axis=-1)
        total = np.sum(lines * self.waves, axis=-1)
        for number, factor in wave.cycles:
            cycle = self.layout.cycles[number]
            low, high = self.coefficients[..., cycle.low], self.coefficients[..., cycle.high]
            share = is_at_high(cycle, self.coefficients, self.theta) if self._levels is None else self._levels[number]
            total = total + factor * (low + (high - low) * share) * (derivative == 0)
        return total

    def sway(self, slots: ContactSlots, argument: int = 0, derivative: int = 0) -> NDArray | float:
        """Return the displacement that is added to a deflection, or a derivative of it over time; else 0."""
        wave = slots.waves.get(slots.form.law.arguments[argument])
        if wave is None:
            return 0.0
        return self.wave(wave, derivative) / self.coefficients[..., 0] ** derivative

    def value(self, slot: int) -> NDArray:
        """Return a number of a law."""
        return self.coefficients[..., slot]

    def named(self, numbers: Mapping[str, int], waves: Mapping[str, Wave]) -> dict[str, NDArray]:
        """Return the values of some parameters by name."""
        values = {name: self.value(slot) for name, slot in numbers.items()}
        return values | {name: values[name] * (1.0 + self.wave(wave)) for name, wave in waves.items() if name in values}


class Dry(NamedTuple):
    """Modes and states of dry friction, of one motion or of many instants."""

    #: shape (..., contacts that are friction): 1 or -1 in slip, 0 in stick; None: friction slips by the sign of its
    #: rate.
    slips: NDArray | None
    extensions: NDArray  #: shape (..., contacts with a memory): Their own states.


def is_at_high(cycle: CycleSlots, coefficients: NDArray, theta: NDArray | float) -> NDArray[np.bool_]:
    """Return True where a cycle of two levels is at the high one."""
    length = 2.0 * np.pi / cycle.order
    up, down = np.real(coefficients[..., cycle.up]), np.real(coefficients[..., cycle.down])
    return (np.real(theta) - up) % length < down - up


def contact_deflections(
    layout: CoefficientLayout, coefficients: NDArray, theta: NDArray | float, q: NDArray, derivative: int = 0
) -> NDArray:
    """Return the first deflection of each contact, shape (..., contacts), for positions of shape (..., n)."""
    # The derivative 1 is its rate over time, for velocities in place of positions.
    if not layout.contacts:
        return np.zeros((*q.shape[:-1], 0))
    angles = Angles(layout, coefficients, theta)
    return np.stack(
        [q @ coefficients[slots.deflection] + angles.sway(slots, 0, derivative) for slots in layout.contacts], axis=-1
    )


def contact_forces(
    layout: CoefficientLayout,
    coefficients: NDArray,
    theta: NDArray | float,
    q: NDArray,
    v: NDArray,
    closed: Sequence[Sequence[bool] | None] | None = None,
    angles: Angles | None = None,
    dry: Dry | None = None,
) -> NDArray:
    """Return the contact forces ``f_k``, shape (..., contacts), for positions and velocities of shape (..., n)."""
    # `closed` is as in `contact_force`; `angles` replaces `theta` if it is known already. Friction that sticks rigidly
    # has no force of its own: its reaction is among the accelerations. Without `dry`, friction slips by the sign of its
    # rate, and springs in series with it have no extension.
    angles, forces, structure = angles or Angles(layout, coefficients, theta), [], layout.structure
    moves, friction = [], 0
    for slots in layout.contacts:
        rows = [coefficients[vector] for vector in slots.deflections]
        moves.append(
            [
                (q @ row + angles.sway(slots, place), v @ row + angles.sway(slots, place, 1))
                for place, row in enumerate(rows)
            ]
        )
    for index, slots in enumerate(layout.contacts):
        own = None if closed is None else closed[index]
        if not slots.form.law.is_dry:
            forces.append(contact_force(slots, angles, moves[index], own))
            continue
        stages = stages_of(slots, angles, moves[index], own)
        if (host := structure.host(index)) is not None:
            outside = layout.contacts[host]
            shut = None if closed is None else closed[host]
            stages.host = Host(
                stages_of(outside, angles, moves[host], shut), contact_force(outside, angles, moves[host], shut)
            )
        rate = moves[index][0][1] - coefficients[..., slots.numbers["speed"]]
        slips = None if dry is None else dry.slips
        stages.slip = np.sign(np.real(rate)) if slips is None else slips[..., friction]
        if index in structure.memories:
            place = structure.memories.index(index)
            stages.extension = 0.0 if dry is None else dry.extensions[..., place]
        friction += 1
        forces.append(slots.form.law.force(rate, stages, angles.named(slots.numbers, slots.waves)))
    found = np.empty((*q.shape[:-1], len(forces)), np.result_type(float, *forces))
    for index, force in enumerate(forces):  # a law may leave all of its force out, as where a stop only rebounds
        found[..., index] = force
    return found


def contact_force(
    slots: ContactSlots, angles: Angles, moves: Sequence[tuple[NDArray, NDArray]], closed: Sequence[bool] | None = None
) -> NDArray:
    """Compute the force of one contact by its law."""
    law, unit = slots.form.law, angles.unit
    if law.rebounds:
        return 0.0 * moves[0][1]
    if law.is_formula and unit != 1.0:  # the law may be any formula of lengths
        moves = [(x * unit, rate * unit) for x, rate in moves]
    stages = stages_of(slots, angles, moves, closed)
    force = law.force(moves[0][1], stages, angles.named(slots.numbers, slots.waves))
    return force / unit if law.is_formula else force


class Named(Protocol):
    """A source of the values of parameters at an angle, as `Angles` is."""

    def named(self, numbers: Mapping[str, int], waves: Mapping[str, Wave]) -> dict[str, Any]:
        """Return the values of some parameters by name."""
        ...


def stages_of(
    slots: ContactSlots,
    angles: Named,
    moves: Sequence[tuple[Any, Any]],
    closed: Sequence[bool] | None = None,
    extra: Mapping[str, Any] | None = None,
    decide: Callable[[int, Any], Any] | None = None,
    within: Callable[[Any, float], tuple[Any, Any]] | None = None,
    functions: Mapping[str, Callable] = NUMPY_FUNCTIONS,
) -> Stages:
    """Return the arguments of the law of a contact."""
    # Parameters are as in `contact_force`, and ``extra`` numbers of guards; ``decide`` returns the value of a mode from
    # its number and its guard, by default from the sign of the guard. Another arithmetic has ``functions`` of its own,
    # and ``within``, which returns depth and mode of a stage from the signed depth and the side.
    law, stages = slots.form.law, []
    for number, stage in enumerate(slots.stages):
        values = angles.named(stage.numbers, stage.waves)
        depth = moves[0][0] - stage.sign * values["clearance"]
        if within is None:
            inside = stage.sign * np.real(depth) > 0.0 if closed is None else np.asarray(closed[number])
            # the formula must not overflow far outside a stage
            own = np.where(inside, depth, 0.0), inside * 1.0
        else:
            own = within(depth, stage.sign)
        stages.append(StageTerms(stage.sign, *own, stage.innermost, values))
    deflections = dict(zip(law.arguments, moves, strict=True))
    modes: list[Any] = [0.0] * law.mode_count
    found = Stages(stages, deflections=deflections, modes=modes, functions=functions)
    for mode in range(law.mode_count):  # a guard may depend on earlier modes
        guard = law.guards(moves[0][1], found, angles.named(slots.numbers, slots.waves) | dict(extra or {}))[mode]
        modes[mode] = np.where(np.real(guard) > 0.0, 1.0, 0.0) if decide is None else decide(mode, guard)
    return found


def accelerations(
    layout: CoefficientLayout,
    coefficients: NDArray,
    theta: NDArray | float,
    q: NDArray,
    v: NDArray,
    closed: Sequence[Sequence[bool] | None] | None = None,
    levels: Sequence[bool] | None = None,
    unit: float = 1.0,
    dry: Dry | None = None,
) -> NDArray:
    """Return accelerations ``q''`` over time (not theta), shape (..., n)."""
    # `closed` is as in `contact_force`, `levels` and `unit` as in `Angles`, `dry` as in `contact_forces`. Where
    # friction sticks or a stop is held, the coefficients are those of `gapwalk.flow.constraints.constrained`.
    angles = Angles(layout, coefficients, theta, levels, unit)
    forces = contact_forces(layout, coefficients, theta, q, v, closed, angles, dry)
    return balance(coefficients[layout.accelerations], q, v, forces, angles.waves)


def balance(table: NDArray, q: NDArray, v: NDArray, forces: NDArray, waves: NDArray) -> NDArray:
    """Return sums over the columns of a table, as of the accelerations or of the reactions; shape (..., rows)."""
    n, mean = q.shape[-1], 2 * q.shape[-1] + forces.shape[-1]
    return (
        table[:, mean]
        + waves @ table[:, mean + 1 :].T
        - q @ table[:, :n].T
        - v @ table[:, n : 2 * n].T
        - forces @ table[:, 2 * n : mean].T
    )
