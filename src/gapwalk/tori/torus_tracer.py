"""Tracer of a family of tori in one direction, with resolution by need, events, and reasons for its end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np

from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason, Walk, WalkState
from gapwalk.tori.closed_curve import odd, resampled, tail, tangents
from gapwalk.tori.locked_window import LockedWindow
from gapwalk.tori.resonance_leap import FEW, MANY, NEXT, Stride, Strides, far_from_fractions, posed_with
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_ends import DENOMINATOR, halved, has_shrunk, locked, resonance_near, rough, shrunk, vanished
from gapwalk.tori.torus_events import events_between, events_in_leap, simplest, window_at
from gapwalk.tori.torus_family import TorusEnd, TorusEndReason, TorusEvent, TorusEventKind, TorusPoint
from gapwalk.tori.torus_solution import TorusOptions
from gapwalk.tori.torus_start import TorusStart, equation_of, start_beyond, torus_at

_MUCH = 1e-2  # share of the accuracy below which a torus has more samples than it needs
_TAIL = 0.1  # tail of its series, over the accuracy, with which it has enough: the error is some 100 times smaller
_GROWN = 5.0  # growth of a curve beyond which its reference is another
_STILL = 1e-7  # change of the parameter in a step, over the largest so far, that counts as none
_ALIGNED = 0.5  # cosine between the tangents of a curve and of its reference below which the phase is fixed again
_SHORTEST = 1e-3  # step, as a share of the longest, to which the end of smoothness is located
_SHORT = 0.3  # step, over a good one, at which a leap over a resonance is tried
_SHORTER = 0.2  # factor on the step after which it is tried again
_AHEAD = (0.1, 0.3, 1.0, 3.0)  # places ahead at which locked motions are looked for, in good steps
_REASONS = {
    EndReason.RANGE: TorusEndReason.RANGE,
    EndReason.TURNED_BACK: TorusEndReason.RANGE,
    EndReason.TABLE: TorusEndReason.RANGE,
    EndReason.CLOSED: TorusEndReason.CLOSED,
    EndReason.POINTS: TorusEndReason.POINTS,
    EndReason.STEP: TorusEndReason.STEP,
}

Step = tuple[TorusPoint, list[TorusEvent]]


class TorusTracer(Iterator[Step]):
    """Iterator over the tori of a family in one direction."""

    def __init__(self, beginning: TorusStart, walk: WalkOptions, options: TorusOptions) -> None:
        fine, first = beginning.fineness, walk.first_step
        walk = replace(walk, initial_step=fine * first, smallest_step=fine * walk.smallest_step) if fine < 1.0 else walk
        self.beginning, self.options, self.steps = beginning, options, walk
        self.corrector, self._moved = beginning.corrector, 0.0
        self._strides = Strides(beginning.within, options, walk.largest_step)
        self._leaping: Stride | None = None  # the step that leaps continue, as long as they succeed
        self._halving = False  # True if the last step has halved the size of the torus, where others fail
        self._untried = np.inf  # step below which a leap has not been tried since the last good step
        self.end: TorusEnd | None = None
        self.walk = self._walk_from(WalkState(None, beginning.first, walk.first_step, 0))
        self._pose_again(self.walk.state, beginning.first)

    @property
    def is_closed(self) -> bool:
        """True if the family has closed on itself."""
        return self.end is not None and self.end.reason is TorusEndReason.CLOSED

    @property
    def end_so_far(self) -> TorusEnd:
        """The end; that it was stopped if it has none yet."""
        point = self.walk.point
        return self.end or TorusEnd(TorusEndReason.STOPPED, point.value, torus_at(point).rotation)

    def __next__(self) -> Step:
        while True:
            if self.end is not None:
                raise StopIteration
            state = self.walk.state
            leapt = self._leap_on(state.point) if self._leaping is not None else None
            if leapt is None and self._halving:
                leapt = self._halve(state.point)
            if leapt is None and self._is_short(state):
                leapt = self._pass(state, FEW)
            if leapt is not None:
                return leapt
            self._place_step(state)
            try:
                point = next(self.walk)
            except StopIteration:
                leapt = self._ended(state)
                if leapt is None:
                    raise
                return leapt
            torus = torus_at(point)
            if has_shrunk(state.point, point):
                self.end = shrunk(state.point, point, equation_of(self.corrector).parameter)
            elif (past := self._past_second(state.point, point)) is not None:
                self.end = past
            elif (ratio := self._creeps_to(state.point, point)) is not None:
                leapt = self._lock(state.point, ratio, self._window(state.point, ratio))
                if leapt is not None:
                    return leapt
            elif not self.options.accepts(torus):
                leapt = self._refine(state, point)
                if leapt is not None:
                    return leapt
            else:
                break
        if self.end is not None:
            raise StopIteration
        self._strides.add(Stride(self.corrector, state.point, point, point.arclength - state.point.arclength))
        events = events_between(state.point, point, self.corrector, self.beginning.within)
        self._pose_again(self.walk.state, point)
        return TorusPoint(point.value, torus, point.arclength), events

    def _walk_from(self, state: WalkState) -> Walk:
        return Walk(state.point, self.beginning.within, self.corrector, self.steps, state, trust=0.0, branched=True)

    def _place_step(self, state: WalkState) -> None:
        """Vary the next step a little, so that its torus is not next to a resonance."""
        if self.beginning.second is None:
            self.walk.step = far_from_fractions(state.step, state.earlier, state.previous, state.point, self.corrector)

    def _is_short(self, state: WalkState) -> bool:
        """Return True if steps have become short, or much shorter since a leap was tried."""
        good = self._strides.good
        if good is None or state.step >= _SHORT * good.length:
            self._untried = np.inf
            return False
        return state.step < self._untried

    def _pose_again(self, state: WalkState, point: BranchPoint) -> None:
        """Pose the equation again if the curve has moved far from its reference, or has more samples than it needs."""
        torus = torus_at(point)
        if torus.error < _MUCH * self.options.accuracy and torus.count > self.options.samples:
            fewer = self._enough(torus)
            if fewer < torus.count:
                self._pose(point, fewer, state)
                return
        equation = equation_of(self.corrector)
        unit = equation.system.state_scales()
        old, new = tangents(equation.reference / unit).ravel(), tangents(torus.states / unit).ravel()
        cosine = float(old @ new) / float(np.linalg.norm(old) * np.linalg.norm(new))
        grown = float(np.linalg.norm(new) / np.linalg.norm(old))
        if cosine < _ALIGNED or not 1.0 / _GROWN < grown < _GROWN:
            self._pose(point, torus.count, state)

    def _enough(self, torus: Torus) -> int:
        """Return the number of samples, two thirds of the present ones or fewer, with which a curve is accurate."""
        unit, count = torus.system.state_scales(), torus.count
        while True:
            fewer = max(odd(2 * count // 3), odd(self.options.samples - 1))
            if fewer >= count or tail(resampled(torus.states, fewer) / unit) > _TAIL * self.options.accuracy:
                return count
            count = fewer

    def _pose(self, point: BranchPoint, count: int, state: WalkState) -> bool:
        """Pose the equation with another number of samples, or reference, and continue at a point; return if it did."""
        posed = posed_with(self.corrector, point, count, self.beginning.within)
        if posed is None:
            return False
        self.corrector, lifted = posed
        self.walk = self._walk_from(WalkState(None, lifted, state.step, state.count))
        return True

    def _past_second(self, last: BranchPoint, beyond: BranchPoint) -> TorusEnd | None:
        """Return the end of a family whose second parameter has left its range; None if it has not."""
        second = self.beginning.second
        if second is None or torus_at(beyond).system[second.name] in second.within:
            return None
        torus = torus_at(last)
        words = f"{second.name} = {torus.system[second.name]:.8g} is near the end of its range"
        return TorusEnd(TorusEndReason.RANGE, last.value, torus.rotation, words)

    def _near_resonance(self, torus: Torus) -> Fraction | None:
        """Return the resonance next to a torus; None if there is none, or the rotation number is kept."""
        return resonance_near(torus.rotation) if self.beginning.second is None else None

    def _resonance_ahead(self, torus: Torus) -> Fraction | None:
        """Return the strongest resonance that a few good steps would pass; None if there is none."""
        good = self._strides.good
        if good is None or good.turned == 0.0 or self.beginning.second is not None:
            return None
        return simplest(*sorted((torus.rotation, torus.rotation + FEW[-1] * good.turned)))

    def _creeps_to(self, before: BranchPoint, after: BranchPoint) -> Fraction | None:
        """Return the fraction that the rotation number approaches while the parameter stands still; None otherwise."""
        moved = abs(after.value - before.value)
        if moved > _STILL * self._moved:
            self._moved = max(self._moved, moved)
            return None
        first, last = torus_at(before).rotation, torus_at(after).rotation
        near = self._near_resonance(torus_at(after))
        return near if near is not None and abs(last - near) < abs(first - near) else None

    def _refine(self, state: WalkState, rejected: BranchPoint) -> Step | None:
        """Return to a state with more samples, or with a shorter step if they are the most.

        A resonance may be in the way: leap over it and return the step, or end if nothing helps.
        """
        if state.step < self._untried and not torus_at(rejected).grazes:
            leapt = self._pass(state, FEW)
            if leapt is not None:
                return leapt
        more = self.options.finer(torus_at(state.point).count)
        if more is not None and self._pose(state.point, more, state):
            return None
        if more is None and rejected.arclength - state.point.arclength > _SHORTEST * self.steps.largest_step:
            self.walk.go_back(state, rejected)
            return None
        leapt = self._pass(state, MANY)
        if leapt is None:
            self.end = self._locked_beside(state.point) or rough(
                state.point, torus_at(rejected), self._crept(state.point)
            )
        return leapt

    def _locked_beside(self, last: BranchPoint) -> TorusEnd | None:
        """Return the end of a family whose last torus is in a window of locked motions, or next to one; else None."""
        for ratio in (self._near_resonance(torus_at(last)), self._crept(last), self._resonance_ahead(torus_at(last))):
            window = None if ratio is None else self._window(last, ratio)
            if ratio is not None and window is not None and window.distance(last.value) <= window.width:
                return locked(last, ratio, window)
        return None

    def _crept(self, last: BranchPoint) -> Fraction | None:
        """Return the simplest fraction to which the rotation number has come since the last good step; None if none."""
        good = self._strides.good
        if good is None or self.beginning.second is not None:
            return None
        low, high = sorted((torus_at(good.end).rotation, torus_at(last).rotation))
        return simplest(low, high) if low < high else None

    def _pass(self, state: WalkState, lengths: tuple[float, ...]) -> Step | None:
        """Return the step over a resonance, by a leap, or from the motion beyond a locked window; None if none is."""
        self._untried = _SHORTER * state.step
        leap = self._strides.leap(state.point, equation_of(self.corrector).count, lengths)
        if leap is not None:
            return self._leapt(state.point, leap)
        near = self._resonance_ahead(torus_at(state.point))
        if near is None or (lengths is FEW and near.denominator > DENOMINATOR):
            return None
        return self._past_window(state.point, near, self._window(state.point, near))

    def _leap_on(self, last: BranchPoint) -> Step | None:
        """Return the next leap after one that succeeded; None if there is none, and steps are taken again."""
        before, self._leaping = self._leaping, None
        assert before is not None
        leap = self._strides.leap_from(self.corrector, last, before, last, NEXT)
        return None if leap is None else self._leapt(last, leap)

    def _leapt(self, last: BranchPoint, leap: Stride) -> Step:
        """Continue at the end of a leap, and return the step with what happened on the way."""
        events = events_in_leap(last, leap.end, self.corrector, self.beginning.within)
        self.corrector, self._leaping, self._untried = leap.corrector, leap, np.inf
        self._strides.restart(leap)
        self.walk = self._walk_from(WalkState(None, leap.end, leap.length, self.walk.state.count + 1))
        self._pose_again(self.walk.state, leap.end)
        return TorusPoint(leap.end.value, torus_at(leap.end), leap.end.arclength), events

    def _halve(self, last: BranchPoint) -> Step | None:
        """Return the step to a torus of half the size, and record the end if they shrink; None if there is none."""
        point = halved(last, self.corrector)
        self._halving = point is not None
        if point is None:
            return None
        self.end = vanished(last, point, equation_of(self.corrector).parameter)
        self.walk = self._walk_from(WalkState(None, point, self.walk.step, self.walk.state.count + 1))
        events = events_between(last, point, self.corrector, self.beginning.within)
        return TorusPoint(point.value, torus_at(point), point.arclength), events

    def _window(self, last: BranchPoint, ratio: Fraction) -> LockedWindow | None:
        """Return the locked motions at the last torus, or ahead of it; None if none are found."""
        good = self._strides.good
        ahead = 0.0 if good is None else good.end.value - good.start.value
        for value in (last.value, *(last.value + share * ahead for share in _AHEAD)):
            if value in self.beginning.within:
                window = window_at(last, ratio, value, self.corrector, self.beginning.within)
                if window is not None:
                    return window
        return None

    def _lock(self, last: BranchPoint, ratio: Fraction, window: LockedWindow | None) -> Step | None:
        """Continue beyond a window in which the motion locks, and return the first step there; else record the end."""
        leapt = self._past_window(last, ratio, window)
        if leapt is None:
            self.end = locked(last, ratio, window)
        return leapt

    def _past_window(self, last: BranchPoint, ratio: Fraction, window: LockedWindow | None) -> Step | None:
        """Return the first step beyond a window in which the motion locks; None if no torus is found there."""
        good = self._strides.good
        way = 0.0 if good is None else float(np.sign(good.end.value - good.start.value))
        if window is None or good is None or not way:
            return None
        parameter, within = equation_of(self.corrector).parameter, self.beginning.within
        beyond = start_beyond(torus_at(last), window, parameter, way, within, last.value, self.options)
        if beyond is None:
            return None
        self.corrector, self._moved = beyond.corrector, 0.0
        self._strides.restart(good)
        self._leaping = good
        away = float(np.linalg.norm(beyond.first.x[-2:] - last.x[-2:]))
        first = replace(beyond.first, arclength=last.arclength + away, memo={})
        self.walk = self._walk_from(WalkState(None, first, good.length, self.walk.state.count + 1))
        torus, before = torus_at(first), torus_at(last)
        middle = 0.5 * (window.low + window.high)
        event = TorusEvent(
            TorusEventKind.RESONANCE,
            middle,
            0.5 * window.width,
            float(ratio),
            before.unstable,
            torus.unstable,
            ratio,
            window,
        )
        return TorusPoint(first.value, torus, first.arclength), [event]

    def _ended(self, state: WalkState) -> Step | None:
        """Record the end of the walk; where it ended at a resonance, try to leap over it and return the step."""
        end, torus = self.walk.end, torus_at(state.point)
        assert end is not None
        if end.reason is not EndReason.STEP:
            self.end = TorusEnd(
                _REASONS[end.reason], self.walk.point.value, torus_at(self.walk.point).rotation, end.detail
            )
            return None
        leapt = self._halve(state.point) or self._pass(state, MANY)
        if leapt is not None:
            return leapt
        self.end = self._locked_beside(state.point)
        near = self._near_resonance(torus)
        if self.end is None and torus.error > self.options.accuracy:
            self.end = rough(state.point, torus, self._crept(state.point))
        elif self.end is None and near is not None:
            self.end = locked(state.point, near, None)
        elif self.end is None:
            self.end = TorusEnd(TorusEndReason.STEP, state.point.value, torus.rotation, end.detail)
        return None
