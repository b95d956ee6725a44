"""Special points of sliding against closed forms, and against what changes on both sides of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import gapwalk as gw
from gapwalk.bifurcation.friction_along_branch import changes_between
from gapwalk.bifurcation.loci import LocusEndReason
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import flow_of
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import friction
from gapwalk.orbit.sticking import FrictionPhase, friction_phases, text_of
from gapwalk.verification.friction_dop853 import carry
from gapwalk.verification.verification import Check, Ledger
from gapwalk.verification.verify_orbits import verify_loci
from tests.dry.trials.random_systems import random_system
from tests.flow.dry_systems import clutch
from tests.sampled_verification import verified
from tests.tiers import in_campaign, some_of

K, C, SPRING, LIMIT, W = 1.0, 0.1, 0.5, 0.3, 0.8
LONG = gw.WalkOptions(largest_step=0.1)
"""Long steps, for walks of which only the special points count."""


def oscillator(*, amplitude=0.1, damping=C, mean=0.0, **options):
    pad = friction("pad", {"x": 1.0}, LIMIT, **options)
    loads = [gw.Harmonic(amplitude, {"x": 1.0})]
    matrices = {"damping": [[damping]], "mean": {"x": mean}}
    return gw.System(("x",), [[K]], **matrices, contacts=[pad], harmonics=loads, frequency=W)


@pytest.fixture(scope="module")
def walked():
    """Walk the branch of the clutch with friction over the frequencies of its points of sliding."""
    return gw.follow(gw.find_orbit(clutch(0.02), frequency=0.6), "frequency", 0.2)


def sliding(branch):
    return [each for each in branch.special_points if each.kind in SLIDING]


SLIDING = (Kind.CROSSING_SLIDING, Kind.SWITCHING_SLIDING, Kind.GRAZING_SLIDING, Kind.ADDING_SLIDING, Kind.SLIP_ONSET)


@pytest.mark.slow
def test_a_mass_at_rest_begins_to_slip_where_the_load_equals_the_limit():
    branch = gw.follow(gw.find_orbit(oscillator(damping=0.05)), "harmonic1.amplitude", 0.36, walk=LONG)
    found = sliding(branch)
    assert {each.kind for each in found} == {Kind.SLIP_ONSET}
    assert {each.contact for each in found} == {"pad +", "pad -"}
    for each in found:
        assert each.value == pytest.approx(LIMIT, abs=1e-10)
    assert not branch.unexplained
    assert branch.points[0].orbit.pattern == "pad sticks"
    assert branch.points[-1].orbit.pattern == "pad 2 sticks"


def test_a_jenkins_element_begins_to_slip_where_the_linear_motion_reaches_its_limit():
    branch = gw.follow(gw.find_orbit(oscillator(stiffness=SPRING)), "harmonic1.amplitude", 0.7, walk=LONG)
    exact = LIMIT / SPRING * abs(K + SPRING - W**2 + 1j * C * W)
    found = sliding(branch)
    assert [each.kind for each in found] == [Kind.SLIP_ONSET] * 2
    for each in found:
        assert each.value == pytest.approx(exact, abs=1e-10)
        assert each.uncertainty < 1e-9
    assert not [each for each in branch.special_points if each not in found]
    assert not branch.unexplained


def test_friction_off_its_middle_begins_to_slip_earlier_and_keeps_no_position_from_there():
    """Beyond the first touch, the extension of a Jenkins element moves so that its force just reaches its limit."""
    load = 0.1
    start = gw.find_orbit(oscillator(amplitude=0.4, mean=load, stiffness=SPRING))
    branch = gw.follow(start, "harmonic1.amplitude", 0.6, walk=LONG)
    state = branch.points[0].orbit.state
    slider = state[0] - state[2]
    size = abs(K + SPRING - W**2 + 1j * C * W)
    mean = (load + slider * SPRING) / (K + SPRING) - slider
    first = (LIMIT / SPRING - abs(mean)) * size
    assert abs(mean) > 0.01
    found = sliding(branch)
    assert found[0].kind is Kind.SLIP_ONSET
    assert found[0].value == pytest.approx(first, abs=1e-9)
    assert found[-1].value == pytest.approx(LIMIT / SPRING * size, abs=1e-9)
    assert len(found) == 2
    assert not branch.unexplained


@pytest.mark.slow
def test_a_branch_ends_where_rigid_friction_gives_way_to_one_side():
    system = oscillator(damping=0.05)
    branch = gw.follow(gw.find_orbit(system, start=np.array([0.1, 0.0])), "harmonic1.amplitude", 0.5)
    assert branch.ends[-1].reason is EndReason.GIVES_WAY
    assert branch.ends[-1].value == pytest.approx(LIMIT - 0.1 * K, abs=1e-9)
    assert [each.kind for each in branch.special_points] == [Kind.SLIP_ONSET]
    assert branch.points[-1].arclength == branch.special_points[0].point.arclength
    assert gw.verify(branch).breaches == ()  # the point where it ends is no neighbour of the special point there


def den_hartog(frequency):
    """Return the limit at which a mass without damping begins to stop, from the closed form of half a period.

    Between its stops the mass moves from x0 to -x0, with ``x = f + a cos t + b sin t + G cos(W t + phi)``. It stops
    where its acceleration after the turn vanishes.
    """
    gain, half = 1.0 / (1.0 - frequency**2), np.pi / frequency

    def equations(unknowns):
        a, b, phase, x0, limit = unknowns
        ends = []
        for t, x in ((0.0, x0), (half, -x0)):
            wave = frequency * t + phase
            ends += [
                limit + a * np.cos(t) + b * np.sin(t) + gain * np.cos(wave) - x,
                -a * np.sin(t) + b * np.cos(t) - gain * frequency * np.sin(wave),
            ]
        return [*ends, np.cos(phase) + limit - x0]

    found, *_, ok, _ = fsolve(equations, [0.5, 0.5, 0.5, 1.5, 0.8], xtol=1e-14, full_output=True)
    assert ok == 1 or np.abs(equations(found)).max() < 1e-12
    return found[-1]


def test_crossing_sliding_is_where_den_hartogs_oscillator_begins_to_stop():
    system = oscillator(amplitude=1.0, damping=0.0)
    branch = gw.follow(gw.find_orbit(system), "pad.limit", 0.9, walk=LONG)
    found = sliding(branch)
    assert [each.kind for each in found] == [Kind.CROSSING_SLIDING] * 2
    for each in found:
        assert each.value == pytest.approx(den_hartog(W), abs=1e-9)
    assert branch.points[0].orbit.pattern == "pad slips"
    assert branch.points[-1].orbit.pattern == "pad 2 sticks"


@pytest.mark.slow
def test_the_clutch_has_all_its_points_of_sliding(walked):
    found = sliding(walked)
    kinds = [each.kind.value.removesuffix("-sliding") for each in found]
    assert kinds == [
        *("grazing", "switching", "crossing"),
        *("grazing", "switching", "grazing", "switching"),
        *("adding", "adding", "grazing", "grazing"),
    ]
    assert found[0].value == pytest.approx(0.43253142, abs=1e-8)  # shared/elements.md, for every section
    assert not walked.unexplained


def test_on_both_sides_of_a_point_the_sequences_differ_by_its_phase(walked):
    equation_points = sliding(walked)
    for special in equation_points:
        start = special.orbit
        texts = []
        for way in (-1.0, 1.0):
            value = special.value + way * 1e-7
            orbit = gw.find_orbit(start.system.at(frequency=value), start=start.state)
            texts.append(text_of(orbit.friction[1]))
        assert len(texts[0]) != len(texts[1]), special


@pytest.mark.slow
def test_a_walk_with_shorter_steps_has_the_same_points_of_sliding(walked):
    values = [each.value for each in sliding(walked)]
    finer = gw.follow(walked.points[0].orbit, "frequency", 0.2, walk=gw.WalkOptions(largest_step=0.01))
    assert [each.value for each in sliding(finer)] == pytest.approx(values, abs=1e-9)


def test_changes_are_the_shortest_phases_that_one_orbit_lacks(walked):
    first, last = walked.points[0].orbit, walked.points[-1].orbit
    assert changes_between(first, first) == []
    assert changes_between(first, last) is not None
    special = sliding(walked)[0]
    assert special.contact.startswith("lining ")


def test_a_phase_without_length_is_none():
    """Where another contact changes, friction may stop and slip on at the same angle."""
    log = [SlipEvent(0.0, 0, 0), SlipEvent(1.0, 0, 1), SlipEvent(2.0, 0, 0), SlipEvent(2.0, 0, 1), SlipEvent(3.0, 0, 0)]
    assert friction_phases(log, 0, 4.0) == [FrictionPhase(1, 1.0, 3.0), FrictionPhase(0, 3.0, 5.0)]
    assert text_of(friction_phases([*log[:2], log[1]._replace(slip=0), log[-1]], 0, 4.0)) == "0"


def test_the_onset_of_a_jenkins_element_over_the_frequency_is_its_closed_form():
    branch = gw.follow(gw.find_orbit(oscillator(stiffness=SPRING)), "harmonic1.amplitude", 0.6, walk=LONG)
    locus = gw.follow_locus(sliding(branch)[0], "frequency", "harmonic1.amplitude", ((0.6, 1.4), (0.05, 1.0)))
    assert len(locus.points) > 20
    for point in locus.points:
        frequency, amplitude = point.values
        exact = LIMIT / SPRING * abs(K + SPRING - frequency**2 + 1j * C * frequency)
        assert amplitude == pytest.approx(exact, abs=1e-10)


def test_den_hartogs_boundary_is_a_locus_of_crossing_sliding():
    branch = gw.follow(gw.find_orbit(oscillator(amplitude=1.0, damping=0.0)), "pad.limit", 0.85, walk=LONG)
    locus = gw.follow_locus(sliding(branch)[0], "frequency", "pad.limit", ((0.7, 0.95), (0.5, 0.95)))
    assert len(locus.points) > 20
    for point in locus.points[::4]:
        assert point.values[1] == pytest.approx(den_hartog(point.values[0]), abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", some_of([Kind.GRAZING_SLIDING, Kind.SWITCHING_SLIDING, Kind.ADDING_SLIDING], Kind.SWITCHING_SLIDING)
)
def test_loci_of_the_clutch_agree_with_walks_at_other_limits(walked, kind):
    special = next(each for each in sliding(walked) if each.kind is kind)
    near = special.value - 0.01, special.value + 0.01
    locus = gw.follow_locus(special, "frequency", "lining.limit", (near, (0.0195, 0.0205)))
    for point in (locus.points[0], locus.points[-1]):
        frequency, limit = point.values
        assert abs(limit - 0.02) > 1e-4
        system = point.orbit.system.at(frequency=frequency + 2e-4)
        again = gw.follow(gw.find_orbit(system, start=point.orbit.state), "frequency", frequency - 2e-4, walk=LONG)
        values = [each.value for each in sliding(again) if each.kind is kind]
        assert values == pytest.approx([frequency], abs=1e-10)


@pytest.mark.parametrize("number", [3, 9])
def test_the_gradient_of_a_point_of_sliding_obeys_the_scaling_of_the_clutch(walked, number):
    """A larger motion, in the same ratio to loads, clearance and limit, has the same frequencies."""
    lengths = ("mean.q1", "mean.q3", "harmonic1.amplitude", "lining.limit", "stage2.clearance")
    special = sliding(walked)[number]
    slopes = special.gradient(*lengths, "stage2.impact_damping")
    moved = [special.orbit.system[name] * slopes[name] for name in slopes.names]
    assert max(map(abs, moved)) > 1e-3
    assert sum(moved[:-1]) - moved[-1] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.slow
def test_next_to_a_graze_of_a_jenkins_element_no_stick_is_endless():
    """Its stick is there so short that rounding hides its end."""
    branch = gw.follow(gw.find_orbit(clutch(0.02, stiffness=10.0), frequency=0.229), "frequency", 0.2275)
    found = sliding(branch)
    assert [each.value for each in found] == pytest.approx([0.2280282904231, 0.2276748939945], abs=1e-11)
    assert max(each.uncertainty for each in found) < 1e-8
    orbit, random = found[0].orbit, np.random.default_rng(0)
    flow, coefficients = flow_of(orbit.system), coefficients_of(orbit.system)
    for size in [1e-14] * 20 + [*10.0 ** random.uniform(-13.0, -9.0, 20)]:
        state = orbit.state + size * random.uniform(-1.0, 1.0, len(orbit.state))
        end = flow.integrate(coefficients, state).state
        assert end == pytest.approx(orbit.state, abs=1e-11 + 10.0 * size)
        assert carry([replace(orbit, state=state)])[0].closure < 1e-9 + 10.0 * size


BESIDE = [0.278, -0.847, -0.513, 1.044, 0.078, 0.454, 0.578, -0.249]
"""One of three motions, next to the change."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ends", "near", "walk", "sampled"),
    [
        ((1.1395, 1.1415), BESIDE, LONG, 4),
        in_campaign((1.0885090005248657, 1.4150617006823254), "settle", gw.WalkOptions(), 0),
    ],
)
def test_a_change_at_which_its_margin_jumps_is_located_to_its_bracket(ends, near, walk, sampled) -> None:
    """A spring closes where the slip rate reverses, and its damping changes the force at once."""
    system = random_system(9)
    branch = gw.follow(gw.find_orbit(system.at(frequency=ends[0]), start=near), "frequency", ends[1], walk=walk)
    (found,) = [each for each in branch.special("switching-sliding") if abs(each.value - 1.14) < 1e-2]
    assert found.uncertainty < 1e-9
    orbit = found.orbit  # both events are at one instant
    reversals = [each.theta for each in orbit.slips if system.structure.contacts[each.contact].name == "coulomb1"]
    closings = [each.theta for each in orbit.events]
    assert min(abs(a - b) for a in reversals for b in closings) < 1e-8
    assert verified(branch, sampled).breaches == ()  # which locates it with another integrator


