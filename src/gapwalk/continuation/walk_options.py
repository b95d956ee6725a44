"""Options of a walk: length and number of its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from gapwalk.errors import ModelError


@dataclass(frozen=True, slots=True)
class WalkOptions:
    """Options of a walk. Steps are arclengths in scaled variables (see `scales_of`), in which the range has width 1.

    Parameters
    ----------
    initial_step
        The first step; it is clipped to the two limits below.
    smallest_step, largest_step
        The step at which the walk gives up, and the longest step.
    largest_turn
        The largest angle between the tangents at both ends of a step, in radians.
    iterations
        Newton iterations per step that the step-size control aims at.
    max_points
        Number of points after which the walk stops and reports that limit.
    """

    initial_step: float = 0.002
    # not compared: it changes no point of a walk, so a walk begun with another value can be resumed
    smallest_step: float = field(default=1e-13, compare=False)
    largest_step: float = 0.01
    largest_turn: float = 0.35
    iterations: int = 3
    max_points: int = 20_000

    def __post_init__(self) -> None:
        for name in ("initial_step", "smallest_step", "largest_step", "largest_turn"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
                raise ModelError(f"{name} is {value!r}; it must be a number > 0")
        if not self.smallest_step <= self.largest_step:
            raise ModelError(
                f"the steps must satisfy smallest_step <= largest_step, but they are {self.smallest_step} and "
                f"{self.largest_step}"
            )
        for name in ("iterations", "max_points"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 2:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 2")

    @property
    def first_step(self) -> float:
        """First step of a walk, clipped to the limits."""
        return min(max(self.initial_step, self.smallest_step), self.largest_step)
