"""Where a branch ends on another one: the orbit that both share."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.departure import Departure, depart
from gapwalk.bifurcation.trail import Trail
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import NumericalError
from gapwalk.motion.unit import magnitude
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.identity import SAME, phases
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit

_STEPS = (1e-4, 2e-5, 4e-6)  # with which first step a flip is sought along its parent: smaller where one went astray
_LARGEST, _POINTS = 2e-3, 15  # and how far


def meets(orbit: Orbit, special: SpecialPoint, parameter: str) -> bool:
    """Whether an orbit is that of a special point, begun later or gone round twice perhaps.

    Balanced, a doubled branch meets its parent where the truncated equation has it, and the parent's flip is where its
    multipliers have it: the two differ by the truncation.
    """
    value, wanted = orbit.system[parameter], special.value
    same = max(SAME, orbit.truncation, special.orbit.truncation)
    if abs(value - wanted) > same * (1.0 + abs(wanted)):
        return False
    off = np.abs(phases(special.orbit) - orbit.state).max(axis=1)
    return bool(off.min() <= same * magnitude(orbit.state, orbit.system))


def parent_flip(branch: Branch, within: tuple[float, float], method: Method | None = None) -> Orbit | None:
    """The flip at which a period-doubled branch ends; None if there is none on its parent beside its last point.

    A walk may end just before its parent, where a contact grazes so close to the flip that its steps grow too small.
    The parent's orbit is found from the mean of the two halves, and followed both ways within the range given.

    Parameters
    ----------
    branch
        The branch.
    within
        Range of its parameter.
    method
        How orbits are posed.
    """
    last = branch.points[-1].orbit
    if last.period % 2:
        return None
    try:
        states = last.strobes(last.period // 2 + 1)
        parent = find_orbit(last.system, last.period // 2, 0.5 * (states[0] + states[-1]), method=method)
        departures = [depart(parent, branch.parameter, within, way, method) for way in (-1, 1)]
        found = [flip for departure in departures if (flip := _first_flip(departure)) is not None]
    except NumericalError:
        return None
    return min(found, key=lambda flip: flip.point.arclength).orbit if found else None


def _first_flip(departure: Departure) -> SpecialPoint | None:
    """The first flip one way along a branch, which may itself end at its parent just beyond."""
    for step in _STEPS:
        trail = Trail(departure, WalkOptions(initial_step=step, largest_step=_LARGEST, max_points=_POINTS))
        flips = next((flips for _, special in trail if (flips := _flips(special))), [])
        if flips:
            return flips[0]
        if trail.end is None or trail.end.reason is not EndReason.JOINED:
            break
    return None


def _flips(special: list[SpecialPoint]) -> list[SpecialPoint]:
    return [each for each in special if each.kind is Kind.FLIP]