def test_slip_that_ends_in_both_directions_at_once_ends_where_the_stroke_is_that_of_the_limit() -> None:
    """The position at which friction comes to rest must be that where its slip ends, not one within its freedom."""
    system = random_system(72).at(frequency=0.87)
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.85)
    found = branch.special("slip-onset")
    assert {each.contact for each in found} == {"jenkins2 +", "jenkins2 -"}
    first = max(found, key=lambda each: each.value)
    axes = np.array([system[f"jenkins2.deflection.{each}"] for each in system.coordinates])
    motion = first.orbit.motion(2001)
    stroke = np.ptp(sum(axis * motion.signal(name) for axis, name in zip(axes, system.coordinates, strict=True)))
    free = 2.0 * system["jenkins2.limit"] / system["jenkins2.stiffness"]
    assert stroke == pytest.approx(free, rel=1e-5)
    assert max(each.value for each in found) - min(each.value for each in found) < 1e-4


def test_rigid_friction_begins_and_ceases_to_slip_where_the_reaction_in_stick_has_the_limit() -> None:
    """A mass on a spring at one that friction holds: its spring and its damper pull with the limit on both sides."""
    limit, spring, damping = 0.3, 2.0, 0.1
    system = gw.System(
        ("x", "y"),
        [[1.0 + spring, -spring], [-spring, spring]],
        damping=[[damping, -damping], [-damping, damping]],
        contacts=[friction("pad", {"x": 1.0}, limit)],
        harmonics=[gw.Harmonic(0.1, {"y": 1.0})],
        frequency=1.25,
    )

    def pull(frequency: float) -> float:
        wave = spring + 1j * damping * frequency
        return abs(0.1 * wave / (wave - frequency**2)) - limit

    exact = brentq(pull, 1.0, 1.25, xtol=1e-12)
    there = gw.follow(gw.find_orbit(system), "frequency", 1.0, walk=LONG)
    back = gw.follow(there.points[-1].orbit, "frequency", 1.25, walk=LONG)
    assert there.points[-1].orbit.stuck == (0,)
    assert abs(there.points[-1].orbit.state[0]) < 1e-8  # where its forces in both directions are the same
    for branch in (there, back):
        found = sliding(branch)
        assert branch.ends[-1].reason is EndReason.RANGE
        assert sorted((each.kind, each.contact) for each in found) == [(Kind.SLIP_ONSET, f"pad {way}") for way in "+-"]
        for each in found:
            assert abs(each.value - exact) <= each.uncertainty < 1e-7  # positions that are kept are on a grid


