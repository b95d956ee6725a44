"""Grazes of stages that add friction: its force is there at once, however soft the touch is."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import Arc
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.model.coefficients import layout_of
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Hysteretic
from gapwalk.orbit.sticking import Closure
from tests.dry.trials.random_systems import random_system
from tests.sampled_verification import SAMPLED, verified

FREQUENCY, DAMPING, CLEARANCE = 0.8, 0.1, 0.5
GRAZE = CLEARANCE * abs(1.0 - FREQUENCY**2 + 1j * DAMPING * FREQUENCY)
"""Load at which a linear oscillator reaches the clearance."""


def clutch(load: float) -> gw.System:
    stage = Stage(CLEARANCE, 2.0, side=Side.POSITIVE, numbers={"hysteresis": 0.1})
    return gw.System(
        ["x"],
        [[1.0]],
        [[DAMPING]],
        contacts=[
            Contact("clutch", {"x": 1.0}, [stage], law=Hysteretic("elastic")),
            friction("rub", {"x": 1.0}, 0.0, stages_of="clutch"),
        ],
        harmonics=[gw.Harmonic(load, {"x": 1.0})],
        frequency=FREQUENCY,
    )


@pytest.mark.parametrize("sampled", SAMPLED)
@pytest.mark.parametrize("ends", [(0.9, 1.1), (1.1, 0.9)])
def test_a_graze_with_friction_turns_the_branch_in_either_direction(ends: tuple[float, float], sampled: int) -> None:
    """The branch turns back at the graze, since a multiplier jumps across 1 there, and once more at a fold."""
    branch = gw.follow(gw.find_orbit(clutch(ends[0] * GRAZE)), "harmonic1.amplitude", ends[1] * GRAZE)
    assert branch.ends[-1].reason is EndReason.RANGE
    assert sorted(str(each.kind) for each in branch.special_points) == ["fold", "grazing"]
    (graze,), (fold,) = branch.special("grazing"), branch.special("fold")
    assert abs(graze.value - GRAZE) <= graze.uncertainty < 1e-9
    assert graze.is_corner
    assert graze.turns
    assert fold.value < GRAZE
    assert branch.unexplained == ()
    assert verified(branch, sampled).breaches == ()


def test_multipliers_grow_without_bound_as_the_touch_becomes_softer() -> None:
    branch = gw.follow(gw.find_orbit(clutch(1.1 * GRAZE)), "harmonic1.amplitude", 0.9 * GRAZE)
    (graze,) = branch.special("grazing")
    touching = [each for each in branch.points if each.orbit.closings[0]][-8:]
    depths = np.array([max(each.orbit.turning_depths[0].values) for each in touching])
    largest = np.array([abs(each.orbit.multipliers[0]) for each in touching])
    soft = depths < 1e-4
    assert soft.sum() >= 2
    slope = np.polyfit(np.log(depths[soft]), np.log(largest[soft]), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.05)
    assert graze.before.total == 1


@pytest.mark.slow
def test_a_graze_at_which_the_motion_jumps_is_not_counted() -> None:
    """The branch ends there: a spring with friction would lose part of its force at once where the stage opens."""
    system = random_system(29)
    branch = gw.follow(gw.find_orbit(system.at(frequency=0.993)), "frequency", 0.99)
    assert branch.ends[-1].reason is EndReason.JUMPS
    assert branch.special("grazing") == ()
    assert branch.unexplained == ()


@pytest.mark.slow
def test_a_graze_at_which_a_multiplier_jumps_across_minus_one_is_passed_in_either_direction() -> None:
    system = random_system(39)
    walk = gw.WalkOptions(largest_step=0.1)
    there = gw.follow(gw.find_orbit(system.at(frequency=0.972)), "frequency", 0.969, walk=walk)
    back = gw.follow(there.points[-1].orbit, "frequency", 0.972, walk=walk)
    for branch in (there, back):
        assert branch.ends[-1].reason is EndReason.RANGE
        (graze,) = branch.special_points
        assert graze.passes_flip
        assert branch.unexplained == ()
    one, other = there.special_points[0], back.special_points[0]
    assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty < 1e-8


@pytest.mark.slow
def test_a_stage_that_opens_as_its_friction_reverses_is_passed() -> None:
    """The acceleration of the deflection jumps where it turns, just where the stage opens."""
    system = random_system(132)
    branch = gw.follow(gw.find_orbit(system.at(frequency=1.19)), "frequency", 1.18)
    assert branch.ends[-1].reason is EndReason.RANGE
    assert [str(each.kind) for each in branch.special_points] == ["grazing", "fold"]
    assert branch.unexplained == ()


def test_beside_a_huge_multiplier_the_others_are_kept() -> None:
    slips = [SlipEvent(0.0, 0, 1)]
    arc = Arc(np.zeros(3), np.diag([2e12, 1.2, 1e-5]), None, [], 1, slips)
    closure = Closure.of(layout_of(clutch(1.0).structure), lambda: np.zeros(0), [arc], np.zeros(3))
    assert closure.multipliers.tolist() == [2e12, 1.2, 0.0]
