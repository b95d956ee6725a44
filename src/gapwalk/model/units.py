"""The kinds of quantities of a drive train, numbers with a unit, and the conversion to the numbers of the equations.

Its equations of motion are in *consistent* units: the unit of its angles (deg, say), s, and N m. So deflections come
out as an engineer reads them, torques in N m, and time in s. Angles are a dimension of their own here, so that N m/deg,
N m/rad and N m are three different things.

Quantities are read from a text by pint. Its registry holds a few units of mechanics only, and takes the angle as a
dimension: pint's own one would take N m/deg for N m, N m for J, and rpm for Hz times 2 pi.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property, lru_cache
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.problems import given

# Units in the spellings of engineers, read by pint.

READING = Lock()  # units of two registries do not go together, and pint does not say that threads may share one

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
meter = [length] = m = metre
second = [time] = s = sec
gram = [mass] = g
radian = [angle] = rad
minute = 60 second = min
newton = kilogram * meter / second ** 2 = N
degree = 0.017453292519943295 radian = deg
arcminute = degree / 60 = arcmin
revolution = 6.283185307179586 radian = rev = turn
hertz = revolution / second = Hz
revolutions_per_minute = revolution / minute = rpm
inch = 0.0254 meter = in
foot = 12 inch = ft
pound = 453.59237 gram = lb
pound_force = 4.4482216152605 newton = lbf
pascal = newton / meter ** 2 = Pa
bar = 1e5 pascal
psi = pound_force / inch ** 2
"""

_ROWS = [line.split(" = ") for line in _DEFINITIONS.strip().splitlines()]
_KNOWN = "known are " + ", ".join((*row, *row[:1])[2] for row in _ROWS if not row[0].endswith("-"))
_LONGEST = 60

# Spellings of units, and their names in pint.
_WRITTEN = (
    (r"[·⋅×]", " "),
    (r"°", " deg"),
    (r"²", "^2"),
    (r"³", "^3"),
    (r"\b([kMm]?)Nms\b", r"\1N m s"),
    (r"\b([kMm]?)Nm\b", r"\1N m"),
    (r"\bkgm\b", "kg m"),
    (r"(?<=[A-Za-z])-(?=[A-Za-z])", " "),  # N-m, in-lbf
    (r"^['′]$", "arcmin"),
    (r"\s*/\s*", "/"),
    (r"\s*(\^|\*\*)\s*", "^"),
)

# Slips that are worth a word of their own.
HINTS = {
    "J": "J is the unit of an energy; write a torque in N m",
    "1/s": "write Hz (turns in a second) or rad/s",
    "s^-1": "write Hz (turns in a second) or rad/s",
    "1/min": "write rpm",
    "min^-1": "write rpm",
    "U/min": "write rpm",
    "degC": "a temperature has no place here; an angle is written in deg",
}


def normalised(unit: str) -> str:
    """Return a unit in the spelling of pint."""
    for pattern, instead in _WRITTEN:
        unit = re.sub(pattern, instead, unit)
    return unit.strip()


def parsed(text: str) -> Any:
    """Return the unit of a text."""
    if len(text) > _LONGEST or not re.fullmatch(r"[A-Za-zµμ0-9 ^*/().-]+", text) or re.search(r"\^-?\d{2}|\d{4}", text):
        raise ValueError("this is no unit")
    if re.search(r"/[^()/*]*[ *][^()/]", text):
        raise ValueError("a product after the slash (/) needs brackets, as in N m/(rad s)")
    for word in re.findall(r"[A-Za-zµμ]+", text):
        if word not in registry_of_units():
            raise ValueError(f"there is no unit {word!r} here; {HINTS.get(word, _KNOWN)}")
    try:
        return registry_of_units().parse_units(text)
    except Exception:  # pint's parser raises errors of a dozen types, of its own and of Python's tokenizer
        raise ValueError("this is no unit") from None


@lru_cache(maxsize=1)
def registry_of_units() -> Any:
    """Return the registry of the units of mechanics, in which the angle is a dimension."""
    import pint  # only where units are used

    made = pint.UnitRegistry(None)  # pyright: ignore[reportArgumentType]
    made.load_definitions(_DEFINITIONS.strip().splitlines())
    return made


