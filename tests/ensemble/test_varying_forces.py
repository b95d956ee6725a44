"""The batch integrator with displacements, numbers that vary, levels that jump, and forces by formula."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk import basins, regimes
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import force
from gapwalk.model.loads import Rectangle
from tests.tiers import keeps, some_of
from tests.toys.yielding import Yielding


def oscillator(*contacts, loads=(), stiffness=1.0, damping=0.1, frequency=0.8):
    loads = [Harmonic(0.6, {"x": 1.0}), *loads]
    return System(("x",), [[stiffness]], [[damping]], contacts=[*contacts], harmonics=loads, frequency=frequency)


def stop(law="elastic", **numbers):
    return Contact("stop", {"x": 1.0}, (Stage(0.4, 8.0, side=Side.POSITIVE),), None, law, **numbers)


def spring(stiffness=1.0):
    return Contact("spring", {"x": 1.0}, (Stage(0.0, stiffness),))


def formula(text, **numbers):
    return force("f", {"x": 1.0}, text, **numbers)


def coupled():
    deflections = {"r": {"x": 1.0}, "s": {"x": -0.5, "y": 1.0}}
    law = "k*r*s**2 + c*s'*r' + 0.3*tanh(3*r') + 0.2*sin(s) + 0.1*log(4 + r**2)/sqrt(1 + s**2) - exp(-s**2)*2**(r/2)"
    pull = force("f", deflections, law, acts_on={"x": 1.0, "y": 0.5}, k=1.0, c=0.1)
    loads = [
        Harmonic(0.6, {"x": 1.0}),
        Harmonic(0.2, varies="f.s", order=2, phase=0.3),
        Harmonic(0.3, varies="f.k", order=3),
    ]
    return System(
        ("x", "y"), [[2.0, -0.3], [-0.3, 2.5]], [[0.2, 0.0], [0.0, 0.2]],
        contacts=[pull, Contact("gap", {"y": 1.0}, (Stage(0.3, 2.0),))], harmonics=loads, frequency=0.8,
    )  # fmt: skip


SYSTEMS = {
    "displacement": oscillator(stop(), loads=[Harmonic(0.1, varies="stop.deflection", order=3, phase=0.4)]),
    "clearance": oscillator(
        stop("hunt-crossley", impact_damping=0.3), loads=[Harmonic(0.1, varies="stop.clearance", order=2)]
    ),
    "stiffness": oscillator(stop(), loads=[Harmonic(0.3, varies="stop.stiffness", order=5, phase=0.4)]),
    "levels": oscillator(spring(), loads=[Rectangle(0.4, "spring.stiffness", order=2, share=0.4, phase=0.7)]),
    "levels jump at 0": oscillator(spring(), loads=[Rectangle(0.4, "spring.stiffness", phase=-math.pi / 2)]),
    "van der Pol": oscillator(formula("-mu*(1 - x**2)*v", mu=0.5)),
    "kinks": oscillator(formula("c*v*abs(v) + k*max(x - 0.2, 0) + d*min(v, 0.2)", c=0.3, k=4.0, d=0.2)),
    "coupled": coupled(),
    "yielding": oscillator(
        Contact("stop", {"x": 1.0}, (Stage(0.4, 8.0),), None, Yielding(), fading=0.0),
        loads=[Harmonic(0.3, varies="stop.stiffness", order=3)],
    ),
}


def draw(system, count=64, size=0.8, seed=1):
    return np.random.default_rng(seed).normal(size=(count, 2 * system.size)) * size


def exact(system, states, periods=1):
    flow, coefficients = flow_of(system), coefficients_of(system)
    return np.array([flow.integrate(coefficients, state, 0.0, periods * PERIOD).state for state in states])


def rms(difference):
    return float(np.sqrt(np.mean(difference**2)))


def lanes_of(system, count):
    """Values that hardly differ from lane to lane: another kernel, of the same motions."""
    return {"frequency": system.frequency + 1e-13 * np.arange(count)}


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_error_falls_with_the_third_power_of_the_step_with_shared_and_with_own_numbers(name):
    system = SYSTEMS[name]
    states = draw(system)
    ends = exact(system, states)
    for parameters in (None, lanes_of(system, len(states))):
        coarse, fine = (
            rms(batch_flow_of(system, BatchOptions(steps=steps)).run(states, 1, parameters=parameters).states - ends)
            for steps in (100, 800)
        )
        assert fine < 1e-5
        assert coarse / fine > 100.0  # 64 for the second power, 512 for the third; the places of kinks scatter it


@pytest.mark.parametrize("name", some_of([*SYSTEMS], "displacement", "levels jump at 0", "coupled"))
def test_twenty_periods_agree_with_the_exact_flow(name):
    system = SYSTEMS[name]
    states = draw(system, 20, 0.3)
    run = batch_flow_of(system, BatchOptions(error=1e-7)).run(states, 20, every=1)
    assert run.error <= 1e-7
    for periods in (1, 3, 20):
        assert run.strobes is not None
        # motions near grazing amplify errors, so the typical one is compared
        assert np.median(np.abs(run.strobes[periods - 1] - exact(system, states, periods)).max(axis=1)) < 1e-5
    assert run.states == pytest.approx(run.strobes[-1])


def test_one_period_agrees_with_scipy_and_formulas_written_again():
    rectangle = Rectangle(0.4, {"stop.stiffness": 1.0}, order=2, share=0.3, phase=0.5)
    loads = [Harmonic(0.15, varies="stop.deflection", order=3, phase=0.4), rectangle]
    loads.append(Harmonic(0.5, varies="f.c", order=2))
    system = oscillator(stop(), formula("c*v*abs(v) + k*max(x - 0.1, 0)**1.5", c=0.3, k=1.0), loads=loads)

    def right_hand_side(theta, y):
        x, v = y
        bump = x + 0.15 * math.cos(3 * theta + 0.4)
        high = math.cos(2 * theta + 0.5) > math.cos(math.pi * 0.3)
        pull = 8.0 * (1.0 + (0.4 if high else -0.4 * 0.3 / 0.7)) * max(bump - 0.4, 0.0)
        pull += 0.3 * (1.0 + 0.5 * math.cos(2 * theta)) * v * abs(v) + max(x - 0.1, 0.0) ** 1.5
        return v / 0.8, (0.6 * math.cos(theta) - 0.1 * v - x - pull) / 0.8

    states = draw(system, 8)
    ends = [
        solve_ivp(right_hand_side, (0.0, PERIOD), state, method="DOP853", rtol=1e-10, atol=1e-10, max_step=0.01).y[
            :, -1
        ]
        for state in states
    ]
    run = batch_flow_of(system, BatchOptions(steps=3000)).run(states, 1)
    assert run.states == pytest.approx(np.array(ends), abs=1e-5)
    assert rms(run.states - ends) < 2e-6


def random_system(seed):
    """A system with a stop that is moved, a stiffness with levels, and a formula, on one or two coordinates."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 3))
    names = ("x", "y")[:n]
    basis = np.linalg.qr(random.normal(size=(n, n)))[0]

    def vector():
        return dict(zip(names, random.normal(size=n).tolist(), strict=True))

    texts = [
        "a*r**3 + b*r'*abs(r')",
        "a*sin(r) + b*r'*r**2",
        "a*max(r - 0.2, 0) - b*min(r + 0.3, 0)",
        "a*tanh(r + b*r')",
    ]
    contacts = [
        Contact("stop", vector(), (Stage(random.uniform(0.1, 0.5), 4.0),), None, "hunt-crossley", impact_damping=0.1),
        force("f", {"r": vector()}, texts[int(random.integers(4))], acts_on=vector() if n == 1 else None, a=0.8, b=0.3),
    ]
    loads = [
        Harmonic(random.uniform(0.2, 0.8), vector(), phase=random.uniform(-3, 3)),
        Harmonic(random.uniform(0.02, 0.2), varies="stop.deflection", order=int(random.integers(2, 5)), phase=1.0),
        Harmonic(random.uniform(0.1, 0.5), varies="f.a", order=5, phase=0.3),
        Rectangle(
            random.uniform(0.1, 0.6), "stop.stiffness", int(random.integers(1, 4)), random.uniform(0.2, 0.8), 2.0
        ),
    ]
    stiffness = basis @ np.diag(random.uniform(0.5, 2.0, n)) @ basis.T
    return System(
        names, stiffness, 0.15 * np.eye(n), contacts=contacts, harmonics=loads, frequency=random.uniform(0.5, 1.5)
    )


