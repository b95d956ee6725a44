"""The non-dimensional form of a drive train with units, exactly, and back.

Angles, times and torques are divided by scales: an angle (a clearance), a frequency and an inertia, as the paper
divides by bc1 and w (section 2 of Padmanabhan and Singh 1995). Every number of a part is counted in a product
of powers of those, so the form of the train, and the names of its numbers, stay the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, structure_of
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind, Units, kind_of


@dataclass(frozen=True, slots=True)
class Scales:
    """The physical values of the number 1 in a non-dimensional drive train.

    Parameters
    ----------
    angle
        In rad, > 0.
    frequency
        In rad/s, > 0: the time 1 is one divided by it.
    inertia
        In kg m^2, > 0.

    Raises
    ------
    ModelError
        If one of them is not > 0.
    """

    angle: float
    frequency: float
    inertia: float

    def __post_init__(self) -> None:
        for name in ("angle", "frequency", "inertia"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ModelError(f"the scale {name} is {getattr(self, name)!r}; it must be a number > 0")
            object.__setattr__(self, name, float(getattr(self, name)))

    @property
    def torque(self) -> float:
        """Scale of torques, in N m."""
        return self.inertia * self.frequency**2 * self.angle

    def of(self, kind: QuantityKind | None) -> float:
        """Return the physical value of the number 1 of a kind, in SI units with rad."""
        if kind is None or kind is QuantityKind.PHASE:
            return 1.0
        powers = kind.value
        return self.angle**powers.angle * self.frequency**-powers.time * self.torque**powers.torque

    @property
    def words(self) -> str:
        """Write the scales in one line."""
        return (
            f"1 means an angle of {math.degrees(self.angle):.6g} deg, a frequency of {self.frequency:.6g} rad/s, "
            f"an inertia of {self.inertia:.6g} kg m^2, a torque of {self.torque:.6g} N m"
        )


@dataclass(frozen=True)
class NonDimensional:
    """A drive train without units, with the physical one that it represents.

    Attributes
    ----------
    physical
        The system with units.
    system
        The same without; its parameters have the same names, but ``frequency`` for a ``speed``.
    scales
        Physical values of its numbers.
    """

    physical: System
    system: System
    scales: Scales

    def name(self, parameter: str) -> str:
        """Return the name in the non-dimensional system of a parameter of the physical one."""
        return "frequency" if parameter == self.physical.structure.pace else parameter

    def value(self, parameter: str, value: float) -> float:
        """Return the non-dimensional value of a parameter (by its physical name) from a value in its unit."""
        return value * self._factor(parameter)

    def physical_value(self, parameter: str, value: float) -> float:
        """Return the value in its unit of a parameter (by its physical name) from the non-dimensional one."""
        return value / self._factor(parameter)

    def state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Make a non-dimensional state from a physical one (angles, then angles per second), shape (..., 2n)."""
        return np.asarray(state, dtype=float) * self._states

    def physical_state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Make a physical state from a non-dimensional one, shape (..., 2n)."""
        return np.asarray(state, dtype=float) / self._states

    def _factor(self, parameter: str) -> float:
        return _factor(self._units, parameter, self.scales)

    @property
    def _units(self) -> Units:
        return _units(self.physical)

    @cached_property
    def _states(self) -> NDArray[np.float64]:
        angle = self._units.angle / self.scales.angle
        return np.repeat([angle, angle / self.scales.frequency], self.physical.size)


def nondimensional(system: System, scales: Scales | None = None) -> NonDimensional:
    """Make the non-dimensional form of a drive train with units.

    Parameters
    ----------
    system
        The system of a train with units.
    scales
        Physical values of its numbers; by default `scales_of` the system.

    Raises
    ------
    ModelError
        If the system is no drive train, or has no units.
    """
    units, assembly = _units(system), system.structure.assembly
    assert isinstance(assembly, TrainAssembly)
    scales = scales_of(system) if scales is None else scales
    factors = np.array([_factor(units, name, scales) for name in system.structure.names])
    structure = structure_of(TrainAssembly(assembly.form))
    return NonDimensional(system, System.from_values(structure, system.values * factors), scales)


def scales_of(system: System) -> Scales:
    """Choose scales at which the numbers of a train are about 1.

    They are those of the paper: of the first link that has a clearance, the innermost clearance that is not 0; the
    inertia with which its deflection vibrates alone; and its frequency with the first stage closed, so that stiffnesses
    K11 and n1 of the paper add up to 1. Without clearances the first coordinate counts, and 1 deg.

    Raises
    ------
    ModelError
        If the system is no drive train, or has no units.
    """
    units, assembly = _units(system), system.structure.assembly
    assert isinstance(assembly, TrainAssembly)
    form, values = assembly.form, assembly.consistent(system.values)
    elastic = next((number for number in form.springs if not form.links[number].drag), form.springs[0])
    number, contact = next(
        ((number, contact) for number, contact in form.contacts if number in form.springs), (elastic, None)
    )
    place = form.springs.index(number)
    stiffness, clearance = form.stiffnesses(values)[number], 0.0
    if contact is not None:
        numbers = [system.equations[f"{contact.stage_prefix(contact.stages[0])}.{what}"] for what in ("stiffness",)]
        stiffness += abs(numbers[0])
        gaps = [system.equations[f"{contact.stage_prefix(stage)}.clearance"] for stage in contact.stages]
        clearance = next((gap for gap in gaps if gap > 0.0), 0.0)
    alone = 1.0 / np.linalg.inv(system.matrix("mass"))[place, place]
    inertia = alone / units.angle  # from the unit of angles to rad
    angle = clearance * units.angle or math.radians(1.0)
    return Scales(float(angle), float(np.sqrt(stiffness / alone)) or 1.0, float(inertia))


def _units(system: System) -> Units:
    if system.units is None:
        raise ModelError("the system has no units; only a drive train with units has another, non-dimensional form")
    return system.units


def _factor(units: Units, parameter: str, scales: Scales) -> float:
    kind = kind_of(parameter)
    if kind is None:
        return 1.0
    unit = units.frequency if kind is QuantityKind.FREQUENCY else units.of(kind).factor
    return unit / scales.of(kind)
