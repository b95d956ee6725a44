"""Jacobian, eigenvectors and impacts of an orbit, linear starts, and ensembles; against SciPy and closed forms."""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gapwalk as gw
from gapwalk.errors import ModelError

DAMPING, RESTITUTION, FREQUENCY, FORCE = 0.1, 0.8, 2.6, 9.0


def oscillator(force: float, frequency: float, restitution: float = RESTITUTION) -> gw.System:
    """An oscillator beside a rigid stop at 1."""
    return gw.System(
        ["x"],
        mass=[[1.0]],
        stiffness=[[1.0]],
        damping=[[DAMPING]],
        contacts=[gw.rigid_stop("stop", {"x": 1.0}, 1.0, restitution=restitution, side="positive")],
        harmonics=[gw.Harmonic(force, {"x": 1.0})],
        frequency=frequency,
    )


@functools.cache
def struck() -> gw.Orbit:
    """A settled motion with impacts, found at a force at which the free motion would pass the stop."""
    orbit = gw.settle(oscillator(FORCE, FREQUENCY)).orbit
    assert orbit is not None
    return orbit


def by_scipy(state: np.ndarray, duration: float, force: float) -> tuple[np.ndarray, int]:
    """Integrate from impact to impact; return the last state and the number of impacts."""

    def stop(_: float, y: np.ndarray) -> float:
        return y[0] - 1.0

    setattr(stop, "terminal", True)  # noqa: B010 - as SciPy asks for it
    setattr(stop, "direction", 1.0)  # noqa: B010
    now, count = 0.0, 0
    while True:
        found = solve_ivp(
            lambda t, y: [y[1], force * np.cos(FREQUENCY * t) - y[0] - DAMPING * y[1]],
            (now, duration),
            state,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            events=stop,
        )
        state, now = found.y[:, -1].copy(), float(found.t[-1])
        if found.status != 1:
            return state, count
        state[0], state[1], count = 1.0 - 1e-15, -RESTITUTION * state[1], count + 1


def test_the_jacobian_and_the_impacts_of_a_motion_with_impacts_are_those_of_scipy() -> None:
    orbit = struck()
    duration = 2.0 * np.pi * orbit.period / FREQUENCY
    end, count = by_scipy(orbit.state, duration, FORCE)
    assert (count, orbit.period) == (2, 3)
    assert end == pytest.approx(orbit.state, abs=1e-8)
    assert orbit.measure("impacts.stop") == count / orbit.period
    step = 1e-5
    ends = [[by_scipy(orbit.state + side * way, duration, FORCE)[0] for side in (step, -step)] for way in np.eye(2)]
    columns = [(high - low) / (2.0 * step) for high, low in ends]
    assert orbit.jacobian == pytest.approx(np.transpose(columns), rel=1e-5, abs=1e-5)
    # each impact contracts areas by the square of the restitution (Budd and Dux 1994)
    assert np.linalg.det(orbit.jacobian) == pytest.approx(RESTITUTION ** (2 * count) * np.exp(-DAMPING * duration))


def test_eigenvectors_belong_to_the_multipliers_in_their_order() -> None:
    orbit = struck()
    assert orbit.jacobian @ orbit.eigenvectors == pytest.approx(orbit.eigenvectors * orbit.multipliers, abs=1e-10)
    assert np.linalg.norm(orbit.eigenvectors, axis=0) == pytest.approx(1.0)
    free = gw.find_orbit(oscillator(0.1, FREQUENCY))
    matrix = np.array([[0.0, 1.0], [-1.0, -DAMPING]])
    assert free.jacobian == pytest.approx(expm(matrix * 2.0 * np.pi / FREQUENCY), abs=1e-12)
    assert free.measure("impacts.stop") == 0.0


def test_impacts_are_counted_on_contacts_with_a_gap_only() -> None:
    with pytest.raises(ModelError, match="did you mean stop"):
        struck().measure("impacts.stpo")


def test_a_linear_start_finds_the_motion_below_a_graze_in_closed_form() -> None:
    force, frequency = 2.9, 2.0
    assert abs(force / (1.0 - frequency**2 + 1j * DAMPING * frequency)) < 1.0
    system = oscillator(force, frequency)
    orbit = gw.find_orbit(system, start="linear")
    gain = force / (1.0 - frequency**2 + 1j * DAMPING * frequency)
    assert orbit.state == pytest.approx([gain.real, (1j * frequency * gain).real], abs=1e-12)
    undamped = gw.System(
        ["x"], mass=[[1.0]], stiffness=[[1.0]], harmonics=[gw.Harmonic(1.0, {"x": 1.0})], frequency=1.0
    )
    with pytest.raises(ModelError, match="no linear response at resonance"):
        gw.find_orbit(undamped, start="linear")


def test_an_ensemble_is_integrated_as_each_of_its_states() -> None:
    system, starts = oscillator(FORCE, FREQUENCY), np.random.default_rng(1).uniform(-0.9, 0.9, (4, 2))
    motions = gw.integrate(system, list(starts), periods=1.5)
    assert len(motions) == 4
    for motion, start in zip(motions, starts, strict=True):
        end, _ = by_scipy(start, 1.5 * 2.0 * np.pi / FREQUENCY, FORCE)
        assert motion.states[-1] == pytest.approx(end, abs=1e-7)
