"""Run-ups against closed forms, SciPy, the flow at constant speed, and the laws of inertia."""

from __future__ import annotations

import io

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import wofz

import gapwalk as gw
from gapwalk.answers.run_up import SpeedCourse
from gapwalk.ensemble.batch_flow import BatchOptions

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
    run = gw.ask.run_up(linear(), SpeedCourse.ramp(first, last, rate), state=[0.1, -0.2], samples=64)
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
    run = gw.ask.run_up(impacting(), course, state=[0.1, -0.2], samples=32)
    by_scipy, hits = exact_by_scipy(course, [0.1, -0.2], run.time)
    assert hits == run.peaks[0].impacts > 5
    assert np.abs(np.interp(by_scipy[:, 0], run.time, run.states[:, 0]) - by_scipy[:, 1]).max() < 1e-8


def train(**more) -> gw.System:
    """A flywheel that drives a hub by a shaft, and a loose gear; without excitation but a small one."""
    text = """
    speed = "950 rpm"
    mean = { gear = "-2 N m" }
    reaction = "flywheel"
    inertia = [
        { name = "flywheel", inertia = "0.14 kg m^2" },
        { name = "hub", inertia = "0.004 kg m^2" },
        { name = "gear", inertia = "0.002 kg m^2" },
    ]
    shaft = [{ name = "clutch", between = ["flywheel", "hub"], stiffness = "200 N m/rad", damping = "1 N m s/rad" }]
    [[gear]]
    name = "mesh"
    between = ["hub", "gear"]
    ratio = RATIO
    clearance = "0.1 deg"
    stiffness = "10000 N m/rad"
    impact_damping = "1 s/rad"
    [[harmonic]]
    order = 2
    amplitude = "AMPLITUDE N m"
    acts_on = { flywheel = 1.0 }
    [study]
    kind = "run-up"
    from = "700 rpm"
    to = "1100 rpm"
    rate = "100 rpm/s"
    """
    for name, value in ({"ratio": "1.0", "amplitude": "1e-9"} | more).items():
        text = text.replace(name.upper(), value)
    return gw.read_study(io.StringIO("\n".join(line.strip() for line in text.splitlines()))).system


@pytest.mark.parametrize("ratio", [1.0, -2.5])
def test_inertias_pull_back_while_the_reaction_runs_the_train_up(ratio):
    run = gw.ask.run_up(train(ratio=str(ratio)), SpeedCourse.ramp(700.0, 1900.0, 1000.0), samples=16)
    rate = 1000.0 * 2.0 * np.pi / 60.0
    late = run.time > 0.9
    drag = -2.0 / ratio
    assert run.signal("clutch.torque")[late] == pytest.approx((0.004 + 0.002 / ratio**2) * rate - drag, rel=1e-3)
    assert run.signal("mesh.force")[late] == pytest.approx(0.002 / ratio**2 * rate - drag, rel=1e-3)


@pytest.mark.parametrize("by", ["curves", "steps"])
def test_the_torque_of_a_drag_follows_the_square_of_the_speed(by):
    system = gw.train.Train(
        [gw.train.Inertia("engine", 1.0), gw.train.Inertia("rotor", 0.01)],
        [gw.train.Shaft("link", ("engine", "rotor"), stiffness=2000.0, damping=2.0)],
        drags=[gw.train.Drag("fan", ("rotor", "ground"), quadratic=1e-3)],
        reaction="engine",
        frequency=60.0,
        harmonics=[gw.Harmonic(0.1, {"engine": 1.0}, order=2)],
    ).system()
    course = SpeedCourse.ramp(60.0, 140.0, 40.0)
    run = gw.ask.run_up(system, course, samples=32, by=by)
    assert run.signal("fan.force") == pytest.approx(1e-3 * (run.speed + run.signal("rotor.speed")) ** 2, rel=1e-9)
    assert abs(run.peaks[0].force) == pytest.approx(1e-3 * 140.0**2, rel=1e-3)
    assert gw.ask.run_ups(system, [course]).by_steps  # the batch of exact ones holds such torques


def test_a_constant_speed_is_a_run_up_without_acceleration():
    system = impacting().at(frequency=0.9)
    run = gw.ask.run_up(system, SpeedCourse([0.0, 20.0], [0.9, 0.9]), state=[0.1, 0.3], phase=1.0, samples=64)
    motion = gw.integrate(system, np.array([0.1, 0.3]), 2.0, 64, phase=1.0)
    assert np.abs(run.states[:129] - motion.states).max() < 1e-12


def test_many_run_ups_agree_with_the_exact_ones():
    system = impacting()
    courses = [SpeedCourse.ramp(0.6, 1.2, rate) for rate in (0.005, 0.01, 0.02)]
    courses += [SpeedCourse.ramp(1.2, 0.6, 0.01), SpeedCourse([0.0, 30.0, 45.0, 60.0], [0.6, 1.1, 1.2, 1.0])]
    phases = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    found = gw.ask.run_ups(system, courses, phases=phases, bins=20, options=BatchOptions(error=1e-5, sample=4))
    assert found.error < 1e-5
    assert not found.diverged.any()
    for number, course in enumerate(courses):
        exact = gw.ask.run_up(system, course, phase=float(phases[number]), samples=256)
        assert found.peaks("wall")[number] == pytest.approx(abs(exact.peaks[0].force), rel=2e-3)
        assert found.impacts[number].sum() == exact.peaks[0].impacts
        assert found.high[number].max() == pytest.approx(exact.states[:, 0].max(), abs=2e-4)
        assert found.low[number].min() == pytest.approx(exact.states[:, 0].min(), abs=2e-4)


