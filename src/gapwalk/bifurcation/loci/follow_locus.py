"""Continuation of a special point in two parameters: its locus, with its points of codimension two.

Method: docs/numerics/loci.md
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.loci.codimension_two import Finding, find_codim2, find_merging
from gapwalk.bifurcation.loci.corner import AWAY, Approach, Corner, approaches, leaps, turn_corner
from gapwalk.bifurcation.loci.locus import Codim2, Codim2Point, Locus, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation
from gapwalk.bifurcation.loci.locus_start import LocusStart, Ranges, lift, refined, start_locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.both_directions import Tracing, in_one_direction
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason, Walk, WalkState
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.method import Method

LocusReport = Callable[[LocusPoint, list[Codim2Point]], None]
"""Function called with each new point and the points of codimension two before it."""


_CORNER = 1e-7  # step below which a corner is searched for if none was predicted
_AT = 100.0  # distance within which it must then lie, in lengths of that step
_OVER = 3.0  # distance within which a predicted corner must lie, in estimated distances
_SHALLOW, _WIDE = 1e-6, 1e-2  # a touch shallower than this, in units of the state, is led to a corner this far ahead
_SHARE = 0.7  # share of the distance to a corner that a step may cover
_BESIDE = 0.1 * AWAY  # distance from the path round a corner within which the start lies on it
_EDGE = 1e-12  # distance from the limit of a range, in widths, within which the start lies on it
_RESTART = 0.2  # first step beyond a corner, as a share of the distance already covered from the corner
_ENDS = (Codim2.RESONANCE_1_1, Codim2.RESONANCE_1_2)  # points at which a Neimark-Sacker locus ends
_REASONS = {
    EndReason.RANGE: LocusEndReason.RANGE,
    EndReason.TABLE: LocusEndReason.TABLE,
    EndReason.TURNED_BACK: LocusEndReason.RANGE,
    EndReason.CLOSED: LocusEndReason.CLOSED,
    EndReason.STEP: LocusEndReason.STEP,
    EndReason.POINTS: LocusEndReason.POINTS,
}


def follow_locus(
    special: SpecialPoint,
    first: str,
    second: str,
    to: Ranges,
    *,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: LocusReport | None = None,
) -> Locus:
    """Follow a fold, flip, Neimark-Sacker or grazing point in two named parameters, in both directions.

    Parameters
    ----------
    special
        The point to start from, from a branch along any parameter.
    first, second
        Names of the parameters, such as ``"frequency"`` and ``"mean.q1"``.
    to
        The range of each: ``((low, high), (low, high))``.
    walk
        Options of the walk.
    method
        Discretisation of the orbits: `Shooting` in one segment (default), or `Balance`, however the point was found.
    report
        Called with each new point and the points of codimension two before it.

    Returns
    -------
    Locus
        Its points, and where it ends.

    Raises
    ------
    ModelError
        For a branch point, which has no locus; for unknown or equal parameters; for ranges that exclude the start.
    ConvergenceError
        If the start is not a special point of its kind to the tolerance of the method, or needs too many harmonics.
    Interrupted
        After Ctrl-C; its `found` is the locus so far.

    Notes
    -----
    Kuznetsov (2004), *Elements of Applied Bifurcation Theory*; Govaerts (2000), *Numerical Methods for Bifurcations of
    Dynamical Equilibria*.

    Examples
    --------
    >>> curve = gw.follow_locus(fold, "frequency", "stop.clearance", ((1.0, 1.6), (0.9, 1.1)))
    >>> curve.values[[0, -1]].round(6)
    array([[1.372124, 1.1     ],
           [1.41379 , 0.9     ]])
    """
    return trace_locus(start_locus(special, first, second, to, method), walk).to_end(traced_locus, report)


class LocusStep(NamedTuple):
    """New point of a locus, and the points of codimension two between it and the point before."""

    point: LocusPoint
    codim2: list[Codim2Point]


class LocusTracer(Iterator[LocusStep]):
    """Tracer of a locus in one direction."""

    def __init__(self, beginning: LocusStart, walk: WalkOptions | None = None, resume: WalkState | None = None) -> None:
        self.beginning, self.options = beginning, walk or WalkOptions()
        self.first = self._point(beginning.first)
        self.end: LocusEnd | None = None
        while resume is not None and len(self.beginning.first.x) < len(resume.point.x):
            finer = refined(self.beginning)
            if finer is None:
                break
            self.beginning = finer
        self.walk = self._walk_from(resume)

    @property
    def state(self) -> WalkState:
        """Progress so far; a tracer made with it as `resume` continues as if never stopped."""
        return self.walk.state

    @property
    def is_closed(self) -> bool:
        """True if the locus has closed on itself."""
        return self.end is not None and self.end.reason is LocusEndReason.CLOSED

    def finish_with(self, end: LocusEnd) -> None:
        """Set the end that the walk had reached before it was stopped."""
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
                end = self.walk.end
                assert end is not None
                if end.reason is not EndReason.STEP or not is_coarse:
                    self.end = LocusEnd(_REASONS[end.reason], self._values(self.walk.point), end.detail)
                    raise
                step = self._around_corner(_AT * _CORNER, [])
                if step is not None:
                    return step
                self.walk = self._walk_from(self.walk.state)
                continue
            inaccuracy = self.beginning.plane.inaccuracy(point.orbit)
            if inaccuracy:
                if self._refine(state):
                    continue
                self.end = LocusEnd(LocusEndReason.COARSE, self._values(state.point), inaccuracy)
                raise StopIteration
            with suppress(NumericalError):
                if self._is_smooth(state, point, is_coarse) and (step := self._step(state, point)) is not None:
                    return step
            # no points connect the two: the step went astray, or over a corner
            self.walk.go_back(state, point)

    def _around_corner_ahead(self) -> LocusStep | None:
        """Return the step round a nearby corner; without one, limit the next step to end before the next corner."""
        if not self.beginning.kind.by_multipliers:
            return None
        ahead = approaches(self.walk.previous, self.walk.point)
        shallow = _SHALLOW * float(self.beginning.corrector.scales[0])
        near = [
            each
            for each in ahead
            if each.reach < AWAY or (each.turning.is_touch and abs(each.turning.depth) < shallow and each.reach < _WIDE)
        ]
        if near and (step := self._around_corner(_OVER * near[-1].reach, near)) is not None:
            return step
        if ahead:
            self.walk.step = min(self.walk.step, _SHARE * ahead[0].reach)
        return None

    def _is_smooth(self, state: WalkState, last: BranchPoint, is_coarse: bool) -> bool:
        """Return True if a step stays on its arc.

        Arcs that nearly meet are distinguished by the orientation of the Jacobian. Along one arc the orientation
        changes only where arcs really cross; there the smallest steps are accepted. A locus of multipliers has a corner
        wherever a contact begins or ceases to touch.
        """
        if is_coarse and last.determinant * state.point.determinant < 0.0:
            return False
        if not self.beginning.kind.by_multipliers:
            return True
        return state.point.orbit.closings == last.orbit.closings and not leaps(state.previous, state.point, last)

    def _refine(self, state: WalkState) -> bool:
        """Continue from a state with a finer resolution; return whether that was possible."""
        finer = refined(self.beginning)
        point = None if finer is None else lift(state.point, finer.corrector)
        if finer is None or point is None:
            return False
        self.beginning = finer
        self.walk = self._walk_from(WalkState(None, point, state.step, state.count))
        return True

    def _walk_from(self, state: WalkState | None) -> Walk:
        start = self.beginning
        return Walk(start.first, start.within[1], start.corrector, self.options, state, trust=0.0)

    def _step(self, state: WalkState, point: BranchPoint) -> LocusStep | None:
        """Return the step, cut off at the limit of the first range or the end of the locus; None to step shorter."""
        reason, detail, outside = None, "", point
        if self._first_value(point) not in self.beginning.within[0]:
            edge = self._at_edge(state.point, point)
            if edge is None:
                return None
            point, within = edge, self.beginning.within[0]
            table = within.table_at(within.bound(self._first_value(outside)))
            reason, detail = LocusEndReason.TABLE if table else LocusEndReason.RANGE, table
        found = find_codim2(self.beginning.kind, self.beginning.corrector, state.previous, state.point, point)
        for number, finding in enumerate(found):
            if self.beginning.kind is Kind.NEIMARK_SACKER and finding.kind in _ENDS:  # the pair is real beyond it
                found, point, reason = found[: number + 1], finding.point, LocusEndReason.RESONANCE
                detail = ""
                break
        step = LocusStep(self._point(point), [self._codim2(finding) for finding in found])
        if reason is not None:
            self.end = LocusEnd(reason, step.point.values, detail)
        return step

    def _to_merging(self) -> LocusStep | None:
        """Return the last step, if it leads to the point where the orbits reach half their period."""
        if self.beginning.kind is not Kind.FOLD:
            return None
        state = self.walk.state
        try:
            end = find_merging(self.beginning.corrector, state.previous, state.point)
        except NumericalError:
            return None
        if end is None:
            return None
        step = LocusStep(self._point(end), [self._codim2(Finding(Codim2.GENERALISED_FLIP, end))])
        self.end = LocusEnd(LocusEndReason.JOINED, step.point.values)
        return step

    def _at_edge(self, inside: BranchPoint, outside: BranchPoint) -> BranchPoint | None:
        """Return the point of the locus at the limit of the first parameter that a step has passed."""
        corrector = self.beginning.corrector
        value = self.beginning.within[0].bound(self._first_value(outside)) / corrector.scales[-2]
        share = (value - inside.x[-2]) / (outside.x[-2] - inside.x[-2])
        guess, normal = inside.x + share * (outside.x - inside.x), np.zeros(len(inside.x))
        guess[-2], normal[-2] = value, 1.0
        correction = corrector.correct(guess, normal)
        if correction is None:
            return None
        length = inside.arclength + float(np.linalg.norm(correction.x - inside.x))
        correction.x[-2] = value  # it differs only by rounding
        return corrector.point(correction, inside.tangent, length)

    def _around_corner(self, within: float, ahead: list[Approach]) -> LocusStep | None:
        """Return the step from the present point around a corner; None if there is no corner, or it was just passed."""
        state = self.walk.state
        if not self.beginning.kind.by_multipliers or (
            state.previous is None and state.point is not self.beginning.first
        ):
            return None
        corner = turn_corner(self.beginning.corrector, state.point, within, ahead)
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
        """Return True if the path round a corner passes the first point of the tracer."""
        if point.arclength < 4.0 * self.options.first_step:
            return False
        places = [point.x, corner.finding.point.x, corner.beyond.x]
        return any(_distance(self.first.x, a, b) < _BESIDE for a, b in pairwise(places))

    def _starts_outwards(self) -> bool:
        """Return True if the first step would leave the ranges at once."""
        state, first = self.walk.state, self.beginning.first
        if state.point is not first:
            return False
        for within, value, slope in zip(self.beginning.within, self.first.values, first.tangent[-2:], strict=True):
            bound = within.low if slope < 0.0 else within.high
            if slope != 0.0 and abs(value - bound) <= _EDGE * (within.high - within.low):
                return True
        return False

    def _first_value(self, point: BranchPoint) -> float:
        return float(point.x[-2] * self.beginning.corrector.scales[-2])

    def _values(self, point: BranchPoint) -> tuple[float, float]:
        return self._first_value(point), point.value

    def _point(self, point: BranchPoint) -> LocusPoint:
        return LocusPoint(self._values(point), point.orbit, self._angle(point), point.x, point.tangent, point.arclength)

    def _codim2(self, finding: Finding) -> Codim2Point:
        return Codim2Point(finding.kind, self._point(finding.point), finding.contact)

    def _angle(self, point: BranchPoint) -> float:
        if isinstance(self.beginning.equation, GrazingEquation):
            return float(point.x[-3] * self.beginning.corrector.scales[-3]) % (PERIOD * self.beginning.plane.period)
        return self.beginning.kind.angle(point.orbit.free_multipliers)


def _distance(x: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the distance of a place from the straight line segment between two others."""
    share = float((x - a) @ (b - a)) / float((b - a) @ (b - a))
    return float(np.linalg.norm(x - a - min(1.0, max(0.0, share)) * (b - a)))


