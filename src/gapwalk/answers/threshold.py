"""Threshold: the value of a parameter beyond which gaps no longer rattle over a whole range of another one.

The record of the limit with its evidence; `gapwalk.answers.threshold` finds it.

Method: docs/howto/studies.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from gapwalk.answers.gap_states import (
    GapState,
    GapVerdicts,
    gap_state,
    innermost,
    judge_gaps,
    watched,
)
from gapwalk.answers.lane_sweep import LanePiece
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.follow import BranchTracer
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.bifurcation.kinds import Kind
from gapwalk.bifurcation.loci.follow_locus import equation_of, follow_locus, plane_of
from gapwalk.bifurcation.loci.gradient import Gradient
from gapwalk.bifurcation.loci.locus import Locus, LocusPoint
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bracketed_root import zero_between_signs
from gapwalk.continuation.corrector import Corrector, powers_of_two
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import ConvergenceError, FlowError, ModelError, NumericalError
from gapwalk.model.bounds import Bounded, Counted, Natural
from gapwalk.model.system import System
from gapwalk.model.words import listed_words, range_words, value_words
from gapwalk.notebook import Shown
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.orbit.shooting import Shooting
from gapwalk.picture_parts import End, Line, Parts, Picture, Series, Shade, curves_of_loci, pictured
from gapwalk.pieces import done, workers_around
from gapwalk.summary import Rows, SummaryParts, Tables, remarks, summarizes

# Extremum of a locus: the largest or smallest value of one parameter on a curve of special points.
#
# Between two points of the locus the slope of one parameter by the other changes its sign where the extremum lies. It
# is exact at each point, from the derivatives of the locus equation, so that a bracketing method ends at rounding.

_EXACT = 1e-12  # relative width of the bracket at which the extremum is located
_EDGE = 1e-9  # share of a range within which a point lies at its end


class Extremum(NamedTuple):
    """Extremum of a locus within a range."""

    special: SpecialPoint  #: The special point there; its value is that of the extremal parameter.
    at: float  #: Value of the other parameter.
    error: float  #: Estimated error of the extremal value.
    is_edge: bool  #: True if it lies at an end of the range, beyond which the locus goes on.
    locus: Locus  #: The locus.

    @property
    def value(self) -> float:
        """The extremal value."""
        return self.special.value


def locus_extremum(
    special: SpecialPoint,
    parameter: str,
    over: str,
    to: tuple[tuple[float, float], tuple[float, float]],
    way: int,
) -> Extremum:
    """Follow a special point over one parameter to the extremum of another."""
    locus = follow_locus(special, parameter, over, to)
    points = list(locus.points)
    best = max(range(len(points)), key=lambda k: way * points[k].values[0])
    there = points[best]
    width = to[1][1] - to[1][0]
    is_edge = min(abs(there.values[1] - end) for end in to[1]) < _EDGE * width
    neighbours = [points[k] for k in (best - 1, best + 1) if 0 <= k < len(points)]
    curve = _Curve(special, locus, there, neighbours)
    if is_edge or len(neighbours) < 2:
        return Extremum(curve.special(there), there.values[1], _blur(there), is_edge, locus)
    low, high = sorted(point.values[1] for point in neighbours)
    try:
        at, value = curve.turning(low, high)
    except (ConvergenceError, ValueError):  # a cusp, or a corner: the point of the walk is the best there is
        spread = max(abs(point.values[0] - there.values[0]) for point in neighbours)
        return Extremum(curve.special(there), there.values[1], spread, False, locus)
    return Extremum(curve.special(curve.point(at)), at, _blur(there) + _EXACT * abs(value), False, locus)


class _Curve:
    """A locus near one of its points, as a function of the second parameter."""

    def __init__(self, special: SpecialPoint, locus: Locus, near: LocusPoint, neighbours: Sequence[LocusPoint]) -> None:
        self.first, self.locus, self.near, self.names = special, locus, near, (locus.first, locus.second)
        plane = plane_of(Shooting(), near.orbit, self.names)
        widths = [abs(value) or 1.0 for value in near.values]
        equation, unknowns, scales = equation_of(plane, _special(special, locus, near), widths)
        self._corrector = Corrector(equation, powers_of_two(scales))
        known = [(unknowns, near), *((equation.unknowns(each.orbit), each) for each in neighbours)]
        # guesses: points that are known, in scaled variables; on a narrow peak only the nearest one leads to a point
        self._known = [np.append(those, each.values[1]) / self._corrector.scales for those, each in known]

    def turning(self, low: float, high: float) -> tuple[float, float]:
        """Return where the first parameter is stationary between two values of the second, and its value there."""
        finest = _EXACT * abs(high - low)
        at = zero_between_signs(lambda value: self._solved(value)[1], low, high, absolute=finest, relative=1e-14)
        return at, self._solved(at)[0]

    def point(self, at: float) -> LocusPoint:
        """Return the point of the locus at a value of the second parameter."""
        correction = self._corrected(at)
        x = correction.x * self._corrector.scales
        equation = self._corrector.equation
        orbit = equation.orbit(x[:-1], float(x[-1]), correction.evaluation)
        values = orbit.system[self.names[0]], orbit.system[self.names[1]]
        return LocusPoint(values, orbit, self.near.angle, correction.x, self.near.tangent, self.near.arclength)

    def special(self, point: LocusPoint) -> SpecialPoint:
        """Return a point of the locus as a special point of the branch along the first parameter."""
        # The orbit of a graze keeps a small distance from the breakpoint; the value is that of the touch itself.
        found, equation = _special(self.first, self.locus, point), self._corrector.equation
        if not isinstance(equation, GrazingEquation):
            return found
        correction, scales = self._corrected(point.values[1]), self._corrector.scales
        deeper = np.zeros(len(scales) - 1)
        deeper[-2] = -equation.depth  # the residual of the depth, before that of the rate
        moved = np.linalg.solve(correction.evaluation.by_unknowns * scales[:-1], deeper)[-1] * scales[-2]
        return replace(found, point=replace(found.point, value=found.value + float(moved)))

    def _solved(self, at: float) -> tuple[float, float]:
        """Return the first parameter at a value of the second, and its slope."""
        correction, scales = self._corrected(at), self._corrector.scales
        evaluation = correction.evaluation
        assert evaluation.by_parameter is not None
        slopes = np.linalg.solve(evaluation.by_unknowns * scales[:-1], -evaluation.by_parameter)
        return float(correction.x[-2] * scales[-2]), float(slopes[-1] * scales[-2])

    def _corrected(self, at: float):
        guess = min(self._known, key=lambda x: abs(x[-1] * self._corrector.scales[-1] - at))
        correction = self._corrector.at_value(guess, at)
        if correction is None:
            raise ConvergenceError(f"the locus has no point at {self.names[1]} = {at:.10g}")
        self._known.append(correction.x)
        return correction


def _special(special: SpecialPoint, locus: Locus, point: LocusPoint) -> SpecialPoint:
    """Return a point of a locus as a special point of the branch along the first parameter."""
    value = point.values[0]
    branch_point = BranchPoint(value, point.orbit, point.x, point.tangent, math.nan, math.nan)
    sides = point.orbit.instability
    return SpecialPoint(special.kind, branch_point, sides, sides, math.nan, locus.contact, parameter=locus.first)


def _blur(point: LocusPoint) -> float:
    """Return the rounding of a parameter of a point."""
    return 1e-10 * abs(point.values[0])


_SMOOTH = 1e-6  # error of a limit, relative to the range, above which its locus was not smooth there


@dataclass(frozen=True, slots=True)
class ThresholdOptions(Bounded):
    """Options of a threshold."""

    values: Annotated[int, Ge(4)] = 24  #: Values of the other parameter at which motions are tried.
    starts: Annotated[int, Ge(2)] = 10  #: Starts at each of them: rest, and states spread over a box.
    #: Number of forcing periods in which motions may become periodic. Those that have not are followed up to 60 times
    #: as long.
    periods: Annotated[int, Ge(16)] = 600
    rounds: Counted = 6  #: The most borders that are followed one after the other.
    seed: Natural = 0  #: Seed of the starts.


class Confirmation(NamedTuple):
    """Motions that were tried, such as those just beyond a threshold."""

    value: float  #: Value of the parameter; of several, the last one.
    #: motions, starts: Number of motions, and of starts at each pair of values.
    motions: int
    starts: int
    rattling: int  #: Number of those that rattle once they have settled.
    #: restless, lost: Number of those that did not become periodic, and of those that diverge; the others are settled.
    restless: int
    lost: int
    waited: int  #: Largest number of forcing periods of the transients, before the gaps were observed.
    checked: int  #: Number of quiet motions that were confirmed by the exact flow too.
    error: float  #: Error of the batch integrator over a forcing period of settled motions, relative to their size.

    @property
    def settled(self) -> int:
        """Number of motions that became periodic: of these it is known whether they rattle."""
        return self.motions - self.restless - self.lost

    @property
    def words(self) -> str:
        """Description of how the motions were tried."""
        text = f"{self.starts} starts at each value, followed until motions repeat, for at most {self.waited} periods"
        if self.restless:
            text += f"; {self.restless} motions had not settled by then and do not count"
        if self.lost:
            text += f"; {self.lost} motions diverged and do not count"
        if self.error:
            text += f"; error {self.error:.0e} of the motion in a period"
        return text + (f"; {self.checked} quiet motions checked with the exact flow" if self.checked else "")


@dataclass(frozen=True, eq=False, repr=False)
class Threshold(Shown):
    """Value of a parameter beyond which gaps do not rattle over a range of another one."""

    system: System  #: The system.
    gaps: tuple[str, ...]  #: Names of the contacts concerned.
    #: parameter, begin, end: The parameter and its range, from the side that rattles to the side that is quiet.
    parameter: str
    begin: float
    end: float
    #: over, low, high: The other parameter, and its range.
    over: str
    low: float
    high: float
    #: The special point at the threshold, of the branch along `parameter`; None if there is no threshold in the range.
    limit: SpecialPoint | None
    at: float  #: Value of the other parameter at the limit.
    uncertainty: float  #: Estimated error of the threshold.
    is_edge: bool  #: True if the limit lies at an end of this range, so that a wider range has another limit.
    loci: tuple[Locus, ...]  #: Loci that were followed, the decisive one last.
    confirmation: Confirmation | None  #: Motions that were tried just beyond the threshold.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.
    #: Without a limit: the last value at which something rattles, and the first at which nothing does; else empty.
    between: tuple[float, ...] = ()
    #: The gaps that rattle at the last value at which a motion was seen to rattle, before the threshold.
    last: tuple[str, ...] = ()
    #: shape (points, 3): By equal steps: values of `over` and of `parameter` at which motions were tried, and 1 where
    #: one rattles, else 0.
    points: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    #: Before the end of the search: where each gap rattles, in sentences.
    so_far: tuple[str, ...] = field(default=(), metadata={"stored": False})

    @property
    def value(self) -> float:
        """The threshold; nan if there is none in the range."""
        if self.between:
            return self.between[1]
        return math.nan if self.limit is None else self.limit.value

    @property
    def failures(self) -> tuple[str, ...]:
        """Reason why there is no confirmed threshold, as sentences."""
        found = self.confirmation
        if found is None or not found.rattling:
            return ()
        where = "beyond it" if self.limit is not None else "in the range"
        return (f"{found.rattling} of {found.motions} motions rattle {where}, and their border could not be followed",)

    def gradient(self, *names: str) -> Gradient:
        """Return how far other parameters move the threshold; see `SpecialPoint.gradient`."""
        # At an extremum the slope by the other parameter is zero, so these are the slopes of the limit itself.
        if self.limit is None:
            raise ModelError("there is no threshold in the range, so it has no gradient")
        return self.limit.gradient(*names)

    @property
    def complete(self) -> bool:
        """True if the search is over."""
        return not self.so_far

    @property
    def is_of_points(self) -> bool:
        """True if the motions that were tried are all there is to draw: no border was followed to a limit."""
        whole = self.complete and bool(self.loci)
        return bool(self.between) or (self.limit is None and not whole and len(self.points) > 0)

    def tables(self) -> Tables:
        """Return the tables of the loci, both parameters at each of their points, and of the motions tried by steps."""
        return {"tried": self._tried_rows} if self.is_of_points and len(self.points) else {"loci": self._rows}

    def _tried_rows(self) -> Rows:
        yield [self.over, self.parameter, "rattles"]
        yield from self.points.tolist()

    def _rows(self) -> Rows:
        yield ["locus", "kind", self.over, self.parameter]
        for number, locus in enumerate(self.loci, start=1):
            for value, other in locus.values.tolist():
                yield [number, str(locus.kind), other, value]

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        if self.so_far:
            return "; ".join(self.so_far)
        units = self.system.units
        gaps, over = listed_words(self.gaps), range_words((self.low, self.high), self.over, units)
        verb = "does" if len(self.gaps) == 1 else "do"
        way = "and above" if self.end > self.begin else "and below"
        if self.between:
            last, first = (value_words(value, self.parameter, units, 6) for value in self.between)
            place = value_words(self.at, self.over, units, 6)
            left = rattle_words(self.last, "still ")
            edge = ", an end of the range: a wider one may have another threshold" * (self.at in (self.low, self.high))
            return f"{gaps} {verb} not rattle over {over} at {first} {way} ({left} at {last}, {place}{edge})"
        if self.limit is None:
            left = rattle_words(self.last, "still ")
            end = f": {left} at {value_words(self.end, self.parameter, units, 6)}"
            none = f"{gaps}: no threshold of {range_words((self.begin, self.end), self.parameter, units)} over {over}"
            return none + end * any(note.startswith(left) for note in self.notes)
        several, contact = len(self.gaps) > 1, self.limit.contact.rpartition(" ")[0]
        limit = f"{self.limit.kind.value}{f' of {contact}' * (several and bool(contact))}"
        last = f"; before it {rattle_words(self.last)}" if several and self.last and not contact else ""
        return (
            f"{gaps} {verb} not rattle over {over} at "
            f"{value_words(self.value, self.parameter, units, 7)} {way} "
            f"(limit: {limit} at {value_words(self.at, self.over, units, 7)}{last})"
        )

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the answer, its evidence, and what moves it most; with the notes or without."""
        yield from self.so_far or (self.sentence,)
        units = self.system.units
        unit = units.parameter(self.parameter) if units else ""
        if self.limit is not None:
            place = " (at an end of the range: a wider range has another limit)" if self.is_edge else ""
            yield f"error of the limit {self.uncertainty:.0e}{f' {unit}' if unit else ''}{place}"
        if (found := self.confirmation) is not None and not found.rattling:
            share = min(300.0 / max(found.settled, 1), 100.0)
            yield (
                f"confirmed at {value_words(found.value, self.parameter, units, 7)}: none of {found.settled:,} settled "
                f"motions rattles there, so with 95 % confidence fewer than {share:.2g} % of such starts do"
            )
            yield f"({found.words})"
        if self.between:
            yield f"the limit lies between {self.between[0]:.8g} and {self.between[1]:.8g}{f' {unit}' if unit else ''}"
        elif self.limit is not None and self.uncertainty > _SMOOTH * abs(self.end - self.begin):
            yield "the limit is a corner of its locus, such as a cusp, so it has no slopes"
        elif self.limit is not None:
            with suppress(NumericalError, ModelError):
                yield f"what moves it most, in percent for one percent more: {self.gradient().words(5)}"
        if notes:
            yield from remarks(self.notes, self.failures)

    def __repr__(self) -> str:
        return f"Threshold({self.sentence})"