_DEGREE = math.pi / 180.0
_PER_MINUTE = 30.0 / math.pi  # rpm of a rad/s


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit."""

    text: str  #: As it is written.
    factor: float  #: Value in the reference unit of its kind: SI, with angles in rad and speeds in rad/s.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        if not 0.0 < self.factor < math.inf or not self.text.isprintable():
            raise ValueError(f"{self.text!r} is no unit")


PLAIN = Unit("", 1.0)
"""The unit of plain numbers."""


class QuantityKind(Enum):
    """The kinds of quantities of a drive train; a phase is an angle of the excitation, not of the train.

    Parameters
    ----------
    words
        Name with its article.
    reference
        The unit in which gapwalk computes, as the library pint writes it.
    unit
        The unit of its parameters where a file gives none.
    usual
        Units in which files give it, the most usual one first.
    angle, time, torque
        The powers of an angle of the train, of time and of torque in its unit. Inertia is counted per angle: an inertia
        times an angular acceleration is a torque.

    Examples
    --------
    >>> driveline.units.parameter("mesh.clearance"), driveline.units.kind("mesh.clearance").name
    ('deg', 'ANGLE')
    """

    ANGLE = "an angle", "radian", Unit("deg", _DEGREE), ("deg", "rad"), 1, 0, 0
    INERTIA = "an inertia", "kilogram*meter**2", Unit("kg m^2", 1.0), ("kg m^2",), -1, 2, 1
    STIFFNESS = "a stiffness", "newton*meter/radian", Unit("N m/rad", 1.0), ("N m/rad", "N m/deg"), -1, 0, 1
    CUBIC = (
        "a cubic stiffness",
        "newton*meter/radian**3",
        Unit("N m/rad^3", 1.0),
        ("N m/rad^3", "N m/deg^3"),
        *(-3, 0, 1),
    )
    DAMPING = "a damping", "newton*meter*second/radian", Unit("N m s/rad", 1.0), ("N m s/rad", "N m s/deg"), -1, 1, 1
    IMPACT = "an impact damping", "second/radian", Unit("s/rad", 1.0), ("s/rad", "s/deg"), -1, 1, 0
    TORQUE = "a torque", "newton*meter", Unit("N m", 1.0), ("N m",), 0, 0, 1
    FREQUENCY = "a frequency or speed", "radian/second", Unit("Hz", 2.0 * math.pi), ("rpm", "Hz", "rad/s"), 0, -1, 0
    RATE = "a rate", "radian/second", Unit("rad/s", 1.0), ("rpm", "rad/s", "deg/s"), 1, -1, 0
    ACCELERATION = "an acceleration", "radian/second**2", Unit("rad/s^2", 1.0), ("rad/s^2", "deg/s^2"), 1, -2, 0
    LENGTH = "a length", "meter", Unit("m", 1.0), ("mm", "m"), 0, 0, 0
    TIME = "a time", "second", Unit("s", 1.0), ("s", "ms"), 0, 1, 0
    PHASE = "a phase", "radian", Unit("deg", _DEGREE), ("deg", "rad"), 0, 0, 0
    # of cylinders: with its crank a mass is an inertia, which the angles of the train do not scale
    MASS = "a mass", "kilogram", Unit("kg", 1.0), ("kg",), 0, 2, 1
    PRESSURE = "a pressure", "pascal", Unit("bar", 1e5), ("bar", "MPa", "Pa"), 0, 0, 0

    def __init__(
        self, words: str, reference: str, unit: Unit, usual: tuple[str, ...], angle: int, time: int, torque: int
    ) -> None:
        self.words, self.reference, self.unit, self.usual = words, reference, unit, usual
        self.angle, self.time, self.torque = angle, time, torque

    def __repr__(self) -> str:
        return self.name


PACES = ("frequency", "speed")
"""The names that the first parameter may have."""

_BY_WORD = {
    "inertia": QuantityKind.INERTIA,
    "stiffness": QuantityKind.STIFFNESS,
    "hysteresis_stiffness": QuantityKind.STIFFNESS,
    "damping": QuantityKind.DAMPING,
    "centre": QuantityKind.ANGLE,
    "radius": QuantityKind.LENGTH,
}


def name_kind(word: str, kind: QuantityKind) -> None:
    """Set the kind of the parameters whose names end in a word, as in ``stop.impact_damping``."""
    if _BY_WORD.setdefault(word, kind) is not kind:
        taken = ", ".join(_BY_WORD)
        raise ModelError(f"parameters named {word!r} are {_BY_WORD[word].words} already; taken names are {taken}")


def kind_of(parameter: str) -> QuantityKind | None:
    """Return the kind of a parameter of a drive train by its name; None for a plain number (ratios, shares)."""
    if parameter in PACES:
        return QuantityKind.FREQUENCY
    words = parameter.split(".")
    if words[0] == "mean":
        return QuantityKind.TORQUE
    return None if "acts_on" in words[:-1] else _BY_WORD.get(words[-1])


_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with a unit."""

    number: float  #: The number as it was written.
    unit: str  #: The unit, in the form ``N m/deg``.
    factor: float  #: Size of the unit in the reference unit of its kind (SI, with angles in rad).
    kind: QuantityKind  #: Kind of the quantity.

    def __str__(self) -> str:
        return f"{self.number:.10g} {self.unit}"


