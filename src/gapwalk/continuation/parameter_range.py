"""Range of the parameter within which a branch is followed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from gapwalk.errors import ModelError
from gapwalk.model.system import System

_OWN = 12.5  # a wider range is measured near a value by this many times the size of the value
_OCTAVES = 2.0  # change of the frequency, as a share of itself, that weighs as much as ten clearances


@dataclass(frozen=True, slots=True)
class Range:
    """Range of a parameter.

    Attributes
    ----------
    low, high
        Its limits.
    is_relative
        True if the parameter is the frequency. Frequencies are compared by ratio: the response at a hundredth of the
        frequency is no less rich, and half the frequency is equally far away everywhere.
    natural
        Change of any other parameter that changes the motion considerably, if known; infinite otherwise.
    """

    low: float
    high: float
    is_relative: bool = False
    natural: float = math.inf

    def __contains__(self, value: object) -> bool:
        return isinstance(value, float) and self.low <= value <= self.high

    @property
    def width(self) -> float:
        """Difference of the limits."""
        return self.high - self.low

    def bound(self, value: float) -> float:
        """Return the limit of the range that a value outside it has passed."""
        return self.low if value < self.low else self.high

    def nearness(self, value: float) -> float:
        """Return the width that counts near a value, as a share of the width of the range."""
        size = abs(value) if self.is_relative else max(abs(value), self.natural)
        return min(1.0, _OWN * size / self.width)

    def weight(self, value: float, scale: float) -> float:
        """Return the weight of a parameter measured in units of `scale`, near a value, relative to the unknowns.

        With this weight, angles and distances do not depend on the width of the range.
        """
        return scale / (_OCTAVES * abs(value)) if self.is_relative and value != 0.0 else 1.0

    def along(self, parameter: str, system: System) -> Range:
        """Return this range for a parameter of a system."""
        return replace(self, is_relative=system.structure.place(parameter) == 0)


def check_range(start: float, to: float | tuple[float, float]) -> Range:
    """Return the range from the start to `to`, or the range given; raise a ModelError if the start is outside it."""
    low, high = sorted((start, to) if isinstance(to, int | float) else to)
    if not low < high:
        raise ModelError(f"the branch starts at {start:.10g} and should be followed to {to}: the range is empty")
    if not low <= start <= high:
        raise ModelError(f"the branch starts at {start:.10g}, outside the range from {low:.10g} to {high:.10g}")
    return Range(float(low), float(high))
