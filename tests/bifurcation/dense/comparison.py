"""One walk beside another with smaller steps: which special points only one of them has."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gapwalk import Branch, Orbit, SpecialPoint, WalkOptions, follow
from gapwalk.continuation.walk import EndReason

FINER = 20
SAME = 1e-6  # distance in scaled variables within which two special points are the same
LAST = 0.01  # arclength before the end of a walk that ran out of points, within which the other may know more


@dataclass(frozen=True)
class Comparison:
    """What came of walking one branch twice."""

    name: str  #: Which branch.
    missing: list[str] = field(default_factory=list)  #: Special points that only the walk with small steps has.
    invented: list[str] = field(default_factory=list)  #: Those that only the one with default steps has.
    shared: int = 0  #: How many both have.
    apart: float = 0.0  #: Largest difference of a value that both have.
    points: int = 0  #: Points of the walk with default steps.
    fine_points: int = 0  #: Points of the one with small steps.
    ends: list[str] = field(default_factory=list)  #: How they ended.
    note: str = ""  #: Why there is nothing to compare, if there is not.

    @property
    def agrees(self) -> bool:
        """Whether no special point is missing, none invented, and both walks went the same way."""
        return not self.missing and not self.invented and (not self.ends or self.ends[0] == self.ends[1])

    def __str__(self) -> str:
        if self.note:
            return self.note
        text = f"{self.shared} special points, {self.apart:.0e} apart, {self.points} points and {self.fine_points}"
        for what, found in (("missing", self.missing), ("invented", self.invented)):
            text += "".join(f"\n    {what}: {each}" for each in found)
        return text if len(set(self.ends)) < 2 else f"{text}\n    ends: {self.ends}"


def compare_walks(name: str, start: Orbit, parameter: str, to: float, max_points: int = 20_000) -> Comparison:
    """Follow a branch at default settings and with steps 20 times smaller, and compare their special points."""
    steps = WalkOptions(max_points=max_points)
    one, other = (follow(start, parameter, to, walk=walk) for walk in (steps, _finer(steps)))
    mine, its = list(one.special_points), list(other.special_points)
    shared, apart = 0, 0.0
    for special in one.special_points:
        twin = min(its, key=lambda each: _distance(each, special), default=None)
        if twin is not None and _distance(twin, special) < SAME:
            shared, apart = shared + 1, max(apart, abs(twin.value - special.value))
            mine.remove(special)
            its.remove(twin)
    ends = [branch.ends[-1].reason for branch in (one, other)]
    if EndReason.POINTS in ends:
        mine, its, ends = _before_end_of(other, one, mine), _before_end_of(one, other, its), [EndReason.POINTS] * 2
    return Comparison(
        name,
        [_describe(each) for each in its],
        [_describe(each) for each in mine],
        shared,
        apart,
        len(one.points),
        len(other.points),
        [reason.value for reason in ends],
    )


def _finer(steps: WalkOptions) -> WalkOptions:
    return replace(
        steps,
        initial_step=steps.initial_step / FINER,
        largest_step=steps.largest_step / FINER,
        max_points=steps.max_points * FINER,
    )


def _before_end_of(other: Branch, branch: Branch, special: list[SpecialPoint]) -> list[SpecialPoint]:
    """Special points of a branch that come before the place where another walk along it ended."""
    if other.points[-1].arclength > branch.points[-1].arclength:
        return special
    last = other.points[-1].x
    near = [point for point in branch.points if abs(point.arclength - other.points[-1].arclength) < 0.1]
    end = min(near, key=lambda point: float(np.linalg.norm(point.x - last)))
    return [each for each in special if each.point.arclength < end.arclength - LAST]


def _distance(a: SpecialPoint, b: SpecialPoint) -> float:
    """Distance of two special points in scaled variables; infinite if they are not of one kind."""
    if (a.kind, a.contact) != (b.kind, b.contact):
        return float("inf")
    return float(np.linalg.norm(a.point.x - b.point.x))


def _describe(special: SpecialPoint) -> str:
    return f"{special!r} arclength {special.point.arclength:.9g}"
