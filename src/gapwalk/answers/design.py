"""A design: the changed parameters, how far each goal is reached, and the proof on the response of the new design."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import kept, released, usual_gaps
from gapwalk.answers.goals import (
    COARSE,
    EXACT,
    MARGIN,
    AnyGoal,
    Goal,
    LocalResponse,
    Need,
    NoPoint,
    Quiet,
    unstable_spans,
)
from gapwalk.answers.lane_sweep import is_many
from gapwalk.answers.settled_curve import SettledCurve
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated.search import FoundOrbit, search
from gapwalk.bifurcation.isolated.search_starts import SearchOptions
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.bounds import Bounded, Counted, Fraction, Natural, Positive, check_fields
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.measures import full_measure
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.words import between_words, parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.find import carry, find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.picture_parts import Bar, Line, NamedCurve, Parts, Picture, Shade, pictured
from gapwalk.pieces import stage, workers_around
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, summarizes

# The least change of some parameters that reaches all goals, found by gradients and proved on the new response.
#
# The change is measured by the weighted sum of squares of relative changes. Each step solves the problem with
# linearised margins (sequential quadratic programming, Nocedal and Wright 2006, chapter 18) inside a trust region. The
# response of the next design is then walked again, so that special points that have appeared or vanished on the way
# count at once. A step is taken if the sum of the change and a penalty on the largest missing margin decreases.

_PENALTY, _STRONGEST = 10.0, 1e5  # on the largest missing margin, at first and at most
_TRUST, _WIDEST = 0.1, 0.5  # radius of the trust region, in relative changes
_DONE = 1e-6  # relative changes, and missing margins relative to the safety margin, that no longer count
_NARROWEST = 1e-5  # radius at which a search is stuck
_HOPELESS = 1.5  # ratio to the least change known at which a search that still misses goals is given up
# largest step of a response without gaps; steps of `SettledCurve` between two values at which a new train is settled
_SMOOTH, _WATCHED = 0.05, 8
_ACCEPTED, _GOOD = 0.05, 0.7  # shares of the predicted decrease


@dataclass(frozen=True, slots=True)
class Change:
    """A parameter that may change.

    Examples
    --------
    >>> gw.ask.Change("stop.clearance", by=0.3).bounds(system)
    (0.7, 1.3)
    """

    parameter: str  #: Name of the parameter.
    by: Positive = 0.5  #: Largest relative change in either direction; 0.5 is 50 %.
    #: low, high: Limits of the value of the parameter, given in place of `by`.
    low: float | None = None
    high: float | None = None
    #: Weight of the relative change in the sum of squares that is minimised: a parameter with a larger weight changes
    #: less.
    weight: Positive = 1.0

    def __post_init__(self) -> None:
        check_fields(self, f" of {self.parameter}")

    def bounds(self, system: System) -> tuple[float, float]:
        """Return the limits of the value."""
        value = system[self.parameter]
        low = value - self.by * abs(value) if self.low is None else self.low
        high = value + self.by * abs(value) if self.high is None else self.high
        if not low < high:
            raise ModelError(
                f"{self.parameter} is {value:g} and may change from {low:g} to {high:g}; write its limits, "
                f"as in low = {value - 1:g}, high = {value + 1:g}"
            )
        if not low <= value <= high:
            raise ModelError(f"{self.parameter} is {value:g}, outside its limits from {low:g} to {high:g}")
        for bound in (low, high):
            try:
                system.at({self.parameter: bound})
            except ModelError as error:
                wrong = f"{self.parameter} may change from {low:g} to {high:g} (by = {self.by:g}), but"
                raise ModelError(
                    f"{wrong} {bound:g} is not allowed; write a smaller by (0.5: by at most 50 %), or limits"
                ) from error
        return low, high

    def scale(self, system: System) -> float:
        """Return the change that is a relative change of 1: the value, or half of the range if the value is zero."""
        low, high = self.bounds(system)
        return abs(system[self.parameter]) or 0.5 * (high - low)


@dataclass(frozen=True, slots=True)
class Route:
    """One search for the least change: which way each goal is to be reached, from where, and how it ended."""

    ways: tuple[str, ...]  #: The way of each goal; empty for a goal with a single way.
    start: int  #: 0: from the present design; otherwise the number of another start.
    values: tuple[float, ...]  #: Values of the parameters at its end.
    change: float  #: Weighted norm of the relative changes there.
    missing: float  #: Largest missing margin there; 0 if all goals are reached.
    steps: int  #: Responses that were walked.
    words: str = ""  #: Description of the margin that is missing most; or of a failure.

    @property
    def is_reached(self) -> bool:
        """True if all goals are reached."""
        return self.missing <= 0.0


@dataclass(frozen=True, slots=True)
class LeastChangeOptions(Bounded):
    """Options of a search for the least change."""

    #: Further starts, spread over the bounds, for the ways that need the least change from the present design.
    starts: Natural = 2
    steps: Counted = 40  #: The most designs whose response is walked, for each way and start.
    margin: Fraction = MARGIN  #: Safety margin: as a share of the width of a band, or of a limit.
    seed: Natural = 0  #: Seed of the further starts.
    walk: WalkOptions = COARSE  #: Options of the walks.


@dataclass(frozen=True, slots=True)
class Tried:
    """A design that a search has tried: its margins, or why it could not be judged."""

    needs: tuple[Need, ...] = ()  #: Its margins.
    failure: str = ""  #: Why it could not be judged; otherwise empty.


class _Asked(NamedTuple):
    """A design that is to be judged: its relative changes, the ways of the goals, and the leads of the one before."""

    u: NDArray[np.float64]
    ways: tuple[str, ...]
    leads: tuple[Orbit, ...]


class _Judged(NamedTuple):
    """A design: its relative changes, the first orbit of the response for each goal, and all margins."""

    u: NDArray[np.float64]
    leads: tuple[Orbit, ...]
    needs: list[Need]

    @property
    def missing(self) -> float:
        """Largest missing margin."""
        return max([0.0, *(-need.margin for need in self.needs)])


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """The parameters that may change, the goals, and the response on which they are judged."""

    lead: Orbit  #: Orbit at the beginning of the range.
    #: parameter, end: The walked parameter, and the other end of its range.
    parameter: str
    end: float
    #: changes, goals: The parameters that may change, and the goals.
    changes: tuple[Change, ...]
    goals: tuple[AnyGoal, ...]
    options: LeastChangeOptions = field(default_factory=LeastChangeOptions)  #: Options of the search.

    def __post_init__(self) -> None:
        system = self.lead.system
        names = [change.parameter for change in self.changes]
        if not names:
            raise ModelError("no parameter may change; name at least one")
        if not self.goals:
            raise ModelError("a design needs at least one goal")
        for name in names:
            if system.structure.place(name) == system.structure.place(self.parameter):
                raise ModelError(f"{name} is the parameter of the response itself; name other parameters")
        if len(set(map(system.structure.place, names))) < len(names):
            raise ModelError("a parameter that may change is named twice")
        begin = system[self.parameter]
        for goal in self.goals:
            if not isinstance(goal, Goal):
                raise ModelError(f"a goal is {goal!r}; write one such as gw.ask.NoPoint('fold', (0.6, 0.66))")
            goal.check(system, (min(begin, self.end), max(begin, self.end)))
        for change in self.changes:
            change.bounds(system)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that may change."""
        return tuple(change.parameter for change in self.changes)

    @property
    def scales(self) -> NDArray[np.float64]:
        """Sizes of relative changes of 1, shape (k,)."""
        return np.array([change.scale(self.lead.system) for change in self.changes])

    @property
    def weights(self) -> NDArray[np.float64]:
        """Weights of the relative changes, shape (k,)."""
        return np.array([change.weight for change in self.changes])

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Bounds of the relative changes, shape (k, 2)."""
        system = self.lead.system
        limits = np.array([change.bounds(system) for change in self.changes])
        now = np.array([system[name] for name in self.names])
        return (limits - now[:, None]) / self.scales[:, None]

    def system_at(self, u: NDArray[np.float64]) -> System:
        """Return the system with some relative changes."""
        system = self.lead.system
        values = {
            name: system[name] + scale * part
            for name, scale, part in zip(self.names, self.scales.tolist(), u.tolist(), strict=True)
        }
        return system.at(values)

    def size(self, u: NDArray[np.float64]) -> float:
        """Return the weighted norm of relative changes."""
        return float(np.sqrt(np.sum(self.weights * u**2)))

    @property
    def is_held(self) -> bool:
        """True if its responses are those with all gaps held (see `first_orbit`)."""
        return released(self.lead.system).structure != self.lead.system.structure

    def response(self, u: NDArray[np.float64], lead: Orbit | None = None) -> LocalResponse:
        """Return the response of a design, which is walked when it is first needed."""
        lead = lead or self.lead
        system = System.from_values(lead.system.structure, self.system_at(u).values)
        moved, scales = carry(lead, system, self.names), tuple(self.scales.tolist())
        walk, end = self.options.walk, self.end
        if self.is_held:  # it is smooth, and need not be walked through a resonance beyond the goals
            ends = [value for goal in self.goals for value in goal.band or (end,)]
            walk, end = replace(walk, largest_step=_SMOOTH), min(ends) if end < system[self.parameter] else max(ends)
        # multipliers that turn fast with the speed, and grazes, say nothing about a flank that is held
        is_plain = self.is_held and not any(isinstance(goal, NoPoint) for goal in self.goals)
        return LocalResponse(moved, self.parameter, end, self.names, scales, walk, is_plain)

    def free_response(self, held: LocalResponse) -> LocalResponse:
        """Return the response of the machine, from the motion with all gaps held; a NumericalError if it is none."""
        return replace(held, lead=find_orbit(released(held.system), self.lead.period, held.lead.state), is_plain=False)

    def ways(self) -> list[tuple[str, ...]]:
        """Return the combinations of the ways of all goals."""
        return list(product(*(goal.ways(self.lead.system) for goal in self.goals)))

    def starts(self) -> NDArray[np.float64]:
        """Return the further starts, evenly spread over the bounds; shape (starts, k)."""
        from scipy.stats import qmc  # imported late: it takes long

        low, high = self.bounds.T
        sampler = qmc.Halton(len(self.changes), seed=self.options.seed)
        return low + (high - low) * sampler.random(self.options.starts)

    def route(self, ways: tuple[str, ...], start: int, known: float = math.inf) -> Route:
        """Search for the least change in one way."""
        begun = _Search(self, ways, start)
        while (route := begun.ended(known)) is None:
            begun.take(self.judged(begun.ahead))
        return route

    def judged(self, asked: _Asked) -> _Judged | str:
        """Walk the responses of a design and judge them, or return why that failed; a piece of work for any process."""
        many, needs = len(self.goals), list[Need]()
        try:
            responses = self._responses(asked)
            for k, (goal, way, response) in enumerate(zip(self.goals, asked.ways, responses, strict=True)):
                with stage(k / many, (k + 1) / many):
                    needs += goal.needs(response, way, self.options.margin)
        except (NumericalError, ModelError) as error:
            return str(error)
        return _judged(asked.u, responses, needs)

    def _responses(self, asked: _Asked) -> list[LocalResponse]:
        """Return the response of a design for each goal; goals that are judged on one system share it."""
        found: dict[Structure, LocalResponse] = {}
        posed = [self._posed(goal, asked.ways) for goal in self.goals]
        for place, system in enumerate(posed):
            if system.structure not in found:
                lead = asked.leads[place] if asked.leads else self._first(system)
                # without what it has cached, which depends on the process that has found it
                found[system.structure] = self.response(asked.u, replace(lead))
        return [found[system.structure] for system in posed]

    def _posed(self, goal: Goal, ways: tuple[str, ...]) -> System:
        """Return the system on whose response a goal is judged."""
        # Where gaps are to be quiet over the band of the goal, it is the one whose gaps keep their states: the motion
        # that is looked for is the same, and it is judged without the rattle that the design is to remove.
        system = self.lead.system
        for other, way in zip(self.goals, ways, strict=True):
            if other is goal or _covers(other.band, goal.band):
                system = other.posed(system, way)
        return system

    def _first(self, posed: System) -> Orbit:
        """Return the orbit at the beginning of the range of the present design, with the structure of another system.

        Newton's method from the present orbit finds it at once where that motion is already as the goal wants it.
        """
        lead = self.lead
        if posed.structure == lead.system.structure:
            return lead
        try:
            return find_orbit(posed, lead.period, lead.state)
        except NumericalError:
            return find_orbit(posed, lead.period)

    def count(self, found: Sequence[Route]) -> int:
        """Return the number of routes: all ways from the present design, then the two best from further starts."""
        many = len(self.ways())
        return many + min(many, 2) * self.options.starts * (len(found) >= many)

    def routes(
        self, routes: Sequence[Route] = (), tried: Mapping[int, Tried] | None = None
    ) -> Iterator[Route | tuple[int, Tried]]:
        """Yield each design that is tried, with its number, and each route, after those that were found before."""
        found, begun, workers = list(routes), dict[int, _Search](), workers_around()
        while (first := len(found)) < self.count(found):
            for number in range(first, self.count(found)):
                if number not in begun:
                    begun[number] = self._begun(number, found, tried or {})
            if route := begun[first].ended(_least(found)):
                found.append(route)
                yield route
                continue
            now = [(number, each) for number, each in sorted(begun.items()) if number >= first and each.asked]
            now = now[: getattr(workers, "count", 1)]
            for index, judged in workers.each(self.judged, [each.ahead for _, each in now]):
                number, asking = now[index]
                place = number * self.options.steps + asking.steps
                asking.take(judged)
                yield place, Tried(failure=judged) if isinstance(judged, str) else Tried(tuple(judged.needs))

    def _begun(self, number: int, found: Sequence[Route], tried: Mapping[int, Tried]) -> _Search:
        """Return a search, after the designs that it has tried before."""
        ways, start = self.ways(), 0
        if number >= len(ways):
            best = sorted(found[: len(ways)], key=lambda route: (route.missing, route.change))[:2]
            start, which = divmod(number - len(ways), len(best))
            begun = _Search(self, best[which].ways, start + 1)
        else:
            begun = _Search(self, ways[number], 0)
        while (asked := begun.asked) and (known := tried.get(number * self.options.steps + begun.steps)):
            begun.take(known.failure or _judged(asked.u, self._responses(asked), [*known.needs]))
        return begun

    def relative(self, values: Sequence[float]) -> NDArray[np.float64]:
        """Return the relative changes of some values of the parameters."""
        now = np.array([self.lead.system[name] for name in self.names])
        return (np.array(values) - now) / self.scales

    def values(self, u: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the values of the parameters with some relative changes."""
        system = self.system_at(u)
        return tuple(system[name] for name in self.names)


