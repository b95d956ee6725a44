"""Curves of springs: against brute force, NumPy and SciPy on random points, and what is refused."""

from dataclasses import replace
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from gapwalk.errors import ModelError
from gapwalk.model.measured import spring_curve as polyline_thinning
from gapwalk.model.measured.spring_curve import MAX_CORNERS, Curve, spring_curve, thin_polyline

SEEDS = range(40)


def points(seed: int, count: int = 9):
    """Random points of a curve with flat, steep and falling parts."""
    random = np.random.default_rng(seed)
    x = np.linspace(-3.0, 4.0, count) + random.uniform(-3.0, 3.0, count) / count
    rises = random.uniform(0.0, 1.0, count) * random.choice([0.01, 1.0, 10.0], count)
    rises[random.integers(count)] *= -1.0
    return x, np.cumsum(rises) - random.uniform(0.0, 5.0)


def reaches(x, y, kept, error: float) -> bool:
    return bool(np.max(np.abs(np.interp(x, x[kept], y[kept]) - y)) <= error)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_smaller_choice_of_points_is_within_the_error(seed: int) -> None:
    x, y = points(seed)
    for error in (0.01, 0.1, 0.3, 1.0):
        kept = thin_polyline(x, y, error, len(x))
        assert kept is not None
        assert (kept[0], kept[-1]) == (0, len(x) - 1)
        assert reaches(x, y, kept, error * (1.0 + 1e-12))
        inner = range(1, len(x) - 1)
        fewest = next(
            2 + count
            for count in range(len(x) - 1)
            if any(reaches(x, y, [0, *chosen, len(x) - 1], error) for chosen in combinations(inner, count))
        )
        assert len(kept) == fewest
        assert thin_polyline(x, y, error, fewest - 1) is None


@pytest.mark.parametrize("seed", range(5))
def test_few_candidates_keep_every_point_within_the_error(seed: int, monkeypatch) -> None:
    random = np.random.default_rng(seed)
    x = np.sort(random.uniform(-2.0, 2.0, 800))
    y = np.interp(x, [-2.0, -1.0, 1.0, 2.0], [-9.0, 0.0, 0.0, 5.0]) + random.uniform(-0.01, 0.01, 800)
    exact = thin_polyline(x, y, 0.03, 50)
    monkeypatch.setattr(polyline_thinning, "EXACT", 100)
    kept = thin_polyline(x, y, 0.03, 50)
    assert exact is not None
    assert kept is not None
    assert reaches(x, y, kept, 0.03)
    assert len(exact) <= len(kept) <= len(exact) + 2


