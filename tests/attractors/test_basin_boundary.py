"""Edge states, manifolds of saddles, their homoclinic tangency, and the exponent of boundaries."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.attractors.basins import Uncertainty
from tests.computed import once

DAMPING = 0.1


def wells(amplitude: float) -> gw.System:
    return gw.System(
        ["x"],
        stiffness=[[0.0]],
        damping=[[DAMPING]],
        contacts=[gw.force("well", {"x": 1.0}, "x**3 - x")],
        harmonics=[gw.Harmonic(amplitude, {"x": 1.0})],
        frequency=1.0,
    )


def strobe(amplitude: float, state: np.ndarray, periods: float) -> np.ndarray:
    def right(t: float, y: np.ndarray) -> list[float]:
        return [y[1], y[0] - y[0] ** 3 - DAMPING * y[1] + amplitude * np.cos(t)]

    return solve_ivp(right, (0.0, 2.0 * np.pi * periods), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@once
def manifolds(amplitude: float) -> tuple:
    saddle = gw.find_orbit(wells(amplitude), start=np.array([-0.5 * amplitude, 0.0]))
    found = [gw.analysis.manifold(saddle, which, 4.2, accuracy=1e-5) for which in ("unstable", "stable")]
    return (*found, found[0].crossings(found[1]))


def test_points_of_manifolds_come_from_the_saddle_and_go_there() -> None:
    unstable, stable, _ = manifolds(0.0750)
    assert unstable.multiplier * stable.multiplier == pytest.approx(math.exp(-2.0 * math.pi * DAMPING), rel=1e-9)
    saddle = unstable.orbit.state
    for manifold, sign in ((unstable, -1.0), (stable, 1.0)):
        for side in (manifold.first, manifold.second):
            # the last point belongs to the line to the accuracy, and is less than three periods from the first piece
            assert np.linalg.norm(strobe(0.0750, side[-1], 3.0 * sign) - saddle) < 2e-3
    assert min(*unstable.lengths, *stable.lengths) >= 4.2


def test_both_manifolds_in_one_picture_have_one_legend() -> None:
    unstable, stable, _ = manifolds(0.0750)
    figure = unstable.plot().figure
    stable.plot(ax=figure.axes[0])
    (legend,) = figure.legends
    assert [each.get_text() for each in legend.get_texts()] == ["unstable manifold", "stable manifold", "saddle"]


def test_the_homoclinic_tangency_is_between_melnikovs_value_and_one_part_in_a_thousand_above() -> None:
    melnikov = 4.0 * DAMPING / 3.0 * math.cosh(0.5 * math.pi) / (math.sqrt(2.0) * math.pi)
    assert melnikov == pytest.approx(0.0753, abs=5e-5)
    *_, before = manifolds(melnikov)
    *_, beyond = manifolds(1.001 * melnikov)
    assert len(before) == 0
    assert len(beyond) == 4  # a pair on each side
    unstable = manifolds(1.001 * melnikov)[0]
    for state in beyond:  # by another integrator each is homoclinic to the saddle
        for periods in (1.0, -1.0):
            assert np.linalg.norm(strobe(1.001 * melnikov, state, periods) - unstable.orbit.state) < 0.1


def test_the_edge_state_between_two_wells_is_the_saddle() -> None:
    found = gw.analysis.edge_state(wells(0.05), np.array([-1.0, 0.0]), np.array([1.0, 0.0]))
    assert abs(found.multipliers[0]) > 1.0 > abs(found.multipliers[1])
    np.testing.assert_allclose(strobe(0.05, found.state, 1.0), found.state, atol=1e-9)
    with pytest.raises(gw.errors.ModelError, match="both states lead to one motion"):
        gw.analysis.edge_state(wells(0.05), np.array([0.9, 0.0]), np.array([1.0, 0.0]))


def test_a_manifold_that_is_none_is_refused() -> None:
    system = wells(0.05)
    with pytest.raises(gw.errors.ModelError, match="0 multipliers outside"):
        gw.analysis.manifold(gw.settle(system, start=[1.0, 0.0]).orbit)
    saddle = gw.find_orbit(system, start=np.array([-0.025, 0.0]))
    with pytest.raises(gw.errors.ModelError, match='write "stable" or "unstable"'):
        gw.analysis.manifold(saddle, "both")  # type: ignore[arg-type]


def test_what_depends_on_rates_is_not_followed_backwards() -> None:
    drag = gw.force("drag", {"x": 1.0}, "x**3 - x + 0.3*v*abs(v)")
    system = gw.System(
        ["x"], stiffness=[[0.0]], contacts=[drag], harmonics=[gw.Harmonic(0.05, {"x": 1.0})], frequency=1.0
    )
    saddle = gw.find_orbit(system, start=np.array([-0.025, 0.0]))
    with pytest.raises(gw.errors.ModelError, match="cannot be followed backwards"):
        gw.analysis.manifold(saddle, "stable", 4.0)


def test_limits_of_the_uncertainty_exponent_hold_the_right_value() -> None:
    random, inside = np.random.default_rng(4), 0
    x = np.linspace(-1.0, 1.0, 257)
    for _ in range(40):  # random smooth curves: some are bent within few cells
        height = np.zeros((257, 257))
        for a, b in 4.0 * random.normal(size=(6, 2)):
            height += random.normal() * np.cos(a * x[:, None] + b * x[None, :] + random.uniform(0.0, 6.0))
        found = Uncertainty.of((height > 0.0).astype(int), 0.95)
        inside += found.low <= 1.0 <= found.high
    assert inside >= 36


def test_the_uncertainty_exponent_of_a_line_and_of_a_cantor_set() -> None:
    x = np.linspace(-1.0, 1.0, 243 * 3)
    circle = (np.hypot(x[:, None], x[None, :]) < 0.6).astype(int)
    found = Uncertainty.of(circle, 0.95)
    assert found.exponent == pytest.approx(1.0, abs=0.01)
    assert found.low <= 1.0 <= found.high < found.low + 0.03
    # stripes whose edges are a Cantor set of middle thirds, along the diagonal: exponent 1 - log 2/log 3
    place = (np.add.outer(np.arange(729), np.arange(729)) % 729) / 729.0
    label = np.zeros_like(place, dtype=int)
    rest = place.copy()
    for level in range(1, 6):
        digit = np.floor(3.0 * rest).astype(int)
        label = np.where((label == 0) & (digit == 1), level, label)
        rest = 3.0 * rest - digit
    found = Uncertainty.of(label % 2 + 2 * (label > 0), 0.95)
    assert found.exponent == pytest.approx(1.0 - math.log(2.0) / math.log(3.0), abs=0.1)
    assert found.dimension == 2.0 - found.exponent
    with pytest.raises(gw.errors.ModelError, match="no boundary"):
        Uncertainty.of(np.zeros((64, 64), dtype=int), 0.95)
