"""Branches compared, and the branches of harmonic balance against those of shooting."""

from dataclasses import replace

import numpy as np
import pytest

from gapwalk import Balance, Contact, Harmonic, Kind, Stage, System, WalkOptions, compare, find_orbit, follow
from gapwalk.bifurcation.branch_start import switch
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError
from gapwalk.paper import case

WALK = WalkOptions(largest_step=0.02)


@pytest.fixture(scope="module")
def by_shooting():
    """Figure 12 around its upper resonance, with two folds and seven grazing points."""
    return follow(find_orbit(case("12"), frequency=0.8), "frequency", to=0.55)


def balanced(method: Balance, name: str = "12", start: float = 0.8, to: float = 0.55):
    return follow(find_orbit(case(name), frequency=start), "frequency", to=to, method=method, walk=WALK)


def test_a_branch_agrees_with_itself(by_shooting) -> None:
    comparison = compare(by_shooting, by_shooting)
    assert comparison.largest == comparison.largest_shift == 0.0
    assert len(comparison.matches) == len(by_shooting.special_points)


def test_other_steps_differ_by_no_more_than_the_interpolation(by_shooting) -> None:
    coarse = follow(by_shooting.points[0].orbit, "frequency", to=0.55, walk=WALK)
    comparison = compare(coarse, by_shooting)
    assert comparison.largest < 1e-4
    assert comparison.largest < 20 * comparison.resolution
    assert comparison.largest_shift < 1e-9


def test_a_known_shift_is_found(by_shooting) -> None:
    moved = replace(
        by_shooting,
        special_points=tuple(
            replace(each, point=replace(each.point, value=each.value + 1e-3)) for each in by_shooting.special_points
        ),
    )
    comparison = compare(by_shooting, moved)
    assert [match.difference for match in comparison.matches] == pytest.approx([1e-3] * len(comparison.matches))
    assert comparison.within(1e-3 / 0.25 * 1.01)
    assert not comparison.within(1e-3 / 0.25 * 0.99)


def test_special_points_of_one_branch_alone_are_named(by_shooting) -> None:
    fold = by_shooting.special(Kind.FOLD)[0]
    poorer = replace(by_shooting, special_points=tuple(s for s in by_shooting.special_points if s is not fold))
    comparison = compare(by_shooting, poorer)
    assert comparison.only_first == (fold,)
    assert comparison.only_second == ()
    assert not comparison.within(1.0)
    assert f"only in the first: {fold!r}" in str(comparison)


def test_the_mean_of_a_symmetric_motion_is_rounding_and_does_not_count() -> None:
    """A mass between two stops, and one that nothing moves."""
    gap = Contact("gap", {"x": 1.0}, (Stage(1.0, 20.0),))
    system = System(
        ["x", "y"],
        [[1.0, 0.0], [0.0, 1.0]],
        [[0.05, 0.0], [0.0, 0.05]],
        contacts=[gap],
        harmonics=[Harmonic(0.2, {"x": 1.0})],
        frequency=0.7,
    )
    shot, few = (
        follow(find_orbit(system, method=method), "frequency", to=1.1, method=method, walk=WALK)
        for method in (None, Balance(error=1e-4))
    )
    assert np.abs(shot.measure("mean.x")).max() < 1e-12
    assert compare(shot, few).within(1e-3)


def test_branches_of_different_parameters_are_refused(by_shooting) -> None:
    with pytest.raises(ModelError, match=r"one branch follows frequency, the other stage2\.clearance"):
        compare(by_shooting, replace(by_shooting, parameter="stage2.clearance"))


def test_balance_tends_to_shooting_with_more_harmonics(by_shooting) -> None:
    """Errors of the folds: measured 2e-4 at H = 5, 2e-6 at 10, 5e-8 at 20, as others found too."""
    bounds = {5: (3e-4, 4e-3), 10: (4e-6, 2e-4), 20: (2e-7, 1e-4)}  # of the ranges, 5e-5 is the interpolation's
    for harmonics, (shift, distance) in bounds.items():
        comparison = compare(balanced(Balance(harmonics, error=1.0)), by_shooting)
        folds = [match for match in comparison.matches if match.first.kind is Kind.FOLD]
        assert len(folds) == 2
        assert not comparison.only_first
        assert not comparison.only_second
        assert max(abs(match.difference) for match in folds) < shift
        assert comparison.largest < distance


def test_flips_are_located_with_their_nature(by_shooting) -> None:
    start = find_orbit(case("9b"), frequency=1.45)
    shot = follow(start, "frequency", to=1.1)
    comparison = compare(balanced(Balance(15), "9b", 1.45, 1.1), shot)
    flips = [match for match in comparison.matches if match.first.kind is Kind.FLIP]
    assert len(flips) == 2
    assert all(match.first.nature == match.second.nature != "" for match in flips)
    assert all(match.first.change == match.second.change for match in flips)
    assert comparison.within(1e-4)


@pytest.mark.slow
def test_natures_are_right_with_few_harmonics() -> None:
    """They are read off the doubled branch, which the truncated equation has leave at a place of its own."""
    shot = follow(find_orbit(case("13"), frequency=1.4), "frequency", to=0.38)
    few = balanced(Balance(8, error=1.0), "13", 1.4, 0.38)
    assert [flip.nature for flip in few.special(Kind.FLIP)] == [flip.nature for flip in shot.special(Kind.FLIP)]
    assert [flip.nature[:3] for flip in shot.special(Kind.FLIP)] == ["sup", "sub", "sup", "sup", "sup", "sub"]


