"""The equations of motion as symbolic expressions, with their exact variational equations.

Each coefficient that is not zero becomes a run-time parameter of the compiled flow, so that one compilation
serves every value. Each stage on each side has a *switch*, 1 while it touches and 0 while it does not, that
multiplies its force: the expressions are smooth, and events at the breakpoints flip the switches. The modes of a law
(`Law.guards`) are such switches too, and so are the levels of variations that jump, which flip at known angles. The
forces are the formulas of the force laws (`gapwalk.model.laws`), and all derivatives are taken of those expressions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.run_time import RunTimeParameters
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, StageSlots, Wave, coefficients_of, layout_of
from gapwalk.model.laws import CLEARANCE, Friction, Host, Stages, StageTerms
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind
from gapwalk.taylor.symbols import (
    ANGLE,
    FUNCTIONS,
    ONE,
    ZERO,
    Symbol,
    changed,
    cos,
    derivative,
    number,
    parameter,
    parameters_of,
    replaced,
    sin,
    sqrt,
    total,
    variable,
)

# The unit of length in which a motion is integrated: tolerances of the integrator are absolute below 1.
#
# A gap of 50 micrometres in a model in metres is far below 1, and so are motions of the size 1e-9. Their flow is
# integrated in a power of two of the model's own unit, so that scaling causes no rounding.

_LARGE = 0.01  # size from which motions are integrated in the unit of the model


class LengthUnit:
    """Conversion of coefficients of one layout to another unit of length, and the choice of the unit for a motion."""

    def __init__(self, layout: CoefficientLayout) -> None:
        n, forms, self._layout = layout.structure.size, layout.structure.contacts, layout
        self._size = n
        self._loads = layout.accelerations[:, 2 * n + len(forms) :].ravel()
        self._stiffness, self._damping = layout.accelerations[:, :n], layout.accelerations[:, n : 2 * n]
        self._contacts = layout.accelerations[:, 2 * n : 2 * n + len(forms)]
        numbers = [pair for contact in layout.contacts for pair in contact.parameters()]
        self._clearances = _slots(slot for parameter, slot in numbers if parameter == CLEARANCE)
        self._sways = _slots(slot for contact in layout.contacts for slot in _displacements(contact))
        self._springs = _slots(slot for parameter, slot in numbers if parameter.kind is QuantityKind.STIFFNESS)
        powers = [(slot, parameter.growth) for parameter, slot in numbers if parameter != CLEARANCE]
        self._scaled = [
            (_slots(slot for slot, each in powers if each == power), power)
            for power in sorted({power for _, power in powers if power})
        ]

    def natural(self, coefficients: NDArray[np.float64]) -> float:
        """Return the smaller of the smallest clearance and the amplitude of a free mass under the loads."""
        # It is 1 if both are 0. A clearance that is negligible compared with the motion does not determine its size: in
        # a unit of it, rounding alone would move the motion from one side of such a gap to the other.
        clearances, time = coefficients[self._clearances], coefficients[0]
        gap = float(clearances[clearances > 0.0].min(initial=np.inf))
        load = float(np.abs(coefficients[self._loads]).max(initial=0.0))
        moved = max(load * time**2, float(np.abs(coefficients[self._sways]).max(initial=0.0)))
        if gap < moved:  # then no smaller than the motion against springs, dampers and closed contacts
            damping, stiffness, contacts, springs = (
                float(np.abs(coefficients[slots]).max(initial=0.0))
                for slots in (self._damping, self._stiffness, self._contacts, self._springs)
            )
            gap = max(gap, load / (1.0 / time**2 + (contacts * springs + damping / time + stiffness)))
        return min((size for size in (moved, gap) if 0.0 < size < np.inf), default=1.0)

    def of_motion(self, coefficients: NDArray[np.float64], state: NDArray[np.float64]) -> float:
        """Return the unit for the motion from a state: 1 unless it is small."""
        half, numbers = self._size, state[: 2 * self._size].tolist()
        if max(map(abs, numbers[:half])) >= _LARGE:
            return 1.0
        size = max(*map(abs, numbers[:half]), coefficients[0] * max(map(abs, numbers[half:])))
        size = max(size, self.natural(coefficients))
        return 1.0 if not size < _LARGE else 2.0 ** round(math.log2(size))

    def carried(self, coefficients: NDArray[np.float64], unit: float) -> NDArray[np.float64]:
        """Convert the coefficients of a system, or of a direction of systems, to lengths in that unit."""
        scaled = coefficients.copy()
        for first in range(0, scaled.shape[-1] - 2, len(self._layout)):  # of a ramp also their growth with the speed
            scaled[..., first + self._loads] /= unit
        scaled[..., self._clearances] /= unit
        scaled[..., self._sways] /= unit
        for slots, power in self._scaled:
            scaled[..., slots] *= unit**power
        return scaled


def _displacements(contact: ContactSlots) -> Iterator[int]:
    """Iterate over the slots of the displacements that are added to the deflections of a contact."""
    for argument in contact.form.law.arguments:
        if argument in contact.waves:
            yield from contact.waves[argument].lines.tolist()


def _slots(slots: Iterable[int]) -> NDArray[np.intp]:
    return np.array([*slots], dtype=np.intp)


@lru_cache(maxsize=256)
def _unit_of(structure: Structure) -> LengthUnit:
    return LengthUnit(layout_of(structure))


def natural_length(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> float:
    """Return the length of `LengthUnit.natural` for the coefficients of a system."""
    return _unit_of(layout.structure).natural(coefficients)


def smallness(system: System) -> float:
    """Return the size, at most 1, below which states are negligible: tolerances are relative to it or more."""
    # For systems whose clearances and motions are about 1 or larger it is 1, in the units of the system.
    length = _unit_of(system.structure).natural(coefficients_of(system))
    return length if length < _LARGE else 1.0


def magnitude(state: NDArray[np.float64], system: System) -> float:
    """Return the size of a state of a system, never 0: distances between states are relative to it."""
    return smallness(system) + float(np.abs(state).max())


EDGE = 1e-7
"""Width of the edges of fractional powers, in units of length: nearer to 0 they are polynomials (`power_edge`)."""
_HIDDEN = {"tanh": (-19.0, 19.0), "exp": (-63.0, -54.0, -45.0, -36.0)}
"""Arguments of functions at which their growth becomes visible beside 1, or beside numbers up to 1e10 smaller."""
_SMALL = 1e-4  # factor that keeps event functions smaller than the motion, for each root


class _ContactLaw(NamedTuple):
    """Force of a contact; its derivatives by each deflection and its rate; the guards of its modes; and its friction.

    Each derivative has the slots of the deflection by which it is. `restarts` are expressions that vanish where a new
    Taylor series has to begin.
    """

    force: Symbol
    slopes: list[tuple[NDArray[np.intp], list[Symbol]]]
    guards: list[Symbol]
    limits: tuple[Symbol, Symbol]
    restarts: list[Symbol]


class _Seen(NamedTuple):
    """A contact as its law sees it, in symbols of its own; the motion has the expression of each symbol.

    `calls` are the functions that the law evaluates, with their arguments.
    """

    rate: Symbol
    stages: Stages
    numbers: dict[str, Any]
    moves: list[tuple[Symbol, Symbol]]
    motion: dict[Symbol, Symbol]
    calls: list[tuple[str, Symbol]]


class Equations(RunTimeParameters):
    """The right-hand sides for one coefficient layout and one pattern of non-zero coefficients; see the base class."""

    @cached_property
    def positions(self) -> list:
        """Symbols of the n positions."""
        return [variable(f"q{i}") for i in range(self.layout.structure.size)]

    @cached_property
    def velocities(self) -> list:
        """Symbols of the n velocities ``v = dq/dt``."""
        return [variable(f"v{i}") for i in range(self.layout.structure.size)]

    @cached_property
    def rate(self) -> Symbol:
        """Symbol of ``r = 1/W``, by which derivatives over t become derivatives over theta."""
        return 1.0 / self._speed if self.ramp else self._coefficient(0)

    @cached_property
    def _speed(self) -> Symbol:
        """The speed W of a ramp: its square grows linearly with theta."""
        growth, square = (parameter(self.indices[len(self.pattern) - place]) for place in (2, 1))
        return sqrt(square + growth * ANGLE)

    def gap(self, contact: int, stage: int) -> Symbol:
        """Return the weighted deflection of a contact past a breakpoint: the stage's event function."""
        # The tolerance of the integrator is relative to the largest of the variables and the event functions. So the
        # event function of a distant breakpoint must not be larger than the motion.
        slots, switch = self.layout.contacts[contact], self.switches.index((contact, stage))
        depth = parameter(self.first_weight + switch) * self._depth(self._deflection(slots), slots.stages[stage])
        if switch not in self.stops:
            return depth
        held = parameter(self.first_held + self.stops.index(switch))  # then the reaction ends the contact
        return (1.0 - held) * depth + held * self.reaction(self.layout.structure.reactions.index((contact, switch)))

    def guard(self, contact: int, mode: int) -> Symbol:
        """Return the event function of a mode of a law, which does not vanish while it waits (`ModeSwitches.wait`)."""
        guard = self._contact_laws[contact].guards[mode]
        if not self.may_wait:
            return guard
        waits = parameter(self.first_waiting + self.modes.index((contact, mode)))
        return (1.0 - waits) * guard + waits

    @cached_property
    def restarts(self) -> list[Symbol]:
        """Event functions that vanish where the Taylor series of the motion has to begin again."""
        # The rest of ``tanh(u)`` to 1 or -1 is below rounding where ``|u| > 19``, and so are all its derivatives:
        # nothing in the series shows that the function turns farther on, and a step would lead beyond it. The same
        # holds for ``exp(u)`` far below 0. A step therefore ends where they become visible; from there the series shows
        # it.
        return list(dict.fromkeys(each for law in self._contact_laws for each in law.restarts))

    def slip_guards(self, place: int) -> list[Symbol]:
        """Return the two event functions of friction, by its place in `dry`: one for each direction of slip."""
        # In stick they are what is left to the force at which slip begins. In slip rigid friction, which may turn
        # round, has its slip rate for the first one, and a spring in series for that of its direction; the other one
        # does not vanish. So the force of a spring that stops at its limit is no event of the function that has just
        # had one.
        contact = self.dry[place]
        stick, breakaway = parameter(self.first_stick + place), self._contact_laws[contact].limits[1]
        if not self.layout.contacts[contact].form.law.has_memory:
            force = self.reaction(self.layout.structure.reactions.index((contact, -1)))
            return [
                (1.0 - stick) * self.slip_rate(place) + stick * (breakaway - force),
                (1.0 - stick) + stick * (breakaway + force),
            ]
        force, slip = self._contact_laws[contact].force, parameter(self.first_slip + place)
        return [
            (1.0 - stick) * (0.5 * (1.0 + side * slip) * self.slip_rate(place) + 0.5 * (1.0 - side * slip))
            + stick * (breakaway - side * force)
            for side in (1.0, -1.0)
        ]

    def slip_rate(self, place: int) -> Symbol:
        """Return the rate at which friction slips, or would slip: that of its deflection, less those of its base."""
        # In series with a spring, the spring follows its limit where that is not constant.
        contact = self.dry[place]
        law = self.layout.contacts[contact].form.law
        rate = self._base_rate(contact)
        return rate - parameter(self.first_slip + place) * self.creep(contact) if law.has_memory else rate

    def _base_rate(self, contact: int) -> Symbol:
        slots = self.layout.contacts[contact]
        return self._deflection_rate(slots) - self._coefficient(slots.numbers["speed"])

    def creep(self, contact: int) -> Symbol:
        """Return the rate over time of the extension of a spring at its limit; 0 if the limit is constant."""
        growth = changed(self._contact_laws[contact].limits[0], {**dict(self._motion), ANGLE: ONE})
        if growth == ZERO:
            return growth
        return growth / (self.rate * self._coefficient(self.layout.contacts[contact].numbers["stiffness"]))

    def reaction(self, number: int) -> Symbol:
        """Return a reaction, by its number in the structure: a sum over the columns of the accelerations."""
        row = self.layout.reactions[number]
        forces = [*self.positions, *self.velocities, *(law.force for law in self._contact_laws)]
        mean = len(forces)
        loads = [self._coefficient(row[mean]), *self._terms(row[mean + 1 :], self._waves)]
        return total(loads) - total(self._terms(row[:mean], forces))

    @cached_property
    def readings(self) -> list[Symbol]:
        """Values by which friction and held stops are decided, as functions of the state and the run-time parameters.

        The columns of the accelerations other than positions and velocities: forces of all contacts, 1, waves. Then for
        each friction: its slip rate, the force in slip, and that at which slip begins. Then rates of the extensions.
        """
        found = self._columns.copy()
        for place, contact in enumerate(self.dry):
            found += [self.slip_rate(place), *self._contact_laws[contact].limits]
        found += self._extension_rates
        return [ZERO + each for each in found]

    @cached_property
    def decisions(self) -> list[Symbol]:
        """Values by which friction that changes its mode alone is decided, under the coefficients of what is held."""
        # For each friction: its slip rate, the force in slip, that at which slip begins, the derivative of the slip
        # rate over time with a constant limit, its reaction, and the derivatives by theta of the reaction and of the
        # force at which slip begins. Then the length of the vector of the velocities, and of the positions times W.
        # Then the accelerations.
        found, turning = [], [each / self.rate for each in self._accelerations]
        motion = {**dict(self.state), ANGLE: ONE}
        for place, contact in enumerate(self.dry):
            limits, force = self._contact_laws[contact].limits, ZERO
            bent = changed(self._base_rate(contact), motion) / self.rate
            if (contact, -1) in self.layout.structure.reactions:
                force = self.reaction(self.layout.structure.reactions.index((contact, -1)))
            growths = [changed(each, motion) for each in (force, limits[1])]
            found += [self.slip_rate(place), *limits, bent, force, *growths]
        speeds = [*self.velocities, *(q / self.rate for q in self.positions)]
        speed = sqrt(total([each * each for each in speeds]))
        return [ZERO + each for each in [*found, speed, *turning]]

    @cached_property
    def _columns(self) -> list[Symbol]:
        """Columns of the accelerations other than positions and velocities: forces of all contacts, 1, waves."""
        return [*(law.force for law in self._contact_laws), number(1.0), *self._waves]

    @cached_property
    def tangents(self) -> tuple[list, list[Symbol]]:
        """Changes of the columns of the accelerations and of the limits of friction, and the symbols that they need."""
        # Those are the state, its change, the change of theta, and those of the coefficients of `tangent_slots`.
        state = [*self.positions, *self.velocities, *self.extensions]
        changes = {each: variable(f"d{each.value}") for each in state} | {ANGLE: variable("dtheta")}
        changes |= {parameter(self.indices[slot]): variable(f"dp{slot}") for slot in self.tangent_slots}
        return [*state, *changes.values()], [changed(each, changes) for each in self._bounded]

    @cached_property
    def _bounded(self) -> list[Symbol]:
        limits = [limit for contact in self.dry for limit in self._contact_laws[contact].limits]
        return [ZERO + each for each in [*self._columns, *limits]]

    @cached_property
    def tangent_slots(self) -> list[int]:
        """Slots of the coefficients that directions change, and that `tangents` depend on."""
        used = set[int]().union(*map(parameters_of, self._bounded))
        varying = sorted({int(slot) for slots in self.varying for slot in slots})
        return [slot for slot in varying if self.indices[slot] in used]

    @cached_property
    def extensions(self) -> list:
        """Symbols of the states of the contacts with a memory."""
        return [variable(f"z{i}m") for i in range(len(self.layout.structure.memories))]

    @cached_property
    def _motion(self) -> list:
        kinematics = [(q, self.rate * v) for q, v in zip(self.positions, self.velocities, strict=True)]
        return kinematics + list(zip(self.velocities, self._accelerations, strict=True))

    @cached_property
    def state(self) -> list:
        """``(variable, right-hand side)`` of the equations over theta: of positions, velocities and extensions."""
        memories = zip(self.extensions, self._extension_rates, strict=True)
        return self._motion + [(z, self.rate * rate) for z, rate in memories]

    @cached_property
    def _extension_rates(self) -> list[Symbol]:
        """Rate of each extension over time: of its deflection in stick; in slip it follows the limit."""
        found = []
        for contact in self.layout.structure.memories:
            place = self.dry.index(contact)
            slip, stick = parameter(self.first_slip + place), parameter(self.first_stick + place)
            found.append(stick * self._base_rate(contact) + slip * self.creep(contact))
        return found

    @cached_property
    def column(self) -> list[tuple[Symbol, Symbol]]:
        """Equations of a change of the state, the same for each column of the transition matrix."""
        return self._linearised([variable(f"d{symbol.value}") for symbol, _ in self.state])

    def forcing(self, index: int) -> list[Symbol]:
        """Return what is added to these equations for the coefficients along a direction given at run time."""
        slots, first = self.varying[index].tolist(), self.first_component(index)
        changes = {parameter(self.indices[slot]): parameter(first + place) for place, slot in enumerate(slots)}
        return [changed(force, changes) for _, force in self.state]

    def integrals(self) -> list:
        """Return the equations of the integrals over theta of each position and of its square."""
        firsts = [(variable(f"s{i}"), q) for i, q in enumerate(self.positions)]
        return firsts + [(variable(f"ss{i}"), q * q) for i, q in enumerate(self.positions)]

    @cached_property
    def turning(self) -> list[tuple[NDArray[np.intp] | None, Symbol]]:
        """Event functions that vanish where a coordinate or a contact's deflection turns."""
        # First the n velocities, then the deflection rates of those contacts that depend on more than one coordinate,
        # each with the slots of its deflection vector (None for a coordinate).
        events: list[tuple[NDArray[np.intp] | None, Symbol]] = [(None, v) for v in self.velocities]
        for contact in self.layout.contacts:
            if np.count_nonzero(self.pattern[contact.deflection]) > 1 or contact.sway is not None:
                events.append((contact.deflection, self._deflection_rate(contact)))
        return events

    @cached_property
    def reversals(self) -> list[Symbol]:
        """The rate of the deflection of each contact, if motions are smooth but for contacts that stand still."""
        contacts = self.layout.contacts
        is_plain = not (self.ramp or self.dry or self.stops or self.modes or self.layout.cycles)
        is_plain = is_plain and all(each.sway is None for each in contacts)
        return [self._deflection_rate(each) for each in contacts] if is_plain and self.switches else []

    def _coefficient(self, slot: int):
        """Return the symbol of one coefficient, or the number 0 if it is not included."""
        if not self.pattern[slot]:
            return ZERO
        found, count = parameter(self.indices[int(slot)]), len(self.layout)
        for power in (1, 2) if self.ramp else ():
            if self.pattern[slot + power * count]:
                found = found + parameter(self.indices[slot + power * count]) * self._speed**power
        return found

    def _terms(self, slots, symbols) -> list[Symbol]:
        """Return the products of coefficients and symbols, without those that are zero."""
        return [
            self._coefficient(slot) * symbol for slot, symbol in zip(slots, symbols, strict=True) if self.pattern[slot]
        ]

    def _dot(self, slots, symbols) -> Symbol:
        return total(self._terms(slots, symbols))

    def _deflection(self, slots: ContactSlots, argument: int = 0) -> Symbol:
        moved = self._dot(slots.deflections[argument], self.positions)
        wave = slots.waves.get(slots.form.law.arguments[argument])
        return moved if wave is None else moved + self._wave(wave)

    def _deflection_rate(self, slots: ContactSlots, argument: int = 0) -> Symbol:
        moved = self._dot(slots.deflections[argument], self.velocities)
        wave = slots.waves.get(slots.form.law.arguments[argument])
        return moved if wave is None else moved + self._wave_rate(wave) / self.rate

    @cached_property
    def _waves(self) -> list[Symbol]:
        """Cosines, then sines, of all orders."""
        return [wave(float(order) * ANGLE) for wave in (cos, sin) for order in self.layout.orders]

    def _wave(self, wave: Wave) -> Symbol:
        """Return the variation of a number."""
        cycles = [
            factor * (self._coefficient(low) + (self._coefficient(high) - self._coefficient(low)) * level)
            for (_, low, high, *_), level, factor in (
                (self.layout.cycles[number], parameter(self.first_level + number), factor)
                for number, factor in wave.cycles
            )
        ]
        return total([*self._terms(wave.lines, self._waves), *cycles])

    def _wave_rate(self, wave: Wave) -> Symbol:
        """Return the derivative of a displacement by theta."""
        count, orders = len(self.layout.orders), self.layout.orders
        terms = [
            *(
                float(order) * self._coefficient(slot) * cosine
                for order, slot, cosine in zip(orders, wave.lines[count:], self._waves[:count], strict=True)
                if self.pattern[slot]
            ),
            *(
                -float(order) * self._coefficient(slot) * sine
                for order, slot, sine in zip(orders, wave.lines[:count], self._waves[count:], strict=True)
                if self.pattern[slot]
            ),
        ]
        return total(terms)

    @cached_property
    def _contact_laws(self) -> list[_ContactLaw]:
        """Force of each contact with its derivatives."""
        laws, length = [], parameter(self.length)
        for index, contact in enumerate(self.layout.contacts):
            law, seen = contact.form.law, self._seen(index)
            vectors, moves, motion = list(contact.deflections), seen.moves, seen.motion
            host = self.layout.structure.host(index)
            if host is not None:
                other = self._seen(host, "host_")
                outside = self.layout.contacts[host]
                seen.stages.host = Host(other.stages, outside.form.law.force(other.rate, other.stages, other.numbers))
                vectors, moves, motion = [*vectors, *outside.deflections], moves + other.moves, motion | other.motion
            force = ZERO + law.force(seen.rate, seen.stages, seen.numbers)
            force = force / length if law.is_formula else force
            guards = [ZERO + each for each in law.guards(seen.rate, seen.stages, seen.numbers)]
            limits = [ZERO] * 2
            if isinstance(law, Friction):
                limits = [ZERO + each(seen.stages, seen.numbers) for each in (law.limit, law.breakaway)]
            slopes = [
                (vector, replaced([derivative(force, each) for each in pair], motion))
                for vector, pair in zip(vectors, moves, strict=True)
            ]
            force, low, high, *guards = replaced([force, *limits, *guards], motion)
            calls = replaced([each for _, each in seen.calls], motion)
            restarts = [_restart(name, each) for (name, _), each in zip(seen.calls, calls, strict=True)]
            restarts = [each for each in restarts if not each.is_constant]
            laws.append(_ContactLaw(force, slopes, guards, (low, high), restarts))
        return laws

    def _seen(self, index: int, prefix: str = "") -> _Seen:
        """Return a contact as its law sees it, in symbols of its own that begin with a prefix."""
        contact, length = self.layout.contacts[index], parameter(self.length)
        law, names = contact.form.law, contact.form.law.arguments
        moves = [
            (variable(f"{prefix}deflection{place}"), variable(f"{prefix}deflection_rate{place}"))
            for place in range(len(names))
        ]
        given = [(length * x, length * rate) if law.is_formula else (x, rate) for x, rate in moves]
        first, stages = self.first_switch + sum(len(each.stages) for each in self.layout.contacts[:index]), []
        for place, stage in enumerate(contact.stages):
            own = self._named(stage.numbers, stage.waves)
            depth = self._depth(moves[0][0], stage)
            stages.append(StageTerms(stage.sign, depth, parameter(first + place), stage.innermost, own))
        first = self.first_mode + sum(each.form.law.mode_count for each in self.layout.contacts[:index])
        modes = [parameter(first + mode) for mode in range(law.mode_count)]
        calls: list[tuple[str, Symbol]] = []
        functions = {**FUNCTIONS, **{name: partial(_noted, calls, name) for name in _HIDDEN}}
        arguments = Stages(stages, total, dict(zip(names, given, strict=True)), modes, functions)
        if index in self.dry:
            arguments.slip = parameter(self.first_slip + self.dry.index(index))
        if index in self.layout.structure.memories:
            arguments.extension = self.extensions[self.layout.structure.memories.index(index)]
        numbers = self._named(contact.numbers, contact.waves) | ({"_edge": EDGE * length} if law.is_formula else {})
        motion = {}
        for place, (x, rate) in enumerate(moves):
            motion[x], motion[rate] = self._deflection(contact, place), self._deflection_rate(contact, place)
        return _Seen(given[0][1], arguments, numbers, moves, motion, calls)

    def _named(self, slots: Mapping[str, int], waves: Mapping[str, Wave]) -> dict[str, Any]:
        """Return the symbols of some parameters by name."""
        return {
            name: self._coefficient(slot) * (1.0 + self._wave(waves[name]))
            if name in waves
            else self._coefficient(slot)
            for name, slot in slots.items()
        }

    def _depth(self, x, stage: StageSlots):
        """Return the deflection past a breakpoint."""
        clearance = self._coefficient(stage.clearance)
        return x - clearance if stage.sign > 0 else x + clearance

    @cached_property
    def _accelerations(self) -> list:
        mean = 2 * self.layout.structure.size + len(self.layout.contacts)
        forces = [*self.positions, *self.velocities, *(law.force for law in self._contact_laws)]
        return [
            self.rate
            * (
                total([self._coefficient(row[mean]), *self._terms(row[mean + 1 :], self._waves)])
                - total(self._terms(row[:mean], forces))
            )
            for row in self.layout.accelerations
        ]

    def _linearised(self, symbols: list) -> list:
        """Linearise the equations about the motion, and apply them to one column of symbols."""
        n, memories = self.layout.structure.size, self.layout.structure.memories
        dq, dv, dz = symbols[:n], symbols[n : 2 * n], symbols[2 * n :]
        moved = {each: change for (each, _), change in zip(self.state, symbols, strict=True)}
        changes = []
        for index, law in enumerate(self._contact_laws):
            parts = [
                part * self._dot(vector, change)
                for vector, pair in law.slopes
                for part, change in zip(pair, (dq, dv), strict=True)
            ]
            if index in memories:
                place = memories.index(index)
                parts.append(derivative(law.force, self.extensions[place]) * dz[place])
            changes.append(total(parts))
        forces = [*symbols[: 2 * n], *changes]
        rows = self.layout.accelerations[:, : len(forces)]
        return [
            *((symbol, self.rate * velocity) for symbol, velocity in zip(dq, dv, strict=True)),
            *((symbol, self.rate * -total(self._terms(row, forces))) for symbol, row in zip(dv, rows, strict=True)),
            *((symbol, changed(rate, moved)) for symbol, (_, rate) in zip(dz, self.state[2 * n :], strict=True)),
        ]


