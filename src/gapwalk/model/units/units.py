"""The units of a drive train: one for each kind of quantity, and how they become the numbers of its equations.

Its equations of motion are in *consistent* units: the unit of its angles (deg, say), s, and N m. So deflections come
out as an engineer reads them, torques in N m, and time in s.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.problems import given
from gapwalk.model.units.kind import QuantityKind, kind_of
from gapwalk.model.units.quantity import Quantity, read_quantity

_TOLD = ("frequency", "amplitude", "inertia", "stiffness", "damping", "clearance", "impact_damping")
_DEGREE = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit.

    Parameters
    ----------
    text
        As it is written.
    factor
        What it is in the reference unit of its kind: SI, with angles in rad and speeds in rad/s.
    """

    text: str
    factor: float

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if not 0.0 < self.factor < math.inf or not self.text.isprintable():
            raise ValueError(f"{self.text!r} is no unit")


_DEFAULTS = {
    QuantityKind.ANGLE: Unit("deg", _DEGREE),
    QuantityKind.INERTIA: Unit("kg m^2", 1.0),
    QuantityKind.STIFFNESS: Unit("N m/rad", 1.0),
    QuantityKind.CUBIC: Unit("N m/rad^3", 1.0),
    QuantityKind.DAMPING: Unit("N m s/rad", 1.0),
    QuantityKind.IMPACT: Unit("s/rad", 1.0),
    QuantityKind.TORQUE: Unit("N m", 1.0),
    QuantityKind.FREQUENCY: Unit("Hz", 2.0 * math.pi),
    QuantityKind.PHASE: Unit("deg", _DEGREE),
}


@dataclass(frozen=True)
class Units:
    """The units in which the parameters of a drive train are counted.

    Parameters
    ----------
    chosen
        A unit for each kind that has one of its own; the others have the usual ones.
    turns
        Where the first parameter is the speed of a shaft: periods of the excitation in one turn of it. None where it is
        the frequency of the excitation.
    """

    chosen: tuple[tuple[QuantityKind, Unit], ...] = ()
    turns: int | None = None

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if self.turns is not None and self.turns < 1:
            raise ValueError(f"{self.turns} is no number of periods in a turn")

    def of(self, kind: QuantityKind) -> Unit:
        """The unit of a kind."""
        return self._units[kind]

    def parameter(self, name: str) -> str:
        """The unit of a parameter by its name; empty for a plain number."""
        kind = kind_of(name)
        return "" if kind is None else self.of(kind).text

    @property
    def words(self) -> str:
        """What is counted in what, in a line."""
        kinds = {word: kind for word in _TOLD if (kind := kind_of(word)) is not None}
        names = {"frequency": self.pace, "amplitude": "torque"}
        kinds = {names.get(word, word.replace("_", " ")): kind for word, kind in kinds.items()}
        return ", ".join(f"{word} in {self.of(kind).text}" for word, kind in kinds.items())

    @property
    def angle(self) -> float:
        """The unit of angles, in rad."""
        return self.of(QuantityKind.ANGLE).factor

    @property
    def pace(self) -> str:
        """The name of the first parameter: the frequency of the excitation, or the speed of a shaft."""
        return "frequency" if self.turns is None else "speed"

    @property
    def frequency(self) -> float:
        """The angular frequency W of the excitation, in rad/s, at the value 1 of the first parameter."""
        return self.of(QuantityKind.FREQUENCY).factor * (self.turns or 1)

    def factors(self, names: Iterable[str]) -> NDArray[np.float64]:
        """What one unit of each parameter is in consistent units, shape (names,)."""
        return np.array([self._factor(name) for name in names])

    def number(self, quantity: Quantity, kind: QuantityKind) -> float:
        """The number of a quantity in the unit of its kind."""
        unit = self.of(kind)
        return quantity.number if quantity.factor == unit.factor else quantity.number * (quantity.factor / unit.factor)

    def read(self, parameter: str, value: object) -> float:
        """The number of a text with a unit, in the unit of a parameter.

        Raises
        ------
        ValueError
            If it is no such text, or not of the parameter's kind.
        """
        kind = kind_of(parameter)
        if kind is None:
            raise ValueError(f"is {given(value)}; it is a plain number, so write it without a unit")
        return self.number(read_quantity(value, kind, self.of(kind).text), kind)

    def signal(self, name: str) -> tuple[float, str]:
        """What a signal of a motion is multiplied by, from consistent units, and the unit in which it is then.

        Positions, deflections and velocities are as in states, accelerations in rad/s^2, torques in N m.
        """
        if name.endswith("''"):
            return self.angle, "rad/s^2"
        return 1.0, "N m" if name.endswith((".torque", ".force")) else self.state(name)

    def state(self, name: str) -> str:
        """The unit of a position or deflection, or of a velocity (``q'``): that of angles, and that over s."""
        return self.of(QuantityKind.ANGLE).text + ("/s" if name.endswith("'") else "")

    @cached_property
    def _units(self) -> dict[QuantityKind, Unit]:
        return _DEFAULTS | dict(self.chosen)

    def _factor(self, name: str) -> float:
        kind = kind_of(name)
        if kind is None:
            return 1.0
        if kind is QuantityKind.FREQUENCY:
            return self.frequency
        unit = self.of(kind)
        if kind is QuantityKind.ANGLE:
            return 1.0
        return unit.factor * self.angle**-kind.value.angle


def units_of(quantities: Iterable[Quantity], turns: int | None = None) -> Units:
    """The units of a train from its quantities: of each kind the first one."""
    chosen: dict[QuantityKind, Unit] = {}
    for quantity in quantities:
        chosen.setdefault(quantity.kind, Unit(quantity.unit, quantity.factor))
    return Units(tuple((kind, chosen[kind]) for kind in QuantityKind if kind in chosen), turns)
