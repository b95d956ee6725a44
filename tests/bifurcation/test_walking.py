"""A branch walked point by point: looked at, stopped, and resumed."""

import pickle
from collections import Counter

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError


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


def test_an_isolated_branch_is_walked_once():
    """Newton's method failed from the chord that passes the start, and the branch was walked 92 times."""
    start = [1.7393025818988646, -0.1308810692485267, -0.5480666393837627, 0.00721262586600034]
    orbit = gw.find_orbit(gw.paper.case("15"), 7, start, frequency=0.19958333333333333)
    branch = gw.follow(orbit, "frequency", (0.15, 1.9), walk=gw.WalkOptions(max_points=500))
    assert [end.reason for end in branch.ends] == [EndReason.START, EndReason.CLOSED]
    assert Counter(str(each.kind) for each in branch.special_points) == {"fold": 4, "flip": 4, "grazing": 4}
    values = sorted(each.value for each in branch.special_points)
    assert np.diff(values).min() > 1e-9  # each was met once


@pytest.mark.parametrize(
    ("period", "frequency", "start"),
    [(5, 0.5967, [1.0193, 0.6277, 0.0993, 0.0138]), (7, 0.5936, [0.8277, 0.5533, 0.3139, 0.1769])],
)
def test_an_isolated_branch_ends_where_its_first_motion_comes_back_with_another_phase(period, frequency, start):
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
    assert gw.verify(branch).breaches == ()
