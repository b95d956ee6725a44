"""The least change of some parameters that reaches all goals, found by gradients and proved on the new response.

The change is measured by the weighted sum of squares of relative changes. Each step solves the problem with linearised
margins (sequential quadratic programming, Nocedal and Wright 2006, chapter 18) inside a trust region. The response of
the next design is then walked again, so that special points that have appeared or vanished on the way count at once.
A step is taken if the sum of the change and a penalty on the largest missing margin decreases.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.goals import EXACT, MARGIN, AnyGoal, Goal, Need
from gapwalk.answers.local_response import COARSE, LocalResponse
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.find import carry, find_orbit
from gapwalk.orbit.orbit import Orbit

_PENALTY, _STRONGEST = 10.0, 1e5  # on the largest missing margin, at first and at most
_TRUST, _WIDEST = 0.1, 0.5  # radius of the trust region, in relative changes
_DONE = 1e-6  # relative changes, and missing margins relative to the safety margin, that no longer count
_NARROWEST = 1e-5  # radius at which a search is stuck
_HOPELESS = 1.5  # ratio to the least change known at which a search that still misses goals is given up
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
    by: float = 0.5  #: Largest relative change in either direction; 0.5 is 50 %.
    #: low, high: Limits of its value, in place of `by`.
    low: float | None = None
    high: float | None = None
    #: Weight of its relative change: of two parameters that serve a goal equally, the one of larger weight changes
    #: less.
    weight: float = 1.0

    def __post_init__(self) -> None:
        for name in ("by", "weight"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
                raise ModelError(f"{name} of {self.parameter} is {value!r}; it must be a number > 0")

    def bounds(self, system: System) -> tuple[float, float]:
        """Return the limits of the value.

        Parameters
        ----------
        system
            The system, with the present value.
        """
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
            system.at({self.parameter: bound})
        return low, high

    def scale(self, system: System) -> float:
        """Return the size of a relative change of 1: the value, or half of the range of a parameter that is zero.

        Parameters
        ----------
        system
            The system, with the present value.
        """
        low, high = self.bounds(system)
        return abs(system[self.parameter]) or 0.5 * (high - low)


@dataclass(frozen=True, slots=True)
class Route:
    """One search for the least change: which way each goal is to be reached, from where, and how it ended.

    Examples
    --------
    >>> route = design.routes[0]
    >>> route.start, route.is_reached
    (0, True)
    """

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
class LeastChangeOptions:
    """Options of a search for the least change.

    Examples
    --------
    >>> gw.ask.LeastChangeOptions(starts=4, margin=0.01).margin
    0.01
    """

    #: Further starts, spread over the bounds, for the ways that need the least change from the present design.
    starts: int = 2
    steps: int = 40  #: The most designs whose response is walked, for each way and start.
    margin: float = MARGIN  #: Safety margin: as a share of the width of a band, or of a limit.
    seed: int = 0  #: Seed of the further starts.
    walk: WalkOptions = COARSE  #: Options of the walks.

    def __post_init__(self) -> None:
        for name, least in (("starts", 0), ("steps", 1), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")
        if not 0.0 <= self.margin < 1.0:
            raise ModelError(f"margin is {self.margin!r}; it must be at least 0 and less than 1")


class _Judged(NamedTuple):
    """A design: its relative changes, the first orbits of its responses by their structures, and all margins."""

    u: NDArray[np.float64]
    leads: dict[Structure, Orbit]
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

    def response(self, u: NDArray[np.float64], lead: Orbit | None = None) -> LocalResponse:
        """Return the response of a design, which is walked when it is first needed."""
        lead = lead or self.lead
        system = System.from_values(lead.system.structure, self.system_at(u).values)
        moved, scales = carry(lead, system, self.names), tuple(self.scales.tolist())
        return LocalResponse(moved, self.parameter, self.end, self.names, scales, self.options.walk)

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
        u = self.starts()[start - 1] if start else np.zeros(len(self.changes))
        search = _Search(self, ways, known)
        try:
            found = search.run(u)
        except (NumericalError, ModelError) as error:
            return Route(ways, start, self._values(u), self.size(u), math.inf, search.steps, str(error))
        worst = min(found.needs, key=lambda need: need.margin, default=None)
        is_missing = found.missing > max(_DONE * self.options.margin, EXACT)
        words = worst.words if worst is not None else ""
        if search.is_given_up:
            words += f"; given up, {_HOPELESS:g} times beyond the least change known"
        missing = found.missing if is_missing else 0.0
        return Route(ways, start, self._values(found.u), self.size(found.u), missing, search.steps, words)

    def next_route(self, found: Sequence[Route]) -> tuple[tuple[str, ...], int] | None:
        """Return ways and start of the route after those that were found; None after the last.

        First come all ways from the present design, then the two best of them from further starts.
        """
        ways, many = self.ways(), len(found)
        if many < len(ways):
            return ways[many], 0
        best = sorted(found[: len(ways)], key=lambda route: (route.missing, route.change))[:2]
        number, place = divmod(many - len(ways), len(best))
        return (best[place].ways, number + 1) if number < self.options.starts else None

    def routes(self, found: Sequence[Route] = ()) -> Iterator[Route]:
        """Yield the routes after those that were found."""
        all_found = list(found)
        while (following := self.next_route(all_found)) is not None:
            known = min((route.change for route in all_found if route.is_reached), default=math.inf)
            all_found.append(self.route(*following, known))
            yield all_found[-1]

    def relative(self, values: Sequence[float]) -> NDArray[np.float64]:
        """Return the relative changes of some values of the parameters."""
        now = np.array([self.lead.system[name] for name in self.names])
        return (np.array(values) - now) / self.scales

    def _values(self, u: NDArray[np.float64]) -> tuple[float, ...]:
        system = self.system_at(u)
        return tuple(system[name] for name in self.names)


def _covers(band: tuple[float, float] | None, other: tuple[float, float] | None) -> bool:
    return band is not None and other is not None and band[0] <= other[0] and other[1] <= band[1]


class _Search:
    """Sequential quadratic programming for one way of reaching the goals."""

    def __init__(self, problem: DesignProblem, ways: tuple[str, ...], known: float = math.inf) -> None:
        self.problem, self.ways, self.known, self.steps, self.is_given_up = problem, ways, known, 0, False
        self.weights, self.bounds = problem.weights, problem.bounds

    def run(self, u: NDArray[np.float64]) -> _Judged:
        """Return the best design that was found."""
        now, radius, penalty = self.judged(u, {}), _TRUST, _PENALTY
        is_near = self.problem.size(u) < self.known  # a further start begins beyond, and comes nearer first
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
            try:
                trial = self.judged(now.u + step, now.leads)
            except NumericalError:
                radius = 0.3 * size
                continue
            gained = self.merit(now.u, now.missing, penalty) - self.merit(trial.u, trial.missing, penalty)
            if gained >= _GOOD * predicted:
                radius = min(max(radius, 2.0 * size), _WIDEST)
            elif gained < 0.25 * predicted:
                radius = 0.4 * size
            if gained > _ACCEPTED * predicted:
                now = trial
            if is_near and now.missing > 0.0 and self.problem.size(now.u) > _HOPELESS * self.known:
                self.is_given_up = True
                break
            is_near = is_near or self.problem.size(now.u) < self.known
        return now

    def judged(self, u: NDArray[np.float64], leads: dict[Structure, Orbit]) -> _Judged:
        """Walk the responses of a design, one for each system that the goals are judged on, and judge them."""
        self.steps += 1
        problem, needs = self.problem, list[Need]()
        responses: dict[Structure, LocalResponse] = {}
        for goal, way in zip(problem.goals, self.ways, strict=True):
            posed = self.posed(goal)
            structure = posed.structure
            if structure not in responses:
                responses[structure] = problem.response(u, leads.get(structure) or self.first(posed))
            needs += goal.needs(responses[structure], way, problem.options.margin)
        return _Judged(u, {structure: each.lead for structure, each in responses.items()}, needs)

    def posed(self, goal: Goal) -> System:
        """Return the system on whose response a goal is judged.

        Where gaps are to be quiet over the band of the goal, it is the one whose gaps keep their states: the motion
        that is looked for is the same, and it is judged without the rattle that the design is to remove.
        """
        system = self.problem.lead.system
        for other, way in zip(self.problem.goals, self.ways, strict=True):
            if other is goal or _covers(other.band, goal.band):
                system = other.posed(system, way)
        return system

    def first(self, posed: System) -> Orbit:
        """Return the orbit at the beginning of the range of the present design, with the structure of another system.

        Newton's method from the present orbit finds it at once where that motion is already as the goal wants it.
        """
        lead = self.problem.lead
        if posed.structure == lead.system.structure:
            return lead
        try:
            return find_orbit(posed, lead.period, lead.state)
        except NumericalError:
            return find_orbit(posed, lead.period)

    def merit(self, u: NDArray[np.float64], missing: float, penalty: float) -> float:
        """Return the measure that each step decreases."""
        return 0.5 * float(np.sum(self.weights * u**2)) + penalty * missing

    def quadratic(self, now: _Judged, radius: float, penalty: float) -> tuple[NDArray[np.float64], float]:
        """Return the step that is best for linearised margins, and the largest margin that it leaves missing.

        The unknowns are the step d and the slack s >= 0:

            minimise 1/2 w (u + d)^2 + penalty s   with   margins + slopes d + s >= 0   inside the trust region
        """
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
