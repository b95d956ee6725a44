"""A machine by its parts, which can be mirrored, counted in other units, and begun at another angle of its loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gapwalk as gw
from gapwalk.model.contact import Contact, Side, Stage
from gapwalk.model.registry import Parameter

_OTHER = {Side.POSITIVE: Side.NEGATIVE, Side.NEGATIVE: Side.POSITIVE, Side.BOTH: Side.BOTH}


@dataclass(frozen=True)
class Machine:
    """The arguments of a system, and the range of its frequency; its contacts are odd if both sides are exchanged."""

    coordinates: tuple[str, ...]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    mass: NDArray[np.float64]
    contacts: tuple[Contact, ...]
    harmonics: tuple[gw.Harmonic, ...]
    frequency: float
    to: float
    mean: Mapping[str, float] = field(default_factory=dict)

    @property
    def system(self) -> gw.System:
        """The system at the beginning of the range."""
        return gw.System(
            self.coordinates,
            self.stiffness,
            self.damping,
            self.mass,
            self.contacts,
            self.mean,
            self.harmonics,
            self.frequency,
        )

    def mirrored(self) -> Machine:
        """The machine seen from its other side: all positions have the other sign."""
        return replace(
            self,
            contacts=tuple(map(_mirrored, self.contacts)),
            harmonics=tuple(replace(each, amplitude=-each.amplitude) for each in self.harmonics),
            mean={name: -value for name, value in self.mean.items()},
        )

    def begun_at(self, angle: float) -> Machine:
        """The machine with its period begun at another angle of the loads."""
        shifted = tuple(replace(each, phase=each.phase + each.order * angle) for each in self.harmonics)
        return replace(self, harmonics=shifted)

    def in_units(self, length: float, time: float, force: float) -> Machine:
        """The machine with its numbers in units that are smaller by these factors."""
        units = {"angle": length, "time": time, "torque": force}
        stiffness = force / length
        return replace(
            self,
            stiffness=stiffness * self.stiffness,
            damping=stiffness * time * self.damping,
            mass=stiffness * time**2 * self.mass,
            contacts=tuple(_counted(each, units) for each in self.contacts),
            harmonics=tuple(replace(each, amplitude=force * each.amplitude) for each in self.harmonics),
            frequency=self.frequency / time,
            to=self.to / time,
            mean={name: force * value for name, value in self.mean.items()},
        )


def _mirrored(contact: Contact) -> Contact:
    numbers = dict(contact.numbers)
    for name in ("speed", "offset"):
        if name in numbers:
            numbers[name] = -numbers[name]
    stages = [replace(each, side=_OTHER[each.side]) for each in contact.stages]
    return Contact(contact.name, contact.deflection, stages, contact.force, contact.law, numbers)


def _counted(contact: Contact, units: Mapping[str, float]) -> Contact:
    law = contact.law

    def counted(parameter: Parameter, value: float) -> float:
        kind: Any = parameter.kind or parameter
        for name, unit in units.items():
            value *= unit ** getattr(kind, name, 0)
        return value

    def stage(each: Stage) -> Stage:
        found = {own.name: counted(own, each.number(own) or 0.0) for own in law.stage_parameters}
        plain = {name: found.pop(name) for name in ("clearance", "stiffness", "cubic") if name in found}
        return replace(each, **plain, numbers=found)

    numbers = {own.name: counted(own, contact.numbers[own.name]) for own in law.parameters}
    return Contact(contact.name, contact.deflection, [*map(stage, contact.stages)], contact.force, law, numbers)
