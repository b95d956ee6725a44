"""Records of a shaft that turns: against closed forms, from speeds, pulses and square waves, and what is refused."""

import numpy as np
import pytest
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.loads import turning_orders

SPEED = 50.0 * np.pi  # 1,500 rpm, in rad/s
FIRST, SECOND = 0.01, 0.004  # rad


def smooth(t, rate):
    return SPEED * t + 0.5 * rate * t * t


def angle(t, rate=0.0):
    """The angle of a shaft whose motion has the orders 2 and 3.5 about a ramp."""
    psi = smooth(t, rate)
    return psi + FIRST * np.cos(2.0 * psi) + SECOND * np.sin(3.5 * psi)


def speed(t, rate=0.0):
    """Its derivative, written out."""
    psi = smooth(t, rate)
    slope = 1.0 - 2.0 * FIRST * np.sin(2.0 * psi) + 3.5 * SECOND * np.cos(3.5 * psi)
    return (SPEED + rate * t) * slope


def lines(table) -> dict[float, complex]:
    return {each.order: complex(each.cosine, -each.sine) for each in table.lines}


def passings(end: float, rate: float = 0.0, per_turn: int = 60):
    """The times at which teeth pass a sensor."""
    count = int((angle(end, rate) - FIRST) / (2.0 * np.pi) * per_turn)
    steps = FIRST + 2.0 * np.pi / per_turn * np.arange(count)
    return np.array([brentq(lambda t, at=at: angle(t, rate) - at, 0.0, end, xtol=1e-15, rtol=1e-15) for at in steps])


@pytest.mark.parametrize("rate", [0.0, 2.0, -3.0])
def test_a_record_of_speed_gives_the_motion_whose_derivative_it_is(rate) -> None:
    t = np.arange(20_001) * 1e-4
    table, drift = turning_orders(t, speed(t, rate), per="cycle", orders=[0.5, 2.0, 3.5])
    found = lines(table)
    np.testing.assert_allclose([found[0.5], found[2.0], found[3.5]], [0.0, FIRST, -1j * SECOND], atol=1e-9)
    assert table.mean == pytest.approx(0.0, abs=1e-12)
    ends = (drift.begin, drift.end)
    np.testing.assert_allclose(ends, (SPEED + rate * 0.04, SPEED + rate * 1.96), rtol=1e-3)
    # a parabola and its chord are farthest apart in the middle, by rate T^2 / 8
    assert drift.angle == pytest.approx(abs(rate) * 0.5, rel=0.1, abs=1e-4)


def test_the_same_record_over_the_angle() -> None:
    t = np.arange(4_001) * 5e-4
    table, _ = turning_orders(angle=angle(t), speed=speed(t), per="cycle", orders=[2.0, 3.5])
    found = lines(table)
    np.testing.assert_allclose([found[2.0], found[3.5]], [FIRST, -1j * SECOND], atol=2e-6)


def test_one_period_is_enough_and_its_own_drift_is_taken_off() -> None:
    t = np.linspace(0.0, 0.081, 4001)
    table, drift = turning_orders(t, speed(t, 5.0), per="cycle", orders=[2.0, 3.5])
    np.testing.assert_allclose([*lines(table).values()], [FIRST, -1j * SECOND], atol=2e-5)
    assert drift.periods == 1
    assert drift.words.startswith("one period, the drift from")


@pytest.mark.parametrize("rate", [0.0, 2.0])
def test_pulses_of_an_encoder_give_the_motion(rate) -> None:
    table, _ = turning_orders(passings(1.0, rate), pulses=60, per="cycle", orders=[2.0, 3.5])
    np.testing.assert_allclose(np.abs([*lines(table).values()]), [FIRST, SECOND], rtol=2e-3)


def test_a_square_wave_gives_the_times_of_its_pulses() -> None:
    t = np.arange(200_000) * 5e-6  # 83 samples in a pulse, of which the edge takes two
    turned = (angle(t) - FIRST) / (2.0 * np.pi) * 60.0
    noise = 1e-3 * np.random.default_rng(2).normal(size=t.size)
    level = np.clip(40.0 * np.sin(2.0 * np.pi * turned), -1.0, 1.0) + noise
    table, _ = turning_orders(t, signal=level, pulses=60, per="cycle", orders=[2.0, 3.5])
    np.testing.assert_allclose(np.abs([*lines(table).values()]), [FIRST, SECOND], rtol=1e-2)


