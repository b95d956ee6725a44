"""The walk on branches whose shape is known: linear resonance, closed loops, ends with their reasons."""

import itertools
from collections import Counter

import numpy as np
import pytest

from gapwalk.bifurcation import BranchTracer, Kind, follow, start_branch
from gapwalk.continuation import EndReason, WalkOptions
from gapwalk.errors import ModelError
from gapwalk.flow.flow import Flow
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.orbit import Shooting, find_orbit
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation
from gapwalk.paper import case
from tests.orbit.test_orbit import linear_response
from tests.systems import clutch, linear
from tests.tiers import keeps


def test_every_point_of_a_linear_resonance_is_the_closed_form():
    branch = follow(find_orbit(linear(frequency=2.5)), "frequency", to=0.3)
    assert branch.special_points == ()
    assert branch.points[-1].value == 0.3
    for point in branch.points:
        first, third = linear_response(point.orbit.system, 1), linear_response(point.orbit.system, 3)
        static = np.linalg.solve(point.orbit.system.matrix("stiffness"), [0.3, 0.0])
        assert point.orbit.state[:2] == pytest.approx(static + (first + third).real, abs=1e-8)


def test_a_walk_in_amplitude_of_a_linear_system_is_a_straight_line():
    branch = follow(find_orbit(linear()), "harmonic1.amplitude", to=5.0)
    half = branch.measure("h1.a")
    assert half / branch.values == pytest.approx(np.full(len(half), half[0] / branch.values[0]), rel=1e-9)


def test_folds_are_walked_around_and_the_branch_is_connected():
    branch = follow(find_orbit(clutch(), frequency=1.9), "frequency", to=0.15)
    steps = np.diff(branch.values)
    turns = np.count_nonzero(np.diff(np.sign(steps)))
    assert turns == len(branch.special(Kind.FOLD)) == 6
    gaps = [np.linalg.norm(b.x - a.x) for a, b in itertools.pairwise(branch.points)]
    assert max(gaps) <= 1.05 * WalkOptions().largest_step
    assert [end.reason for end in branch.ends] == [EndReason.START, EndReason.RANGE]
    assert branch.points[-1].value == 0.15
    assert max(point.orbit.residual for point in branch.points) < 1e-7 * 10


def test_points_are_orbits_to_rounding_although_the_walk_does_not_look_twice():
    branch = follow(find_orbit(clutch(), frequency=1.9), "frequency", to=0.55)
    for point in branch.points[::7]:
        again = find_orbit(point.orbit.system, start=point.orbit.state)
        assert again.state == pytest.approx(point.orbit.state, abs=1e-8)
        assert abs(again.multipliers) == pytest.approx(abs(point.orbit.multipliers), abs=1e-5)


def test_a_closed_branch_is_recognised_from_wherever_it_is_entered():
    """Figure 27's smaller island in Te1, at two starts on it."""
    orbit = find_orbit(case("27"), at={"harmonic1.amplitude": 0.6})
    loops = [follow(orbit, "harmonic1.amplitude", to=(-1.0, 1.0))]
    loops.append(follow(loops[0].points[30].orbit, "harmonic1.amplitude", to=(-1.0, 1.0)))
    for loop in loops:
        assert loop.ends[-1].reason is EndReason.CLOSED
        assert loop.points[-1].orbit.state == pytest.approx(loop.points[0].orbit.state, abs=1e-8)
        assert len(loop.special(Kind.FOLD)) == 2
    values = [sorted(special.value for special in loop.special_points) for loop in loops]
    assert values[0] == pytest.approx(values[1], abs=1e-8)


def test_both_directions_from_a_start_give_the_branch_from_end_to_end():
    whole = follow(find_orbit(clutch(), frequency=1.9), "frequency", to=0.9)
    both = follow(find_orbit(clutch(), frequency=1.4), "frequency", to=(0.9, 1.9))
    assert (both.points[0].value, both.points[-1].value) == (0.9, 1.9)
    assert np.all(np.diff(both.values) > 0)
    assert [end.reason for end in both.ends] == [EndReason.RANGE, EndReason.RANGE]
    one = [(special.kind, special.value) for special in whole.special_points][::-1]
    other = [(special.kind, special.value) for special in both.special_points]
    assert [kind for kind, _ in one] == [kind for kind, _ in other]
    assert [value for _, value in one] == pytest.approx([value for _, value in other], abs=1e-9)
    before = [special.before for special in whole.special_points][::-1]
    assert before == [special.after for special in both.special_points]
    assert np.all(np.diff([point.arclength for point in both.points]) > 0)


