"""Held stop: along a branch, a rigid stop begins or ceases to be held, or to be left, for a while in each period.

A stop is held where impacts have come to rest on it, until its force would pull. Along a branch such a phase becomes
shorter and vanishes: the force changes its sign before the impacts have come to rest. Complete chatter then becomes
incomplete. On the side on which the stop is held, the motion depends smoothly on the parameter up to that point. On the
other side, infinitely many impacts graze one after the other as the point is approached, each with a fold, within
arclengths that shrink geometrically. So the point is located from the side on which the stop is held.

A motion that rests on a stop all the time lifts off where the least force of the stop vanishes. That force, as if the
stop were held, is known on both sides, so its zero is the point.

Nordmark and Piiroinen (2009), Simulation and stability analysis of impacting systems with complete chattering,
Nonlinear Dynamics 58, 85-106; Budd and Dux (1994), Chattering and related behaviour in impact oscillators, Phil. Trans.
R. Soc. A 347, 365-389.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import NDArray

from gapwalk.bifurcation.special_point import (
    EXACT,
    ROUNDING,
    SAFETY,
    ErrorEstimator,
    Kind,
    Search,
    StepInterval,
    Symbol,
    Zero,
    zero_between,
)
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import DryModes, Motion, forces_and_accelerations, sample
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, describe_switch

if TYPE_CHECKING:
    from gapwalk.bifurcation.special_point import SpecialPoint

_SMALLEST = 1e-11  # arclength below which two changes count as one
_EXACT = 1e-12  # arclength to which a change is located
_BEYOND = 1.5  # longest distance along the tangents at which it is sought, in lengths of the step, which may be bent
_RATE = 1e-7  # arclength from which on the rate is known at which a phase becomes shorter
_FIT, _NODES = 8.0, 9  # radius, over the samples of a radian, and nodes of the fit about the least force
_ASTRAY = 0.5  # distance of an orbit from its guess, as a share of the distance ahead, beyond which it is another one


class HeldStop(Kind):
    """Held stop: a phase in which a rigid stop is held, or is left between two such phases, appears or vanishes."""

    turn = 0
    by_multipliers = False
    symbol = Symbol("held stop", "", "2", 7.0, "grey")

    def points_in(self, search: Search) -> list[Zero]:
        """Return all points of this kind in a step; see `find_held_changes`."""
        return [
            Zero(self, each.point, each.spread, _no_function, describe_switch(each.point.orbit, each.switch))
            for each in find_held_changes(search.interval, search.first, search.last)
        ]

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Return the width of the bracket, with the difference from another discretisation on the located side."""
        point, off = zero.point, abs(second.at(zero.point).value - zero.point.value)
        width = abs(point.x[-1] and point.value / point.x[-1])
        along = abs(float(point.tangent[-1])) * width * zero.spread
        return float(along + SAFETY * off + ROUNDING * (abs(point.value) + width))

    def nature(self, before: BranchPoint, after: BranchPoint) -> str:
        """Return how often each stop whose phases change is held in a period, before and after the point."""
        found = []
        for switch in held_changes(before, after):
            held = " -> ".join(how_often(each.orbit, switch) for each in (before, after))
            held += "" if held.endswith("time") else " times"
            found.append(f"{describe_switch(before.orbit, switch)} held {held}")
        return ", ".join(found)

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """See `Kind.examined`: the stop must be held on one side otherwise than on the other."""
        names = [describe_switch(before.orbit, switch) for switch in held_changes(before, after)]
        return [] if special.contact in names else [f"{special.contact} is held equally often before and after"], None

    @property
    def no_locus(self) -> str:
        """Reason why it has no locus: on one side of it, orbits are not smooth in any parameter."""
        return "a held-stop has no locus in two parameters: on one side of it infinitely many impacts graze"


class HeldChange(NamedTuple):
    """Located change: the last point before it on the side with more phases, the switch, and the arclength of doubt."""

    point: BranchPoint
    switch: int
    spread: float


def how_often(orbit: Orbit, switch: int) -> str:
    """Return how often a rigid stop is held in a period, or that it is all the time."""
    return "all the time" if orbit.rests(switch) else f"{orbit.held[switch][0]}"


def held_changes(first: BranchPoint, last: BranchPoint) -> list[int]:
    """Return the switches of rigid stops whose phases are not the same in two neighbouring orbits."""
    ours, theirs = first.orbit.held, last.orbit.held
    return [switch for switch, phases in ours.items() if theirs.get(switch) != phases]


def find_held_changes(interval: StepInterval, first: BranchPoint, last: BranchPoint) -> list[HeldChange]:
    """Find all changes between two neighbouring points of a walk, in order; a step with several of them is halved."""
    changed, length = held_changes(first, last), last.arclength - first.arclength
    if not changed:
        return []
    if length < _SMALLEST:
        return [HeldChange(last, switch, length) for switch in changed]
    if len(changed) == 1 and _difference(first, last, changed[0]) <= 1:
        rests = any(point.orbit.rests(changed[0]) for point in (first, last))
        found = (_lift_off if rests else _locate)(interval, first, last, changed[0])
        if found is not None:
            return [found]
    middle = interval.middle(first, last)
    return find_held_changes(interval, first, middle) + find_held_changes(interval, middle, last)


