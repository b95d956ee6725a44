"""Options of a walk, and the control of its step size.

The step size is controlled after den Heijer and Rheinboldt (1981, SIAM J. Numer. Anal. 18, 925-948).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt

from gapwalk.continuation.corrector import Correction
from gapwalk.errors import ModelError

_LONGEST, _SHORTEST = 2.0, 0.4  # limits of the ratio of successive steps
GOAL = 0.6
"""Share of the largest allowed turn, or change, that a step aims at."""

# Bounds that the schema of a table knows too: it names a wrong value as it was written.
_Positive = Annotated[float, Gt(0)]
_AtLeastTwo = Annotated[int, Ge(2)]


@dataclass(frozen=True, slots=True)
class WalkOptions:
    """Options of a walk. Steps are arclengths in scaled variables (see `scales_of`), in which the range has width 1.

    Examples
    --------
    >>> short = gw.follow(orbit, "frequency", 1.6, walk=gw.WalkOptions(max_points=10))
    >>> short.ends[1].reason_words
    'the largest number of points was reached (max_points = 10)'
    """

    initial_step: _Positive = 0.002  #: The first step; it is clipped to the two limits below.
    # not compared: it changes no point of a walk, so a walk begun with another value can be resumed
    smallest_step: _Positive = field(default=1e-13, compare=False)  #: The step at which the walk gives up.
    largest_step: _Positive = 0.01  #: The longest step.
    largest_turn: _Positive = 0.35  #: The largest angle between the tangents at both ends of a step, in radians.
    iterations: _AtLeastTwo = 3  #: Newton iterations per step that the step-size control aims at.
    max_points: _AtLeastTwo = 20_000  #: Number of points after which the walk stops and reports that limit.

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


def next_step(step: float, correction: Correction, turn: float, options: WalkOptions) -> float:
    """Return the step to try after an accepted step, before it is limited to the longest step.

    Two conditions limit it: the corrector should converge in `options.iterations`, and the tangent should not turn
    too far.

    For the first, Newton's errors obey ``e_(j+1) = C e_j^2``, so with ``q = C e_0`` the last of k steps is about
    ``e_0 q^(2^(k-1) - 1)``. This gives q, and from q the initial error from which the wanted number of steps would
    reach the same accuracy: ``q^(2^(k - wanted) - 1)`` times the present one. The error of the tangent predictor
    grows with the square of the step.
    """
    taken, wanted = correction.iterations, options.iterations
    if taken < 2 or correction.last <= 0.0 or correction.last >= correction.distance:
        by_iterations = _LONGEST if taken <= wanted else _SHORTEST
    else:
        contraction = (correction.last / correction.distance) ** (1.0 / (2.0 ** (taken - 1) - 1.0))
        by_iterations = math.sqrt(contraction ** (2.0 ** (taken - wanted) - 1.0))
    by_turn = GOAL * options.largest_turn / max(turn, 1e-12)
    return step * min(_LONGEST, max(_SHORTEST, min(by_iterations, by_turn)))


def shorter_step(step: float) -> float:
    """Return the step to try after a failed step."""
    return step / 3.0
