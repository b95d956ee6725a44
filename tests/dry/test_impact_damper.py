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
    before = np.flatnonzero(motion.theta < second.theta)[-12:-1]  # x has a corner at the impact
    cubic = np.polyfit(motion.theta[before] - second.theta, motion.signal("x")[before], 3)
    inside = (motion.theta > first.theta + 0.01) & (motion.theta < second.theta - 0.01)
    speed = np.abs(np.diff(motion.signal("y")[inside]) / np.diff(motion.theta[inside]))
    # in half a period it flies from one wall to the other, which have moved to opposite places
    width = 2.0 * orbit.system["box.clearance"]
    assert speed == pytest.approx((width + 2.0 * abs(cubic[-1])) / np.pi, rel=1e-8) or speed == pytest.approx(
        (width - 2.0 * abs(cubic[-1])) / np.pi, rel=1e-8
    )


def test_a_walk_finds_where_equal_impacts_become_unstable(orbit: gw.Orbit) -> None:
    branch = gw.follow(orbit, "frequency", 0.975)
    assert branch.values[-1] == 0.975
    assert [each.kind for each in branch.special_points] == [gw.Kind.BRANCH_POINT]
    before, after = branch.points[0].orbit, branch.points[-1].orbit
    assert before.stable
    assert not after.stable
    assert branch.unexplained == ()
