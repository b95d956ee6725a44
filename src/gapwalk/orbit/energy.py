"""Energy book-keeping of an orbit: what works on it, and where the work goes, element by element.

With the velocities, the equations of motion are an equation of powers. Over a period of an orbit the kinetic and the
potential energy return to their values, so that the work of all loads is what dampers, friction and impacts dissipate:

    loads + displacements + variations + moving bases  =  damping + contacts + friction + impacts

Each term is an integral of Gauss's rule between the events of the motion, accurate to rounding; what an impact loses is
the kinetic energy before it less that after it. So both sides are computed apart, and their difference shows the error.

Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import Angles, contact_force
from gapwalk.flow.friction_state import Kink
from gapwalk.flow.motion import Quadrature, quadrature
from gapwalk.model.coefficients import ContactSlots, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.modes import SYMMETRIC, mass_of_energy
from gapwalk.model.system import System, pace_text
from gapwalk.notebook import Shown
from gapwalk.summary import SummaryParts, Table, summarizes

_AT_ONCE = 1e-12  # radians within which impacts are at one instant

Array = NDArray[np.float64]


class Moving(Protocol):
    """An orbit, or another motion that repeats after a number of forcing periods from its state at theta = 0."""

    @property
    def system(self) -> System:
        """The system that moves."""
        ...

    @property
    def period(self) -> int | None:
        """Forcing periods after which it repeats."""
        ...

    @property
    def state(self) -> Array:
        """State at theta = 0."""
        ...


@dataclass(frozen=True, slots=True)
class EnergyItem:
    """The work of one load, or the loss in one element."""

    element: str  #: Name of the load, the contact or the link; ``damping`` for the damping matrix.
    #: ``load``, ``displacement``, ``variation`` or ``moving base``, which do work; or ``damping``, ``friction``,
    #: ``impacts``, ``force`` or ``stiffness``, which take it.
    kind: str
    #: Work, or loss, in one period of the orbit: in J in a system with units, otherwise a force times a length.
    energy: float
    power: float  #: Its mean over the period: in W in a system with units.
    share: float  #: Fraction of the work of all loads that do work on the motion.


@dataclass(frozen=True, eq=False)
class Energy(Shown):
    """Work and losses of an orbit in one period, element by element.

    Notes
    -----
    Where the equations are given in a form whose matrices are not symmetric, as after a division by masses, the masses
    are found for which each contact acts along its own deflection, and the stiffness matrix is symmetric.
    """

    _words: ClassVar[dict[str, str]] = {"work": "work of", "losses": "loss in"}

    system: System  #: The system that moves.
    period: int  #: Forcing periods of the orbit.
    duration: float  #: Time of one period of the orbit.
    #: What does work: each load, displacement, variation of a number and moving base; negative where it takes energy.
    work: tuple[EnergyItem, ...]
    losses: tuple[EnergyItem, ...]  #: Where it goes: dampers, contacts, friction, impacts.

    @property
    def supplied(self) -> float:
        """Work of all loads in one period."""
        return sum(each.energy for each in self.work)

    @property
    def dissipated(self) -> float:
        """Sum of all losses in one period."""
        return sum(each.energy for each in self.losses)

    @property
    def imbalance(self) -> float:
        """Work less losses, over the larger of their sums of sizes: the error of the book-keeping."""
        size = max(sum(abs(each.energy) for each in items) for items in (self.work, self.losses))
        return (self.supplied - self.dissipated) / size if size else 0.0

    def of(self, element: str) -> float:
        """Return the sum of the losses in one element, such as a contact, in one period."""
        own = [each.energy for each in self.losses if each.element == element]
        if not own:
            known = ", ".join(dict.fromkeys(each.element for each in self.losses)) or "there are none"
            raise ModelError(f"no element named {element!r} loses energy; elements with losses: {known}")
        return sum(own)

    @summarizes
    def summary(self) -> SummaryParts:
        """See `Described.summary`."""
        units = self.system.units is not None
        heads = ("energy [J]", "power [W]") if units else ("energy", "power")
        cycle = "one period" if self.period == 1 else f"{self.period} periods"
        yield f"energy in {cycle} of the excitation at {pace_text(self.system)}:"
        for words, items in (("work of", self.work), ("loss in", self.losses)):
            rows = [(e.element, e.kind, f"{e.energy:.6g}", f"{e.power:.6g}", f"{100 * e.share:.2f} %") for e in items]
            yield Table((words, "by", *(f">{head}" for head in heads), ">share"), rows)
        yield f"work less losses: {self.imbalance:.1e} of the work"

    def __repr__(self) -> str:
        return f"Energy(work {self.supplied:.6g}, losses {self.dissipated:.6g} in {self.period} forcing periods)"


def energy(orbit: Moving) -> Energy:
    """Compute the work of each load, and the loss in each element, in one period of an orbit.

    Parameters
    ----------
    orbit
        The orbit, or a settled motion with a period.

    Returns
    -------
    Energy
        Work and losses in J and W in a system with units; otherwise in units of the force times the deflection.

    Raises
    ------
    ModelError
        If the motion has no period, or does not satisfy the equations of motion exactly, or there is no symmetric mass
        matrix, so that no kinetic energy is known.
    FlowError
        If the motion diverges.

    Examples
    --------
    >>> book = gw.analysis.energy(slipping)
    >>> round(book.of("brake") / book.supplied, 6)
    0.885799
    """
    if not orbit.period:
        raise ModelError("a motion that does not repeat has no balance of energy over a period")
    if not getattr(orbit, "is_exact", True):
        raise ModelError(
            "an orbit of harmonic balance neglects higher harmonics, and its energy is not exact; refine it "
            "first: gw.find_orbit(orbit.system, orbit.period, start=orbit.state)"
        )
    system = orbit.system
    along = quadrature(system, orbit.state, orbit.period, getattr(orbit, "known_states", ()))
    return _Book(system, along).closed(orbit.period)


def impact_losses(system: System, along: Quadrature) -> dict[tuple[float, int], float]:
    """Compute the energy loss of each impact on a rigid stop, by its angle and the number of its contact."""
    book = _Book(system, along)
    return {(kink.theta, contact): loss for kink in along.motion.impacts for contact, loss, _ in book.impact(kink)}


class _Book:
    """Powers along a motion at the nodes of Gauss's rule."""

    def __init__(self, system: System, along: Quadrature) -> None:
        self.system, self.along, motion = system, along, along.motion
        self.layout, self.coefficients = layout_of(system.structure), coefficients_of(system)
        self.angles = Angles(self.layout, self.coefficients, motion.theta)
        self.table = self.layout.table(system.values)
        n, assembly = system.size, system.structure.assembly
        self.leaks = np.zeros(n)
        self.train = None
        if isinstance(assembly, TrainAssembly):
            self.train = assembly.numbers(system.values)
            self.leaks = np.broadcast_to(self.train.leaks, (n,))
        # where a drag alone joins two groups of inertias, a velocity is not the derivative of its coordinate
        self.v = motion.v + self.leaks * motion.q
        self.mass = mass_of_energy(system)
        self.forces = self.mass @ self.table  # columns of stiffness, damping, contacts, mean load, loads

    def integral(self, power: Array) -> float:
        """Return the integral of a power over time."""
        return float(self.along.weights @ power)

    def closed(self, period: int) -> Energy:
        """Return the book over one period of an orbit."""
        duration, unit = PERIOD * period / self.system.frequency, 1.0
        if self.system.units is not None:
            unit = self.system.units.angle  # a torque times an angle is in J
        work = [*self._loads(), *(each for each in self._of_contacts() if each[1] in _GIVE)]
        losses = [*self._damping(), *(each for each in self._of_contacts() if each[1] not in _GIVE)]
        total = sum(value for *_, value in work if value > 0.0)

        def items(found: list[tuple[str, str, float]]) -> tuple[EnergyItem, ...]:
            return tuple(
                EnergyItem(name, kind, unit * value, unit * value / duration, value / total if total else 0.0)
                for name, kind, value in found
            )

        return Energy(self.system, period, duration, items(work), items(losses))

    def _loads(self) -> Iterator[tuple[str, str, float]]:
        """Yield the work of the mean load, and of each load on coordinates."""
        equations = self.system.equations
        first = 2 * self.system.size + len(self.layout.contacts)
        if self.forces[:, first].any():
            yield "mean load", "load", self.integral(self.v @ self.forces[:, first])
        theta = self.along.motion.theta
        for column, load in enumerate(equations.structure.driving, start=first + 1):
            lines = load.lines(equations.values[0], [equations[name] for name in load.parameters])
            wave = sum(
                line.cosine * np.cos(line.order * theta) + line.sine * np.sin(line.order * theta) for line in lines
            )
            yield load.name, "load", self.integral((self.v @ self.forces[:, column]) * wave)

    def _damping(self) -> Iterator[tuple[str, str, float]]:
        """Yield the loss in the damping matrix (in a train, in each link), and in a stiffness without a potential."""
        n, q, v = self.system.size, self.along.motion.q, self.v
        stiffness, damping = self.forces[:, :n], self.forces[:, n : 2 * n]
        damping = damping - self.mass * self.leaks
        stiffness = stiffness - damping * self.leaks
        if self.train is not None:
            assembly = self.system.structure.assembly
            assert isinstance(assembly, TrainAssembly)
            rates = v @ self.train.deflections.T
            for number, link in enumerate(assembly.form.links):
                if self.train.damping[number]:
                    yield link.name, "damping", self.integral(self.train.damping[number] * rates[:, number] ** 2)
        elif damping.any():
            yield "damping", "damping", self.integral(np.sum(v * (v @ damping.T), axis=1))
        turning = 0.5 * (stiffness - stiffness.T)
        if np.abs(turning).max(initial=0.0) > SYMMETRIC * np.abs(stiffness).max(initial=0.0):
            yield "stiffness", "stiffness", self.integral(np.sum(v * (q @ turning.T), axis=1))

    def _of_contacts(self) -> list[tuple[str, str, float]]:
        """Return the work and the losses of all contacts, computed once."""
        return self._contacts

    @cached_property
    def _contacts(self) -> list[tuple[str, str, float]]:
        found: list[tuple[str, str, float]] = []
        strikes = dict.fromkeys(range(len(self.layout.contacts)), (0.0, 0.0))
        for kink in self.along.motion.impacts:
            for contact, loss, displaced in self.impact(kink):
                before = strikes[contact]
                strikes[contact] = before[0] + loss, before[1] + displaced
        for index, slots in enumerate(self.layout.contacts):
            found += self._contact(index, slots, *strikes[index])
        return found

    def _contact(
        self, index: int, slots: ContactSlots, lost: float, displaced: float
    ) -> Iterator[tuple[str, str, float]]:
        """Yield work and losses of one contact; those of its impacts are given."""
        motion, name, law = self.along.motion, slots.form.name, slots.form.law
        push = self.forces[:, 2 * self.system.size + index]
        force, along_push = motion.forces[:, index], self.v @ push
        if law.is_dry:
            speed, rate = float(self.coefficients[slots.numbers["speed"]]), self._rate(slots)
            heat, stretched = self.integral(force * (rate - speed)), self._stretching(index, slots)
            if not self._is_reciprocal(slots, push):
                yield name, "force", self.integral(force * (along_push - rate + speed))
            else:
                if slots.sway is not None:
                    yield name, "displacement", self.integral(force * (rate - along_push))
                if speed:
                    yield name, "moving base", -speed * self.integral(force)
            if stretched:
                yield name, "variation", stretched
            yield name, "friction", heat + stretched
            return
        if not self._is_reciprocal(slots, push) or slots.deflections[1:]:
            yield name, "force", self.integral(force * along_push)
        else:
            rate = self._rate(slots)
            if slots.sway is not None:
                yield name, "displacement", self.integral(force * (rate - along_push)) + displaced
            spring = np.zeros_like(force)
            if not law.rebounds:
                still = np.zeros_like(rate)
                spring = contact_force(slots, self.angles, [(self._place(slots), still)])
            if self._varies(slots):
                yield name, "variation", -self.integral(spring * rate)
            if law.is_damped and not law.rebounds:
                yield name, "damping", self.integral((force - spring) * rate)
        if law.rebounds:
            yield name, "impacts", lost

    def _varies(self, slots: ContactSlots) -> bool:
        """Return True if a number of a contact varies over the angle."""
        own = [name for name in slots.waves if name not in slots.form.law.arguments]
        return bool(own) or any(stage.waves for stage in slots.stages)

    def _stretching(self, index: int, slots: ContactSlots) -> float:
        """Return the work of a varying stiffness on the spring of friction: the integral of ``k' z^2 / 2``."""
        wave, structure = slots.waves.get("stiffness"), self.layout.structure
        if wave is None or index not in structure.memories:
            return 0.0
        z = self.along.motion.z[:, structure.memories.index(index)]
        slope = self.angles.wave(wave, 1) / self.coefficients[0] * self.coefficients[slots.numbers["stiffness"]]
        return self.integral(0.5 * slope * z**2)

    def _place(self, slots: ContactSlots) -> Array:
        return self.along.motion.q @ self.coefficients[slots.deflection] + self.angles.sway(slots)

    def _rate(self, slots: ContactSlots) -> Array:
        """Return the rate of a deflection, with its displacement."""
        return self.v @ self.coefficients[slots.deflection] + self.angles.sway(slots, 0, 1)

    def _is_reciprocal(self, slots: ContactSlots, push: Array) -> bool:
        """Return True if a contact acts along its own deflection."""
        vector = self.coefficients[slots.deflection]
        return bool(np.abs(push - vector).max() <= SYMMETRIC * np.abs(vector).max())

    def impact(self, kink: Kink) -> Iterator[tuple[int, float, float]]:
        """Yield for each contact that is struck at one instant its number, its loss, and the work of its displacement.

        The impulses p follow from the jump of the velocities, and each takes ``p d.v`` at the mean velocity.
        """
        system, (before, after) = self.system, kink.velocities
        switches = system.structure.breakpoints
        struck = sorted(
            {
                switches[event.switch].contact
                for event in self.along.motion.events
                if event.enters and abs(event.theta - kink.theta) <= _AT_ONCE
            }
        )
        struck = [contact for contact in struck if self.layout.contacts[contact].form.law.rebounds]
        first = 2 * system.size
        columns = self.table[:, [first + contact for contact in struck]]
        impulses = np.linalg.lstsq(-columns, after - before, rcond=None)[0]
        mean = 0.5 * (before + after) + self.leaks * kink.positions
        angles = Angles(self.layout, self.coefficients, kink.theta)
        for contact, impulse in zip(struck, impulses.tolist(), strict=True):
            slots, push = self.layout.contacts[contact], self.forces[:, first + contact]
            taken = impulse * float(push @ mean)
            moved = impulse * float(angles.sway(slots, 0, 1)) if self._is_reciprocal(slots, push) else 0.0
            yield contact, taken + moved, moved


_GIVE = ("load", "displacement", "variation", "moving base")
