"""The walk: an iterator over the points of one branch, by pseudo-arclength continuation (Keller 1977).

It knows neither disk nor screen, neither shooting nor harmonic balance, and no bifurcations. It can be stopped after
any point and resumed from it. Every end has its reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
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
_BRIEF = 1e-3  # share of the longest step below which multipliers may jump: a law of contact may make them, at a graze
_SHORT = 2e-8  # step at which a walk first stops, so that its owner can look for another way on
_FAR = 0.5  # distance from a guess, in steps, beyond which a point may lie on another branch
_BEND = 1.3  # largest turn, in radians, at a bend
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
    FLOATING = "a part floats freely within its clearance"
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
        """Whether a walk ended so before it had come to an end of the branch or of the range."""
        return self in (EndReason.FLOATING, EndReason.COARSE, EndReason.STEP, EndReason.POINTS, EndReason.FAILED)


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


def unchanged(first: BranchPoint, second: BranchPoint) -> float:
    """No change: 0."""
    return 0.0


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
    change
        Tells how much two neighbouring points differ in what the unknowns do not show (multipliers, say), as a share of
        what a step may change; `unchanged` where that is nothing.
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
        change: Callable[[BranchPoint, BranchPoint], float] = unchanged,
    ) -> None:
        self.change = change
        self.equation, self.corrector, self.options, self.within = equation, corrector, options, within
        self.trust, self.branched = trust, branched
        self.origin = first
        self._first_step = self._longest(first, options.first_step)
        state = resume or WalkState(None, first, self._first_step, 0)
        self.previous, self.point, self.step, self.count = state.previous, state.point, state.step, state.count
        self.end: End | None = None
        self.rejected = 0
        self._least = max(options.smallest_step, _SHORT)

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

    def persist(self) -> bool:
        """Go on with shorter steps where steps have become short; False if they are the smallest allowed."""
        if self.step < self.options.smallest_step:
            return False
        self._least, self.end = self.options.smallest_step, None
        return True

    def go_on(self, state: WalkState, point: BranchPoint, step: float) -> None:
        """Go on from a point that was reached from a state in another way, with the next step as given."""
        self.previous, self.point, self.step = (
            state.point,
            point,
            min(step, self._longest(point, self.options.largest_step)),
        )
        self.count = state.count + 1
        self.end, self._least = None, max(self.options.smallest_step, _SHORT)

    def go_back(self, state: WalkState, rejected: BranchPoint) -> None:
        """Return to an earlier state because a point yielded after it proved wrong, and go on with shorter steps."""
        self.previous, self.point, self.count = state.previous, state.point, state.count
        self.step = shorter_step(rejected.arclength - state.point.arclength)
        self.end = None
        self.rejected += 1

    def _advance(self) -> BranchPoint | None:
        """The next point; None, with `end` set, if there is none."""
        while True:
            if self.step < self._least:
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
            longest, change = self._longest(point, self.options.largest_step), self.change(self.point, point)
            if change > 1.0 and self.step > _BRIEF * longest:
                self.rejected += 1
                self.step *= max(1.0 / change, 1.0 / 3.0)
                continue
            turn = max(_angle(self._tangent(self.point), self._tangent(point)), self.options.largest_turn * change)
            self.step = min(next_step(self.step, correction, turn, self.options), longest)
            if self.step > 10.0 * _SHORT:
                self._least = max(self.options.smallest_step, _SHORT)
            return point

    def _longest(self, point: BranchPoint, share: float) -> float:
        """The step from a point that changes the unknowns by a share of their scales, and the parameter by no more.

        The parameter is measured by the range, but not beyond where its values are far apart: see `Range.nearness`.
        """
        along = float(point.tangent[-1])
        width = self.within.width * self.within.nearness(point.value)
        across = math.sqrt(max(0.0, 1.0 - along * along))
        return share / math.hypot(across, along * float(self.corrector.scales[-1]) / width)

    def _weighed(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """A difference of points, or a tangent, in the measure of angles and distances near the present point.

        The scale of the parameter is one for the whole branch; in this measure the same step is as long, and turns as
        far, whatever that scale and the range are.
        """
        weight = self.within.weight(self.point.value, float(self.corrector.scales[-1]))
        if weight == 1.0:
            return vector
        weighed = vector.copy()
        weighed[-1] *= weight
        return weighed

    def _tangent(self, point: BranchPoint) -> NDArray[np.float64]:
        """The tangent at a point, as a unit vector of that measure."""
        return _unit(self._weighed(point.tangent))

    def bent_step(self, step: float) -> BranchPoint | None:
        """The point a short step ahead where the branch may have a bend on the way; None if there is none."""
        self.step = step
        return self._try_step(_BEND, math.tan(_BEND))[1]

    def _try_step(self, turn: float | None = None, far: float = _FAR) -> tuple[Correction | None, BranchPoint | None]:
        """The correction from the best guess that leads to an acceptable point, and the point."""
        correction = point = None
        trust = self.trust * min(1.0, self.step / _BENT)
        for guess in ahead(self.previous, self.point, self.step):
            correction = self.corrector.correct(guess, self.point.tangent, trust, _NEAR * self.step)
            if correction is None:
                continue
            point = self._accepted(correction, guess, turn or self.options.largest_turn, far)
            if point is not None or correction.distance <= _GOOD * self.step:
                break
        return correction, point

    def _accepted(
        self, correction: Correction, guess: NDArray[np.float64], largest_turn: float, far: float
    ) -> BranchPoint | None:
        """The corrected point, unless it may lie on another branch: too far off, or turned too much."""
        chord = correction.x - self.point.x
        step = self.step * length_of(self._weighed(self.point.tangent))
        if length_of(self._weighed(correction.x - guess)) > far * step:
            return None
        point = self.corrector.point(correction, self.point.tangent, self.point.arclength + length_of(chord))
        first, last = self._tangent(self.point), self._tangent(point)
        turn = _angle(first, last)
        if turn > largest_turn:
            return None
        # on a smooth curve the chord lies between the tangents; off to one side, the point is on another branch
        along = _unit(self._weighed(chord))
        if _angle(first, along) + _angle(along, last) > turn + _ASIDE:
            return None
        return point

    def _closes(self, point: BranchPoint) -> bool:
        """Whether the step to `point` passes through the walk's origin."""
        if self.point is self.origin or point.arclength < 4 * self._first_step:
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


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / length_of(vector)


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Angle between two unit vectors, in radians."""
    return 2.0 * math.asin(min(1.0, length_of(a - b) / 2.0))
