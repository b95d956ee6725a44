"""The compiled flow against closed forms, another integrator, and finite differences."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.coefficients import ParameterLine, coefficients_of
from tests.independent import integrate as reference
from tests.systems import OWN_LAWS, backlash_oscillator, clutch, linear, random_systems, viscous_stop
from tests.tiers import keeps, some_of

STATE = np.array([1.5, 0.3, -0.4, 0.2])
DAMPED = {"elastic": {}, "viscous": {"viscous_damping": 0.1}, "hunt-crossley": {"impact_damping": 0.2}}


def advance(system, state, stop=PERIOD):
    return flow_of(system).integrate(coefficients_of(system), np.asarray(state, dtype=float), 0.0, stop)


@pytest.mark.parametrize(("amplitude", "gap"), [(1.0, 0.5), (3.0, 0.5), (0.9, 0.0), (20.0, 1.7), (0.51, 0.5)])
def test_free_backlash_oscillator_repeats_after_its_closed_form_period(amplitude, gap):
    # half circles of unit frequency in contact, and two flights over the gap of 2b at the speed X - b
    period = 2 * math.pi + 4 * gap / (amplitude - gap)
    arc = advance(backlash_oscillator(2 * math.pi / period, gap), [amplitude, 0.0])
    assert arc.state == pytest.approx([amplitude, 0.0], abs=2e-12 * amplitude / (amplitude - gap))
    assert len(arc.contacts) == 4
    first = arc.contacts[0]
    assert not first.enters
    assert first.velocity == pytest.approx(-(amplitude - gap), rel=1e-12)
    assert first.theta == pytest.approx(0.5 * math.pi * 2 * math.pi / period, rel=1e-12)


def test_linear_motion_agrees_with_the_matrix_exponential():
    from scipy.linalg import expm

    system = linear()
    n, w = system.size, system.frequency
    inverse = np.linalg.inv(system.matrix("mass"))
    a = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-inverse @ system.matrix("stiffness"), -inverse @ system.matrix("damping")]]
    )
    arc = flow_of(system, transition=True).integrate(coefficients_of(system), STATE)
    assert arc.transition == pytest.approx(expm(a * 2 * math.pi / w), abs=1e-12)
    assert arc.contacts == []


@keeps("hunt-crossley")
@pytest.mark.parametrize("law", OWN_LAWS)
def test_state_agrees_with_an_independent_integrator(law):
    viscous = {"viscous_damping": 0.3}
    damping = {"elastic": {}, "piecewise": {}, "viscous": viscous, "pushing": viscous}.get(law, {"impact_damping": 0.2})
    contact = Contact("c", {"q1": 1.0, "q3": -0.3}, (Stage(0.4, 3.0),), None, law, **damping)
    system = System(("q1", "q3"), [[1.0, -0.2], [-0.2, 0.5]], np.eye(2) * 0.1, contacts=[contact], frequency=0.3)
    assert len(advance(system, STATE).contacts) >= 6
    assert advance(system, STATE).state == pytest.approx(reference(system, STATE, max_step=0.005), abs=2e-7)


@pytest.mark.slow
@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(system=random_systems(), seed=st.integers(0, 1000))
def test_random_systems_agree_with_an_independent_integrator(system, seed):
    state = np.random.default_rng(seed).normal(size=2 * system.size)
    # the printed law feeds energy in; a short time keeps such motions bounded
    stop = PERIOD / 4
    expected = reference(system, state, 0.25, max_step=0.004, rtol=1e-10)
    assert advance(system, state, stop).state == pytest.approx(expected, abs=2e-6 * (1 + np.abs(expected).max()))


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(system=random_systems(), seed=st.integers(0, 1000), data=st.data())
def test_sensitivities_agree_with_differences(system, seed, data):
    state = np.random.default_rng(seed).normal(size=2 * system.size)
    name = data.draw(st.sampled_from([n for n in system.structure.names if not n.startswith("mass") or "." in n]))
    line, h = ParameterLine(system, name), 1e-6
    flow = flow_of(system, name, transition=True)
    stop = PERIOD / 4

    def end(value, start):
        return flow.integrate(line.coefficients(value)[0], start, 0.0, stop).state

    coefficients, direction = line.coefficients(system[name])
    arc = flow.integrate(coefficients, state, 0.0, stop, direction)
    by_parameter = (end(system[name] + h, state) - end(system[name] - h, state)) / (2 * h)
    columns = [
        (end(system[name], state + h * e) - end(system[name], state - h * e)) / (2 * h) for e in np.eye(len(state))
    ]
    scale = 1 + np.abs(arc.transition).max() + np.abs(by_parameter).max()
    # two motions on either side of a grazing contact differ by more than the difference quotient resolves
    slow = [event for event in arc.contacts if abs(event.velocity) < 1e-3]
    tolerance = (1e-6 if not slow else 1e-2) * scale
    assert arc.sensitivity == pytest.approx(by_parameter, abs=tolerance)
    assert arc.transition == pytest.approx(np.array(columns).T, abs=tolerance)


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(system=random_systems(laws=("elastic", "hunt-crossley")), seed=st.integers(0, 1000))
def test_determinant_identity(system, seed):
    """det Phi = exp(-integral of trace(M^-1 (C + sum d (df/dv) e'))) (Liouville), by quadrature of a sampled motion."""
    state = np.random.default_rng(seed).normal(size=2 * system.size)
    arc = flow_of(system, transition=True).integrate(coefficients_of(system), state)
    trace = np.trace(np.linalg.solve(system.matrix("mass"), system.matrix("damping"))) * 2 * np.pi / system.frequency
    thetas = np.unique(np.concatenate((np.linspace(0, PERIOD, 4001), [event.theta for event in arc.contacts])))
    states = flow_of(system).sample(coefficients_of(system), state, thetas).states
    for form in system.structure.contacts:
        if form.law.name == "elastic":
            continue
        e = system.values[system.structure.block(f"{form.name}.deflection", system.size)]
        g = _spring_force(system, form, states[:, : system.size] @ e)
        integral = np.sum(np.diff(thetas) * (np.abs(g[1:]) + np.abs(g[:-1])) / 2) / system.frequency
        share = e @ np.linalg.solve(system.matrix("mass"), e)
        trace += share * system[f"{form.name}.impact_damping"] * integral
    assert math.log(abs(np.linalg.det(arc.transition))) == pytest.approx(-trace, abs=2e-5 * (1 + abs(trace)))


def _spring_force(system, form, x):
    g = np.zeros_like(x)
    for stage in form.stages:
        b, k, c = (system[f"{form.stage_prefix(stage)}.{name}"] for name in ("clearance", "stiffness", "cubic"))
        for side in stage.side.signs:
            depth = np.where(side * x > b, x - side * b, 0.0)
            g += k * depth + c * depth**3
    return g


def test_a_start_at_rest_on_a_breakpoint_is_decided_by_the_acceleration():
    # at rest exactly on the breakpoint, pushed in by the mean load: equilibrium lies inside the stage
    system = clutch(**{"harmonic1.amplitude": 0.0})
    state = np.array([1.0, 0.0, 0.0, 0.0])
    assert advance(system, state).state == pytest.approx(reference(system, state, max_step=0.01), abs=1e-8)
    pulled = clutch(**{"harmonic1.amplitude": 0.0, "mean.q1": -0.25})
    assert advance(pulled, state).state == pytest.approx(reference(pulled, state, max_step=0.01), abs=1e-8)


@pytest.mark.parametrize("phase", [math.pi / 2, -math.pi / 2, 0.0])
@pytest.mark.parametrize("clearance", some_of([0.0, 1e-20, 1e-16, 1e-13], 0.0, 1e-20))
@pytest.mark.parametrize("law", ["elastic", "hunt-crossley", "viscous"])
def test_a_mass_at_rest_leaves_a_gap_of_hardly_any_width(law, clearance, phase):
    # under a sine its acceleration is zero at the start, or 3e-17 to the wrong side by rounding
    contacts = [
        Contact("c", {"x": 1.0}, (Stage(clearance, 3.0, 0.5),), None, law, **DAMPED[law]),
        Contact("d", {"x": 1.0}, (Stage(clearance, 0.4, side=Side.POSITIVE),)),
    ]
    load = [Harmonic(0.5, {"x": 1.0}, phase=phase)]
    system = System(("x",), [[1.0]], [[0.1]], contacts=contacts, harmonics=load, frequency=1.3)
    start = [0.0, 0.0]
    assert advance(system, start).state == pytest.approx(reference(system, start, max_step=0.01), abs=1e-8)


@pytest.mark.parametrize("clearance", [0.0, 1e-16])
@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("masses", [2, 8])
def test_a_mass_that_is_pushed_through_others_leaves_its_breakpoint(masses, side, clearance):
    names = [f"q{i}" for i in range(masses)]
    stiffness = 3.0 * (2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
    contact = Contact("c", {names[-1]: 1.0}, (Stage(clearance, 5.0, side=side),))
    load = [Harmonic(0.5, {"q0": 1.0}, phase=math.pi / 2)]
    system = System(names, stiffness, 0.02 * stiffness, contacts=[contact], harmonics=load, frequency=0.7)
    start = np.zeros(2 * masses)
    assert advance(system, start).state == pytest.approx(reference(system, start, max_step=0.05), abs=1e-8)


@pytest.mark.parametrize("clearance", [0.0, 1e-18, 1e-12, 1e-6])
def test_a_large_motion_through_a_narrow_gap(clearance):
    # rounding of the motion exceeds the gap, whose two breakpoints are then passed at once
    def end(unit):
        contact = Contact("c", {"x": 1.0}, (Stage(clearance * unit, 5.0),))
        load = [Harmonic(0.5 * unit, {"x": 1.0}, phase=math.pi / 2)]
        system = System(("x",), [[2.0]], [[0.1]], contacts=[contact], harmonics=load)
        return advance(system, [0.0, 0.0], 4 * PERIOD).state / unit

    once = end(1.0)
    for unit in (1e-9, 1e6, 1e12):
        assert end(unit) == pytest.approx(once, abs=1e-12)


def test_staying_on_a_breakpoint_forever_ends():
    # no load at all: the mass rests on the edge of its gap, and nothing moves
    system = backlash_oscillator()
    assert advance(system, [0.5, 0.0]).state == pytest.approx([0.5, 0.0])


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0, -1e-15, -1e-12, -1e-6])
def test_near_tangent_contacts_keep_the_right_stage(depth):
    """A free flight under a constant pull that reaches the stop by `depth`: grazing, from clear contact to none."""
    stop = Contact("stop", {"x": 1.0}, (Stage(1.0, 50.0),))
    system = System(("x",), [[0.0]], contacts=[stop], mean={"x": -1.0}, frequency=1.0)
    speed = math.sqrt(2 * (1.0 + depth))  # thrown up from 0 against gravity 1, it would rise to 1 + depth
    arc = advance(system, [0.0, speed], 2.5)
    expected = [speed * 2.5 - 3.125, speed - 2.5]
    if depth > 0.0:  # it meets the stop at some speed, vibrates there for less than a turn, and leaves as it came
        touch, pace = math.sqrt(2 * depth), math.sqrt(50.0)
        left = 2.5 - (speed - touch) - 2 * math.atan(touch * pace) / pace
        expected = [1.0 - touch * left - left**2 / 2, -touch - left]
    assert arc.state == pytest.approx(expected, abs=1e-12)


def test_a_viscous_stop_has_the_right_sensitivities():
    """The force jumps at contact, so the sensitivities must jump as well (saltation)."""
    system = viscous_stop()
    state, h = np.array([0.2, 0.5]), 1e-6
    for name in ("frequency", "stop.clearance", "stop.viscous_damping", "stop.deflection.x", "harmonic1.phase"):
        line, flow = ParameterLine(system, name), flow_of(system, name, transition=True)
        coefficients, direction = line.coefficients(system[name])
        arc = flow.integrate(coefficients, state, 0.0, 2 * PERIOD, direction)
        ends = [flow.integrate(line.coefficients(system[name] + s)[0], state, 0.0, 2 * PERIOD).state for s in (h, -h)]
        assert arc.sensitivity == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-7)
        assert len(arc.contacts) >= 2


def test_a_motion_that_diverges_is_refused():
    contact = Contact("c", {"x": 1.0}, (Stage(0.1, 1.0),), None, "hunt-crossley-as-printed", impact_damping=3.0)
    system = System(("x",), [[0.0]], contacts=[contact], frequency=0.05)
    with pytest.raises(FlowError, match="diverges"):
        advance(system, [-3.0, -3.0], 20 * PERIOD)


def test_systems_of_equal_structure_share_one_flow():
    assert flow_of(clutch()) is flow_of(clutch(frequency=1.3, **{"stage2.clearance": 0.7}))
    assert flow_of(clutch()) is not flow_of(clutch(), transition=True)


def test_work_of_one_period_does_not_grow():
    """Guards the hot path by counting: Taylor steps and contact events of a known period."""
    system = clutch()
    state = np.array([3.13724, 2.13791, 0.0324672, 0.374044])
    arc = flow_of(system, "frequency", transition=True).integrate(coefficients_of(system), state, direction=None)
    assert arc.steps <= 28
    assert len(arc.contacts) == 4


@pytest.mark.parametrize("law", ["elastic", "hunt-crossley", "viscous"])
def test_a_gap_of_no_width_switches_both_sides_at_once(law):
    contact = Contact("c", {"x": 1.0}, (Stage(0.0, 2.0, 0.5),), None, law, **DAMPED[law])
    system = System(("x",), [[1.0]], [[0.1]], contacts=[contact], frequency=0.7)
    arc = advance(system, [0.5, 0.0])
    assert len(arc.contacts) >= 4
    assert arc.state == pytest.approx(reference(system, [0.5, 0.0]), abs=1e-8)


def test_two_equal_contacts_switch_at_the_same_time():
    pair = [Contact(name, {"x": sign}, (Stage(0.1, 5.0),)) for name, sign in (("c", 1.0), ("d", -1.0))]
    system = System(("x",), [[1.0]], [[0.1]], contacts=pair, frequency=0.7)
    alone = System(("x",), [[1.0]], [[0.1]], contacts=[Contact("c", {"x": 1.0}, (Stage(0.1, 10.0),))], frequency=0.7)
    assert advance(system, [0.5, 0.0]).state == pytest.approx(advance(alone, [0.5, 0.0]).state, abs=1e-11)


def test_a_stage_without_stiffness_and_a_cubic_one_at_the_origin():
    idle = Contact("c", {"x": 1.0}, (Stage(0.1, 0.0),))
    duffing = Contact("c", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    for contact in (idle, duffing):
        system = System(("x",), [[1.0]], [[0.1]], contacts=[contact], frequency=0.7)
        assert advance(system, [0.5, 0.3]).state == pytest.approx(reference(system, [0.5, 0.3]), abs=1e-9)
