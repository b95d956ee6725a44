"""Follow an orbit along a parameter: the walk with its special points, as a finished branch or as it goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

from gapwalk.bifurcation.detect import Detector, DetectorState
from gapwalk.continuation.branch import Branch, SpecialPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Walk, WalkState, check_range, first_point, scales_of
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting, ShootingEquation

Step = tuple[BranchPoint, list[SpecialPoint]]
"""A new point of a branch, and the special points between it and the one before."""


def follow(
    orbit: Orbit,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    shooting: Shooting | None = None,
    report: Callable[[BranchPoint, list[SpecialPoint]], None] | None = None,
) -> Branch:
    """Follow a periodic orbit along one named parameter, around folds, with every special point on the way.

    Parameters
    ----------
    orbit
        The orbit to start from, as from `find_orbit`.
    parameter
        Name of the parameter, such as ``"frequency"`` or ``"stage2.clearance"``.
    to
        The value at which to stop; or two, between which the branch is followed in both directions.
    walk, shooting
        Options of the walk and of the method.
    report
        Called with each new point and the special points before it.

    Raises
    ------
    ModelError
        For an unknown parameter, or a range that does not hold the orbit.
    """
    start = orbit.system[parameter]
    sides = [Trail(orbit, parameter, to, direction, walk, shooting) for direction in directions(start, to)]
    walked = []
    for trail in sides:
        steps = []
        for point, special in trail:
            steps.append((point, special))
            if report is not None:
                report(point, special)
        walked.append(steps)
        if trail.end is not None and trail.end.reason is EndReason.CLOSED:
            break
    return _join(sides[: len(walked)], walked)


def directions(start: float, to: float | tuple[float, float]) -> tuple[int, ...]:
    """The directions, +1 or -1, in which a branch leaves its start to cover the range."""
    within = check_range(start, to)
    if isinstance(to, int | float):
        return (1,) if to > start else (-1,)
    return tuple(sign for sign, bound in ((-1, within.low), (1, within.high)) if bound != start)


class TrailState(NamedTuple):
    """Where a trail has come to: its walk and its detector."""

    walk: WalkState
    detector: DetectorState


class Trail(Iterator[Step]):
    """One direction of a branch as it is walked: yields each point with the special points before it.

    Parameters
    ----------
    orbit, parameter, to
        As in `follow`.
    direction
        +1 towards larger values of the parameter, -1 towards smaller ones.
    walk, shooting
        Options of the walk and of the method.
    resume
        `state` of a trail that was stopped.
    """

    def __init__(
        self,
        orbit: Orbit,
        parameter: str,
        to: float | tuple[float, float],
        direction: int,
        walk: WalkOptions | None = None,
        shooting: Shooting | None = None,
        resume: TrailState | None = None,
    ) -> None:
        start = orbit.system[parameter]
        within = check_range(start, to)
        for bound in (within.low, within.high):
            orbit.system.at({parameter: bound})  # refuses a range that leads where no system is
        equation = ShootingEquation(orbit.system, parameter, orbit.period, shooting or Shooting())
        corrector = Corrector(equation, scales_of(equation, orbit, within))
        self.first = first_point(equation, orbit, start, corrector, direction)
        self.walk = Walk(equation, self.first, within, corrector, walk or WalkOptions(), resume and resume.walk)
        self.detector = Detector(corrector)
        if resume is not None:
            self.detector.restore(resume.detector)

    @property
    def state(self) -> TrailState:
        """Where the trail has come to; a trail made with it as `resume` goes on as if never stopped."""
        return TrailState(self.walk.state, self.detector.state)

    @property
    def end(self) -> End | None:
        """Where and why the walk ended; None while it goes on."""
        return self.walk.end

    def __next__(self) -> Step:
        state = self.state
        before, first = self.walk.previous, self.walk.point
        while True:
            point = next(self.walk)
            try:
                return point, self.detector.inspect(first, point, before)
            except NumericalError:
                # no orbits lead from one point to the other: the step went astray, onto another branch
                self.detector.restore(state.detector)
                self.walk.go_back(state.walk, point)


def _join(trails: list[Trail], walked: list[list[Step]]) -> Branch:
    """One branch from its one or two trails, in one direction of travel."""
    equation = trails[0].walk.equation
    ends = [trail.end or End(EndReason.STOPPED, trail.walk.point.value) for trail in trails]
    first = trails[0].first
    points: list[BranchPoint] = [first]
    special: list[SpecialPoint] = []
    if len(trails) == 2:
        back = [point for point, _ in walked[0]]
        points = [_reversed(point) for point in reversed(back)] + [first]
        special = [_turned(each) for _, found in reversed(walked[0]) for each in reversed(found)]
    points += [point for point, _ in walked[-1]]
    special += [each for _, found in walked[-1] for each in found]
    if len(trails) == 1:
        ends = [End(EndReason.START, first.value), *ends]
    if equation.parameter is None:
        raise ModelError("a branch needs a parameter to follow")
    return Branch(equation.parameter, equation.period, tuple(points), tuple(special), tuple(ends))


def _reversed(point: BranchPoint) -> BranchPoint:
    return replace(point, tangent=-point.tangent, arclength=-point.arclength)


def _turned(special: SpecialPoint) -> SpecialPoint:
    return replace(special, point=_reversed(special.point), before=special.after, after=special.before)
