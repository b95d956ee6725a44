"""The equations of motion as symbolic expressions, with their exact variational equations.

Each coefficient that is not zero becomes a run-time parameter of the compiled flow, so that one compilation
serves every value. Each stage on each side has a *switch*, 1 while it touches and 0 while it does not, that
multiplies its force: the expressions are smooth, and events at the breakpoints flip the switches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, StageSlots
from gapwalk.model.contact import DampingLaw


@dataclass(frozen=True, eq=False)
class Equations:
    """The right-hand sides for one coefficient layout and one pattern of non-zero coefficients.

    Parameters
    ----------
    layout
        Where the coefficients stand.
    pattern : shape (number of coefficients,), bool
        Which of them take part; the others are zero.
    varying
        For each sensitivity that is wanted, the slots of the coefficients that vary along its direction.

    The run-time parameters are the components of the directions, one direction after the other, then the switches,
    then the weights of the event functions, then the coefficients. The last of all, `1/W`, is in every equation, so
    the integrator has room for them all.
    """

    layout: CoefficientLayout
    pattern: NDArray[np.bool_]
    varying: tuple[NDArray[np.intp], ...] = ()

    @property
    def text(self) -> str:
        """What tells these equations from others, whatever things are called."""
        structure = self.layout.structure
        contacts = [
            (form.damping.value, form.reciprocal, *(stage.side.value for stage in form.stages))
            for form in structure.contacts
        ]
        orders = [form.order for form in structure.harmonics]
        slots = [np.flatnonzero(self.pattern).tolist(), *(slots.tolist() for slots in self.varying)]
        return f"{structure.size} {contacts} {orders} {slots}"

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Slots of the coefficients that take part, in the order of their run-time parameters."""
        return np.roll(np.flatnonzero(self.pattern), -1)

    @cached_property
    def _indices(self) -> dict[int, int]:
        """Run-time parameter of each active slot."""
        return {int(slot): self.first_coefficient + i for i, slot in enumerate(self.active)}

    def first_component(self, index: int) -> int:
        """Run-time parameter of the first component of a direction."""
        return sum(len(slots) for slots in self.varying[:index])

    @cached_property
    def components(self) -> NDArray[np.intp]:
        """Where the components of all directions stand among the coefficients of all directions, one after another."""
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
    def first_coefficient(self) -> int:
        """Run-time parameter of the first coefficient."""
        return self.first_weight + len(self.switches)

    @cached_property
    def switches(self) -> tuple[tuple[int, int], ...]:
        """(contact, stage) of every switch."""
        return tuple(
            (index, stage) for index, contact in enumerate(self.layout.contacts) for stage in range(len(contact.stages))
        )

    @property
    def n_parameters(self) -> int:
        """Number of run-time parameters."""
        return self.first_coefficient + len(self.active)

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
        """Deflection of a contact past a breakpoint, weighed: the stage's event function.

        The integrator counts event functions among what its tolerance is relative to, so one of a breakpoint that is
        far away must weigh no more than the motion.
        """
        slots = self.layout.contacts[contact]
        weight = hy.par[self.first_weight + self.switches.index((contact, stage))]
        return weight * self._depth(self._deflection(slots), slots.stages[stage])

    @cached_property
    def state(self) -> list:
        """``(variable, right-hand side)`` of the 2n equations over theta."""
        kinematics = [(q, self.rate * v) for q, v in zip(self.positions, self.velocities, strict=True)]
        return kinematics + list(zip(self.velocities, self._accelerations, strict=True))

    def fundamental(self) -> list:
        """Equations of the state transition matrix, column by column: 2n columns of 2n variables."""
        size = 2 * self.layout.structure.size
        columns = []
        for j in range(size):
            columns += self._linearised([hy.make_vars(f"phi{i}_{j}") for i in range(size)])
        return columns

    def direction(self, index: int) -> list:
        """Equations of the sensitivity to the coefficients along a direction given at run time."""
        size = 2 * self.layout.structure.size
        first = self.first_component(index)
        equations = self._linearised([hy.make_vars(f"z{i}_{index}") for i in range(size)])
        forced = []
        for (variable, linear), (_, force) in zip(equations, self.state, strict=True):
            terms, used = [linear], _parameter_indices(force)
            for component, slot in enumerate(self.varying[index].tolist()):
                if self._indices[slot] in used:
                    terms.append(hy.diff(force, hy.par[self._indices[slot]]) * hy.par[first + component])
            forced.append((variable, hy.sum(terms)))
        return forced

    def integrals(self) -> list:
        """Equations of the integrals over theta of each position and of its square."""
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
            if np.count_nonzero(self.pattern[contact.deflection]) > 1:
                events.append((contact.deflection, self._dot(contact.deflection, self.velocities)))
        return events

    def _coefficient(self, slot: int):
        """Symbol of one coefficient, or the number 0 where it takes no part."""
        if not self.pattern[slot]:
            return hy.expression(0.0)
        return hy.par[self._indices[int(slot)]]

    def _switch(self, contact: int, stage: int) -> hy.expression:
        return hy.par[self.first_switch + self.switches.index((contact, stage))]

    def _terms(self, slots, symbols) -> list[hy.expression]:
        """Products of coefficients and symbols, without those that are zero."""
        return [
            self._coefficient(slot) * symbol for slot, symbol in zip(slots, symbols, strict=True) if self.pattern[slot]
        ]

    def _dot(self, slots, symbols) -> hy.expression:
        return hy.sum(self._terms(slots, symbols) or [hy.expression(0.0)])

    def _deflection(self, slots: ContactSlots) -> hy.expression:
        return self._dot(slots.deflection, self.positions)

    @cached_property
    def _contact_laws(self) -> list[tuple]:
        """For each contact its force, and the derivatives of that by deflection and by deflection rate."""
        return [self._contact_law(index) for index in range(len(self.layout.contacts))]

    def _contact_law(self, index: int) -> tuple:
        slots, form = self.layout.contacts[index], self.layout.structure.contacts[index]
        x, rate = self._deflection(slots), self._dot(slots.deflection, self.velocities)
        zero = hy.expression(0.0)
        spring, slope, size, growth = [zero], [zero], [zero], [zero]
        for number, stage in enumerate(slots.stages):
            force, tangent = self._spring(x, stage)
            switch = self._switch(index, number)
            weight = 1 if form.damping is DampingLaw.HUNT_CROSSLEY_AS_PRINTED else stage.sign
            spring.append(switch * force)
            slope.append(switch * tangent)
            # each parameter next to a variable: to the integrator a product of parameters is a series like any other
            size.append(weight * (switch * force))
            growth.append(weight * (switch * (tangent * rate)))
        g, k = hy.sum(spring), hy.sum(slope)
        if slots.damping is None or not self.pattern[slots.damping]:
            return g, k, zero
        c = self._coefficient(slots.damping)
        if form.damping is DampingLaw.VISCOUS:
            touching = hy.sum([self._switch(index, number) for number in _first_stages(slots)])
            return g + c * touching * rate, k, c * touching
        magnitude = hy.sum(size)  # of the spring force: |g|, or g as the paper prints it
        return g + c * (magnitude * rate), k + c * hy.sum(growth), c * magnitude

    def _depth(self, x, stage: StageSlots):
        """Deflection past a breakpoint."""
        clearance = self._coefficient(stage.clearance)
        return x - clearance if stage.sign > 0 else x + clearance

    def _spring(self, x, stage: StageSlots) -> tuple:
        depth = self._depth(x, stage)
        force, tangent = self._coefficient(stage.stiffness) * depth, self._coefficient(stage.stiffness)
        if self.pattern[stage.cubic]:
            cubic = self._coefficient(stage.cubic)
            # products, not powers: a symbolic power at exactly 0 gives NaN
            force = force + cubic * (depth * depth * depth)
            tangent = tangent + 3.0 * cubic * (depth * depth)
        return force, tangent

    @cached_property
    def _accelerations(self) -> list:
        n, slots, orders = self.layout.structure.size, self.layout.accelerations, self.layout.orders
        n_contacts = len(self.layout.contacts)
        mean = 2 * n + n_contacts
        cosines = [hy.cos(float(order) * hy.time) for order in orders]
        sines = [hy.sin(float(order) * hy.time) for order in orders]
        rows = []
        for row in slots:
            forces = self._terms(row[: 2 * n], self.positions + self.velocities)
            forces += [
                self._coefficient(row[2 * n + k]) * law[0]
                for k, law in enumerate(self._contact_laws)
                if self.pattern[row[2 * n + k]]
            ]
            loads = [self._coefficient(row[mean])]
            loads += self._terms(row[mean + 1 :], cosines + sines)
            rows.append(self.rate * (hy.sum(loads) - hy.sum(forces)))
        return rows

    def _linearised(self, symbols: list) -> list:
        """The equations linearised about the motion, applied to one column of symbols."""
        n, slots = self.layout.structure.size, self.layout.accelerations
        dq, dv = symbols[:n], symbols[n:]
        equations = [(symbol, self.rate * velocity) for symbol, velocity in zip(dq, dv, strict=True)]
        changes = [
            slope * self._dot(contact.deflection, dq) + damping * self._dot(contact.deflection, dv)
            for contact, (_, slope, damping) in zip(self.layout.contacts, self._contact_laws, strict=True)
        ]
        for symbol, row in zip(dv, slots, strict=True):
            forces = self._terms(row[: 2 * n], symbols)
            forces += [
                self._coefficient(row[2 * n + k]) * change
                for k, change in enumerate(changes)
                if self.pattern[row[2 * n + k]]
            ]
            equations.append((symbol, self.rate * -hy.sum(forces)))
        return equations


def _first_stages(slots: ContactSlots) -> list[int]:
    """The innermost stage on each side, the one that decides whether the contact touches."""
    signs = [stage.sign for stage in slots.stages]
    return [signs.index(sign) for sign in (1, -1) if sign in signs]


def _parameter_indices(expression) -> set[int]:
    """Indices of the run-time parameters on which an expression depends."""
    return {int(str(parameter).removeprefix("p")) for parameter in hy.get_params(expression)}
