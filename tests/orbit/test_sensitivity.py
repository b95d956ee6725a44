"""Sensitivities of whole orbits, against differences of orbits that SciPy integrates; and orbits carried along."""

import numpy as np
import pytest

from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.flow import flow_of
from gapwalk.flow.motion import signal_of
from gapwalk.model import Harmonic, System
from gapwalk.model.coefficients import coefficients_of
from gapwalk.orbit.find import carry, find_orbit
from gapwalk.orbit.orbit import Orbit, sensitivity, signal_along
from gapwalk.paper import case
from tests import independent
from tests.systems import clutch, linear, viscous_stop

MIX = {"q1''": 1.0, "q3''": -0.5, "stage2": 0.3, "q3'": 1.0}


@pytest.fixture(scope="module")
def rattle() -> Orbit:
    """A motion of period 1 with an impact on either side."""
    return find_orbit(case("8a").at({"mean.q1": 0.05, "mean.q3": 0.05, "frequency": 0.35}))


def independent_history(orbit: Orbit, theta):
    """States and accelerations at increasing angles on an orbit, by SciPy; it must close."""
    system, n = orbit.system, orbit.system.size
    times = np.append(theta, 2 * np.pi) / system.frequency
    rows = independent.integrate(system, orbit.state, max_step=0.05, rtol=1e-10, t_eval=times)
    np.testing.assert_allclose(rows[-1], orbit.state, atol=1e-8)
    a = [independent.acceleration(system, t, row[:n], row[n:]) for t, row in zip(times, rows, strict=True)]
    return rows[:-1], np.array(a)[:-1]


@pytest.mark.parametrize("name", ["stage2.impact_damping", "frequency"])
def test_the_derivative_of_a_signal_is_that_of_scipys_orbits(rattle, name) -> None:
    theta = np.linspace(0.1, 6.2, 40)
    signal = signal_of(rattle.system, {"q1''": 1.0, "q3'": -0.5})
    found = sensitivity(rattle, [name]).signal(signal, theta)
    step, values = 2e-5, []
    for sign in (1, -1):
        rows, a = independent_history(carry(rattle, rattle.system.at({name: rattle.system[name] + sign * step})), theta)
        values.append(a[:, 0] - 0.5 * rows[:, 3])
    difference = (values[0] - values[1]) / (2 * step)
    # beside a contact event the acceleration has a corner: there a difference is of first order
    assert np.median(np.abs(found.by_parameters[:, 0] - difference)) < 1e-5 * np.abs(difference).max()
    assert np.abs(found.by_parameters[:, 0] - difference).max() < 1e-3 * np.abs(difference).max()
    rows, a = independent_history(rattle, theta)
    np.testing.assert_allclose(found.values, a[:, 0] - 0.5 * rows[:, 3], atol=1e-7)


@pytest.mark.parametrize("name", ["stage2.clearance", "mean.q1", "stiffness.q3.q1", "mass.q1.q3", "harmonic1.phase"])
def test_derivatives_are_those_of_carried_orbits(rattle, name) -> None:
    theta = 7.0 + np.sort(np.random.default_rng(1).uniform(0.0, 2 * np.pi, 200))
    signal, step = signal_of(rattle.system, MIX), 1e-6
    found = sensitivity(rattle, [name]).signal(signal, theta)
    moved = [carry(rattle, rattle.system.at({name: rattle.system[name] + sign * step})) for sign in (1, -1)]
    difference = (signal_along(moved[0], signal, theta) - signal_along(moved[1], signal, theta)) / (2 * step)
    np.testing.assert_allclose(found.by_parameters[:, 0], difference, atol=1e-7 * np.abs(difference).max())
    by_angle = (signal_along(rattle, signal, theta + step) - signal_along(rattle, signal, theta - step)) / (2 * step)
    np.testing.assert_allclose(found.by_angle, by_angle, atol=1e-7 * np.abs(by_angle).max())


