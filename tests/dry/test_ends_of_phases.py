"""Where a rigid stop ceases to be held, and where a branch ends because the motion jumps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Hysteretic
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.verification.friction_dop853 import carry
from tests.dry.trials.random_systems import random_system
from tests.sampled_verification import verified
from tests.tiers import in_campaign, keeps

LEAVES = math.sqrt(1.0 + math.pi**2)  # load over weight at which a plastic body is thrown for just one period


def thrown(amplitude: float) -> System:
    """A body of weight 1 that falls on a table without restitution, and is thrown up by a load; it flies at 0 rad."""
    stop = Contact("table", {"x": 1.0}, [Stage(0.5, side=Side.POSITIVE)], law="rigid", restitution=0.0)
    load = Harmonic(amplitude, {"x": 1.0}, 1, 2.5)
    return System(["x"], [[0.0]], [[0.0]], contacts=[stop], mean={"x": 1.0}, harmonics=[load], frequency=1.0)


def flying(amplitude: float) -> list[float]:
    """State at 0 rad of the body that leaves the table where the load exceeds its weight; closed form."""
    leaves = math.acos(-1.0 / amplitude)  # phase of the load
    t = 2.5 - leaves
    rate = t + amplitude * (math.sin(2.5) - math.sin(leaves))
    fall = 0.5 * t**2 - amplitude * (math.cos(2.5) - math.cos(leaves) + math.sin(leaves) * t)
    return [0.5 + fall, rate]


@keeps("amplitudes1")
@pytest.mark.parametrize("amplitudes", [(2.6, 3.5), (3.5, 2.6)])
def test_a_stop_ceases_to_be_held_where_the_flight_takes_a_period(amplitudes: tuple[float, float]) -> None:
    orbit = gw.find_orbit(thrown(2.6), start=flying(2.6))
    np.testing.assert_allclose(orbit.state, flying(2.6), atol=1e-12)
    assert orbit.held == {0: (1, 1)}
    if amplitudes[0] != 2.6:
        orbit = gw.follow(orbit, "harmonic1.amplitude", amplitudes[0]).points[-1].orbit
        leaves = math.pi - math.asin(math.pi / amplitudes[0])  # it lands as it left, a period before
        assert orbit.events[-1].theta == pytest.approx((leaves - 2.5) % PERIOD, abs=1e-10)
        assert orbit.held == {0: (0, 1)}
    walk = gw.WalkOptions(largest_step=0.04)
    branch = gw.follow(orbit, "harmonic1.amplitude", amplitudes[1], walk=walk)
    assert branch.ends[-1].reason is EndReason.RANGE
    (found,) = branch.special("held-stop")
    assert abs(found.value - LEAVES) <= found.uncertainty < 1e-8
    assert found.contact == "table +"
    assert found.nature.endswith("held 1 -> 0 times" if amplitudes[0] == 2.6 else "held 0 -> 1 times")
    assert branch.unexplained == ()
    if amplitudes[0] == 2.6:  # the same points, verified once
        assert gw.verify(branch).breaches == ()


@pytest.mark.slow
@pytest.mark.parametrize(("start", "sampled"), [(1.0, 4), in_campaign(0.3, 0)])
def test_a_branch_ends_where_a_stage_with_hysteresis_opens_in_a_touch(start: float, sampled: int) -> None:
    # the motion turns at its least deflection, where the spring with friction is strained to the limit of both stages
    stages = [Stage(0.1, 1.0, name="one", numbers={"hysteresis": 0.05}, side=Side.POSITIVE)]
    stages.append(Stage(0.5, 1.0, name="two", numbers={"hysteresis": 0.1}, side=Side.POSITIVE))
    damper = Contact("damper", {"x": 1.0}, stages, law=Hysteretic("elastic"), numbers={})
    dry = friction("dry", {"x": 1.0}, 0.0, stages_of="damper", stiffness=20.0)
    load = Harmonic(start, {"x": 1.0})
    system = System(["x"], [[0.2]], [[0.1]], [[1.0]], [damper, dry], {"x": 2.2}, [load], frequency=0.6)
    branch = gw.follow(gw.find_orbit(system), "harmonic1.amplitude", 3.0)
    end, last = branch.ends[-1], branch.points[-1].orbit
    assert end.reason is EndReason.JUMPS
    assert "damper.two +" in end.detail
    assert last.extremes[0, 1] == pytest.approx(0.5, abs=1e-6)
    # with hardly another load, the stage opens for a moment, and the motion is another one at once
    assert not [event for event in last.events if event.switch == 1]
    assert end.value - last.system["harmonic1.amplitude"] < 1e-6
    assert verified(branch, sampled).breaches == ()  # no motion is left at that value, beyond the last point
    opening = system.at({"harmonic1.amplitude": end.value})
    moved = flow_of(opening).integrate(coefficients_of(opening), last.state)
    opened, closed = [event.theta for event in moved.contacts if event.switch == 1]
    assert 0.0 < closed - opened < 1e-3
    assert np.abs(moved.state - last.state).max() > 1e-3


def test_a_stage_opens_for_a_moment_in_which_friction_stops_within_rounding_of_its_clearance() -> None:
    # the stage opens for 6e-7 rad, by 4e-13; where it turns back, friction stops, which is another event
    system = random_system(1).at(frequency=float.fromhex("0x1.4efc2215c82c1p-1"))
    state = ["0x1.4e335c06fa4e1p+1", "0x1.d52a4fcfc6ed3p-1", "0x1.394ef4cd4b4f7p+0", "0x1.86377ec33e641p-2"]
    start = np.array([float.fromhex(each) for each in (*state, "0x1.a21a8c4e0eea3p-3")])
    arc = flow_of(system).integrate(coefficients_of(system), start)
    np.testing.assert_allclose(arc.state, start, atol=1e-10)
    opened, closed = [event for event in arc.contacts if 3.40 < event.theta < 3.41]
    assert (opened.enters, closed.enters) == (False, True)
    assert 0.0 < closed.theta - opened.theta < 1e-6
    assert closed.velocity == pytest.approx(-opened.velocity, rel=1e-3)


def test_a_motion_that_begins_at_rest_leaves_a_stop_that_held_it() -> None:
    """It leaves within rounding of its breakpoint; its speed there is small, but not as small as that of the start."""
    system = random_system(96)
    arc = flow_of(system).integrate(coefficients_of(system), np.zeros(system.structure.state_size))
    assert [event.enters for event in arc.contacts[:4]] == [True, False, True, False]
    orbit = gw.find_orbit(system)
    (around,) = carry([orbit], lambda _: None)
    assert around.closure < 1e-9


@pytest.mark.slow
def test_a_walk_that_two_coinciding_events_stop_names_them() -> None:
    """A stage closes, and friction of the contact turns round 2e-12 rad beside it."""
    system = random_system(92)
    start, walk = system.at(frequency=1.003 * system.frequency), gw.WalkOptions(largest_step=0.1, smallest_step=1e-10)
    branch = gw.follow(gw.find_orbit(start), "frequency", 1.005 * system.frequency, walk=walk)
    assert branch.ends[-1].reason is EndReason.STEP
    assert "stages0.one - and stages0dry change together at theta = 2.68635" in branch.ends[-1].detail


@pytest.mark.slow
def test_slip_ends_in_both_directions_at_the_place_where_the_second_begins() -> None:
    """Also where both bounds are nearly reached, so that guesses from farther away slip."""
    system = random_system(166)
    up, down = (
        gw.follow(gw.find_orbit(system.at(frequency=start)), "frequency", end, walk=gw.WalkOptions(largest_step=0.1))
        for start, end in ((0.79, 0.8025), (0.8025, 0.79))
    )
    assert [each.contact for each in up.special_points] == ["stages0dry -", "stages0dry +"]
    first, second = up.special_points
    assert second.value - first.value > 1e-3
    ends = down.special_points
    assert sorted(each.contact for each in ends) == ["stages0dry +", "stages0dry -"]
    assert all(abs(each.value - second.value) < second.uncertainty + each.uncertainty < 2e-9 for each in ends)


@pytest.mark.slow
@pytest.mark.parametrize(("longest", "sampled"), [(0.3, 3), in_campaign(0.01, 0)])
def test_an_onset_is_verified_where_friction_is_pushed_along_without_net_slip(longest, sampled) -> None:
    """Beyond it the walk may be a little within the edge of the continuum, where its force does not reach its bound."""
    start, walk = gw.find_orbit(random_system(166).at(frequency=0.79)), gw.WalkOptions(largest_step=longest)
    branch = gw.follow(start, "frequency", 0.7952, walk=walk)
    assert [each.kind for each in branch.special_points] == [gw.Kind.SLIP_ONSET]
    assert verified(branch, sampled).ok
    onset = branch.special_points[0]
    turned = replace(branch, special_points=(replace(onset, contact="stages0dry +"),))
    assert not verified(turned, sampled).ok
