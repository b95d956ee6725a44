"""Where Taylor series of the flow begin again, and what they leave: against SciPy and closed forms."""

import math

import heyoka as hy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gapwalk as gw
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of


def softened(text, **numbers):
    """An oscillator with a force by formula."""
    force = gw.force("f", {"x": 1.0}, text, **numbers)
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=[force], harmonics=[gw.Harmonic(0.7, {"x": 1.0})])


# tanh and exp that are constant to rounding over most of a motion, but not all of it
HIDDEN = {
    "friction as a tanh": ("m*tanh(v/w)", {"m": 0.1, "w": 1e-3}, lambda x, v: 0.1 * np.tanh(v / 1e-3)),
    "Stribeck": (
        "m*(1 + a*exp(-(v/s)**2))*tanh(v/w)",
        {"m": 0.1, "a": 0.5, "s": 0.05, "w": 0.01},
        lambda x, v: 0.1 * (1.0 + 0.5 * np.exp(-((v / 0.05) ** 2))) * np.tanh(v / 0.01),
    ),
    "soft stop": ("k*exp(a*(x - 1))", {"k": 1.0, "a": 50.0}, lambda x, v: np.exp(50.0 * (x - 1.0))),
    "stiff soft stop": ("k*exp(a*(x - 1))", {"k": 1e3, "a": 200.0}, lambda x, v: 1e3 * np.exp(200.0 * (x - 1.0))),
    "a rounded stop": (
        "k*log(1 + exp(a*(x - 1)))",
        {"k": 1.0, "a": 50.0},
        lambda x, v: np.logaddexp(0.0, 50 * (x - 1)),
    ),
    "a step of the position": (
        "m*tanh(a*(x - 0.5))",
        {"m": 0.1, "a": 80.0},
        lambda x, v: 0.1 * np.tanh(80 * (x - 0.5)),
    ),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_no_step_leads_beyond_a_function_that_is_constant_to_rounding_before(name):
    text, numbers, force = HIDDEN[name]
    random = np.random.default_rng(1)
    for frequency in (0.2, 0.6, 1.4):
        system = softened(text, **numbers).at(frequency=frequency)
        state = np.array([-abs(random.normal()), random.normal()])

        def rates(t, y, frequency=frequency):
            return [y[1], 0.7 * math.cos(frequency * t) - 0.1 * y[1] - y[0] - force(*y)]

        # short steps: a method of Runge and Kutta steps over it too
        span, options = (0.0, PERIOD / frequency), {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        wanted = solve_ivp(rates, span, state, max_step=0.01, **options).y[:, -1]
        arc = flow_of(system, transition=True).integrate(coefficients_of(system), state, 0.0, PERIOD)
        assert arc.state == pytest.approx(wanted, abs=1e-10)


@pytest.mark.parametrize("amplitude", [2.0, 100.0, 1000.0])
def test_an_argument_that_only_a_load_varies_is_watched_too(amplitude):
    force = gw.force("f", {"x": 1.0}, "m*tanh(u) + 0*x", m=0.1, u=1.0)
    loads = [gw.Harmonic(0.7, {"x": 1.0}), gw.Harmonic(amplitude, varies="f.u", order=2)]
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[force], harmonics=loads, frequency=0.6)

    def rates(t, y):
        angle = 0.6 * t
        push = 0.7 * math.cos(angle) - 0.1 * math.tanh(1.0 + amplitude * math.cos(2.0 * angle))
        return [y[1], push - 0.1 * y[1] - y[0]]

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.002}
    wanted = solve_ivp(rates, (0.0, PERIOD / 0.6), [0.3, -0.2], **options).y[:, -1]
    found = flow_of(system).integrate(coefficients_of(system), np.array([0.3, -0.2]), 0.0, PERIOD).state
    assert found == pytest.approx(wanted, abs=1e-9)


def test_the_derivatives_pass_such_functions_too():
    text, numbers, _ = HIDDEN["Stribeck"]
    system, state, step = softened(text, **numbers).at(frequency=0.3), np.array([-0.9, 1.3]), 1e-6
    flow, coefficients = flow_of(system, transition=True), coefficients_of(system)

    def end(state):
        return flow_of(system).integrate(coefficients, state, 0.0, PERIOD).state

    wanted = np.array([(end(state + step * e) - end(state - step * e)) / (2.0 * step) for e in np.eye(2)]).T
    found = flow.integrate(coefficients, state, 0.0, PERIOD).transition
    assert found == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())


