"""Periodic orbits against closed forms, other integrators, other numbers of segments."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gapwalk.bifurcation import follow
from gapwalk.continuation import EndReason
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.model import Harmonic, System
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import force
from gapwalk.orbit import Newton, Shooting, find_orbit
from tests.independent import integrate as reference
from tests.systems import clutch, linear, random_systems, viscous_stop
from tests.tiers import keeps


def linear_response(system: System, order: int) -> np.ndarray:
    """Complex amplitude of the steady linear response at one order, by the dynamic stiffness."""
    w = order * system.frequency
    names = system.coordinates
    force = np.zeros(system.size, dtype=complex)
    for harmonic in system.structure.harmonics:
        if harmonic.order == order:
            shape = np.array([system[f"{harmonic.name}.acts_on.{q}"] for q in names])
            force += system[f"{harmonic.name}.amplitude"] * np.exp(1j * system[f"{harmonic.name}.phase"]) * shape
    dynamic = system.matrix("stiffness") - w**2 * system.matrix("mass") + 1j * w * system.matrix("damping")
    return np.linalg.solve(dynamic, force)


@pytest.mark.parametrize("frequency", [0.3, 0.8, 1.7])
def test_linear_orbit_is_the_closed_form(frequency):
    system = linear(frequency=frequency)
    orbit = find_orbit(system, start="rest")
    first, third = linear_response(system, 1), linear_response(system, 3)
    static = np.linalg.solve(system.matrix("stiffness"), [0.3, 0.0])
    assert orbit.state[:2] == pytest.approx(static + (first + third).real, abs=1e-11)
    assert orbit.state[2:] == pytest.approx((1j * frequency * (first + 3 * third)).real, abs=1e-11)
    for index, name in enumerate("ab"):
        assert orbit.measure(f"mean.{name}") == pytest.approx(static[index], abs=1e-12)
        assert orbit.measure(f"h1.{name}") == pytest.approx(abs(first[index]), abs=1e-12)
        assert orbit.measure(f"h3.{name}") == pytest.approx(abs(third[index]), abs=1e-12)
        square = static[index] ** 2 + (abs(first[index]) ** 2 + abs(third[index]) ** 2) / 2
        assert orbit.measure(f"rms.{name}") == pytest.approx(np.sqrt(square), abs=1e-12)


def test_linear_multipliers_are_the_closed_form():
    system = linear()
    inverse = np.linalg.inv(system.matrix("mass"))
    a = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-inverse @ system.matrix("stiffness"), -inverse @ system.matrix("damping")]]
    )
    expected = np.linalg.eigvals(expm(a * 2 * np.pi / system.frequency))
    found = find_orbit(system).multipliers
    assert sorted(found, key=lambda mu: (abs(mu), mu.imag)) == pytest.approx(
        sorted(expected, key=lambda mu: (abs(mu), mu.imag)), abs=1e-12
    )


@keeps("system3-0.7")
@pytest.mark.parametrize(
    ("system", "frequency"),
    [(clutch(), 0.5), (clutch(), 0.3), (clutch(**{"harmonic1.amplitude": 0.5}), 0.9), (viscous_stop(), 0.7)],
)
def test_orbits_close_under_an_independent_integrator(system, frequency):
    orbit = find_orbit(system, frequency=frequency)
    assert orbit.residual < 1e-10
    assert reference(orbit.system, orbit.state, max_step=0.003) == pytest.approx(orbit.state, abs=1e-7)


@pytest.mark.slow
def test_multipliers_of_an_impacting_orbit_by_differences_of_an_independent_integrator():
    orbit = find_orbit(clutch(), frequency=0.5)
    h = 1e-4
    columns = [
        (
            reference(orbit.system, orbit.state + h * e, max_step=0.03)
            - reference(orbit.system, orbit.state - h * e, max_step=0.03)
        )
        / (2 * h)
        for e in np.eye(4)
    ]
    expected = np.linalg.eigvals(np.array(columns).T)
    assert sorted(abs(orbit.multipliers)) == pytest.approx(sorted(abs(expected)), abs=1e-4)


@pytest.mark.parametrize("frequency", [0.5, 0.635, 0.7, 0.16])
def test_multipliers_do_not_depend_on_the_number_of_segments(frequency):
    single = find_orbit(clutch(), frequency=frequency)
    for segments in (3, 8):
        several = find_orbit(clutch(), frequency=frequency, start=single.state, method=Shooting(segments))
        assert several.state == pytest.approx(single.state, abs=1e-9)
        gaps = np.abs(several.multipliers[:, None] - single.multipliers[None, :])
        assert gaps.min(axis=1).max() < 1e-8
        assert gaps.min(axis=0).max() < 1e-8
        assert several.pattern == single.pattern


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(system=random_systems(laws=("elastic", "viscous", "hunt-crossley")), segments=st.integers(2, 5))
def test_random_systems_have_orbits_that_close(system, segments):
    try:
        orbit = find_orbit(system)
    except ConvergenceError:  # there is one, but Newton's method may not reach it from a chaotic transient
        reject()
    scale = 1 + np.abs(orbit.state).max()
    end = flow_of(system).integrate(coefficients_of(system), orbit.state, 0.0, PERIOD).state
    assert end == pytest.approx(orbit.state, abs=1e-9 * scale)
    several = find_orbit(system, start=orbit.state, method=Shooting(segments))
    assert several.state == pytest.approx(orbit.state, abs=1e-7 * scale)
    assert abs(several.multipliers) == pytest.approx(
        abs(orbit.multipliers), abs=1e-7 * (1 + abs(orbit.multipliers).max())
    )


def test_a_subharmonic_orbit_is_found_and_repeats_only_after_two_periods():
    orbit = find_orbit(clutch(), 2, frequency=0.72)
    assert orbit.stable
    half = flow_of(orbit.system).integrate(coefficients_of(orbit.system), orbit.state, 0.0, PERIOD).state
    assert np.abs(half - orbit.state).max() > 1e-2
    assert orbit.measure("h1/2.q1") > 1e-2
    with pytest.raises(ModelError, match="harmonics of 1/2 of W"):
        orbit.measure("h1/3.q1")


def test_extremes_are_exact():
    orbit = find_orbit(clutch(), frequency=0.5)
    fine = orbit.motion(20_000)
    for index, name in enumerate(orbit.system.coordinates):
        assert orbit.measure(f"max.{name}") == pytest.approx(fine.q[:, index].max(), abs=1e-7)
        assert orbit.measure(f"min.{name}") == pytest.approx(fine.q[:, index].min(), abs=1e-7)
        assert orbit.measure(f"max.{name}") >= fine.q[:, index].max() - 1e-12
        assert orbit.measure(f"half.{name}") == pytest.approx(
            (fine.q[:, index].max() - fine.q[:, index].min()) / 2, abs=1e-7
        )
        assert orbit.measure(f"mean.{name}") == pytest.approx(fine.q[:-1, index].mean(), abs=1e-10)
        assert orbit.measure(f"rms.{name}") == pytest.approx(np.sqrt((fine.q[:-1, index] ** 2).mean()), abs=1e-10)
    assert orbit.measure("max.stage2") == pytest.approx(fine.forces.max(), abs=1e-4)


def test_turning_points_of_a_combined_deflection():
    from gapwalk.model import Contact, Stage

    contact = Contact("c", {"q1": 1.0, "q3": -0.5}, (Stage(0.4, 3.0),))
    system = System(
        ("q1", "q3"), [[1.0, -0.2], [-0.2, 0.5]], np.eye(2) * 0.2, contacts=[contact],
        harmonics=[Harmonic(0.8, {"q1": 1.0})], frequency=0.4,
    )  # fmt: skip
    orbit = find_orbit(system)
    fine = orbit.motion(20_000)
    thetas, values = orbit.turns[0]
    assert max(values) == pytest.approx(fine.deflections.max(), abs=1e-7)
    assert min(values) == pytest.approx(fine.deflections.min(), abs=1e-7)
    slopes = np.diff(np.append(fine.deflections[:, 0], fine.deflections[1, 0]))
    assert len(thetas) == np.count_nonzero(np.diff(np.sign(slopes)))


def test_pattern_counts_impacts_by_side():
    assert find_orbit(clutch(), frequency=0.5).pattern == "1+/1-"
    assert find_orbit(clutch(), frequency=1.9).pattern == "closed+"
    assert (
        find_orbit(clutch(**{"mean.q1": 0.0, "mean.q3": 0.0, "harmonic1.amplitude": 0.01}), frequency=1.9).pattern
        == "open"
    )
    assert find_orbit(viscous_stop()).pattern == "1+"


def test_measures_are_refused_with_what_is_allowed():
    orbit = find_orbit(linear())
    with pytest.raises(ModelError, match=r"no measure 'peak\.a'; write one of max, min, half"):
        orbit.measure("peak.a")
    with pytest.raises(ModelError, match="no signal 'c'; signals are a, b"):
        orbit.measure("max.c")
    with pytest.raises(ModelError, match="is not an order"):
        orbit.measure("hx.a")


@pytest.mark.parametrize(("kwargs", "message"), [
    ({"period": 0}, "period is 0; it must be an integer from 1 to 10,000"),
    ({"period": 1.5}, "period is 1.5"),
    ({"start": "warm"}, 'write "rest", "settle", "linear" or a state of 4 numbers'),
    ({"start": [1.0, 2.0]}, "4 finite numbers"),
    ({"frequencies": 1.0}, "did you mean 'frequency'"),
    ({"frequency": -1.0}, "frequency is -1.0; it must be > 0"),
])  # fmt: skip
def test_bad_requests_are_refused(kwargs, message):
    with pytest.raises(ModelError, match=message):
        find_orbit(clutch(), **kwargs)


@pytest.mark.parametrize(
    "options", [{"segments": 0}, {"segments": 2.0}, {"segments": True}, {"tolerance": 0.0}, {"tolerance": 1.0}]
)
def test_bad_shooting_options_are_refused(options):
    with pytest.raises(ModelError, match="it must"):
        Shooting(**options)


def test_where_there_is_no_orbit_newton_says_so():
    # an undamped linear oscillator at its natural frequency has no periodic response
    system = System(("x",), [[1.0]], harmonics=[Harmonic(1.0, {"x": 1.0})], frequency=1.0)
    with pytest.raises(ConvergenceError, match="no period-1 orbit found"):
        find_orbit(system, start="rest", newton=Newton(iterations=5))


def test_work_of_finding_an_orbit_does_not_grow():
    start = find_orbit(clutch(), frequency=0.5).state + 1e-3
    Flow.calls = 0
    find_orbit(clutch(), frequency=0.5, start=start)
    assert Flow.calls <= 5


@pytest.mark.parametrize(
    ("frequency", "state", "largest"),
    [(0.5, (0.71314187, 1.25901763), 97195433.6), (0.45, (0.4375006, 1.3686577), 5699862622.4)],
)
def test_a_strongly_unstable_motion_is_found_from_a_state_near_it(frequency, state, largest):
    """x'' + .05 x' + x + .05 x^10 = .2 cos: an error of 1e-8 of the state grows to more than the motion in a period."""
    tenth = force("tenth", {"x": 1.0}, "a*x**10", a=0.05)
    loads = [Harmonic(0.2, {"x": 1.0})]
    system = System(["x"], [[1.0]], [[0.05]], contacts=[tenth], harmonics=loads, frequency=frequency)
    orbit = find_orbit(system, start=state)
    assert orbit.state == pytest.approx(state, abs=1e-7)
    assert abs(orbit.multipliers[0]) == pytest.approx(largest, rel=1e-6)

    def rates(time, x):
        return x[1], 0.2 * np.cos(frequency * time) - 0.05 * x[1] - x[0] - 0.05 * x[0] ** 10

    knots = np.linspace(0.0, 2.0 * np.pi / frequency, len(orbit.restarts) + 2)
    states = [orbit.state, *orbit.restarts, orbit.state]
    for span, start, end in zip(pairwise(knots), states[:-1], states[1:], strict=True):
        carried = solve_ivp(rates, span, start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        assert carried == pytest.approx(end, abs=1e-9)
    branch = follow(orbit, "frequency", frequency - 0.01)
    assert branch.ends[-1].reason is EndReason.RANGE


def test_a_period_in_64_segments_is_accurate_whatever_the_multiplier():
    assert find_orbit(linear(), method=Shooting(segments=64)).stable