@pytest.mark.parametrize("seed", SEEDS)
def test_a_linear_curve_is_the_polyline(seed: int) -> None:
    x, y = points(seed)
    x -= x[seed % 9] * (seed % 2)  # every other time, a corner is at 0 exactly
    curve = spring_curve(x, y, error=0.0)
    assert curve.thinning_error < 1e-13
    at = np.concatenate((x, np.random.default_rng(seed).uniform(x[0], x[-1], 100)))
    np.testing.assert_allclose(curve.force(at), np.interp(at, x, y), rtol=0.0, atol=1e-13 * np.max(np.abs(y)))
    slopes = np.diff(y) / np.diff(x)
    beyond = np.array([-50.0, 60.0])
    lines = [y[0] + slopes[0] * (-50.0 - x[0]), y[-1] + slopes[-1] * (60.0 - x[-1])]
    np.testing.assert_allclose(curve.force(beyond), lines, rtol=1e-12, atol=1e-12 * np.max(np.abs(y)))
    np.testing.assert_allclose(curve.slope(beyond), slopes[[0, -1]], rtol=1e-10, atol=1e-10)
    curve._check_read()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_cubic_curve_is_that_of_scipy_and_continues_along_lines(seed: int) -> None:
    x, y = points(seed)
    x -= x[seed % 9] * (seed % 2)
    curve = spring_curve(x, y, "cubic", error=0.0)
    smooth = PchipInterpolator(x, y)
    at = np.random.default_rng(seed).uniform(x[0], x[-1], 200)
    scale = np.max(np.abs(y))
    np.testing.assert_allclose(curve.force(at), smooth(at), rtol=0.0, atol=1e-11 * scale)
    for end, far in ((x[0], x[0] - 7.0), (x[-1], x[-1] + 9.0)):
        slope = smooth(end, 1)
        assert curve.slope(far) == pytest.approx(slope, abs=1e-10 * scale)
        assert curve.force(far) == pytest.approx(smooth(end) + slope * (far - end), abs=1e-9 * scale)
    assert all(each.step == each.slope == 0.0 for each in curve.corners)
    curve._check_read()


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_derivatives_are_exact(kind) -> None:
    x = np.linspace(-2.0, 3.0, 30)
    curve = spring_curve(x, np.sinh(x), kind, 1e-4)
    at = np.random.default_rng(0).uniform(-3.0, 4.0, 100)
    step = 1e-30
    np.testing.assert_allclose(np.imag(curve.force(at + 1j * step)) / step, curve.slope(at), rtol=1e-12, atol=1e-12)
    near = 1e-6
    np.testing.assert_allclose((curve.force(at + near) - curve.force(at - near)) / (2 * near), curve.slope(at), 1e-4)
    assert isinstance(float(curve.force(0.5)), float)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_the_sum_over_corners_loses_no_digits(kind) -> None:
    """Against the same record in exact fractions: the changes of many corners cancel, but from 0 outwards few do."""
    x = np.linspace(-20.0, 20.0, 401)
    curve = spring_curve(x, 30.0 * np.tanh(x / 8.0) + x**3 / 900.0, kind, 3e-4)
    assert len(curve.corners) > 10
    worst = 0.0
    for at in np.linspace(-24.0, 24.0, 97):
        exact = sum((Fraction(c) * Fraction(at) ** power for power, c in enumerate(curve.base)), Fraction(0))
        for corner in curve.corners:
            depth = Fraction(at) - Fraction(corner.position)
            if corner.side * depth > 0:
                exact += sum((Fraction(c) * depth**power for power, c in enumerate(corner.change)), Fraction(0))
        worst = max(worst, abs(float(exact - Fraction(float(curve.force(at))))))
    assert worst < 1e-14 * 40.0


def test_the_error_is_that_at_all_points_and_within_what_was_asked() -> None:
    x = np.linspace(-2.0, 3.0, 3000)
    y = np.sinh(x)
    for kind in ("linear", "cubic"):
        counts = []
        for error in (1e-2, 1e-3, 3e-4):
            curve = spring_curve(x, y, kind, error)
            assert curve.thinning_error <= error
            assert curve.thinning_error == np.max(np.abs(curve.force(x) - y)) / np.max(y)
            assert curve.points == 3000
            counts.append(len(curve.corners))
        assert counts == sorted(counts)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_too_many_corners_are_refused_with_an_error_that_suffices(kind) -> None:
    x = np.linspace(0.0, 40.0, 500)
    y = np.sin(x) + 0.2 * x
    with pytest.raises(ModelError, match="needs more than 50 corners; write error = ") as caught:
        spring_curve(x, y, kind, 1e-9)
    written = float(str(caught.value).split("write error = ")[1].split(",", maxsplit=1)[0])
    curve = spring_curve(x, y, kind, written)
    assert curve.thinning_error <= written
    assert MAX_CORNERS // 2 <= len(curve.corners) <= MAX_CORNERS


def test_noise_is_no_curve() -> None:
    random = np.random.default_rng(0)
    with pytest.raises(ModelError, match="these points are noise, and no curve"):
        spring_curve(np.arange(400.0), random.choice([-1.0, 1.0], 400))


@pytest.mark.parametrize("at", [-1.0, 0.0, 1.5])
def test_two_points_at_one_deflection_are_a_step(at: float) -> None:
    x = np.array([-2.0, at, at, 3.0])
    y = np.array([-4.0, -1.0, 2.0, 7.0])
    curve = spring_curve(x, y)
    (corner,) = curve.corners
    assert (corner.position, corner.side) == (at, -1 if at < 0.0 else 1)
    assert corner.step == corner.side * 3.0
    tiny = 1e-9
    assert curve.force(at - tiny) == pytest.approx(-1.0, abs=1e-7)
    assert curve.force(at + tiny) == pytest.approx(2.0, abs=1e-7)
    assert curve.force(at) == pytest.approx(2.0 if at < 0.0 else -1.0)  # on the inner side
    assert curve.force(-2.0) == pytest.approx(-4.0)
    assert curve.force(3.0) == pytest.approx(7.0)
    assert spring_curve(x[::-1], y[::-1]) == curve  # written from the right to the left
    with pytest.raises(ModelError, match='a cubic curve is smooth; write kind = "linear"'):
        spring_curve(x, y, "cubic")