LocusTracing = Tracing[LocusStart, LocusTracer, LocusStep]
"""Tracing of a locus."""


def trace_locus(beginnings: list[LocusStart], walk: WalkOptions | None = None) -> LocusTracing:
    """Return an iterator over the steps of a locus, from beginnings in one or both directions."""
    return Tracing(beginnings, lambda beginning, state: LocusTracer(beginning, walk, state))


def traced_locus(tracing: LocusTracing) -> Locus:
    """Return the locus so far, in one direction of travel; a single trace may cover a closed curve."""
    kept = slice(-1, None) if tracing.traces[-1].is_closed else slice(None)
    tracers, walked = tracing.traces[kept], tracing.steps[kept]
    start, plane = tracers[-1].beginning, tracers[-1].beginning.plane
    ends = [
        tracer.end or LocusEnd(LocusEndReason.STOPPED, (steps[-1].point if steps else tracer.first).values)
        for tracer, steps in zip(tracers, walked, strict=True)
    ]
    points, codim2 = in_one_direction(
        walked, tracers[-1].first, _reversed, lambda found: replace(found, point=_reversed(found.point))
    )
    first, second = plane.names
    return Locus(start.kind, first, second, plane.period, points, codim2, (ends[0], ends[-1]), start.contact)


def _reversed(point: LocusPoint) -> LocusPoint:
    return replace(point, tangent=-point.tangent, arclength=-point.arclength)
