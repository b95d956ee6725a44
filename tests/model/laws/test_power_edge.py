"""The edge of fractional powers: impacts against a force of Hertz, beside the closed form and another integrator."""

from __future__ import annotations

import math
from typing import NamedTuple

import heyoka as hy
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import gamma

from gapwalk.model.laws.formula import Formula, formula_of
from gapwalk.model.laws.law import edge_polynomial
from tests.model.laws.symbolic import Passage, move

POWERS = [1.05, 1.5, 2.2, 3.5, 9.5]


class Impact(NamedTuple):
    """An impact of a unit mass against ``k max(x, 0)**p`` at a speed, in closed form."""

    depth: float
    duration: float
    slope: float  # of the duration by the speed


def impact(power: float, stiffness: float, speed: float) -> Impact:
    """Compute an impact by its energy: the speed at a depth x is ``speed * sqrt(1 - (x / depth)**(p + 1))``.

    The integral of its inverse is a beta function; for p = 1.5 the duration is 2.94328 depth / speed (Hertz 1882).
    """
    q = power + 1.0
    depth = (q * speed**2 / (2.0 * stiffness)) ** (1.0 / q)
    duration = 2.0 * depth / speed * math.sqrt(math.pi) * gamma(1.0 / q) / (q * gamma(1.0 / q + 0.5))
    return Impact(depth, duration, duration / speed * (2.0 / q - 1.0))


def hertz(power: float) -> Formula:
    return formula_of(f"k*max(x, 0)**{power}", ("x", "v"))


def bounce(power: float, stiffness: float, speed: float, width: float) -> Passage:
    """Enter the contact at its breakpoint, and leave it."""
    return move(hertz(power), {"k": stiffness, "_edge": width}, (0.0, speed), modes=[1.0, 0.0])


@pytest.mark.parametrize("power", POWERS)
def test_the_polynomial_satisfies_its_conditions(power: float) -> None:
    fit = np.poly1d([*edge_polynomial(power), 0.0])
    assert fit.order == 8
    assert fit(0.0) == 0.0
    ends = [fit(1.0), fit.deriv(1)(1.0), fit.deriv(2)(1.0)]
    assert ends == pytest.approx([1.0, power, power * (power - 1.0)], rel=1e-11, abs=1e-11)
    for moment in range(4):
        assert (fit * np.poly1d([1.0, 0.0]) ** moment).integ()(1.0) == pytest.approx(
            1.0 / (power + moment + 1.0), rel=1e-13
        )
    s = np.linspace(0.0, 1.0, 1001)
    assert np.abs(fit(s) - s**power).max() < 1e-3


def test_the_polynomial_is_the_best_of_its_kind() -> None:
    """A change that keeps all conditions makes the square of the error larger."""
    fit = np.poly1d([*edge_polynomial(1.5), 0.0])
    # zero at 0, three times at 1, and orthogonal to 1, s, s**2, s**3
    rng, s = np.random.default_rng(1), np.poly1d([1.0, 0.0])
    basis = [s ** (j + 1) * (s - 1.0) ** 3 for j in range(5)]
    rows = np.array([[(each * s**m).integ()(1.0) for each in basis] for m in range(4)])
    null = np.linalg.svd(rows)[2][4:]
    for weights in rng.normal(size=(5, 1)):
        change = sum((w * each for w, each in zip(weights @ null, basis, strict=True)), np.poly1d([0.0]))
        inner, _ = quad(lambda z, change=change: (fit(z) - z**1.5) * change(z), 0.0, 1.0, epsabs=1e-15)
        assert abs(inner) < 1e-9 * math.sqrt((change * change).integ()(1.0))


def test_the_duration_is_that_of_hertz() -> None:
    depth, duration, _ = impact(1.5, 1.0, 1.0)
    assert duration / depth == pytest.approx(2.94328, abs=5e-6)
    assert duration == pytest.approx(2.94328 * 1.25**0.4, rel=2e-6)  # (m^2 / (k^2 v))^(1/5) times 3.21803
    assert impact(1.0, 4.0, 0.3).duration == pytest.approx(math.pi / 2.0, rel=1e-15)  # a linear spring: half a period


