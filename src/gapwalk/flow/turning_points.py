"""Turning points of coordinates and deflections along a motion, for a survey of an orbit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.contact_events import COOLDOWN, Switchboard
from gapwalk.flow.dry_state import Kink
from gapwalk.flow.equations import Equations
from gapwalk.flow.forces import Angles, accelerations

_ONE_TURN = 1e-8  # radians within which two turning points of a deflection are the same


class Turn(NamedTuple):
    """A turning point: index into `Equations.turning`, theta, and the positions there."""

    event: int
    theta: float
    positions: list[float]


class TurningPoints:
    """The turning points that one integrator finds.

    Parameters
    ----------
    equations
        Its equations.
    taylor
        heyoka's integrator.
    switches
        The control of its modes.
    """

    def __init__(self, equations: Equations, taylor: Any, switches: Switchboard) -> None:
        self._equations, self._taylor, self._switches = equations, taylor, switches
        self._turns: list[Turn] = []

    def start(self, coefficients: NDArray[np.float64], unit: float) -> None:
        """Begin with the coefficients of a system, with lengths in multiples of `unit`."""
        self._turns, self._coefficients, self._unit = [], coefficients, unit
        self._stops: list[tuple[Kink, list[int]]] = []  # events that stop the integrator; what keeps still there

    def at_event(self, event: int, theta: float) -> None:
        """Record where a coordinate or a deflection turns, at an event of the integrator."""
        dry = self._switches.dry
        if dry.held and dry.keeps_still(self._vector(event)):
            return  # its rate is 0 all the time, and changes its sign by rounding
        positions = self._taylor.update_d_output(theta)[: self._equations.layout.structure.size] * self._unit
        self._turns.append(Turn(event, theta, positions.tolist()))

    def at_stop(self, theta: float) -> None:
        """Note an event of friction or stops, which stops the integrator: it may report no other at the same time."""
        dry, n = self._switches.dry, self._equations.layout.structure.size
        if not dry.count:
            return
        q, v = self._taylor.state[:n].copy(), self._taylor.state[n : 2 * n].copy()
        a = dry.read(theta).accelerations
        still = [event for event in range(len(self._equations.turning)) if dry.keeps_still(self._vector(event))]
        self._stops.append((Kink(theta, q, (v, v), (a, a)), still))

    def found(self) -> list[Turn]:
        """Return all turning points since the start, with those at events that stop the integrator.

        Among these are the kinks of a coordinate with ``abs(v)`` or friction, and impacts.
        """
        layout, coefficients = self._equations.layout, self._coefficients
        n, kinks = layout.structure.size, list(self._switches.dry.kinks)
        for theta, state in self._switches.modes.kinks:
            a = accelerations(layout, coefficients, theta, state[:n], state[n : 2 * n], unit=self._unit)
            v = state[n : 2 * n]
            kinks.append(Kink(theta, state[:n], (v, v), (a, a)))
        stops = [(kink, list[int]()) for kink in kinks] + self._stops
        for (theta, positions, velocities, turning), still in stops:
            angles = Angles(layout, coefficients, theta)
            for event, (slots, _) in enumerate(self._equations.turning):
                vector = self._vector(event)
                contact = next((each for each in layout.contacts if each.deflection is slots), None)
                sways = [0.0, 0.0] if contact is None else [float(angles.sway(contact, 0, order)) for order in (1, 2)]
                before, after = (float(vector @ each) + sways[0] for each in velocities)
                change = max(abs(float(vector @ each) + sways[1]) for each in turning)
                known = any(turn.event == event and abs(turn.theta - theta) <= _ONE_TURN for turn in self._turns)
                if known or event in still or not change:
                    continue
                if before * after < 0.0 or abs(after) <= COOLDOWN * float(coefficients[0]) * change:
                    self._turns.append(Turn(event, theta, (positions * self._unit).tolist()))
        return sorted(self._turns, key=lambda turn: turn.theta)

    def _vector(self, event: int) -> NDArray[np.float64]:
        slots = self._equations.turning[event][0]
        return np.eye(self._equations.layout.structure.size)[event] if slots is None else self._coefficients[slots]
