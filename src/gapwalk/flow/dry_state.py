"""The modes of dry friction and of rigid stops at one instant, with the values by which they are decided.

While contacts are held, the motion is that of a system with other coefficients (`gapwalk.flow.constraints`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.compiled_readings import CompiledReadings
from gapwalk.flow.constraints import Constraint
from gapwalk.flow.equations import Equations
from gapwalk.flow.forces import Angles, Dry

Array = NDArray[np.float64]


class SlipEvent(NamedTuple):
    """Dry friction begins to slip or to stick.

    Examples
    --------
    >>> event = slipping.slips[1]
    >>> round(event.theta, 6), event.slip
    (0.49058, 0)
    """

    theta: float  #: Angle of the event, in radians of the fundamental excitation.
    contact: int  #: Number of the contact in the structure.
    slip: int  #: Its mode from there on: 1 or -1 in slip, by the direction, 0 in stick.


class Hold(NamedTuple):
    """Contacts begin or cease to be held: rigid friction that sticks, and rigid stops.

    Examples
    --------
    >>> gw.records.Hold(theta=0.5, reactions=(0,)).reactions
    (0,)
    """

    theta: float  #: Angle of the event, in radians of the fundamental excitation.
    reactions: tuple[int, ...]  #: The numbers in `Structure.reactions` of all that are held from there on.


class Kink(NamedTuple):
    """An instant at which velocities or accelerations jump: positions, and both of them before and after.

    Examples
    --------
    >>> bouncing = gw.System(["x"], [[1.0]], contacts=[gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8)])
    >>> kink = gw.integrate(bouncing, np.array([0.0, 2.0]), 0.5).impacts[0]
    >>> [round(float(velocity[0]), 6) for velocity in kink.velocities]  # before, after: - 0.8 times
    [1.732051, -1.385641]
    """

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
        """Attach to the integrator's state and parameters (live views), with `columns` sensitivity columns.

        `changed` is called with the coefficients whenever they change.
        """
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
        """Begin with the coefficients of a system, which the integrator has, and nothing held.

        What was computed for the system before is kept if it differs by its frequency only.
        """
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
        """Return the values at the present state under the present modes.

        `known` are those at the same state under other modes. They differ by the forces of friction that slips only,
        which are its limits, so no law need be evaluated again.
        """
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
        return moved if self.layout.contacts[contact].sway is None else moved + self._swaying(contact, theta)

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