@pytest.mark.parametrize("speed", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("power", [1.25, 1.5, 2.2, 3.5])
def test_an_impact_is_exact_to_rounding(power: float, speed: float) -> None:
    """The edge is a thousandth of the largest depth, 0.04 of the smallest for p = 1.5, and has no effect on either."""
    width = 1e-3 * impact(power, 50.0, 1.0).depth
    wanted, found = impact(power, 50.0, speed), bounce(power, 50.0, speed, width)
    assert width < 0.2 * wanted.depth
    assert -found.state[1] == pytest.approx(speed, rel=1e-13)
    assert found.time == pytest.approx(wanted.duration, rel=1e-13)
    # at the end x = -v (t - T(v)), and a start at x = dx is a start by dx / v earlier, so the columns are known
    scale = np.array([[1.0, wanted.duration], [speed / wanted.duration, 1.0]])
    exact = np.array([[-1.0, speed * wanted.slope], [0.0, -1.0]])
    np.testing.assert_allclose(found.transition / scale, exact / scale, rtol=0.0, atol=5e-13)
    assert np.linalg.det(found.transition) == pytest.approx(1.0, abs=1e-13)
    assert [index for index, _, time in found.events if time > 0.0] == [1, 1, 0]


@pytest.mark.parametrize(
    ("ratio", "duration", "steps"), [(0.3, 1e-9, 45), (0.1, 1e-12, 45), (0.03, 1e-14, 55), (1e-3, 1e-14, 75)]
)
def test_the_error_falls_with_the_width_of_the_edge(ratio: float, duration: float, steps: int) -> None:
    wanted = impact(1.5, 1.0, 0.1)
    found = bounce(1.5, 1.0, 0.1, ratio * wanted.depth)
    assert found.time == pytest.approx(wanted.duration, rel=duration)
    assert found.steps <= steps


def test_transition_matrices_of_slow_and_fast_impacts_equal_differences() -> None:
    for speed in (0.01, 0.1, 1.0):
        depth, duration, _ = impact(1.5, 50.0, speed)
        numbers, until = {"k": 50.0, "_edge": 1e-3 * impact(1.5, 50.0, 1.0).depth}, 1.5 * duration
        start, formula = (-0.1 * depth, speed), hertz(1.5)
        found = move(formula, numbers, start, until)
        for column, step in enumerate((1e-4 * depth, 1e-4 * speed)):
            ends = []
            for share in (-2, -1, 1, 2):
                shifted = [*start]
                shifted[column] += share * step
                ends.append(move(formula, numbers, (shifted[0], shifted[1]), until).state)
            slope = (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * step)
            scale = np.array([depth, speed]) / (depth, speed)[column]
            np.testing.assert_allclose(found.transition[:, column] / scale, slope / scale, rtol=0.0, atol=1e-9)


DRIVEN = "0.1*v + x + k*max(x - g, 0)**1.5*(1 + 0.2*v) - k*max(-x - g, 0)**1.5"


def driven(width: float) -> Passage:
    formula = formula_of(DRIVEN, ("x", "v"))
    return move(formula, {"k": 40.0, "g": 0.5, "_edge": width}, (0.1, 0.2), 40.0, 1.2 * hy.cos(0.9 * hy.time))


def test_a_motion_with_many_impacts_does_not_depend_on_the_width_of_the_edge() -> None:
    """With damping, a spring and a load, at a depth of 0.2 or so."""
    finest = driven(1e-6)
    assert len(finest.events) > 50
    for width, bound in ((1e-2, 1e-11), (3e-3, 5e-13), (1e-3, 5e-13)):
        found = driven(width)
        np.testing.assert_allclose(found.state, finest.state, rtol=0.0, atol=bound)
        np.testing.assert_allclose(found.transition, finest.transition, rtol=0.0, atol=20.0 * bound)
        assert found.steps < finest.steps


@pytest.mark.slow
def test_a_motion_with_many_impacts_equals_that_of_another_integrator() -> None:

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v = y
        force = 0.1 * v + x + 40.0 * max(x - 0.5, 0.0) ** 1.5 * (1.0 + 0.2 * v) - 40.0 * max(-x - 0.5, 0.0) ** 1.5
        return [v, 1.2 * math.cos(0.9 * t) - force]

    other = solve_ivp(rates, (0.0, 40.0), [0.1, 0.2], method="DOP853", rtol=1e-13, atol=1e-14, max_step=5e-3)
    np.testing.assert_allclose(driven(1e-3).state, other.y[:, -1], rtol=0.0, atol=1e-9)