@pytest.mark.slow
def test_on_the_way_back_slip_ends_where_it_began_in_the_second_direction() -> None:
    """It ends in both at once, and the position at which it does is kept from there on: nothing is found beyond."""
    load, size = 0.1, abs(K + SPRING - W**2 + 1j * C * W)
    there = gw.follow(
        gw.find_orbit(oscillator(amplitude=0.4, mean=load, stiffness=SPRING)), "harmonic1.amplitude", 0.6, walk=LONG
    )
    back = gw.follow(there.points[-1].orbit, "harmonic1.amplitude", 0.4, walk=LONG)
    found = sliding(back)
    assert [each.contact[-1] for each in sorted(found, key=lambda each: each.contact)] == ["+", "-"]
    for each in (*found, sliding(there)[-1]):
        assert abs(each.value - LIMIT / SPRING * size) <= each.uncertainty < 1e-7
    x, _, extension = back.points[-1].orbit.state
    assert x - extension == pytest.approx(load / K, abs=1e-8)  # where its mean force is zero
    assert not back.unexplained
    assert gw.verify(back).breaches == ()


@pytest.mark.slow
def test_friction_whose_normal_force_vanishes_may_slip_in_one_direction_only() -> None:
    """It is let go of where the contact that presses opens, so it need not slip back to end where it began."""
    system = random_system(38)
    assert system.structure.contacts[1].law.host == "normal0"
    start = gw.find_orbit(system.at(frequency=0.948))
    there = gw.follow(start, "frequency", 0.952, walk=LONG)
    back = gw.follow(there.points[-1].orbit, "frequency", 0.948, walk=LONG)
    assert [text_of(point.orbit.friction[1]) for point in (there.points[0], there.points[-1])] == ["-0+0", "+0"]
    assert 1 not in there.points[-1].orbit.stuck
    (one,), (other,) = sliding(there), sliding(back)
    assert one.kind is other.kind is Kind.ADDING_SLIDING
    assert one.contact == other.contact == "normal0dry -"
    assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty < 1e-8
    assert gw.verify(there).breaches == ()


