"""A branch walked point by point: looked at, stopped, and resumed."""

import pickle
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation import EndReason
from gapwalk.continuation.walk import End
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.orbit import sensitivity
from tests.computed import once
from tests.sampled_verification import verified
from tests.tiers import in_campaign


def system() -> gw.System:
    return gw.System(
        ["a"],
        [[1.0]],
        [[0.08]],
        contacts=[gw.backlash("stop", {"a": 1.0}, 1.0, 20.0, impact_damping=0.1)],
        harmonics=[gw.Harmonic(0.5, {"a": 1.0})],
        frequency=1.0,
    )


def test_the_points_are_those_of_the_branch():
    orbit = gw.find_orbit(system())
    branch = gw.follow(orbit, "frequency", 0.6)
    steps = gw.walk(orbit, "frequency", 0.6)
    points, special = [], []
    for point in steps:
        points.append(point)
        special += steps.special_points
    assert [point.value for point in points] == [point.value for point in branch.points[1:]]
    assert [each.value for each in special] == [each.value for each in branch.special_points]
    assert steps.branch.ends == branch.ends


def test_a_walk_in_both_directions_is_resumed_in_either_of_them():
    orbit = gw.find_orbit(system())
    whole = gw.follow(orbit, "frequency", (0.8, 1.2))
    for count in (3, len(whole.points) - 4):
        steps = gw.walk(orbit, "frequency", (0.8, 1.2))
        for _ in range(count):
            next(steps)
        state = pickle.loads(pickle.dumps(steps.state))
        resumed = gw.walk(orbit, "frequency", (0.8, 1.2), resume=state)
        for _ in resumed:
            pass
        assert np.array_equal(resumed.branch.values, whole.values)
        assert resumed.branch.ends == whole.ends


def test_what_was_walked_is_a_branch():
    steps = gw.walk(gw.find_orbit(system()), "frequency", 0.6)
    with pytest.raises(ModelError, match="next"):
        assert steps.branch
    next(steps)
    assert len(steps.branch.points) == 2
    assert steps.branch.ends[-1].reason is EndReason.STOPPED


def test_a_branch_that_leaves_a_special_point_is_walked_too():
    branch = gw.follow(gw.find_orbit(system()), "frequency", 0.6)
    (first, *_) = [each for each in branch.special_points if each.kind in ("flip", "branch-point")]
    steps = gw.walk(first, "frequency", (0.6, 1.0))
    assert next(steps).orbit.period in (1, 2)
    assert steps.branch.ends[0].reason is EndReason.BRANCHED


@pytest.mark.slow
def test_an_isolated_branch_is_walked_once():
    """Newton's method failed from the chord that passes the start, and the branch was walked 92 times."""
    start = [1.7393025818988646, -0.1308810692485267, -0.5480666393837627, 0.00721262586600034]
    orbit = gw.find_orbit(gw.paper.case("15"), 7, start, frequency=0.19958333333333333)
    branch = gw.follow(orbit, "frequency", (0.15, 1.9), walk=gw.WalkOptions(max_points=500))
    assert [end.reason for end in branch.ends] == [EndReason.START, EndReason.CLOSED]
    assert Counter(str(each.kind) for each in branch.special_points) == {"fold": 4, "flip": 4, "grazing": 4}
    values = sorted(each.value for each in branch.special_points)
    assert np.diff(values).min() > 1e-9  # each was met once


