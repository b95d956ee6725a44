"""The tree of a diagram: cascades that go one way, and ends tied to the points at which they join other branches."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gapwalk.attractors.section import Strobe
from gapwalk.bifurcation import Branch, BranchTracer, Kind, SpecialPoint, follow, switch, walk_out
from gapwalk.bifurcation.diagram import Diagram, Origin
from gapwalk.bifurcation.follow import join
from gapwalk.continuation import BranchPoint, End, EndReason
from gapwalk.orbit import find_orbit
from gapwalk.orbit.floquet import Instability
from gapwalk.paper import case
from tests.tiers import in_campaign

AMPLITUDE = "harmonic1.amplitude"
FEIGENBAUM = 4.669201609
STABLE = Instability(0, 0, 0)


def branch(period: int, *flips: float) -> Branch:
    """A branch of nothing but flips."""
    orbit = find_orbit(case("13"), frequency=1.9)
    points = [BranchPoint(value, orbit, np.zeros(5), np.zeros(5), 1.0, 0.0) for value in flips]
    special = tuple(SpecialPoint(Kind.FLIP, point, STABLE, STABLE, 0.0) for point in points)
    return Branch(AMPLITUDE, period, (), special, (End(EndReason.BRANCHED, 0.0), End(EndReason.RANGE, 1.0)))


def family(*generations: tuple[float, ...]) -> Diagram:
    """A branch, its child from its first flip, the child of that from its first, and so on."""
    tree = Diagram(AMPLITUDE, (0.0, 1.0)).with_branch(branch(1, *generations[0]))
    for number, flips in enumerate(generations[1:], start=1):
        tree = tree.with_branch(branch(2**number, *flips), Origin(tree.members[-1].name, 0))
    return tree


def test_a_cascade_goes_one_way():
    values = np.cumsum([0.1, *(0.3 * FEIGENBAUM ** -np.arange(4.0))])
    (cascade,) = family(*((value,) for value in values)).cascades
    assert cascade.members == ("P1-1", "P2-1", "P4-1", "P8-1", "P16-1")
    assert cascade.ratios == pytest.approx([FEIGENBAUM] * 3)


def test_where_a_child_turns_round_a_cascade_ends_and_another_begins():
    (cascade,) = family((0.385,), (0.569,), (0.5685,), (0.5684,)).cascades
    assert cascade.members == ("P2-1", "P4-1", "P8-1")
    assert cascade.values == (0.569, 0.5685, 0.5684)
    there, back = family((0.1,), (0.2,), (0.3,), (0.29,), (0.28,)).cascades
    assert (there.values, back.values) == ((0.1, 0.2, 0.3), (0.3, 0.29, 0.28))
    assert family((0.1,), (0.2,), (0.15,), (0.18,)).cascades == ()
    assert family((0.1,), (0.2,), (0.2,), (0.3,)).cascades == ()  # two flips in one place have no ratio
    assert family((0.1,), (0.2,)).cascades == ()


def test_a_child_that_joins_its_parent_leads_on_from_its_other_end():
    tree = family((0.1, 0.9))
    tree = tree.with_branch(branch(2, 0.2, 0.3, 0.8), Origin("P1-1", 0))
    tied = replace(tree, members=(tree.members[0], replace(tree.members[1], joins=Origin("P1-1", 1))))
    tied = tied.with_branch(branch(4, 0.77), Origin("P2-1", 2))
    (cascade,) = tied.cascades
    assert cascade.values == (0.9, 0.8, 0.77)


def walked_to_flip(special: SpecialPoint) -> Branch:
    """The doubled branch from a flip up to the first flip on it."""
    tracer, steps = BranchTracer(switch(special, AMPLITUDE, (0.0, 1.0))[0]), []
    for step in tracer:
        steps.append(step)
        if any(each.kind is Kind.FLIP for each in step[1]):
            break
    tracing: Any = SimpleNamespace(traces=[tracer], steps=[steps])
    return join(tracing)


@pytest.fixture(scope="module")
def main() -> Branch:
    return follow(find_orbit(case("29"), at={AMPLITUDE: 0.05}), AMPLITUDE, to=1.0)


def cascades_from(main: Branch, value: float, generations: int):
    """The cascades that begin near one value of figure 29's main branch, from so many generations."""
    flip = min(main.special(Kind.FLIP), key=lambda each: abs(each.value - value))
    index = main.special_points.index(flip)
    tree = Diagram(AMPLITUDE, (0.0, 1.0)).with_branch(main)
    for _ in range(generations - 1):
        parent = tree.members[-1]
        child = walked_to_flip(parent.branch.special_points[index])
        tree = tree.with_branch(child, Origin(parent.name, index))
        index = next(i for i, each in enumerate(child.special_points) if each.kind is Kind.FLIP)
    return tree.cascades


