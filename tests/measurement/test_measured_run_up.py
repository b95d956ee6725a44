"""Measured run-ups: orders and extremes of a record are those of the motion that it was written from."""

import io

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.run_up import SpeedCourse
from gapwalk.attractors.spectrum import Waterfall
from gapwalk.errors import ModelError
from gapwalk.measure import read_run_up
from tests.answers.test_run_up import impacting, train

RATE = 5_000.0


def test_orders_of_a_record_in_other_units_are_those_of_the_run_up() -> None:
    """The record is sampled evenly over time, in kN m, deg/s^2 and Hz, with a trace of the speed."""
    system = train(amplitude="20")
    run = gw.ask.run_up(system, SpeedCourse(np.array([0.0, 2.0, 4.0]), np.array([700.0, 1100.0, 700.0])))
    time = np.arange(0.0, 4.0, 1.0 / RATE)
    at = run.at(time)
    rows = np.column_stack(
        (1000.0 * time, at.speed / 60.0, at.signal("clutch.torque") / 1000.0, np.rad2deg(at.signal("clutch''")))
    )
    text = "t (ms); n (Hz); torque (kN m); a (deg/s^2)\n" + "".join(f"{a}; {b}; {c}; {d}\n" for a, b, c, d in rows)
    for signal in ("clutch.torque", "clutch''"):
        record = read_run_up(io.StringIO(text), system, signal)
        legs = record.legs()
        assert [leg.rises for leg in legs] == [True, False]
        for own, leg in zip(run.tracked(signal).legs(), legs, strict=True):
            there, here = (each.waterfall(8.0, 4, over_speed=True) for each in (own, leg))
            place = int(np.argmin(np.abs(there.orders - 2.0)))  # the order of the load
            near = np.interp(there.values, *sorted_by_speed(here, place))
            inside = slice(3, -3)
            assert np.abs(near / there.amplitudes[:, place] - 1.0)[inside].max() < 0.02
            low, high = (each.extremes()[2].max() for each in (own, leg))
            assert high == pytest.approx(low, rel=0.01)


def sorted_by_speed(found: Waterfall, place: int) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(found.values)
    return found.values[order], found.amplitudes[order, place]


def record(time="time", speed="frequency", signal="x", change=lambda rows: rows) -> io.StringIO:
    at = np.linspace(0.0, 100.0, 3001)
    rows = change(np.column_stack((at, np.full_like(at, 0.9), np.cos(0.9 * at))))
    return io.StringIO(f"{time},{speed},{signal}\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))


def test_a_steady_record_has_the_amplitude_of_its_order() -> None:
    found = read_run_up(record(), impacting(), "x")
    assert found.samples == 256
    lines = found.waterfall(3.0, 4, over_speed=False).amplitudes[1]
    assert lines[4] == pytest.approx(1.0, abs=1e-6)
    assert found.speed == pytest.approx(0.9)


def backwards(rows: np.ndarray) -> np.ndarray:
    return np.concatenate((rows[:10], rows[5:]))


def standing(rows: np.ndarray) -> np.ndarray:
    return np.column_stack((rows[:, 0], rows[:, 1] * (np.arange(len(rows)) != 7), rows[:, 2]))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"signal": "force"}, "there is no column 'x'"),
        ({"time": "when"}, "there is no column 'time'"),
        ({"change": backwards}, "time does not increase in line 12"),
        ({"change": standing}, "frequency is 0 in line 9; it must be positive"),
        ({"change": lambda rows: rows[:300]}, "forcing periods; a run-up has 4 at least"),
        ({"change": lambda rows: rows[::60]}, "samples in a forcing period"),
    ],
)
def test_what_is_no_record_of_a_run_up_is_refused(given, words) -> None:
    with pytest.raises(ModelError, match=words):
        read_run_up(record(**given), impacting(), "x")
