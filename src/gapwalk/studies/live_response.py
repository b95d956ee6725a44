"""The live response: a quick walk, whose points are moved to other numbers, and the exact branch in a notebook.

The walk is by harmonic balance to a hundredth, from the static equilibrium, with long steps and without special points.
It needs no compiled flow, so a changed structure costs no more than a changed number. What harmonic balance does not
describe (rigid stops, some friction) is walked by shooting. Where a number alone has changed, the points of the last
walk are first moved to the new curve: a picture for each step of a slider. Where the walk cannot go on, as among many
grazes or after it has turned back at a fold, settled motions are computed by equal steps to the end of the range.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Self, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.settled_curve import SettledCurve
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation import directions, start_branch
from gapwalk.bifurcation.band import Band
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import BranchTracer, follow
from gapwalk.bifurcation.moved_curve import MOVED, marks, moved, thinned
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, Walk, WalkOptions
from gapwalk.errors import ConvergenceError, GapwalkError, ModelError, NumericalError
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.measures import full_measure
from gapwalk.model.system import System
from gapwalk.model.words import measure_words, parameter_words
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import OrbitEquation, solve
from gapwalk.orbit.shooting import Shooting
from gapwalk.studies.live_answer import LONGEST, LiveAnswer, Seen
from gapwalk.studies.options import BranchOptions, RangeStudy
from gapwalk.studies.study_file import Study

BALANCE = Balance(error=0.01)
"""Harmonics up to a hundredth of the motion: less than the width of a line on the page."""
SHOOTING = Shooting(tolerance=1e-6)
STEPS = WalkOptions(initial_step=0.01, largest_step=0.02, largest_turn=0.3, max_points=1000)
_KEPT = 0.75  # share of the points wanted of which a moved curve is moved again
_BEHIND = 250  # points that a walk may stay behind the furthest value: more are folds that nobody sees at this width
_SETTLED = "settled"
_LEVEL = {"min": 0, "max": 2}  # of least, middle and largest height
_ENDS = (EndReason.RANGE, EndReason.TABLE, EndReason.CLOSED)


def range_study(studies: Sequence[Study]) -> Study:
    """Return the study whose range is walked: the first over the pace of the excitation, else over anything."""
    ranges = [each for each in studies if isinstance(each.options, RangeStudy)]
    if not ranges:
        raise ModelError('no study has a range; write one of kind = "response", with parameter, from and to')
    pace = (each for each in ranges if cast("RangeStudy", each.options).parameter == each.system.structure.pace)
    return next(pace, ranges[0])


class LiveResponse(LiveAnswer):
    """Response over a range of a parameter."""

    key = "response"

    def __init__(
        self,
        parameter: str,
        within: tuple[float, float],
        measure: str,
        period: int = 1,
        start: NDArray[np.float64] | None = None,
    ) -> None:
        self.parameter, self.within, self.measure, self.period, self.start = parameter, within, measure, period, start
        self.corrector: Corrector | None = None
        self.points: tuple[BranchPoint, ...] = ()

    @classmethod
    def of(cls, studies: Sequence[Study], at: float | None) -> tuple[Self, System]:
        """See `LiveAnswer.of`."""
        study = range_study(studies)
        options = cast("RangeStudy", study.options)
        system = options.first_system(study.system)
        period = options.period if isinstance(options, BranchOptions) else 1
        live = cls(options.parameter, (options.begin, options.end), shown_measure(system, options), period)
        live.about = system.structure, live.parameter, live.within, live.measure, period
        words = parameter_words(live.parameter, system.units), measure_words(live.measure, system.units)
        live.title = {**dict(zip(("across", "up"), words, strict=True)), "range": list(live.within)}
        live.title["axes"] = [live.parameter, live.measure]
        return live, system

    @classmethod
    def of_branch(cls, branch: Branch, measure: str) -> LiveResponse:
        """Return the live response of a branch."""
        first, low, high = branch.points[0], float(min(branch.values)), float(max(branch.values))
        end = high if branch.values[-1] >= first.value else low
        name = full_measure(measure, branch.system.coordinates)
        live = cls(branch.parameter, (first.value, end), name, branch.period, first.orbit.state)
        for _ in live.rest(first.orbit.system):
            pass
        return live

    def coarse(self, system: System) -> Seen | None:
        """Return the moved points of the last walk, with what happens between them."""
        if self.corrector is None:
            return None
        equation = replace(cast("OrbitEquation", self.corrector.equation), system=system)
        points = moved(Corrector(equation, self.corrector.scales), list(thinned(self.points)))
        if len(points) > _KEPT * min(len(self.points), MOVED):  # the next ones are moved from here
            self.points = tuple(points)
        if len(points) < 2:
            return None
        seen = self._seen(points)  # between distant points of different stability, where it changes is not known
        looks = [first if first == last else "neutral" for first, last in pairwise(seen.looks)]
        return seen._replace(looks=[*looks, seen.looks[-1]])

    def rest(self, system: System) -> Iterator[Seen]:
        """Yield the points of a quick walk, which replaces the last one."""
        before, is_whole = (self.corrector, self.points), False
        self.corrector, self.points, self.end = None, (), ""
        try:
            yield from self._grown(system)
            is_whole = True
        finally:
            if not is_whole:  # it was given up
                self.corrector, self.points = before

    def _grown(self, system: System) -> Iterator[Seen]:
        until = time.process_time() + LONGEST
        for point in self._walk(system, until - LONGEST / 2):
            if isinstance(point, str):
                self.end = point
            elif not isinstance(point, Band):
                yield Seen([point.value], [point.measure(self.measure)], [point.instability.label], [])
            elif shown := point.shown(system, self.measure):
                yield Seen([point.value], [shown[_LEVEL.get(self.measure.partition(".")[0], 1)]], [_SETTLED], [])
            if time.process_time() > until:
                self.end = f"stopped after {LONGEST:g} s of work, before the end of the range"
                break
        yield Seen([], [], [], self._seen(self.points).marks if self.corrector else [])

    def exact(self, system: System) -> Branch:
        """Return the branch, followed again from its first point."""
        first = find_orbit(system, self.period, self.points[0].orbit.state)
        self.start = first.state
        branch = follow(first, self.parameter, self.within[1], report=lambda *_: None)
        for _ in self.rest(system):
            pass
        return branch

    def _seen(self, points: Sequence[BranchPoint]) -> Seen:
        assert self.corrector is not None
        x, y = [each.value for each in points], [each.measure(self.measure) for each in points]
        looks = [each.instability.label for each in points]
        found = marks(points, float(self.corrector.scales[-1]))
        return Seen(x, y, looks, [(each.kind.value, each.value, each.measure(self.measure)) for each in found])

    def _walk(self, system: System, until: float) -> Iterator[BranchPoint | Band | str]:
        """Yield the points of the walk, what settles where it gives up, and why it ended before its range did."""
        # where many gaps rattle, to look for an orbit that is not there takes seconds to minutes
        curve = SettledCurve.of(system, self.parameter, self.within) if self.start is None else None
        settled = None if curve is None else curve.at(0)
        try:
            if settled is not None and settled.period != self.period:
                raise ConvergenceError(f"the motion that settles does not have the period {self.period}")
            start, method = self._first(system, "settle" if settled is None else settled.state)
        except NumericalError:
            yield from self._settled(system, first=settled)
            return
        (direction,) = directions(*self.within)
        beginning = start_branch(start, self.parameter, self.within[1], direction, method)
        walk: Walk | BranchTracer = Walk(beginning.first, beginning.within, beginning.corrector, STEPS)
        if isinstance(method, Shooting) and jumping_switches(system):  # such a graze ends a walk that does not know it
            walk = BranchTracer(beginning, STEPS, judges=False)
        furthest, behind = beginning.first, 0
        self.corrector, self.points = beginning.corrector, (beginning.first,)
        yield furthest
        for step in walk:
            point = step[0] if isinstance(step, tuple) else step
            if isinstance(walk, BranchTracer) and walk.beginning.corrector is not self.corrector:  # more segments
                self.corrector, self.points = walk.beginning.corrector, ()
            self.points += (point,)
            yield point
            is_further = direction * (point.value - furthest.value) > 0.0
            furthest, behind = (point, 0) if is_further else (furthest, behind + 1)
            if behind > _BEHIND or time.process_time() > until:
                break
        words = "the walk was given up" if walk.end is None else walk.end.reason_words
        if walk.end is not None and walk.end.reason in _ENDS:
            yield words * (walk.end.reason is not EndReason.RANGE)
            return
        try:
            yield from self._settled(system, furthest)
        except GapwalkError:  # what does not settle here either
            yield words

    def _settled(self, system: System, last: BranchPoint | None = None, first: Band | None = None) -> Iterator[Band]:
        """Yield what settles at the steps of the range, those beyond the last point of a walk if there is one."""
        curve = SettledCurve(system, self.parameter, self.within)
        place = 0 if last is None else curve.beyond(last.value)
        bands = [] if first is None else [first]
        if first is None and place < len(curve.values):
            bands = [curve.at(place, None if last is None else last.orbit.state)]
        while bands:
            yield from bands
            bands = curve.after(bands) if curve.beyond(bands[-1].value) < len(curve.values) else []

    def _first(self, system: System, near: str | NDArray[np.float64]) -> tuple[Orbit, Method]:
        """Return the first motion, sought by shooting near a state, and the method that has found it."""
        with suppress(ModelError, NumericalError):
            equation = BALANCE.pose(system, None, self.period)
            if self.start is not None:
                return find_orbit(system, self.period, self.start, method=BALANCE), BALANCE
            while equation is not None:
                rests = find_equilibria(system).equilibria
                if not rests:  # teeth that do not yield hold nothing in place
                    break
                guess = equation.rest(rests[0].position)
                unknowns, evaluation = solve(equation, guess, 0.0)
                orbit = equation.orbit(unknowns, 0.0, evaluation)
                if not equation.inaccuracy(orbit):
                    return orbit, BALANCE
                equation = equation.finer()
        if self.start is not None:
            return find_orbit(system, self.period, self.start, method=SHOOTING), SHOOTING
        return find_orbit(system, self.period, near, method=SHOOTING), SHOOTING