def read_quantity(value: object, kind: QuantityKind, written: str = "") -> Quantity:
    """Read a quantity of a kind from a text."""
    usual = written or kind.usual[0]
    if isinstance(value, Quantity):
        if value.kind is not kind:
            raise ValueError(
                f'is {value}, {value.kind.words}; {kind.words} is expected, as in "{value.number:g} {usual}"'
            )
        return value
    if not isinstance(value, str):
        raise ValueError(f'is {given(value)}, a number without a unit; write {kind.words} such as "{value} {usual}"')
    match = re.fullmatch(rf"\s*({_NUMBER})\s*(.*?)\s*", value, re.DOTALL)
    comma = "; a number has a point, not a comma" if re.match(r"\s*[-+]?\d*,\d", value) else ""
    if not match or comma:
        raise ValueError(f'is {given(value)}; it must be {kind.words} such as "1.5 {usual}"{comma}')
    if not match[2]:
        raise ValueError(f'is {given(value)}, without a unit; write {kind.words} such as "{match[1]} {usual}"')
    try:
        with READING:
            factor = _factor(match[2], kind)
    except ValueError as error:
        example = " or ".join(f'"{match[1]} {unit}"' for unit in ([written] if written else kind.usual))
        raise ValueError(f"is {given(value)}: {error}; {kind.words} is expected, as in {example}") from None
    return Quantity(float(match[1]), normalised(match[2]), factor, kind)


def read_unit(text: str, kind: QuantityKind) -> Unit:
    """Read a unit of a kind, such as ``N m/deg`` for a stiffness."""
    with READING:
        return Unit(normalised(text), _factor(text, kind))


def has_unit(value: object) -> bool:
    """Return True if a value is a quantity, or a text that begins with a number and continues with other text."""
    if isinstance(value, Quantity):
        return True
    return isinstance(value, str) and re.match(rf"\s*{_NUMBER}\s*[^\s\d.,+-]", value) is not None


def read_formula_number(value: object) -> tuple[float, Unit]:
    """Read a parameter of a formula: a number, or a text with a unit made of angle, s and N m."""
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value), PLAIN
    match = re.fullmatch(rf"\s*({_NUMBER})\s*(\S.*?)\s*", value, re.DOTALL) if isinstance(value, str) else None
    example = 'write a number, or one with a unit such as "0.01 N m s/rad"'
    if not match:
        raise ValueError(f"is {given(value)}; {example}")
    try:
        with READING:
            factor = _formula_factor(match[2])
    except ValueError as error:
        raise ValueError(f"is {given(value)}: {error}; {example}") from None
    return float(match[1]), Unit(normalised(match[2]), factor)


def _formula_factor(unit: str) -> float:
    registry, text = registry_of_units(), normalised(unit)
    found = parsed(text)
    powers = dict(found.dimensionality)
    torque = powers.pop("[mass]", 0)
    if powers.pop("[length]", 0) != 2 * torque:
        raise ValueError(f"{unit} is not made of an angle, s and N m")
    reference = (
        (registry.newton * registry.meter) ** torque
        * registry.second ** (powers.pop("[time]", 0) + 2 * torque)
        * registry.radian ** powers.pop("[angle]", 0)
    )
    return float(registry.Quantity(1.0, found).to(reference).magnitude)


