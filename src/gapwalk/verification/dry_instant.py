"""A motion with dry friction or rigid stops at one instant: its states, its modes, and how events change them.

It decides the modes of a start and those after an event on its own, from the equations of `DryEquations`, and knows
nothing of the modes that are stored with an orbit. A mode lasts as long as its guard is positive.

States have small imaginary parts, one set for each direction in the state space: those are the changes of the motion,
to first order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from gapwalk.errors import NumericalError
from gapwalk.flow.equations import smallness
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.dry_equations import DryEquations, Key, Loading, Modes, Sizes, Values
from gapwalk.verification.guard_samples import FIRES

SMALL = 1e-25
"""Size of the imaginary parts: rounding does not see their squares."""

EQUAL = 1e-11  # share of its bound by which a force in stick may exceed it by rounding
_AT_ONCE = 200  # the most impacts at one instant
_STILL = 1e-11  # slip rate, relative to the velocities, within which friction may stick
_LEAST = 1e-3  # share of the small length of a system below which a motion is rest
_HELD = 1e-7  # angle of a flight that is not made any more


class DryInstant:
    """The states and modes of the motion of an orbit, and of its neighbours, at one instant.

    Shapes: `states` (state size + 1, state size).

    Attributes
    ----------
    theta, angles
        The angle of the motion, and those of all: it, and one neighbour for each direction of the state space.
    modes, levels
        What is closed, slips and is held; and the levels of numbers that jump.
    length, speed, scales
        The size of the motion, of its velocities, and of each part of a state.
    """

    def __init__(self, orbit: Orbit) -> None:
        equations = self.equations = DryEquations([orbit.system])
        n, size = equations.size, equations.state_size
        self.theta, self.angles = 0.0, np.zeros(size + 1)
        self.states = np.tile(orbit.state.astype(complex), (size + 1, 1))
        self.states[1:] += 1j * SMALL * np.eye(size)
        least = _LEAST * smallness(orbit.system)  # friction may keep all at rest
        length = max(float(np.abs(orbit.extremes).max()), float(np.abs(orbit.state[:n]).max()), least)
        speed = max(float(np.abs(orbit.state[n : 2 * n]).max()), length * equations.omega)
        self.scales = np.full(size, length)
        self.scales[n : 2 * n] = speed
        self.length, self.speed, self._slack = length, speed, EQUAL
        self.sizes = Sizes(np.array([length]), np.array([speed]))
        self.levels = equations.levels(np.array([1e-9]))
        self._stopped, self._began = dict[int, float](), dict[int, float]()
        self._pressed: list[tuple[int, float]] = []  # held stops that an impulse strikes, with the speed of the impact
        self.modes = self._start()

    def _now(self) -> Loading:
        """Return the loading of the motion itself."""
        return self.equations.loading(np.array([self.theta]), np.real(self.states[:1]), self.modes, self.levels)

    def _gap(self, switch: int) -> tuple[float, float]:
        """Return the distance of the motion from a breakpoint, positive where it is open, and its rate over time."""
        equations, n = self.equations, self.equations.size
        angle, state = np.array([self.theta]), np.real(self.states[:1])
        index = equations.contact_of[switch]
        depth = equations.depths(equations.deflections(angle, state[:, :n]))[0, switch]
        rate = equations.deflections(angle, state[:, n : 2 * n] / equations.omega, derivative=1)[0, index]
        return -float(depth), -float(equations.signs[switch] * rate) * equations.omega

    def _slip_rate(self, index: int) -> float:
        return float(self.equations.sliding(np.array([self.theta]), np.real(self.states[:1]))[0, index])

    def _start(self) -> Modes:
        equations = self.equations
        modes = self.modes = Modes(np.zeros(len(equations.signs)), dict.fromkeys(equations.dry, 0), set())
        for switch in range(len(equations.signs)):
            gap, rate = self._gap(switch)
            on = abs(gap) <= 1e-12 * self.length
            if switch not in equations.rigid and ((gap < 0.0 and not on) or (on and rate < 0.0)):
                modes.closed[switch] = 1.0
        for index in equations.dry:
            if index not in equations.memories:
                rate = self._slip_rate(index)
                modes.slip[index] = 0 if abs(rate) <= _STILL * self.speed else round(math.copysign(1.0, rate))
        self._decide()
        for index in equations.memories:
            self._set_slider(index)
        self._decide()
        for switch in equations.rigid:
            gap, rate = self._gap(switch)
            if abs(gap) <= 1e-12 * self.length and abs(rate) <= _STILL * self.speed:
                self._strike(switch)
        equations.come_to_rest(self.angles, self.states, modes, positions=True)
        equations.set_extensions(self.angles, self.states, modes, self.levels)
        return modes

    def _set_slider(self, index: int) -> None:
        """Decide the mode of a Jenkins element by its extension, which is not beyond its limit."""
        equations, place = self.equations, self.equations.memories[index]
        limit = float(self._now().limits[index][0]) / equations.stiffnesses[index]
        z = float(np.real(self.states[0, place]))
        self.modes.slip[index] = 0
        grown = limit > 1e-12 * self.length
        if grown and abs(z) < limit * (1.0 - 1e-12):
            return
        side = round(math.copysign(1.0, z if grown else self._slip_rate(index)))
        if equations.is_idle(index, np.array([limit]), self.modes)[0]:
            self.states[:, place] = 0.0
            return
        self.modes.slip[index] = side
        self.equations.set_extensions(self.angles, self.states, self.modes, self.levels)
        if not self._sliding(index) > 0.0:
            self.modes.slip[index] = 0

    def _sliding(self, index: int) -> float:
        """Return the rate of the slider of a Jenkins element in the direction of its slip."""
        creep = self.equations.creep(index, np.array([self.theta]), self.states[:1], self.modes, self.levels)[0]
        return self.modes.slip[index] * self._slip_rate(index) - float(creep)

    def _decide(self, slipping: Sequence[int] = ()) -> None:
        """Decide which rigid friction at rest sticks: as many as can; `slipping` have just begun to slip."""
        equations, modes = self.equations, self.modes
        at_rest = [
            index
            for index in equations.dry
            if index not in equations.memories
            and index not in slipping
            and abs(self._slip_rate(index)) <= _STILL * self.speed
        ]
        for slips in sorted(product((0, 1, -1), repeat=len(at_rest)), key=lambda each: sum(map(abs, each))):
            modes.slip.update(zip(at_rest, slips, strict=True))
            try:
                now = self._now()
            except np.linalg.LinAlgError:  # too many would stick
                continue
            if all(self._may(index, slip, now) for index, slip in zip(at_rest, slips, strict=True)):
                break
        else:
            raise NumericalError("no modes of friction are consistent")
        equations.come_to_rest(self.angles, self.states, modes)

    def _may(self, index: int, slip: int, now: Loading) -> bool:
        """Return True if friction at rest may stick, or begin to slip in a direction."""
        bound = float(now.breakaways[index][0])
        if not slip:
            return bound > 0.0 and abs(float(now.forces[0, index])) <= bound * (1.0 + self._slack)
        turning = self.equations.turning(np.array([self.theta]), now)[0, index]
        return slip * float(turning) > (0.0 if bound else -1e-12 * self.speed * self.equations.omega)

    def _strike(self, switch: int) -> None:
        """Reverse the rate at a rigid stop, and at those held that this impulse drives the motion into.

        Stops at which the next flight is short are held. Before the modes are decided, the stops that are held have a
        rate: an impulse that pulls releases them.
        """
        equations, modes, still = self.equations, self.modes, _STILL * self.speed
        struck, touching = [switch], sorted(modes.held - {switch})
        if self._gap(switch)[1] < 0.0:
            modes.held.discard(switch)
            equations.rebound(switch, self.angles, self.states)
            while (into := self._driven_into([switch, *touching], struck[-1])) is not None and len(struck) < _AT_ONCE:
                if into not in struck:
                    self._pressed.append((into, -self._gap(into)[1]))
                struck.append(into)
                equations.rebound(into, self.angles, self.states)
            modes.held -= {other for other in touching if self._gap(other)[1] > still}
            self._after_impact()
        for each in dict.fromkeys(struck):
            index, side = int(equations.contact_of[each]), equations.signs[each]
            leaves = max(self._gap(each)[1], 0.0)
            turning = -side * float(equations.turning(np.array([self.theta]), self._now())[0, index])
            if turning < 0.0 and 2.0 * leaves * equations.omega < _HELD * -turning:
                modes.held.add(each)
                equations.come_to_rest(self.angles, self.states, modes)
                self._decide()

    def _driven_into(self, touching: Sequence[int], last: int) -> int | None:
        """Return a stop among those that the motion touches which it is driven into by the last impulse."""
        into = (each for each in touching if each != last and self._gap(each)[1] < -_STILL * self.speed)
        return next(into, None)

    def _after_impact(self) -> None:
        for index in self.equations.dry:
            rate = self._slip_rate(index)
            if index in self.equations.memories:
                if self.modes.slip[index]:
                    self._set_slider(index)
            elif abs(rate) > _STILL * self.speed:
                self.modes.slip[index] = round(math.copysign(1.0, rate))
        self._decide()

    def _change(self, key: tuple[str, int]) -> None:
        """Set the modes after an event."""
        equations, modes, (kind, index) = self.equations, self.modes, key
        released: tuple[int, ...] = ()
        kept = self._kept()
        if kind == "contact" and index in equations.rigid:
            if index in modes.held:
                modes.held.discard(index)
            else:
                self._strike(index)
        elif kind == "contact":
            modes.closed[index] = 1.0 - modes.closed[index]
            for other in equations.memories:
                if equations.host_of(other) == equations.contact_of[index]:
                    self._set_slider(other)
        elif index in equations.memories:
            z = float(np.real(self.states[0, equations.memories[index]]))
            if modes.slip[index]:
                modes.slip[index], self._stopped[index] = 0, self.theta
            else:
                modes.slip[index], self._began[index] = round(math.copysign(1.0, z)), self.theta
                if self.theta == self._stopped.get(index):
                    modes.pausing.add(index)
        elif not modes.slip[index]:
            modes.slip[index] = round(math.copysign(1.0, float(self._now().forces[0, index])))
            released = (index,)
        self._decide(released)
        if self._kept() - kept:
            self._stop_sliders()

    def _kept(self) -> set[Key]:
        """Return the rigid friction that sticks and the stops that are held: what keeps a rate at zero."""
        equations, modes = self.equations, self.modes
        stuck = {index for index in equations.dry if index not in equations.memories and not modes.slip[index]}
        return {("slip", index) for index in stuck} | {("contact", switch) for switch in modes.held}

    def _stop_sliders(self) -> None:
        """End the slip of Jenkins elements that stop with what has just come to rest.

        Their guards would stay within rounding of zero as long as that keeps them there.
        """
        for index in self.equations.memories:
            slips = self.modes.slip[index] and self._began.get(index) != self.theta
            if slips and abs(self._sliding(index)) <= _STILL * self.speed:
                self.modes.slip[index], self._stopped[index] = 0, self.theta

    def _end_pauses(self) -> None:
        """End the pauses of elements whose slip rate has its direction again, or whose slip has ended otherwise."""
        for index in [*self.modes.pausing]:
            slip = self.modes.slip[index]
            if not slip or slip * self._slip_rate(index) > FIRES * self.speed:
                self.modes.pausing.discard(index)

    def _rates(self, angle: float, states: Values) -> Values:
        return self.equations.derivatives(np.full(len(states), angle), states, self.modes, self.levels)