FIVE, SEVEN = (5, 0.5967, [1.0193, 0.6277, 0.0993, 0.0138]), (7, 0.5936, [0.8277, 0.5533, 0.3139, 0.1769])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("period", "frequency", "start", "sampled"), [(*FIVE, 4), in_campaign(*FIVE, 0), in_campaign(*SEVEN, 0)]
)
def test_an_isolated_branch_ends_where_its_first_motion_comes_back_with_another_phase(
    period, frequency, start, sampled
):
    """It was walked as many times around as its motions have periods, with each special point as often."""
    masses = gw.System(
        ["a", "b"],
        [[1.0, -1.0], [-1.0, 2.0]],
        [[0.03, -0.03], [-0.03, 0.06]],
        contacts=[gw.stop("stop", {"a": 1.0}, clearance=1.0, stiffness=100.0)],
        harmonics=[gw.Harmonic(0.1, {"b": 1.0})],
        frequency=frequency,
    )
    branch = gw.follow(gw.find_orbit(masses, period, start), "frequency", (0.5, 0.8))
    assert [end.reason for end in branch.ends] == [EndReason.START, EndReason.CLOSED]
    assert len(branch.special("fold")) == 2
    first, last = branch.points[0], branch.points[-1]
    assert np.abs(first.orbit.state - last.orbit.state).max() > 1e-2
    assert np.abs(first.orbit.strobes(period) - last.orbit.state).max(axis=1).min() < 1e-12
    values = sorted(each.value for each in branch.special_points)
    assert np.diff(values).min() > 1e-9  # each was met once
    assert verified(branch, sampled).breaches == ()


@once
def unstable_branch() -> gw.Branch:
    """Motions of HarmonicBalance.jl issue 451, whose largest multiplier grows without a bound towards W = .3."""
    mass = gw.System(
        ["x"],
        [[1.0]],
        [[0.05]],
        contacts=[gw.force("nl", {"x": 1.0}, "a*x**10", a=0.05)],
        harmonics=[gw.Harmonic(0.2, {"x": 1.0})],
        frequency=0.5,
    )
    return gw.follow(gw.find_orbit(mass, frequency=0.3), "frequency", to=2.0)


@pytest.mark.slow
def test_strongly_unstable_motions_are_followed_in_segments():
    branch = unstable_branch()
    assert branch.ends[1].reason is EndReason.TURNED_BACK
    assert not branch.unexplained
    assert abs(branch.points[-1].orbit.multipliers[0]) > 1e18
    # by multiple shooting with DOP853 in 30 segments: state and largest multiplier
    for value, state, largest in (
        (0.5, (0.71314187, 1.25901763), 97195433.6),
        (0.45, (0.4375006, 1.3686577), 5.69986262e9),
    ):
        (orbit,) = [each for each in Curve(branch).orbits_at(value) if not each.stable]
        assert orbit.state == pytest.approx(state, abs=1e-7)
        assert orbit.multipliers[0].real == pytest.approx(largest, rel=1e-8)
        assert np.prod(orbit.multipliers).real == pytest.approx(np.exp(-0.05 * 2.0 * np.pi / value), rel=1e-6)
        assert Curve(branch).holds(orbit)


def test_measures_of_a_strongly_unstable_motion_follow_it_to_the_end_of_its_period():
    orbit = unstable_branch().points[-1].orbit
    motion = orbit.motion(256)
    assert np.abs(motion.q[-1] - motion.q[0]).max() < 1e-9
    # the work of the load is lost in the damping: a motion from the state at theta = 0 alone would leave the orbit
    velocity = motion.signal("x'")[:-1]
    assert 0.2 * (np.cos(motion.theta[:-1]) * velocity).mean() == pytest.approx(0.05 * (velocity**2).mean(), rel=1e-10)
    assert gw.analysis.energy(orbit).imbalance < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, in_campaign(12)])
def test_verify_accepts_strongly_unstable_motions_and_finds_a_false_state(count):
    branch = unstable_branch()
    points = branch.points[-12:][:count]
    ends = End(EndReason.START, points[0].value), End(EndReason.STOPPED, points[-1].value)
    part = replace(branch, points=points, special_points=(), ends=ends)
    assert gw.verify(part).ok
    false = replace(points[1].orbit, restarts=points[1].orbit.restarts * (1.0 + 1e-7))
    spoiled = (points[0], replace(points[1], orbit=false), *points[2:])
    assert not gw.verify(replace(part, points=spoiled)).ok


def test_a_walk_that_ends_in_unstable_motions_says_the_multiplier():
    orbit = unstable_branch().points[-1].orbit
    text = gw.Shooting(4).pose(orbit.system).inaccuracy(replace(orbit, multipliers=1e4 * orbit.multipliers))
    assert "grow by 3.18e+22 in a period" in text
    assert "gw.Shooting(segments = 16)" in text
    with pytest.raises(NumericalError, match="grow by"):
        sensitivity(orbit, ["frequency"])
