"""The walk: an iterator over the points of one branch, by pseudo-arclength continuation (Keller 1977).

It knows neither disk nor screen, neither shooting nor harmonic balance, and no bifurcations. It can be stopped after
any point and resumed from it. Every end has its reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import TRUST, Correction, Corrector, length_of
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.predictor import ahead
from gapwalk.continuation.range import Range
from gapwalk.continuation.step import next_step, shorter_step
from gapwalk.orbit.equation import Equation

_ASIDE = 0.06  # largest angle, in radians, by which a chord may lie outside the tangents at its ends
_BENT = 1e-4  # steps shorter than that tell of a branch that bends within a Newton step, which is then looked at
_NEAR = 0.01  # length of a Newton step, in steps of the walk, whose square is nothing beside the bend of the branch
_GOOD = 0.1  # distance from a guess, in steps, within which another guess would lead to the same point


class EndReason(Enum):
    """Why a branch ends; the value is the sentence that a user reads."""

    START = "the walk began here"
    RANGE = "the end of the range was reached"
    TURNED_BACK = "the branch turned round and left the range on the side on which it had started"
    CLOSED = "the branch closed on itself"
    BRANCHED = "the branch begins here, at a special point of another"
    JOINED = "the branch joined the one that it branches off from"
    COARSE = "the motion needs to be resolved more finely"
    STEP = "the step became smaller than the smallest allowed"
    POINTS = "the largest number of points was reached"
    STOPPED = "the walk was stopped before its end"
    INTERRUPTED = "the walk was interrupted"
    FAILED = "the numerics failed"

    @property
    def is_final(self) -> bool:
        """Whether a walk that ended so cannot go on."""
        return self not in (EndReason.STOPPED, EndReason.INTERRUPTED, EndReason.FAILED)

    @property
    def is_failure(self) -> bool:
        """Whether a walk ended so because the numerics gave up."""
        return self in (EndReason.COARSE, EndReason.STEP, EndReason.FAILED)


@dataclass(frozen=True, slots=True)
class End:
    """Where and why a branch ends."""

    reason: EndReason
    value: float
    detail: str = ""

    def __str__(self) -> str:
        text = f"{self.reason.value}, at {self.value:.8g}"
        return f"{text} ({self.detail})" if self.detail else text


@dataclass(frozen=True, slots=True)
class WalkState:
    """Where a walk has come to: its last two points, the next step, and the number of points so far."""

    previous: BranchPoint | None
    point: BranchPoint
    step: float
    count: int


class Walk(Iterator[BranchPoint]):
    """Walks one branch, from its first point onwards.

    Parameters
    ----------
    equation
        The equation whose solutions form the branch.
    first
        The point to start from, as from `first_point`; it is not yielded.
    within
        Range of the parameter.
    corrector
        Corrects onto the branch.
    options
        Steps.
    resume
        Where a walk that was stopped had come to: it goes on as if it had never been stopped.
    trust
        Residual from which the next Newton step is exact to rounding; 0 where the derivatives are approximate.
    branched
        Whether the branch begins at a special point of another one, perhaps across the parameter: then it has no side
        of the range to turn back to.
    """

    def __init__(
        self,
        equation: Equation,
        first: BranchPoint,
        within: Range,
        corrector: Corrector,
        options: WalkOptions,
        resume: WalkState | None = None,
        trust: float = TRUST,
        branched: bool = False,
    ) -> None:
        self.equation, self.corrector, self.options, self.within = equation, corrector, options, within
        self.trust, self.branched = trust, branched
        self.origin = first
        state = resume or WalkState(None, first, self._bounded(first, options.first_step), 0)
        self.previous, self.point, self.step, self.count = state.previous, state.point, state.step, state.count
        self.end: End | None = None
        self.rejected = 0

    @property
    def state(self) -> WalkState:
        """Where the walk has come to: all that is needed to go on from there."""
        return WalkState(self.previous, self.point, self.step, self.count)

    def __next__(self) -> BranchPoint:
        if self.end is not None:
            raise StopIteration
        if self.count >= self.options.max_points:
            self.end = End(EndReason.POINTS, self.point.value, f"max_points = {self.options.max_points}")
            raise StopIteration
        point = self._advance()
        if point is None:
            raise StopIteration
        self.previous, self.point = self.point, point
        self.count += 1
        return point

    def finish(self, last: BranchPoint, end: End) -> None:
        """End the walk at a point before the one that was yielded last."""
        self.point, self.end = last, end

    def go_back(self, state: WalkState, rejected: BranchPoint) -> None:
        """Return to an earlier state because a point yielded after it proved wrong, and go on with shorter steps."""
        self.previous, self.point, self.count = state.previous, state.point, state.count
        self.step = shorter_step(rejected.arclength - state.point.arclength)
        self.end = None
        self.rejected += 1

    def _advance(self) -> BranchPoint | None:
        """The next point; None, with `end` set, if there is none."""
        while True:
            if self.step < self.options.smallest_step:
                detail = f"smallest_step = {self.options.smallest_step:g}; Newton's method no longer follows the branch"
                self.end = End(EndReason.STEP, self.point.value, detail)
                return None
            correction, point = self._try_step()
            if correction is None or point is None:
                self.rejected += 1
                self.step = shorter_step(self.step)
                continue
            if self._closes(point):
                self.end = End(EndReason.CLOSED, self.origin.value)
                return self._closing_point()
            if point.value not in self.within:
                return self._last_point(point)
            step = next_step(self.step, correction, _angle(self.point.tangent, point.tangent), self.options)
            self.step = self._bounded(point, step)
            return point

    def _bounded(self, point: BranchPoint, step: float) -> float:
        """A step from a point, as far as the parameter may change there: see `Range.nearness`."""
        along = abs(float(point.tangent[-1]))
        longest = self.options.largest_step * self.within.nearness(point.value)
        return longest / along if step * along > longest else step

    def _try_step(self) -> tuple[Correction | None, BranchPoint | None]:
        """The correction from the best guess that leads to an acceptable point, and the point."""
        correction = point = None
        trust = self.trust * min(1.0, self.step / _BENT)
        for guess in ahead(self.previous, self.point, self.step):
            correction = self.corrector.correct(guess, self.point.tangent, trust, _NEAR * self.step)
            if correction is None:
                continue
            point = self._accepted(correction)
            if point is not None or correction.distance <= _GOOD * self.step:
                break
        return correction, point

    def _accepted(self, correction: Correction) -> BranchPoint | None:
        """The corrected point, unless it may lie on another branch: too far off, or turned too much."""
        chord = correction.x - self.point.x
        length = length_of(chord)
        if correction.distance > 0.5 * self.step:
            return None
        point = self.corrector.point(correction, self.point.tangent, self.point.arclength + length)
        turn = _angle(self.point.tangent, point.tangent)
        if turn > self.options.largest_turn:
            return None
        # on a smooth curve the chord lies between the tangents; off to one side, the point is on another branch
        along = chord / length
        if _angle(self.point.tangent, along) + _angle(along, point.tangent) > turn + _ASIDE:
            return None
        return point

    def _closes(self, point: BranchPoint) -> bool:
        """Whether the step to `point` passes through the walk's origin."""
        if self.point is self.origin or point.arclength < 4 * self.options.first_step:
            return False
        chord, gap = point.x - self.point.x, self.origin.x - self.point.x
        length2 = float(chord @ chord)
        along = float(chord @ gap) / length2
        if not 0.0 < along <= 1.0 or point.tangent @ self.origin.tangent < 0.8:
            return False
        if length_of(gap - along * chord) > 0.3 * np.sqrt(length2):
            return False
        flat = self.origin.tangent
        guess = self.point.x + along * chord
        meeting = self.corrector.correct(guess - ((guess - self.origin.x) @ flat) * flat, flat)
        return meeting is not None and length_of(meeting.x - self.origin.x) < 1e-6

    def _closing_point(self) -> BranchPoint:
        gap = length_of(self.origin.x - self.point.x)
        o = self.origin
        return BranchPoint(o.value, o.orbit, o.x, o.tangent, o.determinant, self.point.arclength + gap)

    def _last_point(self, beyond: BranchPoint) -> BranchPoint | None:
        """The point of the branch on the bound that the step to `beyond` has passed."""
        bound = self.within.bound(beyond.value)
        ahead = (bound - self.origin.value) * self.origin.tangent[-1] > 0
        reason = EndReason.RANGE if ahead or self.branched else EndReason.TURNED_BACK
        share = (bound - self.point.value) / (beyond.value - self.point.value)
        correction = self.corrector.at_value(self.point.x + share * (beyond.x - self.point.x), bound)
        if correction is None:  # a fold lies between: come nearer in a shorter step
            self.step = shorter_step(self.step)
            return self._advance()
        self.end = End(reason, bound)
        length = length_of(correction.x - self.point.x)
        if length == 0.0:
            return None
        return self.corrector.point(correction, self.point.tangent, self.point.arclength + length)


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Angle between two unit vectors, in radians."""
    return 2.0 * math.asin(min(1.0, length_of(a - b) / 2.0))
