"""Motions that are linear between events, in extended precision: matrix exponentials by Taylor's series.

For systems of springs with gaps and hysteresis, and rigid friction that slips all the time. The order of events is
given; their times are located by Newton's method.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

Real = np.longdouble
Array = NDArray[np.longdouble]
PERIOD = 2 * Real("3.14159265358979323846264338327950288")
_TERMS, _NEWTON, _EXACT = 25, 60, 1e-18


class Event(NamedTuple):
    """The time of an event, the number of a switch or -1 for slip, and the mode after it."""

    time: Any
    switch: int
    mode: int


class LinearPieces:
    """The equations of one system of a contact with stages and hysteresis, lengths multiplied by `scale`."""

    def __init__(self, system: System, scale: float) -> None:
        self.values, self.names, self.n = system.parameters, system.coordinates, system.size
        self.host, self.dry = (contact.name for contact in system.structure.contacts)
        self.springs = str(getattr(system.structure.contacts[0].law, "springs", ""))
        self.scale, self.loads = Real(scale), [each.name for each in system.structure.harmonics]
        self.orders = [each.order for each in system.structure.harmonics]
        self.mass, self.damping, self.stiffness = (self._matrix(each) for each in ("mass", "damping", "stiffness"))
        self.inverse = np.linalg.inv(self.mass.astype(float)).astype(Real)
        for _ in range(4):  # refined to extended precision
            self.inverse = self.inverse @ (2 * np.eye(self.n, dtype=Real) - self.mass @ self.inverse)
        self.switches = [(name, side) for name in ("one", "two") for side in (1, -1)]
        self.size = 2 * self.n + 2 * len(self.loads) + 1  # with the cosines and sines of the loads, and 1

    def _matrix(self, name: str) -> Array:
        return np.array([[self.values[f"{name}.{a}.{b}"] for b in self.names] for a in self.names], dtype=Real)

    def _vector(self, name: str) -> Array:
        return np.array([self.values[f"{name}.{a}"] for a in self.names], dtype=Real)

    def _stage(self, switch: int, number: str) -> Real:
        unit = self.scale if number != "stiffness" else 1
        return Real(self.values[f"{self.host}.{self.switches[switch][0]}.{number}"]) * unit

    def rates(self, closed: Sequence[int], slip: int) -> Array:
        """Return the matrix of the equations in given modes."""
        n, place = self.n, 2 * self.n
        on, dry = self._vector(f"{self.host}.deflection"), self._vector(f"{self.dry}.deflection")
        stiffness, damping, force = self.stiffness.copy(), self.damping.copy(), self._vector("mean") * self.scale
        limit = Real(self.values[f"{self.dry}.limit"]) * self.scale
        for switch, (_, side) in enumerate(self.switches):
            if closed[switch]:
                stiffness += self._stage(switch, "stiffness") * np.outer(on, on)
                force = force + on * self._stage(switch, "stiffness") * self._stage(switch, "clearance") * side
                limit += self._stage(switch, "hysteresis")
        if self.springs == "viscous" and any(closed):
            damping = damping + Real(self.values[f"{self.host}.viscous_damping"]) * np.outer(on, on)
        found = np.zeros((self.size, self.size), dtype=Real)
        found[:n, n:place] = np.eye(n, dtype=Real)
        found[n:place, :n], found[n:place, n:place] = -self.inverse @ stiffness, -self.inverse @ damping
        found[n:place, -1] = self.inverse @ (force - dry * limit * slip)
        for name, order in zip(self.loads, self.orders, strict=True):
            shape = self.inverse @ self._vector(f"{name}.acts_on") * Real(self.values[f"{name}.amplitude"]) * self.scale
            phase, turns = Real(self.values[f"{name}.phase"]), order * Real(self.values["frequency"])
            found[n : 2 * n, place], found[n : 2 * n, place + 1] = shape * np.cos(phase), -shape * np.sin(phase)
            found[place, place + 1], found[place + 1, place] = -turns, turns
            place += 2
        return found

    def _after(self, rates: Array, time: Any) -> Array:
        """Return the exponential of a matrix times a time."""
        parts = max(1, int(np.ceil(float(abs(time) * np.abs(rates).sum(1).max()) / 0.5)))
        term = found = power = np.eye(self.size, dtype=Real)
        for number in range(1, _TERMS):
            term = term @ rates * (time / parts / number)
            found = found + term
        for _ in range(parts):
            power = found @ power
        return power

    def around(
        self, state: Array, events: Sequence[Event], closed: list[int], slip: int
    ) -> tuple[Array, Array, list[Event]]:
        """Return the state after a period, its derivative by the first one, and the events with their times."""
        n, closed, time, found = self.n, list(closed), Real(0), []
        end = PERIOD / Real(self.values["frequency"])
        y, transition = np.zeros(self.size, dtype=Real), np.eye(2 * n, dtype=Real)
        y[: 2 * n], y[2 * n : -1 : 2], y[-1] = state, 1, 1
        for event in events:
            rates, guard = self.rates(closed, slip), np.zeros(self.size, dtype=Real)
            if event.switch < 0:
                guard[n : 2 * n] = self._vector(f"{self.dry}.deflection")
            else:
                guard[:n] = self._vector(f"{self.host}.deflection") * self.switches[event.switch][1]
                guard[-1] = -self._stage(event.switch, "clearance")
            span = event.time - time
            for _ in range(_NEWTON):
                there = self._after(rates, span) @ y
                step = -(guard @ there) / (guard @ (rates @ there))
                span += step
                if abs(step) < _EXACT:
                    break
            power = self._after(rates, span)
            y, time, transition = power @ y, time + span, power[: 2 * n, : 2 * n] @ transition
            before = rates @ y
            if event.switch < 0:
                slip = event.mode
            else:
                closed[event.switch] = event.mode
            jump = (self.rates(closed, slip) @ y - before)[: 2 * n]
            transition = transition + np.outer(jump, guard[: 2 * n]) @ transition / (guard @ before)
            found.append(event._replace(time=time))
        power = self._after(self.rates(closed, slip), end - time)
        return (power @ y)[: 2 * n], power[: 2 * n, : 2 * n] @ transition, found


def largest_multiplier(orbit: Orbit, steps: int = 10) -> float:
    """Return the multiplier of largest modulus of the periodic motion at an orbit, corrected by Newton's method."""
    system = orbit.system
    scale = 1.0 / float(np.abs(orbit.extremes).max())
    pieces = LinearPieces(system, scale)
    pace = Real(system.frequency)
    events = [Event(Real(each.theta) / pace, each.switch, int(each.enters)) for each in orbit.events]
    events += [Event(Real(each.theta) / pace, -1, each.slip) for each in orbit.slips if each.theta]
    events.sort(key=lambda each: each.time)
    assert all(each.mode for each in events if each.switch < 0)
    x = float(pieces._vector(f"{pieces.host}.deflection") @ orbit.state[: pieces.n]) * scale
    closed = [int(side * x > pieces._stage(place, "clearance")) for place, (_, side) in enumerate(pieces.switches)]
    slip = next(each.slip for each in orbit.slips if not each.theta)
    state, transition = np.array(orbit.state, dtype=Real) * Real(scale), np.eye(len(orbit.state), dtype=Real)
    for _ in range(steps):
        after, transition, events = pieces.around(state, events, closed, slip)
        gap = (after - state).astype(float)
        state = state + np.linalg.solve(np.eye(len(state)) - transition.astype(float), gap).astype(Real)
    return float(np.abs(np.linalg.eigvals(transition.astype(float))).max())
