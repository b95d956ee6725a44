"""Tables over the speed: against SciPy, complex steps, and what is refused."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from gapwalk.errors import ModelError
from gapwalk.model.measured.measured_table import SpeedTable, speed_table

SPEEDS = np.array([700.0, 1000.0, 1600.0, 2500.0, 4000.0, 6000.0])
VALUES = np.array([30.0, 42.0, 55.0, 55.0, 61.0, 20.0])
TABLE = speed_table(SPEEDS, VALUES, "gas.csv", "rpm")


def test_values_and_slopes_are_those_of_scipy() -> None:
    smooth = PchipInterpolator(SPEEDS, VALUES)
    at = np.concatenate((SPEEDS, np.random.default_rng(0).uniform(700.0, 6000.0, 200)))
    np.testing.assert_allclose(TABLE.value(at), smooth(at), rtol=1e-14)
    np.testing.assert_allclose(TABLE.slope(at), smooth(at, 1), rtol=1e-12, atol=1e-15)
    assert TABLE.value(1600.0) == 55.0
    assert isinstance(float(TABLE.value(800)), float)


@pytest.mark.parametrize("speed", [700.0, 1000.0, 1234.5, 5999.0, 6000.0])
def test_a_complex_step_gives_the_slope(speed: float) -> None:
    step = 1e-40
    assert TABLE.value(speed + 1j * step).imag / step == pytest.approx(TABLE.slope(speed), rel=1e-14)
    second = TABLE.slope(speed + 1j * step).imag / step
    if speed not in SPEEDS:
        near = 1e-3
        assert second == pytest.approx((TABLE.slope(speed + near) - TABLE.slope(speed - near)) / (2 * near), rel=1e-5)


def test_nothing_is_given_outside() -> None:
    with pytest.raises(ModelError, match=r"gas.csv covers 700 to 6000 rpm; it has no value at 6120 rpm. Extend"):
        TABLE.value(6120.0)
    with pytest.raises(ModelError, match="no value at 690 rpm"):
        TABLE.slope(np.array([800.0, 690.0]))
    with pytest.raises(ModelError, match="no value at nan"):
        TABLE.value(np.nan)
    with pytest.raises(ModelError, match="covers 0 to 1; it has no value at 2"):
        SpeedTable((0.0, 1.0), (3.0, 4.0)).value(2.0 + 1e-30j)
    assert TABLE.covers([700.0, 6000.0 * (1.0 + 1e-15)])
    assert not TABLE.covers([700.0, 6001.0])
    assert TABLE.value(6000.0 * (1.0 + 1e-15)) == pytest.approx(20.0)


def test_points_are_sorted_and_equal_tables_are_equal() -> None:
    assert speed_table(SPEEDS[::-1], VALUES[::-1], "gas.csv", "rpm") == TABLE
    assert hash(TABLE) == hash(speed_table(SPEEDS, VALUES, "gas.csv", "rpm"))


@pytest.mark.parametrize(
    ("speeds", "values", "words"),
    [
        ([1.0], [1.0], "there are 1 points; a table has 2 to 1,000"),
        (range(1001), range(1001), "there are 1001 points"),
        ([1.0, 2.0], [1.0], "2 speeds, but 1 values"),
        ([1.0, 1.0, 2.0], [1.0, 2.0, 3.0], "the speed 1 follows 1; speeds must increase"),
        ([1.0, 1.0 + 1e-12, 2.0], [1.0, 2.0, 3.0], "nearly equal"),
        ([1.0, np.nan], [1.0, 2.0], "finite"),
        ([1.0, 2.0], [1.0, 1e300], "below 1e100"),
        (["a", "b"], [1.0, 2.0], "list of numbers"),
        ([[1.0, 2.0]], [1.0, 2.0], "one row"),
    ],
)
def test_what_is_no_table_is_refused(speeds, values, words) -> None:
    with pytest.raises(ModelError, match=words):
        speed_table(speeds, values)
    with pytest.raises(ModelError, match="the speed 1 follows 2"):
        SpeedTable((2.0, 1.0), (1.0, 2.0))