# Search for a threshold, round by round: borders followed to their extrema, then many motions tried beyond them.
#
# The quiet motion begins to rattle where a contact grazes, and rattling motions cease at grazing points or folds. All
# of these lie on loci in the plane of both parameters. The threshold is the extremum of the locus that reaches
# farthest. It is found from both sides, and then confirmed: many motions from random starts just beyond it are
# followed until they have settled. If one of them rattles, its own border is followed in the same way. The batch
# integrator follows them; one that rattles is followed by the exact flow before it counts, and so are some of the
# quiet ones. If none rattles, the quiet motion is walked over the range of the other parameter, which misses no narrow
# resonance.
#
# Method: docs/howto/studies.md

_TOGETHER = 64  # motions that are tried at a time: with the same steps, and as a piece of work for any process
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


def rattle_words(gaps: Sequence[str], adverb: str = "") -> str:
    """Write which gaps rattle; they may be unknown."""
    return f"{listed_words(gaps) if gaps else 'something'} {adverb}rattle{'s' * (len(gaps) < 2)}"


class Hit(NamedTuple):
    """A motion that rattles."""

    #: value, other: Values of both parameters.
    value: float
    other: float
    state: NDArray[np.float64]  #: shape (state_size,): Its state at theta = 0.
    gaps: tuple[str, ...] = ()  #: Those that rattle in it; empty if that is not known.

    def words(self, adverb: str = "") -> str:
        """Write what rattles in it: ``mesh1 and mesh2 still rattle``."""
        return rattle_words(self.gaps, adverb)


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

    @property
    def coarse(self) -> NDArray[np.float64]:
        """Values of the parameter at which motions are tried first."""
        return np.linspace(*self.to, _COARSE)

    def at(self, value: float, other: float) -> System:
        """Return the system at values of both parameters."""
        return self.system.at({self.parameter: value, self.over: other})

    # Pieces of work, for any process.

    def judged(self, piece: tuple[NDArray[np.float64], NDArray[np.float64]]) -> Tried:
        """Follow some motions until they have settled, and judge their gaps."""
        # Shapes: `pairs` (motions, 2), of the other parameter and the parameter; `states` (motions, state_size).
        pairs, states = piece
        by_name, periods = {self.over: pairs[:, 0], self.parameter: pairs[:, 1]}, self.options.periods
        found = judge_gaps(self.system, states, by_name, self.gaps, periods)
        # where damping is weak, transients that rattle last long; equal steps have rules of their own for that
        for doubling in () if prefers_lanes(self.system) else range(1, _DOUBLINGS + 1):
            left = np.flatnonzero((found.periods == 0) & (found.codes >= 0).all(axis=1))
            if not len(left):
                break
            some_values = {name: each[left] for name, each in by_name.items()}
            later = judge_gaps(self.system, found.states[left], some_values, self.gaps, periods << doubling)
            for whole, part in zip(found[:4], later[:4], strict=True):
                whole[left] = part
            found = found._replace(error=max(found.error, later.error), waited=found.waited + later.waited)
        counts = (found.codes >= 0).all(axis=1) & ((found.periods > 0) | prefers_lanes(self.system))
        motions = (
            Hit(value, other, found.states[k], self.rattling_by(found.codes[k]))
            for k, (other, value) in enumerate(pairs.tolist())
            if counts[k]
        )
        return Tried(tuple(motions), found)

    def rattles_exactly(self, piece: tuple[Hit, int]) -> bool | None:
        """Return True if a motion rattles once it has settled, by the exact flow; None if it does not settle."""
        hit, patience = piece
        system = self.at(hit.value, hit.other)
        try:
            settled = settle(system, hit.state, SettleOptions(max_periods=patience))
            if settled.orbit is not None:
                return self.rattles(settled.orbit)
            if not settled.converged:
                return None
            return any(state.rattles for state in watched(system, settled.state, self.gaps))
        except FlowError:
            return None

    def rattles(self, motion) -> bool:
        """Return True if a gap rattles along a motion."""
        return bool(self.rattling(motion))

    def rattling(self, motion) -> tuple[str, ...]:
        """Return the gaps that rattle along a motion."""
        return tuple(gap for gap in self.gaps if gap_state(motion, gap).rattles)

    def rattling_by(self, codes: NDArray[np.int_]) -> tuple[str, ...]:
        """Return the gaps that rattle by their codes in a motion, shape (gaps,)."""
        return tuple(gap for gap, code in zip(self.gaps, codes.tolist(), strict=True) if code not in (-1, *_QUIET))

    def walked_into(self, value: float) -> Hit | None:
        """Return a motion that rattles on the branch over the other parameter, as at a resonance between tries."""
        low, high = self.span
        with suppress(NumericalError, FlowError):
            orbit = find_orbit(self.at(value, low))
            for point, _ in BranchTracer(start_branch(orbit, self.over, high, 1)):
                if point.stable and self.rattles(point.orbit):
                    return Hit(value, point.value, point.orbit.state, self.rattling(point.orbit))
        return None

    def border(self, piece: tuple[Hit, bool]) -> SpecialPoint | None:
        """Return the special point along the parameter at which rattle begins, or ceases, near a rattling motion."""
        hit, begins = piece
        with suppress(NumericalError):
            if begins:
                quiet = find_orbit(self.at(self.to[1], hit.other))
                if not self.rattles(quiet):
                    return self._first(quiet, self.to[0], lambda point: self.rattles(point.orbit))
                return None
            settled = settle(self.at(hit.value, hit.other), hit.state, _SETTLE)
            if settled.orbit is not None:
                return self._first(settled.orbit, self.to[1], lambda point: not self.rattles(point.orbit))
        return None

    def _first(self, orbit: Orbit, end: float, is_over) -> SpecialPoint | None:
        """Return the point at which a branch towards a value changes: the first graze of a gap after which it is over.

        Or the fold at which it turns back, if the motion rattles there or jumps to one that does.
        """
        last = None
        switches = {describe_switch(orbit, switch) for gap in self.gaps for switch in innermost(orbit.system, gap)}
        start = orbit.system[self.parameter]
        tracer = BranchTracer(start_branch(orbit, self.parameter, end, 1 if end > start else -1))
        for point, specials in tracer:
            for special in specials:
                if special.kind == Kind.FOLD:
                    is_border = self.rattles(special.orbit) or self._rattles_beyond(special, end > start)
                    return special if is_border else None
                if special.kind == Kind.GRAZING and special.contact in switches:
                    last = special
            if last is not None and is_over(point):
                return last
        return None

    def _rattles_beyond(self, fold: SpecialPoint, rises: bool) -> bool:
        """Return True if the motion that is reached by the jump at a fold rattles."""
        step = (1 if rises else -1) * _BEYOND * abs(self.to[1] - self.to[0])
        hit = Hit(fold.value + step, fold.orbit.system[self.over], fold.orbit.state)
        return bool(self.rattles_exactly((hit, _WATCH)))

    def extremum(self, special: SpecialPoint) -> Extremum | str:
        """Follow a border over the other parameter to its extremum; in words why it was not followed."""
        within = (min(self.to), max(self.to)), self.span
        try:
            return locus_extremum(special, self.parameter, self.over, within, self.way)
        except (NumericalError, ModelError) as error:
            return str(error)


