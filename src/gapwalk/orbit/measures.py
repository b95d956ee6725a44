"""Measures of one orbit: extrema, mean, rms and harmonics of any of its signals."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.problems import near_names

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit

MEASURES = ("max", "min", "half", "mean", "rms")


def measure(orbit: Orbit, name: str) -> float:
    """See `Orbit.measure`."""
    kind, _, signal = name.partition(".")
    if signal in orbit.system.coordinates and kind in MEASURES:
        return pick(orbit.extremes[orbit.system.coordinates.index(signal)], kind)
    if kind in MEASURES:
        values = _fine_signal(orbit, signal)
        mean, rms = float(values[:-1].mean()), float(np.sqrt(np.mean(values[:-1] ** 2)))
        return pick(np.array([values.max(), values.min(), mean, rms]), kind)
    if kind.startswith("h") and signal and not near_names(kind, MEASURES):
        return abs(harmonic(orbit, kind[1:], signal))
    coordinates = orbit.system.coordinates
    if near := near_names(name, [*coordinates, *(f"{each}.{q}" for each in MEASURES for q in coordinates)]):
        raise ModelError(f"there is no measure {name!r}; did you mean {' or '.join(near)}?")
    raise ModelError(
        f"there is no measure {name!r}; write one of {', '.join(MEASURES)}, h0, h1, ... , a dot and a signal, "
        f"such as half.{coordinates[0]}"
    )


def pick(row: NDArray[np.float64], kind: str) -> float:
    """Return one measure from a row of maximum, minimum, mean and rms."""
    if kind == "half":
        return float(row[0] - row[1]) / 2
    return float(row[("max", "min", "mean", "rms").index(kind)])


def harmonic(orbit: Orbit, order: str | int | Fraction, signal: str) -> complex:
    """Return the complex amplitude of a harmonic (``Re(c exp(i h theta))``); its order is a multiple of 1/m.

    Orders count turns of the forcing frequency, or of a shaft whose speed is a parameter.
    """
    turns = orbit.system.turns
    try:
        line = Fraction(order) / (turns or 1) * orbit.period
    except ValueError:
        raise ModelError(f"harmonic {order!r} is not an order; write h0, h1, h2, ... or h1/2") from None
    if line.denominator != 1 or line < 0:
        step = f"1/{orbit.period} of W" if turns is None else f"multiples of order {Fraction(turns, orbit.period)}"
        raise ModelError(f"a period-{orbit.period} orbit has harmonics of {step}, not of {order}")
    values = orbit.motion(4 * orbit.samples).signal(signal)[:-1]
    lines = np.fft.rfft(values) / len(values)
    if line >= len(lines):
        raise ModelError(f"harmonic {order} lies beyond the {len(lines) - 1} lines that this orbit resolves")
    return complex(lines[int(line)]) * (1 if line == 0 else 2)


def _fine_signal(orbit: Orbit, signal: str) -> NDArray[np.float64]:
    """Return a signal sampled so finely that its largest sample is its maximum to about 1e-5."""
    return orbit.motion(8 * orbit.samples).signal(signal)
