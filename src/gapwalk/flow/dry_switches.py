"""Modes of dry friction and of held stops: set at the start of a motion, changed at its events, and checked.

Which contacts are held follows from what they would need: all that may be held are taken as held together, and the one
whose reaction exceeds its bound most is released, until none does. While they are held, the motion is that of a system
with other coefficients (`gapwalk.flow.constraints`).

Derivatives pass an event by the general rule of `gapwalk.flow.event_rule`, in its closed form for these events. Where a
contact begins to be held, changes of the motion are projected on the constraint; a Jenkins element that begins to slip
forgets how far it was strained.

Method: docs/numerics/flow.md
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.constraints import Constraint
from gapwalk.flow.equations import Equations
from gapwalk.flow.forces import Angles, Dry, balance, contact_forces, stages_of
from gapwalk.model.laws import Friction, Host

_STILL = 1e-12  # share of the size of the velocities below which a slip rate at the start is 0
_ON = 1e-12  # share of a limit within which a force is at it
_NEAR = 1e-8  # the same at the end of a motion
_SETTLING = 1e-7  # radians after a change within which a guard of the new mode vanishes by rounding
_BEYOND = 1e-2  # share of its size by which a motion may begin beyond a rigid stop
_TOGETHER = 1e-9  # radians within which two slip rates vanish together
TAIL = 1e-6  # radians that further impacts may last together for the contact to be held at once
_STEP = 1e-150  # of the complex step

Array = NDArray[np.float64]


class SlipEvent(NamedTuple):
    """Dry friction begins to slip or to stick.

    Attributes
    ----------
    theta
        Angle of the event, in radians of the fundamental excitation.
    contact
        Number of the contact in the structure.
    slip
        Its mode from there on: 1 or -1 in slip, by the direction, 0 in stick.
    """

    theta: float
    contact: int
    slip: int


class Readings(NamedTuple):
    """Values at one state, under the present modes.

    Attributes
    ----------
    rates : shape (state size,)
        Derivatives of the state over time.
    slip_rates, limits, breakaways : shape (contacts that are friction,)
        Slip rate, force in slip, and force at which slip begins.
    reactions : shape (reactions,)
        The reactions; 0 of those that are not held.
    """

    rates: Array
    slip_rates: Array
    limits: Array
    breakaways: Array
    reactions: Array


class Kink(NamedTuple):
    """An instant at which velocities or accelerations jump: positions, and both of them before and after."""

    theta: float
    positions: Array
    velocities: tuple[Array, Array]
    accelerations: tuple[Array, Array]


class _Held(NamedTuple):
    """The coefficients, their derivatives along the directions, and the constraint of a set of held contacts."""

    coefficients: Array
    directions: Array
    constraint: Constraint


class DrySwitches:
    """Control of the modes of friction and of held stops of one compiled integrator.

    Parameters
    ----------
    equations
        Its equations.

    Attributes
    ----------
    count
        Number of contacts that are friction, plus number of switches of rigid stops.
    coefficients
        The present coefficients: those of the system while its present contacts are held.
    log
        The slip events since the start, which begin with the modes at the start.
    kinks
        The instants since the start at which friction ceased to slip in one direction, or an impact occurred.
    """

    def __init__(self, equations: Equations) -> None:
        layout = equations.layout
        structure = layout.structure
        self.equations, self.n, self.size = equations, structure.size, structure.state_size
        self.count = len(equations.dry) + len(equations.stops)
        self.log: list[SlipEvent] = []
        self.kinks: list[Kink] = []
        self._forgotten: set[int] = set()  # places of the state that the last event has reset
        self._layout, self._slots = layout, [layout.contacts[k] for k in equations.dry]
        self._laws = [layout.contacts[k].form.law for k in equations.dry]
        by_contact = {contact: number for number, (contact, switch) in enumerate(structure.reactions) if switch < 0}
        self._reaction = [by_contact.get(k) for k in equations.dry]
        self._memory = [structure.memories.index(k) if k in structure.memories else None for k in equations.dry]
        self.stop_reaction = {switch: number for number, (_, switch) in enumerate(structure.reactions) if switch >= 0}
        self._sign = {
            number: layout.contacts[contact].stages[switch - equations.switches.index((contact, 0))].sign
            for number, (contact, switch) in enumerate(structure.reactions)
            if switch >= 0
        }
        self._of_reaction = {number: place for place, number in enumerate(self._reaction) if number is not None}
        self._compiled: Any = None

    def compile(self) -> Any:
        """Return the compiled readings, for `attach`; integrators of the same equations share them."""
        if not self.count:
            return None
        variables = [*self.equations.positions, *self.equations.velocities, *self.equations.extensions]
        return hy.cfunc(self.equations.readings, vars=variables)

    def attach(self, integrator: Any, columns: int, compiled: Any) -> None:
        """Attach to the integrator's state and parameters (live views), with `columns` sensitivity columns."""
        self._integrator, self._state, self._parameters = integrator, integrator.state, integrator.pars
        self._columns, self._compiled = columns, compiled
        self._read_from = self._parameters[: compiled.nparams] if self.count else self._parameters

    def start(
        self,
        coefficients: Array,
        directions: Array,
        theta: float,
        unit: float,
        changed: Callable[[Array], None],
    ) -> None:
        """Set all modes for the state in the integrator, and begin a new log.

        Parameters
        ----------
        coefficients, directions
            Coefficients of the system, and their derivatives along each direction, with lengths in multiples of `unit`.
        theta
            The angle.
        unit
            The unit of length.
        changed
            Function that is called with the coefficients whenever they change.
        """
        self.base, self._base_directions, self._unit, self._changed = coefficients, directions, unit, changed
        self._known: dict[tuple[int, ...], _Held] = {}
        self.log, self.kinks, self._begun = [], [], [theta - 1.0] * len(self._slots)
        self._slips, self._sticks, self.held = [0] * len(self._slots), [False] * len(self._slots), ()
        self._apply()
        self._within(theta)
        still = _STILL * self._speed()
        self._restart(theta, still, self._touching(theta, still))
        for place, contact in enumerate(self.equations.dry):
            self.log.append(SlipEvent(theta, contact, self._slips[place]))

    def _speed(self) -> float:
        """Return the size of the velocities, now or a quarter of a period later."""
        q, v = np.abs(self._state[: self.n]).max(), np.abs(self._state[self.n : 2 * self.n]).max()
        return max(float(v), float(q) / float(self.base[0]))

    def _touching(self, theta: float, still: float) -> list[int]:
        """Return the reactions of those stops on which the motion is, at rest."""
        found, size = [], float(np.abs(self._state[: self.n]).max())
        for number in self._sign:
            depth, rate, scale = self._gap(number, theta)
            if abs(depth) <= _STILL * (scale + size) and abs(rate) <= still:
                found.append(number)
        return found

    def _gap(self, number: int, theta: float) -> tuple[float, float, float]:
        """Return the deflection beyond a stop, its rate over time, and the size of its clearance."""
        n, (contact, switch) = self.n, self._layout.structure.reactions[number]
        slots, angles = self._layout.contacts[contact], Angles(self._layout, self.base, theta)
        clearance = float(self.base[slots.stages[self.equations.switches[switch][1]].clearance])
        vector = self.base[slots.deflection]
        depth = float(vector @ self._state[:n] + angles.sway(slots)) - self._sign[number] * clearance
        return depth, float(vector @ self._state[n : 2 * n] + angles.sway(slots, 0, 1)), clearance

    def _within(self, theta: float) -> None:
        """Move a state that is a little beyond a stop, as in a step of Newton's method, back to it."""
        for number, sign in self._sign.items():
            depth, _, scale = self._gap(number, theta)
            if sign * depth <= 0.0:
                continue
            if sign * depth > _BEYOND * (scale + float(np.abs(self._state[: self.n]).max())):
                name = self._layout.contacts[self._layout.structure.reactions[number][0]].form.name
                raise FlowError(
                    f"the motion begins {sign * depth * self._unit:.3g} beyond the rigid stop {name!r}; begin it where "
                    "the deflection is within the clearance"
                )
            impulse = Constraint(self._layout, self.base, [number]).impulses[:, 0]
            if self._columns:
                self._rows()[:, : self.n] -= np.outer(self._place_changes(number, theta), impulse)
            self._state[: self.n] -= depth * impulse

    def _restart(self, theta: float, still: float, stops: Sequence[int]) -> None:
        """Decide all modes from the state alone, and project the state on what is held."""
        now, candidates = self.read(theta), list(stops)
        for place, law in enumerate(self._laws):
            rate = float(now.slip_rates[place])
            self._slips[place], self._sticks[place] = 0, False
            if law.has_memory:
                continue
            if abs(rate) <= still:
                candidates.append(self._reaction[place])  # type: ignore[arg-type]
            else:
                self._slips[place] = 1 if rate > 0.0 else -1
        self._hold(theta, candidates)
        if self.held:
            self._project(theta)
        for place, law in enumerate(self._laws):
            if law.has_memory:
                self._begin_memory(place, theta)

    def _begin_memory(self, place: int, theta: float) -> None:
        """Decide whether a Jenkins element sticks from its extension and slip rate; it is never beyond its limit."""
        self._slips[place], self._sticks[place] = 0, False
        self._apply()
        now, memory = self.read(theta), self._memory[place]
        assert memory is not None
        index, stiffness = 2 * self.n + memory, float(self.base[self._slots[place].numbers["stiffness"]])
        limit, force = float(now.limits[place]), stiffness * float(self._state[index])
        if limit > 0.0 and abs(force) < limit * (1.0 - _ON):
            self._sticks[place] = True
            self._apply()
            return
        side = 1 if force > 0.0 else -1
        if limit <= 0.0:
            side = 0 if not self._grows(place) else 1 if now.slip_rates[place] > 0.0 else -1
        self._reset_extension(place, side, theta)
        if side:
            self._slips[place] = side
            self._apply()
            now = self.read(theta)
            rate = side * float(now.slip_rates[place])
            if rate == 0.0:
                rate = side * self._slip_acceleration(place, now, theta)
            if rate <= 0.0:
                self._slips[place], self._sticks[place], self._begun[place] = 0, True, theta
        self._apply()

    def _grows(self, place: int) -> bool:
        """Return True if the limit of friction is not constant, and the contact that presses is closed."""
        law, host = self._laws[place], self._layout.structure.host(self.equations.dry[place])
        assert isinstance(law, Friction)
        return law.by == "normal" and host is not None and any(self.closed[host])

    def _reset_extension(self, place: int, side: int, theta: float) -> None:
        """Set the extension of a Jenkins element to its limit on one side (0: to zero), with its derivatives."""
        memory = self._memory[place]
        assert memory is not None
        index = 2 * self.n + memory
        stiffness = float(self.base[self._slots[place].numbers["stiffness"]])
        if self._columns:
            rows = self._rows()
            rows[:, index] = side * self._limit_changes(place, theta) if side else 0.0
        self._state[index] = side * float(self.read(theta).limits[place]) / stiffness
        self._forgotten.add(index)

    def read(self, theta: float) -> Readings:
        """Return the values at the present state under the present modes."""
        layout, n, state = self._layout, self.n, self._state[: self.size]
        found = self._compiled(state, pars=self._read_from, time=theta)
        contacts, waves = len(layout.contacts), 2 * len(layout.orders)
        forces, angles = found[:contacts], found[contacts : contacts + waves]
        last = contacts + waves + 3 * len(self._slots)
        dry = found[contacts + waves : last].reshape(-1, 3)
        q, v = state[:n], state[n : 2 * n]
        a = balance(self.coefficients[layout.accelerations], q, v, forces, angles)
        reactions = balance(self.coefficients[layout.reactions], q, v, forces, angles) if self.held else self._nothing
        return Readings(np.concatenate((v, a, found[last:])), dry[:, 0], dry[:, 1], dry[:, 2], reactions)

    @property
    def _nothing(self) -> Array:
        return np.zeros(len(self._layout.structure.reactions))

    def _slip_acceleration(self, place: int, now: Readings, theta: float) -> float:
        return self.acceleration(self.equations.dry[place], now, theta)

    def acceleration(self, contact: int, now: Readings, theta: float) -> float:
        """Return the second derivative of a deflection over time."""
        slots, n = self._layout.contacts[contact], self.n
        sway = float(Angles(self._layout, self.base, theta).sway(slots, 0, 2)) if slots.sway is not None else 0.0
        return float(self.base[slots.deflection] @ now.rates[n : 2 * n]) + sway

    def _hold(self, theta: float, candidates: Iterable[int]) -> None:
        """Hold those of the candidates that stay within their bounds; the others slip, or open."""
        held = sorted({*candidates}, key=lambda number: (number in self._of_reaction, number))
        while True:
            for number in held:
                if (place := self._of_reaction.get(number)) is not None:
                    self._slips[place], self._sticks[place] = 0, True
            self.held = tuple(held)
            self._apply()
            if not held:
                return
            now, worst, excess = self.read(theta), -1, 0.0
            for number in self._entry.constraint.independent:
                reaction, place = float(now.reactions[number]), self._of_reaction.get(number)
                if place is None:
                    over = np.inf if self._sign[number] * reaction < 0.0 else 0.0
                else:
                    bound = float(now.breakaways[place])
                    over = abs(reaction) / bound - 1.0 - _ON if bound > 0.0 else np.inf
                if over > excess:
                    worst, excess = number, over
            if worst < 0:
                return
            held.remove(worst)
            if (place := self._of_reaction.get(worst)) is not None:
                self._slips[place], self._sticks[place] = (1 if now.reactions[worst] > 0.0 else -1), False
                self._begun[place] = theta

    def _apply(self) -> None:
        """Give the integrator the present modes, and the coefficients of what is held."""
        entry = self._known.get(self.held)
        if entry is None:
            constraint = Constraint(self._layout, self.base, self.held)
            directions = self._base_directions
            if self.held and len(directions):
                step = 1j * _STEP
                directions = np.array(
                    [
                        Constraint(self._layout, self.base + step * each, self.held).coefficients().imag / _STEP
                        for each in directions
                    ]
                )
            entry = self._known[self.held] = _Held(constraint.coefficients(), directions, constraint)
        equations, count = self.equations, len(self._slots)
        if getattr(self, "_entry", None) is not entry:
            self._entry, self.coefficients = entry, entry.coefficients
            first = equations.first_coefficient
            self._parameters[first:] = entry.coefficients[equations.active]
            if len(entry.directions):
                self._parameters[: equations.first_switch] = entry.directions.ravel()[equations.components]
            self._changed(entry.coefficients)
        self._parameters[equations.first_slip : equations.first_slip + count] = self._slips
        self._parameters[equations.first_stick : equations.first_stick + count] = self._sticks
        for place, switch in enumerate(equations.stops):
            self._parameters[equations.first_held + place] = self.stop_reaction[switch] in self.held

    def _rows(self) -> Array:
        """Return the changes of the state, one row for each column of the sensitivities (a live view)."""
        return self._state[self.size : self.size * (1 + self._columns)].reshape(self._columns, self.size)

    def _along(self) -> Array:
        """Return the change of the system's coefficients along each row."""
        along, directions = np.zeros((self._columns, len(self.base))), self._base_directions
        along[self._columns - len(directions) :] = directions
        return along

    def _rate_changes(self, contact: int, theta: float) -> Array:
        """Return the change, along each row, of the rate of a deflection, less that of its base."""
        slots, n = self._layout.contacts[contact], self.n
        changes = self._rows()[:, n : 2 * n] @ self.base[slots.deflection]
        if not len(self._base_directions):
            return changes
        velocity, directions = self._state[n : 2 * n], self._base_directions
        own = directions[:, slots.deflection] @ velocity
        if "speed" in slots.numbers:
            own = own - directions[:, slots.numbers["speed"]]
        if slots.sway is not None:
            own = own + self._varied(lambda coefficients: Angles(self._layout, coefficients, theta).sway(slots, 0, 1))
        changes[self._columns - len(directions) :] += own
        return changes

    def _place_changes(self, number: int, theta: float) -> Array:
        """Return the change, along each row, of the depth beyond a stop."""
        contact, switch = self._layout.structure.reactions[number]
        slots, n = self._layout.contacts[contact], self.n
        changes = self._rows()[:, :n] @ self.base[slots.deflection]
        if not len(self._base_directions):
            return changes
        directions = self._base_directions
        clearance = slots.stages[self.equations.switches[switch][1]].clearance
        own = directions[:, slots.deflection] @ self._state[:n] - self._sign[number] * directions[:, clearance]
        if slots.sway is not None:
            own = own + self._varied(lambda coefficients: Angles(self._layout, coefficients, theta).sway(slots))
        changes[self._columns - len(directions) :] += own
        return changes

    def _varied(self, function: Callable[[NDArray], Any]) -> Array:
        """Return the change of a function of the coefficients along each direction."""
        step = 1j * _STEP
        return np.array([float(np.imag(function(self.base + step * each))) for each in self._base_directions]) / _STEP

    def _limit_changes(self, place: int, theta: float) -> Array:
        """Return the change, along each row, of the extension at which a Jenkins element slips."""
        slots = self._slots[place]
        law = slots.form.law
        assert isinstance(law, Friction)
        names, along = ("limit", "stiffness"), self._along()
        if law.by == "limit":
            limit, stiffness = (float(self.base[slots.numbers[name]]) for name in names)
            by_limit, by_stiffness = (along[:, slots.numbers[name]] for name in names)
            return by_limit / stiffness - limit * by_stiffness / stiffness**2
        step, found = 1j * _STEP, []
        for row, change in zip(self._rows(), along, strict=True):
            coefficients, state = self.base + step * change, self._state[: self.size] + step * row
            angles = Angles(self._layout, coefficients, theta)
            stages = stages_of(slots, angles, [(0.0, 0.0)])
            stages.host = self._host(place, coefficients, angles, state)
            numbers = angles.named(slots.numbers, slots.waves)
            found.append(complex(law.limit(stages, numbers) / numbers["stiffness"]).imag / _STEP)
        return np.array(found)

    def _host(self, place: int, coefficients: NDArray, angles: Angles, state: NDArray) -> Host:
        """Return the host of friction at a state, real or complex, with the present modes of its stages."""
        host = self._layout.structure.host(self.equations.dry[place])
        assert host is not None
        slots, n = self._layout.contacts[host], self.n
        vector = coefficients[slots.deflection]
        moves = [(state[:n] @ vector + angles.sway(slots), state[n : 2 * n] @ vector + angles.sway(slots, 0, 1))]
        stages = stages_of(slots, angles, moves, self.closed[host])
        return Host(stages, slots.form.law.force(moves[0][1], stages, angles.named(slots.numbers, slots.waves)))

    closed: list[list[bool]]
    """For each contact which of its stages are closed, as the switches of the stages have it."""

    def _project(self, theta: float) -> None:
        """Project state and derivatives on what is held."""
        constraint, n = self._entry.constraint, self.n
        if not constraint.independent:
            return
        stops = [place for place, number in enumerate(constraint.independent) if number in self._sign]
        if self._columns:
            rows = self._rows()
            rates = np.array([self._rate_changes(contact, theta) for contact in constraint.contacts])
            if stops:
                depths = np.array([self._place_changes(constraint.independent[place], theta) for place in stops])
                rows[:, :n] -= depths.T @ constraint.impulses[:, stops].T
            rows[:, n : 2 * n] -= rates.T @ constraint.impulses.T
        state, angles = self._state, Angles(self._layout, self.base, theta)
        for place, contact in enumerate(constraint.contacts):
            slots, number = self._layout.contacts[contact], constraint.independent[place]
            rate = float(constraint.vectors[place] @ state[n : 2 * n] + angles.sway(slots, 0, 1))
            rate -= float(self.base[slots.numbers["speed"]]) if "speed" in slots.numbers else 0.0
            state[n : 2 * n] -= rate * constraint.impulses[:, place]
            if number in self._sign:
                state[:n] -= self._gap(number, theta)[0] * constraint.impulses[:, place]

    def late(self, before: Readings, theta: float, shifts: Array, speed: float) -> None:
        """Add what an event contributes that comes earlier or later: ``(F+ - R_y F- - R_theta) (g_y s + g_p) / den``.

        R is the projection on what is held after the event.

        Parameters
        ----------
        before
            The values before the event; those after it are those of now.
        theta
            The angle.
        shifts : shape (columns,)
            Change of the guard along each column.
        speed
            Rate of the guard over time before the event.
        """
        after = self.read(theta)
        kept = before.rates.copy()
        kept[[*self._forgotten]] = 0.0
        jump = after.rates - kept
        jump[: self.n] = 0.0
        constraint, n = self._entry.constraint, self.n
        for place, contact in enumerate(constraint.contacts):  # R_y F- + R_theta
            jump[n : 2 * n] += constraint.impulses[:, place] * self.acceleration(contact, before, theta)
        size = np.abs(after.rates) + np.abs(before.rates)
        jump[np.abs(jump) <= 1e-13 * size.max()] = 0.0
        if jump.any() and speed:
            self._rows()[:] += np.outer(shifts / speed, jump)

    def at_slip(self, event: int, direction: int) -> None:
        """Change the mode of friction at one of its two events."""
        place, second = divmod(event, 2)
        theta, now = self._integrator.time, self.read(self._integrator.time)
        for other, law in enumerate(self._laws):  # of two events at the same time only one is reported
            if other != place and law.has_memory and self._stops_too(other, now, theta):
                self._at_memory(other, False, -self._slips[other], theta)
        if self._laws[place].has_memory:
            self._at_memory(place, bool(second), direction, theta)
        elif self._sticks[place]:
            self._release(place, -1 if second else 1, theta)
        elif not second and theta - self._begun[place] > _SETTLING:
            self._stop(place, theta)

    def _stop(self, place: int, theta: float) -> None:
        """Decide whether rigid friction sticks where its slip rate vanishes, or slips the other way."""
        before, old = self.read(theta), self._slips[place]
        self._forgotten.clear()
        acceleration = self._slip_acceleration(place, before, theta)
        if old * acceleration > 0.0:
            return  # the rate only begins to grow
        shifts = self._rate_changes(self.equations.dry[place], theta) if self._columns else np.zeros(0)
        candidates = [*self.held, self._reaction[place]]
        for other, number in enumerate(self._reaction):  # of two events at the same time only one is reported
            if number is not None and other != place and self._stops_too(other, before, theta):
                candidates.append(number)
        modes = self._modes()
        self._hold(theta, [number for number in candidates if number is not None])
        self._project(theta)
        if self._columns:
            self.late(before, theta, shifts, acceleration)
        self.kink(before, theta)
        self._report(modes, theta)

    def kink(self, before: Readings, theta: float) -> None:
        """Record an instant at which velocities or accelerations jump."""
        n, pair = self.n, (before.rates, self.read(theta).rates)
        velocities, accelerations = ((a[part], b[part]) for a, b in [pair] for part in (slice(n), slice(n, 2 * n)))
        self.kinks.append(Kink(theta, self._state[:n].copy(), velocities, accelerations))

    def keeps_still(self, vector: Array) -> bool:
        """Return True if what is held determines the rate of a deflection, which then has no turning points."""
        vectors = self._entry.constraint.vectors
        if not self.held or not len(vectors):
            return False
        shares = np.linalg.lstsq(vectors.T, vector, rcond=None)[0]
        return float(np.abs(shares @ vectors - vector).max()) <= 1e-12 * float(np.abs(vector).max())

    def _stops_too(self, place: int, now: Readings, theta: float) -> bool:
        """Return True if the slip rate of friction that slips vanishes at the same time as an event."""
        if not self._slips[place] or theta - self._begun[place] <= _SETTLING:
            return False
        rate, change = float(now.slip_rates[place]), self._slip_acceleration(place, now, theta)
        return abs(rate) <= _TOGETHER * abs(change) * float(self.base[0]) and self._slips[place] * change < 0.0

    def _release(self, place: int, side: int, theta: float) -> None:
        """Let rigid friction slip where its reaction reaches the force at which slip begins."""
        number, modes, before = self._reaction[place], self._modes(), self.read(theta)
        self._forgotten.clear()
        assert number is not None
        gradient = self._reaction_changes(number, theta) if self._columns and self._jumps(place) else None
        self._slips[place], self._sticks[place], self._begun[place] = side, False, theta
        rest = [each for each in self.held if each != number]
        self._hold(theta, rest)
        if gradient is not None:
            shifts, speed = gradient
            self.late(before, theta, shifts, speed)
        self._report(modes, theta)

    def _jumps(self, place: int) -> bool:
        """Return True if the force jumps where slip begins, or another contact may let go as well."""
        static = float(self.base[self._slots[place].numbers["static"]])
        return static != 1.0 or len(self.held) > 1

    def _reaction_changes(self, number: int, theta: float) -> tuple[Array, float]:
        """Return the change of a reaction less its bound along each row, and its rate over time."""
        contact = self._layout.structure.reactions[number][0]
        place = self.equations.dry.index(contact)
        slots, n, layout, step = self._slots[place], self.n, self._layout, 1j * _STEP
        law, now = slots.form.law, self.read(theta)
        assert isinstance(law, Friction)
        side = 1.0 if now.reactions[number] > 0.0 else -1.0

        def margin(state: NDArray, coefficients: NDArray, angle: Any) -> Any:
            constraint = Constraint(layout, coefficients, self.held)
            held, angles = constraint.coefficients(), Angles(layout, coefficients, angle)
            dry = Dry(np.array(self._slips, dtype=float), state[2 * n :])
            forces = contact_forces(layout, coefficients, angle, state[:n], state[n : 2 * n], self.closed, angles, dry)
            row = held[layout.reactions[[number]]]
            reaction = balance(row, state[:n], state[n : 2 * n], forces, angles.waves)[0]
            stages = stages_of(slots, angles, [(0.0, 0.0)])
            if law.host:
                stages.host = self._host(place, coefficients, angles, state)
            return side * reaction - law.breakaway(stages, angles.named(slots.numbers, slots.waves))

        state, base = self._state[: self.size], self.base
        shifts = [
            complex(margin(state + step * row, base + step * along, theta)).imag / _STEP
            for row, along in zip(self._rows(), self._along(), strict=True)
        ]
        frequency = 1.0 / float(base[0])
        moved = margin(state + step * now.rates, base.astype(complex), theta + step * frequency)
        return np.array(shifts), complex(moved).imag / _STEP

    def _at_memory(self, place: int, second: bool, direction: int, theta: float) -> None:
        """Change the mode of a Jenkins element."""
        modes, now = self._modes(), self.read(theta)
        if self._sticks[place]:
            side = -1 if second else 1
            just = theta - self._begun[place] <= _SETTLING
            rate = self._slip_acceleration(place, now, theta) if just else float(now.slip_rates[place])
            if side * rate <= 0.0:
                return  # where slip has just ended, the force is at its limit, and leaves it
            self._reset_extension(place, side, theta)
            self._slips[place], self._sticks[place] = side, False
        elif self._slips[place] and not second and direction in (0, -self._slips[place]):
            if self._slips[place] * self._slip_acceleration(place, now, theta) > 0.0:
                return
            self._slips[place], self._sticks[place], self._begun[place] = 0, True, theta
            self.kink(now, theta)
        else:
            return
        self._apply()
        self._report(modes, theta)

    def _modes(self) -> list[int]:
        return self._slips.copy()

    def _report(self, before: list[int], theta: float) -> None:
        """Log the modes that have changed."""
        for contact, old, new in zip(self.equations.dry, before, self._slips, strict=True):
            if old != new:
                self.log.append(SlipEvent(theta, contact, new))

    @property
    def directions(self) -> Array:
        """The derivatives of the system's coefficients along each direction."""
        return self._base_directions

    def holds(self, switch: int) -> bool:
        """Return True if the stop of a switch is held."""
        return self.stop_reaction.get(switch) in self.held

    def let_go(self, switch: int, theta: float) -> bool:
        """Open a stop that is held where its reaction vanishes; return False if it is not held."""
        number = self.stop_reaction.get(switch)
        if number is None or number not in self.held:
            return False
        modes = self._modes()
        self._hold(theta, [each for each in self.held if each != number])
        self._report(modes, theta)
        return True

    def after_impact(self, theta: float, stops: Sequence[int] = ()) -> None:
        """Decide all modes again after an impact, which moves what was stuck; `stops` are held if they are pushed."""
        still, modes = _STILL * self._speed(), self._modes()
        touching = [number for number in self._touching(theta, still) if number in {*self.held, *stops}]
        now, candidates = self.read(theta), touching
        for place, law in enumerate(self._laws):
            if law.has_memory:
                continue
            rate = float(now.slip_rates[place])
            if abs(rate) <= still and self._sticks[place]:
                candidates.append(self._reaction[place])  # type: ignore[arg-type]
            elif self._sticks[place] or rate * self._slips[place] < 0.0:
                self._slips[place], self._sticks[place] = (1 if rate > 0.0 else -1), False
                self._begun[place] = theta - 2.0 * _SETTLING
        self._hold(theta, candidates)
        for place, law in enumerate(self._laws):
            if law.has_memory and self._slips[place] and self._slips[place] * float(now.slip_rates[place]) < 0.0:
                self._slips[place], self._sticks[place], self._begun[place] = 0, True, theta
        self._apply()
        self._report(modes, theta)

    def after_stage(self, contact: int, theta: float) -> None:
        """Decide the friction that a contact hosts again after one of its stages has closed or opened."""
        structure, modes = self._layout.structure, self._modes()
        self._forgotten.clear()
        for place, friction in enumerate(self.equations.dry):
            if structure.host(friction) != contact:
                continue
            if self._laws[place].has_memory:
                self._begin_memory(place, theta)
        self._hold(theta, self.held)
        self._report(modes, theta)

    def hosted(self, contact: int) -> bool:
        """Return True if a contact hosts friction."""
        return any(self._layout.structure.host(friction) == contact for friction in self.equations.dry)

    @property
    def present(self) -> Dry | None:
        """The present modes and extensions, for `gapwalk.flow.forces`; None without friction and rigid stops."""
        if not self.count:
            return None
        return Dry(np.array(self._slips, dtype=float), self._state[2 * self.n : self.size].copy())

    def are_right(self, theta: float) -> bool:
        """Return True if the modes are those of the present state, unless it is where they change."""
        now, velocity = self.read(theta), self._speed()
        for place, law in enumerate(self._laws):
            rate, bound = float(now.slip_rates[place]), float(now.breakaways[place])
            if self._slips[place]:
                if self._slips[place] * rate < -_NEAR * velocity:
                    return False
            elif self._sticks[place]:
                if law.has_memory:
                    memory = self._memory[place]
                    assert memory is not None
                    force = float(self.base[self._slots[place].numbers["stiffness"]]) * self._state[2 * self.n + memory]
                else:
                    force = float(now.reactions[self._reaction[place]])  # type: ignore[index]
                if abs(force) > bound * (1.0 + _NEAR):
                    return False
        return True
