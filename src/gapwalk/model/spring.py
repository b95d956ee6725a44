"""The static spring of a contact: its force and its slope by the deflection, with the numbers of one system."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import DampingLaw
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System


@dataclass(frozen=True, slots=True)
class Slope:
    """A stage on one side of its contact: ``stiffness * xi + cubic * xi**3`` beyond ``sign * clearance``."""

    stage: str
    sign: int
    clearance: float
    stiffness: float
    cubic: float

    def depth(self, x: float) -> float:
        """How far a deflection is past the clearance; below zero if it is not."""
        return self.sign * x - self.clearance


Range = tuple[tuple[Slope, ...], float, float]
"""A stretch of a deflection: the stages that are closed on it, from where, to where."""


@dataclass(frozen=True, eq=False)
class Spring:
    """The spring of a contact.

    Attributes
    ----------
    form
        The contact without its numbers.
    deflection, force : shape (n,)
        The vectors e and d.
    slopes
        Its stages on each side, from the inside out.
    coefficient
        Of its damping law.
    """

    form: ContactForm
    deflection: NDArray[np.float64]
    force: NDArray[np.float64]
    slopes: tuple[Slope, ...]
    coefficient: float

    def drag(self, force: float, closed: tuple[Slope, ...]) -> float:
        """What the damping force grows by with the rate of the deflection, at a force of the spring."""
        factors = {
            DampingLaw.NONE: 0.0,
            DampingLaw.VISCOUS: 1.0 if closed else 0.0,
            DampingLaw.HUNT_CROSSLEY: abs(force),
            DampingLaw.HUNT_CROSSLEY_AS_PRINTED: force,
        }
        return factors[self.form.damping] * self.coefficient

    def pull(self, x: float, closed: tuple[Slope, ...]) -> tuple[float, float]:
        """Force and slope at a deflection while these stages are closed."""
        force = slope = 0.0
        for each in closed:
            depth = each.depth(x)
            force += each.sign * (each.stiffness * depth + each.cubic * depth**3)
            slope += each.stiffness + 3.0 * each.cubic * depth**2
        return force, slope

    def energy(self, x: float) -> float:
        """The energy stored at a deflection."""
        depths = [(each, max(each.depth(x), 0.0)) for each in self.slopes]
        return sum(0.5 * each.stiffness * depth**2 + 0.25 * each.cubic * depth**4 for each, depth in depths)

    def closed(self, x: float, margin: float = 0.0) -> tuple[Slope, ...]:
        """The stages that are closed at a deflection, beyond a margin."""
        return tuple(each for each in self.slopes if each.depth(x) > margin)

    def innermost(self) -> tuple[Slope, ...]:
        """The stage that closes first, on the positive side if there is one."""
        sides = [[each for each in self.slopes if each.sign == sign] for sign in (1, -1)]
        return tuple(next(side for side in sides if side)[:1])

    def ranges(self) -> Iterator[Range]:
        """The stretches of the deflection on which nothing closes or opens: what is closed, from where, to where."""
        up, down = ([each for each in self.slopes if each.sign == sign] for sign in (1, -1))
        for sign, side in ((1, up), (-1, down)):
            ends = [each.clearance for each in side] + [math.inf]
            for count in range(1, len(side) + 1):
                low, high = sorted((sign * ends[count - 1], sign * ends[count]))
                yield tuple(side[:count]), low, high
        yield (), -down[0].clearance if down else -math.inf, up[0].clearance if up else math.inf


def springs_of(system: System) -> tuple[Spring, ...]:
    """The springs of all contacts of a system."""
    return tuple(_spring(system, form) for form in system.structure.contacts)


def _spring(system: System, form: ContactForm) -> Spring:
    slopes = []
    for stage in form.stages:
        prefix = form.stage_prefix(stage)
        numbers = [system.equations[f"{prefix}.{what}"] for what in ("clearance", "stiffness", "cubic")]
        slopes += [Slope(stage.name, sign, *numbers) for sign in stage.side.signs]
    deflection = system.vector(f"{form.name}.deflection")
    force = deflection if form.reciprocal else system.vector(f"{form.name}.force")
    coefficient = system.equations[f"{form.name}.{form.damping_name}"] if form.damping_name else 0.0
    return Spring(form, deflection, force, tuple(slopes), coefficient)