def test_a_run_up_has_the_orders_of_the_speed_that_is_asked_for() -> None:
    """From 1,500 to 3,400 rpm, with an amplitude that grows with the speed."""
    t, rate = np.arange(60_001) / 30_000.0, 100.0
    psi, now = smooth(t, rate), SPEED + rate * t
    torque = now * (0.3 * np.cos(2.0 * psi - 0.4) + 0.1 * np.cos(4.0 * psi)) + 20.0
    at = 2400.0 * np.pi / 30.0
    table, drift = turning_orders(t, speed(t, rate), torque, at=at, per="cycle", orders=[1.0, 2.0, 4.0])
    mean = 0.5 * (drift.begin + drift.end)
    assert drift.begin < at < drift.end
    found = lines(table)
    np.testing.assert_allclose(found[2.0] / mean, 0.3 * np.exp(-0.4j), rtol=1e-3)
    np.testing.assert_allclose(found[4.0] / mean, 0.1, rtol=5e-3)  # the growth within a cycle of order 2
    assert abs(found[1.0]) < 0.002 * mean  # likewise
    assert table.mean == pytest.approx(20.0, rel=2e-3)
    moved, _ = turning_orders(t, speed(t, rate), at=at, per="cycle", orders=[2.0, 3.5])
    np.testing.assert_allclose([*lines(moved).values()], [FIRST, -1j * SECOND], atol=1e-5)


def test_an_acceleration_gives_the_displacement() -> None:
    t = np.arange(8_001) * 2.5e-4
    acceleration = -4.0 * SPEED**2 * 1e-3 * np.cos(2.0 * SPEED * t)
    table, _ = turning_orders(t, np.full(t.size, SPEED), acceleration, accelerates=True, orders=[2.0])
    assert table.lines[0].cosine == pytest.approx(1e-3, rel=1e-6)


T = np.arange(1000) * 1e-3


def with_one(values, place: int, value: float):
    values = np.array(values)
    values[place] = value
    return values


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"time": T, "speed": SPEED - 400.0 * T},
            "its speed is -0.1203.. in sample 394 .607 in all.; the angle must",
        ),
        ({"time": T, "speed": np.full(1000, -SPEED)}, "its speed is negative throughout; give its magnitude"),
        (
            {"time": with_one(T, 5, 0.004), "speed": speed(T)},
            "time does not increase from sample 5 .0.004. to",
        ),
        (
            {"time": np.where(T > 0.5, T + 0.2, T), "speed": speed(T)},
            "samples are missing: time goes on by 0.201",
        ),
        ({"time": T, "speed": with_one(speed(T), 3, np.nan)}, "the speed must be one row of finite numbers"),
        ({"time": T, "speed": speed(T)[:-1]}, "time has 1000 samples, but speed has 999 samples"),
        ({"time": T[:30], "speed": speed(T[:30])}, "it has 0.7.. turns, but 1 whole turn is needed; give a longer"),
        ({"time": T, "speed": SPEED + 100.0 * T}, "its speed goes from 1.* to .*; say at which speed they are wanted"),
        ({"time": T, "speed": speed(T), "at": 400.0}, "no period has the speed 400 within 2 %; its periods have 157"),
        ({"time": np.delete(passings(0.5), 77), "pulses": 60}, "a pulse is missing after pulse 77|after sample 77"),
        (
            {"time": T, "pulses": 60, "signal": np.ones(1000)},
            "the channel of pulses is 1 throughout; name the",
        ),
        ({"time": T}, "needs its speed over time or angle, or the times of pulses"),
        ({"time": T[:4], "speed": speed(T[:4])}, "it has 4 samples; a record of a turning shaft has 8 at least"),
    ],
)
def test_what_is_no_record_of_a_turning_shaft_is_refused(given, told) -> None:
    with pytest.raises(ModelError, match=told):
        turning_orders(**given)


def test_a_model_file_reads_the_motion_of_its_flywheel(tmp_path) -> None:
    """The amplitudes come out in the angle of the train, and the drift is said."""
    t = np.arange(20_001) * 1e-4
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(t.tolist(), (speed(t, 2.0) * 30.0 / np.pi).tolist(), strict=True))
    (tmp_path / "run.csv").write_text("time (s), n (1/min)\n" + rows)
    (tmp_path / "m.toml").write_text(
        """
speed = "1500 rpm"
[[inertia]]
name = "flywheel"
[[inertia]]
name = "hub"
inertia = "0.01 kg m^2"
[[shaft]]
name = "clutch"
between = ["flywheel", "hub"]
stiffness = "10 N m/deg"
damping = "0.1 N m s/rad"
[[measured]]
file = "run.csv"
varies = "flywheel.angle"
per = "cycle"
orders = [2, 3.5]
[study]
kind = "response"
parameter = "speed"
from = "1500 rpm"
to = "1600 rpm"
"""
    )
    system = gw.read_study(tmp_path / "m.toml").system
    (load,) = system.structure.harmonics
    numbers = dict(load.constants)
    np.testing.assert_allclose(
        [abs(complex(*each[1:])) for each in numbers["series"]], np.degrees([FIRST, SECOND]), rtol=1e-6
    )
    assert "the drift from 1500.76 rpm to 1536.98 rpm (+2.4 %, " in numbers["drift"]
