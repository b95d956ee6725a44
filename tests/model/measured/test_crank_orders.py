"""Orders over the angle of a shaft: against closed forms, quadrature by SciPy, random series; what is refused."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from gapwalk.errors import ModelError
from gapwalk.model.measured.crank_orders import OrderTable, displacement_orders, orders_of

TURN = 2.0 * math.pi


def series(random, turns: int, highest: int = 6):
    """A random series: its mean, and by harmonic of the period a cosine and a sine."""
    mean, parts = random.normal(0.0, 10.0), random.normal(0.0, 5.0, (highest, 2))

    def value(angle, derivative: int = 0):
        total = np.full(np.shape(angle), 0.0 if derivative else mean)
        for place, (cosine, sine) in enumerate(parts):
            order = (place + 1) / turns
            part = (cosine - 1j * sine) * (1j * order) ** derivative
            total = total + np.real(part * np.exp(1j * order * np.asarray(angle)))
        return total

    return mean, parts, value


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("closed", [True, False])
def test_even_samples_give_back_a_series(seed: int, closed: bool) -> None:
    random = np.random.default_rng(seed)
    turns = 1 + seed % 2
    mean, parts, value = series(random, turns)
    begin = random.uniform(-9.0, 9.0)
    count = int(random.integers(14, 80))
    angle = begin + np.arange(count + closed) * (TURN * turns / count)
    table = orders_of(angle, value(angle), per=("turn", "cycle")[turns - 1], error=0.0)
    assert table.mean == pytest.approx(mean, abs=1e-13 * 40)
    assert table.orders == tuple(k / turns for k in range(1, 7))
    np.testing.assert_allclose([(each.cosine, each.sine) for each in table.lines], parts, atol=1e-12)
    assert table.left_out < 1e-14
    assert (table.turns, table.samples, table.is_even) == (turns, count, True)
    at = random.uniform(-20.0, 20.0, 30)
    np.testing.assert_allclose(table.value(at), value(at), atol=1e-11)
    table._check_read()


@pytest.mark.parametrize("seed", range(6))
def test_orders_of_a_polyline_are_its_fourier_integrals(seed: int) -> None:
    random = np.random.default_rng(seed)
    turns, begin = 1 + seed % 2, random.uniform(-3.0, 3.0)
    period = TURN * turns
    angle = begin + np.sort(random.uniform(0.0, period, 8))
    angle[0], angle[-1] = begin, begin + period * (1.0 if seed % 3 else 0.97)  # a gap is completed
    torque = random.normal(5.0, 10.0, 8)
    torque[-1] = torque[0]
    nodes, levels = np.append(angle, begin + period), np.append(torque, torque[0])
    wanted = [1 / turns, 2, 2.5 if turns == 2 else 3, 7]
    table = orders_of(angle, torque, orders=wanted, per=("turn", "cycle")[turns - 1])
    assert not table.is_even

    def integral(weight) -> float:
        return sum(quad(weight, a, b, epsabs=1e-13)[0] for a, b in pairwise(nodes) if b > a)

    def line(x: float) -> float:
        return float(np.interp(x, nodes, levels))

    assert table.mean == pytest.approx(integral(line) / period, abs=1e-11)
    for each in table.lines:
        cosine = integral(lambda x, order=each.order: line(x) * math.cos(order * x))
        sine = integral(lambda x, order=each.order: line(x) * math.sin(order * x))
        assert each.cosine == pytest.approx(2.0 / period * cosine, abs=1e-11)
        assert each.sine == pytest.approx(2.0 / period * sine, abs=1e-11)
    assert table.orders == tuple(sorted(map(float, wanted)))
    square = integral(lambda x: (line(x) - table.mean) ** 2)
    share = 1.0 - sum(each.energy for each in table.lines) * period / square
    assert table.left_out == pytest.approx(share, abs=1e-10)


def test_a_jump_is_a_rectangle() -> None:
    """Its sines are 4 / (pi k), for odd k."""
    angle = np.array([0.0, 0.0, math.pi, math.pi, TURN])
    table = orders_of(angle, [-1.0, 1.0, 1.0, -1.0, -1.0], error=0.01)
    assert table.orders == tuple(range(1, 2 * len(table.lines), 2))
    np.testing.assert_allclose(
        [each.sine for each in table.lines], [4 / (math.pi * k) for k in table.orders], rtol=1e-12
    )
    np.testing.assert_allclose([each.cosine for each in table.lines], 0.0, atol=1e-13)
    left = 1.0 - sum(8.0 / (math.pi * k) ** 2 for k in table.orders)
    assert table.left_out == pytest.approx(left, abs=1e-13)
    assert left <= 0.01 < left + table.lines[-1].energy


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("even", [True, False])
def test_the_fewest_orders_within_the_share_are_kept(seed: int, even: bool) -> None:
    random = np.random.default_rng(seed)
    angle = np.linspace(0.0, TURN, 65)
    if not even:
        angle[1:-1] += random.uniform(-0.03, 0.03, 63)
    _, _, value = series(random, 1, 20)
    every = orders_of(angle, value(angle), orders=list(range(1, 31)))
    assert every.is_even is even
    energies = np.sort([each.energy for each in every.lines])[::-1]
    total = energies.sum() / (1.0 - every.left_out)
    for error in (0.3, 0.1, 0.01):
        table = orders_of(angle, value(angle), error=error)
        assert table.left_out <= error
        low, strong = table.low_left[0], max(table.lines, key=lambda each: each.energy).order
        assert low not in table.orders
        assert low < strong
        assert len(table.lines) == 1 + np.flatnonzero(1.0 - np.cumsum(energies) / total <= error)[0]
        assert 1.0 - sum(each.energy for each in table.lines) / total == pytest.approx(table.left_out, abs=1e-12)


def test_too_many_orders_are_refused_with_an_error_that_suffices() -> None:
    angle, torque = [0.0, 0.0, 1.0, 1.0, TURN], [-1.0, 1.0, 1.0, -1.0, -1.0]
    with pytest.raises(
        ModelError, match=r"more than 100 orders .* 0.0001 of the energy is left out; write error = "
    ) as caught:
        orders_of(angle, torque)
    written = float(str(caught.value).split("write error = ")[1].split(",", maxsplit=1)[0])
    assert orders_of(angle, torque, error=written).left_out <= written


def test_the_error_of_lines_between_uneven_samples_is_estimated() -> None:
    angle = np.linspace(0.0, TURN, 91)
    angle[1:-1] += np.random.default_rng(0).uniform(-0.001, 0.001, 89)
    table = orders_of(angle, 7.0 * np.cos(5.0 * angle))
    assert (table.orders, table.is_even) == ((5.0,), False)
    assert 1.0 - table.lines[0].cosine / 7.0 == pytest.approx(table.lines_error, rel=0.05)
    assert "orders 5, which leave out" in table.words
    assert "change the highest one by about 1 %" in table.words
    assert orders_of(np.linspace(0.0, TURN, 91), np.ones(91)).lines_error == 0.0


def test_coarse_samples_are_refused_as_such() -> None:
    angle = np.linspace(0.0, TURN, 9)
    with pytest.raises(
        ModelError, match=r"resolve orders up to 3, and 0.33 of the energy .* error = 0.34, or give more"
    ):
        orders_of(angle, np.cos(4.0 * angle) + np.sqrt(2.0) * np.cos(angle))
    with pytest.raises(ModelError, match=r"resolve orders up to 3, and 1 of the energy .* 0.0001; give more samples"):
        orders_of(angle, np.cos(4.0 * angle))


def test_a_constant_has_no_orders_and_scales_do_not_matter() -> None:
    angle = np.linspace(0.0, TURN, 37)
    table = orders_of(angle, np.full(37, 7.0))
    assert (table.mean, table.lines, table.left_out) == (7.0, (), 0.0)
    assert orders_of(angle, np.zeros(37)).lines == ()
    assert orders_of(angle[angle != angle[5]], np.full(36, 7.0)).lines == ()
    small, large = (orders_of(angle, 3.0 + np.cos(3.0 * angle) * size + size, error=0.0) for size in (1e-6, 1e6))
    assert small.orders == large.orders == (3.0,)
    tiny = orders_of(angle, 1e-60 * np.cos(3.0 * angle))
    assert tiny.orders == (3.0,)
    assert tiny.lines[0].cosine == pytest.approx(1e-60, rel=1e-12)


def test_numbers_that_were_rounded_in_a_file_are_even_ones() -> None:
    angle = np.round(np.arange(217) * (360.0 / 216.0), 2)
    torque = 50.0 * np.cos(np.radians(2.0 * angle)) + 20.0
    table = orders_of(np.radians(angle), np.round(torque, 3))
    assert table.is_even
    assert table.orders == (2.0,)
    assert table.lines[0].cosine == pytest.approx(50.0, abs=1e-2)


@pytest.mark.parametrize(
    ("angle", "torque", "options", "words"),
    [
        (np.linspace(0, TURN, 9), range(9), {}, "do not end as they begin: 0 at 0 deg, but 8 a period later"),
        (np.linspace(0, 2 * TURN, 721), np.zeros(721), {}, 'from 0 deg to 720 deg, which is not a turn.*"cycle"'),
        (
            np.linspace(0, TURN, 361),
            np.zeros(361),
            {"per": "cycle"},
            r'not a cycle of two turns \(720 deg\).* per = "turn"',
        ),
        (np.linspace(0, 5, 50), np.zeros(50), {}, "nor one sample less; give the samples of one period"),
        (np.linspace(0, 700, 50), np.zeros(50), {}, "give the samples of one period"),
        ([0.0, 2.0, 1.0, 6.0], np.zeros(4), {}, r"does not increase from sample 2 \(114.592 deg\) to sample 3"),
        ([0.0, 3.0, 6.0, 0.2], np.zeros(4), {}, "if it begins again from 0 after a turn, add a turn"),
        ([0.0, 1.0, 1.0, 1.0, TURN], np.zeros(5), {}, "three samples at 57.2958 deg"),
        ([0.0, TURN], [1.0, 1.0], {}, "2 samples; a period needs 3"),
        ([0.0, 1.0, TURN], [1.0, 1.0], {}, "3 angles, but 2 values"),
        ([0.0, 1.0, np.inf], np.zeros(3), {}, "finite"),
        (
            np.delete(np.linspace(0, TURN, 361), np.s_[4:38]),
            np.sin(np.delete(np.linspace(0, TURN, 361), np.s_[4:38])),
            {},
            "samples are missing from 3 deg to 38 deg: the other steps are 1 deg",
        ),
        ([0.0, 1.0, 1e9], np.zeros(3), {}, "too large"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"per": "stroke"}, "per is 'stroke'"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"error": 1.0}, "error is 1.0; it must be a number >= 0 and < 1"),
        (
            np.linspace(0, TURN, 9),
            np.cos(np.linspace(0, TURN, 9)),
            {"orders": [4]},
            "resolve orders up to 3; order 4 needs",
        ),
        (np.linspace(0, TURN, 9), np.zeros(9), {"orders": [0.5]}, 'orders are whole numbers; with per = "cycle"'),
        (np.linspace(0, 2 * TURN, 9), np.zeros(9), {"orders": [0.3], "per": "cycle"}, "multiples of 0.5"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"orders": [0]}, "the order 0 is none"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"orders": [True]}, "the order True is none"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"orders": ["1"]}, "the order '1' is none"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"orders": []}, "orders is .*; it is a list"),
        (np.linspace(0, TURN, 9), np.zeros(9), {"orders": [1, 1.0]}, "an order occurs twice"),
    ],
)
def test_what_has_no_orders_is_refused(angle, torque, options, words) -> None:
    with pytest.raises(ModelError, match=words):
        orders_of(angle, torque, **options)


@pytest.mark.parametrize("seed", range(5))
def test_an_acceleration_is_integrated_twice(seed: int) -> None:
    random = np.random.default_rng(seed)
    turns, speed = 1 + seed % 2, random.uniform(1.0, 200.0)
    per = ("turn", "cycle")[turns - 1]
    mean, parts, value = series(random, turns)
    angle = np.linspace(0.0, TURN * turns, 100)
    table = displacement_orders(angle, acceleration=speed**2 * value(angle, 2), speed=speed, per=per, error=0.0)
    np.testing.assert_allclose([(each.cosine, each.sine) for each in table.lines], parts, atol=1e-11)
    assert table.mean == 0.0
    same = displacement_orders(angle, displacement=value(angle), per=per, error=0.0)
    assert same.mean == pytest.approx(mean)
    np.testing.assert_allclose([(each.cosine, each.sine) for each in same.lines], parts, atol=1e-11)


def test_an_acceleration_with_a_mean_is_refused() -> None:
    angle = np.linspace(0.0, TURN, 100)
    acceleration = np.cos(angle)
    assert displacement_orders(angle, acceleration=acceleration + 0.005, speed=2.0).lines[0].cosine == pytest.approx(
        -0.25
    )
    with pytest.raises(
        ModelError, match=r"mean acceleration is 0.1, but its effective value 0.7.*offset of the sensor"
    ):
        displacement_orders(angle, acceleration=acceleration + 0.1, speed=2.0)
    with pytest.raises(ModelError, match="mean acceleration is 1, but"):
        displacement_orders(angle, acceleration=np.ones(100), speed=2.0)
    with pytest.raises(ModelError, match="speed is None; an acceleration needs the speed"):
        displacement_orders(angle, acceleration=acceleration)
    with pytest.raises(ModelError, match="give one of them"):
        displacement_orders(angle)
    with pytest.raises(ModelError, match="give one of them"):
        displacement_orders(angle, displacement=angle, acceleration=angle, speed=1.0)


def test_a_table_is_a_value_and_damaged_ones_are_found() -> None:
    angle = np.linspace(0.0, TURN, 37)
    table = orders_of(angle, np.cos(2 * angle))
    assert hash(table) == hash(orders_of(angle, np.cos(2 * angle)))
    for wrong in (
        OrderTable(3, 0.0, (), 0.0, 9, True),
        OrderTable(1, math.nan, (), 0.0, 9, True),
        OrderTable(1, 0.0, table.lines * 2, 0.0, 9, True),
    ):
        with pytest.raises(ValueError, match="a table"):
            wrong._check_read()