@dataclass(frozen=True, eq=False)
class Tried:
    """Motions that were tried in one piece of the work."""

    motions: tuple[Hit, ...]  #: Those that count; quiet ones have no gaps.
    verdicts: GapVerdicts | None = None  #: What the gaps of all do, if they were judged together.
    swept: LanePiece | None = None  #: The piece of a sweep that they are.


Steps = Generator[Any, None, list[Tried]]
Each = Callable[[Callable[[Any], Tried], Sequence[Any]], Steps]
"""Does pieces of work, and yields what of it is to be stored; returns what was tried, in the order of the pieces."""


def points_of(motions: Sequence[Hit]) -> NDArray[np.float64]:
    """Return where motions were tried, and whether one rattles there, as of `Threshold`."""
    seen = {(each.other, each.value): bool(each.gaps) for each in sorted(motions, key=lambda each: bool(each.gaps))}
    return np.array([(*pair, rattles) for pair, rattles in seen.items()], dtype=float).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Round:
    """One round of a search for a threshold."""

    tried: Confirmation  #: Motions that were tried: over the whole range first, then just beyond the best limit so far.
    hit: Hit | None  #: The one that rattles farthest towards the quiet side; None if none does.
    extrema: tuple[Extremum, ...]  #: Extrema of the borders that were followed from it.
    notes: tuple[str, ...]  #: Remarks, in sentences.
    quiet: float = math.nan  #: By equal steps: the value nearest to the hit at which nothing rattles.
    confirms: bool = False  #: True if it tries that value from random starts.
    band: tuple[Hit, ...] = ()  #: By equal steps: all that rattle at the value of the hit.
    #: shape (points, 3): As of `Threshold`.
    points: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))