@pytest.mark.slow
@pytest.mark.parametrize("generations", [4, in_campaign(5)])
def test_ratios_of_figure_29_come_near_feigenbaums_number(main, generations):
    (cascade,) = cascades_from(main, 0.34223, generations)
    assert cascade.members == ("P1-1", "P2-1", "P4-1", "P8-1", "P16-1")[:generations]
    assert np.all(np.diff(cascade.values) > 0.0)
    distances = np.abs(np.subtract(cascade.ratios, FEIGENBAUM))
    assert distances[0] < 1.0
    assert generations < 5 or distances[-1] < 0.7 * distances[0]


@pytest.mark.slow
def test_the_child_of_figure_29_that_turns_round_is_in_no_cascade_with_its_parent(main):
    # the ratios were -543, 4.6, 3.2: the child of the flip at 0.3849 goes up to 0.57 before it doubles, on its way back
    (cascade,) = cascades_from(main, 0.38486, 5)
    assert cascade.members[0] == "P2-1"
    assert cascade.values[0] == pytest.approx(0.56880397, abs=1e-8)
    assert all(ratio > 1.0 for ratio in cascade.ratios)


@pytest.mark.slow
def test_an_end_is_tied_to_the_flip_whose_orbit_it_shares_and_to_no_other_nearby():
    # where the parent is known only up to a place before the flip at which the last branch ends, that flip is on no
    # known branch, but another flip of the parent is 0.001 away
    main = follow(find_orbit(case("15"), frequency=1.9), "frequency", to=0.15)
    tree = Diagram("frequency", (0.15, 1.9)).with_branch(main)
    for value in (0.2190504, 0.1976937, 0.2023369):
        parent = tree.members[-1]
        index = min(
            (i for i, special in enumerate(parent.branch.special_points) if special.kind is Kind.FLIP),
            key=lambda i: abs(parent.branch.special_points[i].value - value),
        )
        child = walk_out(switch(parent.branch.special_points[index], "frequency", (0.15, 1.9)))
        tree = tree.with_branch(child, Origin(parent.name, index))
    first, second, third, fourth = tree.members
    for member, parent in ((second, first), (third, second)):
        special = parent.branch.special_points[member.joins.special]
        assert member.joins.parent == parent.name
        assert special.value == member.branch.ends[-1].value
        assert special.value == pytest.approx(member.branch.points[-1].value, abs=1e-7)
    shared = third.branch.special_points[fourth.joins.special]
    beyond = fourth.branch.ends[-1].value
    assert (fourth.joins.parent, shared.value) == (third.name, beyond)
    last = fourth.branch.points[-1].orbit
    later = Strobe(last.system).arc(last.state, 4).state  # the flip's orbit lies between the two halves of the last one
    flip = find_orbit(case("15"), 4, 0.5 * (last.state + later), frequency=beyond)
    assert np.abs(flip.multipliers + 1.0).min() < 1e-6
    np.testing.assert_allclose(shared.orbit.state, flip.state, atol=1e-6)

    known = third.branch.special_points[: fourth.joins.special]
    points = tuple(point for point in third.branch.points if point.arclength < known[-1].point.arclength)
    short = replace(third, branch=replace(third.branch, points=points, special_points=known))
    untied = replace(tree, members=(first, second, short)).with_branch(child, fourth.begins).members[-1]
    assert 1e-4 < min(abs(each.value - beyond) for each in known if each.kind is Kind.FLIP) < 2e-3
    assert untied.joins is None
    assert untied.branch.ends[-1].value == pytest.approx(beyond, abs=1e-9)