def _noted(calls: list[tuple[str, Symbol]], name: str, argument: Any) -> Symbol:
    """Return a function of an argument, and note that it was evaluated."""
    calls.append((name, ZERO + argument))
    return FUNCTIONS[name](argument)


def _restart(name: str, argument: Symbol) -> Symbol:
    """Return an expression that vanishes where the growth of a function becomes visible."""
    found = number(1.0)
    for place in _HIDDEN[name]:
        found = found * (_SMALL * (argument - place))
    return found


# Where a motion is relative to the breakpoints of all stages, in plain numbers.
#
# These are read at every event of a motion, of which there are thousands in a walk: a few numbers of a list are
# several times faster than arrays.

_CLOSE = 1e-6  # relative distance of two breakpoints of a contact within which they may coincide by rounding


class BreakpointGeometry:
    """Geometry of the breakpoints of one compiled integrator.

    Shapes: `signs` (count,).

    Attributes
    ----------
    signs : shape (count,)
        Side of each switch: 1 or -1.
    """

    _state: Any
    _parameters: Any
    _coefficients: NDArray[np.float64]

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        layout = equations.layout
        contacts = [layout.contacts[k] for k, _ in equations.switches]
        stages = [layout.contacts[k].stages[j] for k, j in equations.switches]
        self.n, self.size = layout.structure.size, layout.structure.state_size
        self.count = len(stages)
        self.signs = np.array([stage.sign for stage in stages], dtype=float)
        self._breaks = np.array([stage.clearance for stage in stages], dtype=np.intp)
        self._deflections = np.array([contact.deflection for contact in contacts]).reshape(self.count, self.n)
        self._signs = self.signs.tolist()
        self._sways = [contact.sway for contact in contacts]
        self._swaying = [switch for switch, sway in enumerate(self._sways) if sway is not None]
        moving = [sway for sway in self._sways if sway is not None]
        self._geometry = np.concatenate((self._deflections.ravel(), self._breaks, *moving))
        self._orders = np.array(layout.orders, dtype=float)
        self._known, self._weights = b"", equations.first_weight

    def _read_geometry(self, coefficients: NDArray) -> None:
        """Read deflection vectors and breakpoints as plain numbers, only when they have changed."""
        known = coefficients[self._geometry].tobytes()
        if known == self._known:
            return
        self._known = known
        self._vectors = coefficients[self._deflections]
        self._offsets = (self.signs * coefficients[self._breaks]).tolist()
        self._scales = [1.0 + abs(offset) for offset in self._offsets]
        self._scale = max(self._scales)
        weights = [min(1.0, 1.0 / abs(offset)) if offset else 1.0 for offset in self._offsets]
        self._parameters[self._weights : self._weights + self.count] = weights
        self._rows = [tuple((int(i), float(vector[i])) for i in np.flatnonzero(vector)) for vector in self._vectors]
        self._simultaneous = [self._possibly_simultaneous(switch) for switch in range(self.count)]
        # deflections of one coordinate each, the usual case, are compared with their breakpoints fastest
        plain = not self._swaying and all(len(row) == 1 for row in self._rows)
        rows = zip(self._signs, self._rows, self._offsets, strict=True)
        self._plain = [(*row[0], sign, offset) for sign, row, offset in rows] if plain else None
        self._rate_rows = [tuple((self.n + i, factor) for i, factor in row) for row in self._rows]
        self._lines = [None if sway is None else coefficients[sway] for sway in self._sways]

    def _sway(self, switch: int, theta: float, derivative: int = 0) -> float:
        """Return the displacement that is added to the deflection of a switch, or a derivative of it by theta."""
        lines, count = self._lines[switch], len(self._orders)
        if lines is None:
            return 0.0
        angles = self._orders * theta + 0.5 * math.pi * derivative
        powers = self._orders**derivative
        return float(lines[:count] @ (powers * np.cos(angles)) + lines[count:] @ (powers * np.sin(angles)))

    def _possibly_simultaneous(self, switch: int) -> tuple[int, ...]:
        """Return the switches that may change simultaneously: of other contacts, and of breakpoints close by."""
        contact, offset = self.equations.switches[switch][0], self._offsets[switch]
        others = enumerate(zip(self.equations.switches, self._offsets, strict=True))
        return tuple(
            other
            for other, ((k, _), place) in others
            if other != switch and (k != contact or abs(place - offset) <= _CLOSE * self._scales[switch])
        )

    def _depths(self, positions: list[float], theta: float) -> list[float]:
        """Return the penetration of each stage (> 0), or the distance from it (< 0)."""
        if self._plain is not None:
            return [sign * (factor * positions[i] - offset) for i, factor, sign, offset in self._plain]
        depths = [
            sign * (sum([factor * positions[i] for i, factor in row]) - offset)
            for sign, row, offset in zip(self._signs, self._rows, self._offsets, strict=True)
        ]
        for switch in self._swaying:
            depths[switch] += self._signs[switch] * self._sway(switch, theta)
        return depths

    def _are_near(self, depths: list[float], state: list[float], share: float) -> list[bool]:
        """Return which breakpoints the motion is on, within a share of the size of the motion and the breakpoint."""
        size = self._size(state)
        return [abs(depth) <= share * (scale + size) for depth, scale in zip(depths, self._scales, strict=True)]

    def _size(self, state: list[float]) -> float:
        """Return the size of the motion: of its positions, now or a quarter of a period later."""
        return max(*map(abs, state[: self.n]), float(self._coefficients[0]) * max(map(abs, state[self.n :])))

    def _rate(self, switch: int, theta: float) -> float:
        """Return the rate of the deflection of a switch over time."""
        rate = 0.0
        for i, factor in self._rate_rows[switch]:
            rate += factor * self._state.item(i)
        if self._lines[switch] is not None:
            rate += self._sway(switch, theta, 1) / float(self._coefficients[0])
        return rate