def test_a_law_of_ones_own_is_watched_like_a_formula():
    class Saturating(gw.laws.Law):
        name, words = "saturating", "a force that saturates"
        stage_parameters = (gw.laws.CLEARANCE, gw.laws.STIFFNESS)

        def force(self, rate, stages, numbers):
            tanh = stages.functions["tanh"]
            return stages.total(s.closed * s["stiffness"] * s.sign * tanh(1e3 * s.sign * s.depth) for s in stages)

    contact = gw.Contact("stop", {"x": 1.0}, [gw.Stage(0.5, 0.3)], law=Saturating())
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[contact], harmonics=[gw.Harmonic(0.7, {"x": 1.0})])
    equations = flow_of(system).equations
    assert len(equations.restarts) == 2  # one on each side


def test_series_leave_no_more_than_rounding():
    """A linear oscillator with a load of the fifth order against the exponential of its matrix."""
    random, worst = np.random.default_rng(4), 0.0
    for frequency in random.uniform(0.1, 2.0, 12):
        load = gw.Harmonic(0.3, {"x": 1.0}, order=5)
        system = gw.System(["x", "y"], [[2.0, -1.0], [-1.0, 1.5]], [[0.1, 0.0], [0.0, 0.05]], harmonics=[load])
        system, state = system.at(frequency=frequency), random.normal(size=4)
        # of positions, velocities over time, and the cosine and sine of the load, over the angle
        matrix = np.zeros((6, 6))
        matrix[:2, 2:4], matrix[2, 4] = np.eye(2) / frequency, 0.3 / frequency
        matrix[2:4, :2] = -np.array([[2.0, -1.0], [-1.0, 1.5]]) / frequency
        matrix[2:4, 2:4] = -np.diag([0.1, 0.05]) / frequency
        matrix[4, 5], matrix[5, 4] = -5.0, 5.0
        wanted = np.append(state, [1.0, 0.0])
        for _ in range(64):
            wanted = expm(matrix * PERIOD / 64) @ wanted
        flow = flow_of(system)
        found = flow.integrate(coefficients_of(system), state, 0.0, PERIOD).state
        worst = max(worst, float(np.abs(found - wanted[:4]).max() / np.abs(state).max()))
    assert worst < 1e-14  # 64 exponentials have rounding too


def test_series_leave_no_more_than_rounding_with_impact_damping():
    """A motion that stays in contact, against one in 80-bit numbers."""
    worst, random = 0.0, np.random.default_rng(2)
    for frequency, damping in zip(random.uniform(0.3, 1.5, 8), random.uniform(0.05, 0.5, 8), strict=True):
        stage = gw.Contact("s", {"x": 1.0}, [gw.Stage(0.1, 9.0)], law="hunt-crossley", impact_damping=float(damping))
        load = gw.Harmonic(0.5, {"x": 1.0})
        system = gw.System(["x"], [[1.0]], [[0.1]], mean={"x": 8.0}, contacts=[stage], harmonics=[load])
        state = np.array([0.9 + 0.2 * random.random(), 0.3 * random.normal()])
        flow = flow_of(system.at(frequency=frequency))
        found = flow.integrate(coefficients_of(system.at(frequency=frequency)), state, 0.0, PERIOD)
        assert not found.contacts

        x, v = hy.make_vars("x", "v")
        force = 9.0 * (x - np.longdouble(0.1)) * (1.0 + np.longdouble(damping) * v)
        push = 8.0 + 0.5 * hy.cos(np.longdouble(frequency) * hy.time) - np.longdouble(0.1) * v - x - force
        start = state.astype(np.longdouble)
        exact = hy.taylor_adaptive([(x, v), (v, push)], state=start, tol=np.longdouble(1e-19), fp_type=np.longdouble)
        exact.propagate_until(2.0 * np.arctan2(np.longdouble(0.0), np.longdouble(-1.0)) / np.longdouble(frequency))
        worst = max(worst, float(np.abs(found.state - exact.state).max()))
    assert worst < 1e-14
