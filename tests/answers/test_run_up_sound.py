"""The sound of a run-up is its exact signal, at the instants of the samples; legs are those of its speed."""

import io

import numpy as np
import pytest
from scipy.io import wavfile

import gapwalk as gw
from gapwalk.answers.run_up import SpeedCourse
from gapwalk.attractors.spectrum import SECOND
from gapwalk.errors import ModelError
from tests.answers.test_run_up import DAMPING, FORCE, chirped, exact_by_scipy, impacting, linear, train


def test_the_sound_of_a_chirp_is_the_closed_form() -> None:
    """Displacement by the Fresnel integral; acceleration from the balance of forces with its derivative."""
    first, last, rate = 0.6, 1.4, 0.05
    run = gw.ask.run_up(linear(), SpeedCourse.ramp(first, last, rate), state=[0.1, -0.2], samples=64)
    heard = run.sound("x", rate=8_000)
    time = np.arange(len(heard.values)) * SECOND / 8_000
    assert heard.duration == pytest.approx(run.time[-1] / SECOND, abs=1.0 / 8_000)
    assert np.abs(heard.values - chirped(time, first, rate)).max() < 1e-9
    step = 1e-4
    rates = (chirped(time[1:-1] + step, first, rate) - chirped(time[1:-1] - step, first, rate)) / (2.0 * step)
    force = FORCE * np.cos(first * time[1:-1] + 0.5 * rate * time[1:-1] ** 2)
    exact = force - heard.values[1:-1] - 2.0 * DAMPING * rates
    assert np.abs(run.sound("x''", rate=8_000).values[1:-1] - exact).max() < 1e-7
    rate_of_file, content = wavfile.read(io.BytesIO(heard.wav(2.0 * heard.full_scale)))
    assert rate_of_file == 8_000
    mean = heard.values.mean()
    np.testing.assert_allclose(content / 2.0**31 * 2.0 * heard.full_scale + mean, heard.values, atol=1e-6)


def test_the_sound_of_impacts_agrees_with_scipy() -> None:
    course = SpeedCourse(np.array([0.0, 30.0, 45.0, 60.0]), np.array([0.6, 1.1, 1.2, 1.0]))
    run = gw.ask.run_up(impacting(), course, state=[0.1, -0.2], samples=32)
    heard = run.sound("wall.force", rate=4_000)
    time = np.arange(len(heard.values)) * SECOND / 4_000
    by_scipy, hits = exact_by_scipy(course, [0.1, -0.2], time)
    assert hits > 5
    depth = np.maximum(by_scipy[:, 1] - 0.5, 0.0)
    force = 20.0 * depth * (1.0 + 0.2 * by_scipy[:, 2])
    places = np.searchsorted(time, by_scipy[:, 0] - 1e-9)
    assert len(np.unique(places)) > 0.99 * len(time)
    assert np.abs(heard.values[places] - force).max() < 1e-6 * force.max()
    assert force.max() > 1.0


def test_a_run_up_at_other_times_is_itself() -> None:
    run = gw.ask.run_up(
        impacting(), SpeedCourse(np.array([0.0, 40.0, 80.0]), np.array([0.7, 1.2, 0.7])), state=[0.1, -0.2], samples=32
    )
    again = run.at(run.time)
    np.testing.assert_allclose(again.states, run.states, atol=1e-10)
    np.testing.assert_allclose(again.signal("x''"), run.signal("x''"), atol=1e-9)
    for times in ([], [1.0, 1.0], [-1.0, 2.0], [0.0, 81.0]):
        with pytest.raises(ModelError, match="times"):
            run.at(times)


def test_the_speed_divides_a_run_up_into_legs() -> None:
    run = gw.ask.run_up(linear(), SpeedCourse(np.array([0.0, 200.0, 400.0]), np.array([0.6, 1.4, 0.6])), samples=32)
    up, down = run.tracked("x").legs()
    assert up.rises
    assert not down.rises
    assert up.speed.max() == pytest.approx(1.4, abs=1e-3)
    assert abs(up.theta[-1] - down.theta[0]) <= 2.0 * np.pi / 32 + 1e-9
    # at the resonance the motion follows late: above it while the speed rises, below it while it falls
    tops = [leg.extremes()[0][np.argmax(leg.extremes()[2])] for leg in (up, down)]
    assert tops[0] > 1.0 > tops[1]
    (whole,) = gw.ask.run_up(linear(), SpeedCourse.ramp(0.6, 1.4, 0.01), samples=32).tracked("x").legs()
    assert whole.rises


def test_accelerations_are_the_derivatives_of_the_velocities() -> None:
    """Of a train, whose reaction also runs it up; in rad/s^2, while its states are in deg."""
    system = train(amplitude="20")
    run = gw.ask.run_up(system, SpeedCourse.ramp(700.0, 1100.0, 400.0))
    time = np.linspace(0.31, 0.32, 2001)
    part = run.at(time)
    slopes = np.deg2rad(np.gradient(part.signal("clutch'"), time))
    exact = part.signal("clutch''")
    assert np.abs(slopes[1:-1] - exact[1:-1]).max() < 1e-4 * np.abs(exact).max()
    assert np.abs(exact).max() > 1.0
