"""Accelerations of inertias and torques of links, against SciPy on the absolute equations 1 to 3 of the paper."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.motion import Motion, signal_names, signal_of
from tests.model.drivetrain.trains import (
    BETA,
    BOX,
    DAMPING,
    DEGREE,
    FIRST,
    FLYWHEEL,
    GAP,
    HUB,
    MEAN,
    SECOND,
    SHAFT,
    SHAFT_DAMPING,
    SIZE,
    by_hand,
    physical,
)
from tests.tiers import keeps

INERTIAS = np.array([FLYWHEEL, HUB, BOX])


def absolute(time: float, state: np.ndarray, frequency: float, last: float = -MEAN) -> np.ndarray:
    """Rates of the three angles and of their speeds, in rad and s."""
    (u1, u2, u3), rates = state[:3], state[3:]
    q, rate = u1 - u2, rates[0] - rates[1]
    g = SECOND * math.copysign(max(abs(q) - GAP, 0.0), q)
    clutch = FIRST * q + DAMPING * rate + g + BETA * abs(g) * rate
    shaft = SHAFT * (u2 - u3) + SHAFT_DAMPING * (rates[1] - rates[2])
    torques = MEAN + SIZE * math.cos(frequency * time) - clutch, clutch - shaft, shaft + last
    return np.concatenate((rates, np.array(torques) / INERTIAS))


@keeps("12.0-False")
@pytest.mark.parametrize("with_units", [False, True])
@pytest.mark.parametrize("last", [-MEAN, 12.0])
def test_inertias_accelerate_as_the_absolute_equations_say(with_units: bool, last: float) -> None:
    """Also where the mean torques do not balance, so that the train accelerates as a whole."""
    system = (physical() if with_units else by_hand()).system().at({"mean.box": last})
    unit = DEGREE if with_units else 1.0
    state = np.array([0.04, 0.001, 1.5, -0.8]) / unit
    motion = gw.integrate(system, state, periods=2, samples=40)
    q1, q2, v1, v2 = state * unit
    start = [0.3, 0.3 - q1, 0.3 - q1 - q2, 50.0, 50.0 - v1, 50.0 - v1 - v2]
    options = {"rtol": 1e-11, "atol": 1e-13, "method": "DOP853", "max_step": float(motion.time[1]) / 50}
    found = solve_ivp(
        absolute, (0.0, motion.time[-1]), start, t_eval=motion.time, args=(system.frequency, last), **options
    )
    states = zip(found.t, found.y.T, strict=True)
    expected = np.array([absolute(time, y, system.frequency, last)[3:] for time, y in states])
    for place, name in enumerate(("flywheel", "hub", "box")):
        size = np.abs(expected[:, place]).max()
        np.testing.assert_allclose(motion.signal(f"{name}''"), expected[:, place], rtol=0, atol=1e-7 * size)
    np.testing.assert_allclose(motion.signal("input.torque"), BOX * expected[:, 2] - last, rtol=0, atol=1e-5)
    clutch = MEAN + SIZE * np.cos(motion.theta) - FLYWHEEL * expected[:, 0]
    np.testing.assert_allclose(motion.signal("clutch.torque"), clutch, rtol=0, atol=1e-5)
    always = FIRST * motion.signal("clutch") * unit + DAMPING * motion.v[:, 0] * unit  # the rest is that of its contact
    np.testing.assert_allclose(motion.signal("clutch.force"), clutch - always, rtol=0, atol=1e-5)


def test_no_two_signals_have_one_name() -> None:
    """The coordinate of a link and its contact have the same name, and the force was hidden behind the deflection."""
    for train in (by_hand(), physical()):
        system = train.system()
        names = signal_names(system)
        assert len(set(names)) == len(names)
        motion = gw.integrate(system, np.array([1.0, 0.1, 0.0, 0.0]) * 9, periods=1, samples=20)
        histories = [motion.signal(name) for name in names]
        for place, name in enumerate(names):
            same = [names[k] for k, other in enumerate(histories) if np.array_equal(other, histories[place])]
            assert {each.replace(".acceleration", "''") for each in same} == {name.replace(".acceleration", "''")}
    assert system.units is not None
    assert system.units.signal("clutch.force")[1] == "N m"


def test_a_link_of_a_closed_loop_has_no_force_in_the_name_of_a_deflection() -> None:
    inertias = [gw.train.Inertia(name, 1.0) for name in ("a", "b", "c")]
    shafts = [
        gw.train.Shaft("first", ("a", "b"), stiffness=4.0, damping=0.1),
        gw.train.Shaft("second", ("b", "c"), stiffness=4.0, damping=0.1),
        gw.train.Shaft("bridge", ("a", "c"), stiffness=9.0, damping=0.1, clearance=0.2),
    ]
    system = gw.train.Train(inertias, shafts, harmonics=[gw.Harmonic(1.0, {"a": 1.0})], frequency=0.9).system()
    assert "bridge" not in system.coordinates
    motion = gw.integrate(system, np.array([0.3, 0.3, 0.0, 0.0]))
    np.testing.assert_array_equal(motion.signal("bridge.force"), motion.forces[:, 0])
    with pytest.raises(ModelError, match=r"there is no signal 'bridge'; did you mean bridge\.(force|torque)"):
        motion.signal("bridge")


def test_a_held_train_has_no_motion_as_a_whole() -> None:
    """One inertia on the wall: its acceleration is that of the twist of its shaft."""
    wall = gw.train.Shaft("shaft", ("disc", "ground"), stiffness=4.0, damping=0.1)
    harmonic = gw.Harmonic(1.0, {"disc": 1.0})
    system = gw.train.Train([gw.train.Inertia("disc", 2.0)], [wall], harmonics=[harmonic], frequency=0.9).system()
    motion = gw.find_orbit(system).motion()
    np.testing.assert_allclose(motion.signal("disc''"), motion.a[:, 0], rtol=1e-13, atol=1e-13)
    torque = np.cos(motion.theta) - 2.0 * motion.a[:, 0]
    np.testing.assert_allclose(motion.signal("shaft.torque"), torque, atol=1e-13)


def test_slopes_of_what_parts_do_are_those_of_small_real_steps() -> None:
    system = physical().system()
    random = np.random.default_rng(8)
    theta, states, along = random.uniform(0, 6, 9), random.normal(0, 4, (9, 4)), random.normal(size=(9, 4))

    def moved(step: float) -> Motion:
        q = states + step * along
        return Motion(system, theta + 0.7 * step, q[:, :2], q[:, 2:], ())

    for name in signal_names(system):
        signal = signal_of(system, name)
        slope = signal.slope(moved(0.0), along, theta=0.7)
        difference = (signal.of(moved(1e-6)) - signal.of(moved(-1e-6))) / 2e-6
        np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-6 * (1 + np.abs(difference).max()))
    with pytest.raises(ModelError, match="the slope of box'' by a parameter is not known"):
        signal_of(system, "box''").slope(moved(0.0), along, np.zeros(1))