def test_the_doubled_branch_is_walked_from_one_flip_to_the_other() -> None:
    method = Balance(12, error=1e-3)
    parent = balanced(method, "9b", 1.45, 1.1)
    first, second = parent.special(Kind.FLIP)
    child = follow(first, "frequency", (1.1, 1.45), walk=WALK, method=method)
    assert child.period == 2
    assert child.ends[-1].reason is EndReason.JOINED
    assert child.ends[-1].value == pytest.approx(second.value, abs=2e-5)
    middle = child.points[len(child.points) // 2]
    exact = find_orbit(middle.orbit.system, 2, middle.orbit.state)
    assert middle.orbit.state == pytest.approx(exact.state, abs=5e-3)
    assert middle.orbit.measure("h1/2.q1") == pytest.approx(exact.measure("h1/2.q1"), abs=1e-4)


def test_harmonics_grow_along_the_branch_as_the_error_needs(by_shooting) -> None:
    branch = balanced(Balance(error=1e-5))
    assert len(branch.points[0].x) < len(branch.points[-1].x)
    assert max(point.orbit.truncation for point in branch.points) <= 1e-5
    comparison = compare(branch, by_shooting)
    assert comparison.within(1e-4)
    assert comparison.largest_shift < 3e-7


def test_a_flip_is_left_with_as_many_harmonics_as_it_was_found_with() -> None:
    parent = balanced(Balance(error=1e-5), "9b", 1.45, 1.1)
    flip = parent.special(Kind.FLIP)[0]
    shot = follow(find_orbit(case("9b"), frequency=1.45), "frequency", to=1.1).special(Kind.FLIP)[0]
    assert len(flip.point.x) > 22
    assert flip.value == pytest.approx(shot.value, abs=1e-6)
    assert flip.nature == shot.nature == "supercritical"
    (beginning,) = switch(flip, "frequency", (1.1, 1.45), Balance(error=1e-5))
    assert len(beginning.first.x) == 2 * len(flip.point.x) - 2


def test_orbits_are_looked_up_on_a_balanced_branch_of_growing_harmonics(by_shooting) -> None:
    branch = balanced(Balance(error=1e-4))
    curve = Curve(branch)
    assert len({point.orbit.harmonics for point in branch.points}) > 1
    between = follow(branch.points[30].orbit, "frequency", to=0.55, method=Balance(error=1e-4)).points[3].orbit
    assert curve.holds(between)
    exact = by_shooting.points[len(by_shooting.points) // 2].orbit
    assert curve.holds(exact)  # to the truncation
    assert not Curve(by_shooting).holds(replace(exact, state=exact.state + 1e-4))
    assert not curve.holds(replace(exact, state=exact.state + 0.1))
    nearest = min(
        curve.orbits_at(exact.system.frequency), key=lambda orbit: float(np.abs(orbit.state - exact.state).max())
    )
    assert nearest.state == pytest.approx(exact.state, abs=5e-3)
    assert nearest.harmonics == max(point.orbit.harmonics for point in branch.points)


def test_a_doubled_balanced_branch_holds_its_motions_begun_a_period_later() -> None:
    method = Balance(12, error=1e-3)
    flip = balanced(method, "9b", 1.45, 1.1).special(Kind.FLIP)[0]
    child = follow(flip, "frequency", (1.1, 1.45), walk=WALK, method=method)
    orbit = child.points[len(child.points) // 2].orbit
    start = child.points[len(child.points) // 2 + 1].orbit.strobes(2)[1]  # a forcing period later
    there = child.points[len(child.points) // 2 + 1].orbit.system
    later = find_orbit(there, 2, start, method=method)
    assert not np.allclose(later.state, child.points[len(child.points) // 2 + 1].orbit.state, atol=1e-2)
    assert lies_on(child, later)
    assert lies_on(child, orbit)
    assert not lies_on(child, find_orbit(orbit.system, 1, "rest", method=method))


def test_a_balanced_branch_can_be_drawn(tmp_path) -> None:
    figure = balanced(Balance(10, error=1.0), to=0.6).plot("q1").figure
    figure.savefig(tmp_path / "branch.png")
    assert (tmp_path / "branch.png").stat().st_size > 5000


def test_too_few_harmonics_end_the_branch_with_what_to_change() -> None:
    branch = balanced(Balance(8, error=2e-4))
    end = branch.ends[-1]
    assert end.reason is EndReason.COARSE
    assert end.reason.is_failure
    assert "take harmonics = 16 or more" in str(end)
    assert all(point.orbit.truncation <= 2e-4 for point in branch.points)
    assert 0.6 < branch.points[-1].value < 0.78


def test_a_step_that_turns_unseen_invents_nothing() -> None:
    """With steps over a whole resonance, figure 12 once had two false folds near .33."""
    start = find_orbit(case("12"), frequency=0.45)
    branch = follow(start, "frequency", to=0.15, method=Balance(20), walk=WalkOptions(largest_step=0.1))
    assert branch.special_points == ()
    assert np.all(np.diff(branch.values) < 0.0)