@pytest.mark.slow
def test_three_masses_in_a_batch():
    """Lanes hold modal coordinates from three degrees of freedom on; only one mass is loaded, and grows."""
    stiffness = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.5]])
    system = gw.System(
        ["a", "b", "c"], mass=[1.0, 2.0, 1.0], damping=0.05 * stiffness, stiffness=stiffness,
        contacts=[gw.backlash("gap", {"b": 1.0, "c": -1.0}, 0.3, 5.0)],
        harmonics=[gw.Harmonic(0.4, {"a": 1.0}, growth=1), gw.Harmonic(0.1, {"a": 1.0}, order=3)],
        frequency=1.0,
    )  # fmt: skip
    course = SpeedCourse.ramp(0.4, 1.6, 0.04)
    state = np.array([0.1, 0.0, -0.1, 0.0, 0.2, 0.0])
    found = gw.ask.run_ups(system, [course], states=state[None], bins=10, options=BatchOptions(error=1e-5))
    exact = gw.ask.run_up(system, course, state=state, samples=128)
    assert found.impacts.sum() == exact.peaks[0].impacts > 3
    assert found.peaks("gap")[0] == pytest.approx(abs(exact.peaks[0].force), rel=1e-3)

    def motion(t, y):
        speed, angle = course.at(t)
        x, v = y[:3], y[3:]
        gap = x[1] - x[2]
        force = 5.0 * (max(gap - 0.3, 0.0) + min(gap + 0.3, 0.0))
        pushed = np.array([0.4 * speed * np.cos(angle) + 0.1 * np.cos(3 * angle), -force, force])
        return [*v, *((pushed - 0.05 * stiffness @ v - stiffness @ x) / [1.0, 2.0, 1.0])]

    times = exact.time[::37]
    solved = solve_ivp(
        motion, (0.0, course.duration), state, "DOP853", t_eval=times, rtol=1e-11, atol=1e-12, max_step=0.2
    )
    assert np.abs(solved.y.T - exact.states[::37]).max() < 1e-6  # SciPy steps over kinks here


def test_what_cannot_run_up_is_refused_by_name():
    load = [gw.Harmonic(0.1, {"x": 1.0})]
    stiff = {"mass": [1.0], "damping": [0.1], "stiffness": [1.0], "frequency": 1.0}
    course = SpeedCourse.ramp(0.5, 1.0, 0.1)
    brake = gw.System(["x"], contacts=[gw.friction("brake", {"x": 1.0}, 0.1, static=1.5)], harmonics=load, **stiff)
    wall = gw.System(["x"], contacts=[gw.rigid_stop("wall", {"x": 1.0}, 0.1, restitution=0.7)], harmonics=load, **stiff)
    table = gw.System(["x"], harmonics=[gw.Harmonic(0.1, {"x": 1.0}, over_speed="1 + W**3")], **stiff)
    for system, word in ((brake, "at rest the friction of brake"), (wall, "rigid stop"), (table, "over the speed")):
        for compute in (lambda s: gw.ask.run_up(s, course), lambda s: gw.ask.run_ups(s, [course])):
            with pytest.raises(gw.errors.ModelError, match=word):
                compute(system)
    for wrong, word in (
        (lambda: SpeedCourse([0.0, 1.0], [0.0, 1.0]), "must be > 0"),
        (lambda: SpeedCourse([0.0, 0.0], [1.0, 1.0]), "increase"),
        (lambda: SpeedCourse.ramp(1.0, 2.0, -1.0), "rate"),
        (lambda: gw.ask.run_up(linear(), SpeedCourse.ramp(0.5, 1.0, 0.1), state=[1.0]), "state"),
    ):
        with pytest.raises(gw.errors.ModelError, match=word):
            wrong()


def test_a_waterfall_of_a_run_up_has_the_orders_of_its_loads():
    run = gw.ask.run_up(linear(order=3), SpeedCourse.ramp(0.05, 0.2, 0.0002), state=[0.3, 0.0], samples=64)
    found = run.waterfall("x", 6.0, 4)
    highest = found.orders[1:][found.amplitudes[:, 1:].argmax(axis=1)]
    assert np.all(highest[len(highest) // 2 :] == 3.0)
    assert found.amplitudes[-1, found.orders == 3.0] == pytest.approx(
        FORCE / (1 - (3 * found.values[-1]) ** 2), rel=0.03
    )


def test_a_trace_is_read_in_the_unit_of_the_system():
    course = SpeedCourse.read(io.StringIO("t (ms); n (Hz)\n500; 10\n1500; 20\n"), train())
    assert course.time.tolist() == [0.0, 1.0]
    assert course.speed == pytest.approx([600.0, 1200.0])