def _difference(first: BranchPoint, last: BranchPoint, switch: int) -> int:
    """Return by how many phases of either sort two motions differ."""
    return max(abs(a - b) for a, b in zip(first.orbit.held[switch], last.orbit.held[switch], strict=True))


def _locate(interval: StepInterval, first: BranchPoint, last: BranchPoint, switch: int) -> HeldChange | None:
    """Locate a change from the side with more phases; None if they do not vanish within the step."""
    # On the other side there may be no orbit at a distance, or several, so that nothing is concluded from them but that
    # the phases of the first side are gone. What is left of the phase at the point counts as its error: the flow
    # resolves no phase that is shorter than two events must be apart.
    rich, poor = sorted((first, last), key=lambda point: -sum(point.orbit.held[switch]))
    corrector, way = interval.corrector, math.copysign(1.0, poor.arclength - rich.arclength)
    point, before, near, far = rich, rich, 0.0, _BEYOND * abs(poor.arclength - rich.arclength)
    longest = far
    while far - near > _EXACT:
        ahead = 0.5 * (far - near)
        trial = corrector.point_ahead(point, way * ahead, _ASTRAY * ahead)
        if trial is not None and trial.orbit.held == rich.orbit.held:
            before = point if ahead > _RATE else before
            point, near = trial, near + ahead
        else:
            far = near + ahead
    if far == longest or not first.arclength <= point.arclength <= last.arclength:
        return None
    left, shrunk = _shortest(point.orbit, switch), _shortest(before.orbit, switch) - _shortest(point.orbit, switch)
    rest = left * abs(point.arclength - before.arclength) / shrunk if shrunk > 0.0 else 0.0
    return HeldChange(point, switch, max(far - near, rest))


def _lift_off(interval: StepInterval, first: BranchPoint, last: BranchPoint, switch: int) -> HeldChange | None:
    """Locate where a stop that is held all the time at one of two points ceases to be; None if its force tells not."""

    def force(arclength: float) -> float:
        return _least_force(interval.at(arclength).orbit, switch)

    if force(first.arclength) * force(last.arclength) >= 0.0:
        return None
    place, converged = zero_between(force, first.arclength, last.arclength)
    return HeldChange(interval.at(place), switch, EXACT if converged else math.inf)


def _least_force(orbit: Orbit, switch: int) -> float:
    """Return the least force of a stop in a period, towards it, as if it were held all the time."""
    motion, full = orbit.motion(), PERIOD * orbit.period
    forces = _force(motion, switch)
    least = int(np.argmin(forces))
    nodes = _FIT / orbit.samples * np.cos(np.linspace(np.pi, 0.0, _NODES))
    thetas = float(motion.theta[least]) + full * (motion.theta[least] < 0.5 * full) + nodes
    beside = sample(orbit.system, orbit.state, np.concatenate(([0.0], thetas)))
    fit = Chebyshev.fit(nodes, _force(beside, switch)[1:], _NODES - 1)
    turns = [each.real for each in fit.deriv().roots().tolist() if abs(each) <= nodes[-1]]
    found = float(min([forces[least], *fit(np.array(turns))]))
    return found if orbit.rests(switch) else min(found, -np.finfo(float).tiny)  # short flights disturb the fit


def _force(motion: Motion, switch: int) -> NDArray[np.float64]:
    """Return the force of a stop at each sample of a motion, towards it, as if it were held."""
    structure, modes = motion.system.structure, motion.modes
    (place, contact), *_ = [(at, own) for at, (own, each) in enumerate(structure.reactions) if each == switch]
    held = modes.held.copy()
    held[:, place] = True
    given = layout_of(structure), coefficients_of(motion.system), motion.theta, motion.q, motion.v, motion.z
    forces = forces_and_accelerations(*given, DryModes(modes.slips, held))[0]
    return structure.breakpoints[switch].side * forces[:, contact]


def _shortest(orbit: Orbit, switch: int) -> float:
    """Return the length, in radians, of the shortest phase in which a stop is held, or left between two of them."""
    full, own = PERIOD * orbit.period, [event for event in orbit.events if event.switch == switch]
    holds = [(own[place - 1].theta, event.theta) for place, event in enumerate(own) if not event.enters]
    lengths = [(end - begin) % full for begin, end in holds]
    if len(holds) > 1:
        lengths += [(begin - holds[place - 1][1]) % full for place, (begin, _) in enumerate(holds)]
    return min(lengths, default=full)


def _no_function(point: BranchPoint) -> float:
    return math.nan
