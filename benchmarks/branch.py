"""The frequency response of figure 13, with every special point on it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.clutch import ScipyClutch
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.shooter import walk
from benchmarks.stopwatch import fastest, side_by_side
from gapwalk import Branch, Kind, Orbit, WalkOptions, find_orbit, follow, paper
from gapwalk.flow.flow import Flow

GROUP = "Branch of figure 13"
_REFERENCE = Path(__file__).resolve().parents[1] / "tests" / "data" / "special_points.json"
_EXACT = 1e-9  # of the frequency of a special point, compared with the reference
_AGREE = 1e-6  # of the states of the two walks
_STEPS = WalkOptions(initial_step=0.05, largest_step=0.1)  # in shares of a range that is short


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    return [measure_branch(effort), measure_walk(effort)]


def measure_branch(effort: Effort) -> Row:
    """Measure the branch from Omega = 1.9 to 0.15; the baseline is an estimate from its number of flow calls."""
    start = _start(1.9)

    def ours() -> Branch:
        return follow(start, "frequency", to=0.15)

    branch, calls = _count_calls(ours)
    seconds = fastest(ours, effort)
    found = _points_found(branch)
    counts = {
        "points": len(branch.points),
        "flow calls": sum(calls.values()),
        "flow calls with sensitivities": calls["sensitive"],
        "points per second": round(len(branch.points) / seconds),
        "special points found": found,
        "special points expected": len(_expected()),
        "grazing points": len(branch.special(Kind.GRAZING)),
    }
    note = (
        f"{counts['points']} points, {counts['flow calls']} flow calls, {counts['points per second']} points a second; "
        f"{found} of {counts['special points expected']} special points to {_EXACT:g}, "
        f"and {counts['grazing points']} grazing points. The baseline is an estimate: as many periods by DOP853"
    )
    estimate = _estimate(start, calls, effort)
    targets = (Target(0.1), Target(len(_expected()), "found"))
    what = "W = 1.9 to 0.15 with special points"
    return Row(GROUP, what, seconds, estimate, "estimate", targets, counts, note)


def measure_walk(effort: Effort) -> Row:
    """Walk a short part of it with both programs, to the same points; SciPy finds no special points there."""
    start, clutch = _start(0.9), ScipyClutch(paper.case("13"))

    def ours() -> Branch:
        return follow(start, "frequency", to=effort.walk_to, walk=_STEPS)

    branch = ours()
    frequencies = branch.values.tolist()

    def theirs():
        return walk(clutch, start.state, frequencies)

    for point, shot in zip(branch.points, theirs(), strict=True):
        difference = float(np.abs(point.orbit.state - shot.state).max())
        if not difference < _AGREE:
            raise RuntimeError(f"the walks differ by {difference:.3g} at W = {point.value:.6g}")
    count = len(frequencies)
    seconds, baseline = (total / count for total in side_by_side([ours, theirs], effort))
    note = f"{count} points, the same for both; gapwalk looks for special points on the way, the baseline does not"
    what = f"W = 0.9 to {effort.walk_to:g}, for each point"
    return Row(GROUP, what, seconds, baseline, "shooting with DOP853", counts={"points": count}, note=note)


def _start(frequency: float) -> Orbit:
    return find_orbit(paper.case("13"), frequency=frequency)


def _count_calls(work: Callable[[], Any]) -> tuple[Any, Counter[str]]:
    """Return the result of some work, and how many integrations it took with sensitivities and without."""
    counts: Counter[str] = Counter()
    integrate = Flow.integrate

    def counted(self, *args, **options):
        counts["sensitive" if self.has_transition else "plain"] += 1
        return integrate(self, *args, **options)

    with patch.object(Flow, "integrate", counted):
        return work(), counts


def _estimate(start: Orbit, calls: Counter[str], effort: Effort) -> float:
    """Return the time that SciPy takes for the same number of forcing periods, at its speed at Omega = 0.5."""
    clutch, state = ScipyClutch(start.system), _start(0.5).state
    plain, sensitive = side_by_side(
        [lambda: clutch.period(state, 0.5), lambda: clutch.period_with_sensitivities(state, 0.5)], effort
    )
    return calls["plain"] * plain + calls["sensitive"] * sensitive


def _expected() -> list[dict[str, Any]]:
    return json.loads(_REFERENCE.read_text(encoding="utf-8"))["figures"]["13"]


def _points_found(branch: Branch) -> int:
    """Count the special points of the reference that the branch has."""
    return sum(
        any(abs(special.value - expected["W"]) <= _EXACT for special in branch.special(expected["kind"]))
        for expected in _expected()
    )