def _covers(band: tuple[float, float] | None, other: tuple[float, float] | None) -> bool:
    return band is not None and other is not None and band[0] <= other[0] and other[1] <= band[1]


def _least(found: Sequence[Route]) -> float:
    return min((route.change for route in found if route.is_reached), default=math.inf)


def _judged(u: NDArray[np.float64], responses: Sequence[LocalResponse], needs: list[Need]) -> _Judged:
    return _Judged(u, tuple(each.lead for each in responses), needs)


class _Search:
    """Sequential quadratic programming for one way of reaching the goals: it asks for one judged design at a time."""

    def __init__(self, problem: DesignProblem, ways: tuple[str, ...], start: int) -> None:
        self.problem, self.ways, self.start, self.steps = problem, ways, start, 0
        self.weights, self.bounds = problem.weights, problem.bounds
        self.trace: list[tuple[int, _Judged]] = []  # the steps so far, and the design that was best then
        self.begun = problem.starts()[start - 1] if start else np.zeros(len(problem.changes))
        self._run, self._end = self.run(self.begun), _Judged(self.begun, (), [])
        self.asked: _Asked | None = next(self._run)

    @property
    def ahead(self) -> _Asked:
        """The design that it asks for."""
        assert self.asked is not None
        return self.asked

    def take(self, judged: _Judged | str) -> None:
        """Go on with the design that was asked for, or with why it could not be judged."""
        self.steps += 1
        try:
            self.asked = self._run.send(judged)
        except StopIteration as end:
            self.asked, self._end = None, end.value

    def ended(self, known: float) -> Route | None:
        """Return the route with some least change known; None while it goes on."""
        is_near = self.problem.size(self.begun) < known  # a further start begins beyond, and comes nearer first
        for steps, now in self.trace:
            size = self.problem.size(now.u)
            if is_near and now.missing > 0.0 and size > _HOPELESS * known:
                reason = f"; given up: its change is more than {_HOPELESS:g} times the smallest known"
                return self._told(now, steps, reason)
            is_near = is_near or size < known
        if self.asked is not None:
            return None
        if isinstance(self._end, str):
            return self._route(self.begun, math.inf, self.steps, self._end)
        return self._told(self._end, self.steps)

    def _told(self, found: _Judged, steps: int, more: str = "") -> Route:
        worst = min(found.needs, key=lambda need: need.margin, default=None)
        is_missing = found.missing > max(_DONE * self.problem.options.margin, EXACT)
        words = (worst.words if worst is not None else "") + more
        return self._route(found.u, found.missing if is_missing else 0.0, steps, words)

    def _route(self, u: NDArray[np.float64], missing: float, steps: int, words: str) -> Route:
        return Route(self.ways, self.start, self.problem.values(u), self.problem.size(u), missing, steps, words)

    def run(self, u: NDArray[np.float64]) -> Generator[_Asked, _Judged | str, _Judged | str]:
        """Ask for one design after another; return the best, or why the first could not be judged."""
        now, radius, penalty = (yield _Asked(u, self.ways, ())), _TRUST, _PENALTY
        if isinstance(now, str):
            return now
        while self.steps < self.problem.options.steps and radius > _NARROWEST:
            step, slack = self.quadratic(now, radius, penalty)
            size = float(np.abs(step).max())
            small = max(_DONE * self.problem.options.margin, 0.1 * EXACT)
            if slack > small and size < 0.5 * radius and penalty < _STRONGEST:
                penalty *= 10.0  # the penalty was too weak to close the margins although there was room
                continue
            predicted = self.merit(now.u, now.missing, penalty) - self.merit(now.u + step, slack, penalty)
            if size <= _DONE or predicted <= 1e-9 * self.merit(now.u, now.missing, penalty):
                break
            trial = yield _Asked(now.u + step, self.ways, now.leads)
            if isinstance(trial, str):
                radius = 0.3 * size
                continue
            gained = self.merit(now.u, now.missing, penalty) - self.merit(trial.u, trial.missing, penalty)
            if gained >= _GOOD * predicted:
                radius = min(max(radius, 2.0 * size), _WIDEST)
            elif gained < 0.25 * predicted:
                radius = 0.4 * size
            if gained > _ACCEPTED * predicted:
                now = trial
            self.trace.append((self.steps, _Judged(now.u, (), now.needs)))
        return now

    def merit(self, u: NDArray[np.float64], missing: float, penalty: float) -> float:
        """Return the measure that each step decreases."""
        return 0.5 * float(np.sum(self.weights * u**2)) + penalty * missing

    def quadratic(self, now: _Judged, radius: float, penalty: float) -> tuple[NDArray[np.float64], float]:
        """Return the step that is best for linearised margins, and the largest margin that it leaves missing."""
        # The unknowns are the step d and the slack s >= 0:
        #
        #     minimise 1/2 w (u + d)^2 + penalty s   with   margins + slopes d + s >= 0   inside the trust region
        from scipy.optimize import minimize  # imported late: it takes long

        count, low, high = len(now.u), *self.bounds.T
        if not now.needs:
            return np.clip(-now.u, -radius, radius), 0.0
        values = np.array([need.margin for need in now.needs])
        slopes = np.column_stack((np.array([need.slopes for need in now.needs]), np.ones(len(values))))

        def target(z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            ahead = now.u + z[:-1]
            return 0.5 * float(self.weights @ ahead**2) + penalty * z[-1], np.append(self.weights * ahead, penalty)

        limits = [*zip(np.maximum(low - now.u, -radius), np.minimum(high - now.u, radius), strict=True), (0.0, None)]
        constraint = {"type": "ineq", "fun": lambda z: values + slopes @ z, "jac": lambda z: slopes}
        start = np.append(np.zeros(count), now.missing)
        how: dict[str, Any] = {"method": "SLSQP", "options": {"ftol": 1e-15, "maxiter": 200}}
        solved = minimize(target, start, jac=True, bounds=limits, constraints=[constraint], **how)
        step = np.clip(solved.x[:-1], [each[0] for each in limits[:-1]], [each[1] for each in limits[:-1]])
        return step, max(0.0, float(-(values + slopes[:, :-1] @ step).min()))


@dataclass(frozen=True, slots=True)
class ChangedParameter:
    """A parameter before and after."""

    name: str  #: Name of the parameter.
    #: before, after: Its values.
    before: float
    after: float
    #: low, high: Its limits.
    low: float
    high: float

    @property
    def percent(self) -> float:
        """Change in percent, positive where its size grows; nan if the parameter was zero."""
        return 100.0 * (self.after - self.before) / self.before if self.before else math.nan

    @property
    def is_at_limit(self) -> bool:
        """True if it has reached one of its limits."""
        slack = 1e-6 * (self.high - self.low)
        return self.after <= self.low + slack or self.after >= self.high - slack


@dataclass(frozen=True, slots=True)
class JudgedGoal:
    """A goal, and how far it is reached."""

    words: str  #: Description.
    #: before, after: Margins of the present and of the new design, as shares of `of`; negative where the goal is not
    #: reached. NaN if unknown, as where all flanks would be held, but the gap rattles, shaken by others.
    before: float
    after: float
    #: Change with which all other goals are reached without this one; nan if that was not asked, infinite if they are
    #: not reached either.
    without: float = math.nan
    of: str = ""  #: What the margins are shares of: of a clearance, of a limit, ...
    #: Whether the gap rattles in the motion of the present and of the new design that settles from rest.
    rattles: tuple[bool, bool] = (False, False)

    @property
    def verdict(self) -> str:
        """One word for the new design: rattles, reached or missed."""
        return "rattles" if self.rattles[1] else "reached" if self.is_reached else "missed"

    @property
    def is_reached(self) -> bool:
        """True if the new design reaches the goal."""
        return self.after >= -EXACT


@dataclass(frozen=True, eq=False)
class Design(Shown):
    """The least change that reaches all goals; or the design that comes nearest to them."""

    #: before, system: The present and the new system, at the first value of the range.
    before: System
    system: System
    #: parameter, within: The walked parameter, and its range from the first value to the last.
    parameter: str
    within: tuple[float, float]
    goals: tuple[AnyGoal, ...]  #: The goals.
    changes: tuple[ChangedParameter, ...]  #: The parameters that may change.
    judged: tuple[JudgedGoal, ...]  #: How far each goal is reached, on the responses below.
    change: float  #: Weighted norm of the relative changes.
    #: response_before, response: Responses of the present and of the new system.
    #: None of a train whose motion has no period: where gaps rattle often, that with all of them held is judged.
    response_before: Branch | None
    response: Branch | None
    #: Isolated branches of motions of the same period that the search has found on the new system.
    isolated: tuple[Branch, ...]
    others: tuple[FoundOrbit, ...]  #: Motions of other periods that it has found.
    searched: tuple[float, ...]  #: Values of the parameter at which it searched.
    routes: tuple[Route, ...]  #: All ways and starts that were tried.
    complete: bool = True  #: False if the search for the least change was stopped before its end.
    #: notes, failures: Remarks, in sentences; reasons why the goals are not proved.
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    @property
    def is_reached(self) -> bool:
        """True if all goals are reached, and no isolated branch that was found is against them."""
        return all(goal.is_reached for goal in self.judged) and not self.failures

    @property
    def sentence(self) -> str:
        """The answer, as a sentence."""
        moved = [each for each in sorted(self.changes, key=_size, reverse=True) if abs(each.after - each.before) > 0.0]
        texts = [f"{each.name} {_percent(each)}" for each in moved if _size(each) >= 5e-4] or ["nothing"]
        if all(goal.is_reached for goal in self.judged):
            what = " and ".join(_together(goal.words for goal in self.judged))
            if self.failures:
                return f"not proved: {what}; the response reaches it with {', '.join(texts)}, but {self.failures[0]}"
            return f"{what}: change {', '.join(texts)}"
        missed = " and ".join(_together(goal.words for goal in self.judged if not goal.is_reached))
        return f"not reached within the limits: {missed}; the nearest design has {', '.join(texts)}"

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the answer, the changes, the goals and the proof; notes and failures if wanted."""
        units = self.system.units
        yield self.sentence
        yield ""
        rows = [
            (
                parameter_symbol(each.name, units),
                f"{each.before:.6g}",
                f"{each.after:.6g}",
                _percent(each),
                f"{each.low:.4g} to {each.high:.4g}" + (" (reached)" if each.is_at_limit else ""),
            )
            for each in self.changes
        ]
        yield Table(("parameter", ">before", ">after", ">change", ">limits"), rows)
        yield ""
        goals = [
            (each.words, _margin(each.before, each.rattles[0]), _margin(each.after, each.rattles[1]), each.verdict)
            for each in self.judged
        ]
        yield Table(("goal", ">margin before", ">after", ""), goals)
        yield f"margins are shares of {', or of '.join(dict.fromkeys(each.of for each in self.judged))}"
        for each in self.judged:
            if math.isfinite(each.without):
                yield f'  without the goal "{each.words}", a change of norm {each.without:.4g} reaches all other goals'
            elif not math.isnan(each.without):
                yield f'  without the goal "{each.words}", the other goals are not reached either'
        yield ""
        reached = [route for route in self.routes if route.is_reached]
        count, steps = len(self.routes), sum(route.steps for route in self.routes)
        yield (
            f"norm of the relative changes {self.change:.6g}; {count} search{'es' if count > 1 else ''}, "
            f"{len(reached) or 'none'} of which reached the goals with the safety margin, {steps} designs tried"
        )
        walked = self.response.counts if self.response else "the quiet motion could not be followed"
        yield f"proof: {walked}; searched at {len(self.searched)} values: {self._found_words()}"
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Tables:
        """Return the tables of changes, goals, and searches."""
        return {"changes": self._change_rows, "goals": self._goal_rows, "searches": self._route_rows}

    def _found_words(self) -> str:
        many = len(self.isolated)
        text = "no isolated branch" if not many else f"{many} isolated branch{'es' if many > 1 else ''}"
        periods = sorted({each.orbit.period for each in self.others})
        return text + (f"; motions of period {', '.join(map(str, periods))}" if periods else "")

    def _change_rows(self) -> Rows:
        yield ["parameter", "before", "after", "percent", "low", "high"]
        for each in self.changes:
            yield [each.name, each.before, each.after, each.percent, each.low, each.high]

    def _goal_rows(self) -> Rows:
        shown = ["share.of", "rattles.before", "rattles.after"]
        yield ["goal", "margin.before", "margin.after", *shown, "reached", "change.without"]
        for each in self.judged:
            margins = [each.before, each.after, each.of, *each.rattles]
            yield [each.words, *margins, each.verdict == "reached", each.without]

    def _route_rows(self) -> Rows:
        yield ["ways", "start", "change", "missing", "responses", "limit", *(each.name for each in self.changes)]
        for route in self.routes:
            head = [" ".join(filter(None, route.ways)), route.start, route.change, route.missing, route.steps]
            yield [*head, route.words, *route.values]

    def __repr__(self) -> str:
        return f"Design({self.sentence})"


_OF: dict[type, str] = {Quiet: "the clearance", NoPoint: "the width of the band"}  # what margins are shares of


def _together(words: Iterable[str]) -> list[str]:
    """Return the words of goals; those of gaps that are to be quiet in one band are one."""
    found: dict[str, str] = {}
    for text in words:
        gap, quiet, band = text.rpartition(" quiet ")
        found[band] = f"{found[band]}, {gap}" if quiet and band in found else gap or text
    return [text if text.endswith(band) else f"{text} quiet {band}" for band, text in found.items()]


def _size(each: ChangedParameter) -> float:
    return abs(each.after - each.before) / (abs(each.before) or 0.5 * (each.high - each.low))


def _margin(value: float, rattles: bool) -> str:
    return f"{value:+.4f}" if not math.isnan(value) else "rattles" if rattles else "unknown"


def _percent(each: ChangedParameter) -> str:
    return f"{each.percent:+.2f} %" if each.before else f"to {each.after:.4g}"


def best_route(routes: Sequence[Route]) -> Route:
    """Return the route of the least change that reaches the goals, or else the one that misses them least."""
    return min(routes, key=lambda route: (route.missing, route.change))


def proved(
    problem: DesignProblem,
    routes: Sequence[Route],
    values: int | tuple[float, ...],
    options: SearchOptions,
    *,
    complete: bool = True,
) -> Design:
    """Return the design of the best route, judged on its response, which is walked again and searched."""
    best = best_route(routes)
    fine = replace(problem, options=replace(problem.options, walk=WalkOptions()))
    u = problem.relative(best.values)
    new = fine.response(u)
    notes: list[str] = []
    present, before = _present(fine, notes)
    found: list[FoundOrbit] = []
    searched: tuple[float, ...] = ()
    now, loose = dict[str, list[float]](), dict[str, list[float]]()
    response: Branch | None = None
    failures: list[str] = []
    if problem.is_held:
        now, _ = _parted(problem, released(present.system), notes)
        loose, searched = _parted(problem, released(new.system), failures)
        failures += _against(problem, released(new.system), loose)
        try:
            response = problem.free_response(new).branch if not failures else None
        except NumericalError as error:
            failures.append(f"the quiet motion could not be followed: {error}")
    elif values:
        searched = values if isinstance(values, tuple) else _searched(problem, values)
        result = search(new.system, problem.parameter, searched, known=[new.branch], options=options)
        found = list(result.new)
    response = response if problem.is_held else new.branch
    own = [each for each in found if each.orbit.period == problem.lead.period]
    isolated = [] if problem.is_held else _followed(new.branch, own, notes)
    others = tuple(each for each in found if each.orbit.period != problem.lead.period)
    judged = []
    for goal, margin in zip(problem.goals, before, strict=True):
        rattles = [isinstance(goal, Quiet) and goal.gap in some for some in (now, loose)]
        least = math.nan if rattles[0] and margin >= 0.0 else margin  # with all flanks held it would be quiet
        words = goal.words(new.system, problem.parameter)
        of = _OF.get(type(goal), "the limit")
        judged.append(JudgedGoal(words, least, goal.margin(new), of=of, rattles=(rattles[0], rattles[1])))
    failures += [text for branch in isolated for goal in problem.goals for text in goal.against(branch)]
    if others:
        low, high = min(each.value for each in others), max(each.value for each in others)
        notes.append(
            f"the search found motions of other periods between {low:.6g} and {high:.6g}; the goals do not concern them"
        )
    for low, high in unstable_spans(new.branch, *new.ends):
        notes.append(f"the response is unstable between {low:.6g} and {high:.6g}; another motion settles there")
    if broken := [route for route in routes if math.isinf(route.missing)]:
        names = dict.fromkeys(" and ".join(filter(None, route.ways)) or "the only way" for route in broken)
        notes.append(
            f"{len(broken)} of {len(routes)} searches failed ({'; '.join(names)}): the table of searches says why"
        )
    if not complete:
        notes.append(f"stopped when {len(routes)} searches were done")
    if len(judged) > 1 and not best.is_reached:
        judged = [replace(each, without=_without(problem, best, k)) for k, each in enumerate(judged)]
    limits = [change.bounds(problem.lead.system) for change in problem.changes]
    changes = tuple(
        ChangedParameter(name, problem.lead.system[name], value, *ends)
        for name, value, ends in zip(problem.names, best.values, limits, strict=True)
    )
    return Design(
        released(present.system),
        released(new.system),
        problem.parameter,
        (problem.lead.system[problem.parameter], problem.end),
        problem.goals,
        changes,
        tuple(judged),
        best.change,
        None if problem.is_held else present.walked,
        response,
        tuple(isolated),
        others,
        searched,
        tuple(routes),
        complete,
        tuple(notes),
        tuple(failures),
    )


def first_orbit(
    system: System, goals: Sequence[AnyGoal], period: int, start: str | Sequence[float] | NDArray[np.float64]
) -> Orbit:
    """Return the orbit at the beginning; for quiet goals of a train whose gaps rattle often, with all of them held.

    Each is held on the flank that the mean load presses: the motion is smooth, and it is that of the machine as soon as
    no flank pulls.
    """
    gaps = usual_gaps(system)
    if is_many(system) and any(isinstance(goal, Quiet) for goal in goals):
        rests = find_equilibria(system).equilibria
        sides = {each.name: each.side for each in rests[0].contacts if each.name in gaps} if rests else {}
        if sides and not any(form.law.rebounds for form in system.structure.contacts):
            for gap, side in sides.items():
                system = kept(system, gap, side)
            start = "settle"
    return find_orbit(system, period, start)


def _parted(
    problem: DesignProblem, system: System, notes: list[str]
) -> tuple[dict[str, list[float]], tuple[float, ...]]:
    """Settle a design from rest at steps of the range; return where gaps part in the bands of goals, and the values."""
    curve = SettledCurve(system, problem.parameter, (system[problem.parameter], problem.end))
    try:
        bands = curve.spread(_WATCHED)
    except NumericalError as error:
        notes.append(str(error))
        return {}, ()
    bounds = {goal.gap: goal.within for goal in problem.goals if isinstance(goal, Quiet)}
    parted: dict[str, list[float]] = {}
    for place, form in enumerate(system.structure.equations.contacts):
        least, most = bounds.get(form.name, (-math.inf, math.inf))
        values = [band.value for band in bands if band.separations[place] > 0.0 and least <= band.value <= most]
        parted |= {form.name: values} if values else {}
    return parted, tuple(band.value for band in bands)


def _against(problem: DesignProblem, system: System, parted: dict[str, list[float]]) -> list[str]:
    """Return why a new design is not proved: the gaps of goals that part, with others that shake them."""
    failures, bounds = [], [goal.gap for goal in problem.goals if isinstance(goal, Quiet)]
    for gap, values in parted.items():
        if gap in bounds:
            where = between_words((min(values), max(values)), problem.parameter, system.units)
            failures.append(f"{gap} rattles in the motion that settles from rest {where}")
    others = [gap for gap in parted if gap not in bounds]
    if failures and others:
        more = ", ".join(f'{{ quiet = "{gap}" }}' for gap in others)
        failures[0] += f"; other gaps rattle and shake it, so that they need goals too: {more}"
    return failures


def _present(problem: DesignProblem, notes: list[str]) -> tuple[LocalResponse, list[float]]:
    """Return the response of the present design, and its margins; nan where it does not reach the end of the range."""
    present = problem.response(np.zeros(len(problem.changes)))
    try:
        return present, [goal.margin(present) for goal in problem.goals]
    except NumericalError as error:
        notes.append(f"the present design could not be judged: {error}")
        return present, [math.nan] * len(problem.goals)


def _searched(problem: DesignProblem, values: int) -> tuple[float, ...]:
    """Return values inside the bands of the goals, or inside the range if no goal has a band."""
    begin = problem.lead.system[problem.parameter]
    bands = [goal.band for goal in problem.goals if goal.band] or [(min(begin, problem.end), max(begin, problem.end))]
    low, high = min(band[0] for band in bands), max(band[1] for band in bands)
    return tuple((low + (high - low) * (np.arange(values) + 0.5) / values).tolist())


def _followed(known: Branch, found: Sequence[FoundOrbit], notes: list[str]) -> list[Branch]:
    """Return the branches of orbits that lie on none that is known, each once."""
    branches: list[Branch] = []
    ends = float(known.values.min()), float(known.values.max())
    for each in found:
        if any(Curve(branch).holds(each.orbit) for branch in branches):
            continue
        try:
            branches.append(follow(each.orbit, known.parameter, ends))
        except (NumericalError, ModelError) as error:
            notes.append(f"a motion at {each.value:.6g} lies on no known branch and could not be followed: {error}")
    return branches


def _without(problem: DesignProblem, best: Route, place: int) -> float:
    """Return the least change that reaches all goals but one, in the ways of the best route."""
    goals = tuple(goal for k, goal in enumerate(problem.goals) if k != place)
    ways = tuple(way for k, way in enumerate(best.ways) if k != place)
    route = replace(problem, goals=goals).route(ways, 0)
    return route.change if route.is_reached else math.inf


@pictured(Design, size=(8.0, 7.2))
def design_picture(found: Design, measure: str = "") -> Picture:
    """Describe the responses before and after with the bands of the goals shaded, and the changes as bars."""
    kinds = {getattr(goal, "kind", None) for goal in found.goals}
    alike = "isolated branches are drawn like the response after"
    isolated = [(f"isolated-{k}", each, "after", alike) for k, each in enumerate(found.isolated, start=1)]
    before = "before", found.response_before, "before", "before"
    all_curves = [("after", found.response, "after", "after"), *isolated, before]
    known = [end for goal in found.goals if goal.band for end in goal.band]
    known += [value for curve in (found.response, found.response_before) if curve for value in curve.values.tolist()]
    unknown = "before: without a curve, because gaps rattle and the motion has no period"
    return Picture(
        found.system,
        (found.parameter, full_measure(measure or shown_measure(found.system, found), found.system.coordinates)),
        [
            NamedCurve(name, curve, look, text, is_earlier=look == "before", marks=kinds)
            for name, curve, look, text in all_curves
            if curve is not None
        ],
        lambda: _parts_of_picture(found),
        heading=[found.sentence, *[unknown] * (found.response_before is None)],
        script="tuple(filter(None, (record.response, *record.isolated, record.response_before)))",
        panels=("main", "bars"),
        height=2.6,
        reach={found.parameter: (min(known or found.within), max(known or found.within))},
    )


def _parts_of_picture(found: Design) -> Parts:
    """Return the bands of the goals, and the change of each parameter within its limits."""
    words: dict[tuple[float, float], list[str]] = {}
    for goal, judged in zip(found.goals, found.judged, strict=True):
        if goal.band:
            words.setdefault(goal.band, []).append(judged.words)
    ends = dict.fromkeys(end for band in words for end in band)
    return Parts(
        shades=[Shade(found.parameter, *band, "goal", "; ".join(_together(texts))) for band, texts in words.items()],
        lines=[Line(found.parameter, end, f"{end:.6g}") for end in ends],
        bars=[_bar(each, found.system) for each in found.changes],
    )


def _bar(change: ChangedParameter, system: System) -> Bar:
    """Return a change and its limits in percent: of its value, or of half its range if that was zero."""
    size = change.before or 0.5 * (change.high - change.low)
    low, high, moved = (100.0 * (end - change.before) / size for end in (change.low, change.high, change.after))
    text = f"{change.before:.4g} → {change.after:.4g}  ({moved:+.2f} %)"
    # that of a negative number grows to the left
    return Bar(parameter_symbol(change.name, system.units), min(low, high), max(low, high), moved, text)
