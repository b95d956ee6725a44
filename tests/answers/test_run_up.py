"""Run-ups against closed forms, SciPy, the flow at constant speed, and the laws of inertia."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import wofz

import gapwalk as gw
from gapwalk.answers.speed_course import SpeedCourse

DAMPING, FORCE, PHASE = 0.05, 0.3, 0.4


def linear(**more) -> gw.System:
    return gw.System(
        ["x"], mass=[1.0], damping=[2.0 * DAMPING], stiffness=[1.0],
        harmonics=[gw.Harmonic(FORCE, {"x": 1.0}, **more)], frequency=1.0,
    )  # fmt: skip


def impacting() -> gw.System:
    return gw.System(
        ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0],
        contacts=[gw.stop("wall", {"x": 1.0}, 0.5, 20.0, impact_damping=0.2)],
        harmonics=[gw.Harmonic(0.3, {"x": 1.0}), gw.Harmonic(0.1, {"x": 1.0}, order=2, growth=2, phase=PHASE)],
        frequency=1.0,
    )  # fmt: skip


def chirped(t, first, rate):
    """Displacement of the linear oscillator from (0.1, -0.2), by the Faddeeva function (a complex Fresnel integral)."""
    pole = -DAMPING + 1j * np.sqrt(1.0 - DAMPING**2)

    def duhamel(pole):
        a = np.sqrt(-0.5j * rate)
        c = (1j * first - pole) / (2.0 * a)
        moved = np.exp(pole * t) * wofz(-1j * c) - np.exp(1j * (first * t + rate * t * t / 2)) * wofz(1j * (a * t - c))
        return np.sqrt(np.pi) / (2.0 * a) * moved

    forced = FORCE * (duhamel(pole) - duhamel(np.conj(pole))) / (2j * pole.imag)
    free = np.cos(pole.imag * t) * 0.1 + (-0.2 + DAMPING * 0.1) / pole.imag * np.sin(pole.imag * t)
    return forced.real + np.exp(-DAMPING * t) * free


@pytest.mark.parametrize(("first", "last", "rate"), [(0.5, 1.8, 0.004), (0.6, 1.4, 0.05)])
def test_a_chirp_agrees_with_the_fresnel_integral(first, last, rate):
    run = gw.run_up(linear(), SpeedCourse.ramp(first, last, rate), state=[0.1, -0.2], samples=64)
    assert run.time[-1] == pytest.approx((last - first) / rate, rel=1e-14)
    assert np.abs(run.states[:, 0] - chirped(run.time, first, rate)).max() < 1e-9
    assert np.ptp(run.states[:, 0]) > 1.0
    assert np.abs(run.speed - (first + rate * run.time)).max() < 1e-12


def exact_by_scipy(course: SpeedCourse, state, times):
    """The impacting mass by SciPy, restarted at each contact event and each knot, over time instead of the angle."""

    def load(t):
        speed, angle = course.at(t)
        return 0.3 * np.cos(angle) + 0.1 * speed**2 * np.cos(2 * angle + PHASE)

    def free(t, y):
        return [y[1], load(t) - y[0] - 0.1 * y[1]]

    def touching(t, y):
        return [y[1], load(t) - y[0] - 0.1 * y[1] - 20.0 * (y[0] - 0.5) * (1.0 + 0.2 * y[1])]

    def gap(t, y):
        return y[0] - 0.5

    gap.terminal = True
    y, t, found, hits, knots = np.array(state), 0.0, [], 0, list(course.time[1:])
    closed = y[0] > 0.5
    while t < course.duration:
        gap.direction = -1.0 if closed else 1.0
        inside = times[(times >= t) & (times <= knots[0])]
        solved = solve_ivp(
            touching if closed else free, (t, knots[0]), y, "DOP853", events=gap, rtol=1e-12, atol=1e-13,
            dense_output=True,
        )  # fmt: skip
        inside = inside[inside <= solved.t[-1]]
        inside = inside[inside > (found[-1][0] if found else -1.0)]
        found += [(s, *solved.sol(s)) for s in inside]
        t, y = solved.t[-1], solved.y[:, -1]
        if solved.status == 1:
            hits += not closed
            closed = not closed
        if t >= knots[0] - 1e-12:
            knots.pop(0)
    return np.array(found), hits


def test_impacts_agree_with_scipy_over_time():
    course = SpeedCourse([0.0, 30.0, 45.0, 60.0], [0.6, 1.1, 1.2, 1.0])
    run = gw.run_up(impacting(), course, state=[0.1, -0.2], samples=32)
    by_scipy, hits = exact_by_scipy(course, [0.1, -0.2], run.time)
    assert hits == run.peaks[0].impacts > 5
    assert np.abs(np.interp(by_scipy[:, 0], run.time, run.states[:, 0]) - by_scipy[:, 1]).max() < 1e-8