def _same_dimension(first: str, second: str) -> bool:
    with READING:
        return parsed(first).dimensionality == parsed(second).dimensionality


@lru_cache(maxsize=512)
def _factor(unit: str, kind: QuantityKind) -> float:
    """Return the size of a unit in the reference unit of a kind; raise a ValueError with the reason if it has none."""
    text = normalised(unit)
    if text in HINTS:
        raise ValueError(HINTS[text])
    registry = registry_of_units()
    reference = registry.parse_units(kind.reference)
    found = parsed(text)
    if kind is QuantityKind.INERTIA and found.dimensionality == (reference / registry.radian).dimensionality:
        reference = reference / registry.radian  # N m s^2/rad
    if found.dimensionality != reference.dimensionality:
        of_force = re.sub(r"\blb\b", "lbf", text)
        if of_force != text and parsed(of_force).dimensionality == reference.dimensionality:
            raise ValueError(f"lb is the unit of a mass, lbf that of a force; write {of_force}")
        raise ValueError(_other_kind(unit, found))
    return float(registry.Quantity(1.0, found).to(reference).magnitude)


def _other_kind(unit: str, found: Any) -> str:
    registry = registry_of_units()
    for kind in QuantityKind:
        reference = registry.parse_units(kind.reference)
        if kind is not QuantityKind.PHASE and found.dimensionality == reference.dimensionality:
            return f"{unit} is the unit of {kind.words}"
    return f"{unit} is the unit of something else"


_TOLD = ("frequency", "amplitude", "inertia", "stiffness", "damping", "clearance", "impact_damping")


