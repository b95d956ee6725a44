"""The slip rate of dry friction, and what its force lacks to its bound, at instants of a motion with known modes.

Slip ends where the *slip rate* vanishes, and stick ends where the *reserve* does: the force at which slip begins, less
the force in stick towards one side. Both are functions of the state, the angle and the coefficients while the modes are
kept as they are, beyond the event too. All of them accept complex numbers, for derivatives by a complex step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.dry_state import SlipEvent
from gapwalk.flow.forces import Angles, Dry, balance, contact_force, contact_forces, stages_of
from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.laws import Host
from gapwalk.model.structure import Structure

_STEP = 1e-150  # of the complex step
_BESIDE = 1e-5  # radians over which the rate of change of a rate is taken
_AT = 1e-9  # radians within which an event is at an instant
_ORIGIN = [(0.0, 0.0)]  # friction itself depends on no deflection

Array = NDArray[np.float64]


class Modes(NamedTuple):
    """The modes at one instant: the slip of each contact that is friction, and the numbers of the reactions held."""

    slips: tuple[int, ...]
    held: tuple[int, ...]


def friction_of(structure: Structure) -> list[int]:
    """Return the numbers of the contacts that are dry friction."""
    return [number for number, contact in enumerate(structure.contacts) if contact.law.is_dry]


def modes_at(
    structure: Structure, slips: Sequence[SlipEvent], contacts: Sequence[ContactEvent], theta: float, before: bool
) -> Modes:
    """Return the modes of a periodic motion just before or just after an instant, from its logs.

    Parameters
    ----------
    structure
        The structure.
    slips, contacts
        The events of friction, and of contacts, of one period, in order.
    theta
        The angle.
    before
        True for the modes just before it.
    """
    edge = theta - _AT if before else theta + _AT
    found, held = [], []
    rigid = {contact: number for number, (contact, switch) in enumerate(structure.reactions) if switch < 0}
    for contact in friction_of(structure):
        own = [event for event in slips if event.contact == contact]
        past = [event for event in own if event.theta <= edge] or own
        found.append(past[-1].slip if past else 0)
        if not found[-1] and contact in rigid:
            held.append(rigid[contact])
    for number, (_, switch) in enumerate(structure.reactions):
        own = [event for event in contacts if event.switch == switch] if switch >= 0 else []
        past, coming = [each for each in own if each.theta <= edge], [each for each in own if each.theta > edge]
        if own and (past or own)[-1].enters and not (coming or own)[0].enters:
            held.append(number)
    return Modes(tuple(found), tuple(sorted(held, key=lambda number: structure.reactions[number][1] < 0)))


class FrictionGauge:
    """Gauge of one contact that is dry friction.

    Parameters
    ----------
    layout
        The layout of the coefficients.
    contact
        Number of the contact in the structure.
    """

    def __init__(self, layout: CoefficientLayout, contact: int) -> None:
        structure = layout.structure
        self.layout, self.contact, self.n = layout, contact, structure.size
        self._slots = layout.contacts[contact]
        self._law: Any = structure.contacts[contact].law
        self.place = friction_of(structure).index(contact)
        self.memory = structure.memories.index(contact) if contact in structure.memories else None
        self.reaction = next(
            (number for number, (own, switch) in enumerate(structure.reactions) if own == contact and switch < 0), None
        )

    def sticking(self, modes: Modes) -> Modes:
        """Return the modes with this friction in stick."""
        held = modes.held
        if self.reaction is not None and self.reaction not in held:
            held = (*held, self.reaction)
        return self._with(modes, 0, held)

    def slipping(self, modes: Modes, slip: int) -> Modes:
        """Return the modes with this friction in slip."""
        return self._with(modes, slip, tuple(number for number in modes.held if number != self.reaction))

    def _with(self, modes: Modes, slip: int, held: tuple[int, ...]) -> Modes:
        slips = list(modes.slips)
        slips[self.place] = slip
        return Modes(tuple(slips), held)

    def rate(self, coefficients: NDArray, theta: Any, y: NDArray, modes: Modes, side: int) -> NDArray:
        """Return the slip rate towards a side, over time, for states of the shape (..., state_size)."""
        moved = y[..., self.n : 2 * self.n] @ coefficients[self._slots.deflection]
        moved = moved + Angles(self.layout, coefficients, theta).sway(self._slots, 0, 1)
        return side * (moved - coefficients[self._slots.numbers["speed"]])

    def reserve(self, coefficients: NDArray, theta: Any, y: NDArray, modes: Modes, side: int) -> NDArray:
        """Return the force at which slip to a side begins, less the force in stick; shape as `rate`."""
        angles = Angles(self.layout, coefficients, theta)
        numbers, stages = angles.named(self._slots.numbers, self._slots.waves), stages_of(self._slots, angles, _ORIGIN)
        if (host := self.layout.structure.host(self.contact)) is not None:
            outside = self.layout.contacts[host]
            vector, n = coefficients[outside.deflection], self.n
            move = (
                y[..., :n] @ vector + angles.sway(outside),
                y[..., n : 2 * n] @ vector + angles.sway(outside, 0, 1),
            )
            stages.host = Host(stages_of(outside, angles, [move]), contact_force(outside, angles, [move]))
        if self.memory is not None:
            force = numbers["stiffness"] * y[..., 2 * self.n + self.memory]
        else:
            force = self._balanced(coefficients, theta, y, modes, [self.reaction or 0])[..., 0]
        return self._law.breakaway(stages, numbers) - side * force

    def acceleration(self, coefficients: NDArray, theta: Any, y: NDArray, modes: Modes, side: int) -> NDArray:
        """Return the derivative of `rate` over time."""
        moved = self.accelerations(coefficients, theta, y, modes) @ coefficients[self._slots.deflection]
        return side * (moved + Angles(self.layout, coefficients, theta).sway(self._slots, 0, 2))

    def accelerations(self, coefficients: NDArray, theta: Any, y: NDArray, modes: Modes) -> NDArray:
        """Return the accelerations under some modes, shape (..., n)."""
        return self._balanced(coefficients, theta, y, modes, None)

    def _balanced(
        self, coefficients: NDArray, theta: Any, y: NDArray, modes: Modes, reactions: list[int] | None
    ) -> NDArray:
        layout, n = self.layout, self.n
        held, angles = Constraint(layout, coefficients, modes.held).coefficients(), Angles(layout, coefficients, theta)
        slips, q, v = np.array(modes.slips, dtype=float), y[..., :n], y[..., n : 2 * n]
        dry = Dry(np.broadcast_to(slips, (*y.shape[:-1], len(slips))), y[..., 2 * n :])
        forces = contact_forces(layout, coefficients, theta, q, v, None, angles, dry)
        rows = layout.accelerations if reactions is None else layout.reactions[reactions]
        return balance(held[rows], q, v, forces, angles.waves)

    def motion(self, coefficients: NDArray, theta: Any, y: NDArray, modes: Modes) -> NDArray:
        """Return the derivative of one state over time; extensions in slip follow a limit that varies."""
        n, structure = self.n, self.layout.structure
        found = np.concatenate((y[n : 2 * n], self.accelerations(coefficients, theta, y, modes), 0.0 * y[2 * n :]))
        for place, contact in enumerate(structure.memories):
            gauge = self if contact == self.contact else FrictionGauge(self.layout, contact)
            if not modes.slips[gauge.place]:
                found[2 * n + place] = gauge.rate(coefficients, theta, y, modes, 1)
        return found

    def change(self, function: Any, coefficients: NDArray, theta: float, y: NDArray, modes: Modes, side: int) -> float:
        """Return the derivative over time of `rate` or `reserve` along the motion under some modes."""
        if function == self.rate:
            return float(self.acceleration(coefficients, theta, y, modes, side))
        moved = y + 1j * _STEP * self.motion(coefficients, theta, y, modes)
        angle = theta + 1j * _STEP / float(coefficients[0])
        return complex(function(coefficients.astype(complex), angle, moved, modes, side)).imag / _STEP

    def curvature(
        self, function: Any, coefficients: NDArray, theta: float, y: NDArray, modes: Modes, side: int
    ) -> float:
        """Return the second derivative over time of `rate` or `reserve`, to a few digits."""
        step, way = _BESIDE * float(coefficients[0]), self.motion(coefficients, theta, y, modes)
        ends = [
            self.change(function, coefficients, theta + sign * _BESIDE, y + sign * step * way, modes, side)
            for sign in (-1.0, 1.0)
        ]
        return (ends[1] - ends[0]) / (2.0 * step)
