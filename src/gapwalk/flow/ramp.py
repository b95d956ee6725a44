"""The exact flow of a system whose speed changes steadily: a variant of the compiled flow, with the same events.

Over the angle theta of the excitation, the equations of motion are those at constant speed, with 1/W a function of the
angle. At a constant acceleration ``a = dW/dt`` the square of the speed grows linearly with the angle,

    dW/dtheta = a / W,    W^2 = W0^2 + 2 a (theta - theta0)

so ``1/W`` is known in closed form, and its Taylor series is part of that of the motion. The time since the start of a
piece of constant acceleration is ``t = 2 (theta - theta0) / (W0 + W)``. Loads that grow with the speed are polynomials
of W of degree 2, found from the coefficients themselves.

A train whose speed is held by a reaction needs a torque to run up: at each instant the reaction drives the inertias of
all its parts. That torque, ``a sum(J r^2)`` in terms of the reaction's own shaft, acts on the reaction's inertia. The
mean slips of drags grow with the speed, and their torques with the first and second power of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.equations import Equations
from gapwalk.flow.flow import Flow, Variations
from gapwalk.flow.forces import Angles, balance, contact_forces
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, structure_of
from gapwalk.model.laws.formula import is_computed
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

_NODES = (0.5, 1.0, 1.5)  # speeds, relative to the given one, whose parabola gives the growth with the speed
_CHECKS = (0.7, 1.25)
_EXACT = 1e-11  # relative difference above which a coefficient is no parabola of the speed


class _AtSpeeds(Angles):
    """Angles along a run-up, where numbers of laws grow with the speed, as the slip of a drag does."""

    def __init__(self, layout: CoefficientLayout, growth: NDArray, theta: NDArray, speed: NDArray) -> None:
        super().__init__(layout, growth[0], theta)
        self.growth, self.speed = growth, speed

    def value(self, slot: int) -> NDArray:
        """Return a number of a law at each sample."""
        return np.polynomial.polynomial.polyval(self.speed, self.growth[:, slot])


@dataclass(frozen=True, eq=False)
class Ramped:
    """Coefficients of a system as functions of the speed, and its exact flow at a constant acceleration."""

    system: System  #: The system; its own speed does not matter.

    def __post_init__(self) -> None:
        for problem in ramp_problems(self.system):
            raise ModelError(f"a run-up of this system is not possible: {problem}")
        assembly = self.system.structure.assembly
        if isinstance(assembly, TrainAssembly) and assembly.form.has_turn:
            free = structure_of(replace(assembly, form=replace(assembly.form, keeps_speed=False)))
            object.__setattr__(self, "system", System.from_values(free, self.system.values))
        assert self.growth.shape[0] == 3  # refuses what is no parabola of the speed

    @cached_property
    def growth(self) -> NDArray[np.float64]:
        """Coefficients by powers 0, 1, 2 of the speed W, shape (3, number of coefficients)."""
        system, layout, unit = self.system, layout_of(self.system.structure), self.system.structure.frequency
        base = system.frequency

        def at(factor: float) -> NDArray[np.float64]:
            values = system.values.copy()
            values[0] = base * factor / unit
            found = layout.compute(values)
            found[0] = 0.0
            return found

        known = np.array([at(factor) for factor in _NODES])
        found = np.linalg.solve(np.vander(_NODES, increasing=True), known)
        scale = np.abs(known).max(axis=0)
        forcing = layout.accelerations[:, 2 * layout.structure.size + len(layout.contacts) :]
        # what cancels is rounding of the largest load
        scale[forcing] = np.maximum(scale[forcing], np.finfo(float).eps / _EXACT * scale[forcing].max(initial=0.0))
        constant = np.ptp(known, axis=0) <= _EXACT * scale
        found[0, constant], found[1:, constant] = known[1, constant], 0.0
        found[np.abs(found) <= _EXACT * scale] = 0.0
        loads = np.zeros(len(layout), dtype=bool)
        loads[forcing] = True
        for contact in layout.contacts:
            own = {each.name: slot for each, slot in contact.parameters()} if not contact.stages else {}
            loads[[slot for name, slot in own.items() if is_computed(name)]] = True
        errors = [
            np.abs(np.polynomial.polynomial.polyval(each, found) - at(each)) > 100 * _EXACT * scale for each in _CHECKS
        ]
        if np.any(errors) or np.any(~constant & ~loads):
            raise ModelError(
                "a run-up of this system is not possible: a number other than the size of a load depends on the "
                "speed, or a load depends on it in another way than by its first or second power"
            )
        return found / base ** np.arange(3.0)[:, None]

    @cached_property
    def carried(self) -> NDArray[np.float64]:
        """Constant accelerations of the coordinates by the torque that runs a train up, at ``dW/dt = 1``; shape (n,).

        It is zero unless a reaction holds the speed of a train.
        """
        assembly, none = self.system.structure.assembly, np.zeros(self.system.size)
        units = self.system.units
        if not isinstance(assembly, TrainAssembly) or units is None or units.turns is None:
            return none
        form, train = assembly.form, assembly.numbers(self.system.values)
        if form.reaction is None:
            return none
        torque = np.zeros(len(form.inertias))
        torque[form.reaction] = np.sum(train.inertia * train.speeds**2) / train.speeds[form.reaction]
        if not form.is_free or form.has_turn:  # the other coordinates of a free train do not turn with it
            torque -= train.inertia * train.speeds
        reference = 1.0 if form.reference is None else float(train.speeds[form.reference])
        if form.massless:
            moved: Any = np.linalg.solve(self.system.matrix("mass"), train.angles.T @ torque)
        else:
            bodies, flexed, _ = train.flexed
            moved = flexed @ (bodies.T @ torque)
        return moved * form.pace / reference

    @cached_property
    def flow(self) -> Flow:
        """The compiled flow."""
        count = len(layout_of(self.system.structure))
        pattern = np.zeros(3 * count + 2, dtype=bool)
        pattern[: 3 * count] = (self.growth != 0.0).ravel()
        pattern[:count] |= pattern[: 3 * count].reshape(3, count).any(axis=0)
        pattern[self.means] |= self.carried != 0.0
        pattern[[0, -2, -1]] = True
        return _compile(self.system.structure, pattern.tobytes())

    @cached_property
    def means(self) -> NDArray[np.intp]:
        """Slots of the constant accelerations."""
        layout = layout_of(self.system.structure)
        return layout.accelerations[:, 2 * layout.structure.size + len(layout.contacts)]

    def coefficients(self, speed: float | NDArray[np.float64], acceleration: float) -> NDArray[np.float64]:
        """Return the coefficients at a speed W, one or many, and an acceleration; shape (..., number)."""
        speed = np.asarray(speed, dtype=float)
        found = np.multiply.outer(speed**0, self.growth[0])
        found = found + np.multiply.outer(speed, self.growth[1]) + np.multiply.outer(speed**2, self.growth[2])
        found[..., self.means] += acceleration * self.carried
        found[..., 0] = 1.0 / speed
        return found

    def accelerations(
        self,
        theta: NDArray[np.float64],
        q: NDArray[np.float64],
        v: NDArray[np.float64],
        forces: NDArray[np.float64],
        speed: NDArray[np.float64],
        acceleration: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the accelerations ``q''`` over time, shape (samples, n)."""
        # Shapes: `theta`, `speed`, `acceleration` (samples,); `q`, `v` (samples, n); `forces` (samples, contacts).
        layout = layout_of(self.system.structure)
        waves = Angles(layout, self.growth[0], theta).waves
        total = np.multiply.outer(acceleration, self.carried)
        for power, table in enumerate(self.growth[:, layout.accelerations]):  # those of powers 1 and 2 have loads alone
            if table.any():
                total += speed[:, None] ** power * balance(table, q, v, forces, waves)
        return total

    def forces(
        self, theta: NDArray[np.float64], states: NDArray[np.float64], speed: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the contact forces at samples with the speeds W, shape (samples, contacts)."""
        layout, (q, v) = layout_of(self.system.structure), np.split(states, 2, axis=1)
        return contact_forces(layout, self.growth[0], theta, q, v, angles=_AtSpeeds(layout, self.growth, theta, speed))

    def sample(
        self, state: NDArray[np.float64], thetas: NDArray[np.float64], speed: float, acceleration: float
    ) -> Variations:
        """Return the states at increasing angles, of which the first is the start, with the events; see `Flow.sample`.

        Shapes: `state` (2n,).
        """
        square, growth = speed**2 - 2.0 * acceleration * thetas[0], 2.0 * acceleration
        given = self.growth.copy()
        given[0, self.means] += acceleration * self.carried
        given[0, 0] = 1.0 / speed  # only the size of motions is judged by it
        return self.flow.sample(np.concatenate((given.ravel(), [growth, square])), state, thetas)


def ramp_problems(system: System) -> Iterator[str]:
    """Yield the reasons why a system cannot run up, one sentence each."""
    structure, layout = system.structure, layout_of(system.structure)
    numbers = coefficients_of(system)
    for slots in layout.contacts:
        if "static" in slots.numbers and numbers[slots.numbers["static"]] != 1.0:
            yield f"at rest the friction of {slots.form.name} is larger than in slip; write static = 1.0"
    if any(form.law.rebounds for form in structure.contacts):
        yield "it has a rigid stop, whose impacts are decided at constant speed; give the stop a stiffness"
    for slots in layout.contacts:
        if any(argument in slots.waves for argument in slots.form.law.arguments):
            yield f"a displacement is added to the deflection of {slots.form.name}; leave that load out"
    for load in structure.equations.harmonics:
        if load.is_scaled:
            yield f"the load {load.name} has a factor over the speed; give it a constant amplitude, or growth 1 or 2"


@lru_cache(maxsize=16)
def _compile(structure: Structure, mask: bytes) -> Flow:
    pattern = np.frombuffer(mask, dtype=bool)
    return Flow(Equations(layout_of(structure), pattern, (), ramp=True))
