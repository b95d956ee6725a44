"""A search in lanes of the batch integrator: the same orbits as one after the other, with a fraction of the work."""

from unittest.mock import patch

import numpy as np
import pytest

from gapwalk import friction, rigid_stop
from gapwalk.bifurcation.isolated import SearchOptions, search
from gapwalk.bifurcation.isolated.search_starts import (
    Catalogue,
    Chunk,
    exact_orbit,
    lanes_of,
    newton_aside,
    newton_in_lanes,
    search_chunk,
    spread_starts,
    state_box,
)
from gapwalk.ensemble.batch_flow import BlockPlan, Blocks
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.model import System
from gapwalk.model.coefficients import coefficients_of
from gapwalk.orbit import ShootingEquation
from gapwalk.paper import case
from tests.systems import linear, viscous_stop

SEARCH = "gapwalk.bifurcation.isolated.search._MANY"


def in_a_box(system: System, count: int = 24):
    box = state_box(system)
    return box, spread_starts([system], box, count, 0, system.frequency)


def both(values, **options):
    """A search in lanes and one without, each with its number of calls of the flow."""
    found = []
    for many in (0, 10**9):
        before = Flow.calls
        with patch(SEARCH, many):
            result = search(case("15"), "frequency", values, options=SearchOptions(**options))
        found.append((result, Flow.calls - before))
    return found


@pytest.mark.slow
def test_lanes_find_what_is_found_one_after_the_other_with_a_tenth_of_the_work():
    (lanes, few), (alone, many) = both([0.45, 0.62, 0.8], starts=24, newton_starts=24)
    for value in alone.values:
        catalogue = Catalogue(state_box(case("15").at(frequency=value)))
        for each in alone.at(value):
            catalogue.add(each.orbit)
        known = len(catalogue.entries)
        for each in lanes.at(value):
            catalogue.add(each.orbit)
        assert len(lanes.at(value)) >= known
        assert len(catalogue.entries) == len(lanes.at(value))
    assert [tally.starts for tally in lanes.tallies] == [24, 24, 24]
    assert sum(each.hits_settled for each in lanes.found) == sum(each.hits_settled for each in alone.found)
    assert few < 0.1 * many


def test_transients_that_die_away_slowly_settle_on_an_orbit_that_newton_s_method_finds():
    """Beside a Neimark-Sacker point, where no return is close before the patience ends."""
    with patch(SEARCH, 0):
        result = search(case("15"), "frequency", [0.8645833333333334])
    assert [len(tally.unsettled) for tally in result.tallies] == [0]


def test_a_few_starts_are_followed_one_after_the_other():
    """The batch integrator would take longer to compile."""
    with patch("gapwalk.bifurcation.isolated.search_starts.lanes_of", side_effect=AssertionError):
        search(linear(), "frequency", [0.8], options=SearchOptions(starts=24, newton_starts=0))


def test_derivatives_are_those_of_the_flow():
    system = case("15").at(frequency=0.6)
    box, states = in_a_box(system)
    lanes = lanes_of(system, states, box)
    assert lanes is not None
    periods = np.tile([1, 4, 8], 8)
    residuals, jacobians = lanes.evaluate(states, periods)
    for state, period, residual, jacobian in zip(states, periods.tolist(), residuals, jacobians, strict=True):
        arc = flow_of(system, transition=True).integrate(coefficients_of(system), state, 0.0, PERIOD * period)
        assert arc.transition is not None
        exact = arc.transition * box / box[:, None] - np.eye(4)
        assert residual == pytest.approx((arc.state - state) / box, abs=2e-3)
        assert jacobian == pytest.approx(exact, abs=0.05 * np.abs(exact).max())


def test_newton_s_method_leads_to_the_same_orbits():
    system = case("15").at(frequency=0.8)
    box, starts = in_a_box(system)
    lanes = lanes_of(system, starts, box)
    assert lanes is not None
    starts, periods = lanes.strobes(starts, 5)[-1], np.full(len(starts), 3)
    found = newton_in_lanes(lanes, starts, periods, lambda which, _: np.zeros(len(which), dtype=bool))
    ends = [newton_aside(ShootingEquation(system, None, 3), start, box) for start in starts]
    solved = np.isfinite(found).all(axis=1)
    assert solved.sum() >= 0.8 * sum(end is not None for end in ends) > 4
    for state in found[solved]:
        orbit = exact_orbit(system, 3, state)
        assert orbit is not None
        assert np.abs((orbit.state - state) / box).max() < 1e-2


def test_what_is_given_up_is_not_followed_further():
    system = case("15").at(frequency=0.8)
    box, starts = in_a_box(system)
    lanes, asked = lanes_of(system, starts, box), []

    def all_are_met(which, states):
        asked.append(len(which))
        return np.ones(len(which), dtype=bool)

    assert lanes is not None
    assert np.isnan(newton_in_lanes(lanes, starts, np.full(24, 3), all_are_met)).all()
    assert len(asked) == 1


def test_friction_stops_and_stiff_systems_are_left_to_the_exact_flow():
    hard = [friction("brake", {"x": 1.0}, 0.3, stiffness=5.0), rigid_stop("wall", {"x": 1.0}, 1.0, 0.6)]
    others = [System(["x"], [[1.0]], [[0.1]], contacts=[each], frequency=0.8) for each in hard]
    for system in (*others, viscous_stop().at({"stop.stiffness": 1e9})):
        assert lanes_of(system, np.zeros((2, system.state_size)), np.ones(system.state_size)) is None
    assert lanes_of(linear(), np.zeros((2, 4)), np.ones(4)) is not None


def test_a_motion_that_runs_away_is_one_for_the_exact_flow_too():
    system = linear(damping=-3.0)
    chunk = Chunk(0.8, 0, system, np.ones(4), 0.5 * np.eye(2, 4), (), SearchOptions(starts=2), many=True)
    assert search_chunk(chunk).ran_away == 2


def test_a_short_start_is_as_accurate_as_the_steps():
    """With the forces before the start extrapolated, where contacts are closed at the start."""
    system = case("15").at(frequency=0.6)
    _, states = in_a_box(system)
    flow, coefficients = flow_of(system), coefficients_of(system)
    exact = np.array([flow.integrate(coefficients, state, 0.0, PERIOD).state for state in states])
    errors = []
    for begins_often in (False, True):
        lanes = lanes_of(system, states, np.ones(4))
        assert lanes is not None
        plan = BlockPlan(lanes.plan.linear, lanes.plan.pattern, lanes.plan.steps, begins_often)
        blocks = Blocks(plan, states, 0, 0, False, 1)
        blocks.advance(1)
        errors.append(np.median(np.abs(blocks.states - exact).max(axis=1)))
    assert errors[1] < 2.0 * errors[0] + 1e-6
