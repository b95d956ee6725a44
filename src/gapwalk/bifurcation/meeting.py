"""Where a branch ends on another one: the orbit that both share."""

from __future__ import annotations

import numpy as np

from gapwalk.bifurcation.departure import depart
from gapwalk.bifurcation.trail import Trail
from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
from gapwalk.continuation.options import WalkOptions
from gapwalk.errors import NumericalError
from gapwalk.model.coefficients import coefficients_of
from gapwalk.motion.flow import PERIOD, flow_of
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.identity import SAME, stroboscopic
from gapwalk.orbit.orbit import Orbit

_BESIDE = WalkOptions(initial_step=1e-4, largest_step=2e-3, max_points=15)  # how far along its parent a flip is sought


def meets(orbit: Orbit, special: SpecialPoint, parameter: str) -> bool:
    """Whether an orbit is that of a special point, begun at another forcing period or gone round twice perhaps."""
    value, wanted = orbit.system[parameter], special.value
    if abs(value - wanted) > SAME * (1.0 + abs(wanted)):
        return False
    off = np.abs(stroboscopic(special.orbit) - orbit.state).max(axis=1)
    return bool(off.min() <= SAME * (1.0 + float(np.abs(orbit.state).max())))


def parent_flip(branch: Branch, within: tuple[float, float]) -> Orbit | None:
    """The flip at which a period-doubled branch ends; None if there is none on its parent beside its last point.

    A walk may end just before its parent, where a contact grazes so close to the flip that its steps grow too small.
    The parent's orbit is found from the mean of the two halves, and followed both ways within the range given.
    """
    last = branch.points[-1].orbit
    if last.period % 2:
        return None
    flow, coefficients = flow_of(last.system), coefficients_of(last.system)
    found: list[SpecialPoint] = []
    try:
        later = flow.integrate(coefficients, last.state, 0.0, 0.5 * PERIOD * last.period).state
        parent = find_orbit(last.system, last.period // 2, 0.5 * (last.state + later))
        for way in (-1, 1):
            trail = Trail(depart(parent, branch.parameter, within, way), _BESIDE)
            found += next((flips for _, special in trail if (flips := _flips(special))), [])[:1]
    except NumericalError:
        return None
    return min(found, key=lambda flip: flip.point.arclength).orbit if found else None


def _flips(special: list[SpecialPoint]) -> list[SpecialPoint]:
    return [each for each in special if each.kind is Kind.FLIP]