@pytest.mark.parametrize("is_verified", [False, in_campaign(True)])
def test_two_directions_of_slip_that_change_at_one_corner_turn_the_branch_once(is_verified: bool) -> None:
    system = random_system(28).at(frequency=1.8075)  # symmetric
    orbit = gw.find_orbit(system, start=np.array([-0.29440640542486296, 0.20306479532267838, -0.01138456999848104]))
    branch = gw.follow(orbit, "frequency", 1.82)
    assert branch.ends[-1].reason is EndReason.TURNED_BACK
    found = branch.special("adding-sliding")
    assert [each.contact for each in found] == ["stages1dry -", "stages1dry +"]
    assert [(each.before.total, each.after.total) for each in found] == [(0, 0), (0, 1)]
    assert not is_verified or gw.verify(branch).breaches == ()


def loaded(damping: float, frequency: float, *others: gw.Harmonic) -> gw.System:
    """Return a mass with rigid friction and a harmonic load, as Den Hartog's."""
    loads, pad = [gw.Harmonic(1.0, {"x": 1.0}, phase=0.7), *others], friction("f", {"x": 1.0}, 0.3)
    return gw.System(["x"], [[1.0]], damping=[[damping]], contacts=[pad], harmonics=loads, frequency=frequency)


def locus_of(system: gw.System, kind: str, contact: str):
    branch = gw.follow(gw.find_orbit(system), "f.limit", (0.24, 0.36), walk=LONG)
    special = next(each for each in branch.special(kind) if each.contact == contact)
    return gw.follow_locus(special, *PLANE)