@keeps("2", "1")
@pytest.mark.parametrize("seed", some_of(range(40), *range(4)))
def test_random_systems_keep_the_error_that_was_asked_for(seed):
    system = random_system(seed)
    states = draw(system, 64, 0.7, seed)
    run = batch_flow_of(system, BatchOptions(error=1e-5)).run(states, 1)
    errors = np.abs(run.states - exact(system, states)).max(axis=1) / np.abs(states).max()
    assert np.quantile(errors, 0.9) < 3e-5


def test_each_lane_has_its_own_numbers():
    rectangle = Rectangle(0.4, {"stop.stiffness": 1.0}, order=2, share=0.3, phase=0.5)
    loads = [Harmonic(0.15, varies="stop.deflection", order=3, phase=0.4), rectangle]
    system = oscillator(stop(), formula("c*v*abs(v) + k*x**3", c=0.3, k=1.0), loads=loads)
    random = np.random.default_rng(2)
    parameters = {
        "frequency": random.uniform(0.5, 1.5, 70),
        "harmonic3.amplitude": random.choice([0.0, 0.1, 0.2], 70),
        "rectangle2.amplitude": random.uniform(-0.5, 0.5, 70),
        "rectangle2.phase": random.uniform(-3.0, 3.0, 70),
        "rectangle2.share": random.uniform(0.1, 0.9, 70),
        "f.c": random.uniform(0.1, 0.5, 70),
        "f.k": random.choice([0.0, 1.0], 70),
    }
    states = draw(system, 70)
    run = batch_flow_of(system, BatchOptions(steps=400)).run(states, 2, parameters=parameters)
    for lane in (0, 13, 64, 69):
        one = system.at({name: float(values[lane]) for name, values in parameters.items()})
        alone = batch_flow_of(one, BatchOptions(steps=400)).run(states[[lane]], 2).states[0]
        assert run.states[lane] == pytest.approx(alone, abs=1e-9)
        assert run.states[lane] == pytest.approx(exact(one, states[[lane]], 2)[0], abs=2e-4)