@dataclass(frozen=True)
class Units:
    """The units in which the parameters of a drive train are counted.

    Examples
    --------
    >>> units = driveline.units
    >>> units.parameter("mesh.clearance"), units.state("mesh'"), units.signal("clutch.torque")
    ('deg', 'deg/s', (1.0, 'N m'))
    """

    #: A unit for each kind with a chosen unit; the others have the default ones.
    chosen: tuple[tuple[QuantityKind, Unit], ...] = ()
    #: If the first parameter is the speed of a shaft: periods of the excitation in one turn of it, which may be a
    #: fraction. None if it is the frequency of the excitation.
    turns: int | Fraction | None = None
    #: Parameters whose kind does not follow from their names, each with its kind, or None, and a unit, which holds if
    #: the kind is None: the fraction by which a load varies a stiffness, a displacement, the parameters of a formula.
    own: tuple[tuple[str, QuantityKind | None, Unit], ...] = ()
    shaft: str = field(default="", compare=False)  #: Name of that shaft's inertia; empty if there is none.
    #: Inertias with a radius, in m, at which their accelerations are given.
    radii: tuple[tuple[str, float], ...] = ()
    #: Parameters of whose kind the study asks in another unit, which then is theirs.
    asked: tuple[tuple[str, Unit], ...] = ()

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        if self.turns is not None and not self.turns > 0:
            raise ValueError(f"{self.turns} is no number of periods in a turn")
        if not all(0.0 < radius < math.inf for _, radius in self.radii):
            raise ValueError("a radius is not positive")

    def of(self, kind: QuantityKind) -> Unit:
        """Return the unit of a kind."""
        return self._units.get(kind, kind.unit)

    def parameter(self, name: str) -> str:
        """Return the unit of a parameter by its name; empty for a plain number."""
        return self.unit(name).text

    def kind(self, name: str) -> QuantityKind | None:
        """Return the kind of a parameter by its name; None for a plain number, and for one of a formula."""
        return self._own[name][0] if name in self._own else kind_of(name)

    @property
    def words(self) -> str:
        """Write the units in one line."""
        names = {"frequency": self.pace, "amplitude": "torque"}
        known = [(names.get(word, word.replace("_", " ")), self.parameter(word)) for word in _TOLD]
        return ", ".join(f"{word} in {unit}" for word, unit in known if unit)

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
        return float(self.of(QuantityKind.FREQUENCY).factor * (self.turns or 1))

    def factors(self, names: Iterable[str]) -> NDArray[np.float64]:
        """Return the size of one unit of each parameter in consistent units, shape (names,).

        Returns
        -------
        array, shape (names,)
            The factors.
        """
        return np.array([self._factor(name) for name in names])

    def number(self, quantity: Quantity, kind: QuantityKind) -> float:
        """Convert a quantity to the unit of its kind."""
        unit = self.of(kind)
        return quantity.number if quantity.factor == unit.factor else quantity.number * (quantity.factor / unit.factor)

    def read(self, parameter: str, value: object) -> float:
        """Convert a text with a unit to a number in the unit of a parameter.

        Parameters
        ----------
        parameter
            Name of the parameter.
        value
            The text, such as ``"2 deg"``.
        """
        kind = self.kind(parameter)
        if kind is None:
            unit = self.unit(parameter)
            if unit is PLAIN or not unit.text:
                raise ValueError(f"is {given(value)}; it is a plain number, so write it without a unit")
            number, found = read_formula_number(value)
            if not found.text or not _same_dimension(unit.text, found.text):
                raise ValueError(f'is {given(value)}; it has the unit {unit.text}, as in "{number:g} {unit.text}"')
            return number * (found.factor / unit.factor)
        unit = self.unit(parameter)
        found = read_quantity(value, kind, unit.text)
        return found.number * (found.factor / unit.factor) if parameter in self._asked else self.number(found, kind)

    def signal(self, name: str) -> tuple[float, str]:
        """Return the factor from consistent units to the unit of a signal of a motion, and that unit.

        Positions, deflections and velocities have the units of `state`, torques N m; speeds of inertias and of slips in
        rpm. Accelerations are in rad/s^2, but ``gear.acceleration`` of an inertia with a radius is in m/s^2 at that
        radius. A mode of friction (slip or stick) has no unit.

        Returns
        -------
        factor : float
            One over the size of the unit in consistent units.
        unit : str
            The unit.
        """
        if name.endswith(".slip"):
            return 1.0, ""
        if (owner := name.removesuffix(".acceleration")) != name and owner in self._radii:
            return self.angle * self._radii[owner], "m/s^2"
        if name.endswith(("''", ".acceleration")):
            return self.angle, "rad/s^2"
        if name.endswith(".speed"):
            return self.angle * _PER_MINUTE, "rpm"
        return 1.0, "N m" if name.endswith((".torque", ".force")) else self.state(name)

    def state(self, name: str) -> str:
        """Return the unit of a position or deflection (that of angles), or of a velocity ``q'`` (per second).

        Parameters
        ----------
        name
            Name of a position, deflection or velocity.
        """
        return self.of(QuantityKind.ANGLE).text + ("/s" if name.endswith("'") else "")

    @cached_property
    def _units(self) -> dict[QuantityKind, Unit]:
        return dict(self.chosen)

    @cached_property
    def _radii(self) -> dict[str, float]:
        return dict(self.radii)

    @cached_property
    def _asked(self) -> dict[str, Unit]:
        return dict(self.asked)

    @cached_property
    def _own(self) -> dict[str, tuple[QuantityKind | None, Unit]]:
        return {name: (kind, unit) for name, kind, unit in self.own}

    def unit(self, name: str) -> Unit:
        """Return the unit of a parameter: that of a study, of its kind, or of a formula; `PLAIN` if it has none."""
        if name in self._asked:
            return self._asked[name]
        kind = self.kind(name)
        return self.of(kind) if kind else self._own[name][1] if name in self._own else PLAIN

    def _factor(self, name: str) -> float:
        kind, unit = self.kind(name), self.unit(name)
        if kind is None:
            return unit.factor
        if kind is QuantityKind.ANGLE:
            return unit.factor / self.angle
        return self.frequency if kind is QuantityKind.FREQUENCY else unit.factor * self.angle**-kind.angle


def units_of(
    quantities: Iterable[Quantity],
    turns: int | Fraction | None = None,
    own: Iterable[tuple[str, QuantityKind | None, Unit]] = (),
) -> Units:
    """Choose the units of a train: for each kind, that of the first quantity."""
    chosen: dict[QuantityKind, Unit] = {}
    for quantity in quantities:
        chosen.setdefault(quantity.kind, Unit(quantity.unit, quantity.factor))
    return Units(tuple((kind, chosen[kind]) for kind in QuantityKind if kind in chosen), turns, tuple(own))
