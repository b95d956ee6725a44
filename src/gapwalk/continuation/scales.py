"""Units in which a branch is walked: how large a change of each unknown weighs as much as one of the parameter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.growth import linear_growth
from gapwalk.continuation.range import Range
from gapwalk.model.system import System
from gapwalk.orbit.equation import OrbitEquation
from gapwalk.orbit.orbit import Orbit

_REACH = 20.0  # clearances beyond this many times the size of the first orbit are never met
_FAST = 1.0 / 16.0  # share of the highest frequency of a range by which velocities are measured at least
_CLEARANCES = 10.0  # change of an orbit, in clearances, that weighs as much as the whole range of the parameter


def scales_of(equation: OrbitEquation, orbit: Orbit, within: Range) -> NDArray[np.float64]:
    """Scales of the unknowns and of the parameter, shape (N + 1,), for the branch of an orbit in a range.

    A parameter is measured in widths of its range, and the unknowns as `unknown_scales` does. But the motion may be a
    million times larger at the other end of the range: so a length is that of the largest motion to be expected
    (`linear_growth`), and velocities go by a good part of the highest frequency at least.
    """
    parameter = equation.parameter or ""
    length = _length(orbit, lambda: linear_growth(orbit.system, parameter, within))
    place = orbit.system.structure.place(parameter)
    fastest = max(System.beside(orbit.system, place, bound).frequency for bound in (within.low, within.high))
    frequency = max(orbit.system.frequency, _FAST * fastest)
    return powers_of_two(np.append(equation.scales(_CLEARANCES * length, frequency), within.width))


def unknown_scales(equation: OrbitEquation, orbit: Orbit) -> NDArray[np.float64]:
    """Scales of the unknowns of an equation near an orbit, shape (N,).

    Positions in largest clearances (the natural length of a system with gaps), or in amplitudes of the orbit if that is
    larger or no gap is within its reach; velocities in that times the frequency. Both are divided among the unknowns
    and set against the parameter so that an orbit that changes by a tenth of that length counts as 1 % of the range.
    """
    return equation.scales(_CLEARANCES * _length(orbit))


def _length(orbit: Orbit, growth: Callable[[], float] | None = None) -> float:
    """The largest clearance within reach of an orbit, or its amplitude if that is larger.

    Where no gap is within reach, the motion can still grow, by `growth` until it uses up the smallest of them.
    """
    clearances = [
        orbit.system[f"{contact.stage_prefix(stage)}.clearance"]
        for contact in orbit.system.structure.contacts
        for stage in contact.stages
    ]
    gaps = [clearance for clearance in clearances if clearance > 0.0]
    amplitude = 0.5 * float(np.ptp(orbit.extremes[:, :2], axis=1).max())
    reach = _REACH * float(np.abs(orbit.extremes[:, :2]).max())
    if growth is not None and all(gap > reach for gap in gaps):
        grown = min([growth(), *gaps])
        if np.isfinite(grown):
            amplitude, reach = max(amplitude, grown), max(reach, _REACH * grown)
    return max([amplitude, *(gap for gap in gaps if gap <= reach)]) or 1.0


def powers_of_two(scales: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scales that round nothing: a walk from 2.0 begins at 2.0, not at 1.9999999999999998."""
    return np.exp2(np.round(np.log2(scales)))
