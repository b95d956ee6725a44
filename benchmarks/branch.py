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
from gapwalk import Branch, Harmonic, Kind, Orbit, System, WalkOptions, find_orbit, follow, paper
from gapwalk.flow.flow import Flow
from gapwalk.model.contact import Contact, Stage, friction

GROUP = "Branch of figure 13"
_REFERENCE = Path(__file__).resolve().parents[1] / "tests" / "data" / "special_points.json"
_EXACT = 1e-9  # of the frequency of a special point, compared with the reference
_AGREE = 1e-6  # of the states of the two walks
_PERIODS = 16  # of DOP853, as long as which the branch should take
_LIMIT, _STIFFNESS = 0.02, 10.0  # of the friction, and of its spring as a Jenkins element
_STEPS = WalkOptions(initial_step=0.05, largest_step=0.1)  # in shares of a range that is short


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    return [
        measure_branch(effort),
        measure_in_periods("W = 1.9 to 0.15", _start(1.9), effort, Target(1.0 / _PERIODS, "ratio")),
        measure_in_periods(
            f"W = 2 to 0.15, Coulomb friction {_LIMIT:g}", start_with_friction(None), effort, Target(1.0)
        ),
        measure_in_periods(
            f"W = 2 to 0.15, Jenkins element {_LIMIT:g}", start_with_friction(_STIFFNESS), effort, Target(1.0)
        ),
        measure_walk(effort),
    ]


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


def measure_in_periods(what: str, start: Orbit, effort: Effort, target: Target) -> Row:
    """Measure a branch; the baseline is one forcing period by DOP853 with sensitivities, without friction."""

    def ours() -> Branch:
        return follow(start, "frequency", to=0.15)

    clutch, state = ScipyClutch(paper.case("13")), _start(0.5).state
    before = Flow.calls
    branch, calls = ours(), Flow.calls - before
    seconds, period = side_by_side([ours, lambda: clutch.period_with_sensitivities(state, 0.5)], effort)
    counts = {
        "points": len(branch.points),
        "special points": len(branch.special_points),
        "flow calls": calls,
        "periods": round(seconds / period, 1),
    }
    note = (
        f"{counts['points']} points with {counts['special points']} special points and {calls} flow calls take as long "
        f"as {counts['periods']:g} forcing periods by DOP853 with sensitivities"
    )
    return Row(GROUP, f"{what}, in periods", seconds, period, "one period", (target,), counts, note)


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


def start_with_friction(stiffness: float | None) -> Orbit:
    """Return the orbit at W = 2 of the clutch with friction on the rate of q1, rigid or in series with a spring."""
    stage = Contact(
        "stage2",
        {"q1": 1.0},
        [Stage(1.0, 1.0)],
        force={"q1": 0.9, "q3": -0.54},
        law="hunt-crossley",
        impact_damping=0.05,
    )
    lining = friction("lining", {"q1": 1.0}, _LIMIT, stiffness=stiffness, force={"q1": 1.0, "q3": -0.6})
    system = System(
        ("q1", "q3"),
        [[0.1, -0.6], [-0.06, 1.1]],
        [[0.04, -0.04], [-0.04, 0.06]],
        mean={"q1": 0.25, "q3": 0.25},
        contacts=[stage, lining],
        harmonics=[Harmonic(0.25, {"q1": 1.0})],
        frequency=2.0,
    )
    return find_orbit(system)


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
