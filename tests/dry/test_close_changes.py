"""Changes of slip and stick close to each other, or so brief that the flow leaves them out."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.orbit.shooting import ShootingEquation
from tests.dry.trials.random_systems import random_system
from tests.tiers import in_campaign

PAIR = [(gw.Kind.GRAZING_SLIDING, 0.7348862749), (gw.Kind.SWITCHING_SLIDING, 0.7348864748)]


@pytest.mark.parametrize("way", [in_campaign(1), -1])
def test_two_changes_within_a_step_over_a_corner_are_told_apart(way: int) -> None:
    """Slip that is interrupted by stick, and from 2e-7 on ends with it, looks like crossing-sliding from afar."""
    start, end = (0.73487, 0.7349)[::way]
    orbit = gw.find_orbit(random_system(102).at(frequency=start))
    branch = gw.follow(orbit, "frequency", end)
    found = [(each.kind, pytest.approx(each.value, abs=1e-10)) for each in branch.special_points]
    assert found == [pair for pair in PAIR[::way] for _ in range(2)]  # the motion is symmetric


def test_a_spring_that_slips_at_the_start_of_the_period_is_not_taken_to_stick_there() -> None:
    """Its extension is at its limit in the orbit, but a little within it in the last motion of Newton's method.

    Such a motion begins with stick, as if a phase of slip had been divided in two.
    """
    orbit = gw.find_orbit(random_system(115).at(frequency=1.9818436975))
    equation = gw.Shooting().pose(orbit.system, "frequency", 1)
    assert isinstance(equation, ShootingEquation)
    unknowns, value = equation.unknowns(orbit), orbit.system.frequency
    begun = {each.contact: each.slip for each in reversed(orbit.slips)}
    assert begun[2] == -1
    assert equation.evaluate(unknowns, value).reach > 0.0
    unknowns[-1] += 1e-9
    nearly = equation.evaluate(unknowns, value)
    assert np.abs(nearly.residual).max() == pytest.approx(1e-9, rel=1e-3)
    assert nearly.reach == 0.0


@pytest.mark.slow
def test_the_error_of_a_change_includes_what_the_flow_leaves_out() -> None:
    """Springs in parallel with rigid friction slip with it, and not before: all of them change at one place.

    Within 3e-10 of it the slip is so brief that rounding would decide on it.
    """
    orbit = gw.find_orbit(random_system(145).at(frequency=0.5302))
    found = [each for each in gw.follow(orbit, "frequency", 0.5304).special_points if each.kind == "adding-sliding"]
    rigid, springs = found[-1], found[:-1]
    assert [each.contact for each in found] == ["jenkins0 -", "jenkins1 -", "coulomb2 -"]
    assert rigid.uncertainty < 1e-12
    assert all(1e-12 < abs(each.value - rigid.value) < each.uncertainty < 1e-8 for each in springs)


@pytest.mark.slow
@pytest.mark.parametrize("way", [1, in_campaign(-1)])
def test_stick_that_ends_in_slip_either_way_is_located_where_the_contact_that_presses_opens(way: int) -> None:
    """The bounds vanish there: the direction of slip changes where stick ends at the opening itself."""
    start, end = (0.4587, 0.45885)[::way]
    beside = [-0.022, -0.464, -0.336, 0.144, -0.167, 0.23]  # of three motions
    orbit = gw.find_orbit(random_system(10).at(frequency=start), 1, beside)
    (found,) = gw.follow(orbit, "frequency", end).special("switching-sliding")
    assert found.value == pytest.approx(0.45877588185856, abs=1e-12)
    assert found.uncertainty < 1e-10
    sticks = [phase.stop for phase in found.orbit.friction[3] if phase.mode == 0]
    openings = [event.theta for event in found.orbit.events if event.switch == 2 and not event.enters]
    assert abs(sticks[-1] - openings[-1]) < 1e-9
