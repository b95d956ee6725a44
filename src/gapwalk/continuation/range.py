"""The values of the parameter between which a branch is followed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from gapwalk.errors import ModelError
from gapwalk.model.system import System

_OWN = 12.5  # values differ over so many times their own size, where a range is wider
_OCTAVES = 2.0  # change of the frequency, as a share of itself, that weighs as much as ten clearances


@dataclass(frozen=True, slots=True)
class Range:
    """A range of a parameter.

    Attributes
    ----------
    low, high
        Its ends.
    is_relative
        Whether the parameter is the frequency. What a system does at frequencies a hundred times lower is not a
        hundredth of its response, but as much again: half the frequency is as far away everywhere.
    natural
        Change of any other parameter that changes the motion much, where that is known; infinite otherwise.
    """

    low: float
    high: float
    is_relative: bool = False
    natural: float = math.inf

    def __contains__(self, value: object) -> bool:
        return isinstance(value, float) and self.low <= value <= self.high

    @property
    def width(self) -> float:
        """From one end to the other."""
        return self.high - self.low

    def bound(self, value: float) -> float:
        """The end of the range that a value beyond it has passed."""
        return self.low if value < self.low else self.high

    def nearness(self, value: float) -> float:
        """The width of the range that counts near a value, as a share of the whole."""
        size = abs(value) if self.is_relative else max(abs(value), self.natural)
        return min(1.0, _OWN * size / self.width)

    def weight(self, value: float, scale: float) -> float:
        """How much a parameter that is measured in units of `scale` weighs near a value, compared with the unknowns.

        Angles and distances in which it has this weight do not depend on the width of the range.
        """
        return scale / (_OCTAVES * abs(value)) if self.is_relative and value != 0.0 else 1.0

    def along(self, parameter: str, system: System) -> Range:
        """The same range, of a parameter of a system."""
        return replace(self, is_relative=system.structure.place(parameter) == 0)


def check_range(start: float, to: float | tuple[float, float]) -> Range:
    """The range from the start to `to`, or the range given; a ModelError if it does not hold the start."""
    low, high = sorted((start, to) if isinstance(to, int | float) else to)
    if not low < high:
        raise ModelError(f"the branch starts at {start:.10g} and should be followed to {to}: there is no way to go")
    if not low <= start <= high:
        raise ModelError(f"the branch starts at {start:.10g}, outside the range from {low:.10g} to {high:.10g}")
    return Range(float(low), float(high))
