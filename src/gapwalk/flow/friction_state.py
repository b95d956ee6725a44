"""The modes of dry friction and of rigid stops at one instant, with the values by which they are decided.

While contacts are held, the motion is that of a system with other coefficients (`gapwalk.flow.constraints`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.equations import Equations
from gapwalk.flow.forces import Angles, CompiledReadings, Dry, balance, contact_forces

Array = NDArray[np.float64]


class SlipEvent(NamedTuple):
    """Dry friction begins to slip or to stick."""

    theta: float  #: Angle of the event, in radians of the fundamental excitation.
    contact: int  #: Number of the contact in the structure.
    slip: int  #: Its mode from there on: 1 or -1 in slip, by the direction, 0 in stick.


class Hold(NamedTuple):
    """Contacts begin or cease to be held: rigid friction that sticks, and rigid stops."""

    theta: float  #: Angle of the event, in radians of the fundamental excitation.
    reactions: tuple[int, ...]  #: The numbers in `Structure.reactions` of all that are held from there on.


class Kink(NamedTuple):
    """An instant at which velocities or accelerations jump: positions, and both of them before and after."""

    theta: float  #: Angle of the excitation, in radians.
    positions: Array  #: Positions at that instant.
    velocities: tuple[Array, Array]  #: Velocities before and after.
    accelerations: tuple[Array, Array]  #: Accelerations before and after.

    @property
    def is_impact(self) -> bool:
        """True if velocities jump."""
        before, after = self.velocities
        return before is not after and not np.array_equal(before, after)

    def scaled(self, unit: float) -> Kink:
        """Return it with lengths in another unit, of which this is the size."""
        before, after = ((unit * each[0], unit * each[1]) for each in (self.velocities, self.accelerations))
        return Kink(self.theta, unit * self.positions, before, after)


class Readings(NamedTuple):
    """Values at one state, under the present modes."""

    #: velocities, accelerations: shape (n,): Derivatives of the state over time.
    velocities: Array
    accelerations: Array
    extending: Array  #: shape (contacts with a memory,): Rates of the extensions.
    reactions: Array  #: shape (reactions,): The reactions; 0 of those that are not held.
    #: Slip rate, force in slip, and force at which slip begins, of each contact that is friction.
    friction: list[list[float]]
    #: What the columns of the accelerations multiply: positions, velocities, forces of all contacts, 1, waves.
    columns: Array


def largest(values: Array) -> float:
    """Return the largest absolute value of a few numbers."""
    return max(map(abs, values.tolist()))


class _Held(NamedTuple):
    """Coefficients of the system while some contacts are held, and their derivatives along the directions.

    The table has the rows of accelerations and reactions, by the values of `Equations.readings`. `active` and
    `components` are what the integrator takes over of coefficients and directions.
    """

    coefficients: Array
    directions: Array
    constraint: Constraint
    table: Array
    active: Array
    components: Array


class DryState:
    """Modes of friction and of rigid stops of one compiled integrator.

    Shapes: `column_signs` (columns,).

    Attributes
    ----------
    slots, laws, reaction_of, memory_of
        For each contact that is friction: its slots, its law, the number of its reaction or None, and the place of
        its extension in a state or None.
    slips, sticks
        The modes of these: 1 or -1 in slip, 0 otherwise; and True in stick.
    held
        The numbers of the reactions that are held.
    hold_log
        The changes of `held` since the start, which begin with those held at the start; the last of an instant
        holds.
    sign_of
        For each reaction of a stop, its side: 1 or -1.
    coefficients
        The present coefficients: those of the system while its present contacts are held.
    base, directions
        Coefficients of the system without constraints, and their derivatives along each direction.
    stop_reaction
        The number of the reaction of each switch of a rigid stop.
    has_constant_limit
        For each friction, True if its force in slip is the same all the time.
    velocity_rows
        The part of `rows` that changes velocities.
    vectors
        Deflection vector of each contact that is friction or a rigid stop.
    spans
        For each friction, the sum of the sizes of the numbers of its vector; inf if a displacement is added.
    column_signs : shape (columns,)
        Signs with which the columns of coefficients enter accelerations and reactions.
    is_moved
        For each of them, True if a direction changes its deflection, or the rate of its base.
    rate_factors
        For each friction the places in a state, and the factors, of the velocities that are its slip rate; None if
        it depends on more than these.
    is_strained
        For each friction with a spring whose limit is constant, True if a direction changes the extension in slip.
    has_base
        For each of them, True if its base moves.
    closed
        For each contact which of its stages are closed.
    """

    closed: list[list[bool]]
    coefficients: Array
    entry: _Held
    vectors: dict[int, Array]
    spans: list[float]
    is_moved: dict[int, bool]
    has_base: dict[int, bool]
    rate_factors: list[list[tuple[int, float]] | None]
    is_strained: list[bool]
    velocity_rows: Array

    def __init__(self, equations: Equations) -> None:
        layout, structure = equations.layout, equations.layout.structure
        self.equations, self.layout, self.n, self.size = equations, layout, structure.size, structure.state_size
        self.count = len(equations.dry) + len(equations.stops)
        self.slots = [layout.contacts[contact] for contact in equations.dry]
        self.laws: list[Any] = [slots.form.law for slots in self.slots]
        by_contact = {contact: number for number, (contact, switch) in enumerate(structure.reactions) if switch < 0}
        self.reaction_of = [by_contact.get(contact) for contact in equations.dry]
        places = {contact: 2 * self.n + place for place, contact in enumerate(structure.memories)}
        self.memory_of = [places.get(contact) for contact in equations.dry]
        self.friction_of = {number: place for place, number in enumerate(self.reaction_of) if number is not None}
        self.sign_of = {
            number: layout.contacts[contact].stages[equations.switches[switch][1]].sign
            for number, (contact, switch) in enumerate(structure.reactions)
            if switch >= 0
        }
        self._order = [*self.sign_of, *sorted(self.friction_of)]  # of what is held: stops before friction
        self.stop_reaction = {structure.reactions[number][1]: number for number in self.sign_of}
        self.has_constant_limit = [
            law.by == "limit" and not slots.varies for law, slots in zip(self.laws, self.slots, strict=True)
        ]
        self.slips, self.sticks = [0] * len(self.slots), [False] * len(self.slots)
        self.held: tuple[int, ...] = ()
        self.hold_log: list[Hold] = []
        self._known: dict[tuple[int, ...], _Held] = {}
        self._applied: _Held | None = None
        self._applied_modes: list[Any] = []
        self.base, self.directions = np.zeros(0), np.zeros((0, 0))
        self._numbers = (b"", b"")
        self._first_slip, self._first_coefficient = equations.first_slip, equations.first_coefficient
        # where the integrator has 1/W, and its changes; the directions that change it
        self._components = equations.components if equations.varying else np.zeros(0, dtype=np.intp)
        self._rate_places = np.flatnonzero(equations.active == 0).tolist()
        changes = np.flatnonzero(self._components % len(equations.pattern) == 0)
        directions_of = self._components[changes] // len(equations.pattern)
        self._rate_changes = [*zip(changes.tolist(), directions_of.tolist(), strict=True)]
        self._columns_end = layout.accelerations.shape[1]
        self.column_signs = np.ones(self._columns_end)
        self.column_signs[: 2 * self.n + len(layout.contacts)] = -1.0
        self._friction_end = self._columns_end + 3 * len(self.slots)
        self._rigid_columns = [
            (place, 2 * self.n + contact)
            for place, contact in enumerate(equations.dry)
            if self.memory_of[place] is None
        ]
        self._springs = [equations.dry.index(contact) for contact in structure.memories]
        # the dry contacts and those of stops, with the slots of their deflection, its displacement, and their speed
        self._contacts: dict[int, list[int]] = {}
        for contact in [*equations.dry, *(contact for contact, switch in structure.reactions if switch >= 0)]:
            slots = layout.contacts[contact]
            speed = [slots.numbers["speed"]] if "speed" in slots.numbers else []
            sway = [] if slots.sway is None else [0, *slots.sway.tolist()]
            self._contacts[contact] = [*slots.deflection.tolist(), *sway, *speed]
        # of springs in series, the slots of the coefficients of the extension in slip, if it is constant
        self._strains = [
            [slots.numbers["limit"], slots.numbers["stiffness"]] if self.has_constant_limit[place] and memory else []
            for place, (slots, memory) in enumerate(zip(self.slots, self.memory_of, strict=True))
        ]
        self._sways = any(layout.contacts[contact].sway is not None for contact in self._contacts)

    def attach(
        self, integrator: Any, columns: int, compiled: CompiledReadings | None, changed: Callable[[Array], None]
    ) -> None:
        """Attach to the integrator's state and parameters (live views), with `columns` sensitivity columns."""
        # `changed` is called with the coefficients whenever they change.
        self._changed, self.integrator = changed, integrator
        self.state, self._parameters = integrator.state, integrator.pars
        self._own = self.state[: self.size]
        self._rows = self.state[self.size : self.size * (1 + columns)].reshape(columns, self.size)
        self.columns = columns
        self.velocity_rows = self._rows[:, self.n : 2 * self.n]
        if compiled is not None:
            self._compiled, self._read, self._follows = compiled, compiled.readings, compiled.follows
            self._numbers_used = self._parameters[compiled.used]
            self._last_of: tuple[_Held | None, bytes] = None, b""
            self._given = np.empty(self.size + 1 + len(self._numbers_used))
            self._deciding: tuple[Any, Array, Array, Array, Array] | None = None

    def begin(self, base: Array, directions: Array) -> None:
        """Begin with the coefficients of a system, which the integrator has, and nothing held."""
        # What was computed for the system before is kept if it differs by its frequency only.
        numbers = (base[1:].tobytes(), directions[:, 1:].tobytes())
        same, self._numbers = numbers == self._numbers and not self._sways, numbers
        self.base, self.directions = base, directions
        if same:
            rate, changes = base.item(0), directions[:, 0]
            for entry in self._known.values():
                entry.coefficients[0], entry.directions[:, 0] = rate, changes
                for place in self._rate_places:
                    entry.active[place] = rate
                for place, direction in self._rate_changes:
                    entry.components[place] = changes.item(direction)
        else:
            self._known = {}
            self.rate_factors = [self._factors_of(place) for place in range(len(self.slots))]
            self.vectors = {contact: base[self.layout.contacts[contact].deflection] for contact in self._contacts}
            spans = ((np.abs(base[slots.deflection]).sum(), slots.sway) for slots in self.slots)
            self.spans = [float(span) if sway is None else math.inf for span, sway in spans]
            self.has_base = {contact: bool(base[slots[self.n :]].any()) for contact, slots in self._contacts.items()}
            self.is_strained = [bool(directions[:, slots].any()) for slots in self._strains]
            self.is_moved = {contact: bool(directions[:, slots].any()) for contact, slots in self._contacts.items()}
        was_held, self.held = bool(self.held), ()
        self.slips, self.sticks = [0] * len(self.slots), [False] * len(self.slots)
        self.entry = self._entry_of(())
        # a start may be decided twice: then the integrator may still have what the first one held
        self._applied = None if was_held else self.entry
        self.coefficients = self.entry.coefficients
        self._changed(self.coefficients)

    def _factors_of(self, place: int) -> list[tuple[int, float]] | None:
        """Return which velocities of a state make up a slip rate; None if it depends on more, as with a moving base."""
        slots = self.slots[place]
        if slots.sway is not None or self.base[slots.numbers["speed"]]:
            return None
        return [(self.n + i, factor) for i, factor in enumerate(self.base[slots.deflection].tolist()) if factor]

    def _entry_of(self, held: tuple[int, ...]) -> _Held:
        """Return the coefficients and the rest for a set of held contacts."""
        known = self._known.get(held)
        if known is not None:
            return known
        layout = self.layout
        constraint = Constraint(layout, self.base, held)
        directions = constraint.changes(self.directions)
        coefficients = constraint.coefficients()
        table = np.vstack((coefficients[layout.accelerations], coefficients[layout.reactions]))
        table *= self.column_signs
        active, components = coefficients[self.equations.active], directions.ravel()[self._components]
        self._known[held] = found = _Held(coefficients, directions, constraint, table, active, components)
        return found

    def hold(self, held: Iterable[int]) -> None:
        """Hold some contacts, by the numbers of their reactions; the integrator does not know before `apply`."""
        self.held = tuple(sorted(held, key=self._order.index))
        self.entry = self._entry_of(self.held)

    def apply(self) -> None:
        """Give the integrator the present modes, and the coefficients of what is held."""
        entry, modes = self.entry, [*self.slips, *self.sticks]
        if self.sign_of:
            modes += [number in self.held for number in self.sign_of]
        if modes != self._applied_modes:
            self._applied_modes = modes
            self._parameters[self._first_slip : self._first_slip + len(modes)] = modes
        if self._applied is not entry:
            equations, self._applied, self.coefficients = self.equations, entry, entry.coefficients
            self._parameters[self._first_coefficient :] = entry.active
            if len(entry.directions):
                self._parameters[: equations.first_switch] = entry.components
            self._changed(entry.coefficients)
            self.hold_log.append(Hold(self.integrator.time, self.held))

    def apply_alone(self, place: int) -> None:
        """Give the integrator the mode of one friction: nothing else has changed, and what is held has not."""
        first, stick = self._first_slip, len(self.slips) + place
        self._parameters[first + place] = self._applied_modes[place] = self.slips[place]
        self._parameters[first + stick] = self._applied_modes[stick] = self.sticks[place]

    def read(self, theta: float, known: Readings | None = None) -> Readings:
        """Return the values at the present state under the present modes."""
        # `known` are those at the same state under other modes. They differ by the forces of friction that slips only,
        # which are its limits, so no law need be evaluated again.
        if known is not None and not self._follows:
            return self._changed_modes(known)
        self.apply()
        size, given = self.size, self._given
        given[:size] = self._own
        given[size] = theta
        given[size + 1 :] = self._numbers_used
        entry, asked = self._last_of
        if entry is not self.entry or asked != given.tobytes():  # at an impact the same is read several times
            n, columns, last, found = self.n, self._columns_end, self._friction_end, self._read(given)
            values, friction = self.entry.table.dot(found[:columns]), found[columns:last].reshape(-1, 3).tolist()
            self._last = Readings(found[n : 2 * n], values[:n], found[last:], values[n:], friction, found[:columns])
            self._last_of = self.entry, given.tobytes()
        return self._last

    def decide(self, theta: float) -> list[float]:
        """Return the values of `Equations.decisions` at the present state under the modes that the integrator has."""
        if self._deciding is None:  # compiled when first needed
            function, used = self._compiled.decisions
            numbers = self._parameters[used]
            given = np.empty(self.size + 1 + len(numbers))
            self._deciding = function, numbers, given, given[: self.size], given[self.size + 1 :]
        function, numbers, given, own, used = self._deciding
        own[:], given[self.size], used[:] = self._own, theta, numbers
        return function(given).tolist()

    def _changed_modes(self, known: Readings) -> Readings:
        columns, extending = known.columns.copy(), known.extending
        for place, column in self._rigid_columns:
            columns[column] = self.slips[place] * known.friction[place][1]
        if self._springs:
            rates = [known.friction[place][0] if self.sticks[place] else 0.0 for place in self._springs]
            extending = np.array(rates)
        values = self.entry.table.dot(columns)
        return Readings(known.velocities, values[: self.n], extending, values[self.n :], known.friction, columns)

    def tangents(self, theta: float, rows: Array, along: Array, turn: float = 0.0) -> tuple[Array, Array]:
        """Return the derivatives of the columns of the accelerations, and of the limits, along some changes."""
        turns = np.full((len(rows), 1), turn)
        changes = np.hstack((rows, turns, along[:, self.equations.tangent_slots]))
        found = self._compiled.tangents(self._own, self._parameters, theta, list(changes))
        split = self._columns_end - 2 * self.n
        return np.hstack((rows[:, : 2 * self.n], found[:, :split])), found[:, split:].reshape(len(rows), -1, 2)

    def rows(self) -> Array:
        """Return the changes of the state, one row for each column of the sensitivities (a live view)."""
        return self._rows

    def along(self) -> Array:
        """Return the change of the system's coefficients along each row."""
        along = np.zeros((self.columns, len(self.base)))
        along[self.columns - len(self.directions) :] = self.directions
        return along

    def stiffness(self, place: int) -> float:
        """Return the stiffness of the spring of friction with a memory."""
        return self.base.item(self.slots[place].numbers["stiffness"])

    def acceleration(self, contact: int, now: Readings, theta: float) -> float:
        """Return the second derivative of a deflection over time."""
        moved = float(self.vectors[contact].dot(now.accelerations))
        is_plain = not self._sways or self.layout.contacts[contact].sway is None
        return moved if is_plain else moved + self._swaying(contact, theta)

    def _swaying(self, contact: int, theta: float) -> float:
        """Return the second derivative over time of the displacement that is added to a deflection."""
        return float(Angles(self.layout, self.base, theta).sway(self.layout.contacts[contact], 0, 2))

    def slip_acceleration(self, place: int, now: Readings, theta: float) -> float:
        """Return the derivative of the slip rate of friction over time, with a limit that is constant."""
        return self.acceleration(self.equations.dry[place], now, theta)

    def rigid_rate(self, place: int, theta: float) -> float:
        """Return the slip rate of friction without a spring, over time."""
        contact, slots = self.equations.dry[place], self.slots[place]
        rate = float(self.vectors[contact].dot(self.state[self.n : 2 * self.n])) - self.base.item(
            slots.numbers["speed"]
        )
        if slots.sway is not None:
            rate += float(Angles(self.layout, self.base, theta).sway(slots, 0, 1))
        return rate

    def gap(self, number: int, theta: float) -> tuple[float, float, float]:
        """Return the deflection beyond a stop, by its reaction; its rate over time; and the size of its clearance."""
        n, (contact, switch) = self.n, self.layout.structure.reactions[number]
        slots, angles = self.layout.contacts[contact], Angles(self.layout, self.base, theta)
        clearance = float(self.base[slots.stages[self.equations.switches[switch][1]].clearance])
        vector = self.base[slots.deflection]
        depth = float(vector @ self.state[:n] + angles.sway(slots)) - self.sign_of[number] * clearance
        return depth, float(vector @ self.state[n : 2 * n] + angles.sway(slots, 0, 1)), clearance

    def speed(self) -> float:
        """Return the size of the velocities, now or a quarter of a period later."""
        return self._speed_of(self._own.tolist())

    def _speed_of(self, numbers: list[float]) -> float:
        """Return the same for the numbers of a state."""
        n = self.n
        return max(*map(abs, numbers[n : 2 * n]), max(map(abs, numbers[:n])) / self.base.item(0))

    def keeps_still(self, vector: Array) -> bool:
        """Return True if what is held determines the rate of a deflection, which then has no turning points."""
        vectors = self.entry.constraint.vectors
        if not self.held or not len(vectors):
            return False
        shares = np.linalg.lstsq(vectors.T, vector, rcond=None)[0]
        return float(np.abs(shares @ vectors - vector).max()) <= 1e-12 * float(np.abs(vector).max())

    @property
    def present(self) -> Dry | None:
        """The present modes and extensions, for `gapwalk.flow.forces`; None without friction and rigid stops."""
        if not self.count:
            return None
        return Dry(np.array(self.slips, dtype=float), self.state[2 * self.n : self.size].copy())


# Derivatives of a motion through the events of dry friction and of rigid stops that are held.
#
# They are the general rule of `gapwalk.flow.event_rule` in its closed form for these events. Where a contact begins to
# be held, changes of the motion are projected on the constraint. A Jenkins element that begins to slip forgets how far
# it was strained. Where forces jump, an event that comes later contributes what they did in the meantime.

_NOTHING = 1e-13  # share of the accelerations below which their jump is rounding
_STEP = 1e-150  # of the complex step


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
    """Return the changes of the velocities where a motion comes to its stops from changes of the positions."""
    # It comes there in no time to leading order, but dampers that it moves on the way give finite impulses.
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
    """Project the state and its changes on what is held."""
    # Changes of positions at a stop that is held are those of motions that begin before it, and come to it.
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
    """Add what an event contributes that comes earlier or later: ``(F+ - R_y F- - R_theta) (g_y s + g_p) / den``."""
    # R is the projection on what is held after the event.
    #
    # Shapes: `shifts` (columns,).
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
