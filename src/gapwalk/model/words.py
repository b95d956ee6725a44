"""Labels of axes for parameters, measures and signals."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from gapwalk.model.measures import parsed, spoken
from gapwalk.model.system import System
from gapwalk.model.units import Units

_ALL = 17  # digits that tell any two numbers apart
_FIXED = 5  # decimals up to which an error is written without a power of ten

_LONGER = {
    "cubic": "cubic stiffness",
    "quadratic": "quadratic stiffness",
    "even_quadratic": "even quadratic stiffness",
    "limit": "friction limit",
    "static": "static friction limit",
}


def parameter_words(name: str, units: Units | None = None) -> str:
    """Return the label of an axis for a parameter."""
    return _with(_parameter_words(name, units), units and units.parameter(name))


def parameter_symbol(name: str, units: Units | None = None) -> str:
    """Return the short form of a parameter, for tables and progress lines."""
    return _with(_symbol(name, units), units and units.parameter(name))


def measure_words(name: str, units: Units | None = None) -> str:
    """Return the label of an axis for a measure such as ``half.q1`` or ``h1/2.q1``."""
    asked = parsed(name)
    return name if asked is None else _with(asked.words(units), asked.unit(units))


def measure_symbol(name: str, units: Units | None = None) -> str:
    """Return the short form of a measure, for tables: ``max x [deg]``."""
    asked = parsed(name)
    return _with(name.replace(".", " ", 1), asked and asked.unit(units))


def state_words(coordinate: str, units: Units | None = None) -> str:
    """Return the label of an axis for a coordinate at each forcing period."""
    return _with(f"{coordinate}(0), once every forcing period", units and units.state(coordinate))


def coordinate_words(coordinate: str, units: Units | None = None) -> str:
    """Return the label of an axis for a coordinate or a velocity, in the units of states."""
    return _with(coordinate, units and units.state(coordinate))


def signal_words(signal: str, units: Units | None = None) -> str:
    """Return the label of an axis for a signal."""
    return _with(spoken(signal), units and units.signal(signal)[1])


def value_words(value: float, name: str, units: Units | None = None, digits: int = 8) -> str:
    """Write the value of a parameter in a sentence: ``Ω = 0.5``, ``speed = 1500 rpm``."""
    return " ".join(filter(None, (f"{_symbol(name, units)} = {value:.{digits}g}", units and units.parameter(name))))


def told_apart(low: float, high: float, digits: int = 6) -> tuple[str, str]:
    """Write two numbers with some digits, or with so many more that they differ as the numbers do."""
    while low != high and digits < _ALL and f"{low:.{digits}g}" == f"{high:.{digits}g}":
        digits += 1
    return f"{low:.{digits}g}", f"{high:.{digits}g}"


def with_error(value: float, error: float, digits: int = 8, figures: int = 1) -> str:
    """Write a value and its error with equal decimals, as in ``580 ± 10``; a value without an error to some digits."""
    if not (math.isfinite(error) and error > 0.0):
        return f"{value:.{digits}g}"
    error = float(f"{error:.{figures - 1}e}")
    decimals = figures - 1 - int(f"{error:e}".partition("e")[2])  # of the last figure of the error
    if decimals <= _FIXED:
        return f"{round(value, decimals):.{max(decimals, 0)}f} ± {error:.{max(decimals, 0)}f}"
    exponent = int(f"{value or 1.0:e}".partition("e")[2])
    text = f"{value:.{decimals}f}" if exponent > -_FIXED else f"{value:.{max(decimals + exponent, 0)}e}"
    return f"{text} ± {error:.{figures - 1}e}"


def listed_words(names: Sequence[str]) -> str:
    """Write names in a sentence: ``mesh1, mesh2 and mesh3``."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def range_words(ends: tuple[float, float], name: str, units: Units | None = None) -> str:
    """Write a range in a sentence: ``Ω from 0.7 to 1.3``, ``speed from 700 to 1100 rpm``."""
    unit = units.parameter(name) if units else ""
    low, high = told_apart(*ends)
    return " ".join(filter(None, (f"{_symbol(name, units)} from {low} to {high}", unit)))


def between_words(ends: tuple[float, float], name: str, units: Units | None = None) -> str:
    """Write a range in a sentence: ``between Ω = 0.6 and 0.66``, ``between speed = 750 and 1050 rpm``."""
    low, high = told_apart(*ends)
    unit = units.parameter(name) if units else ""
    return " ".join(filter(None, (f"between {_symbol(name, units)} = {low} and {high}", unit)))


def pace_words(system: System) -> str:
    """Write the first parameter of a system in a sentence, as in `value_words`."""
    structure = system.structure
    return value_words(system[structure.pace], structure.pace, structure.units)


def order_words(units: Units | None) -> str:
    """Return the label of an axis for orders, with the name of the inertia by whose turns they count."""
    if units is None or units.turns is None:
        return "multiples of the excitation frequency Ω"
    return f"order (per turn of {units.shaft or 'the reference shaft'})"


def line_words(name: str) -> str:
    """Return the name of a spectral line in a picture: ``2Ω``, or ``2`` if orders are counted per turn."""
    return name.removeprefix("order ").replace("W", "Ω")


def _parameter_words(name: str, units: Units | None) -> str:
    if name == "frequency":
        return "excitation frequency" + " Ω" * (units is None)
    owner, _, word = name.rpartition(".")
    if owner == "mean":
        return f"mean {'load' if units is None else 'torque'} on {word}"
    first, _, rest = name.partition(".")
    if first in ("mass", "damping", "stiffness") and rest:
        return f"{first} ({rest.replace('.', ', ')})"
    if owner.endswith(".acts_on"):
        return f"share of {_owner_words(owner.removesuffix('.acts_on'))} that acts on {word}"
    words = _LONGER.get(word, word.replace("_", " "))
    return f"{words} of {_owner_words(owner)}" if owner else words


def _owner_words(owner: str) -> str:
    """Return what a parameter belongs to: ``harmonic 1``, ``stage 2 of clutch``."""
    first, *rest = owner.split(".")  # names that gapwalk gives, not those of a model
    numbered = [re.sub(r"^harmonic(\d+)$", r"harmonic \1", first)]
    numbered += [re.sub(r"^stage(\d+)$", r"stage \1", each) for each in rest]
    return " of ".join(reversed(numbered))


def _symbol(name: str, units: Units | None) -> str:
    return "Ω" if name == "frequency" and units is None else name


def _with(words: str, unit: str | None) -> str:
    return f"{words} [{unit}]" if unit else words
