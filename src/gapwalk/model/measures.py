"""The names of measures of a motion: ``half.q1``, ``order2.gear1.acceleration``, ``db.rms.gear1.acceleration``.

A measure is a kind, a dot and a signal. Kinds are those of `KINDS`, and orders: ``order2`` (or ``h2``) is the amplitude
of order 2, ``order2+4+6`` the root of the sum of the squares of several. ``a/b`` is the ratio of two measures; if b is
a signal alone, of the same kind: ``order2.input.speed/flywheel.speed`` is the transfer between two inertias. With
``db.`` in front of all this it is the level in dB: 20 times the logarithm of the ratio, or of the value over its
reference (1e-6 m/s^2 for accelerations in m/s^2, otherwise 1 of the unit); of orders, that of the root mean square.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from typing import NamedTuple

from gapwalk.model.units import Units

KINDS = {
    "max": "maximum of {}",
    "min": "minimum of {}",
    "half": "amplitude of {} (half the peak to peak)",
    "mean": "mean of {}",
    "rms": "root mean square of {}",
    "peak_to_peak": "peak to peak of {}",
    "impacts": "impacts per forcing period on {}",
    "drift": "progress of {} per forcing period",
}
"""The kinds of measures that are no orders, in words."""
IMPACTS = "impacts"
"""The kind that counts the impacts on a contact per forcing period: z = p/n for p impacts in a motion of period n."""

LEVEL = "db."
"""Prefix of a level in dB."""
EXAMPLES = f"{', '.join(KINDS)}, or an order such as order2, order2+4+6 or h1/2"
"""The kinds, in words."""
_ORDERS = re.compile(r"(?:h|order)(\d+(?:/[1-9]\d*)?(?:\+\d+(?:/[1-9]\d*)?)*)")
_LINEAR = 1e-6  # reference of levels of accelerations in m/s^2


def spoken(signal: str, article: str = "") -> str:
    """Return a signal in words: ``torque of clutch``."""
    owner, _, word = signal.rpartition(".")
    return f"{article}{word} of {owner}" if owner and word in ("acceleration", "force", "torque") else signal


class MeasureName(NamedTuple):
    """A measure, as its name says."""

    kind: str  #: One of `KINDS`; ``"order"`` for amplitudes of orders.
    signal: str  #: The signal.
    orders: tuple[Fraction, ...] = ()  #: The orders, each once.
    over: MeasureName | None = None  #: The measure by which it is divided.
    is_level: bool = False  #: True for its level in dB.

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that it measures."""
        return (self.signal, *(self.over.signals if self.over else ()))

    def words(self, units: Units | None) -> str:
        """Return it in words, without its unit."""
        if self.kind in KINDS:
            words = KINDS[self.kind].format(spoken(self.signal, "the "))
        else:
            one = "harmonic" if units is None or units.turns is None else "order"
            several = "s" * (len(self.orders) > 1)
            words = f"amplitude of {one}{several} {', '.join(map(str, self.orders))} of {spoken(self.signal, 'the ')}"
            words += " (root of the sum of squares)" * bool(several)
        if self.over is not None:
            same = self.over._replace(signal="") == self._replace(signal="", over=None, is_level=False)
            words += f" over that of {spoken(self.over.signal, 'the ')}" if same else f" over {self.over.words(units)}"
        return f"level of {words.removeprefix('amplitude of ')}" if self.is_level else words

    def unit(self, units: Units | None) -> str:
        """Return its unit; empty for a plain number."""
        own = units.signal(self.signal)[1] if units and self.kind != IMPACTS else ""
        if self.is_level:
            return "dB" if self.over else f"dB re {'1e-6' if self.is_linear(units) else '1'} {own}".rstrip()
        if self.over is None:
            return own
        other = self.over.unit(units)
        return "" if own == other else f"({own})/({other})"

    def is_linear(self, units: Units | None) -> bool:
        """Return True for a linear acceleration, whose levels have a reference of their own."""
        return bool(units) and units.signal(self.signal)[1] == "m/s^2"

    def level(self, value: float, units: Units | None) -> float:
        """Return the level of its value, -inf for 0."""
        if self.over is None and self.orders not in ((), (0,)):
            value /= math.sqrt(2.0)
        size = abs(value) / (_LINEAR if self.is_linear(units) and not self.over else 1.0)
        return 20.0 * math.log10(size) if size > 0.0 else -math.inf if size == 0.0 else math.nan


def parsed(name: str) -> MeasureName | None:
    """Return what the full name of a measure says; None if it is no name of a measure."""
    level, text = name.startswith(LEVEL), name.removeprefix(LEVEL)
    first, *rest = re.split(r"/(?=[A-Za-z_])", text)
    found = _single(first)
    if found is None or rest[1:]:
        return None
    if rest:
        under = _single(rest[0]) or found._replace(signal=rest[0])
        found = found._replace(over=under)
    return found._replace(is_level=level)


def _single(text: str) -> MeasureName | None:
    kind, _, signal = text.partition(".")
    if not signal:
        return None
    if kind in KINDS:
        return MeasureName(kind, signal)
    match = _ORDERS.fullmatch(kind)
    return MeasureName("order", signal, tuple(dict.fromkeys(map(Fraction, match[1].split("+"))))) if match else None


def full_measure(measure: str, coordinates: tuple[str, ...]) -> str:
    """Return the full name of a measure: ``half`` is that of the first coordinate, ``q1`` means ``half.q1``."""
    if measure in coordinates:
        return f"half.{measure}"
    is_kind = measure.removeprefix(LEVEL) in KINDS or _ORDERS.fullmatch(measure.removeprefix(LEVEL))
    return f"{measure}.{coordinates[0]}" if is_kind else measure
