"""The trail along a locus: a walk with its points of codimension two, step by step, that can be stopped and resumed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.locus.approach import Approach, approaches, leaps
from gapwalk.bifurcation.locus.corner import AWAY, Corner, turn_corner
from gapwalk.bifurcation.locus.departure import LocusDeparture, lift, refined
from gapwalk.bifurcation.locus.detect import Finding, find_codim2
from gapwalk.bifurcation.locus.functions import ends_locus
from gapwalk.bifurcation.locus.locus import Codim2, Codim2Point, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.bifurcation.locus.merging import distance_to_merging, find_merging
from gapwalk.bifurcation.locus.touch import TouchEquation
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import EndReason, Walk, WalkState
from gapwalk.errors import NumericalError
from gapwalk.motion.flow import PERIOD

_CORNER = 1e-7  # step below which a corner is looked for if none was seen to come
_AT = 100.0  # distance within which it must lie then, in lengths of that step
_OVER = 3.0  # distance within which a corner that was seen to come must lie, in distances that were estimated
_SHALLOW, _WIDE = 1e-6, 1e-2  # depth, in units of the state, of a touch that is led to its corner from so far away
_SHARE = 0.7  # of the way to a corner that a step may cover
_BESIDE = 0.1 * AWAY  # distance from the way round a corner within which the start lies on it
_EDGE = 1e-12  # distance from the edge of a range, in widths, within which the start lies on it
_RESTART = 0.2  # first step beyond a corner, in lengths of the way there from the corner
_REASONS = {
    EndReason.RANGE: LocusEndReason.RANGE,
    EndReason.TURNED_BACK: LocusEndReason.RANGE,
    EndReason.CLOSED: LocusEndReason.CLOSED,
    EndReason.STEP: LocusEndReason.STEP,
    EndReason.POINTS: LocusEndReason.POINTS,
}


class LocusStep(NamedTuple):
    """A new point of a locus, and the points of codimension two between it and the one before."""

    point: LocusPoint
    codim2: list[Codim2Point]


class LocusState(NamedTuple):
    """Where a trail along a locus has come to."""

    walk: WalkState


class LocusTrail(Iterator[LocusStep]):
    """One direction of a locus as it is walked.

    Parameters
    ----------
    departure
        Where it begins, and which way.
    walk
        Options of the walk.
    resume
        `state` of a trail from the same departure that was stopped.
    """

    def __init__(
        self, departure: LocusDeparture, walk: WalkOptions | None = None, resume: LocusState | None = None
    ) -> None:
        self.departure, self.options = departure, walk or WalkOptions()
        self.first = self._point(departure.first)
        self.end: LocusEnd | None = None
        while resume is not None and len(self.departure.first.x) < len(resume.walk.point.x):
            if not self._refine():
                break
        self.walk = self._walk_from(resume and resume.walk)

    @property
    def state(self) -> LocusState:
        """Where the trail has come to; a trail made with it as `resume` goes on as if never stopped."""
        return LocusState(self.walk.state)

    @property
    def is_closed(self) -> bool:
        """Whether the locus has closed on itself."""
        return self.end is not None and self.end.reason is LocusEndReason.CLOSED

    def finish_with(self, end: LocusEnd) -> None:
        """Take over the end that the walk had come to before it was stopped."""
        self.end = end

    def __next__(self) -> LocusStep:
        if self.end is not None:
            raise StopIteration
        if self._starts_outwards():
            self.end = LocusEnd(LocusEndReason.START, self.first.values)
            raise StopIteration
        while True:
            step = self._to_merging() or self._around_corner_ahead()
            if step is not None:
                return step
            state = self.walk.state
            coarse = max(_CORNER, self.options.smallest_step)
            is_coarse = state.step >= coarse
            self.walk.options = replace(self.options, smallest_step=coarse) if is_coarse else self.options
            try:
                point = next(self.walk)
            except StopIteration:
                assert self.walk.end is not None
                if self.walk.end.reason is not EndReason.STEP or not is_coarse:
                    self._end_with_walk()
                    raise
                step = self._around_corner(_AT * _CORNER, [])
                if step is not None:
                    return step
                self.walk = self._walk_from(self.walk.state)
                continue
            doubt = self.departure.plane.doubt(point.orbit)
            if doubt:
                if self._go_on_more_finely(state):
                    continue
                self.end = LocusEnd(LocusEndReason.COARSE, self._values(state.point), doubt)
                raise StopIteration
            step = None
            try:
                if self._is_smooth(state, point, is_coarse):
                    step = self._step(state, point)
            except NumericalError:
                step = None
            if step is not None:
                return step
            # no points lead from one to the other: the step went astray, or over a corner
            self.walk.go_back(state, point)

    def _around_corner_ahead(self) -> LocusStep | None:
        """The step round a corner that is near; otherwise the next step is shortened to end before the next corner."""
        if self.departure.kind is Kind.GRAZING:
            return None
        ahead = approaches(self.walk.previous, self.walk.point)
        shallow = _SHALLOW * float(self.departure.corrector.scales[0])
        near = [
            each
            for each in ahead
            if each.reach < AWAY or (each.turning.is_touch and abs(each.turning.depth) < shallow and each.reach < _WIDE)
        ]
        if near:
            step = self._around_corner(_OVER * near[-1].reach, near)
            if step is not None:
                return step
        if ahead:
            self.walk.step = min(self.walk.step, _SHARE * ahead[0].reach)
        return None

    def _is_smooth(self, state: WalkState, last: BranchPoint, is_coarse: bool) -> bool:
        """Whether a step stays on its arc.

        Between arcs that avoid one another narrowly, the orientation of the Jacobian tells them apart; only where they
        truly cross does it change along an arc, and there the smallest steps are let through. A locus of multipliers
        has a corner wherever a contact begins or ceases to touch.
        """
        if is_coarse and last.determinant * state.point.determinant < 0.0:
            return False
        if self.departure.kind is Kind.GRAZING:
            return True
        if state.point.orbit.closings != last.orbit.closings:
            return False
        return not leaps(state.previous, state.point, last)

    def _refine(self) -> bool:
        """Resolve the locus more finely, as if it had been so from the beginning; whether that can be done."""
        finer = refined(self.departure)
        if finer is None:
            return False
        self.departure = finer
        return True

    def _go_on_more_finely(self, state: WalkState) -> bool:
        """Go on from a state with a finer resolution; whether that can be done."""
        if not self._refine():
            return False
        point = lift(state.point, self.departure.corrector)
        if point is None:
            return False
        self.walk = self._walk_from(WalkState(None, point, state.step, state.count))
        return True

    def _walk_from(self, state: WalkState | None) -> Walk:
        departure = self.departure
        return Walk(
            departure.equation,
            departure.first,
            departure.within[1],
            departure.corrector,
            self.options,
            state,
            trust=0.0,
        )

    def _step(self, state: WalkState, point: BranchPoint) -> LocusStep | None:
        """The step to a point, cut off at the first range's edge and where the locus ends; None to step shorter."""
        reason = None
        if self._first_value(point) not in self.departure.within[0]:
            edge = self._at_edge(state.point, point)
            if edge is None:
                return None
            point, reason = edge, LocusEndReason.RANGE
        found = find_codim2(self.departure.kind, self.departure.corrector, state.previous, state.point, point)
        for number, finding in enumerate(found):
            if ends_locus(self.departure.kind, finding.kind):
                found, point, reason = found[: number + 1], finding.point, LocusEndReason.RESONANCE
                break
        step = LocusStep(self._point(point), [self._codim2(finding) for finding in found])
        if reason is not None:
            self.end = LocusEnd(reason, step.point.values)
        return step

    def _to_merging(self) -> LocusStep | None:
        """The last step, if it leads to where the orbits take half their period."""
        if self.departure.kind is not Kind.FOLD:
            return None
        state = self.walk.state
        distance = distance_to_merging(state.previous, state.point)
        if distance == float("inf"):
            return None
        try:
            end = find_merging(self.departure.corrector, state.point, distance)
        except NumericalError:
            return None
        if end is None:
            return None
        step = LocusStep(self._point(end), [self._codim2(Finding(Codim2.GENERALISED_FLIP, end))])
        self.end = LocusEnd(LocusEndReason.JOINED, step.point.values)
        return step

    def _at_edge(self, inside: BranchPoint, outside: BranchPoint) -> BranchPoint | None:
        """The point of the locus on the edge of the range of the first parameter that a step has passed."""
        corrector = self.departure.corrector
        value = self.departure.within[0].bound(self._first_value(outside)) / corrector.scales[-2]
        share = (value - inside.x[-2]) / (outside.x[-2] - inside.x[-2])
        guess, normal = inside.x + share * (outside.x - inside.x), np.zeros(len(inside.x))
        guess[-2], normal[-2] = value, 1.0
        correction = corrector.correct(guess, normal)
        if correction is None:
            return None
        length = inside.arclength + float(np.linalg.norm(correction.x - inside.x))
        correction.x[-2] = value  # to rounding, it is already
        return corrector.point(correction, inside.tangent, length)

    def _around_corner(self, within: float, ahead: list[Approach]) -> LocusStep | None:
        """The step round the corner at which the walk has come; None if there is none, or if it was just turned."""
        state = self.walk.state
        if self.departure.kind is Kind.GRAZING or (state.previous is None and state.point is not self.departure.first):
            return None
        corner = turn_corner(self.departure.corrector, state.point, within, ahead)
        if corner is None:
            return None
        if self._passes_start(state.point, corner):
            self.end = LocusEnd(LocusEndReason.CLOSED, self.first.values)
            length = state.point.arclength + float(np.linalg.norm(self.first.x - state.point.x))
            return LocusStep(replace(self.first, arclength=length), [self._codim2(corner.finding)])
        step = _RESTART * (corner.beyond.arclength - corner.finding.point.arclength)
        self.walk = self._walk_from(WalkState(None, corner.beyond, step, state.count + 1))
        return LocusStep(self._point(corner.beyond), [self._codim2(corner.finding)])

    def _passes_start(self, point: BranchPoint, corner: Corner) -> bool:
        """Whether the way round a corner leads over the point from which the trail began."""
        if point.arclength < 4.0 * self.options.first_step:
            return False
        places = [point.x, corner.finding.point.x, corner.beyond.x]
        return any(_distance(self.first.x, a, b) < _BESIDE for a, b in pairwise(places))

    def _starts_outwards(self) -> bool:
        """Whether the first step would leave the ranges at once."""
        state, first = self.walk.state, self.departure.first
        if state.point is not first:
            return False
        for within, value, slope in zip(self.departure.within, self.first.values, first.tangent[-2:], strict=True):
            bound = within.low if slope < 0.0 else within.high
            if slope != 0.0 and abs(value - bound) <= _EDGE * (within.high - within.low):
                return True
        return False

    def _end_with_walk(self) -> None:
        """Take over the end of the walk."""
        end = self.walk.end
        assert end is not None
        self.end = LocusEnd(_REASONS[end.reason], self._values(self.walk.point), end.detail)

    def _first_value(self, point: BranchPoint) -> float:
        return float(point.x[-2] * self.departure.corrector.scales[-2])

    def _values(self, point: BranchPoint) -> tuple[float, float]:
        return self._first_value(point), point.value

    def _point(self, point: BranchPoint) -> LocusPoint:
        return LocusPoint(self._values(point), point.orbit, self._angle(point), point.x, point.tangent, point.arclength)

    def _codim2(self, finding: Finding) -> Codim2Point:
        return Codim2Point(finding.kind, self._point(finding.point), finding.contact)

    def _angle(self, point: BranchPoint) -> float:
        if isinstance(self.departure.equation, TouchEquation):
            return float(point.x[-3] * self.departure.corrector.scales[-3]) % (PERIOD * self.departure.plane.period)
        return self.departure.kind.angle(point.orbit.multipliers)


def _distance(x: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Distance of a place from the straight way between two others."""
    share = float((x - a) @ (b - a)) / float((b - a) @ (b - a))
    return float(np.linalg.norm(x - a - min(1.0, max(0.0, share)) * (b - a)))
