"""The diagram of figure 15, and the speed of the walks that it is made of."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.clutch import ScipyClutch
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.stopwatch import cpu_seconds, fastest, side_by_side
from gapwalk import Branch, Orbit, WalkOptions, diagram, find_orbit, follow, paper, search
from gapwalk.bifurcation.isolated.search_starts import Lanes
from gapwalk.continuation import walk as walks
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.flow.flow import PERIOD, Flow
from gapwalk.orbit.orbit import true_period

GROUP = "Diagram of figure 15"
_RANGE = (0.15, 1.9)
_NARROWEST = (_RANGE[1] - _RANGE[0]) / 300  # isolated branch to find; the same in any part of the range
_AT, _EIGHT = 0.408896, (3.70, 0.83, 0.74, 0.95)  # a frequency, and a state there near a motion of period 8
_SEVEN, _AT_SEVEN = (
    (1.7393025818988646, -0.1308810692485267, -0.5480666393837627, 0.00721262586600034),
    0.19958333333333333,
)
_MOST = 500  # points of a walk that does not see that it has gone round
_AGREE = 1e-6


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    one = find_orbit(paper.case("15"), frequency=_RANGE[1])
    eight = find_orbit(paper.case("15"), 8, _EIGHT, frequency=_AT)
    if true_period(eight) != 8:
        raise RuntimeError(f"the motion at W = {_AT:g} repeats after {true_period(eight)} forcing periods")
    return [
        measure_walk(one, Target(15.0, "ratio"), effort),
        measure_walk(eight, Target(50.0, "ratio"), effort),
        measure_isola(),
        measure(one, effort),
    ]


def measure_walk(start: Orbit, target: Target, effort: Effort) -> Row:
    """Measure the CPU time per point of one branch with all its special points."""

    def ours() -> Branch:
        return follow(start, "frequency", to=_RANGE)

    branch, periods = count_periods(ours)
    points = len(branch.points)
    seconds = fastest(ours, effort) / points
    baseline = estimate(periods, effort) / points
    counts = {"points": points, "special points": len(branch.special_points), "points per second": round(1 / seconds)}
    low, high = branch.values.min(), branch.values.max()
    note = (
        f"{points} points from W = {low:.4g} to {high:.4g} with {counts['special points']} special points, "
        f"{counts['points per second']} points a second. The baseline is an estimate: as many periods by DOP853"
    )
    return Row(
        GROUP, f"a branch of period {branch.period}: each point", seconds, baseline, "estimate", (target,), counts, note
    )


def measure_isola() -> Row:
    """Measure an isolated branch of period 7 with sharp turns, beside walks that look for their start from a chord."""
    orbit = find_orbit(paper.case("15"), 7, _SEVEN, frequency=_AT_SEVEN)
    found: list[Branch] = []

    def walk() -> None:
        found.append(follow(orbit, "frequency", to=_RANGE, walk=WalkOptions(max_points=_MOST)))

    def chord(before: BranchPoint, after: BranchPoint, share: float) -> NDArray[np.float64]:
        return before.x + share * (after.x - before.x)

    seconds = cpu_seconds(walk)
    with patch.object(walks, "hermite", chord):
        baseline = cpu_seconds(walk)
    ours, theirs = (len(branch.points) for branch in found)
    note = (
        f"{ours} points, and it closes: {'yes' if found[0].closed else 'no'}. The baseline misses its start and goes "
        f"round until it has {_MOST} points in each direction, {theirs} of 10,000 that a walk may have"
    )
    targets = (Target(2.0, "ratio"),)
    return Row(
        GROUP, "an isolated branch of period 7", seconds, baseline, "from a chord", targets, {"points": ours}, note
    )


def measure(start: Orbit, effort: Effort) -> Row:
    """Measure the whole diagram in one process, once: period 1 to 8, with the search for isolated branches."""
    low, high = effort.diagram_from, _RANGE[1]
    values = math.ceil((high - low) / _NARROWEST * (1.0 - 1e-12))
    options = {"workers": 1, "search_values": values}
    found: list[Any] = []

    def ours() -> None:
        found.append(count_periods(lambda: diagram(start.system, "frequency", (low, high), start=start, **options)))

    searching: list[float] = []
    searches = sys.modules[search.__module__]
    search_chunk = vars(searches)["search_chunk"]

    def timed(chunk: Any) -> Any:
        begun = time.process_time()
        result = search_chunk(chunk)
        searching.append(time.process_time() - begun)
        return result

    with patch.object(searches, "search_chunk", timed):
        seconds = cpu_seconds(ours)
    tree, periods = found[0]
    points = sum(len(branch.points) for branch in tree.branches)
    counts: dict[str, float] = {
        "branches": len(tree.members),
        "points": points,
        "periods": round(sum(periods.values())),
        "search values": values,
        "search starts": values * options.search.starts,
        "seconds of the search": round(sum(searching), 2),
    }
    note = (
        f"{counts['branches']} branches of {points} points; the search tries {counts['search starts']} starts at "
        f"{values} values of W, in {sum(searching) / seconds:.0%} of the time. The baseline is an estimate: as many "
        f"periods, {counts['periods']}, by DOP853"
    )
    targets = (Target(60.0, "ratio"),) if low == _RANGE[0] else ()
    what = f"P1 to P8 with search, W = {low:g} to {high:g}"
    return Row(GROUP, what, seconds, estimate(periods, effort), "estimate", targets, counts, note)


def count_periods(work: Callable[[], Any]) -> tuple[Any, Counter[str]]:
    """Return the result of some work, and its numbers of forcing periods with sensitivities and without.

    Those of the batch integrator count too: a search follows transients with it, and makes Newton steps.
    """
    counts: Counter[str] = Counter()
    integrate, sample, strobes, evaluate = Flow.integrate, Flow.sample, Lanes.strobes, Lanes.evaluate

    def integrated(self, coefficients, state, start=0.0, stop=PERIOD, direction=None):
        counts["sensitive" if self.has_transition else "plain"] += (stop - start) / PERIOD
        return integrate(self, coefficients, state, start, stop, direction)

    def sampled(self, coefficients, state, thetas):
        counts["plain"] += (thetas[-1] - thetas[0]) / PERIOD
        return sample(self, coefficients, state, thetas)

    def strobed(self, states, periods):
        counts["plain"] += len(states) * periods
        return strobes(self, states, periods)

    def evaluated(self, states, periods):
        before = counts["plain"]
        found = evaluate(self, states, periods)
        counts.update(
            plain=before - counts["plain"]
        )  # the displaced motions are its derivatives, and some run on beyond their period
        counts.update(sensitive=int(periods.sum()))
        return found

    with ExitStack() as stack:
        stack.enter_context(patch.object(Flow, "integrate", integrated))
        stack.enter_context(patch.object(Flow, "sample", sampled))
        stack.enter_context(patch.object(Lanes, "strobes", strobed))
        stack.enter_context(patch.object(Lanes, "evaluate", evaluated))
        return work(), counts


def estimate(periods: Counter[str], effort: Effort) -> float:
    """Return the time that SciPy takes for as many forcing periods, at its speed at Omega = 0.5."""
    orbit = find_orbit(paper.case("15"), frequency=0.5)
    clutch, state = ScipyClutch(orbit.system), orbit.state
    difference = float(np.abs(clutch.period(state, 0.5) - state).max())
    if not difference < _AGREE:
        raise RuntimeError(f"gapwalk and SciPy differ by {difference:.3g}")
    plain, sensitive = side_by_side(
        [lambda: clutch.period(state, 0.5), lambda: clutch.period_with_sensitivities(state, 0.5)], effort
    )
    return periods["plain"] * plain + periods["sensitive"] * sensitive
