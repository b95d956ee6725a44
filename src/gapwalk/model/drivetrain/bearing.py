"""Gears that move in their bearings, along or across the line of action of their teeth.

A displacement ``y`` of a gear of base radius ``r`` along the line of action deflects the teeth as the angle ``y / r``
does. So the gear's displacement is represented by an inertia ``m r^2`` with the angle ``y / r``, and the bearing by a
shaft of the stiffness ``k r^2`` to the ground. The deflection of a mesh with the ratio i is then

    first + cos(angle) y1 / r1 - i second - |i| cos(angle) y2 / r2

with the angles between the coordinates of the bearings and the line of action. Two bearings at right angles hold a gear
in its plane. Kahraman and Singh (1991), Journal of Sound and Vibration 146, 135-156.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.bounds import NotNegative, Positive, bound_of, has
from gapwalk.model.drivetrain.planetary import Planet
from gapwalk.model.drivetrain.train_parts import GROUND, Gear, Shaft
from gapwalk.model.drivetrain.train_rows import row_of
from gapwalk.model.units import QuantityKind, Units, normalised, parsed, registry_of_units

_IN_SI = {"radius": "m", "mass": "kg", "stiffness": "N/m", "damping": "N s/m", "clearance": "m"}


@dataclass(frozen=True)
class Bearing:
    """The bearing of a gear that moves sideways: a mass on a spring along one direction.

    Its quantities are texts such as ``"40 mm"``, ``"1.2 kg"``, ``"2e8 N/m"``, or plain numbers in SI units (in a train
    without units, in the units of the train). As parameters they refer to the angle y/r of the gear, for a displacement
    y and the radius r: ``name.stiffness`` is k r^2.

    Raises
    ------
    ModelError
        If a text is not such a quantity.

    Examples
    --------
    >>> gw.train.Bearing("front", "pinion", radius="40 mm", mass="1.2 kg", stiffness="200 N/um").stiffness
    200000000.0
    """

    name: str  #: Prefix of its parameters' names; its displacement is the angle of the inertia ``name_journal``.
    carries: str  #: The inertia of the gear.
    radius: float | str  #: Radius of the base circle of the gear.
    mass: float | str  #: The mass that moves sideways.
    stiffness: float | str  #: Stiffness of the bearing.
    damping: float | str = 0.0  #: Damping of the bearing.
    clearance: float | str | None = None  #: Half the clearance of the bearing.
    #: Angle between its direction and the line of action of the teeth, in degrees: one angle for all meshes of the
    #: gear, or an angle for each mesh by its name.
    angle: float | Mapping[str, float] = 0.0

    def __post_init__(self) -> None:
        for what, unit in _IN_SI.items():
            value = getattr(self, what)
            if isinstance(value, str):
                object.__setattr__(self, what, _read(f"{self.name}.{what}", value, unit))

    def inertia(self, units: Units | None) -> Planet:
        """Make the inertia whose angle is the displacement of the gear, divided by the radius."""
        return Planet(f"{self.name}_journal", self._counted("mass", 2, QuantityKind.INERTIA, units))

    def shaft(self, units: Units | None) -> Shaft:
        """Make the spring and the damper of the bearing, between its inertia and the ground."""
        clearance = None if self.clearance is None else self._counted("clearance", -1, QuantityKind.ANGLE, units)
        return Shaft(
            self.name,
            (f"{self.name}_journal", GROUND),
            stiffness=self._counted("stiffness", 2, QuantityKind.STIFFNESS, units),
            damping=self._counted("damping", 2, QuantityKind.DAMPING, units),
            clearance=clearance,
        )

    def _counted(self, what: str, power: int, kind: QuantityKind, units: Units | None) -> float:
        radius: Any = self.radius
        return getattr(self, what) * radius**power / (units.of(kind).factor if units else 1.0)

    def share(self, gear: str) -> float:
        """Return the share of its displacement that lies along the line of action of a mesh."""
        angle = self.angle.get(gear, 90.0) if isinstance(self.angle, Mapping) else self.angle
        found = math.cos(math.radians(angle))
        return 0.0 if abs(found) < _ACROSS else found

    def problems(self, inertias: Sequence[str], gears: Sequence[Gear]) -> Iterator[str]:
        """List its errors, one sentence each, to follow its name."""
        if self.carries not in inertias:
            yield f"has carries = {self.carries!r}, which is no inertia; write the name of that of the gear"
            return
        own = [gear.name for gear in gears if self.carries in gear.between]
        named = [*self.angle] if isinstance(self.angle, Mapping) else own
        if not own or not {*named} <= {*own}:
            which = next((name for name in named if name not in own), "")
            yield (
                f"has an angle to {which}, which is no gear of {self.carries}; its gears are {', '.join(own)}"
                if own
                else f"carries {self.carries}, which has no teeth that could move it; write a [[gear]] there"
            )
        for what in _IN_SI:
            bound = NotNegative if what in ("damping", "clearance") else Positive
            if not has(bound, value := getattr(self, what)) and (value is not None or what != "clearance"):
                yield f"has {what} = {value!r}; it must be {bound_of(bound)}"


_ACROSS = 1e-12


def _read(name: str, text: str, unit: str) -> float:
    """Return the number of a text in an SI unit."""
    match = re.fullmatch(r"\s*([-+.\deE]*\d\.?)\s*([^\d\s].*)", text)
    try:
        number, given = float(match[1] if match else ""), parsed(normalised(match[2] if match else ""))
        return float(registry_of_units().Quantity(number, given).to(parsed(normalised(unit))).magnitude)
    except Exception as error:  # pint's errors are of a dozen types
        raise ModelError(f'{name} is {text!r}; write a number with a unit such as "2 {unit}"') from error


def on_bearings(gears: Sequence[Gear], bearings: Sequence[Bearing]) -> list[Gear]:
    """Return the gears, those on bearings with the weights of all angles in their deflections."""
    found = []
    for gear in gears:
        row = row_of(gear)
        for each in bearings:
            if each.carries in gear.between and (share := each.share(gear.name)):
                radius = 1 if each.carries == gear.between[0] else -abs(row[gear.between[1]])
                row[f"{each.name}_journal"] = Fraction(share) * radius
        if len(row) > 2:
            gear = copy.copy(gear)
            object.__setattr__(gear, "weights", row)
        found.append(gear)
    return found
