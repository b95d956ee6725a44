"""What checks look at: peaks, ranges of instability, loops, in numbers and in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind
from gapwalk.bifurcation.diagram import Limb
from gapwalk.orbit.floquet import Instability
from gapwalk.study.result import Result

MEASURE = "half.q1"


class Range(NamedTuple):
    """A range of a parameter."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """How wide it is."""
        return self.high - self.low

    def meets(self, low: float, high: float) -> bool:
        """Whether it has something in common with another one."""
        return self.low <= high and low <= self.high

    def __str__(self) -> str:
        return f"{self.low:.4g}–{self.high:.4g}"


class Peak(NamedTuple):
    """A local maximum of a response: parameter and height."""

    value: float
    height: float

    def __str__(self) -> str:
        return f"{self.height:.3g} at {self.value:.3g}"


def main_branch(result: Result) -> Branch:
    """The branch of period 1 that the walk began with."""
    return result.branches[0]


def limbs(result: Result, period: int) -> list[Limb]:
    """The branches of one period."""
    assert result.diagram is not None
    return [limb for limb in result.diagram.limbs if limb.period == period]


def values(branch: Branch, kind: Kind, low: float = -np.inf, high: float = np.inf) -> list[float]:
    """The parameter at the special points of one kind, in order of size, within a range."""
    return sorted(special.value for special in branch.special(kind) if low <= special.value <= high)


def ranges(branch: Branch, test: Callable[[Instability], bool]) -> list[Range]:
    """The ranges of the parameter, from low to high, on which all motions pass a test of their instability."""
    nodes = [(point.arclength, point.value, point.instability) for point in branch.points]
    nodes += [(special.point.arclength, special.value, special.after) for special in branch.special_points]
    nodes.sort(key=lambda node: node[0])
    found: list[list[float]] = []
    inside = False
    for _, value, instability in nodes:
        if inside:
            found[-1].append(value)  # the node that ends a stretch belongs to it too
        passes = test(instability)
        if passes and not inside:
            found.append([value])
        inside = passes
    return sorted(Range(min(stretch), max(stretch)) for stretch in found)


def flipped(branch: Branch) -> list[Range]:
    """Where a multiplier lies beyond -1."""
    return ranges(branch, lambda instability: instability.below > 0)


def beating(branch: Branch) -> list[Range]:
    """Where a complex pair of multipliers lies outside the unit circle."""
    return ranges(branch, lambda instability: instability.pairs > 0)


def extent(branch: Branch) -> Range:
    """The range of the parameter that a branch covers."""
    return Range(float(branch.values.min()), float(branch.values.max()))


def peaks(branch: Branch, low: float = -np.inf, high: float = np.inf) -> list[Peak]:
    """The local maxima of the response along the branch, by the parameter, within a range."""
    heights, places = branch.measure(MEASURE), branch.values
    inner = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:])) + 1
    found = [Peak(float(places[i]), float(heights[i])) for i in inner if low <= places[i] <= high]
    return sorted(found)


def highest(branch: Branch, low: float = -np.inf, high: float = np.inf) -> Peak:
    """The highest point of the response within a range."""
    heights, places = branch.measure(MEASURE), branch.values
    inside = np.flatnonzero((places >= low) & (places <= high))
    best = inside[np.argmax(heights[inside])]
    return Peak(float(places[best]), float(heights[best]))


def words(found: Sequence[object]) -> str:
    """A list in words; ``none`` if it is empty."""
    return ", ".join(f"{each:.4g}" if isinstance(each, float) else str(each) for each in found) or "none"
