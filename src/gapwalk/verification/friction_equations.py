"""Equations of motion of one system with dry friction or rigid stops in given modes, for verification.

The formulas of limits are those of the laws. Which elements stick or are held is an argument; their reactions are
solved for together: ``(E M^-1 D) reactions = E a``, with the accelerations ``a`` without them. States may be complex:
their imaginary parts, if small, are then changes of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.laws.friction import Friction
from gapwalk.model.laws.law import Host, Stages
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.dop853 import between
from gapwalk.verification.independent_equations import Equations, Lanes, of_lanes, times

Values = NDArray[Any]
Key = tuple[str, int]
"""An event: ``"contact"`` with the number of a switch, or ``"slip"`` with that of a contact."""

PAUSE = 1e-6
"""Slip rate, relative to the velocities, by which slip may reverse in a pause."""

_ALL = slice(None)
_STEP = 1e-150  # of the complex step


@dataclass(eq=False)
class Modes:
    """The modes of a motion."""

    closed: NDArray[np.float64]  #: shape (switches,): 1 for each stage that acts, otherwise 0.
    slip: dict[int, int]  #: 1, -1 or 0, in stick, by the number of each contact with dry friction.
    held: set[int]  #: Switches of rigid stops that are held.
    #: Jenkins elements that slip on, though their slip rate reverses for a moment: they would be back at their limit
    #: before rounding shows.
    pausing: set[int] = field(default_factory=set)

    @property
    def key(self) -> Hashable:
        """Equal for equal modes."""
        return self.closed.tobytes(), *self.slip.items(), frozenset(self.held), frozenset(self.pausing)


class Loading(NamedTuple):
    """Forces in given modes, of some states."""

    accelerations: Values  #: shape (L, n): Over time.
    forces: Values  #: shape (L, contacts): The force of each contact; of those that stick or are held, the reaction.
    #: limits, breakaways: The limit of each dry contact, and the force at which it begins to slip, shape (L,), by its
    #: number.
    limits: dict[int, Values]
    breakaways: dict[int, Values]
    sliding: Values  #: shape (L, contacts): Rates of the deflections, less the speed of the base.


class Sizes(NamedTuple):
    """Sizes of motions, one or one for each lane: lengths, and velocities."""

    length: Values
    speed: Values


class DryEquations(Equations):
    """Equations of some systems of one structure, for several states at once.

    Where `lanes` is not given, there is one system, or one state for each.
    """

    def __init__(self, systems: Sequence[System]) -> None:
        super().__init__(systems)
        structure = systems[0].equations.structure
        forms = structure.contacts
        self.omega = float(self.frequency[0])
        self.state_size = structure.state_size
        self.dry = [index for index, form in enumerate(forms) if form.law.is_dry]
        self.memories = {contact: 2 * self.size + place for place, contact in enumerate(structure.memories)}
        self.rigid = [switch for _, switch in structure.reactions if switch >= 0]
        self.stiffnesses = {index: float(self._own[index]["stiffness"][0]) for index in structure.memories}
        self._hosts = {index: structure.host(index) for index in self.dry}
        self.unreached = [
            switch for switch, k in enumerate(self.contact_of) if forms[k].law.rebounds and switch not in self.rigid
        ]
        self._pressed = [index for index in self.dry if self._law(index).by == "normal"]
        self._varied_prefixes = {prefix for prefix, _ in self._shares}
        self.creeping = [
            index for index in self.memories if index in self._pressed or forms[index].name in self._varied_prefixes
        ]
        self._within = -np.concatenate((self._stiffness, self._damping), axis=2)
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
        """Return the deflection vector of a contact, shape (n,), of the first system."""
        return self._vectors[0][self._first[index]]

    def push(self, index: int) -> NDArray[np.float64]:
        """Return the acceleration by the force of a contact, ``M^-1 d``, shape (n,), of the first system."""
        return self._push[0][:, index]

    def force_of(self, index: int, sizes: Sizes, lanes: Lanes = _ALL) -> Values:
        """Return the force that would give a contact the accelerations of a motion of some size."""
        drag = of_lanes(self._drag, lanes)[:, self._first[index]]
        return sizes.speed * self.frequency[lanes] / np.abs(drag)

    def active(self, modes: Modes) -> list[int]:
        """Return the contacts that have a reaction: friction that sticks rigidly, and stops that are held."""
        stuck = [index for index in self.dry if index not in self.memories and not modes.slip[index]]
        return [*stuck, *(int(self.contact_of[switch]) for switch in sorted(modes.held))]

    def _named(self, prefix: str, numbers: Mapping[str, Any], loads: Values, lanes: Any) -> dict[str, Any]:
        if prefix in self._varied_prefixes:
            return super()._named(prefix, numbers, loads, lanes)
        return {name: of_lanes(values, lanes) for name, values in numbers.items()}

    def loading(
        self,
        angles: Values,
        states: Values,
        modes: Modes,
        levels: Values,
        lanes: Lanes = _ALL,
        *,
        breakaways: bool = True,
    ) -> Loading:
        """Compute accelerations, forces and limits."""
        # Shapes: `angles` (L,); `states` (L, size); `levels` (L, loads that jump).
        n, count = self.size, len(states)
        q, v = states[:, :n], states[:, n : 2 * n]
        loads = self._loads.at(angles, lanes, levels)
        x, rates = self._moves(angles, q, v, lanes, loads)
        closed = modes.closed[None]
        forces = np.zeros((count, len(self._contacts)), dtype=np.result_type(states, angles))
        sliding = rates[:, self._first].copy()
        known: dict[int, Stages] = {}
        limits: dict[int, Values] = {}
        bounds: dict[int, Values] = {}
        for index in self._order:
            form, place = self._contacts[index], self._of_contact[index][0]
            stages, numbers = self._arguments(index, loads, x, rates, closed, lanes)
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
        free = (
            of_lanes(self._mean, lanes)
            + times(of_lanes(self._shapes, lanes), loads[:, self._driving])
            + times(of_lanes(self._within, lanes), states[:, : 2 * n])
            - times(of_lanes(self._push, lanes), forces)
        )
        if active := self.active(modes):
            rows, pushes = of_lanes(self._vectors, lanes)[:, self._first[active]], of_lanes(self._push, lanes)
            turning = times(rows, free) + self._swaying(angles, lanes)[:, active]
            matrices = rows @ pushes[:, :, active]
            alike = len(matrices) == 1
            reactions = (
                np.linalg.solve(matrices[0], turning.T).T
                if alike
                else np.linalg.solve(matrices, turning[:, :, None])[:, :, 0]
            )
            free = free - times(pushes[:, :, active], reactions)
            forces[:, active] = reactions
        return Loading(free, forces, limits, bounds, sliding)

    def turning(self, angles: Values, found: Loading) -> Values:
        """Return the derivatives over time of the slip rates of all contacts, shape (L, contacts), of one system."""
        return found.accelerations @ self._vectors[0][self._first].T + self._swaying(angles)

    def _swaying(self, angles: Values, lanes: Lanes = _ALL) -> Values:
        """Return the accelerations of what is added to the deflections, shape (L, contacts)."""
        if not self._displaced.any():
            return np.zeros((len(angles), len(self._contacts)))
        still = np.zeros((len(angles), self.size))
        return self.deflections(angles, still, lanes, derivative=2) * self.frequency[lanes, None] ** 2

    def derivatives(self, angles: Values, states: Values, modes: Modes, levels: Values, lanes: Lanes = _ALL) -> Values:
        """Return the derivatives of states over the angle; of an extension in slip, which its limit determines, 0."""
        n = self.size
        found = self.loading(angles, states, modes, levels, lanes, breakaways=False)
        rates = np.zeros(states.shape, dtype=found.accelerations.dtype)
        rates[:, :n], rates[:, n : 2 * n] = states[:, n : 2 * n], found.accelerations
        for index, place in self.memories.items():
            if not modes.slip[index]:
                idle = self.is_idle(index, found.limits[index], modes)
                rates[:, place] = np.where(idle, 0.0, found.sliding[:, index])
        return rates / self.frequency[lanes, None]

    def is_idle(self, index: int, limits: Values, modes: Modes) -> NDArray[np.bool_]:
        """Return True for each limit of friction of a contact that is open, so that it has no force."""
        host = self._hosts[index]
        if host is None:
            return np.zeros(len(limits), dtype=bool)
        if index in self._pressed:
            return np.full(len(limits), not modes.closed[self.contact_of == host].any())
        return np.real(limits) == 0.0

    def creep(
        self, index: int, angles: Values, states: Values, modes: Modes, levels: Values, lanes: Lanes = _ALL
    ) -> NDArray[np.float64]:
        """Return the rates over time of the extension that belongs to the limit of an element; 0 if it is constant."""
        if index not in self.creeping:
            return np.zeros(len(states))
        angles, states = np.real(angles), np.real(states)
        rates, step = self.derivatives(angles, states, modes, levels, lanes), 1j * _STEP
        limits = self.loading(angles + step, states + step * rates, modes, levels, lanes).limits[index]
        stiffness = of_lanes(self._own[index]["stiffness"], lanes)
        return np.imag(limits) / _STEP * self.frequency[lanes] / stiffness

    def mode_guards(
        self, angles: Values, states: Values, modes: Modes, levels: Values, sizes: Sizes, lanes: Lanes = _ALL
    ) -> dict[Key, Values]:
        """Return the guards of some modes, as shares of their scales: a mode lasts while its guard is positive."""
        # Of friction without force it is 1.
        n = self.size
        now, found = self.loading(angles, states, modes, levels, lanes), dict[Key, Values]()
        depths = self.depths(self.deflections(angles, states[:, :n], lanes), lanes)
        for switch, sign in enumerate(self.signs):
            index = int(self.contact_of[switch])
            if switch in modes.held:
                found["contact", switch] = sign * now.forces[:, index] / self.force_of(index, sizes, lanes)
            elif switch not in self.unreached:
                side = 1.0 if modes.closed[switch] else -1.0
                found["contact", switch] = side * depths[:, switch] / sizes.length
        for index in self.dry:
            slip, limits = modes.slip[index], now.limits[index]
            forces = now.forces[:, index]
            if index not in self.memories:
                left = now.breakaways[index] - np.where(np.real(forces) > 0.0, forces, -forces)
                size = np.maximum(self.force_of(index, sizes, lanes), np.real(now.breakaways[index]))
                found["slip", index] = slip * now.sliding[:, index] / sizes.speed if slip else left / size
                continue
            if slip:
                rates = slip * now.sliding[:, index] + (PAUSE * sizes.speed if index in modes.pausing else 0.0)
                left = (rates - self.creep(index, angles, states, modes, levels, lanes)) / sizes.speed
            else:
                left = limits - np.where(np.real(forces) > 0.0, forces, -forces)
                left = left / (of_lanes(self._own[index]["stiffness"], lanes) * sizes.length)
            found["slip", index] = np.where(self.is_idle(index, limits, modes), 1.0, left)
        return found

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

    def inside(
        self, shares: Values, h: Values, states: Values, rates: Values, lanes: Lanes = _ALL
    ) -> NDArray[np.float64]:
        """Return states at some shares of steps, from states and rates at their two ends, shape (L, shares, size)."""
        # Shapes: `h` (L,); `states`, `rates` (2, L, size).
        n, omega, turns = self.size, self.frequency[lanes, None, None], h[:, None, None]
        (y0, y1), (r0, r1) = states[:, :, None], turns * rates[:, :, None]
        first, last = ([y[..., :n], r[..., :n], turns * r[..., n : 2 * n] / omega] for y, r in ((y0, r0), (y1, r1)))
        s = shares[:, None]
        q, slope = between(first, last, s)
        # the extensions by a cubic
        d, a, b = y1[..., 2 * n :] - y0[..., 2 * n :], r0[..., 2 * n :], r1[..., 2 * n :]
        z = y0[..., 2 * n :] + s * (a + s * ((3.0 * d - 2.0 * a - b) + s * (a + b - 2.0 * d)))
        found = np.concatenate((q, slope / turns * omega, z), axis=-1)
        return np.where((shares == 1.0)[:, None], y1, found)


# Comparison of the stored events of an orbit with friction or rigid stops with those that verification finds.

_PERIOD = 2.0 * math.pi
_SOFTEST = 3e-5  # speed of an impact over that of the motion whose depth, its square, is within the bound of closure
_TOGETHER = 1e-3  # radians within which two records of an impact may be one


class Change(NamedTuple):
    """An event: ``"contact"`` with the number of a switch, or ``"slip"`` with that of a contact; the mode after it.

    `slope` is the derivative of its guard over the angle, as a share of the size of the motion.
    """

    kind: str
    number: int
    mode: int
    theta: float
    slope: float


def mismatch(orbit: Orbit, changes: Sequence[Change]) -> float:
    """Compare the stored events of an orbit with those that were found, and return the largest difference."""
    # Where modes differ over some angle, it is that angle times the slope of the guard: about how far the motion is
    # then on the wrong side. Impacts are compared one by one, but for the last ones of those that end in a held
    # contact.
    rigid = {switch for _, switch in orbit.system.structure.reactions if switch >= 0}
    end = _PERIOD * orbit.period
    stored = [Change("contact", each.switch, int(each.enters), each.theta, 1.0) for each in orbit.events]
    stored += [Change("slip", each.contact, each.slip, each.theta, 1.0) for each in orbit.slips]
    worst = 0.0
    for key in sorted({(each.kind, each.number) for each in (*stored, *changes)}):
        theirs, ours = ([each for each in those if (each.kind, each.number) == key] for those in (stored, changes))
        if key[0] == "contact" and key[1] in rigid:
            worst = max(worst, _of_impacts(theirs, ours, end))
        else:
            if key[0] == "contact":  # the mode at the start follows from the first event
                begun = 1 - theirs[0].mode if theirs else ours[0].mode
                theirs = [Change(*key, begun, 0.0, 1.0), *theirs]
            worst = max(worst, _of_modes(theirs, ours, end))
    return worst


def _of_modes(theirs: Sequence[Change], ours: Sequence[Change], end: float) -> float:
    """Return the longest angle over which modes differ, times the steepest slope of a guard at its ends."""
    # Where only the stored motion has a phase, its guard is zero at both ends: its slope is of the order of that angle.
    # Where only the other one has it, the stored motion is on the wrong side of the guard at which it begins. The guard
    # at which it ends belongs to the phase: a force that just exceeds its bound may be followed by a steep slip rate.
    if not theirs or not ours:
        return math.inf
    every = [(each.theta, 0, each) for each in theirs] + [(each.theta, 1, each) for each in ours]
    every.sort(key=lambda each: each[:2])  # events of one motion at the same angle stay in their order
    modes, worst, within = [theirs[0].mode, ours[0].mode], 0.0, list[tuple[float, int, Change]]()
    for event in every:
        theta, side, each = event
        modes[side] = each.mode
        within = [*within, event] if within or modes[0] != modes[1] else []
        if within and modes[0] == modes[1]:
            slopes = [abs(other.slope) for _, side, other in within if side]
            slope = slopes[0] if len(slopes) == len(within) else max(slopes, default=0.0)
            length = theta - within[0][0]
            worst, within = max(worst, length * (slope or length)), []
    return max(worst, end - within[0][0]) if within else worst


def _of_impacts(theirs: Sequence[Change], ours: Sequence[Change], end: float) -> float:
    worst, left = 0.0, list(theirs)
    angles = [each.theta for each in (*theirs, *ours)]
    alone = []
    for each in ours:
        near = [other for other in left if other.mode == each.mode and _apart(other, each, end) < _TOGETHER]
        if near:
            match = min(near, key=lambda other, each=each: _apart(other, each, end))
            left.remove(match)
            worst = max(worst, abs(each.slope) * _apart(match, each, end))
        else:
            alone.append(each)
    for each in (*alone, *left):
        others = sorted(abs(each.theta - angle) for angle in angles)[1:]  # without itself
        if abs(each.slope) < _SOFTEST:  # the motion misses it by so little that errors of integration decide
            worst = max(worst, each.slope**2)
        elif not others or others[0] > _TOGETHER:
            return math.inf
    return worst


def _apart(a: Change, b: Change, end: float) -> float:
    return min(abs(a.theta - b.theta), end - abs(a.theta - b.theta))