@keeps("1")
@pytest.mark.parametrize("stop", [1, 2, 17, 60])
def test_a_stopped_walk_resumes_as_if_never_stopped(stop):
    orbit = find_orbit(clutch(), frequency=1.9)
    undisturbed = list(BranchTracer(start_branch(orbit, "frequency", 0.6, -1)))
    first = BranchTracer(start_branch(orbit, "frequency", 0.6, -1))
    begun = list(itertools.islice(first, stop))
    resumed = begun + list(BranchTracer(start_branch(orbit, "frequency", 0.6, -1), resume=first.state))
    assert len(resumed) == len(undisturbed)
    for (a, specials_a), (b, specials_b) in zip(resumed, undisturbed, strict=True):
        assert np.array_equal(a.x, b.x)
        assert [special.value for special in specials_a] == [special.value for special in specials_b]


def test_ends_have_their_reasons():
    orbit = find_orbit(clutch(), frequency=1.9)
    few = follow(orbit, "frequency", to=0.15, walk=WalkOptions(max_points=10))
    assert few.ends[-1].reason is EndReason.POINTS
    assert len(few.points) == 11
    coarse = WalkOptions(initial_step=0.1, smallest_step=0.1, largest_step=0.1, largest_turn=0.05)
    stuck = follow(orbit, "frequency", to=0.15, walk=coarse)
    assert stuck.ends[-1].reason is EndReason.STEP
    assert "smallest_step" in str(stuck.ends[-1])


def test_a_branch_that_turns_round_and_comes_back_says_so():
    # start between the folds of the main resonance on the upper part, heading up: it turns at the fold and returns
    down = follow(find_orbit(clutch(), frequency=1.9), "frequency", to=0.3)
    fold = next(special for special in down.special(Kind.FOLD) if special.value > 0.635)
    upper = next(p for p in down.points if p.arclength > fold.point.arclength and 0.5 < p.value < 0.63)
    back = follow(upper.orbit, "frequency", to=upper.value + 0.05)
    assert back.ends[-1].reason is EndReason.TURNED_BACK
    assert back.points[-1].value == pytest.approx(upper.value)
    assert back.points[-1].orbit.state != pytest.approx(upper.orbit.state, abs=1e-3)


def test_results_do_not_depend_on_units():
    """The same clutch in other units of length, time and force has the same special points."""
    length, time = 2.5e-3, 1 / 180.0
    acceleration = length / time**2
    contact = Contact("stage2", {"q1": 1.0}, (Stage(length, 1.0),), {"q1": 0.9 / time**2, "q3": -0.54 / time**2})
    system = System(
        ("q1", "q3"),
        np.array([[0.1, -0.6], [-0.06, 1.1]]) / time**2,
        np.array([[0.04, -0.04], [-0.04, 0.06]]) / time,
        contacts=[contact],
        mean={"q1": 0.25 * acceleration, "q3": 0.25 * acceleration},
        harmonics=[Harmonic(0.25 * acceleration, {"q1": 1.0})],
        frequency=1.9 / time,
    )
    plain = follow(find_orbit(clutch(**{"stage2.impact_damping": 0.0}), frequency=1.9), "frequency", to=0.65)
    scaled = follow(find_orbit(system), "frequency", to=0.65 / time)
    assert len(plain.special_points) >= 6
    assert [s.kind for s in scaled.special_points] == [s.kind for s in plain.special_points]
    assert [s.value * time for s in scaled.special_points] == pytest.approx(
        [s.value for s in plain.special_points], abs=1e-8
    )


def test_multiple_shooting_walks_the_same_branch():
    orbit = find_orbit(clutch(), frequency=1.9)
    single = follow(orbit, "frequency", to=0.6)
    several = follow(orbit, "frequency", to=0.6, method=Shooting(segments=3))
    assert [s.kind for s in several.special_points] == [s.kind for s in single.special_points]
    assert [s.value for s in several.special_points] == pytest.approx(
        [s.value for s in single.special_points], abs=1e-8
    )


