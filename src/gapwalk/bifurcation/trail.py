"""The trail: a walk with its special points, step by step, that can be stopped after any step and resumed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.counts import unexplained
from gapwalk.bifurcation.departure import Departure, lift, refined
from gapwalk.bifurcation.detect import Detector, DetectorState
from gapwalk.bifurcation.doubling import has_merged, is_close, passes_parent, value_ahead, value_between
from gapwalk.bifurcation.kind import Kind
from gapwalk.bifurcation.kinds.event import Event
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.bifurcation.passage import pass_graze
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Walk, WalkState
from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.symmetry import Symmetry, finds_all, symmetries_of
from gapwalk.motion.unit import magnitude
from gapwalk.orbit.floating import floats, unheld
from gapwalk.orbit.floquet import largest_move

_GRAZES = 1e-5  # distance from a breakpoint, relative to the motion, within which a deflection grazes there
_AHEAD = 1e-4  # arclength beyond the beginning of a branch from which special points are looked for
_SHARP = 1e-6  # arclength of a step within which a graze is passed by its depth, not by the arclength
_BEGINNING = 1e-4  # radians from the beginning of the period within which a contact begins or ends just there
_BENT, _UNCHANGED = 1e-6, 1e-3  # the step over the bend, and the share by which multipliers may change meanwhile
_NEARER, _NEAREST = 0.1, 1e-8  # share of it that is left where a contact grazes before, and the least that is tried

_SYMMETRIC, _LOST = 1e-6, 1e-4  # defects of a symmetry, in amplitudes: of an orbit that has it, and that has lost it
_RESTORED = 1e-3  # the same at the vertex where a symmetry returns: it is located to the square of that, and better
_ROUNDING = 1e-8  # size of motions whose asymmetry is rounding, in the scale of positions
_CERTAIN = 1e-6  # arclength of a step that is not taken again, whatever it leaves unexplained
_FAR = 0.8  # change of a multiplier in one step: half a turn takes four steps

Step = tuple[BranchPoint, list[SpecialPoint]]
"""A new point of a branch, and the special points between it and the one before."""


class TrailState(NamedTuple):
    """Where a trail has come to: its walk and its detector."""

    walk: WalkState
    detector: DetectorState


def _change(first: BranchPoint, second: BranchPoint) -> float:
    """How far multipliers move between two neighbouring points, as a share of what a step may move them."""
    return largest_move(first.orbit.multipliers, second.orbit.multipliers) / _FAR


def _walk(departure: Departure, options: WalkOptions, state: WalkState | None) -> Walk:
    """The walk from a departure, or from a state that it had come to."""
    return Walk(
        departure.equation,
        departure.first,
        departure.within,
        departure.corrector,
        options,
        state,
        branched=departure.singular,
        change=_change,
    )


def resumed_trail(
    departure: Departure, walk: WalkOptions | None, state: TrailState, events: Sequence[Event] = ()
) -> Trail:
    """The trail that goes on from a state, also where the resolution of its equation was refined by the way.

    Parameters
    ----------
    departure
        From which the trail departed.
    walk
        Options of the walk.
    state
        `Trail.state` when it was stopped; but its points are as they were yielded, so that the one before the last may
        be from before a refinement.
    events
        Kinds of special points of the user's own.
    """
    previous, size = state.walk.previous, len(state.walk.point.x)
    while len(departure.first.x) < size:
        finer = refined(departure)
        if finer is None:
            break
        if previous is not None and len(previous.x) < len(finer.first.x):
            previous = lift(previous, finer.corrector, finer.equation)
        departure = finer
    return Trail(departure, walk, state._replace(walk=replace(state.walk, previous=previous)), events)


class Trail(Iterator[Step]):
    """One direction of a branch as it is walked: yields each point with the special points before it.

    Parameters
    ----------
    departure
        Where it begins, and which way.
    walk
        Options of the walk.
    resume
        `state` of a trail from the same departure that was stopped.
    events
        Kinds of special points of the user's own.
    """

    def __init__(
        self,
        departure: Departure,
        walk: WalkOptions | None = None,
        resume: TrailState | None = None,
        events: Sequence[Event] = (),
    ) -> None:
        self.departure, self.first = departure, departure.first
        self._kinds = (*Kind.known(), *events)
        options = walk or WalkOptions()
        self.walk = _walk(departure, options, resume and resume.walk)
        self._symmetries: dict[Symmetry, tuple[int, ...]] | None = None
        self.detector = Detector(departure.corrector, self._kinds)
        self._ways = unheld(self.first.orbit.system)
        if resume is not None:
            self.detector.restore(resume.detector)
        if why := floats(self.walk.point.orbit, self._ways):
            self.walk.finish(self.walk.point, End(EndReason.FLOATING, self.walk.point.value, why))

    @property
    def state(self) -> TrailState:
        """Where the trail has come to; a trail made with it as `resume` goes on as if never stopped."""
        return TrailState(self.walk.state, self.detector.state)

    @property
    def end(self) -> End | None:
        """Where and why the walk ended; None while it goes on."""
        return self.walk.end

    @property
    def is_closed(self) -> bool:
        """Whether the branch has closed on itself."""
        return self.end is not None and self.end.reason is EndReason.CLOSED

    def finish_with(self, end: End) -> None:
        """Take over the end that the walk had come to before it was stopped."""
        self.walk.end = end

    def __next__(self) -> Step:
        state = self.state
        before, first = self.walk.previous, self.walk.point
        while True:
            try:
                point = next(self.walk)
            except StopIteration:
                if self._refine(state.walk.count):
                    before, first, state = None, self.walk.point, self.state
                    continue
                stuck = self.walk.end is not None and self.walk.end.reason is EndReason.STEP
                step = (self._pass_graze(state.walk) or self._pass_bend(state.walk)) if stuck else None
                if step is not None:
                    return step
                if stuck and self.walk.persist():
                    continue
                self._end_at_parent(before, first)
                self._explain_small_step(first)
                raise
            if why := floats(point.orbit, self._ways):
                self.walk.finish(first, End(EndReason.FLOATING, first.value, why))
                continue
            if self._grazes_sharply(first, point):
                step = self._pass_graze(state.walk)
                if step is not None:
                    return step
            doubt = self.departure.equation.doubt(point.orbit)
            if doubt:
                self.walk.finish(first, End(EndReason.COARSE, first.value, doubt))
                continue
            try:
                if self._is_doubled(first) and has_merged(point):
                    raise NumericalError("the step went onto the parent branch")
                if self._is_astray(first, point):
                    raise NumericalError("the step went onto a branch of motions without a symmetry of this one")
                step = self._until_vertex(point, self._explained(first, point, before))
            except NumericalError:
                # no orbits lead from one point to the other: the step went astray, onto another branch
                if before is not None and self._is_doubled(first) and is_close(first):
                    self.walk.finish(first, End(EndReason.JOINED, value_ahead(before, first)))
                    return first, []
                self.detector.restore(state.detector)
                self.walk.go_back(state.walk, point)
                continue
            return self._until_parent(first, step)

    def _refine(self, count: int) -> bool:
        """Go on more finely where the walk ended for want of it, after `count` points; whether that can be done."""
        if self.walk.end is None or self.walk.end.reason is not EndReason.COARSE:
            return False
        finer = refined(self.departure)
        point = None if finer is None else lift(self.walk.point, finer.corrector, finer.equation)
        if finer is None or point is None:
            return False
        state = WalkState(None, point, self.walk.step, count)
        walk = self.walk
        self.departure = finer
        self.walk = _walk(finer, walk.options, state)
        self.walk.rejected = walk.rejected
        self.detector = Detector(finer.corrector, self._kinds)
        return True

    def _kept(self, point: BranchPoint) -> dict[Symmetry, tuple[int, ...]]:
        """The symmetries that all orbits of the branch have, each with the breakpoints that it exchanges.

        They are those of its first orbit, or of the next if it begins at another branch.

        A parameter may break a symmetry of the equations (a mean load does), so they must have it all over the range.
        """
        if self._symmetries is None:
            if self.departure.singular and point.arclength < _AHEAD:
                return {}
            self._symmetries = {
                each: each.moves_switches(point.orbit.system)
                for each in self._symmetries_of_all()
                if self._defect(each, point) < _SYMMETRIC
            }
        return self._symmetries

    def _is_astray(self, first: BranchPoint, point: BranchPoint) -> bool:
        """Whether a point lacks a symmetry of the branch: by its extremes, or by how often its contacts close.

        Past a graze at a stiff stop the second shows what is too small for the first.
        """
        closings = point.orbit.closings
        return any(
            closings != tuple(closings[switch] for switch in switches) or self._defect(symmetry, point) > _LOST
            for symmetry, switches in self._kept(first).items()
        )

    def _defect(self, symmetry: Symmetry, point: BranchPoint) -> float:
        return symmetry.defect(point.orbit.extremes, _ROUNDING * float(self.departure.corrector.scales[0]))

    def _symmetries_of_all(self) -> tuple[Symmetry, ...]:
        """The symmetries that the system has at both ends of the range, and at the beginning."""
        system, within = self.first.orbit.system, self.departure.within
        place = system.structure.place(self.departure.equation.parameter or "")
        ends = [symmetries_of(System.beside(system, place, value)) for value in (within.low, within.high)]
        return tuple(each for each in symmetries_of(system) if all(each in end for end in ends))

    def _explained(self, first: BranchPoint, point: BranchPoint, before: BranchPoint | None) -> list[SpecialPoint]:
        """The special points of a step, if they explain what changes in it; a shorter step may show what was missed."""
        special = self._inspect(first, point, before)
        singular = first is self.first and self.departure.singular  # all test functions vanish there
        if point.arclength - first.arclength > _CERTAIN and not singular:
            for text in unexplained(first, point, special):
                raise NumericalError(text)
        return special

    def _inspect(self, first: BranchPoint, point: BranchPoint, before: BranchPoint | None) -> list[SpecialPoint]:
        """The special points of a step; of the first step of a branch that begins at another, from just beyond there.

        All test functions vanish where such a branch begins.
        """
        if first is self.first and self.departure.singular:
            beside = self._beside_beginning(min(_AHEAD, 0.05 * point.arclength))
            if beside is None:
                return []
            first, before = beside, None
        parameter, method = self.departure.equation.parameter or "", self.departure.equation.options
        return [each.kind.judged(each, parameter, method) for each in self.detector.inspect(first, point, before)]

    def _beside_beginning(self, ahead: float) -> BranchPoint | None:
        """A point just beyond the beginning of a branch that begins at another; None if there is none.

        Where the contacts already close otherwise than at the beginning, one grazes between, and the branch may turn
        there at once: so that nothing of it is missed, a nearer point is taken.
        """
        corrector, first = self.departure.corrector, self.first
        beside = None
        while ahead >= _NEAREST:
            correction = corrector.correct(first.x + ahead * first.tangent, first.tangent)
            if correction is None:
                break
            beside = corrector.point(correction, first.tangent, ahead)
            if beside.orbit.closings == first.orbit.closings:
                break
            ahead *= _NEARER
        return beside

    def _grazes_sharply(self, first: BranchPoint, point: BranchPoint) -> bool:
        """Whether a contact grazes in a step so short, or so much changes with it, that its stop must be stiff."""
        if first.orbit.closings == point.orbit.closings:
            return False
        return point.arclength - first.arclength < _SHARP or _change(first, point) > 1.0

    def _pass_graze(self, state: WalkState) -> Step | None:
        """The step over a graze from a state of the walk: a stiff stop turns the branch within rounding there."""
        first = state.point
        if first is self.first and self.departure.singular:
            return None  # two branches begin there, and the depth does not tell them apart
        passage = pass_graze(self.departure.corrector, first)
        if passage is None or (self._is_doubled(first) and has_merged(passage.point)):
            return None
        if self._is_astray(first, passage.point):
            return None
        self.walk.go_on(state, passage.point, 0.5 * passage.distance)
        self.detector = Detector(self.departure.corrector, self._kinds)  # test functions may have jumped
        return self._until_parent(first, self._until_vertex(passage.point, passage.special))

    def _pass_bend(self, state: WalkState) -> Step | None:
        """The step over a bend from a state of the walk: where a contact begins or ends just as the period begins.

        The state there runs along the motion, and that has a bend where a viscous force sets in. The motion itself is
        as smooth along the branch as elsewhere, so its multipliers stay as they are.
        """
        first = state.point
        full = PERIOD * first.orbit.period
        if not any(min(event.theta, full - event.theta) < _BEGINNING for event in first.orbit.events):
            return None
        point = self.walk.bent_step(_BENT)
        if point is None or first.orbit.closings != point.orbit.closings:
            return None
        off = np.abs(first.orbit.multipliers - point.orbit.multipliers).max()
        if off > _UNCHANGED * np.abs(first.orbit.multipliers).max() or first.determinant * point.determinant < 0.0:
            return None
        self.walk.go_on(state, point, _BENT)
        self.detector = Detector(self.departure.corrector, self._kinds)
        return point, []

    def _until_vertex(self, point: BranchPoint, special: list[SpecialPoint]) -> Step:
        """The step, cut off where the branch joins the one that it branches off from.

        There it turns round, and what follows is the same motion again: shifted by a forcing period beyond a flip,
        mirrored beyond a loss of symmetry.
        """
        for number, each in enumerate(special):
            if each.is_vertex and self._has_parent(each.point):
                self.walk.finish(each.point, End(EndReason.JOINED, each.value))
                return each.point, special[:number]
        return point, special

    def _has_parent(self, vertex: BranchPoint) -> bool:
        """Whether the orbit at a vertex has what those of the branch lack: half their period, or a symmetry.

        Only then is there a branch to join. Where not all symmetries are looked for, the vertex is believed.
        """
        if vertex.orbit.period % 2 == 0 and is_close(vertex):
            return True
        if not finds_all(vertex.orbit.system):
            return True
        kept = self._kept(self.walk.point)
        lost = [each for each in symmetries_of(vertex.orbit.system) if each not in kept]
        return any(self._defect(each, vertex) < _RESTORED for each in lost)

    def _is_doubled(self, point: BranchPoint) -> bool:
        """Whether a point may be near the parent of a period-doubled branch, and is not its beginning."""
        return point.orbit.period % 2 == 0 and not (point is self.first and self.departure.singular)

    def _until_parent(self, first: BranchPoint, step: Step) -> Step:
        """The step, cut off where a doubled branch passes its parent and that was not located as a branch point."""
        point, special = step
        joined = self.walk.end is not None and self.walk.end.reason is EndReason.JOINED
        if joined or not self._is_doubled(first) or not passes_parent(first, point):
            return step
        value = value_between(first, point, float(self.departure.corrector.scales[-1]))
        self.walk.finish(first, End(EndReason.JOINED, value))
        low, high = sorted((first.value, point.value))
        return first, [each for each in special if low <= each.value <= high and not is_close(each.point)]

    def _explain_small_step(self, last: BranchPoint) -> None:
        """Say so where a walk got stuck because a contact grazes: a stiff one turns the branch within a step."""
        end = self.walk.end
        if end is None or end.reason is not EndReason.STEP:
            return
        size = magnitude(last.orbit.extremes[:, :2], last.orbit.system)
        depths = [min(map(abs, turns.values), default=np.inf) for turns in last.orbit.turning_depths]
        if depths and min(depths) <= _GRAZES * size:
            contact = describe_switch(last.orbit, depths.index(min(depths)))
            advice = "the branch turns there too sharply to be followed: begin beyond, or with a softer contact"
            self.walk.finish(last, End(end.reason, end.value, f"{end.detail}; {contact} grazes, and {advice}"))

    def _end_at_parent(self, before: BranchPoint | None, last: BranchPoint) -> None:
        """Give a walk that got stuck just before its parent its true reason."""
        stuck = self.walk.end is not None and self.walk.end.reason is EndReason.STEP
        if stuck and before is not None and self._is_doubled(last) and is_close(last):
            self.walk.finish(last, End(EndReason.JOINED, value_ahead(before, last)))
