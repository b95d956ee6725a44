"""Quantities: a number with a unit, read from a text by pint.

The registry holds a few units of mechanics only, and takes the angle as a dimension: pint's own one would take N m/deg
for N m, N m for J, and rpm for Hz times 2 pi.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import Any

from gapwalk.model.problems import given
from gapwalk.model.units.kind import QuantityKind

_reading = Lock()  # units of two registries do not go together, and pint does not say that threads may share one

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
"""

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_LONGEST = 60

# What people write, and what it stands for.
_WRITTEN = (
    (r"[·⋅×]", " "),
    (r"°", " deg"),
    (r"²", "^2"),
    (r"³", "^3"),
    (r"\b([kMm]?)Nms\b", r"\1N m s"),
    (r"\b([kMm]?)Nm\b", r"\1N m"),
    (r"\bkgm\b", "kg m"),
    (r"\b([Nn])-m\b", r"\1 m"),
    (r"\s*/\s*", "/"),
    (r"\s*(\^|\*\*)\s*", "^"),
)

# Slips that are worth a word of their own.
_HINTS = {
    "J": "J is the unit of an energy; write a torque in N m",
    "1/s": "write Hz (turns in a second) or rad/s",
    "s^-1": "write Hz (turns in a second) or rad/s",
    "1/min": "write rpm",
    "min^-1": "write rpm",
    "U/min": "write rpm",
    "degC": "a temperature has no place here; an angle is written in deg",
}


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with a unit.

    Parameters
    ----------
    number
        The number as it was written.
    unit
        The unit, written in the way of ``N m/deg``.
    factor
        What one such unit is in the reference unit of its kind (SI, with angles in rad).
    kind
        What it is.
    """

    number: float
    unit: str
    factor: float
    kind: QuantityKind

    def __str__(self) -> str:
        return f"{self.number:.10g} {self.unit}"


def read_quantity(value: object, kind: QuantityKind, written: str = "") -> Quantity:
    """Read a quantity of a kind from a text.

    Parameters
    ----------
    value
        A text such as ``"0.14 kg m^2"``; also ``kg*m**2``, ``kg·m²``, ``Nm/deg``. A `Quantity` is taken as it is.
    kind
        What it must be.
    written
        The unit that a text of this kind should have in a hint, if one is known.

    Raises
    ------
    ValueError
        If it is no text, has no unit, an unknown one, or one of another kind. The message reads on after the name of
        what is wrong, and says what to write.
    """
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
        with _reading:
            factor = _factor(match[2], kind)
    except ValueError as error:
        example = " or ".join(f'"{match[1]} {unit}"' for unit in ([written] if written else kind.usual))
        raise ValueError(f"is {given(value)}: {error}; {kind.words} is expected, as in {example}") from None
    return Quantity(float(match[1]), _normalised(match[2]), factor, kind)


def has_unit(value: object) -> bool:
    """Whether a value is a quantity, or a text that begins with a number and goes on with something else."""
    if isinstance(value, Quantity):
        return True
    return isinstance(value, str) and re.match(rf"\s*{_NUMBER}\s*[^\s\d.,+-]", value) is not None


@lru_cache(maxsize=512)
def _factor(unit: str, kind: QuantityKind) -> float:
    """What a unit is in the reference of a kind; a ValueError that says what is wrong with it."""
    text = _normalised(unit)
    if text in _HINTS:
        raise ValueError(_HINTS[text])
    registry = _registry()
    reference = registry.parse_units(kind.value.reference)
    found = _parsed(text)
    if kind is QuantityKind.INERTIA and found.dimensionality == (reference / registry.radian).dimensionality:
        reference = reference / registry.radian  # N m s^2/rad
    if found.dimensionality != reference.dimensionality:
        raise ValueError(_other_kind(unit, found))
    return float(registry.Quantity(1.0, found).to(reference).magnitude)


def _normalised(unit: str) -> str:
    for pattern, instead in _WRITTEN:
        unit = re.sub(pattern, instead, unit)
    return unit.strip()


def _parsed(text: str) -> Any:
    """The unit that a text stands for."""
    if len(text) > _LONGEST or not re.fullmatch(r"[A-Za-zµμ0-9 ^*/().-]+", text) or re.search(r"\^-?\d{2}|\d{4}", text):
        raise ValueError("this is no unit")
    if re.search(r"/[^()/*]*[ *][^()/]", text):
        raise ValueError("what stands below the stroke needs brackets, as in N m/(rad s)")
    for word in re.findall(r"[A-Za-zµμ]+", text):
        if word not in _registry():
            raise ValueError(f"there is no unit {word!r} here" + (f"; {_HINTS[word]}" if word in _HINTS else ""))
    try:
        return _registry().parse_units(text)
    except Exception:  # pint's parser raises errors of a dozen types, of its own and of Python's tokenizer
        raise ValueError("this is no unit") from None


def _other_kind(unit: str, found: Any) -> str:
    registry = _registry()
    for kind in QuantityKind:
        reference = registry.parse_units(kind.value.reference)
        if kind is not QuantityKind.PHASE and found.dimensionality == reference.dimensionality:
            return f"{unit} is the unit of {kind.words}"
    return f"{unit} is the unit of something else"


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint  # only where units are used

    registry = pint.UnitRegistry(None)  # pyright: ignore[reportArgumentType]
    registry.load_definitions(_DEFINITIONS.strip().splitlines())
    return registry
