"""Which orbits lie on a branch: against finer walks, through folds and doublings, and against neighbours off it."""

from dataclasses import replace

import numpy as np
import pytest

from gapwalk.bifurcation import Kind, follow, switch, walk_out
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.continuation import EndReason, WalkOptions
from gapwalk.orbit import Shooting, find_orbit
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.paper import case
from tests.bifurcation.test_special_points import symmetric

FINER = WalkOptions(initial_step=0.001, largest_step=0.004)
AMPLITUDE = "harmonic1.amplitude"


@pytest.fixture(scope="module")
def response():
    return follow(find_orbit(case("13"), frequency=2.0), "frequency", to=0.3)


@pytest.fixture(scope="module")
def loop():
    """The larger isolated loop of figure 27."""
    start = find_orbit(case("27").at({AMPLITUDE: 0.0}), start=[-1.3, 0.5, 0.1, 0.1])
    return follow(find_orbit(start.system, start=start.state), AMPLITUDE, to=(-1.0, 1.0))


@pytest.mark.slow
def test_every_orbit_of_a_finer_walk_lies_on_the_branch(response):
    finer = follow(find_orbit(case("13"), frequency=2.0), "frequency", to=0.3, walk=FINER)
    assert len(finer.points) > 1.5 * len(response.points)
    curve = Curve(response)
    assert [point for point in finer.points if not curve.holds(point.orbit)] == []
    assert [special for special in finer.special_points if not curve.holds(special.orbit)] == []
    assert lies_on(response, finer.points[100].orbit)


@pytest.mark.slow
def test_both_orbits_by_a_fold_are_found_and_lie_on_the_branch_however_near(response):
    curve = Curve(response)
    folds = response.special(Kind.FOLD)
    assert len(folds) == 6
    for fold in folds:
        inside = 1.0 if fold.nature == "opens to higher values" else -1.0
        for distance in (1e-3, 1e-6, 1e-9):
            orbits = curve.orbits_at(fold.value + inside * distance)
            assert [orbit.stable for orbit in orbits] == [True, False, True]
            assert all(curve.holds(orbit) for orbit in orbits)
            assert len(curve.orbits_at(fold.value - inside * distance)) == 1


@pytest.mark.slow
def test_doubled_branches_and_their_parents(response):
    parent = Curve(response)
    for flip in response.special(Kind.FLIP)[:3]:
        doubled = walk_out(switch(flip, "frequency", (0.3, 2.0)))
        assert doubled.ends[-1].reason is EndReason.JOINED
        curve = Curve(doubled)
        own = doubled.points[2:-2]
        assert not any(parent.holds(point.orbit) for point in own)
        assert not any(curve.holds(point.orbit) for point in response.points)
        assert curve.holds(flip.orbit)  # where one begins on the other they share an orbit
        assert parent.holds(doubled.points[0].orbit)
        # begun one forcing period later it is the same motion; so it is when it is called a motion of period 4
        later = [replace(point.orbit, state=stroboscopic(point.orbit)[1]) for point in own]
        assert all(curve.holds(orbit) for orbit in later)
        assert all(curve.holds(replace(orbit, period=4)) for orbit in later[::10])


@pytest.mark.parametrize("size", [1e-14, 1e-12, 1e-10, 1e-8])
def test_where_branches_meet_they_hold_the_orbit_however_it_is_rounded(response, size):
    rng = np.random.default_rng(1)
    flips = response.special(Kind.FLIP)[:2]
    parent = Curve(response)
    for flip in flips:
        curve = Curve(walk_out(switch(flip, "frequency", (0.3, 2.0))))
        for end in flips:  # it begins at one and joins the other
            for _ in range(20):
                rounded = replace(end.orbit, state=end.orbit.state * (1.0 + size * rng.normal(size=4)))
                assert curve.holds(rounded)
                assert parent.holds(rounded)


def test_beside_where_branches_meet_each_holds_its_own_orbits(response):
    rng = np.random.default_rng(2)
    parent = Curve(response)
    flip = response.special(Kind.FLIP)[0]
    beginning = switch(flip, "frequency", (0.3, 2.0))[0]
    curve, corrector = Curve(walk_out([beginning])), beginning.corrector
    for amplitude in (1e-6, 1e-5, 1e-4, 1e-3):
        point = beginning.first
        correction = corrector.correct(point.x + amplitude * point.tangent, point.tangent)
        orbit = corrector.point(correction, point.tangent, amplitude).orbit
        for _ in range(5):
            rounded = replace(orbit, state=orbit.state * (1.0 + 1e-12 * rng.normal(size=4)))
            assert curve.holds(rounded)
            assert not parent.holds(rounded)
        for side in (-1.0, 1.0):
            beside = {"frequency": flip.value + side * 10 * amplitude}
            assert not curve.holds(find_orbit(flip.orbit.system, start=flip.orbit.state, at=beside))


def test_the_branch_from_its_other_end_is_the_same(response):
    first, second = (walk_out(switch(flip, "frequency", (0.3, 2.0))) for flip in response.special(Kind.FLIP)[:2])
    curve = Curve(first)
    assert first.ends[-1].value == pytest.approx(second.points[0].value, abs=1e-8)
    assert all(curve.holds(point.orbit) for point in second.points)


@pytest.mark.slow
def test_a_closed_loop_and_the_branch_that_passes_it_by(loop):
    assert loop.ends[-1].reason is EndReason.CLOSED
    main = follow(find_orbit(case("27")), AMPLITUDE, to=(-1.0, 1.0))
    on_loop, on_main = Curve(loop), Curve(main)
    assert not any(on_main.holds(point.orbit) for point in loop.points)
    assert not any(on_loop.holds(point.orbit) for point in main.points)
    middle = loop.points[len(loop.points) // 3].orbit
    again = follow(middle, AMPLITUDE, to=(-1.0, 1.0), walk=FINER)
    assert all(on_loop.holds(point.orbit) for point in again.points)
    assert len(on_loop.orbits_at(0.0)) == 2
    assert len(on_main.orbits_at(0.0)) == 1
    assert on_loop.orbits_at(0.5) == []


def test_an_orbit_of_another_system_is_on_no_branch(response):
    orbit = response.points[50].orbit
    assert lies_on(response, orbit)
    other = find_orbit(orbit.system, start=orbit.state, at={"stage2.clearance": 1.0 + 1e-9})
    assert not lies_on(response, other)
    assert not lies_on(response, find_orbit(symmetric(1.0)))
    beyond = find_orbit(case("13"), frequency=2.1)
    assert not lies_on(response, beyond)


def test_branches_walked_with_several_segments(response):
    several = follow(find_orbit(case("13"), frequency=0.9), "frequency", to=0.7, method=Shooting(segments=3))
    curve, single = Curve(several), Curve(response)
    inside = [point for point in response.points if 0.7 <= point.value <= 0.9]
    assert len(inside) > 10
    assert all(curve.holds(point.orbit) for point in inside)
    assert all(single.holds(point.orbit) for point in several.points)


@pytest.mark.slow
def test_branches_are_told_apart_close_to_where_they_cross():
    branch = follow(find_orbit(symmetric(3.0)), "frequency", to=0.6)
    breaking = branch.special(Kind.BRANCH_POINT)[0]
    broken = walk_out([switch(breaking, "frequency", (0.6, 3.0))[0]])
    curve = Curve(branch)
    held = [curve.holds(point.orbit) for point in broken.points]
    assert held[0]
    assert not any(held[1:-1])
    assert np.abs(broken.points[1].orbit.state - breaking.orbit.state).max() < 0.2
