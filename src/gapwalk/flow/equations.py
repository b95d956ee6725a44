"""The equations of motion as symbolic expressions, with their exact variational equations.

Each coefficient that is not zero becomes a run-time parameter of the compiled flow, so that one compilation
serves every value. Each stage on each side has a *switch*, 1 while it touches and 0 while it does not, that
multiplies its force: the expressions are smooth, and events at the breakpoints flip the switches. The modes of a law
(`Law.guards`) are such switches too, and so are the levels of variations that jump, which flip at known angles. The
forces are the formulas of the force laws (`gapwalk.model.laws`), and all derivatives are taken of those expressions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, StageSlots, Wave
from gapwalk.model.laws import Stages, StageTerms

EDGE = 1e-7
"""Width of the edges of fractional powers, in units of length: nearer to 0 they are polynomials (`power_edge`)."""
FUNCTIONS = {
    **{name: getattr(hy, name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh")},
    "pow": lambda base, power: (hy.expression(0.0) + base) ** power,
}
"""Functions of formulas, of expressions."""


class _ContactLaw(NamedTuple):
    """Force of a contact; its derivatives by each deflection and its rate; and the guards of its modes."""

    force: hy.expression
    slopes: list[list[hy.expression]]
    guards: list[hy.expression]


@dataclass(frozen=True, eq=False)
class Equations:
    """The right-hand sides for one coefficient layout and one pattern of non-zero coefficients.

    Parameters
    ----------
    layout
        Positions of the coefficients in an array.
    pattern : shape (number of coefficients,), bool
        True for each coefficient that is included; the others are zero.
    varying
        For each sensitivity, the slots of the coefficients that vary along its direction.

    The run-time parameters are the components of the directions, one direction after the other, then the switches,
    then the weights of the event functions, the modes, the levels of the cycles, the unit of length, then the
    coefficients. The last one, `1/W`, occurs in every equation, so heyoka allocates room for all of them.
    """

    layout: CoefficientLayout
    pattern: NDArray[np.bool_]
    varying: tuple[NDArray[np.intp], ...] = ()

    @property
    def text(self) -> str:
        """Text that identifies these equations, independent of the names of coordinates and contacts."""
        structure = self.layout.structure
        contacts = [
            (repr(form.law), form.reciprocal, *(stage.side.value for stage in form.stages))
            for form in structure.contacts
        ]
        variations = [(*variation[:4], [load for load, _ in variation.loads]) for variation in structure.variations]
        slots = [np.flatnonzero(self.pattern).tolist(), *(slots.tolist() for slots in self.varying)]
        return f"{structure.size} {contacts} {list(self.layout.orders)} {variations} {self.layout.cycles} {slots}"

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Slots of the coefficients that are included, in the order of their run-time parameters."""
        return np.roll(np.flatnonzero(self.pattern), -1)

    @cached_property
    def _indices(self) -> dict[int, int]:
        """Run-time parameter of each active slot."""
        return {int(slot): self.first_coefficient + i for i, slot in enumerate(self.active)}

    def first_component(self, index: int) -> int:
        """Return the run-time parameter of the first component of a direction."""
        return sum(len(slots) for slots in self.varying[:index])

    @cached_property
    def components(self) -> NDArray[np.intp]:
        """Indices of the components of all directions, in the joined coefficients of all directions."""
        return np.concatenate([index * len(self.pattern) + slots for index, slots in enumerate(self.varying)])

    @property
    def first_switch(self) -> int:
        """Run-time parameter of the first switch."""
        return self.first_component(len(self.varying))

    @property
    def first_weight(self) -> int:
        """Run-time parameter of the first weight of an event function."""
        return self.first_switch + len(self.switches)

    @property
    def first_mode(self) -> int:
        """Run-time parameter of the first mode of a law."""
        return self.first_weight + len(self.switches)

    @property
    def first_level(self) -> int:
        """Run-time parameter of the first cycle of two levels: 1 at the high one, otherwise 0."""
        return self.first_mode + len(self.modes)

    @property
    def length(self) -> int:
        """Run-time parameter of the unit of length, in units of the model."""
        return self.first_level + len(self.layout.cycles)

    @property
    def first_coefficient(self) -> int:
        """Run-time parameter of the first coefficient."""
        return self.length + 1

    @cached_property
    def formulas(self) -> bool:
        """True if any force is a formula, which may have no value somewhere."""
        return any(not contact.form.law.stage_parameters for contact in self.layout.contacts)

    @cached_property
    def modes(self) -> tuple[tuple[int, int], ...]:
        """(contact, mode of its law) of every mode."""
        return tuple(
            (index, mode)
            for index, contact in enumerate(self.layout.contacts)
            for mode in range(contact.form.law.mode_count)
        )

    @cached_property
    def switches(self) -> tuple[tuple[int, int], ...]:
        """(contact, stage) of every switch."""
        return tuple(
            (index, stage) for index, contact in enumerate(self.layout.contacts) for stage in range(len(contact.stages))
        )

    @cached_property
    def positions(self) -> list:
        """Symbols of the n positions."""
        return [hy.make_vars(f"q{i}") for i in range(self.layout.structure.size)]

    @cached_property
    def velocities(self) -> list:
        """Symbols of the n velocities ``v = dq/dt``."""
        return [hy.make_vars(f"v{i}") for i in range(self.layout.structure.size)]

    @cached_property
    def rate(self) -> hy.expression:
        """Symbol of ``r = 1/W``, by which derivatives over t become derivatives over theta."""
        return self._coefficient(0)

    def gap(self, contact: int, stage: int) -> hy.expression:
        """Return the weighted deflection of a contact past a breakpoint: the stage's event function.

        The tolerance of the integrator is relative to the largest of the variables and the event functions. So the
        event function of a distant breakpoint must not be larger than the motion.
        """
        slots = self.layout.contacts[contact]
        weight = hy.par[self.first_weight + self.switches.index((contact, stage))]
        return weight * self._depth(self._deflection(slots), slots.stages[stage])

    def guard(self, contact: int, mode: int) -> hy.expression:
        """Return the event function of a mode of a law."""
        return self._contact_laws[contact].guards[mode]

    @cached_property
    def state(self) -> list:
        """``(variable, right-hand side)`` of the 2n equations over theta."""
        kinematics = [(q, self.rate * v) for q, v in zip(self.positions, self.velocities, strict=True)]
        return kinematics + list(zip(self.velocities, self._accelerations, strict=True))

    def fundamental(self) -> list:
        """Return the equations of the state transition matrix, column by column: 2n columns of 2n variables."""
        size = 2 * self.layout.structure.size
        columns = []
        for j in range(size):
            columns += self._linearised([hy.make_vars(f"phi{i}_{j}") for i in range(size)])
        return columns

    def direction(self, index: int) -> list:
        """Return the equations of the sensitivity to the coefficients along a direction given at run time."""
        size = 2 * self.layout.structure.size
        first = self.first_component(index)
        equations = self._linearised([hy.make_vars(f"z{i}_{index}") for i in range(size)])
        forced = []
        for (variable, linear), (_, force) in zip(equations, self.state, strict=True):
            terms, used = [linear], {int(str(each).removeprefix("p")) for each in hy.get_params(force)}
            for component, slot in enumerate(self.varying[index].tolist()):
                if self._indices[slot] in used:
                    terms.append(hy.diff(force, hy.par[self._indices[slot]]) * hy.par[first + component])
            forced.append((variable, hy.sum(terms)))
        return forced

    def integrals(self) -> list:
        """Return the equations of the integrals over theta of each position and of its square."""
        firsts = [(hy.make_vars(f"s{i}"), q) for i, q in enumerate(self.positions)]
        return firsts + [(hy.make_vars(f"ss{i}"), q * q) for i, q in enumerate(self.positions)]

    @cached_property
    def turning(self) -> list[tuple[NDArray[np.intp] | None, hy.expression]]:
        """Event functions that vanish where a coordinate or a contact's deflection turns.

        First the n velocities, then the deflection rates of those contacts that depend on more than one coordinate,
        each with the slots of its deflection vector (None for a coordinate).
        """
        events: list[tuple[NDArray[np.intp] | None, hy.expression]] = [(None, v) for v in self.velocities]
        for contact in self.layout.contacts:
            if np.count_nonzero(self.pattern[contact.deflection]) > 1 or contact.sway is not None:
                events.append((contact.deflection, self._deflection_rate(contact)))
        return events

    def _coefficient(self, slot: int):
        """Return the symbol of one coefficient, or the number 0 if it is not included."""
        if not self.pattern[slot]:
            return hy.expression(0.0)
        return hy.par[self._indices[int(slot)]]

    def _terms(self, slots, symbols) -> list[hy.expression]:
        """Return the products of coefficients and symbols, without those that are zero."""
        return [
            self._coefficient(slot) * symbol for slot, symbol in zip(slots, symbols, strict=True) if self.pattern[slot]
        ]

    def _dot(self, slots, symbols) -> hy.expression:
        return hy.sum(self._terms(slots, symbols) or [hy.expression(0.0)])

    def _deflection(self, slots: ContactSlots, argument: int = 0) -> hy.expression:
        moved = self._dot(slots.deflections[argument], self.positions)
        wave = slots.waves.get(slots.form.law.arguments[argument])
        return moved if wave is None else moved + self._wave(wave)

    def _deflection_rate(self, slots: ContactSlots, argument: int = 0) -> hy.expression:
        moved = self._dot(slots.deflections[argument], self.velocities)
        wave = slots.waves.get(slots.form.law.arguments[argument])
        return moved if wave is None else moved + self._wave_rate(wave) / self.rate

    @cached_property
    def _waves(self) -> list[hy.expression]:
        """Cosines, then sines, of all orders."""
        return [wave(float(order) * hy.time) for wave in (hy.cos, hy.sin) for order in self.layout.orders]

    def _wave(self, wave: Wave) -> hy.expression:
        """Return what a number varies by."""
        cycles = [
            factor * (self._coefficient(low) + (self._coefficient(high) - self._coefficient(low)) * level)
            for (_, low, high, *_), level, factor in (
                (self.layout.cycles[number], hy.par[self.first_level + number], factor)
                for number, factor in wave.cycles
            )
        ]
        return hy.sum([*self._terms(wave.lines, self._waves), *cycles] or [hy.expression(0.0)])

    def _wave_rate(self, wave: Wave) -> hy.expression:
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
        return hy.sum(terms or [hy.expression(0.0)])

    @cached_property
    def _contact_laws(self) -> list[_ContactLaw]:
        """Force of each contact with its derivatives."""
        laws, length, switch = [], hy.par[self.length], self.first_switch
        for index, contact in enumerate(self.layout.contacts):
            law = contact.form.law
            # a law without stages may be any formula of lengths: it is evaluated in the unit of the model
            scaled = not law.stage_parameters
            names = law.arguments
            moves = [hy.make_vars(f"deflection{place}", f"deflection_rate{place}") for place in range(len(names))]
            given = [tuple(length * each for each in pair) if scaled else tuple(pair) for pair in moves]
            stages = []
            for stage in contact.stages:
                own = self._named(stage.numbers, stage.waves)
                depth = self._depth(moves[0][0], stage)
                stages.append(StageTerms(stage.sign, depth, hy.par[switch], stage.innermost, own))
                switch += 1
            first = self.first_mode + sum(self.layout.contacts[k].form.law.mode_count for k in range(index))
            arguments = Stages(
                stages,
                hy.sum,
                dict(zip(names, given, strict=True)),
                [hy.par[first + mode] for mode in range(law.mode_count)],
                FUNCTIONS,
            )
            numbers = self._named(contact.numbers, contact.waves) | ({"_edge": EDGE * length} if scaled else {})
            force = hy.expression(0.0) + law.force(given[0][1], arguments, numbers)
            force = force / length if scaled else force
            guards = [hy.expression(0.0) + each for each in law.guards(given[0][1], arguments, numbers)]
            motion = {}
            for place, (x, rate) in enumerate(moves):
                motion[x], motion[rate] = self._deflection(contact, place), self._deflection_rate(contact, place)
            slopes = [[hy.subs(hy.diff(force, each), motion) for each in pair] for pair in moves]
            laws.append(_ContactLaw(hy.subs(force, motion), slopes, [hy.subs(each, motion) for each in guards]))
        return laws

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
                hy.sum([self._coefficient(row[mean]), *self._terms(row[mean + 1 :], self._waves)])
                - hy.sum(self._terms(row[:mean], forces))
            )
            for row in self.layout.accelerations
        ]

    def _linearised(self, symbols: list) -> list:
        """Linearise the equations about the motion, and apply them to one column of symbols."""
        n = self.layout.structure.size
        dq, dv = symbols[:n], symbols[n:]
        changes = [
            hy.sum(
                [
                    part * self._dot(vector, change)
                    for vector, pair in zip(contact.deflections, law.slopes, strict=True)
                    for part, change in zip(pair, (dq, dv), strict=True)
                ]
            )
            for contact, law in zip(self.layout.contacts, self._contact_laws, strict=True)
        ]
        forces = [*symbols, *changes]
        rows = self.layout.accelerations[:, : len(forces)]
        return [
            *((symbol, self.rate * velocity) for symbol, velocity in zip(dq, dv, strict=True)),
            *((symbol, self.rate * -hy.sum(self._terms(row, forces))) for symbol, row in zip(dv, rows, strict=True)),
        ]
