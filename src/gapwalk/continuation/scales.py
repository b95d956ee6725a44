"""Units in which a branch is walked: how large a change of each unknown weighs as much as one of the parameter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.growth import linear_growth
from gapwalk.continuation.range import Range
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System
from gapwalk.orbit.balance.linear import linear_of
from gapwalk.orbit.equation import OrbitEquation
from gapwalk.orbit.orbit import Orbit

_REACH = 20.0  # clearances beyond this many times the size of the first orbit are never met
_SLOWEST, _FASTEST = 0.25, 16.0  # of the natural frequency: frequencies by which velocities are measured
_CLEARANCES = 10.0  # change of an orbit, in clearances, that weighs as much as the natural change of the parameter


def scales_of(equation: OrbitEquation, orbit: Orbit, within: Range) -> NDArray[np.float64]:
    """Scales of the unknowns and of the parameter, shape (N + 1,), for the branch of an orbit in a range.

    None of them grows with the range without bound: what lies within a part of it is walked alike, however wide the
    whole is. Frequencies are measured by a typical one, and so are velocities. Other parameters are measured in widths
    of the range, or by `Range.natural` if that is smaller, and the unknowns as `unknown_scales` does. But the motion
    may be a million times larger at the other end of the range: so a length is that of the largest motion to be
    expected (`linear_growth`).
    """
    parameter = equation.parameter or ""
    length = _length(orbit, lambda: linear_growth(orbit.system, parameter, within))
    frequency = _typical_frequency(orbit.system)
    scale = frequency if within.is_relative else min(within.width, within.natural)
    return powers_of_two(np.append(equation.scales(_CLEARANCES * length, frequency), scale))


def with_natural_change(within: Range, equation: OrbitEquation, orbit: Orbit) -> Range:
    """The range of a parameter that is not the frequency, with its `Range.natural` from an orbit.

    That is the change that would move the orbit by ten clearances, or the value itself if that is larger.
    """
    if within.is_relative:
        return within
    value = orbit.system[equation.parameter or ""]
    evaluation = equation.evaluate(equation.unknowns(orbit), value)
    try:
        slope = np.linalg.solve(evaluation.by_unknowns, -np.asarray(evaluation.by_parameter))
    except np.linalg.LinAlgError:
        slope = np.zeros(1)
    speed = float(np.abs(slope / unknown_scales(equation, orbit)[: len(slope)]).max())
    moved = 1.0 / speed if speed > 0.0 else 0.0
    natural = max(abs(value), moved if math.isfinite(moved) else 0.0)
    return replace(within, natural=natural or math.inf)


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


def _typical_frequency(system: System) -> float:
    """The frequency of a system, unless it is far from its natural one: then the nearest that is not.

    The natural one is a mean (root of the mean square) over the modes while all gaps are open, or, of a system that
    only its contacts hold, while all are closed.
    """
    linear = linear_of(layout_of(system.structure), coefficients_of(system))
    closed = np.array([max((each.stiffness for each in spring.slopes), default=0.0) for spring in springs_of(system)])
    for stiffness in (np.zeros(len(closed)), closed):
        square = float(np.trace(linear.shifted(stiffness))) / system.size
        if square > 0.0:
            natural = math.sqrt(square)
            return min(max(system.frequency, _SLOWEST * natural), _FASTEST * natural)
    return system.frequency
