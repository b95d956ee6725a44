"""Walk over the points of one branch, by pseudo-arclength continuation (Keller 1977); tracing in both directions.

The walk is independent of files and display, of shooting and harmonic balance, and of bifurcations. It can be stopped
after any point and resumed from it. Every end has a reason.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Annotated, Any, Generic, Self, TypeVar

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from gapwalk.continuation.corrector import TRUST, Correction, Corrector, Range, ahead, hermite, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.bounds import Positive, check_fields

# Options of a walk, and the control of its step size.
#
# The step size is controlled after den Heijer and Rheinboldt (1981, SIAM J. Numer. Anal. 18, 925-948).

_LONGEST, _SHORTEST = 2.0, 0.4  # limits of the ratio of successive steps
GOAL = 0.6
"""Share of the largest allowed turn, or change, that a step aims at."""

_AtLeastTwo = Annotated[int, Ge(2)]


@dataclass(frozen=True, slots=True)
class WalkOptions:
    """Options of a walk along a branch. Steps are arclengths in scaled variables: the range has the width 1.

    Examples
    --------
    >>> short = gw.follow(orbit, "frequency", 1.6, walk=gw.WalkOptions(max_points=10))
    >>> short.ends[1].reason_words
    'the largest number of points was reached (max_points = 10)'
    """

    initial_step: Positive = 0.002  #: The first step; it is clipped to the two limits below.
    # not compared: it changes no point of a walk, so a walk begun with another value can be resumed
    smallest_step: Positive = field(default=1e-13, compare=False)  #: The step at which the walk gives up.
    largest_step: Positive = 0.01  #: The longest step.
    largest_turn: Positive = 0.35  #: The largest angle between the tangents at both ends of a step, in radians.
    iterations: _AtLeastTwo = 3  #: Newton iterations per step that the step-size control aims at.
    max_points: _AtLeastTwo = 20_000  #: Number of points after which the walk stops and reports that limit.

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.smallest_step <= self.largest_step:
            raise ModelError(
                f"the steps must satisfy smallest_step <= largest_step, but they are {self.smallest_step} and "
                f"{self.largest_step}"
            )

    @property
    def first_step(self) -> float:
        """First step of a walk, clipped to the smallest and the largest step."""
        return min(max(self.initial_step, self.smallest_step), self.largest_step)


def next_step(step: float, correction: Correction, turn: float, options: WalkOptions) -> float:
    """Return the step to try after an accepted step, before it is limited to the longest step."""
    # Two conditions limit it: the corrector should converge in `options.iterations`, and the tangent should not turn
    # too far.
    #
    # For the first, Newton's errors obey ``e_(j+1) = C e_j^2``, so with ``q = C e_0`` the last of k steps is about
    # ``e_0 q^(2^(k-1) - 1)``. This gives q, and from q the initial error from which the wanted number of steps would
    # reach the same accuracy: ``q^(2^(k - wanted) - 1)`` times the present one. The error of the tangent predictor
    # grows with the square of the step.
    taken, wanted = correction.iterations, options.iterations
    if taken < 2 or correction.last <= 0.0 or correction.last >= correction.distance:
        by_iterations = _LONGEST if taken <= wanted else _SHORTEST
    else:
        contraction = (correction.last / correction.distance) ** (1.0 / (2.0 ** (taken - 1) - 1.0))
        by_iterations = math.sqrt(contraction ** (2.0 ** (taken - wanted) - 1.0))
    by_turn = GOAL * options.largest_turn / max(turn, 1e-12)
    return step * min(_LONGEST, max(_SHORTEST, min(by_iterations, by_turn)))


def shorter_step(step: float) -> float:
    """Return the step to try after a failed step."""
    return step / 3.0


_ASIDE = 0.06  # largest angle, in radians, by which a chord may lie outside the tangents at its ends
_BENT = 1e-4  # below this step the branch may bend within a Newton step, which is then always evaluated
_BRIEF = 1e-3  # share of the longest step below which multipliers may jump: a contact law can cause that at a graze
_SHORT = 2e-8  # step at which a walk first stops if its caller can try another way to continue
_SHORTER = 0.1  # share of a shorter step that another method has left, at which it stops then
_FAR = 0.5  # distance from a guess, in steps, beyond which a point may lie on another branch
_NEAR = 0.01  # length of a Newton step, in steps of the walk, whose square is negligible against the branch's curvature
_SAME = 1e-6  # distance of two points that are the same
_SAME_WAY = 0.8  # cosine of the angle between tangents where a walk passes its origin
_GOOD = 0.1  # distance from a guess, in steps, within which another guess would lead to the same point


class Reason(Enum):
    """Reason why a curve ends; the value is the sentence that a user reads."""

    @property
    def is_final(self) -> bool:
        """True if a walk that ended for this reason cannot be continued."""
        return self.name not in ("STOPPED", "INTERRUPTED", "FAILED")

    @property
    def is_failure(self) -> bool:
        """True if a walk that ended for this reason reached neither an end of the curve nor of the range."""
        return self.name in ("FLOATING", "COARSE", "STEP", "WITHIN_ROUNDING", "POINTS", "FAILED")

    @classmethod
    def of(cls, reason: Reason) -> Self:
        """Return the member of the name of another reason; the end of the range where there is none."""
        return cls.__members__.get(reason.name) or cls.__members__["RANGE"]


class EndReason(Reason):
    """Reason why a branch ends; the value is the sentence that a user reads."""

    START = "the walk began here"
    RANGE = "the end of the range was reached"
    TABLE = "a load is not known beyond the end of its table"
    TURNED_BACK = (
        "the branch turned back and left the range on the side on which it had started; walk from the other end too"
    )
    CLOSED = "the branch closed on itself"
    BRANCHED = "the branch begins here, at a special point of another branch"
    JOINED = "the branch joined the branch from which it had branched off"
    AT_REST = "the motion shrinks to an equilibrium"
    CENTRE = "motions of all amplitudes exist at this one value, as about a centre"
    FLOATING = "a part floats freely within its clearance"
    GIVES_WAY = "friction that never slipped begins to slip to one side, so no motion beyond keeps its position"
    JUMPS = "the motion jumps, so that the branch ends"
    COARSE = "the motion needs more segments (shooting) or harmonics (harmonic balance)"
    STEP = "the step became smaller than the smallest allowed"
    WITHIN_ROUNDING = "the branch ends at a graze: beyond it the contact closes by less than rounding errors"
    POINTS = "the largest number of points was reached"
    STOPPED = "the walk was stopped before its end"
    INTERRUPTED = "the walk was interrupted"
    FAILED = "the numerics failed"
    SETTLED = "beyond, settled motions are computed at steps of the range"
    BEGINS = "the backbone begins here"
    AMPLITUDE = "the largest amplitude was reached"
    NO_SLOPE = "an equilibrium has no finite slope where a contact changes"
    NOT_ISOLATED = "the equilibria run along the point at which a contact changes, so that they are not isolated"
    CONTACTS = "more than 1000 contacts changed"


class AnyEnd:
    """End of a curve of any kind, in words."""

    __slots__ = ()
    reason: Any
    value: Any
    detail: Any

    @property
    def reason_words(self) -> str:
        """Reason with its details, as a sentence."""
        return f"{self.reason.value} ({self.detail})" if self.detail else self.reason.value

    @property
    def place(self) -> str:
        """Place of the end in words."""
        return f"{self.value:.8g}"

    def __str__(self) -> str:
        text = f"{self.reason.value}, at {self.place}"
        return f"{text} ({self.detail})" if self.detail else text


@dataclass(frozen=True, slots=True)
class End(AnyEnd):
    """Place and reason of the end of a branch."""

    reason: EndReason  #: The reason.
    value: float  #: Value of the parameter there.
    detail: str = ""  #: Further explanation; may be empty.


@dataclass(frozen=True, slots=True)
class WalkState:
    """Progress of a walk: its last points, the next step, and the number of points so far.

    Where the walk has not so many points, `previous` and `earlier`, the point before it, are None.
    """

    previous: BranchPoint | None
    point: BranchPoint
    step: float
    count: int
    earlier: BranchPoint | None = None


class Walk(Iterator[BranchPoint]):
    """Iterator over the points of one branch, from its first point on."""

    def __init__(
        self,
        first: BranchPoint,
        within: Range,
        corrector: Corrector,
        options: WalkOptions,
        resume: WalkState | None = None,
        trust: float = TRUST,
        branched: bool = False,
        change: Callable[[BranchPoint, BranchPoint], float] = lambda first, second: 0.0,
        twins: Callable[[], Sequence[NDArray[np.float64]]] = tuple,
        asks: bool = False,
    ) -> None:
        self.origin, self.within, self.corrector, self.options = first, within, corrector, options
        self.trust, self.branched, self.change = trust, branched, change
        self._find_twins = twins
        self._twins: list[NDArray[np.float64]] | None = None
        self._first_step = self._longest(first, options.first_step)
        state = resume or WalkState(None, first, self._first_step, 0)
        self.previous, self.point, self.step, self.count = state.previous, state.point, state.step, state.count
        self.earlier = state.earlier
        self.end: End | None = None
        self._stuck: End | None = None
        self.rejected = 0
        self._short = _SHORT if asks else 0.0
        self._least = max(options.smallest_step, self._short)

    @property
    def state(self) -> WalkState:
        """Progress so far: everything needed to continue from there."""
        return WalkState(self.previous, self.point, self.step, self.count, self.earlier)

    @property
    def is_stuck(self) -> bool:
        """True if the walk ended because its steps became too short, and nothing else is known of this end."""
        return self.end is not None and self.end is self._stuck

    def __next__(self) -> BranchPoint:
        if self.end is not None:
            raise StopIteration
        if self.count >= self.options.max_points:
            self.end = End(EndReason.POINTS, self.point.value, f"max_points = {self.options.max_points}")
            raise StopIteration
        point = self._advance()
        if point is None:
            raise StopIteration
        self.earlier, self.previous, self.point = self.previous, self.point, point
        self.count += 1
        return point

    def end_at(self, bound: float) -> End:
        """Return the end of the walk at a bound of its range."""
        ahead = (bound - self.origin.value) * self.origin.tangent[-1] > 0
        reason = EndReason.RANGE if ahead or self.branched else EndReason.TURNED_BACK
        table = self.within.table_at(bound)
        return End(EndReason.TABLE if table else reason, bound, table)

    def finish(self, last: BranchPoint, reason: EndReason, detail: str = "", value: float | None = None) -> None:
        """End the walk at a point before the one that was yielded last; the value is that of the point by default."""
        self.point, self.end = last, End(reason, last.value if value is None else value, detail)

    def persist(self) -> bool:
        """Continue with shorter steps where steps have become short; return False if they are the smallest allowed."""
        if self.step < self.options.smallest_step:
            return False
        self._least, self.end = self.options.smallest_step, None
        return True

    def go_on(self, state: WalkState, point: BranchPoint, step: float) -> None:
        """Continue from a point that another method has reached from a state, with the given next step."""
        self.earlier, self.previous, self.point, self.count = state.previous, state.point, point, state.count + 1
        self.step = min(step, self._longest(point, self.options.largest_step))
        least = self._short if self.step > self._short else _SHORTER * self.step  # it must be able to take the step
        self.end, self._least = None, max(self.options.smallest_step, least)

    def go_back(self, state: WalkState, rejected: BranchPoint) -> None:
        """Return to an earlier state because a point yielded after it was wrong, and continue with shorter steps."""
        self.earlier, self.previous, self.point = state.earlier, state.previous, state.point
        self.count, self.end = state.count, None
        self.step = shorter_step(rejected.arclength - state.point.arclength)
        self.rejected += 1

    def _advance(self) -> BranchPoint | None:
        """Return the next point; set `end` and return None if there is none."""
        while True:
            if self.step < self._least:
                detail = f"smallest_step = {self.options.smallest_step:g}; Newton's method no longer follows the branch"
                self.end = self._stuck = End(EndReason.STEP, self.point.value, detail)
                return None
            correction, point, turn = self._try_step()
            if correction is None or point is None:
                self.rejected += 1
                self.step = shorter_step(self.step)
                continue
            last = self._closing_point(point)
            if last is not None:
                self.end = End(EndReason.CLOSED, self.origin.value)
                return last
            if point.value not in self.within:
                return self._last_point(point)
            longest, change = self._longest(point, self.options.largest_step), self.change(self.point, point)
            if change > 1.0 and self.step > _BRIEF * longest:
                self.rejected += 1
                # aim below the limit: a step that aims at the limit itself approaches it from above, ever more slowly
                self.step *= max(GOAL / change, 1.0 / 3.0)
                continue
            turn = max(turn, self.options.largest_turn * change)
            self.step = min(next_step(self.step, correction, turn, self.options), longest)
            if self.step > 10.0 * self._short:
                self._least = max(self.options.smallest_step, self._short)
            return point

    def _longest(self, point: BranchPoint, share: float) -> float:
        """Return the step from a point that changes unknowns and parameter by no more than a share of their scales."""
        # The parameter is measured by the width of the range, or by less for small values: see `Range.nearness`.
        along = float(point.tangent[-1])
        width = self.within.width * self.within.nearness(point.value)
        across = math.sqrt(max(0.0, 1.0 - along * along))
        return share / math.hypot(across, along * float(self.corrector.scales[-1]) / width)

    def _weighed(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a difference of points, or a tangent, in the metric of angles and distances near the present point."""
        # The scale of the parameter is constant along the branch. In this metric, length and turn of a step do not
        # depend on that scale or on the range.
        weight = self.within.weight(self.point.value, float(self.corrector.scales[-1]))
        if weight == 1.0:
            return vector
        weighed = vector.copy()
        weighed[-1] *= weight
        return weighed

    def _tangent(self, point: BranchPoint) -> NDArray[np.float64]:
        """Return the tangent at a point, as a unit vector of that metric."""
        return _unit(self._weighed(point.tangent))

    def _try_step(self) -> tuple[Correction | None, BranchPoint | None, float]:
        """Return the correction from the best guess that leads to an acceptable point, the point, and its turn."""
        correction, point, turn = None, None, 0.0
        trust = self.trust * min(1.0, self.step / _BENT)
        for guess in ahead(self.earlier, self.previous, self.point, self.step):
            correction = self.corrector.correct(guess, self.point.tangent, trust, _NEAR * self.step)
            if correction is None:
                continue
            point, turn = self._accepted(correction, guess)
            if point is not None or correction.distance <= _GOOD * self.step:
                break
        return correction, point, turn

    def _accepted(self, correction: Correction, guess: NDArray[np.float64]) -> tuple[BranchPoint | None, float]:
        """Return the corrected point, and the angle by which the tangent turns in the step."""
        # The point is None if it may lie on another branch: too far away, or turned too much.
        chord = correction.x - self.point.x
        step = self.step * length_of(self._weighed(self.point.tangent))
        if length_of(self._weighed(correction.x - guess)) > _FAR * step:
            return None, 0.0
        point = self.corrector.point(correction, self.point.tangent, self.point.arclength + length_of(chord))
        first, last = self._tangent(self.point), self._tangent(point)
        turn = angle(first, last)
        if turn > self.options.largest_turn:
            return None, turn
        # on a smooth curve the chord lies between the two tangents; if not, the point is on another branch
        along = _unit(self._weighed(chord))
        if angle(first, along) + angle(along, last) > turn + _ASIDE:
            return None, 0.0
        return point, turn

    def _closing_point(self, point: BranchPoint) -> BranchPoint | None:
        """Return the origin of the walk, or a twin of it, if the step to `point` passes through it; None otherwise."""
        if self.point is self.origin or point.arclength < 4 * self._first_step:
            return None
        if point.tangent @ self.origin.tangent >= _SAME_WAY:
            place = self._beyond_branch_point(point) if self.branched else self.origin.x
            if place is not None and self._passed(point, place, self.origin.tangent) is not None:
                gap = length_of(self.origin.x - self.point.x)
                return replace(self.origin, arclength=self.point.arclength + gap, memo={})
        if self._twins is None:
            # twins that are the origin itself, as where a branch of twice the period begins, close nothing
            self._twins = [each for each in self._find_twins() if length_of(each - self.origin.x) > _SAME]
        for twin in self._twins:
            found = self._passed(point, twin, None)
            if found is not None:
                length = self.point.arclength + length_of(found.x - self.point.x)
                last = self.corrector.point(found, point.tangent, length)
                if (
                    last.tangent[-1] * self.origin.tangent[-1] > 0.0
                ):  # a branch that ends in a flip comes back otherwise
                    return last
        return None

    def _beyond_branch_point(self, point: BranchPoint) -> NDArray[np.float64] | None:
        """Return the solution a little beyond the origin: at a branch point itself Newton's method is singular."""
        ahead = 0.1 * length_of(point.x - self.point.x) * self.origin.tangent
        near = float((self.origin.x - self.point.x) @ (point.x - self.point.x)) > 0.0
        found = self.corrector.correct(self.origin.x + ahead, self.origin.tangent) if near else None
        return None if found is None else found.x

    def _passed(
        self, point: BranchPoint, place: NDArray[np.float64], normal: NDArray[np.float64] | None
    ) -> Correction | None:
        """Return the solution at a place if the step to `point` passes through it; the normal is the chord if None."""
        chord, gap = point.x - self.point.x, place - self.point.x
        length2 = float(chord @ chord)
        along = float(chord @ gap) / length2
        if not 0.0 < along <= 1.0 or length_of(gap - along * chord) > 0.3 * math.sqrt(length2):
            return None
        flat = chord / math.sqrt(length2) if normal is None else normal
        guess = hermite(self.point, point, along)  # from a chord Newton's method fails beside a sharp turn
        found = self.corrector.correct(guess - ((guess - place) @ flat) * flat, flat)
        return found if found is not None and length_of(found.x - place) < _SAME else None

    def _last_point(self, beyond: BranchPoint) -> BranchPoint | None:
        """Return the point of the branch at the limit that the step to `beyond` has passed."""
        bound = self.within.bound(beyond.value)
        share = (bound - self.point.value) / (beyond.value - self.point.value)
        correction = self.corrector.at_value(self.point.x + share * (beyond.x - self.point.x), bound)
        if correction is None:  # there is a fold in between: approach the limit in a shorter step
            self.step = shorter_step(self.step)
            return self._advance()
        self.end = self.end_at(bound)
        length = length_of(correction.x - self.point.x)
        if length == 0.0:
            return None
        return self.corrector.point(correction, self.point.tangent, self.point.arclength + length)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / length_of(vector)


def angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the angle between two unit vectors, in radians."""
    return 2.0 * math.asin(min(1.0, length_of(a - b) / 2.0))


D = TypeVar("D")
S = TypeVar("S", bound=tuple[Any, ...])
T = TypeVar("T", bound=Any)
R = TypeVar("R")
P = TypeVar("P")
F = TypeVar("F")


@dataclass(frozen=True)
class TracingState(Generic[S]):
    """Progress of a tracing: the state, the end and the steps of each direction that was begun."""

    states: tuple[Any, ...]
    ends: tuple[Any, ...]
    steps: tuple[tuple[S, ...], ...]


class Tracing(Iterator[S], Generic[D, T, S]):
    """Iterator over the steps of a curve, traced in each direction in which it leaves its start.

    A trace is an iterator over the steps in one direction. Its `end` is None while it continues; `is_closed` says that
    the curve has returned to its start; one that is made with its `state` resumes it.

    Attributes
    ----------
    steps
        The steps that each trace has yielded.
    """

    def __init__(
        self, beginnings: Sequence[D], begin: Callable[[D, Any], T], resume: TracingState[S] | None = None
    ) -> None:
        self._beginnings, self._begin = beginnings, begin
        self.traces: list[T] = []
        self.steps: list[list[S]] = []
        for state, end, steps in zip(resume.states, resume.ends, resume.steps, strict=True) if resume else ():
            self._begin_next(state, steps)
            if end is not None:
                self.traces[-1].end = end

    def to_end(self, record: Callable[[Any], R], report: Callable[..., object] | None = None) -> R:
        """Trace to the end, call `report` with the parts of each step, and return `record` of this tracing."""
        try:
            for step in self:
                if report is not None:
                    report(*step)
        except KeyboardInterrupt:
            if not self.traces:
                raise
            raise Interrupted(record(self)) from None
        return record(self)

    @property
    def state(self) -> TracingState[S]:
        """Progress so far: a tracing made with it as `resume` continues as if it had never been stopped."""
        return TracingState(
            tuple(trace.state for trace in self.traces),
            tuple(trace.end for trace in self.traces),
            tuple(map(tuple, self.steps)),
        )

    def __next__(self) -> S:
        while True:
            if self.traces:
                try:
                    step = next(self.traces[-1])
                except StopIteration:
                    if self.traces[-1].is_closed or len(self.traces) == len(self._beginnings):
                        raise
                else:
                    self.steps[-1].append(step)
                    return step
            self._begin_next(None, ())

    def _begin_next(self, state: Any, steps: Sequence[S]) -> None:
        self.traces.append(self._begin(self._beginnings[len(self.traces)], state))
        self.steps.append(list(steps))


def in_one_direction(
    walked: Sequence[Sequence[tuple[P, list[F]]]], first: P, turn: Callable[[P], P], turn_found: Callable[[F], F]
) -> tuple[tuple[P, ...], tuple[F, ...]]:
    """Join the steps of one or two traces into the points of a curve and the events between them."""
    *back, ahead = walked
    points, found = [first], []
    for steps in back:
        points = [*(turn(point) for point, _ in reversed(steps)), first]
        found = [turn_found(each) for _, before in reversed(steps) for each in reversed(before)]
    points += [point for point, _ in ahead]
    found += [each for _, before in ahead for each in before]
    return tuple(points), tuple(found)