def test_a_survey_counts_contacts_with_a_moving_stop():
    system = oscillator(stop(), loads=[Harmonic(0.25, varies="stop.deflection", order=3, phase=0.4)])
    states = draw(system, 12)
    for parameters in (None, lanes_of(system, len(states))):
        found = batch_flow_of(system, BatchOptions(steps=400)).run(states, 3, survey=3, parameters=parameters).survey
        assert found is not None
        for lane, state in enumerate(states):
            motion = gw.integrate(system, state, 3, 2000)
            assert found.impacts[lane].sum() * 3 == sum(event.enters for event in motion.events)
            assert found.high[lane, 0] == pytest.approx(motion.q.max(), abs=1e-3)


def test_a_formula_that_overflows_ends_its_trajectory_alone():
    system = oscillator(formula("a*x*exp(x*x) + b*exp(3*abs(x))*v", a=0.2, b=0.01))
    states = np.array([[0.05, 0.0], [0.1, 0.0], [40.0, 0.0], [0.2, -0.1], [1e3, 1e3]])
    run = batch_flow_of(system, BatchOptions(steps=200)).run(states, 3)
    assert run.ran_away.tolist() == [False, False, True, False, True]
    assert np.isnan(run.states[[2, 4]]).all()
    assert run.states[[0, 1, 3]] == pytest.approx(exact(system, states[[0, 1, 3]], 3), abs=1e-4)
    few = batch_flow_of(system, BatchOptions(steps=200)).run(states[[0, 1, 3]], 3)
    assert few.states.tolist() == run.states[[0, 1, 3]].tolist()


def test_a_motion_that_leaves_the_range_of_a_formula_in_one_coordinate_is_marked():
    edge = force("f", {"x": 1.0}, "log(x + 2)")
    system = System(("x", "y"), np.eye(2), 0.2 * np.eye(2), contacts=[edge], harmonics=[Harmonic(0.3, {"y": 1.0})])
    run = batch_flow_of(system, BatchOptions(steps=100)).run(np.array([[0.1, 0.2, 0.0, 0.0], [-5.0, 0.2, 0.0, 0.0]]), 2)
    assert run.ran_away.tolist() == [False, True]


def in_process(check):
    return {"workers": 1, "check": check}


def test_basins_of_two_wells_by_a_formula_are_those_by_a_cubic_spring():
    plane = {"x": (-2.0, 2.0), "x'": (-2.0, 2.0)}
    loads = {"harmonics": [Harmonic(0.2, {"x": 1.0})], "frequency": 1.2}
    cubic = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    one = basins(System(("x",), [[-1.0]], [[0.25]], contacts=[cubic], **loads), plane, 16, **in_process(20))
    written = System(("x",), [[0.0]], [[0.25]], contacts=[formula("-a*x + b*x**3", a=1.0, b=1.0)], **loads)
    other = basins(written, plane, 16, **in_process(20))
    assert one.cells == other.cells
    assert len(one.cells) == 2


def test_a_parametric_oscillator_between_stops_reaches_its_motion_of_period_two():
    contacts = [spring(), Contact("stop", {"x": 1.0}, (Stage(1.0, 5.0),))]
    loads = [Harmonic(0.6, varies="spring.stiffness")]
    system = System(("x",), [[0.0]], [[0.2]], contacts=contacts, harmonics=loads, frequency=1.95)
    found = basins(system, {"x": (-3.0, 3.0), "x'": (-3.0, 3.0)}, 12, **in_process(10))
    assert found.cells == {"period 2": 144}


@pytest.mark.slow
def test_a_regime_map_of_a_formula_with_levels_agrees_with_the_exact_flow():
    loads = [Harmonic(0.3, {"x": 1.0}), Rectangle(0.3, "f.a", order=2, share=0.4)]
    well = formula("-a*x + b*x**3", a=1.0, b=1.0)
    system = System(("x",), [[0.0]], [[0.3]], contacts=[well], harmonics=loads, frequency=1.2)
    plane = {"frequency": (0.8, 1.6), "harmonic1.amplitude": (0.1, 0.45)}
    found = regimes(system, plane, (9, 7), workers=1, check=12)
    assert {"period 1", "period 2", "chaotic"} <= set(found.cells)
    assert len(found.check.different) <= 1