PLANE: tuple = ("frequency", "f.limit", ((0.46, 0.53), (0.2, 0.4)))


def degenerate_place(damping: float, third: float = 0.0, guess: tuple[float, float] = (0.49, 0.29)) -> np.ndarray:
    """Return frequency and limit at which the load turns, and friction is at its bound, where slip ends."""

    def load(angle):
        return np.cos(angle) - third * np.cos(3.0 * angle)

    # if the load grows from there, the mass sticks until it is as large again
    again = brentq(lambda angle: load(angle) - load(0.0), 0.3, np.pi) if third else 0.0

    def misses(p):
        def rates(t, y):
            return [y[1], load(p[0] * t) + p[1] - y[0] - damping * y[1]]

        start, times = [load(0.0) + p[1], 0.0], (again / p[0], np.pi / p[0])
        end = solve_ivp(rates, times, start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        return end[0] + start[0], end[1]  # the half period after it is the opposite

    return fsolve(misses, guess, xtol=1e-12)


def test_without_damping_the_degenerate_point_is_known():
    # slip lasts half a natural period, so that sin(pi W) W^2 / (1 - W^2) is the limit (Csernak and Licsko 2021), and
    # the friction is at its bound where the load turns
    (found,) = locus_of(loaded(0.0, 0.51), "crossing-sliding", "f -").codim2("degenerate-sliding")
    assert found.values == pytest.approx((0.5, 1.0 / 3.0), abs=4e-8)
    assert max(found.errors) < 4e-8


@pytest.mark.parametrize("contact", ["f +", "f -"])
@pytest.mark.parametrize(
    ("kind", "frequency", "other"),
    [
        ("crossing-sliding", 0.51, "switching-sliding"),
        ("switching-sliding", 0.47, "crossing-sliding"),
        ("grazing-sliding", 0.483, "meet there"),  # begins 0.03 radians after slip in the other direction ends
    ],
)
def test_loci_of_sliding_end_at_the_degenerate_point(kind, frequency, other, contact):
    locus = locus_of(loaded(0.05, frequency), kind, contact)
    (found,), place = locus.codim2("degenerate-sliding"), degenerate_place(0.05)
    assert (found.contact == contact) is (kind != "grazing-sliding")
    assert np.all(np.abs(found.values - place) <= np.array(found.errors) + 1e-11)
    assert max(found.errors) < 1e-9
    side = 1.0 if kind == "crossing-sliding" else -1.0
    assert np.all(side * (locus.values[:, 0] - place[0]) >= -1e-11)
    (end,) = (each for each in locus.ends if each.reason is not LocusEndReason.RANGE)
    assert end.reason is LocusEndReason.DEGENERATE
    assert end.values == found.values
    assert other in str(end)
    verify_loci(ledger := Ledger(), [("it", replace(locus, points=locus.points[1:4:2]))])
    assert not [each for each in ledger.verification.breaches if each.check is Check.CONDITION]


@pytest.mark.parametrize("kind", ["crossing-sliding", "adding-sliding", "switching-sliding"])
def test_adding_sliding_ends_at_the_degenerate_point_where_the_load_curves_up(kind):
    third = gw.Harmonic(0.3, {"x": 1.0}, order=3, phase=2.1 + np.pi)
    system = loaded(0.1, 0.5 if kind == "switching-sliding" else 0.48, third)
    branch = gw.follow(gw.find_orbit(system.at({"f.limit": 0.63})), "f.limit", 0.67, walk=LONG)
    special = next(each for each in branch.special(kind) if each.contact == "f -")
    locus = gw.follow_locus(special, "frequency", "f.limit", ((0.47, 0.51), (0.5, 0.8)))
    (found,), place = locus.codim2("degenerate-sliding"), degenerate_place(0.1, 0.3, (0.493, 0.65))
    assert np.all(np.abs(found.values - place) <= np.array(found.errors) + 1e-11)
    assert max(found.errors) < 1e-8


@pytest.mark.parametrize("kind", ["crossing-sliding", "switching-sliding"])
def test_both_loci_begin_at_the_degenerate_point(kind):
    (found,) = locus_of(loaded(0.05, 0.51), "crossing-sliding", "f +").codim2("degenerate-sliding")
    locus = gw.follow_locus(found, *PLANE, kind=kind)
    middle = locus.points[len(locus.points) // 2]
    value, width = middle.values[1], 2e-3
    begin = gw.find_orbit(middle.orbit.system.at({"f.limit": value - width}), start=middle.orbit.state)
    again = gw.follow(begin, "f.limit", value + width, walk=LONG)
    assert [each.value for each in again.special(kind)] == pytest.approx([value] * 2, abs=1e-9)
    with pytest.raises(gw.errors.ModelError, match="crossing-sliding"):
        gw.follow_locus(found, *PLANE, kind="fold")