def test_the_derivative_of_a_linear_motion_is_known_in_closed_form() -> None:
    system = linear()
    orbit = find_orbit(system)
    theta = np.linspace(0.0, 6.0, 25)
    M, C, K = (system.matrix(which) for which in ("mass", "damping", "stiffness"))

    def dynamic(order: int):
        w = order * system.frequency
        return np.linalg.inv(K - w**2 * M + 1j * w * C)

    first, third = np.array([0.7, -0.28]) * np.exp(0.3j), np.array([0.0, 0.2])
    along = np.zeros((2, 2))
    along[0, 1] = 1.0  # stiffness.a.b
    slope = sum(
        np.real(-(dynamic(h) @ along @ dynamic(h) @ load)[0] * np.exp(1j * h * theta))
        for h, load in ((1, first), (3, third))
    )
    mean = -(np.linalg.inv(K) @ along @ np.linalg.inv(K) @ np.array([0.3, 0.0]))[0]
    found = sensitivity(orbit, ["stiffness.a.b"]).signal(signal_of(system, "a"), theta)
    np.testing.assert_allclose(found.by_parameters[:, 0], slope + mean, atol=1e-11)


def test_a_badly_scaled_motion_has_a_derivative() -> None:
    """Its velocities are 1e7 times its deflections: a small singular value is no multiplier of 1."""
    stiffness, damping, force, frequency = 1.7e14, 2e6, 1e6, 1e7
    load = Harmonic(force, {"x": 1.0})
    fast = System(["x"], [stiffness], [damping], mass=[1.0], harmonics=[load], frequency=frequency)
    amplitude = force / (stiffness - frequency**2 + 1j * frequency * damping)
    slope = -(amplitude**2) / force  # by the stiffness
    found = sensitivity(find_orbit(fast), ["stiffness.x.x"]).state[:, 0]
    np.testing.assert_allclose(found, np.real([slope, 1j * frequency * slope]), rtol=1e-8)


@pytest.mark.parametrize("system", [clutch(frequency=0.6), viscous_stop()], ids=["clutch", "viscous"])
def test_variations_piece_by_piece_are_those_at_once(system) -> None:
    """The slow way is taken only where a contact event was missed, so nothing else tests it."""
    flow = flow_of(system, "frequency", transition=True)
    coefficients = coefficients_of(system)
    direction = np.zeros((1, len(coefficients)))
    direction[0, 0] = 1.0
    state, thetas = np.full(2 * system.size, 0.4), np.linspace(0.0, 6.0, 13)
    once = flow.vary(coefficients, state, thetas, direction)
    pieces = flow._take()._vary_piecewise(coefficients, state, thetas, direction)
    for name in ("states", "transitions", "sensitivities"):
        np.testing.assert_allclose(getattr(pieces, name), getattr(once, name), atol=1e-9)
    assert len(once.contacts) == len(pieces.contacts) > 0


def test_an_orbit_is_carried_along_its_branch(rattle) -> None:
    goal = rattle.system.at({"stage2.impact_damping": 0.2, "mean.q1": 0.15, "stage2.clearance": 0.8})
    there = carry(rattle, goal)
    assert there.system == goal
    np.testing.assert_allclose(independent.integrate(goal, there.state), there.state, atol=1e-7)
    np.testing.assert_allclose(carry(there, rattle.system).state, rattle.state, atol=1e-9)


def test_an_orbit_is_not_carried_around_a_fold(rattle) -> None:
    """By `follow` the branch turns at mean.q1 = 0.288782; beyond, Newton's method finds orbits of other branches."""
    with pytest.raises(ConvergenceError, match=r"could be followed only up to mean\.q1 = 0\.28") as error:
        carry(rattle, rattle.system.at({"mean.q1": 0.5}))
    assert "lost on the way" in str(error.value)


def test_where_there_is_no_derivative_it_is_refused() -> None:
    """The fold of a linear motion: without damping, in resonance."""
    undamped = linear(damping=0.0)
    orbit = find_orbit(undamped)
    w2 = float(np.linalg.eigvals(np.linalg.solve(undamped.matrix("mass"), undamped.matrix("stiffness"))).real.min())
    resonant = Orbit(undamped.at(frequency=np.sqrt(w2)), 1, orbit.state, orbit.multipliers, (), 0.0, orbit.steps)
    with pytest.raises(NumericalError, match="fold or a branch point"):
        _ = sensitivity(resonant, ["mean.a"]).state


def test_what_cannot_be_varied_is_refused(rattle) -> None:
    with pytest.raises(ModelError, match=r"no parameter 'stage2\.gap'"):
        sensitivity(rattle, ["stage2.gap"])
    with pytest.raises(ModelError, match="only to other parameter values of its own system"):
        carry(rattle, linear())
    with pytest.raises(ModelError, match=r"differ by mean\.q1, but only mean\.q3 may change"):
        carry(rattle, rattle.system.at({"mean.q1": 0.1}), ["mean.q3"])
