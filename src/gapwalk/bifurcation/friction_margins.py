"""How far friction is, all over an orbit, from a change of its sequence of slip and stick.

Two changes that cancel each other within one step of a walk are not visible in the sequences at its ends. The margins
at its ends, and those of the point before it, show where there may be some.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.friction_gauge import FrictionGauge, Modes, modes_at
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.friction_phases import FrictionPhase
from gapwalk.orbit.measures import apart
from gapwalk.orbit.orbit import Orbit

_SAMPLES = 96  # per forcing period
_SAME = 0.5  # radians by which a margin may move between two points
_DOUBT = 0.5  # share of its bend by which a margin may have moved between two points; 1/8 for a parabola
_NEAR = 0.05  # share of its range within which a least value that appears counts as near zero
_FAR, _LONG = 0.6, 4e-3  # the same in steps of more than this arclength
_BIRTH = 2e-4  # arclength to which the appearance of such a value is narrowed down


class Margin(NamedTuple):
    """Distance of friction from a change at one instant.

    Attributes
    ----------
    contact
        Number of the contact.
    what
        What vanishes at the change: ``rate`` within slip, ``reserve`` within stick, ``stop`` where slip ends.
    side
        The direction of slip concerned.
    theta, value
        The angle, and the distance: for ``rate`` and ``reserve`` the least value nearby.
    range
        Largest value of the same quantity.
    """

    contact: int
    what: str
    side: int
    theta: float
    value: float
    range: float


def margins_of(point: BranchPoint) -> list[Margin]:
    """Return all margins of the orbit of a point; they are computed once."""
    found = point.memo.get("friction margins")
    if found is None:
        found = point.memo["friction margins"] = margins_of_orbit(point.orbit)
    return found


def margins_of_orbit(orbit: Orbit) -> list[Margin]:
    """Return all margins of an orbit."""
    full, coefficients, found = PERIOD * orbit.period, coefficients_of(orbit.system), []
    starts = sorted({phase.start % full for phases in orbit.friction.values() for phase in phases})
    grid = np.unique(np.concatenate((np.linspace(0.0, full, _SAMPLES * orbit.period + 1), starts)))
    states = flow_of(orbit.system).sample(coefficients, orbit.state, grid).states
    for contact, phases in orbit.friction.items():
        gauge = FrictionGauge(layout_of(orbit.system.structure), contact)
        for place, phase in enumerate(phases):
            past = phases[place - 1].mode
            inside = np.flatnonzero([phase.contains(theta, full) for theta in grid[:-1]])
            inside = inside[np.argsort((grid[inside] - phase.start) % full, kind="stable")]
            if len(inside) > 2:
                modes = _modes(orbit, phase.start + 0.5 * phase.length)
                for side in (phase.mode,) if phase.mode else (1, -1):
                    function = gauge.rate if phase.mode else gauge.reserve
                    values = function(coefficients, grid[inside], states[inside], modes, side)
                    found += _least(contact, phase, side, grid[inside], values, phase.length >= full)
            if past and past != phase.mode and gauge.memory is None:
                start = int(np.searchsorted(grid, phase.start % full))
                modes = gauge.sticking(modes_at(orbit.system.structure, orbit.slips, orbit.events, grid[start], True))
                now = coefficients, grid[start], states[start], modes
                own, other = (float(gauge.reserve(*now, side)) for side in (-past, past))
                found.append(Margin(contact, "stop", past, float(grid[start]), own, own + other))
    return found


def _modes(orbit: Orbit, theta: float) -> Modes:
    return modes_at(orbit.system.structure, orbit.slips, orbit.events, theta % (PERIOD * orbit.period), True)


def _least(
    contact: int, phase: FrictionPhase, side: int, thetas: NDArray[np.float64], values: NDArray[np.float64], whole: bool
) -> list[Margin]:
    """Return the least values of a quantity within a phase, by parabolas."""
    if whole:
        thetas, values = np.append(thetas, thetas[:2] + PERIOD), np.append(values, values[:2])
    found, what = [], "rate" if phase.mode else "reserve"
    for place in 1 + np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])):
        slope, bend = 0.5 * (values[place + 1] - values[place - 1]), values[place - 1 : place + 2] @ (1.0, -2.0, 1.0)
        value = float(values[place] - (0.5 * slope**2 / bend if bend > 0.0 else 0.0))
        # the samples are even but for those at events
        width = (thetas[place] - thetas[place - 1]) % PERIOD
        shift = -width * slope / bend if bend > 0.0 else 0.0
        found.append(Margin(contact, what, side, float(thetas[place] + shift), value, float(values.max())))
    return found


def may_change(before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> bool:
    """Return True if changes that cancel each other may hide between two points of a walk with the same sequence."""
    if not any(any(phase.mode for phase in phases) for phases in first.orbit.friction.values()):
        return False
    full, length = PERIOD * first.orbit.period, last.arclength - first.arclength
    now, then = margins_of(first), margins_of(last)
    past = None if before is None or first.arclength <= before.arclength else margins_of(before)
    ratio = math.nan if past is None or before is None else length / (first.arclength - before.arclength)
    for own in now:
        following = _same(own, then, full)
        if following is None:
            continue
        preceding = None if past is None else _same(own, past, full)
        if preceding is not None:
            bend = abs((following.value - own.value) - ratio * (own.value - preceding.value))
            if min(abs(own.value), abs(following.value)) < _DOUBT * bend:
                return True
    if length <= _BIRTH:
        return False
    lonely = [each for each in now if _same(each, then, full) is None]
    lonely += [each for each in then if _same(each, now, full) is None]
    near = _NEAR if length <= _LONG else _FAR
    return any(each.what != "stop" and 0.0 <= each.value < near * each.range for each in lonely)


def _same(own: Margin, others: Sequence[Margin], full: float) -> Margin | None:
    """Return the margin among others that one has become."""
    alike = [
        each
        for each in others
        if (each.contact, each.what, each.side) == (own.contact, own.what, own.side)
        and apart(each.theta, own.theta, full) < _SAME
    ]
    return min(alike, key=lambda each: apart(each.theta, own.theta, full), default=None)
