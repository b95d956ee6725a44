"""A mass that is free in a box with rigid walls: its walks end neither as floating nor in endless halving of a step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw

EXAMPLE = Path(__file__).parents[2] / "examples" / "impact_damper.toml"


@pytest.fixture(scope="module")
def orbit() -> gw.Orbit:
    settled = gw.settle(gw.read_study(EXAMPLE).system, start=[0.1, 0.1, 0.0, 0.5])
    assert settled.orbit is not None
    return settled.orbit


def test_an_impact_has_a_depth_that_vanishes_at_a_graze(orbit: gw.Orbit) -> None:
    deepest = sorted(max(turns.values) for turns in orbit.turning_depths)
    velocity = max(event.velocity for event in orbit.events)
    assert deepest == pytest.approx([0.5 * velocity**2] * 2, rel=1e-6)


def test_between_impacts_the_mass_flies_straight_from_wall_to_wall(orbit: gw.Orbit) -> None:
    first, second = orbit.events
    motion = orbit.motion(4096)
    x, y = motion.signal("x"), motion.signal("y")
    meets = [np.interp(event.theta, motion.theta, x) for event in (first, second)]
    assert sorted(meets) == pytest.approx([-abs(meets[0]), abs(meets[0])], abs=1e-6)
    # over half a period it flies from one wall to the other
    flight = abs(np.interp(second.theta, motion.theta, y) - np.interp(first.theta, motion.theta, y))
    inside = (motion.theta > first.theta + 0.01) & (motion.theta < second.theta - 0.01)
    speed = abs(np.diff(y[inside]) / np.diff(motion.theta[inside]))
    assert speed == pytest.approx(flight / np.pi, abs=1e-6)


def test_a_walk_finds_where_equal_impacts_become_unstable(orbit: gw.Orbit) -> None:
    branch = gw.follow(orbit, "frequency", 0.975)
    assert branch.values[-1] == 0.975
    assert [each.kind for each in branch.special_points] == [gw.Kind.BRANCH_POINT]
    before, after = branch.points[0].orbit, branch.points[-1].orbit
    assert before.stable
    assert not after.stable
    assert branch.unexplained == ()
