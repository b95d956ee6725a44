"""A design: the changed parameters, how far each goal is reached, and the proof on the response of the new design."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gapwalk.answers.gap_states import released
from gapwalk.answers.goals import EXACT, AnyGoal, LocalResponse, NoPoint, Quiet, unstable_spans
from gapwalk.answers.least_change import DesignProblem, Route
from gapwalk.answers.settled_curve import SettledCurve
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated.search import FoundOrbit, search
from gapwalk.bifurcation.isolated.search_starts import SearchOptions
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.measures import full_measure
from gapwalk.model.system import System
from gapwalk.model.words import between_words, parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.picture_parts import Bar, Line, NamedCurve, Parts, Picture, Shade, pictured
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, summarizes

_WATCHED = 8  # steps of `SettledCurve` between two values at which a new train is settled


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


def proved(
    problem: DesignProblem,
    routes: Sequence[Route],
    values: int | tuple[float, ...],
    options: SearchOptions,
    *,
    complete: bool = True,
) -> Design:
    """Return the design of the best route, judged on its response, which is walked again and searched.

    That is the route of the least change that reaches the goals, or else the one that misses them least.
    """
    best = min(routes, key=lambda route: (route.missing, route.change))
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
