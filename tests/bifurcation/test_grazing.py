"""Grazing: only a contact with a gap can touch, or one that is not the same on both sides."""

import numpy as np
import pytest

from gapwalk import verify
from gapwalk.bifurcation import Kind, follow
from gapwalk.bifurcation.kinds import grazing
from gapwalk.flow.flow import Flow
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.orbit import find_orbit
from gapwalk.orbit.harmonic_balance import Balance

AMPLITUDE = "harmonic1.amplitude"


def sprung(*stages: Stage, linear: float = 1.0, force: float = 0.05, frequency: float = 0.5) -> System:
    """A mass on a spring, and a contact of some stages."""
    contact = Contact("spring", {"x": 1.0}, stages)
    loads = [Harmonic(force, {"x": 1.0})]
    return System(["x"], [[linear]], [[0.05]], contacts=[contact], harmonics=loads, frequency=frequency)


CUBIC = Stage(clearance=0.0, stiffness=0.0, cubic=1.0)


@pytest.mark.parametrize("method", [None, Balance()])
def test_a_smooth_spring_has_no_grazing_points(method):
    """Extremes of the third harmonic pass through x = 0 at F = 1.21, where nothing happens to the motion."""
    branch = follow(find_orbit(sprung(CUBIC, force=0.8), method=method), AMPLITUDE, to=1.3, method=method)
    assert not branch.special_points
    assert {point.orbit.pattern for point in branch.points} == {"closed"}
    assert min(len(point.orbit.turns[0].thetas) for point in branch.points) == 2
    assert max(len(point.orbit.turns[0].thetas) for point in branch.points) > 2


def test_a_second_stage_grazes_all_the_same():
    outer = Stage(clearance=0.3, stiffness=2.0, name="stop")
    system = sprung(Stage(0.0, 0.0, 1.0, name="spring"), outer)
    grazes = follow(find_orbit(system), AMPLITUDE, to=0.6).special(Kind.GRAZING)
    assert {graze.contact for graze in grazes} == {"spring.stop +", "spring.stop -"}
    for graze in grazes:
        assert np.abs(graze.orbit.extremes[0, :2]).max() == pytest.approx(0.3, abs=1e-9)


def test_two_sides_of_different_stiffness_meet_where_a_motion_can_touch():
    """Bilinear: x = 0 is a corner of the force, so a motion that just reaches it is a special one."""
    sides = Stage(0.0, 3.0, side=Side.POSITIVE, name="a"), Stage(0.0, 1.0, side=Side.NEGATIVE, name="b")
    system = sprung(*sides, force=0.05).at({"mean.x": 0.5})
    branch = follow(find_orbit(system), AMPLITUDE, to=1.0)
    graze = branch.special(Kind.GRAZING)[0]
    # up to there the motion is linear: the spring of 1 + 3 under the mean load, and the response at W = 0.5
    linear = abs(1.0 / (4.0 - 0.25 + 0.025j))
    assert graze.value == pytest.approx(0.125 / linear, rel=1e-9)


@pytest.mark.slow
def test_a_gap_that_opens_grazes_nothing_as_it_opens():
    branch = follow(find_orbit(sprung(Stage(0.0, 2.0))), "spring.clearance", to=0.01)
    assert not branch.special(Kind.GRAZING)
    assert branch.points[0].orbit.pattern == "closed"
    assert branch.points[-1].orbit.pattern == "1+/1-"
    assert verify(branch).ok


def test_points_far_from_touching_need_no_survey_and_the_grazes_are_those_with_one(monkeypatch):
    surveyed, survey, stop = [], Flow.survey, Stage(0.3, 8.0, side=Side.POSITIVE)
    monkeypatch.setattr(Flow, "survey", lambda *given: surveyed.append(1) or survey(*given))

    def walked():
        surveyed.clear()
        branch = follow(find_orbit(sprung(stop, force=0.3, frequency=1.6)), "frequency", to=0.45)
        return branch, len(surveyed)

    branch, few = walked()
    monkeypatch.setattr(grazing, "_is_clear", lambda *_: False)
    again, many = walked()
    assert few < 0.5 * len(branch.points) < many
    assert len(branch.special(Kind.GRAZING)) >= 2
    assert [(each.kind, each.value, each.contact) for each in branch.special_points] == [
        (each.kind, each.value, each.contact) for each in again.special_points
    ]
    assert np.array_equal(branch.values, again.values)
