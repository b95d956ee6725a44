"""Parameters and measures in the words of an axis."""

from __future__ import annotations

_MEASURES = {
    "half": "amplitude of {} (half the peak to peak)",
    "max": "maximum of {}",
    "min": "minimum of {}",
    "mean": "mean of {}",
    "rms": "root mean square of {}",
}


_OF = ("clearance", "amplitude", "phase", "impact_damping", "viscous_damping", "cubic")  # and of what


def parameter_words(name: str) -> str:
    """The label of an axis over a parameter."""
    if name == "frequency":
        return "excitation frequency Ω"
    owner, _, word = name.rpartition(".")
    if owner == "mean":
        return f"mean load on {word}"
    return f"{word.replace('_', ' ')} of {owner}" if owner and word in _OF else name.replace("_", " ")


def parameter_symbol(name: str) -> str:
    """The short form of a parameter, for tables and lines of progress."""
    return "Ω" if name == "frequency" else name


def measure_words(name: str) -> str:
    """The label of an axis over a measure such as ``half.q1`` or ``h1/2.q1``."""
    kind, _, signal = name.partition(".")
    if kind in _MEASURES:
        return _MEASURES[kind].format(signal)
    return f"amplitude of harmonic {kind[1:]} of {signal}"


def state_words(coordinate: str) -> str:
    """The label of an axis over a coordinate seen once every forcing period."""
    return f"{coordinate}(0), once every forcing period"


def full_measure(measure: str, coordinates: tuple[str, ...]) -> str:
    """The full name of a measure: ``half`` is that of the first coordinate, ``q1`` stands for ``half.q1``."""
    if measure in coordinates:
        return f"half.{measure}"
    return measure if "." in measure else f"{measure}.{coordinates[0]}"
