"""Walks of a stretch of a branch, between special points that are known to lie on it.

Where it is unclear which special points a stretch has, the branch is walked from the last point before it that is
known, until it meets a known point beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.follow import BranchWalk
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit

Array = NDArray[np.float64]

_SAME = 1e-3  # difference of states, relative to the motion, within which two orbits at nearly one value are the same
_NEAR = 1e-4  # share of the range within which two values are nearly one


@dataclass(frozen=True, eq=False)
class Mark:
    """A special point that is known to lie on a branch."""

    form: int  #: Number of its form.
    #: kind, contact: What it is.
    kind: str
    contact: str
    value: float  #: Value of the parameter.
    state: Array  #: shape (state size,): Initial state of its orbit.
    way: float  #: Sign of the change of the parameter where the walk passes it.

    def is_at(self, special: SpecialPoint, width: float) -> bool:
        """Return True if a special point of a walk is this one; `width` is that of the range."""
        if special.kind.value != self.kind or special.contact != self.contact:
            return False
        return abs(special.value - self.value) <= _NEAR * width and self.has(special.orbit.state, special.orbit.system)

    def has(self, state: Array, system: System) -> bool:
        """Return True if an orbit that begins at a state is the one of this point."""
        return float(np.abs(state - self.state).max()) <= _SAME * magnitude(self.state, system)


def walk_stretch(
    system: System,
    parameter: str,
    period: int,
    within: tuple[float, float],
    start: Mark,
    ends: Sequence[Mark],
    options: WalkOptions,
) -> tuple[list[SpecialPoint], Mark | None] | None:
    """Walk a branch from a known special point until it meets another one, or the end of the range."""
    width, low, high = abs(within[1] - within[0]), min(within), max(within)
    found: list[SpecialPoint] = []
    try:
        orbit = find_orbit(system.at({parameter: start.value}), period, start.state)
        if not start.has(orbit.state, orbit.system):
            return None
        steps = BranchWalk([start_branch(orbit, parameter, (low, high), int(start.way))], options, judges=False)
        for _ in steps:
            for special in steps.special_points:
                met = next((end for end in ends if end.is_at(special, width)), None)
                if met is not None:
                    return found, met
                if found or not start.is_at(special, width):
                    found.append(special)
        end = steps.branch.ends[-1]
    except (ModelError, NumericalError):
        return None
    is_over = end.reason in (EndReason.RANGE, EndReason.TURNED_BACK) and end.value == within[1]
    return (found, None) if is_over else None