@pytest.mark.parametrize("kind", ["linear", "cubic"])
@pytest.mark.parametrize("centre", [True, False])
def test_the_same_on_both_sides_stays_the_same_exactly(kind, centre: bool) -> None:
    right = np.sort(np.random.default_rng(3).uniform(0.1, 5.0, 60))
    x = np.concatenate((-right[::-1], [0.0] * centre, right))
    curve = spring_curve(x, np.sinh(x) * (1.0 + 1e-15), kind)
    at = np.random.default_rng(4).uniform(0.0, 7.0, 50)
    np.testing.assert_array_equal(curve.force(-at), -curve.force(at))
    positions = [each.position for each in curve.corners]
    assert positions == [-each for each in reversed(positions)]
    assert curve.thinning_error <= 1e-3


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_what_rounding_makes_different_on_both_sides_is_the_same(kind) -> None:
    x = np.linspace(-1.0, 1.0, 4000)
    assert not np.array_equal(x, -x[::-1])
    curve = spring_curve(x, np.sinh(3.0 * x), kind)
    positions = [each.position for each in curve.corners]
    assert positions == [-each for each in reversed(positions)]
    assert curve.thinning_error <= 1e-3
    third = 1.0 / 3.0
    steps = spring_curve(
        [-1.0, -third, -third, third * (1.0 + 2e-16), third * (1.0 + 2e-16), 1.0], [-4, -3, -1, 1, 3, 4]
    )
    assert [each.step for each in steps.corners] == [-2.0, 2.0]
    assert steps.thinning_error < 1e-15


def test_steps_on_both_sides_stay_the_same_exactly() -> None:
    x, y = [-3.0, -1.0, -1.0, 1.0, 1.0, 3.0], [-9.0, -5.0, -0.1, 0.1, 5.0, 9.0]
    curve = spring_curve(x, y)
    assert [(each.position, each.step) for each in curve.corners] == [(-1.0, -4.9), (1.0, 4.9)]
    middle = spring_curve([-1.0, 0.0, 0.0, 1.0], [-3.0, -2.0, 2.0, 3.0])
    assert middle.base == (-2.0, 1.0, 0.0, 0.0)
    assert [(each.position, each.step, each.slope) for each in middle.corners] == [(0.0, 4.0, 0.0)]


def test_a_range_beside_zero_is_continued_along_its_first_line() -> None:
    curve = spring_curve([2.0, 3.0, 4.0], [1.0, 3.0, 4.0])
    assert curve.base == (-3.0, 2.0, 0.0, 0.0)
    assert [(each.position, each.side, each.slope) for each in curve.corners] == [(3.0, 1, -1.0)]
    left = spring_curve([-4.0, -3.0, -2.0], [-4.0, -3.0, -1.0])
    assert [(each.position, each.side, each.slope) for each in left.corners] == [(-3.0, -1, -1.0)]
    assert curve.covers([2.0, 4.0])
    assert not curve.covers(4.1)


def test_repeated_and_agreeing_measurements_are_one_curve() -> None:
    x = np.array([-2.0, 0.0, 1.0, 1.0, 2.0])
    curve = spring_curve(x, [-2.0, 0.0, 0.9999, 1.0001, 2.0])
    np.testing.assert_allclose(curve.force(x), x, atol=2e-3)
    to_and_fro = np.concatenate((np.linspace(-2.0, 2.0, 41), np.linspace(1.95, -1.95, 40)))
    both = spring_curve(to_and_fro, np.sinh(to_and_fro))
    assert both.thinning_error <= 1e-3
    np.testing.assert_allclose(both.force(to_and_fro), np.sinh(to_and_fro), atol=1.01e-3 * np.sinh(2.0))


LOOP = np.concatenate((np.linspace(-2.0, 2.0, 41), np.linspace(1.9, -2.0, 40)))


