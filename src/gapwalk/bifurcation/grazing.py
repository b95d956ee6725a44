"""Grazing: where a contact just touches a breakpoint, so that the contact pattern changes along the branch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from gapwalk.bifurcation.stretch import Stretch
from gapwalk.continuation.point import BranchPoint
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.motion import sample, switch_names
from gapwalk.orbit.measures import turning_points, with_contacts
from gapwalk.orbit.orbit import Orbit

_SMALLEST = 1e-11  # arclength below which two changes of the pattern count as one


class Graze(NamedTuple):
    """A grazing point: the point of the branch, which switch grazes, and the bracket's width in the parameter."""

    point: BranchPoint
    switch: int
    uncertainty: float


def find_grazing(stretch: Stretch, first: BranchPoint, last: BranchPoint) -> list[Graze]:
    """All grazing points between two points of a branch, in order, by halving until each stands alone.

    A pair of changes that undo each other within one step leaves no trace and is not found.
    """
    changes = np.subtract(last.orbit.closings, first.orbit.closings)
    if not changes.any():
        return []
    changed = np.flatnonzero(changes)
    if np.abs(changes).sum() == 1:
        return [_locate(stretch, first, last, int(changed[0]))]
    if last.arclength - first.arclength < _SMALLEST:
        spread = abs(last.value - first.value)
        return [Graze(last, int(switch), spread) for switch in changed]
    middle = stretch.middle(first, last)
    return find_grazing(stretch, first, middle) + find_grazing(stretch, middle, last)


def describe_switch(orbit: Orbit, switch: int) -> str:
    """Contact, stage and side of a switch, such as ``stage2 -``."""
    contact, stage, side = switch_names(orbit.system)[switch]
    return f"{contact}{'.' + stage if stage else ''} {'+' if side > 0 else '-'}"


def _locate(stretch: Stretch, first: BranchPoint, last: BranchPoint, switch: int) -> Graze:
    """The point between `first` and `last` where the deflection just reaches the breakpoint of a switch."""
    fewer, richer = sorted((first, last), key=lambda point: point.orbit.closings[switch])
    where = _shortest_visit(richer.orbit, switch)
    tracked = {"theta": where}

    def depth(arclength: float) -> float:
        tracked["theta"], value = _extremal_depth(stretch.at(arclength).orbit, switch, tracked["theta"])
        return value

    low, high = first.arclength, last.arclength
    if depth(richer.arclength) * depth(fewer.arclength) < 0:
        root = float(brentq(depth, low, high, xtol=1e-13, rtol=1e-14))
        point = stretch.at(root)
        return Graze(point, switch, abs(float(point.tangent[-1])) * 1e-12)
    return _halve(stretch, first, last, switch)


def _halve(stretch: Stretch, first: BranchPoint, last: BranchPoint, switch: int) -> Graze:
    """The same by halving on the number of closings, where no extremum can be tracked."""
    while last.arclength - first.arclength > _SMALLEST:
        middle = stretch.middle(first, last)
        if middle.orbit.closings[switch] == first.orbit.closings[switch]:
            first = middle
        else:
            last = middle
    return Graze(last, switch, abs(last.value - first.value))


def _shortest_visit(orbit: Orbit, switch: int) -> float:
    """Middle of the shortest time between two events of one switch: the visit or the absence about to vanish."""
    thetas = np.array([event.theta for event in orbit.events if event.switch == switch])
    full = PERIOD * orbit.period
    following = np.append(thetas[1:], thetas[0] + full)
    shortest = int(np.argmin(following - thetas))
    return float(0.5 * (thetas[shortest] + following[shortest]) % full)


def _extremal_depth(orbit: Orbit, switch: int, near: float) -> tuple[float, float]:
    """Angle, and deflection past the breakpoint, of the deflection's extremum nearest to an angle."""
    thetas, depths = _depth_extremes(orbit, switch)
    full = PERIOD * orbit.period
    away = np.abs((thetas - near + full / 2) % full - full / 2)
    nearest = int(np.argmin(away))
    return float(thetas[nearest]), float(depths[nearest])


def _depth_extremes(orbit: Orbit, switch: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles and depths of all extremes of one switch's deflection over the orbit."""
    system, count = orbit.system, orbit.samples * orbit.period
    names = switch_names(system)
    contact, _, side = names[switch]
    index = [form.name for form in system.structure.contacts].index(contact)
    theta = PERIOD * orbit.period * np.arange(count + 1) / count
    motion = sample(system, orbit.state, with_contacts(theta, orbit))
    vector = system.values[system.structure.block(f"{contact}.deflection", system.size)]
    thetas, values = turning_points(motion, vector)
    breakpoint = side * system[_clearance_name(orbit, index, switch)]
    return thetas, side * (values - breakpoint)


def _clearance_name(orbit: Orbit, index: int, switch: int) -> str:
    form = orbit.system.structure.contacts[index]
    _, stage_name, _ = switch_names(orbit.system)[switch]
    stage = next(stage for stage in form.stages if stage.name == stage_name)
    return f"{form.stage_prefix(stage)}.clearance"
