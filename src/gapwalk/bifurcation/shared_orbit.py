"""Junction of two branches: the orbit that a branch shares with the one on which it ends."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.branch_start import BranchStart, start_branch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.continuation.walk import EndReason
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.identity import SAME, phases
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit

_STEPS = (1e-4, 2e-5, 4e-6)  # first steps along the parent in search of a flip: a smaller one if the last went astray
_LARGEST, _POINTS = 2e-3, 15  # the largest step and the number of points of that search


def meets(orbit: Orbit, special: SpecialPoint, parameter: str) -> bool:
    """Return whether an orbit is that of a special point, possibly with another phase or repeated several times.

    In harmonic balance a doubled branch meets its parent at the flip of the truncated equation, but the flip of the
    parent is located by its multipliers. The two differ by the truncation error.
    """
    value, wanted = orbit.system[parameter], special.value
    same = max(SAME, orbit.truncation, special.orbit.truncation)
    if abs(value - wanted) > same * (1.0 + abs(wanted)):
        return False
    off = np.abs(phases(special.orbit) - orbit.state).max(axis=1)
    return bool(off.min() <= same * magnitude(orbit.state, orbit.system))


def parent_flip(branch: Branch, within: tuple[float, float], method: Method | None = None) -> Orbit | None:
    """Return the orbit of the flip at which a period-doubled branch ends; None if its parent has none nearby.

    A walk may end just before its parent, if a contact grazes so close to the flip that the steps become too small.
    The parent's orbit is found from the mean of the two halves, and followed in both directions within the range.

    Parameters
    ----------
    branch
        The branch.
    within
        Range of its parameter.
    method
        Discretisation of the orbits.
    """
    last = branch.points[-1].orbit
    if last.period % 2:
        return None
    try:
        states = last.strobes(last.period // 2 + 1)
        parent = find_orbit(last.system, last.period // 2, 0.5 * (states[0] + states[-1]), method=method)
        beginnings = [start_branch(parent, branch.parameter, within, way, method) for way in (-1, 1)]
        found = [flip for beginning in beginnings if (flip := _first_flip(beginning)) is not None]
    except NumericalError:
        return None
    return min(found, key=lambda flip: flip.point.arclength).orbit if found else None


def _first_flip(beginning: BranchStart) -> SpecialPoint | None:
    """Return the first flip in one direction along a branch, which may itself end at its parent just beyond."""
    for step in _STEPS:
        tracer = BranchTracer(beginning, WalkOptions(initial_step=step, largest_step=_LARGEST, max_points=_POINTS))
        flips = next((flips for _, special in tracer if (flips := _flips(special))), [])
        if flips:
            return flips[0]
        if tracer.end is None or tracer.end.reason is not EndReason.JOINED:
            break
    return None


def _flips(special: list[SpecialPoint]) -> list[SpecialPoint]:
    return [each for each in special if each.kind is Kind.FLIP]
