"""Walks with several friction elements on one deflection do not depend on the step."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.special_point import Kind
from gapwalk.bifurcation.steps_over_corners import coincidence
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from tests.bifurcation.alike.kinds import friction
from tests.dry.several_elements import several_elements
from tests.tiers import in_campaign

ELEMENTS = {"a": (0.2248, 4.706), "b": (0.2816, 2.589), "c": (0.2948, 2.195)}


@pytest.fixture(scope="module")
def first():
    """Return a motion of an Iwan model in which two of three elements never slip."""
    iwan = gw.System(
        ["x"],
        [[0.9]],
        [[0.05]],
        mean={"x": 0.0559},
        frequency=0.7682,
        contacts=[
            gw.friction(name, {"x": 1.0}, limit, stiffness=stiffness) for name, (limit, stiffness) in ELEMENTS.items()
        ],
        harmonics=[gw.Harmonic(0.4308, {"x": 1.0}), gw.Harmonic(0.2991, {"x": 1.0}, 2, 0.4989)],
    )
    return gw.find_orbit(iwan)


@pytest.mark.parametrize("step", [in_campaign(None), 0.05])
def test_elements_that_never_slip_are_pushed_along_together_whatever_the_steps(first, step):
    """Right: where an element slips both ways, its force is at both bounds; until then another one keeps its place."""
    walk = gw.WalkOptions() if step is None else gw.WalkOptions(largest_step=step)
    branch = gw.follow(first, "frequency", 1.1, walk=walk)
    assert branch.ends[-1].reason is EndReason.RANGE
    onsets = [each for each in branch.special_points if each.kind is Kind.SLIP_ONSET]
    assert [each.contact for each in onsets] == ["b +", "c +", "b -", "c -", "c +"]
    values = [0.83039244661, 0.83039244661, 0.93780780486, 1.022775905, 1.08314696408]
    for each, value in zip(onsets, values, strict=True):
        assert abs(each.value - value) < 2e-9
        assert each.uncertainty < 1e-8
    reach = {name: limit / stiffness for name, (limit, stiffness) in ELEMENTS.items()}
    largest, least = ([each.orbit.measure(f"{word}.x") for each in onsets] for word in ("max", "min"))
    assert largest[2] - least[2] == pytest.approx(2.0 * reach["b"], abs=1e-8)
    assert largest[4] - least[4] == pytest.approx(2.0 * reach["c"], abs=1e-8)
    assert least[3] == pytest.approx(largest[2] - 2.0 * reach["c"], abs=1e-7)  # c has kept its place since b slips


@pytest.mark.slow
def test_positions_are_those_of_a_slow_sweep(first):
    """The limit of a frequency that changes ever more slowly; steps of .001 overshoot by about that."""
    branch, state, sliders = gw.follow(first, "frequency", 1.01), first.state.copy(), {}
    for frequency in np.arange(0.769, 1.0, 0.001):
        system = first.system.at(frequency=float(frequency))
        state = flow_of(system).integrate(coefficients_of(system), state, 0.0, 10 * PERIOD).state
        sliders[round(float(frequency), 3)] = state[0] - state[3:]
    for frequency in (0.9, 0.95, 0.999):
        near = min(branch.points, key=lambda point: abs(point.value - frequency)).orbit
        assert near.state[0] - near.state[3:] == pytest.approx(sliders[frequency], abs=3e-3)
    assert sliders[0.999][1] > 0.15 + first.state[0] - first.state[4]  # c has been pushed far


@pytest.mark.slow
@pytest.mark.parametrize("angle", [in_campaign(0.0), 1.0, in_campaign(4.0)])
def test_beyond_the_end_of_slip_an_element_is_pushed_along(angle):
    """Right: it ends where the motion is as wide as both bounds; then the force stays at the upper one, as in a sweep.

    Walks began beyond it anywhere between the bounds, and got stuck or listed another point, by the phase of the loads.
    """
    machine = friction(21).begun_at(angle)
    first = gw.find_orbit(machine.system.at(frequency=1.37))  # all elements slip, so that it has no memory
    assert coincidence(first) == ""  # that they stick together where the mass turns round
    branch = gw.follow(first, "frequency", 1.42)
    assert branch.ends[-1].reason is EndReason.RANGE
    ends = branch.special_points
    assert [(each.kind, each.contact) for each in ends] == [(Kind.SLIP_ONSET, "c +"), (Kind.SLIP_ONSET, "c -")]
    reach = {each.name: each.numbers["limit"] / each.numbers["stiffness"] for each in machine.contacts}["c"]
    for each in ends:
        assert each.uncertainty < 2e-9
        assert abs(each.value - 1.386159825) < 2e-9
        assert each.orbit.measure("half.x") == pytest.approx(reach, abs=1e-9)
    last, state = branch.points[-1].orbit, first.state
    assert last.measure("max.x") - (last.state[0] - last.state[-1]) == pytest.approx(reach, abs=1e-8)
    for frequency in np.arange(1.37, 1.4201, 0.001):
        system = first.system.at(frequency=float(frequency))
        state = flow_of(system).integrate(coefficients_of(system), state, 0.0, 20 * PERIOD).state
    assert last.state == pytest.approx(state, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("ends", [(1.544, 1.5455), in_campaign((1.5, 1.546))])
def test_elements_that_turn_back_at_a_corner_keep_the_positions_that_they_have_there(ends):
    """An onset of slip beyond it was off by a hundred times its stated error, by another step over the corner."""
    machine, found = friction(100), []
    for each in (machine, machine.begun_at(4.0)):
        start = gw.find_orbit(each.system.at(frequency=ends[0]))
        found.append(
            [point for point in gw.follow(start, "frequency", ends[1]).special_points if point.contact == "b -"]
        )
    ((ours,), (theirs,)) = found
    assert abs(ours.value - theirs.value) <= ours.uncertainty + theirs.uncertainty < 1e-9


@pytest.mark.slow
def test_a_walk_down_goes_on_from_the_onset_at_which_slip_ends_on_the_way_up():
    """The branch has so sharp a corner there that it was lost, and the walk crept on by 1e-9 for ever."""
    system, values = several_elements(np.random.default_rng(200)), []
    for start, end in ((1.56, 1.6), (1.6, 1.56)):
        first = gw.find_orbit(system.at(frequency=start))
        branch = gw.follow(first, "frequency", end, walk=gw.WalkOptions(max_points=200))
        assert branch.ends[-1].reason is EndReason.RANGE
        values.append([each for each in branch.special_points if each.contact == "a +"][-1])
    up, down = values
    assert abs(up.value - down.value) <= up.uncertainty + down.uncertainty < 1e-9


@pytest.mark.slow
def test_where_friction_creeps_the_first_orbit_is_beyond_the_edge_of_the_continuum():
    """Right: the largest force that sticking needs is a little less than its bound, and nothing moves.

    Newton's method left slip of 1e-13 in a period. Whether that is slip rounding decided: walks begun at other phases
    of the loads went along the continuum, and listed an onset that is none.
    """
    machine = friction(19)
    bound = {each.name: each.numbers["limit"] for each in machine.contacts if "limit" in each.numbers}["c"]
    springs = sum(each.numbers.get("stiffness", 0.0) for each in machine.contacts) + machine.stiffness[0, 0]
    theta = np.linspace(0.0, PERIOD, 100_001)
    load = machine.mean["x"] + sum(
        each.amplitude * np.cos(each.order * theta + each.phase) for each in machine.harmonics
    )
    first = gw.find_orbit(machine.system)
    assert first.stuck == (0, 1, 2)
    spare = bound - (load - springs * first.state[0]).max()
    assert 1e-9 < spare < 1e-6
    for angle in (0.0, 4.0):
        first = gw.find_orbit(machine.begun_at(angle).system, start=first.state)
        branch = gw.follow(first, "frequency", 1.0)
        assert branch.special_points == ()
        assert branch.ends[-1].reason is EndReason.RANGE
        assert np.ptp([point.orbit.state[0] for point in branch.points]) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 109))
def test_walks_of_random_elements_do_not_depend_on_steps_or_signs(seed):
    system = several_elements(np.random.default_rng(seed))
    loads = [name for name in system.parameters if name.startswith("mean.") or name.endswith(".amplitude")]
    mirrored = system.at({name: -system[name] for name in loads})
    walks = [(system, gw.WalkOptions()), (system, gw.WalkOptions(largest_step=0.02)), (mirrored, gw.WalkOptions())]
    branches = [
        gw.follow(gw.find_orbit(each), "frequency", 1.3 * system["frequency"], walk=walk) for each, walk in walks
    ]
    points = [sorted((each.value, str(each.kind), each.uncertainty) for each in one.special_points) for one in branches]
    for branch, own in zip(branches, points, strict=True):
        assert branch.ends[-1].reason is branches[0].ends[-1].reason is not EndReason.STEP
        assert branch.ends[-1].value == pytest.approx(branches[0].ends[-1].value, abs=1e-8)
        assert len(own) == len(points[0])
        for (value, _, error), (expected, _, other) in zip(own, points[0], strict=True):
            assert abs(value - expected) <= error + other
