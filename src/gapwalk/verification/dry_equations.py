"""Equations of motion of one system with dry friction or rigid stops in given modes, for verification.

The formulas of limits are those of the laws. Which elements stick or are held is an argument; their reactions are
solved for together: ``(E M^-1 D) reactions = E a``, with the accelerations ``a`` without them. States may be complex:
their imaginary parts, if small, are then changes of the motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.laws.closed_form import Host, Stages
from gapwalk.model.laws.friction import Friction
from gapwalk.model.system import System
from gapwalk.verification.dop853 import between
from gapwalk.verification.independent_equations import Equations

Values = NDArray[Any]

_ALL = slice(None)
_STEP = 1e-150  # of the complex step


@dataclass(eq=False)
class Modes:
    """The modes of a motion.

    Attributes
    ----------
    closed : shape (switches,)
        1 for each stage that acts, otherwise 0.
    slip
        1, -1 or 0, in stick, by the number of each contact with dry friction.
    held
        Switches of rigid stops that are held.
    """

    closed: NDArray[np.float64]
    slip: dict[int, int]
    held: set[int]


class Loading(NamedTuple):
    """Forces in given modes, of some states.

    Attributes
    ----------
    accelerations : shape (L, n)
        Over time.
    forces : shape (L, contacts)
        The force of each contact; of those that stick or are held, the reaction.
    limits, breakaways
        The limit of each dry contact, and the force at which it begins to slip, shape (L,), by its number.
    sliding : shape (L, contacts)
        Rates of the deflections, less the speed of the base.
    """

    accelerations: Values
    forces: Values
    limits: dict[int, Values]
    breakaways: dict[int, Values]
    sliding: Values


class DryEquations(Equations):
    """Equations of one system, for several of its states at once.

    Parameters
    ----------
    system
        The system.
    """

    def __init__(self, system: System) -> None:
        super().__init__([system])
        structure = system.equations.structure
        forms = structure.contacts
        self.omega = float(self.frequency[0])
        self.state_size = structure.state_size
        self.dry = [index for index, form in enumerate(forms) if form.law.is_dry]
        self.memories = {contact: 2 * self.size + place for place, contact in enumerate(structure.memories)}
        self.rigid = [switch for _, switch in structure.reactions if switch >= 0]
        self.stiffnesses = {
            index: float(system.equations[f"{forms[index].name}.stiffness"]) for index in structure.memories
        }
        self._hosts = {index: structure.host(index) for index in self.dry}
        self.unreached = [
            switch for switch, k in enumerate(self.contact_of) if forms[k].law.rebounds and switch not in self.rigid
        ]
        self._pressed = [index for index in self.dry if self._law(index).by == "normal"]
        self._varied_prefixes = {prefix for prefix, _ in self._shares}
        self.creeping = [
            index for index in self.memories if index in self._pressed or forms[index].name in self._varied_prefixes
        ]
        # as complex numbers too, so that products with complex states, a million of them, convert nothing
        own = -np.hstack((self._stiffness[0], self._damping[0])).T, self._shapes[0].T, -self._push[0].T
        self._terms = own, [each.astype(complex) for each in own]
        # a contact that hosts friction comes before the friction
        self._order = sorted(range(len(forms)), key=lambda index: forms[index].law.is_dry)

    def _law(self, index: int) -> Friction:
        law = self._contacts[index].law
        assert isinstance(law, Friction)
        return law

    def host_of(self, index: int) -> int | None:
        """Return the contact that hosts friction; None if there is none."""
        return self._hosts[index]

    def row(self, index: int) -> NDArray[np.float64]:
        """Return the deflection vector of a contact, shape (n,)."""
        return self._vectors[0][self._first[index]]

    def push(self, index: int) -> NDArray[np.float64]:
        """Return the acceleration by the force of a contact, ``M^-1 d``, shape (n,)."""
        return self._push[0][:, index]

    def active(self, modes: Modes) -> list[int]:
        """Return the contacts that have a reaction: friction that sticks rigidly, and stops that are held."""
        stuck = [index for index in self.dry if index not in self.memories and not modes.slip[index]]
        return [*stuck, *(int(self.contact_of[switch]) for switch in sorted(modes.held))]

    def _named(self, prefix: str, numbers: Mapping[str, Any], loads: Values, lanes: Any) -> dict[str, Any]:
        return super()._named(prefix, numbers, loads, lanes) if prefix in self._varied_prefixes else dict(numbers)

    def loading(
        self, angles: Values, states: Values, modes: Modes, levels: Values, *, breakaways: bool = True
    ) -> Loading:
        """Compute accelerations, forces and limits.

        Parameters
        ----------
        angles : shape (L,)
            Angles of the excitation.
        states : shape (L, size)
            Positions, velocities, and extensions.
        modes
            The modes.
        levels : shape (L, loads that jump)
            1 for each load at its high level, otherwise 0.
        breakaways
            False to leave them out.
        """
        n, count = self.size, len(states)
        q, v = states[:, :n], states[:, n : 2 * n]
        loads = self._loads.at(angles, _ALL, levels)
        x, rates = self._moves(angles, q, v, _ALL, loads)
        closed = modes.closed[None]
        forces = np.zeros((count, len(self._contacts)), dtype=np.result_type(states, angles))
        sliding = rates[:, self._first].copy()
        known: dict[int, Stages] = {}
        limits: dict[int, Values] = {}
        bounds: dict[int, Values] = {}
        for index in self._order:
            form, place = self._contacts[index], self._of_contact[index][0]
            stages, numbers = self._arguments(index, loads, x, rates, closed, _ALL)
            self._decided(form, stages, numbers, rates[:, place])
            known[index] = stages
            if isinstance(form.law, Friction):
                host = self._hosts[index]
                slip = stages.slip = modes.slip[index]
                stages.host = None if host is None else Host(known[host], forces[:, host])
                limits[index] = form.law.limit(stages, numbers) + np.zeros(count)
                if breakaways:
                    bounds[index] = form.law.breakaway(stages, numbers) + np.zeros(count)
                if index in self.memories:
                    at_limit = slip * limits[index] / numbers["stiffness"]
                    stages.extension = at_limit if slip else states[:, self.memories[index]]
                sliding[:, index] -= numbers["speed"]
            forces[:, index] = form.law.force(rates[:, place], stages, numbers)
        within, driven, pushed = self._terms[np.iscomplexobj(forces)]
        free = self._mean + loads[:, self._driving] @ driven + states[:, : 2 * n] @ within + forces @ pushed
        if active := self.active(modes):
            rows, pushes = np.array([self.row(each) for each in active]), self._push[0][:, active]
            turning = free @ rows.T + self._swaying(angles)[:, active]
            reactions = np.linalg.solve(rows @ pushes, turning.T).T
            free = free - reactions @ pushes.T
            forces[:, active] = reactions
        return Loading(free, forces, limits, bounds, sliding)

    def turning(self, angles: Values, found: Loading) -> Values:
        """Return the derivatives over time of the slip rates of all contacts, shape (L, contacts)."""
        return found.accelerations @ self._vectors[0][self._first].T + self._swaying(angles)

    def _swaying(self, angles: Values) -> Values:
        """Return the accelerations of what is added to the deflections, shape (L, contacts)."""
        still = np.zeros((len(angles), self.size))
        return self.deflections(angles, still, derivative=2) * self.omega**2 + np.zeros((len(angles), 1))

    def derivatives(self, angles: Values, states: Values, modes: Modes, levels: Values) -> Values:
        """Return the derivatives of states over the angle; of an extension in slip, which its limit determines, 0."""
        n = self.size
        found = self.loading(angles, states, modes, levels, breakaways=False)
        rates = np.zeros(states.shape, dtype=found.accelerations.dtype)
        rates[:, :n], rates[:, n : 2 * n] = states[:, n : 2 * n], found.accelerations
        for index, place in self.memories.items():
            if not modes.slip[index] and not self.is_idle(index, found.limits[index], modes):
                rates[:, place] = found.sliding[:, index]
        return rates / self.omega

    def is_idle(self, index: int, limits: Values, modes: Modes) -> bool:
        """Return True for friction of a contact that is open, so that it has no force."""
        host = self._hosts[index]
        if host is None:
            return False
        opened = not modes.closed[self.contact_of == host].any()
        return opened if index in self._pressed else float(np.real(limits[0])) == 0.0

    def creep(self, index: int, angle: float, state: NDArray[np.float64], modes: Modes, levels: Values) -> float:
        """Return the rate over time of the extension that belongs to the limit of an element; 0 if it is constant."""
        if index not in self.creeping:
            return 0.0
        rates = self.derivatives(np.array([angle]), state[None], modes, levels)[0]
        step = 1j * _STEP
        limits = self.loading(np.array([angle + step]), (state + step * rates)[None], modes, levels).limits[index]
        return float(np.imag(limits[0]) / _STEP * self.omega / self.stiffnesses[index])

    def set_extensions(self, angles: Values, states: Values, modes: Modes, levels: Values) -> None:
        """Set the extension of each slipping element: the one at which its force has the limit."""
        slipping = [index for index in self.memories if modes.slip[index]]
        if slipping:
            limits = self.loading(angles, states, modes, levels).limits
            for index in slipping:
                states[:, self.memories[index]] = modes.slip[index] * limits[index] / self.stiffnesses[index]

    def come_to_rest(self, angles: Values, states: Values, modes: Modes, *, positions: bool = False) -> None:
        """Make the slip rates of all active contacts vanish; with `positions`, set held ones on their breakpoints."""
        active, n = self.active(modes), self.size
        if not active:
            return
        rows, pushes = np.array([self.row(each) for each in active]), self._push[0][:, active]
        rates = self.sliding(angles, states)[:, active]
        states[:, n : 2 * n] -= np.linalg.solve(rows @ pushes, rates.T).T @ pushes.T
        if positions and modes.held:
            held = sorted(modes.held)
            own = [int(self.contact_of[switch]) for switch in held]
            rows, pushes = np.array([self.row(each) for each in own]), self._push[0][:, own]
            deep = (self.depths(self.deflections(angles, states[:, :n])) * self.signs)[:, held]
            states[:, :n] -= np.linalg.solve(rows @ pushes, deep.T).T @ pushes.T

    def sliding(self, angles: Values, states: Values) -> Values:
        """Return the rates of the deflections, less the speed of a base, shape (L, contacts)."""
        n = self.size
        loads = self._loads.at(angles, _ALL)
        rates = self._moves(angles, states[:, :n], states[:, n : 2 * n], _ALL, loads)[1][:, self._first].copy()
        for index in self.dry:
            rates[:, index] -= self._own[index]["speed"]
        return rates

    def rebound(self, switch: int, angles: Values, states: Values) -> None:
        """Reverse the rate at a rigid stop."""
        n, index = self.size, int(self.contact_of[switch])
        law, row, push = self._contacts[index].law, self.row(index), self.push(index)
        loads = self._loads.at(angles, _ALL)
        rate = self._moves(angles, states[:, :n], states[:, n : 2 * n], _ALL, loads)[1][:, self._first[index]]
        numbers = self._named(self._contacts[index].name, self._own[index], loads, _ALL)
        change = law.rebound(rate, numbers) - rate
        states[:, n : 2 * n] += np.outer(change / (row @ push), push)

    def inside(self, shares: Values, h: float, states: Values, rates: Values) -> NDArray[np.float64]:
        """Return the states at some shares of a step over the angle h, from states and rates at its two ends."""
        n, (y0, y1), (r0, r1) = self.size, states, h * rates
        first, last = ([y[:n], r[:n], h * r[n : 2 * n] / self.omega] for y, r in ((y0, r0), (y1, r1)))
        s = shares[:, None]
        q, slope = between(first, last, s)
        # the extensions by a cubic
        d, a, b = y1[2 * n :] - y0[2 * n :], r0[2 * n :], r1[2 * n :]
        z = y0[2 * n :] + s * (a + s * ((3.0 * d - 2.0 * a - b) + s * (a + b - 2.0 * d)))
        found = np.concatenate((q, slope / h * self.omega, z), axis=1)
        found[shares == 1.0] = y1
        return found