@pytest.mark.parametrize(
    ("x", "y", "options", "words"),
    [
        (LOOP, LOOP + 0.2 * np.sign(np.gradient(LOOP)), {}, "two branches .* differ by 0.4 .* give the mean curve"),
        (np.sort(LOOP), (LOOP + 0.2 * np.sign(np.gradient(LOOP)))[np.argsort(LOOP)], {}, "rises and falls|two points"),
        (
            np.linspace(-2.0, 2.0, 24),
            np.linspace(-9.0, 9.0, 24) + 0.2 * (-1.0) ** np.arange(24),
            {},
            "bends up and down 21 times in turn",
        ),
        (np.tile([0.0, 1.0, 2.0], 4), np.arange(12.0), {}, "changes its direction 6 times; sort the lines"),
        (
            [0.0, 1.0, 1.0, 1.0, 2.0],
            [0.0, 1.0, 2.0, 3.0, 4.0],
            {},
            "3 points at the deflection 1, with forces from 1 to",
        ),
        (np.repeat(np.arange(7.0), 2)[1:-1], np.arange(12.0), {}, "at 5 deflections there are two points"),
        ([0.0, 0.0, 1.0], [-5.0, 5.0, 9.0], {}, "a step at its end, at the deflection 0; a step needs a point on each"),
        ([0.0, 1.0, 1.0], [-5.0, 5.0, 9.0], {}, "a step at its end, at the deflection 1"),
        ([1.0, 1.0], [1.0, 2.0], {}, "two different deflections"),
        ([1.0], [1.0], {}, "two different deflections"),
        ([], [], {}, "two different deflections"),
        ([0.0, 1.0], [0.0, 0.0], {}, "the force is zero at all points"),
        ([0.0, 1.0, 2.0], [0.0, 1.0], {}, "3 deflections, but 2 forces"),
        ([0.0, np.nan], [0.0, 1.0], {}, "finite numbers"),
        (["a", "b"], [0.0, 1.0], {}, "list of numbers"),
        ([0.0, 1e-300, 1.0], [0.0, 1.0, 2.0], {}, "a step at its end"),
        ([0.0, 1.0], [0.0, 1e200], {}, "too large or too small"),
        ([0.0, 1e-200], [0.0, 1.0], {}, "too large or too small"),
        (
            [0.0, 1.0, 1.0 + 1e-7, 5.0],
            [0.0, 1.0, 3.0, 4.0],
            {},
            "some points are very close .* at 1 and 1.0000001; give",
        ),
        ([-1e308, 1e308], [0.0, 1.0], {}, "too large"),
        ([0.0, 1.0], [0.0, 1.0], {"kind": "spline"}, '\'spline\'; a curve is "linear" or "cubic"'),
        ([0.0, 1.0], [0.0, 1.0], {"error": -1.0}, "error is -1.0; it must be a number from 0 to 0.5"),
        ([0.0, 1.0], [0.0, 1.0], {"error": True}, "error is True"),
        ([0.0, 1.0], [0.0, 1.0], {"error": float("nan")}, "error is nan"),
        ([0.0, 1.0], [0.0, 1.0], {"error": 0.6}, "from 0 to 0.5"),
    ],
)
def test_what_is_no_curve_is_refused(x, y, options, words) -> None:
    with pytest.raises(ModelError, match=words):
        spring_curve(x, y, **options)


def test_a_curve_is_a_value() -> None:
    curve = spring_curve([-4, -2, 2, 4], [-10, 0, 0, 10])
    assert hash(curve) == hash(spring_curve([-4, -2, 2, 4], [-10, 0, 0, 10]))
    assert isinstance(curve, Curve)
    assert curve.words == "linear, 2 corners, within 0 % of the largest force at 4 points"
    assert "1 corners, 1 of them with a step" in spring_curve([-1, 0, 0, 1], [-3, -2, 2, 3]).words
    for wrong in (
        replace(curve, base=(0.0, np.nan, 0.0, 0.0)),
        replace(curve, corners=curve.corners[::-1]),
        replace(curve, corners=tuple(replace(each, side=-each.side) for each in curve.corners)),
        replace(curve, first=9.0),
    ):
        with pytest.raises(ValueError, match="curve"):
            wrong._check_read()
