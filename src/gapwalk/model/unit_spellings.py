"""Units in the spellings of engineers, read by pint."""

from __future__ import annotations

import re
from functools import lru_cache
from threading import Lock
from typing import Any

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
"""

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
    (r"\b([Nn])-m\b", r"\1 m"),
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
        raise ValueError("a product after the stroke needs brackets, as in N m/(rad s)")
    for word in re.findall(r"[A-Za-zµμ]+", text):
        if word not in registry_of_units():
            raise ValueError(f"there is no unit {word!r} here" + (f"; {HINTS[word]}" if word in HINTS else ""))
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
