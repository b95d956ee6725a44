"""Turning points of coordinates and deflections along a motion, for a survey of an orbit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.contact_events import COOLDOWN, Switchboard
from gapwalk.flow.dry_state import Kink, largest
from gapwalk.flow.equations import Equations
from gapwalk.flow.forces import Angles, accelerations

_ONE_TURN = 1e-8  # radians within which two turning points of a deflection are the same
_TURNING = 1e-3  # share of the size of the velocities below which a rate may vanish within rounding of an event


class Turn(NamedTuple):
    """A turning point: index into `Equations.turning`, theta, and the positions there."""

    event: int
    theta: float
    positions: list[float]


class TurningPoints:
    """The turning points that one integrator finds."""

    def __init__(self, equations: Equations, taylor: Any, switches: Switchboard) -> None:
        self._equations, self._taylor, self._switches = equations, taylor, switches
        self._turns: list[Turn] = []
        self._numbers, self._still = b"", dict[tuple[int, ...], list[int]]()  # what keeps still, by what is held
        layout = equations.layout
        self._size, self._unit = layout.structure.size, 1.0
        self._slots = [(event, slots) for event, (slots, _) in enumerate(equations.turning) if slots is not None]
        self.vectors = np.zeros((len(equations.turning), self._size))
        self.vectors[: self._size] = np.eye(self._size)
        self._swaying = [
            (event, contact)
            for event, slots in self._slots
            for contact in layout.contacts
            if contact.deflection is slots and contact.sway is not None
        ]

    def start(self, coefficients: NDArray[np.float64], unit: float) -> None:
        """Begin with the coefficients of a system, with lengths in multiples of `unit`."""
        self._turns, self._coefficients, self._unit = [], coefficients, unit
        self._stops: list[tuple[Kink, list[int]]] = []  # events that stop the integrator; what keeps still there
        numbers = coefficients[1:].tobytes()  # all but the frequency: the rest stays the same along most walks
        if numbers != self._numbers:
            self._numbers, self._still = numbers, {}
            for event, slots in self._slots:
                self.vectors[event] = coefficients[slots]
            self._longest = float(np.abs(self.vectors).sum(axis=1).max())

    def at_event(self, event: int, theta: float) -> None:
        """Record where a coordinate or a deflection turns, at an event of the integrator."""
        if self._switches.dry.held and event in self._keeping_still():
            return  # its rate is 0 all the time, and changes its sign by rounding
        positions = self._taylor.update_d_output(theta)[: self._size]
        self._turns.append(Turn(event, theta, (positions if self._unit == 1.0 else positions * self._unit).tolist()))

    def at_stop(self, theta: float) -> None:
        """Note an event of friction or stops, which stops the integrator: it may report no other at the same time."""
        dry, n = self._switches.dry, self._size
        if not dry.count or (dry.kinks and dry.kinks[-1].theta == theta):
            return
        if not self._swaying:
            rates = self.vectors.dot(dry.state[n : 2 * n]).tolist()
            if min(map(abs, rates)) > _TURNING * dry.speed():
                return
        q, v = dry.state[:n].copy(), dry.state[n : 2 * n].copy()
        a = dry.read(theta).accelerations
        self._stops.append((Kink(theta, q, (v, v), (a, a)), self._keeping_still()))

    def _keeping_still(self) -> list[int]:
        """Return the events whose rates are 0 because of what is held."""
        dry = self._switches.dry
        known = self._still.get(dry.held)
        if known is None:
            known = [event for event, vector in enumerate(self.vectors) if dry.keeps_still(vector)]
            self._still[dry.held] = known
        return known

    def found(self) -> list[Turn]:
        """Return all turning points since the start, with those at events that stop the integrator.

        Among these are the kinks of a coordinate with ``abs(v)`` or friction, and impacts.
        """
        layout, coefficients = self._equations.layout, self._coefficients
        n, kinks = self._size, list(self._switches.dry.kinks)
        for theta, state in self._switches.modes.kinks:
            a = accelerations(layout, coefficients, theta, state[:n], state[n : 2 * n], unit=self._unit)
            v = state[n : 2 * n]
            kinks.append(Kink(theta, state[:n], (v, v), (a, a)))
        shortest = COOLDOWN * float(coefficients[0])
        for (theta, positions, velocities, turning), still in [(kink, list[int]()) for kink in kinks] + self._stops:
            if not self._swaying and velocities[0] is velocities[1]:  # nearly always: nothing turns just there
                slowest = min(map(abs, self.vectors.dot(velocities[0]).tolist()))
                if slowest > shortest * self._longest * max(largest(turning[0]), largest(turning[1])):
                    continue
            before, after, *turned = (self.vectors @ np.array([*velocities, *turning]).T).T.tolist()
            for event, contact in self._swaying:
                angles = Angles(layout, coefficients, theta)
                sways = [float(angles.sway(contact, 0, order)) for order in (1, 2)]
                for values, sway in zip((before, after, *turned), (sways[0], *sways, sways[1]), strict=True):
                    values[event] += sway
            for event, (rate, later, *changes) in enumerate(zip(before, after, *turned, strict=True)):
                change = max(map(abs, changes))
                if event in still or not change or not (rate * later < 0.0 or abs(later) <= shortest * change):
                    continue
                if not any(turn.event == event and abs(turn.theta - theta) <= _ONE_TURN for turn in self._turns):
                    self._turns.append(Turn(event, theta, (positions * self._unit).tolist()))
        return sorted(self._turns, key=lambda turn: turn.theta)
