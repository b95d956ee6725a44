"""A design: the changed parameters, how far each goal is reached, and the proof on the response of the new design."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gapwalk.answers.goals import EXACT, AnyGoal
from gapwalk.answers.least_change import DesignProblem, Route
from gapwalk.answers.local_response import LocalResponse, unstable_spans
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated.search import FoundOrbit, search
from gapwalk.bifurcation.isolated.search_options import SearchOptions
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, summarizes


@dataclass(frozen=True, slots=True)
class ChangedParameter:
    """A parameter before and after.

    Examples
    --------
    >>> change = design.changes[0]
    >>> change.name, round(change.percent, 1)
    ('stop.clearance', -12.7)
    """

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
    """A goal, and how far it is reached.

    Examples
    --------
    >>> goal = design.judged[0]
    >>> goal.words, goal.is_reached
    ('no fold between Ω = 1.35 and 1.42', True)
    """

    words: str  #: Description.
    #: before, after: Margins of the present and of the new design: relative to the width of the band, to the clearance
    #: or to the limit; negative where the goal is not reached.
    before: float
    after: float
    #: Change with which all other goals are reached without this one; nan if that was not asked, infinite if they are
    #: not reached either.
    without: float = math.nan

    @property
    def is_reached(self) -> bool:
        """True if the new design reaches it."""
        return self.after >= -EXACT


@dataclass(frozen=True, eq=False)
class Design(Shown):
    """The least change that reaches all goals; or the design that comes nearest to them.

    Examples
    --------
    >>> design.is_reached, round(design.system.parameters["stop.clearance"], 3)
    (True, 0.873)
    >>> design.sentence
    'no fold between Ω = 1.35 and 1.42: change stop.clearance -12.74 %'
    """

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
    response_before: Branch
    response: Branch
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
            what = " and ".join(goal.words for goal in self.judged)
            if self.failures:
                return f"not proved: {what}; the response reaches it with {', '.join(texts)}, but {self.failures[0]}"
            return f"{what}: change {', '.join(texts)}"
        missed = " and ".join(goal.words for goal in self.judged if not goal.is_reached)
        return f"not reached within the limits: {missed}; nearest with {', '.join(texts)}"

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the answer, the changes, the goals and the proof; notes and failures if wanted.

        Parameters
        ----------
        notes
            True to include notes and failures.
        """
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
            (each.words, _margin(each.before), _margin(each.after), "reached" if each.is_reached else "missed")
            for each in self.judged
        ]
        yield Table(("goal", ">margin before", ">after", ""), goals)
        for each in self.judged:
            if math.isfinite(each.without):
                yield f'  without "{each.words}" a change of {each.without:.4g} reaches the others'
            elif not math.isnan(each.without):
                yield f'  without "{each.words}" the others are not reached either'
        yield ""
        reached = [route for route in self.routes if route.is_reached]
        count, steps = len(self.routes), sum(route.steps for route in self.routes)
        yield (
            f"norm of the relative changes {self.change:.6g}; {count} search{'es' if count > 1 else ''}, "
            f"{len(reached) or 'none'} of which reached the goals with the safety margin, {steps} designs tried"
        )
        yield f"proof: {self.response.counts}; searched at {len(self.searched)} values: {self._found_words()}"
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
        yield ["goal", "margin.before", "margin.after", "reached", "change.without"]
        for each in self.judged:
            yield [each.words, each.before, each.after, each.is_reached, each.without]

    def _route_rows(self) -> Rows:
        yield ["ways", "start", "change", "missing", "responses", "limit", *(each.name for each in self.changes)]
        for route in self.routes:
            head = [" ".join(filter(None, route.ways)), route.start, route.change, route.missing, route.steps]
            yield [*head, route.words, *route.values]

    def __repr__(self) -> str:
        return f"Design({self.sentence})"


def _size(each: ChangedParameter) -> float:
    return abs(each.after - each.before) / (abs(each.before) or 0.5 * (each.high - each.low))


def _margin(value: float) -> str:
    return "unknown" if math.isnan(value) else f"{value:+.4f}"


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
    if values:
        searched = values if isinstance(values, tuple) else _searched(problem, values)
        result = search(new.system, problem.parameter, searched, known=[new.branch], options=options)
        found = list(result.new)
    isolated = _followed(new.branch, [each for each in found if each.orbit.period == problem.lead.period], notes)
    others = tuple(each for each in found if each.orbit.period != problem.lead.period)
    judged = [
        JudgedGoal(goal.words(new.system, problem.parameter), margin, goal.margin(new))
        for goal, margin in zip(problem.goals, before, strict=True)
    ]
    failures = [text for branch in isolated for goal in problem.goals for text in goal.against(branch)]
    if others:
        low, high = min(each.value for each in others), max(each.value for each in others)
        notes.append(
            f"the search found motions of other periods between {low:.6g} and {high:.6g}; the goals are not about them"
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
        present.system,
        new.system,
        problem.parameter,
        (problem.lead.system[problem.parameter], problem.end),
        problem.goals,
        changes,
        tuple(judged),
        best.change,
        present.walked,
        new.branch,
        tuple(isolated),
        others,
        searched,
        tuple(routes),
        complete,
        tuple(notes),
        tuple(failures),
    )


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
