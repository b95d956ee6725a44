"""Parameters and measures in the words of an axis."""

from __future__ import annotations

import re

from gapwalk.model.system import System
from gapwalk.model.units import Units

_MEASURES = {
    "half": "amplitude of {} (half the peak to peak)",
    "max": "maximum of {}",
    "min": "minimum of {}",
    "mean": "mean of {}",
    "rms": "root mean square of {}",
}


_OF = ("clearance", "amplitude", "phase", "impact_damping", "viscous_damping", "cubic")  # and of what


def parameter_words(name: str, units: Units | None = None) -> str:
    """The label of an axis over a parameter."""
    return _with(_parameter_words(name, units), units and units.parameter(name))


def parameter_symbol(name: str, units: Units | None = None) -> str:
    """The short form of a parameter, for tables and lines of progress."""
    symbol = "Ω" if name == "frequency" and units is None else name
    return _with(symbol, units and units.parameter(name))


def measure_words(name: str, units: Units | None = None) -> str:
    """The label of an axis over a measure such as ``half.q1`` or ``h1/2.q1``."""
    kind, _, signal = name.partition(".")
    harmonic = "harmonic" if units is None or units.turns is None else "order"
    words = _MEASURES[kind].format(signal) if kind in _MEASURES else f"amplitude of {harmonic} {kind[1:]} of {signal}"
    return _with(words, units and units.signal(signal)[1])


def state_words(coordinate: str, units: Units | None = None) -> str:
    """The label of an axis over a coordinate seen once every forcing period."""
    return _with(f"{coordinate}(0), once every forcing period", units and units.state(coordinate))


def coordinate_words(coordinate: str, units: Units | None = None) -> str:
    """The label of an axis over a coordinate or a velocity, as states have them."""
    return _with(coordinate, units and units.state(coordinate))


def signal_words(signal: str, units: Units | None = None) -> str:
    """The label of an axis over a signal."""
    return _with(signal, units and units.signal(signal)[1])


def value_words(value: float, name: str, units: Units | None = None) -> str:
    """A value of a parameter in a sentence: ``Ω = 0.5``, ``speed = 1500 rpm``."""
    symbol = "Ω" if name == "frequency" and units is None else name
    return " ".join(filter(None, (f"{symbol} = {value:.8g}", units and units.parameter(name))))


def pace_words(system: System) -> str:
    """The first parameter of a system in a sentence, as `value_words`."""
    structure = system.structure
    return value_words(system[structure.pace], structure.pace, structure.units)


def order_words(turns: int | None) -> str:
    """The label of an axis over orders; see `System.turns`."""
    return "multiples of the excitation frequency Ω" if turns is None else "order (per turn of the reference shaft)"


def line_words(name: str) -> str:
    """The name of a spectral line, written next to it: ``2Ω``, or where orders are counted per turn, ``2``."""
    return name.removeprefix("order ").replace("W", "Ω")


def _parameter_words(name: str, units: Units | None) -> str:
    if name == "frequency":
        return "excitation frequency" + " Ω" * (units is None)
    owner, _, word = name.rpartition(".")
    if owner == "mean":
        return f"mean {'load' if units is None else 'torque'} on {word}"
    return f"{word.replace('_', ' ')} of {owner}" if owner and word in _OF else name.replace("_", " ")


def _with(words: str, unit: str | None) -> str:
    return f"{words} [{unit}]" if unit else words


def full_measure(measure: str, coordinates: tuple[str, ...]) -> str:
    """The full name of a measure: ``half`` is that of the first coordinate, ``q1`` stands for ``half.q1``."""
    if measure in coordinates:
        return f"half.{measure}"
    is_kind = measure in _MEASURES or re.fullmatch(r"h\d+(/\d+)?", measure)
    return f"{measure}.{coordinates[0]}" if is_kind else measure
