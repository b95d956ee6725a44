"""The values of the parameter between which a branch is followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gapwalk.errors import ModelError
from gapwalk.model.system import System

_OWN = 12.5  # frequencies are told apart over so many times their own value, where a range is wider


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
    """

    low: float
    high: float
    is_relative: bool = False

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
        return min(1.0, _OWN * abs(value) / self.width) if self.is_relative else 1.0

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
