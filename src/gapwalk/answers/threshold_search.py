"""Search for a threshold, round by round: borders followed to their extrema, then many motions tried beyond them.

The quiet motion begins to rattle where a contact grazes, and rattling motions cease at grazing points or folds. All of
these lie on loci in the plane of both parameters. The threshold is the extremum of the locus that reaches farthest. It
is found from both sides, and then confirmed: many motions from random starts just beyond it are followed until they
have settled. If one of them rattles, its own border is followed in the same way. The batch integrator follows them; one
that rattles is followed by the exact flow before it counts, and so are some of the quiet ones. If none rattles, the
quiet motion is walked over the range of the other parameter, which misses no narrow resonance.

Method: docs/howto/studies.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import GapState, gap_state, innermost, judge_gaps, watched
from gapwalk.answers.locus_extremum import Extremum, locus_extremum
from gapwalk.answers.threshold import Confirmation, Threshold, ThresholdOptions
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.bifurcation.isolated.search_options import spread_starts, state_box
from gapwalk.bifurcation.kinds import Kind
from gapwalk.bifurcation.special_point import SpecialPoint, describe_switch
from gapwalk.ensemble.start import state_at_rest
from gapwalk.errors import FlowError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import value_words
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit

_COARSE = 9  # values of the parameter at which motions are tried first
_FEW = 2  # starts at each pair of values then
_CHECKED = 8  # quiet motions that are watched again by the exact flow
_RETRIED = 16  # motions lost by the batch integrator that are followed again by the exact flow
_BEYOND = 1e-3  # distance beyond the threshold, in widths of the range, at which it is confirmed
_NEAR = 0.1  # share of the range of the other parameter about the limit in which half of all motions are tried
_SAME = 1e-8  # difference of two limits, relative to the range, below which they are one
_SETTLE = SettleOptions(max_periods=1500)
_DOUBLINGS = 5  # of the periods in which motions may become periodic, for those that have not
_LONG = 4096  # the most forcing periods in which a motion without period is settled by the exact flow
_WATCH = 64  # the most forcing periods in which a motion that seems to have settled is settled by the exact flow
_QUIET = (GapState.CLOSED.code, GapState.OPEN.code)


class Request(NamedTuple):
    """Request of a threshold; the names are those of `gapwalk.ask.threshold`."""

    system: System
    gaps: tuple[str, ...]
    parameter: str
    to: tuple[float, float]
    over: str
    span: tuple[float, float]
    options: ThresholdOptions

    def check(self) -> None:
        """Raise a ModelError if no system can have the values at a corner of the ranges."""
        for first, second in ((a, b) for a in self.to for b in self.span):
            self.at(first, second)

    @property
    def way(self) -> int:
        """1 if the quiet side is that of larger values."""
        return 1 if self.to[1] > self.to[0] else -1

    def at(self, value: float, other: float) -> System:
        """Return the system at values of both parameters."""
        return self.system.at({self.parameter: value, self.over: other})


class Hit(NamedTuple):
    """A motion that rattles."""

    #: value, other: Values of both parameters.
    value: float
    other: float
    state: NDArray[np.float64]  #: shape (state_size,): Its state at theta = 0.


@dataclass(frozen=True, eq=False)
class Round:
    """One round of a search for a threshold."""

    tried: Confirmation  #: Motions that were tried: over the whole range first, then just beyond the best limit so far.
    hit: Hit | None  #: The one that rattles farthest towards the quiet side; None if none does.
    extrema: tuple[Extremum, ...]  #: Extrema of the borders that were followed from it.
    notes: tuple[str, ...]  #: Remarks, in sentences.


class ThresholdSearch:
    """Search for a threshold, round by round."""

    def __init__(self, request: Request) -> None:
        request.check()
        self.request = request
        self.rounds: list[Round] = []
        self._rattles_inside = False

    @property
    def is_over(self) -> bool:
        """True if no further round would change the threshold."""
        if not self.rounds:
            return False
        last = self.rounds[-1]
        return last.hit is None or self._best() is None or not last.extrema

    def advance(self) -> Round:
        """Do the next round, and return it."""
        asked, options, best = self.request, self.request.options, self._best()
        if best is None:
            values = np.linspace(*asked.to, _COARSE)
            tried, hit = self._tried(values, np.linspace(*asked.span, max(8, options.values // 2)), _FEW)
        else:
            beyond = best.value + asked.way * _BEYOND * abs(asked.to[1] - asked.to[0])
            if asked.way * (beyond - asked.to[1]) > 0.0:
                beyond = asked.to[1]
            near = _NEAR * (asked.span[1] - asked.span[0])
            low, high = asked.span
            window = max(low, best.at - near), min(high, best.at + near)
            half = options.values // 2
            others = np.unique(np.concatenate((np.linspace(*asked.span, half), np.linspace(*window, half))))
            tried, hit = self._tried(np.array([beyond]), others, options.starts, self._carried(best))
        extrema, notes = list[Extremum](), list[str]()
        if best is None and hit is None:
            notes = ["nothing rattles in the whole range"]
        elif best is None and hit is not None and hit.value == asked.to[1]:
            notes = [
                f"something still rattles at {self._words(asked.to[1])}; widen the range, or, if its first value is "
                f"the quiet end, write from = {self._key(asked.to[1])} and to = {self._key(asked.to[0])}"
            ]
        elif hit is not None and len(self.rounds) < options.rounds:
            extrema, notes = self._follow(hit)
            if best is None and not extrema:
                notes.append(f"something rattles at {self._place(hit)}, but its border could not be followed")
        if best is not None and hit is None and not self._rattles_inside:
            notes = [
                f"just inside the limit, at {self._words(self._inside(best), 7)}, the motion that leaves it "
                "settles without rattle: the limit is safe, but the motions that rattle may cease before it"
            ]
        self.rounds.append(Round(tried, hit, tuple(extrema), tuple(notes)))
        return self.rounds[-1]

    def found(self) -> Threshold:
        """Return the threshold after the rounds that are done."""
        asked, best = self.request, self._best()
        extrema = sorted(self._extrema, key=lambda each: asked.way * each.value)
        limit = None if best is None else best.special
        at, error, is_edge = (math.nan, float("inf"), False) if best is None else (best.at, best.error, best.is_edge)
        return Threshold(
            asked.system,
            asked.gaps,
            asked.parameter,
            *asked.to,
            asked.over,
            *asked.span,
            limit,
            at,
            error,
            is_edge,
            tuple(each.locus for each in extrema),
            self._confirmation,
            tuple(note for each in self.rounds for note in each.notes),
        )

    @property
    def _confirmation(self) -> Confirmation | None:
        """Motions beyond the limit; or those that rattle, if their border could not be followed."""
        last = self.rounds[-1]
        is_inside = last.hit is not None and last.hit.value != self.request.to[1]
        return last.tried if len(self.rounds) > 1 or is_inside else None

    def _place(self, hit: Hit) -> str:
        other = value_words(hit.other, self.request.over, self.request.system.units, 6)
        return f"{self._words(hit.value)}, {other}"

    def _words(self, value: float, digits: int = 6) -> str:
        """Write a value of the parameter."""
        return value_words(value, self.request.parameter, self.request.system.units, digits)

    def _key(self, value: float) -> str:
        """Write a value of the parameter as in a model file."""
        units = self.request.system.units
        unit = units.parameter(self.request.parameter) if units else ""
        return f'"{value:.6g} {unit}"' if unit else f"{value:.6g}"

    @property
    def _extrema(self) -> list[Extremum]:
        return [extremum for each in self.rounds for extremum in each.extrema]

    def _best(self) -> Extremum | None:
        return max(self._extrema, key=lambda each: self.request.way * each.value, default=None)

    def _tried(
        self, values: NDArray[np.float64], others: NDArray[np.float64], starts: int, carried: Sequence[NDArray] = ()
    ) -> tuple[Confirmation, Hit | None]:
        """Follow motions at all pairs of values from some starts until they have settled, and judge them."""
        asked, options = self.request, self.request.options
        ends = [asked.at(value, other) for value in (values[0], values[-1]) for other in (others[0], others[-1])]
        box = np.max([state_box(end) for end in ends], axis=0)
        some = [state_at_rest(asked.system), *spread_starts(ends, box, starts - 1, options.seed, 0.0), *carried]
        grid = np.array(np.meshgrid(others, values, indexing="ij")).reshape(2, -1).T  # equal speeds side by side
        pairs, states = np.repeat(grid, len(some), axis=0), np.tile(some, (len(grid), 1))
        by_name = {asked.over: pairs[:, 0], asked.parameter: pairs[:, 1]}
        found = judge_gaps(asked.system, states, by_name, asked.gaps, options.periods)
        for doubling in range(1, _DOUBLINGS + 1):  # where damping is weak, transients that rattle last long
            left = np.flatnonzero((found.periods == 0) & (found.codes >= 0).all(axis=1))
            if not len(left):
                break
            some_values = {name: each[left] for name, each in by_name.items()}
            later = judge_gaps(asked.system, found.states[left], some_values, asked.gaps, options.periods << doubling)
            for whole, part in zip(found[:4], later[:4], strict=True):
                whole[left] = part
            found = found._replace(error=max(found.error, later.error), waited=found.waited + later.waited)
        is_lost = np.asarray((found.codes < 0).any(axis=1))
        is_quiet = np.isin(found.codes, _QUIET).all(axis=1)

        def motion(k: int) -> Hit:
            return Hit(float(pairs[k, 1]), float(pairs[k, 0]), states[k] if is_lost[k] else found.states[k])

        is_settled = found.periods > 0
        suspects = [(motion(k), bool(is_settled[k])) for k in np.flatnonzero(~is_lost & ~is_quiet).tolist()]
        lost = [motion(k) for k in np.flatnonzero(is_lost).tolist()]
        again = [self._rattles_exactly(each, _LONG) for each in lost[:_RETRIED]]
        hits = [each for each, rattles in zip(lost, again, strict=False) if rattles]
        quiet, checked = np.flatnonzero(is_quiet & is_settled), 0
        if len(values) == 1 and len(quiet):
            sample = np.unique(np.linspace(0, len(quiet) - 1, _CHECKED).astype(int))
            hits += [each for each in map(motion, quiet[sample].tolist()) if self._rattles_exactly(each)]
            checked = len(sample)
        suspects.sort(key=lambda each: -asked.way * each[0].value)
        slow = 0  # motions that are neither periodic nor known to rattle; each takes seconds
        while suspects and not self._rattles_exactly(suspects[0][0], _WATCH if suspects[0][1] else _LONG):
            slow += not suspects[0][1]
            del suspects[0]
            if slow == _RETRIED:
                suspects = [each for each in suspects if each[1]]
        hits += [each for each, _ in suspects]
        restless = int(((found.periods == 0) & ~is_lost).sum())
        gone = len(lost) - sum(rattles is not None for rattles in again)
        counts = len(states), len(some), len(hits), restless, gone, found.waited, checked, found.error
        tried = Confirmation(float(values[-1]), *counts)
        if not hits and (hit := self._walked_into(float(values[0]))) is not None:
            return tried._replace(motions=tried.motions + 1, rattling=1), hit
        return tried, max(hits, key=lambda each: asked.way * each.value, default=None)

    def _walked_into(self, value: float) -> Hit | None:
        """Return a motion that rattles on the branch over the other parameter, as at a resonance between tries."""
        asked, (low, high) = self.request, self.request.span
        with suppress(NumericalError, FlowError):
            orbit = find_orbit(asked.at(value, low))
            for point, _ in BranchTracer(start_branch(orbit, asked.over, high, 1)):
                if point.stable and self._rattles(point.orbit):
                    return Hit(value, point.value, point.orbit.state)
        return None

    def _rattles_exactly(self, hit: Hit, patience: int = _WATCH) -> bool | None:
        """Return True if a motion rattles once it has settled, by the exact flow; None if it does not settle."""
        system, gaps = self.request.at(hit.value, hit.other), self.request.gaps
        try:
            settled = settle(system, hit.state, SettleOptions(max_periods=patience))
            if settled.orbit is not None:
                return self._rattles(settled.orbit)
            if not settled.converged:
                return None
            return any(state.rattles for state in watched(system, settled.state, gaps))
        except FlowError:
            return None

    def _rattles(self, motion) -> bool:
        return any(gap_state(motion, gap).rattles for gap in self.request.gaps)

    def _follow(self, hit: Hit) -> tuple[list[Extremum], list[str]]:
        """Follow the borders that lie near a rattling motion over the other parameter, to their extrema."""
        asked, notes = self.request, list[str]()
        extrema, followed = list[Extremum](), list[float]()
        ranges, size = ((min(asked.to), max(asked.to)), asked.span), _SAME * max(map(abs, asked.to))
        for special in self._borders(hit):
            if any(abs(special.value - value) <= size for value in followed):
                continue  # the same border, met from the other side
            followed.append(special.value)
            try:
                extremum = locus_extremum(special, asked.parameter, asked.over, ranges, asked.way)
            except (NumericalError, ModelError) as error:
                notes.append(f"a {special.kind} at {self._words(special.value)} was not followed: {error}")
                continue
            if all(abs(extremum.value - each.value) > size for each in (*self._extrema, *extrema)):
                extrema.append(extremum)
        return extrema, notes

    def _borders(self, hit: Hit) -> Iterator[SpecialPoint]:
        """Yield the special points along the parameter at which rattle begins and ceases near a rattling motion."""
        asked = self.request
        with suppress(NumericalError):
            quiet = find_orbit(asked.at(asked.to[1], hit.other))
            if not self._rattles(quiet):
                yield from self._first(quiet, asked.to[0], lambda point: self._rattles(point.orbit))
        with suppress(NumericalError):
            settled = settle(asked.at(hit.value, hit.other), hit.state, _SETTLE)
            if settled.orbit is not None:
                yield from self._first(settled.orbit, asked.to[1], lambda point: not self._rattles(point.orbit))

    def _first(self, orbit: Orbit, end: float, is_over) -> Iterator[SpecialPoint]:
        """Yield the point at which a branch towards a value changes: the first graze of a gap after which it is over.

        Or the fold at which it turns back, if the motion rattles there or jumps to one that does.
        """
        asked, last = self.request, None
        switches = {describe_switch(orbit, switch) for gap in asked.gaps for switch in innermost(orbit.system, gap)}
        start = orbit.system[asked.parameter]
        tracer = BranchTracer(start_branch(orbit, asked.parameter, end, 1 if end > start else -1))
        for point, specials in tracer:
            for special in specials:
                if special.kind == Kind.FOLD:
                    if self._rattles(special.orbit) or self._rattles_beyond(special, end > start):
                        yield special
                    return
                if special.kind == Kind.GRAZING and special.contact in switches:
                    last = special
            if last is not None and is_over(point):
                yield last
                return

    def _rattles_beyond(self, fold: SpecialPoint, rises: bool) -> bool:
        """Return True if the motion that is reached by the jump at a fold rattles."""
        asked = self.request
        step = (1 if rises else -1) * _BEYOND * abs(asked.to[1] - asked.to[0])
        hit = Hit(fold.value + step, fold.orbit.system[asked.over], fold.orbit.state)
        return bool(self._rattles_exactly(hit))

    def _carried(self, best: Extremum) -> list[NDArray[np.float64]]:
        """Return states of rattling motions just inside the threshold, as further starts beyond it."""
        system, state = self.request.at(self._inside(best), best.at), best.special.orbit.state * (1.0 + 1e-3)
        self._rattles_inside = False
        try:
            settled = settle(system, state, _SETTLE)
        except (NumericalError, FlowError):
            return []
        self._rattles_inside = bool(self._rattles_exactly(Hit(self._inside(best), best.at, settled.state)))
        return [settled.state]

    def _inside(self, best: Extremum) -> float:
        asked = self.request
        return best.value - asked.way * _BEYOND * abs(asked.to[1] - asked.to[0])