class ThresholdSearch:
    """Search for a threshold, round by round."""

    usual: ClassVar[tuple[int, int]] = 2, 4
    """How many rounds most searches need, and pieces of work in a round."""

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

    @property
    def _hit(self) -> Hit | None:
        """The motion that rattles farthest towards the quiet side."""
        hits = [each.hit for each in self.rounds if each.hit is not None]
        return max(hits, key=lambda each: self.request.way * each.value, default=None)

    def _widen(self, hit: Hit) -> str:
        asked = self.request
        return (
            f"{hit.words('still ')} at {self._place(hit)}; widen the range, or, if its first value is the quiet end, "
            f"write from = {self._key(asked.to[1])} and to = {self._key(asked.to[0])}"
        )

    def advance(self, each: Each) -> Generator[Any]:
        """Do the next round."""
        asked, options, best = self.request, self.request.options, self._best()
        if best is None:
            others = np.linspace(*asked.span, max(8, options.values // 2))
            tried, hit = yield from self._tried(each, asked.coarse, others, _FEW)
        else:
            beyond = best.value + asked.way * _BEYOND * abs(asked.to[1] - asked.to[0])
            if asked.way * (beyond - asked.to[1]) > 0.0:
                beyond = asked.to[1]
            near = _NEAR * (asked.span[1] - asked.span[0])
            low, high = asked.span
            window = max(low, best.at - near), min(high, best.at + near)
            half = options.values // 2
            others = np.unique(np.concatenate((np.linspace(*asked.span, half), np.linspace(*window, half))))
            starts = options.starts, self._carried(best)
            tried, hit = yield from self._tried(each, np.array([beyond]), others, *starts)
        extrema, notes = list[Extremum](), list[str]()
        if best is None and hit is None:
            notes = ["nothing rattles in the whole range"]
        elif best is None and hit is not None and hit.value == asked.to[1]:
            notes = [self._widen(hit)]
        elif hit is not None and len(self.rounds) < options.rounds:
            extrema, notes = self._follow(hit)
            if best is None and not extrema:
                notes.append(f"{hit.words()} at {self._place(hit)}, but its border could not be followed")
        if best is not None and hit is None and not self._rattles_inside:
            notes = [
                f"a motion that starts just inside the limit, at {self._words(self._inside(best), 7)}, settles without "
                "rattle: the limit is safe, but motions may cease to rattle before it is reached"
            ]
        self.rounds.append(Round(tried, hit, tuple(extrema), tuple(notes)))

    def so_far(self, motions: Sequence[Hit]) -> Threshold:
        """Return what is known before the search is over, by the motions that were tried."""
        asked, loci = self.request, tuple(each.locus for each in self._extrema)
        where = asked.parameter, *asked.to, asked.over, *asked.span
        limit = None, math.nan, float("inf"), False
        rattling = {gap for each in motions for gap in each.gaps}
        seen = [self._seen(gap, motions) for gap in asked.gaps if gap in rattling]
        if quiet := [gap for gap in asked.gaps if gap not in rattling]:
            seen.append(f"{listed_words(quiet)} rattle{'s' * (len(quiet) < 2)} in none of {len(motions)} motions")
        about = loci, None, (), (), (), points_of(motions), tuple(seen)
        return Threshold(asked.system, asked.gaps, *where, *limit, *about)

    def _seen(self, gap: str, motions: Sequence[Hit]) -> str:
        """Write between which values a gap ceases to rattle, by the motions that were tried."""
        way = self.request.way
        last = max((each for each in motions if gap in each.gaps), key=lambda each: way * each.value)
        beyond = [each for each in motions if way * (each.value - last.value) > 0.0]
        if not beyond:
            return f"{gap} rattles at {self._place(last)}; nothing was tried beyond"
        first = self._words(min(beyond, key=lambda each: way * each.value).value)
        return f"{gap} rattles at {self._place(last)}, and in none of {len(beyond)} motions from {first} on"

    def found(self) -> Threshold:
        """Return the threshold after the rounds that are done."""
        asked, best = self.request, self._best()
        extrema = sorted(self._extrema, key=lambda each: asked.way * each.value)
        limit = None if best is None else best.special
        at, error, is_edge = (math.nan, float("inf"), False) if best is None else (best.at, best.error, best.is_edge)
        hit, notes = self._hit, [note for each in self.rounds for note in each.notes]
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
            tuple(notes),
            (),
            () if hit is None else hit.gaps,
            np.vstack([each.points for each in self.rounds]),
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
        self,
        each: Each,
        values: NDArray[np.float64],
        others: NDArray[np.float64],
        starts: int,
        carried: Sequence[NDArray] = (),
    ) -> Generator[Any, None, tuple[Confirmation, Hit | None]]:
        """Follow motions at all pairs of values from some starts until they have settled, and judge them."""
        asked, options = self.request, self.request.options
        ends = [asked.at(value, other) for value in (values[0], values[-1]) for other in (others[0], others[-1])]
        box = np.max([state_box(end) for end in ends], axis=0)
        some = [state_at_rest(asked.system), *spread_starts(ends, box, starts - 1, options.seed, 0.0), *carried]
        grid = np.array(np.meshgrid(others, values, indexing="ij")).reshape(2, -1).T  # equal speeds side by side
        pairs, states = np.repeat(grid, len(some), axis=0), np.tile(some, (len(grid), 1))
        found, _ = yield from self._judged(each, pairs, states, max(1, _TOGETHER // len(some)) * len(some))
        is_lost = np.asarray((found.codes < 0).any(axis=1))
        is_quiet = np.isin(found.codes, _QUIET).all(axis=1)

        def motion(k: int) -> Hit:
            state, gaps = states[k] if is_lost[k] else found.states[k], asked.rattling_by(found.codes[k])
            return Hit(float(pairs[k, 1]), float(pairs[k, 0]), state, gaps)

        is_settled = found.periods > 0
        suspects = [(motion(k), bool(is_settled[k])) for k in np.flatnonzero(~is_lost & ~is_quiet).tolist()]
        lost = [motion(k) for k in np.flatnonzero(is_lost).tolist()]
        again = done(asked.rattles_exactly, [(each, _LONG) for each in lost[:_RETRIED]])
        hits = [each for each, rattles in zip(lost, again, strict=False) if rattles]
        quiet, checked = np.flatnonzero(is_quiet & is_settled), 0
        if len(values) == 1 and len(quiet):
            sample = np.unique(np.linspace(0, len(quiet) - 1, _CHECKED).astype(int))
            motions = [motion(k) for k in quiet[sample].tolist()]
            watch = done(asked.rattles_exactly, [(each, _WATCH) for each in motions])
            hits += [each for each, rattles in zip(motions, watch, strict=True) if rattles]
            checked = len(sample)
        hits += self._confirmed(sorted(suspects, key=lambda each: -asked.way * each[0].value))
        restless = int(((found.periods == 0) & ~is_lost).sum())
        gone = len(lost) - sum(rattles is not None for rattles in again)
        counts = len(states), len(some), len(hits), restless, gone, found.waited, checked, found.error
        tried = Confirmation(float(values[-1]), *counts)
        if not hits and (hit := asked.walked_into(float(values[0]))) is not None:
            return tried._replace(motions=tried.motions + 1, rattling=1), hit
        return tried, max(hits, key=lambda each: asked.way * each.value, default=None)

    def _judged(
        self, each: Each, pairs: NDArray[np.float64], states: NDArray[np.float64], size: int = _TOGETHER
    ) -> Generator[Any, None, tuple[GapVerdicts, list[Hit]]]:
        """Follow motions until they have settled, in pieces of some size; return verdicts, and those that count."""
        pieces = [(pairs[first : first + size], states[first : first + size]) for first in range(0, len(pairs), size)]
        tried = yield from each(self.request.judged, pieces)
        parts = [part.verdicts for part in tried if part.verdicts is not None]
        codes, periods, peaks, ends = map(np.concatenate, zip(*(part[:4] for part in parts), strict=True))
        error, waited = max(part.error for part in parts), max(part.waited for part in parts)
        return GapVerdicts(codes, periods, peaks, ends, error, waited), [one for part in tried for one in part.motions]

    def _confirmed(self, suspects: list[tuple[Hit, bool]]) -> list[Hit]:
        """Return motions that seem to rattle, from the first on that does so by the exact flow."""
        pieces, slow = [(hit, _WATCH if is_settled else _LONG) for hit, is_settled in suspects], 0

        def is_needed(k: int) -> bool:  # those that are neither periodic nor known to rattle take seconds each
            return suspects[k][1] or slow < _RETRIED

        for k, rattles in workers_around().each(self.request.rattles_exactly, pieces, is_needed):
            if rattles:
                return [suspects[later][0] for later in range(k, len(suspects)) if is_needed(later)]
            slow += not suspects[k][1]
        return []

    def _follow(self, hit: Hit) -> tuple[list[Extremum], list[str]]:
        """Follow the borders that lie near a rattling motion over the other parameter, to their extrema."""
        asked, notes = self.request, list[str]()
        extrema, borders = list[Extremum](), list[SpecialPoint]()
        size = _SAME * max(map(abs, asked.to))
        for special in done(asked.border, [(hit, True), (hit, False)]):
            if special is not None and all(abs(special.value - each.value) > size for each in borders):
                borders.append(special)  # unless it is the same border, met from the other side
        for special, extremum in zip(borders, done(asked.extremum, borders), strict=True):
            if isinstance(extremum, str):
                notes.append(f"a {special.kind} at {self._words(special.value)} was not followed: {extremum}")
            elif all(abs(extremum.value - each.value) > size for each in (*self._extrema, *extrema)):
                extrema.append(extremum)
        return extrema, notes

    def _carried(self, best: Extremum) -> list[NDArray[np.float64]]:
        """Return states of rattling motions just inside the threshold, as further starts beyond it."""
        system, state = self.request.at(self._inside(best), best.at), best.special.orbit.state * (1.0 + 1e-3)
        self._rattles_inside = False
        try:
            settled = settle(system, state, _SETTLE)
        except (NumericalError, FlowError):
            return []
        self._rattles_inside = bool(
            self.request.rattles_exactly((Hit(self._inside(best), best.at, settled.state), _WATCH))
        )
        return [settled.state]

    def _inside(self, best: Extremum) -> float:
        asked = self.request
        return best.value - asked.way * _BEYOND * abs(asked.to[1] - asked.to[0])


@pictured(Threshold)
def threshold_picture(found: Threshold) -> Picture:
    """Describe the borders of rattle in the plane of both parameters, the quiet side, and the limit."""
    return Picture(
        found.system,
        (found.over, found.parameter),
        curves_of_loci(found.loci, "{}: rattle begins or ceases"),
        partial(_parts_of_picture, found),
        sentences=found.so_far or [found.sentence],
        heading=[found.sentence, *(found.notes if found.is_of_points else ())],
        script="record.loci",
        empty=""
        if found.loci or found.is_of_points
        else ". ".join((*found.notes, *found.failures)) or "nothing was followed",
    )


def _parts_of_picture(found: Threshold) -> Parts:
    """Return the quiet side, the limit, and what moves it."""
    within = {found.over: (found.low, found.high), found.parameter: tuple(sorted((found.begin, found.end)))}
    if found.is_of_points:
        low, high = sorted((found.value, found.end))
        axes, (x, y, rattles) = (found.over, found.parameter), found.points.T
        looks = (
            ("dots", rattles == 0.0, "other", "tried: quiet"),
            ("crosses", rattles > 0.0, "main", "tried: rattles"),
        )
        return Parts(
            layers=[
                *(Series(x[own], y[own], mark, look, text, axes=axes) for mark, own, look, text in looks if own.any()),
                *(
                    Series([found.at], [y], "stars", "worst", "the last that rattles", axes=axes)
                    for y in found.between[:1]
                ),
            ],
            shades=[Shade(found.parameter, low, high, "quiet", "nothing rattles")] if found.between else [],
            lines=[Line(found.parameter, found.value)] if found.between else [],
            within=within,
        )
    if found.limit is None:
        return Parts(within=within)
    axes, units = (found.over, found.parameter), found.system.units
    low, high = sorted((found.value, found.end))
    ends = ((found.value, found.parameter), (found.at, found.over))
    note = " at ".join(f"{value:.6g} {units.parameter(name) if units else ''}".rstrip() for value, name in ends)
    place = {found.over: found.at, found.parameter: found.value}
    return Parts(
        layers=[Series([found.at], [found.value], "stars", "worst", f"limit: {note}", axes=axes, notes=(note,))],
        shades=[Shade(found.parameter, low, high, "quiet", "nothing rattles")],
        lines=[Line(found.parameter, found.value)],
        ends=[End(f"limit: {note}", found.limit.kind.value, place=place, gradient=found.gradient)],
        within=within,
    )
