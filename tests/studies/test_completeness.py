"""Completeness: every attractor that many random starts reach is on a branch of the diagram.

The starts are let settle by nothing but the flow, or by SciPy, and are judged by their returns alone; so what they
reach is known without Newton's method, the walk, or the search.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.clutch import ScipyClutch
from gapwalk import diagram
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation import EndReason
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.paper import case

MAX_PERIOD = 8
LONGEST = 64  # forcing periods up to which a return is a periodic motion, though too long for the diagram
PATIENCE = (200, 800, 3200)  # forcing periods after which the returns are looked at
RETURN = 1e-6
AT = 1e-4  # of a state that returns so closely, from the orbit to which it goes
SCIPY_RETURN, SCIPY_AT = 1e-3, 5e-3  # its errors at contacts shake a motion by 2e-4 at W = 0.45

WHOLE = (0.15, 1.9)
FREQUENCIES = (0.25, 0.45, 0.6, 0.82, 1.25, 1.69)  # at the last, one start in a hundred leads to the island
ISLANDS = [  # of period 3, as found by searches much denser
    (0.1915, 0.2019),
    (0.2469, 0.2583),
    (0.3475, 0.3545),
    (0.4363, 0.4653),
    (0.7724, 0.9042),
    (1.6663, 1.7120),
]


@dataclass
class Census:
    """Where the starts at one frequency have come to: how many to each attractor of the diagram, and the rest."""

    on_branches: Counter[str]
    longer: int
    never: int
    missing: list[NDArray[np.float64]]


def random_starts(system: System, count: int) -> NDArray[np.float64]:
    """Starts drawn by chance from a box as wide as the motions of figure 15 ever get, and half as wide again."""
    half_widths = np.array([6.0, 6.0, 4.0, 4.0])
    return np.random.default_rng(int(1e4 * system.frequency)).uniform(-half_widths, half_widths, (count, 4))


def settled(system: System, state: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Where a start comes to, and after how many forcing periods it returns there each time; 0 if it does not."""
    flow, coefficients, done = flow_of(system), coefficients_of(system), 0
    for patience in PATIENCE:
        strobes = PERIOD * np.arange(patience - done + 1)
        state, done = flow.sample(coefficients, state, strobes)[0][-1], patience
        path = flow.sample(coefficients, state, PERIOD * np.arange(LONGEST + 1))[0]
        away = np.abs(path[1:] - path[0]).max(axis=1)
        farthest = np.array([away[m - 1 :: m].max() for m in range(1, LONGEST + 1)])
        if farthest.min() <= RETURN:  # a multiple of the period may be just below that, and the period just above
            return path[0], int(np.flatnonzero(farthest <= 10 * RETURN)[0]) + 1
    return state, 0


def attractors(branches: Sequence[tuple[str, Branch]], frequency: float) -> list[tuple[str, int, NDArray[np.float64]]]:
    """Name of the branch, period, and states at the start of each forcing period, of all stable orbits there."""
    return [
        (name, orbit.period, stroboscopic(orbit))
        for name, branch in branches
        for orbit in Curve(branch).orbits_at(frequency)
        if orbit.stable
    ]


def ends_of(system: System, count: int) -> list[tuple[NDArray[np.float64], int]]:
    """Where many starts come to."""
    return [settled(system, start) for start in random_starts(system, count)]


def take_census(ends, known) -> Census:
    """Look for each end on the branches."""
    census = Census(Counter(), 0, 0, [])
    for state, period in ends:
        name = on_which(state, period, known)
        if period == 0:
            census.never += 1
        elif period > MAX_PERIOD:
            census.longer += 1
        elif name is None:
            census.missing.append(np.append(state, period))
        else:
            census.on_branches[name] += 1
    return census


def on_which(state: NDArray[np.float64], period: int, known, within: float = AT) -> str | None:
    """The branch on which a state that returns after some forcing periods is; None if on none."""
    for name, its_period, states in known:
        if its_period == period and np.abs(states - state).max(axis=1).min() <= within:
            return name
    return None


def by_scipy(system: System, state: NDArray[np.float64], known) -> str | None:
    """The branch on which a start ends if SciPy integrates it."""
    clutch = ScipyClutch(system)
    for _ in range(60):
        path = [state]
        for _ in range(MAX_PERIOD):
            path.append(clutch.period(path[-1], system.frequency))
        returns = np.flatnonzero(np.abs(np.array(path[1:]) - state).max(axis=1) <= SCIPY_RETURN)
        name = on_which(path[-1], int(returns[0]) + 1, known, SCIPY_AT) if len(returns) else None
        if name is not None:
            return name
        state = path[-1]
    return None


def named(tree) -> list[tuple[str, Branch]]:
    return [(member.name, member.branch) for member in tree.members]


# A window of the range


@pytest.fixture(scope="module")
def window():
    low, high = 0.43, 0.47
    options = {"max_period": MAX_PERIOD, "workers": 1, "search_values": 6}
    return diagram(case("15").at(frequency=high), "frequency", (low, high), **options)


@pytest.mark.slow
def test_every_attractor_by_the_island_of_period_3_is_on_a_branch(window):
    """At W = 0.45 a branch of period 1 and an island of period 3 share the box of starts."""
    ends = ends_of(case("15").at(frequency=0.45), 200)
    census = take_census(ends, attractors(named(window), 0.45))
    assert census.missing == []
    assert census.never + census.longer == 0
    assert set(census.on_branches) == {"P1-1", "P3-1"}
    assert min(census.on_branches.values()) >= 10
    # without the search the island's share would be missing, and seen to be so
    alone = take_census(ends, attractors(named(window)[:1], 0.45))
    assert len(alone.missing) == census.on_branches["P3-1"]
    assert {int(each[-1]) for each in alone.missing} == {3}


@pytest.mark.slow
def test_scipy_settles_to_the_same_attractors(window):
    """A second opinion on the flow."""
    system = case("15").at(frequency=0.45)
    known = attractors(named(window), 0.45)
    assert {by_scipy(system, start, known) for start in random_starts(system, 4)} == {"P1-1", "P3-1"}


# The whole range


@pytest.fixture(scope="module")
def whole():
    options = {"max_period": MAX_PERIOD, "search_values": 300}
    return diagram(case("15").at(frequency=WHOLE[1]), "frequency", WHOLE, **options)


@pytest.mark.slow
def test_the_diagram_of_figure_15_has_all_islands_of_period_3(whole):
    assert whole.complete
    threes = [member.branch for member in whole.members if member.period == 3 and member.begins is None]
    spans = [(float(branch.values.min()), float(branch.values.max())) for branch in threes]
    for island in ISLANDS:
        assert any(ends == pytest.approx(island, abs=2e-4) for ends in spans), island
    assert all(branch.ends[-1].reason is EndReason.CLOSED for branch in threes)
    assert "300 values of frequency" in " ".join(whole.notes)


@pytest.mark.slow
@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_every_attractor_of_figure_15_is_on_a_branch(whole, frequency, capsys):
    """2,000 starts at each of several frequencies; chaos and tori aside, which are counted."""
    system = case("15").at(frequency=frequency)
    known = attractors(named(whole), frequency)
    census = take_census(ends_of(system, 2000), known)
    with capsys.disabled():
        print(f"\nW = {frequency}: {dict(census.on_branches)}, longer {census.longer}, never {census.never}")
    assert census.missing == []
    assert census.on_branches.total() + census.longer + census.never == 2000
    assert census.never < 100
    seconds = {by_scipy(system, start, known) for start in random_starts(system, 3)}
    assert None not in seconds
    assert seconds <= set(census.on_branches)