@pytest.mark.parametrize(
    "name", ["stage2.clearance", "stage2.impact_damping", "mean.q3", "harmonic1.phase", "stiffness.q1.q3"]
)
def test_any_parameter_can_be_followed(name):
    orbit = find_orbit(clutch(), frequency=0.5)
    to = orbit.system[name] + 0.2
    branch = follow(orbit, name, to=to)
    assert branch.points[-1].value == to
    end = find_orbit(orbit.system.at({name: to}), start=branch.points[-1].orbit.state)
    assert end.state == pytest.approx(branch.points[-1].orbit.state, abs=1e-9)


def test_a_parameter_that_is_zero_at_the_start_can_be_followed():
    stop = Contact("stop", {"x": 1.0}, (Stage(0.3, 4.0, side=Side.POSITIVE),))
    system = System(("x",), [[1.0]], [[0.1]], contacts=[stop], harmonics=[Harmonic(0.5, {"x": 1.0})], frequency=0.7)
    for name in ("mean.x", "harmonic1.phase", "stop.cubic"):
        branch = follow(find_orbit(system), name, to=0.3)
        expected = find_orbit(system.at({name: 0.3}))
        assert branch.points[-1].orbit.state == pytest.approx(expected.state, abs=1e-8)


@pytest.mark.parametrize(
    ("parameter", "to", "message"),
    [
        ("frequenzy", 0.5, "did you mean 'frequency'"),
        ("frequency", 1.9, "the range is empty"),
        ("frequency", (0.1, 0.5), "starts at 1.9, outside the range from 0.1 to 0.5"),
        ("frequency", -1.0, "frequency is -1.0; it must be > 0"),
        ("stage2.clearance", -0.5, "stage2.clearance is -0.5; it must be >= 0"),
        ("frequency", float("nan"), "it must be a finite number|the range is empty"),
    ],
)
def test_bad_requests_are_refused(parameter, to, message):
    with pytest.raises(ModelError, match=message):
        follow(find_orbit(clutch(), frequency=1.9), parameter, to=to)


def test_work_of_the_main_job_does_not_grow():
    """Guards the speed of figure 13 by counting flow calls and points, not by a clock.

    Of the calls some 105 decide whether its flips are super- or subcritical, as the limit towards the flip.
    """
    orbit = find_orbit(clutch(), frequency=1.9)
    Flow.calls = 0
    branch = follow(orbit, "frequency", to=0.15)
    assert len(branch.points) < 340
    # each is computed a second time, for its error (6 calls); its rounding takes 6 calls, and at a graze 6 more
    grazes = sum(special.kind is Kind.GRAZING for special in branch.special_points)
    assert Flow.calls < 1400 + 12 * len(branch.special_points) + 6 * grazes


def test_work_of_harmonic_balance_does_not_grow(monkeypatch):
    """The same for figure 9b at H = 10, whose special points are all found with steps of 0.06.

    Some 330 of the evaluations and 120 of the orbits are for the limits of its eight flips.
    """
    counts, evaluate, orbit = Counter(), BalanceEquation.evaluate, BalanceEquation.orbit

    def counted_evaluate(*args):
        counts["evaluations"] += 1
        return evaluate(*args)

    def counted_orbit(*args):
        counts["orbits"] += 1
        return orbit(*args)

    start = find_orbit(case("9b"), frequency=2.0)
    monkeypatch.setattr(BalanceEquation, "evaluate", counted_evaluate)
    monkeypatch.setattr(BalanceEquation, "orbit", counted_orbit)
    options = WalkOptions(largest_step=0.06)
    branch = follow(start, "frequency", to=0.15, method=Balance(10, error=1.0), walk=options)
    assert Counter(special.kind for special in branch.special_points) == {Kind.FLIP: 8, Kind.GRAZING: 7, Kind.FOLD: 2}
    # each has its error; its rounding takes 6 evaluations and an orbit, and at a graze 6 and 3 more
    assert counts["evaluations"] < 1430 + 8 * len(branch.special_points) + 6 * 7
    assert counts["orbits"] < 580 + 2 * len(branch.special_points) + 3 * 7


def test_no_step_is_longer_than_the_largest():
    """In units of ten clearances for the motion, and of the range for the parameter."""
    options = WalkOptions(largest_step=0.005)
    branch = follow(find_orbit(clutch(), frequency=1.9), "frequency", to=0.9, walk=options)
    steps = np.diff(branch.values)
    assert np.abs(steps).max() <= 0.005 * 1.0 * (1 + 1e-6)
    assert len(branch.points) > 200
