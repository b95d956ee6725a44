"""The least change of some parameters that reaches all goals: the problem, and the search for it by gradients.

The change is measured by the weighted sum of squares of relative changes. Each step solves the problem with linearised
margins (sequential quadratic programming, Nocedal and Wright 2006, chapter 18) inside a trust region. The response of
the next design is then walked again, so that special points that have appeared or vanished on the way count at once. A
step is taken if the sum of the change and a penalty on the largest missing margin decreases.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import kept, released, usual_gaps
from gapwalk.answers.goals import COARSE, EXACT, MARGIN, AnyGoal, Goal, LocalResponse, Need, NoPoint, Quiet
from gapwalk.answers.lane_sweep import is_many
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.bounds import Bounded, Counted, Fraction, Natural, Positive, check_fields
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.find import carry, find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.pieces import stage, workers_around

_PENALTY, _STRONGEST = 10.0, 1e5  # on the largest missing margin, at first and at most
_TRUST, _WIDEST = 0.1, 0.5  # radius of the trust region, in relative changes
_DONE = 1e-6  # relative changes, and missing margins relative to the safety margin, that no longer count
_NARROWEST = 1e-5  # radius at which a search is stuck
_HOPELESS = 1.5  # ratio to the least change known at which a search that still misses goals is given up
_SMOOTH = 0.05  # largest step of a response without gaps
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
