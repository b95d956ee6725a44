"""Step over the orbits of a branch at which an event passes the start of the period, or of another segment.

The unknowns of shooting are the state at theta = 0. Where an impact passes theta = 0 along a branch, this state jumps,
from the one before the impact to the one after it; where a force that jumps sets in there, its path along the branch
has a corner. The motion itself, and what it does, are as smooth as elsewhere. Therefore a few steps are taken with
another section: the state at an angle at which the motion is free, in the middle between two events. Their special
points and the last of them become points of the branch with their states at theta = 0, which are a part of the same
motions. The states at the starts of several segments are moved by one angle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.detector import Detector, unexplained
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Walk, WalkState
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation

AT_START = 1e-4  # radians from the start of the period within which an event coincides with it
_CLEAR = 1e-3  # radians from the start at which the last event that passed it leaves the state there free
_FIRST, _LARGEST, _SHORTEST = 1e-4, 2e-3, 1e-11  # first, largest and smallest step of the walk with another section
_STEPS = 60  # largest number of its steps
_AMONG = 0.5  # radians between two impacts on one stop that are so close that further ones will pass too
_SAME = 1e-7  # distance, in scaled variables, within which a point found at theta = 0 is that of the other section

Vector = NDArray[np.float64]


class Passage(NamedTuple):
    """Result of the steps with another section."""

    point: BranchPoint  #: The last point.
    special: list[SpecialPoint]  #: The special points before it.
    step: float  #: Length of the next step.
    end: End | None  #: End of the branch at the point; None if it continues.


def starts_among_impacts(orbit: Orbit) -> bool:
    """Return True if the start of the period lies between two impacts of a chatter: along a branch, many will pass."""
    rigid = {switch for _, switch in orbit.system.structure.reactions if switch >= 0}
    if not rigid:
        return False
    own = [event for event in orbit.events if event.switch in rigid and event.enters]
    if len(own) < 2 or own[0].switch != own[-1].switch:
        return False
    return own[0].theta - own[-1].theta + PERIOD * orbit.period < _AMONG


def pass_start(corrector: Corrector, walk: Walk, state: WalkState, kinds: Sequence[Kind]) -> Passage | None:
    """Return steps from a point of a walk until the event at the start of the period has passed it.

    If the start lies among the impacts of a chatter, a step of the walk's own length is taken, which many may pass.
    """
    equation, first = corrector.equation, state.point
    if not isinstance(equation, ShootingEquation) or not _may_pass(equation, first.orbit):
        return None
    try:
        return _Section(corrector, equation, first).passage(walk, state, kinds)
    except NumericalError:
        return None


def smooth_between(
    corrector: Corrector, first: BranchPoint, last: BranchPoint
) -> tuple[Corrector, BranchPoint, BranchPoint]:
    """Return a section in which the orbits between two neighbouring points of a branch are smooth.

    That is the start of the period, unless an event of one of them is there.
    """
    equation = corrector.equation
    if isinstance(equation, ShootingEquation) and _may_pass(equation, first.orbit, last.orbit):
        section = _Section(corrector, equation, first)
        try:
            return section.corrector, section.entered(first), section.entered(last)
        except NumericalError:
            pass  # both may be on one side of the event, and what follows tells
    return corrector, first, last


def _may_pass(equation: ShootingEquation, *orbits: Orbit) -> bool:
    """Return True if an event may pass the start of a segment at some orbits, and another section is possible."""
    count = equation.options.segments
    among = count == 1 and any(map(starts_among_impacts, orbits))
    return not equation.begin and (among or any(_clearance(orbit, count) < AT_START for orbit in orbits))


class _Section:
    """Another section for the orbits near a point of a branch, and the way from one section to the other."""

    def __init__(self, corrector: Corrector, equation: ShootingEquation, point: BranchPoint) -> None:
        self._own, self._equation = corrector, equation
        self._posed = replace(equation, begin=_free_angle(point.orbit, equation.options.segments))
        self.corrector = Corrector(self._posed, corrector.scales)

    def passage(self, outer: Walk, state: WalkState, kinds: Sequence[Kind]) -> Passage:
        """Walk from a point until the state at theta = 0 is free; see `pass_start`."""
        first, options, among = state.point, outer.options, starts_among_impacts(state.point.orbit)
        options = replace(
            options,
            initial_step=_FIRST,
            smallest_step=min(options.smallest_step, _SHORTEST),
            largest_step=options.largest_step if among else min(_LARGEST, options.largest_step),
            max_points=_STEPS,
        )
        begin = self.entered(first)
        walk, special = Walk(begin, outer.within, self.corrector, options, change=outer.change), list[SpecialPoint]()
        walk.step = max(walk.step, state.step) if among else walk.step
        if first is not outer.origin and abs(first.x[-1] - outer.origin.x[-1]) < 2.0 * walk.step:
            walk.origin = self.entered(outer.origin)  # where a closed branch ends
        detector, before, last = Detector(self.corrector, kinds), None, begin
        for ahead in walk:
            found = detector.inspect(last, ahead, before)
            for text in unexplained(last, ahead, found):
                raise NumericalError(text)
            special += found
            before, last = last, ahead
            if _clearance(last.orbit, self._equation.options.segments) > (AT_START if among else _CLEAR):
                break
        end = None if walk.end is None or walk.end.reason is EndReason.POINTS else walk.end
        if last is begin or (end is not None and end.reason.is_failure):
            raise ConvergenceError("no orbit is found beyond the event at the start of the period")
        if end is not None and end.reason is not EndReason.CLOSED:
            end = outer.end_at(end.value)
        found = [replace(each, point=self._at_zero(each.point)) for each in special]
        return Passage(self._left(last), found, walk.step, end)

    def entered(self, point: BranchPoint) -> BranchPoint:
        """Return a point with this section."""
        x = np.append(self._posed.unknowns(point.orbit), point.value) / self._own.scales
        along = self._carried(point, self._equation.knots[:-1], self._posed.knots[:-1])
        found = self.corrector.point_near(x, along, point.arclength, within=_SAME * max(1.0, length_of(x)))
        if found is None:
            raise ConvergenceError("the orbit is not found with the other section")
        return found

    def _left(self, point: BranchPoint) -> BranchPoint:
        """Return a point of this section with its state at theta = 0, corrected there."""
        moved = self._at_zero(point)
        within = _SAME * max(1.0, length_of(moved.x))
        found = self._own.point_near(moved.x, moved.tangent, point.arclength, within=within)
        if found is None:
            raise ConvergenceError("the orbit is not found with its state at theta = 0")
        return found

    def _at_zero(self, point: BranchPoint) -> BranchPoint:
        """Return a point of this section with its state at theta = 0."""
        along = self._carried(point, self._posed.knots[:-1], self._equation.knots[1:])
        along[:-1] = np.roll(along[:-1], self._equation.system.state_size)  # that at the end is that at the start
        x = np.append(self._equation.unknowns(point.orbit), point.value) / self._own.scales
        return replace(point, x=x, tangent=along, memo={})

    def _carried(self, point: BranchPoint, starts: list[float], stops: list[float]) -> Vector:
        """Return the scaled tangent of a point at some angles as a unit tangent at a later one for each."""
        scales, along = self._own.scales, point.tangent[-1] * self._own.scales[-1]
        states, changes = ((x[:-1] * scales[:-1]).reshape(len(starts), -1) for x in (point.x, point.tangent))
        moved = [
            self._equation.carried(state, np.append(change, along), point.value, start, stop)[:-1]
            for state, change, start, stop in zip(states, changes, starts, stops, strict=True)
        ]
        tangent = np.append(np.concatenate(moved), along) / scales
        return tangent / length_of(tangent)


def _angles(orbit: Orbit) -> list[float]:
    """Return the angles of all events of an orbit; modes of friction that only go on at its start are none."""
    full = PERIOD * orbit.period
    found = [event.theta % full for event in orbit.events]
    for phases in orbit.friction.values():
        found += [phase.start % full for phase in phases if len(phases) > 1]
    return found


def _clearance(orbit: Orbit, segments: int) -> float:
    """Return the angle between the start of a segment and the nearest event."""
    span = PERIOD * orbit.period / segments
    return min((min(theta % span, span - theta % span) for theta in _angles(orbit)), default=math.inf)


def _free_angle(orbit: Orbit, segments: int) -> float:
    """Return the angle, after the start of each segment, in the middle of the longest part without events there."""
    span = PERIOD * orbit.period / segments
    angles = sorted([0.0, *(theta % span for theta in _angles(orbit)), span])
    start, stop = max(pairwise(angles), key=lambda pair: pair[1] - pair[0])
    return 0.5 * (start + stop)
