"""Step over the orbits of a branch at which an event passes the start of the period.

The unknowns of shooting are the state at theta = 0. Where an impact passes theta = 0 along a branch, this state jumps,
from the one before the impact to the one after it; where a viscous force sets in there, its path along the branch has a
corner. The motion itself, and what it does, are as smooth as elsewhere. Therefore a few steps are taken with another
section: the state at an angle at which the motion is free, in the middle between two events. Their special points and
the last of them become points of the branch with their states at theta = 0, which are a part of the same motions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.detector import Detector, unexplained
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import End, Walk
from gapwalk.continuation.walk_scales import Range
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation

AT_START = 1e-4  # radians from the start of the period within which an event coincides with it
_CLEAR = 1e-3  # radians from the start at which the last event that passed it leaves the state there free
_FIRST, _LARGEST = 1e-6, 2e-3  # first and largest step of the walk with the other section
_STEPS = 60  # largest number of its steps
_SAME = 1e-7  # distance, in scaled variables, within which a point found at theta = 0 is that of the other section

Vector = NDArray[np.float64]


class Passage(NamedTuple):
    """Result of the steps with another section.

    Attributes
    ----------
    point
        The last point.
    special
        The special points before it.
    step
        Length of the next step.
    end
        End of the branch at the point; None if it continues.
    """

    point: BranchPoint
    special: list[SpecialPoint]
    step: float
    end: End | None


def starts_at_event(orbit: Orbit) -> bool:
    """Return True if an event of an orbit coincides with the start of its period."""
    return _clearance(orbit) < AT_START


def pass_start(
    corrector: Corrector,
    point: BranchPoint,
    within: Range,
    options: WalkOptions,
    kinds: Sequence[Kind],
    change: Callable[[BranchPoint, BranchPoint], float],
) -> Passage | None:
    """Return steps from a point of a walk until the event at the start of the period has passed it.

    Parameters
    ----------
    corrector
        Corrector for the branch.
    point
        Point of the walk, with an event at the start of its period.
    within, options, change
        As of the walk.
    kinds
        Kinds of special points to detect.

    Returns
    -------
    Passage or None
        None if no event is at the start, or if no orbit is found beyond.
    """
    equation = corrector.equation
    if not isinstance(equation, ShootingEquation) or equation.options.segments > 1 or not starts_at_event(point.orbit):
        return None
    try:
        return _Section(corrector, equation, point).passage(within, options, kinds, change)
    except NumericalError:
        return None


class _Section:
    """Another section for the orbits near a point of a branch, and the way from one section to the other."""

    def __init__(self, corrector: Corrector, equation: ShootingEquation, point: BranchPoint) -> None:
        self._own, self._equation = corrector, equation
        self._posed = replace(equation, begin=_free_angle(point.orbit))
        self._corrector = Corrector(self._posed, corrector.scales)
        self._first = point

    def passage(self, within: Range, options: WalkOptions, kinds: Sequence[Kind], change: Callable) -> Passage:
        """Walk from the point until the state at theta = 0 is free; see `pass_start`."""
        options = replace(
            options,
            initial_step=_FIRST,
            smallest_step=min(options.smallest_step, 1e-9),
            largest_step=min(_LARGEST, options.largest_step),
            max_points=_STEPS,
        )
        begin = self._entered()
        walk, special = Walk(begin, within, self._corrector, options, change=change), list[SpecialPoint]()
        detector, before, last = Detector(self._corrector, kinds), None, begin
        for ahead in walk:
            found = detector.inspect(last, ahead, before)
            for text in unexplained(last, ahead, found):
                raise NumericalError(text)
            special += found
            before, last = last, ahead
            if _clearance(last.orbit) > _CLEAR:
                break
        if last is begin or (walk.end is not None and walk.end.reason.is_failure):
            raise ConvergenceError("no orbit is found beyond the event at the start of the period")
        found = [replace(each, point=self._at_zero(each.point)) for each in special]
        return Passage(self._left(last), found, walk.step, walk.end)

    def _entered(self) -> BranchPoint:
        """Return the first point with the other section."""
        first, scales = self._first, self._own.scales
        x = np.append(self._posed.unknowns(first.orbit), first.value) / scales
        along = self._carried(first.tangent, first.orbit.state, first.value, 0.0, self._posed.begin)
        correction = self._corrector.correct(x, along)
        if correction is None:
            raise ConvergenceError("the orbit is not found with the other section")
        return self._corrector.point(correction, along, first.arclength)

    def _left(self, point: BranchPoint) -> BranchPoint:
        """Return a point with its state at theta = 0, corrected there."""
        moved = self._at_zero(point)
        correction = self._own.correct(moved.x, moved.tangent)
        if correction is None or np.abs(correction.x - moved.x).max() > _SAME * max(1.0, np.abs(moved.x).max()):
            raise ConvergenceError("the orbit is not found with its state at theta = 0")
        return self._own.point(correction, moved.tangent, point.arclength)

    def _at_zero(self, point: BranchPoint) -> BranchPoint:
        """Return a point of the other section with its state at theta = 0."""
        full, scales = PERIOD * self._equation.period, self._own.scales
        along = self._carried(point.tangent, point.x[:-1] * scales[:-1], point.value, self._posed.begin, full)
        x = np.append(self._equation.unknowns(point.orbit), point.value) / scales
        return replace(point, x=x, tangent=along, memo={})

    def _carried(self, tangent: Vector, state: Vector, value: float, start: float, stop: float) -> Vector:
        """Return a scaled tangent at one angle as a unit tangent at a later one, for all segments that follow."""
        scales = self._own.scales
        change = tangent * scales
        moved = self._equation.carried(state, change, value, start, stop) / scales
        return moved / length_of(moved)


def _angles(orbit: Orbit) -> list[float]:
    """Return the angles of all events of an orbit; modes of friction that only go on at its start are none."""
    full = PERIOD * orbit.period
    found = [event.theta % full for event in orbit.events]
    for phases in orbit.friction.values():
        found += [phase.start % full for phase in phases if len(phases) > 1]
    return found


def _clearance(orbit: Orbit) -> float:
    """Return the angle between the start of the period and the nearest event."""
    full = PERIOD * orbit.period
    return min((min(theta, full - theta) for theta in _angles(orbit)), default=math.inf)


def _free_angle(orbit: Orbit) -> float:
    """Return the angle in the middle of the longest part of the period without events that does not hold its start."""
    angles = sorted([0.0, *_angles(orbit), PERIOD * orbit.period])
    start, stop = max(pairwise(angles), key=lambda pair: pair[1] - pair[0])
    return 0.5 * (start + stop)
