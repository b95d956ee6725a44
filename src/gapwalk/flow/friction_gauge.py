"""The slip rate of dry friction, and what its force lacks to its bound, at instants of a motion with known modes.

Slip ends where the *slip rate* vanishes, and stick ends where the *reserve* does: the force at which slip begins, less
the force in stick towards one side. Both are functions of the state, the angle and the coefficients while the modes are
kept as they are, beyond the event too. All of them accept complex numbers, for derivatives by a complex step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.forces import Angles, CompiledReadings, Dry, balance, contact_force, contact_forces, stages_of
from gapwalk.flow.motion import DryModes
from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.laws import Host

_STEP = 1e-150  # of the complex step
_BESIDE = 1e-5  # radians over which the rate of change of a rate is taken
_ORIGIN = [(0.0, 0.0)]  # friction itself depends on no deflection

Array = NDArray[np.float64]


class Course(NamedTuple):
    """Value of a quantity at one instant, and its first and second derivative over time."""

    value: float
    slope: float
    bend: float

    @property
    def vertex(self) -> float:
        """Time from the instant to the vertex of its parabola."""
        return -self.slope / self.bend if self.bend else 0.0

    @property
    def depth(self) -> float:
        """Difference from the value to that at the vertex, positive if that is lower; 0 without a bend."""
        return self.slope**2 / (2.0 * self.bend) if self.bend else 0.0


class FrictionGauge:
    """Gauge of one contact that is dry friction."""

    def __init__(self, layout: CoefficientLayout, contact: int, readings: CompiledReadings | None = None) -> None:
        structure = layout.structure
        self._readings = readings
        self.layout, self.contact, self.n = layout, contact, structure.size
        self._slots = layout.contacts[contact]
        self._law: Any = structure.contacts[contact].law
        self.place = structure.friction.index(contact)
        self.memory = structure.memories.index(contact) if contact in structure.memories else None
        self.reaction = next(
            (number for number, (own, switch) in enumerate(structure.reactions) if own == contact and switch < 0), None
        )

    def sticking(self, modes: DryModes) -> DryModes:
        """Return the modes, at one instant or at some, with this friction in stick."""
        return self._with(modes, 0)

    def slipping(self, modes: DryModes, slip: int) -> DryModes:
        """Return the modes, at one instant or at some, with this friction in slip."""
        return self._with(modes, slip)

    def _with(self, modes: DryModes, slip: int) -> DryModes:
        slips, held = modes.slips.copy(), modes.held.copy()
        slips[..., self.place] = slip
        if self.reaction is not None:
            held[..., self.reaction] = not slip
        return DryModes(slips, held)

    def rate(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes | None, side: int) -> NDArray:
        """Return the slip rate towards a side, over time, for states of the shape (..., state_size)."""
        moved = y[..., self.n : 2 * self.n] @ coefficients[self._slots.deflection]
        if self._slots.sway is not None:
            moved = moved + Angles(self.layout, coefficients, theta).sway(self._slots, 0, 1)
        return side * (moved - coefficients[self._slots.numbers["speed"]])

    def reserve(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> NDArray:
        """Return the force at which slip to a side begins, less the force in stick; shape as `rate`."""
        bound, force = self.bound_and_force(coefficients, theta, y, modes)
        return bound - side * force

    def bound_and_force(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes) -> tuple[Any, NDArray]:
        """Return the force at which slip begins, and the force in stick, under the modes of one instant."""
        if self.reaction is not None and (read := self._read(coefficients, theta, y, modes)) is not None:
            columns, table = read
            force = columns[..., : table.shape[1]] @ table[self.n + self.reaction]
            return columns[..., table.shape[1] + 3 * self.place + 2], force
        if self.memory is not None and self.has_constant_limit:  # nothing but the spring
            own = {name: coefficients[slot] for name, slot in self._slots.numbers.items()}
            return self._law.breakaway([], own), own["stiffness"] * y[..., 2 * self.n + self.memory]
        angles, n = Angles(self.layout, coefficients, theta), self.n
        numbers, stages = angles.named(self._slots.numbers, self._slots.waves), stages_of(self._slots, angles, _ORIGIN)
        if (host := self.layout.structure.host(self.contact)) is not None:
            outside = self.layout.contacts[host]
            vector = coefficients[outside.deflection]
            move = (
                y[..., :n] @ vector + angles.sway(outside),
                y[..., n : 2 * n] @ vector + angles.sway(outside, 0, 1),
            )
            stages.host = Host(stages_of(outside, angles, [move]), contact_force(outside, angles, [move]))
        if self.memory is not None:
            force = numbers["stiffness"] * y[..., 2 * n + self.memory]
        else:
            force = self._balanced(coefficients, angles, y, modes, [self.reaction or 0])[..., 0]
        return self._law.breakaway(stages, numbers), force

    @property
    def has_constant_limit(self) -> bool:
        """True for a spring whose limit depends on no contact and does not vary."""
        return self.memory is not None and self._law.by == "limit" and not self._slots.varies

    def _read(
        self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return the columns of `CompiledReadings.along` for states, and its table; None where they do not serve."""
        if self._readings is None or np.iscomplexobj(coefficients) or np.iscomplexobj(y) or np.iscomplexobj(theta):
            return None
        states, thetas = y.reshape(-1, y.shape[-1]), np.atleast_1d(theta)
        read = self._readings.along(coefficients, states, thetas, modes.slips.astype(float))
        if read is None:
            return None
        return read.reshape(*y.shape[:-1], -1), self._readings.table(coefficients, modes.order(self.layout.structure))

    def acceleration(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> NDArray:
        """Return the derivative of `rate` over time."""
        angles = Angles(self.layout, coefficients, theta)
        moved = self._accelerations(coefficients, angles, y, modes) @ coefficients[self._slots.deflection]
        return side * (moved + angles.sway(self._slots, 0, 2))

    def _accelerations(self, coefficients: NDArray, angles: Angles, y: NDArray, modes: DryModes) -> NDArray:
        """Return accelerations, shape (..., n), under the modes of one instant."""
        if (read := self._read(coefficients, angles.theta, y, modes)) is None:
            return self._balanced(coefficients, angles, y, modes, None)
        columns, table = read
        return columns[..., : table.shape[1]] @ table[: self.n].T

    def _balanced(
        self, coefficients: NDArray, angles: Angles, y: NDArray, modes: DryModes, reactions: list[int] | None
    ) -> NDArray:
        """Return accelerations, shape (..., n), or reactions, under the modes of one instant."""
        layout, n = self.layout, self.n
        held = Constraint(layout, coefficients, modes.order(layout.structure)).coefficients()
        slips, q, v = modes.slips.astype(float), y[..., :n], y[..., n : 2 * n]
        dry = Dry(np.broadcast_to(slips, (*y.shape[:-1], len(slips))), y[..., 2 * n :])
        forces = contact_forces(layout, coefficients, angles.theta, q, v, None, angles, dry)
        rows = layout.accelerations if reactions is None else layout.reactions[reactions]
        return balance(held[rows], q, v, forces, angles.waves)

    def motion(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes) -> NDArray:
        """Return the derivatives of states over time, shape as `y`."""
        n, structure = self.n, self.layout.structure
        turning = self._accelerations(coefficients, Angles(self.layout, coefficients, theta), y, modes)
        found = np.concatenate((y[..., n : 2 * n], turning, 0.0 * y[..., 2 * n :]), axis=-1)
        for place, contact in enumerate(structure.memories):
            gauge = self if contact == self.contact else FrictionGauge(self.layout, contact, self._readings)
            found[..., 2 * n + place] = gauge._extending(coefficients, theta, y, modes, found)
        return found

    def _extending(
        self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, motion: NDArray
    ) -> NDArray | float:
        """Return the derivative of the extension over time, from those of positions and velocities.

        In stick it is the slip rate, in slip that of the limit. A spring without a limit, whose host is open, has let
        go: it does not extend.
        """
        if self.has_constant_limit:
            return 0.0 if modes.slips[self.place] else self.rate(coefficients, theta, y, modes, 1)
        angle = theta + 1j * _STEP / float(coefficients[0])
        limit, _ = self.bound_and_force(coefficients.astype(complex), angle, y + 1j * _STEP * motion, modes)
        if slip := int(modes.slips[self.place]):
            return slip * np.imag(limit) / _STEP / coefficients[self._slots.numbers["stiffness"]]
        return np.where(np.real(limit) > 0.0, self.rate(coefficients, theta, y, modes, 1), 0.0)

    def change(self, function: Any, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> Any:
        """Return the derivative over time of `rate` or `reserve` along the motion under some modes; shape as `rate`."""
        if function == self.rate:
            return self.acceleration(coefficients, theta, y, modes, side)
        return self._along(function, coefficients, theta, y, modes, side)[1]

    def _along(
        self, function: Any, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int
    ) -> tuple[Any, Any]:
        """Return a function, and its derivative over time along the motion by a complex step."""
        moved = y + 1j * _STEP * self.motion(coefficients, theta, y, modes)
        angle = theta + 1j * _STEP / float(coefficients[0])
        found = function(coefficients.astype(complex), angle, moved, modes, side)
        return np.real(found), np.imag(found) / _STEP

    def course(
        self, function: Any, coefficients: NDArray, theta: float, y: NDArray, modes: DryModes, side: int
    ) -> Course:
        """Return `rate` or `reserve` at one instant with two derivatives over time under the modes just before it.

        The second derivative is that of a quantity that is smooth there, to a few digits. It is taken from before the
        instant: an event may follow at once.
        """
        step, way = _BESIDE * float(coefficients[0]), self.motion(coefficients, theta, y, modes)
        shares = np.array((0.0, -1.0, -2.0))
        thetas, states = theta + _BESIDE * shares, y + step * np.multiply.outer(shares, way)
        if function == self.rate:
            value = function(coefficients, theta, y, modes, side)
            slopes = self.acceleration(coefficients, thetas, states, modes, side)
        else:
            values, slopes = self._along(function, coefficients, thetas, states, modes, side)
            value = values[0]
        bend = float(3.0 * slopes[0] - 4.0 * slopes[1] + slopes[2]) / (2.0 * step)
        return Course(float(value), float(slopes[0]), bend)
