"""Multipliers of products, and their classification."""

from functools import cache

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.orbit import floquet
from gapwalk.orbit.floquet import Instability, classify, largest_move, multipliers


def test_several_segments_give_the_eigenvalues_of_the_product():
    random = np.random.default_rng(3)
    segments = [random.normal(size=(4, 4)) for _ in range(5)]
    product = np.linalg.multi_dot(segments[::-1])
    expected = np.linalg.eigvals(product)
    found = multipliers(segments)
    assert sorted(found, key=abs) == pytest.approx(sorted(expected, key=abs), rel=1e-9)
    assert np.all(np.diff(np.abs(found)) <= 1e-12)


def test_the_small_are_kept_beside_the_huge():
    # 8 segments, each stretching by 100 and shrinking by 1/2: the raw product has 1e16 beside 1/256
    random = np.random.default_rng(5)
    basis = [np.linalg.qr(random.normal(size=(2, 2)))[0] for _ in range(8)]
    segments = [basis[(k + 1) % 8] @ np.diag([100.0, 0.5]) @ basis[k].T for k in range(8)]
    found = multipliers(segments)
    assert abs(found[0]) == pytest.approx(1e16, rel=1e-13)
    assert abs(found[1]) == pytest.approx(2.0**-8, rel=1e-10)


@pytest.mark.parametrize(
    ("values", "expected", "label"),
    [
        ([0.5, -0.9, 0.1j, -0.1j], (0, 0, 0), "stable"),
        ([1.2, 0.3], (1, 0, 0), "above"),
        ([-1.2, 0.3], (0, 1, 0), "below"),
        ([1 + 1j, 1 - 1j, 0.2], (0, 0, 1), "pair"),
        ([-3.0, 2.0, 1 + 1j, 1 - 1j], (1, 1, 1), "below"),
        ([1.0 + 3e-16, 0.5], (0, 0, 0, 1), "neutral"),
        ([0.6 + 0.8j, 0.6 - 0.8j], (0, 0, 0, 2), "neutral"),
        ([1.0 + 3e-8, 1.0 - 3e-8], (0, 0, 0, 2), "neutral"),  # a double root, split by rounding
        ([1.0 - 1e-9, 0.5], (0, 0, 0), "stable"),
        ([1.5, 1.0], (1, 0, 0, 1), "above"),
    ],
)
def test_classification(values, expected, label):
    instability = classify(np.array(values, dtype=complex))
    assert instability == Instability(*expected)
    assert instability.label == label
    assert instability.total == expected[0] + expected[1] + 2 * expected[2]


@cache
def stopped(damping: float) -> gw.System:
    stop, load = gw.stop("stop", {"x": 1.0}, 0.4, 5.0), gw.Harmonic(0.5, {"x": 1.0})
    return gw.System(["x"], [[1.0]], [[damping]], contacts=[stop], harmonics=[load])


@pytest.mark.parametrize("frequency", [0.7, 1.3, 2.2, 3.0])
def test_undamped_motions_are_neutral_and_weakly_damped_ones_are_stable(frequency):
    """By Liouville the product of the multipliers is exp(-2 pi c / W); rounding called half of the undamped stable."""
    for method in (None, gw.Balance()):
        assert gw.find_orbit(stopped(0.0), frequency=frequency, method=method).instability.label == "neutral"
    for damping in (1e-9, 1e-6, 1e-2):
        orbit = gw.find_orbit(stopped(damping), frequency=frequency)
        assert orbit.stable
        product = float(np.prod(orbit.multipliers).real)
        assert -np.log(product) == pytest.approx(2 * np.pi * damping / frequency, rel=1e-4)


def test_motions_of_a_continuum_are_neutral_though_rounding_moves_a_multiplier_off_1():
    """At W = 1/2 with friction (Csernak and Licsko): .99999 from one start, .999986 from another, called stable."""
    friction, load = gw.friction("f", {"x": 1.0}, 0.3), gw.Harmonic(1.0, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], contacts=[friction], harmonics=[load])
    for start in ("settle", "rest"):
        orbit = gw.find_orbit(system, start=start, frequency=0.5)
        assert "neutral" in repr(orbit)
        assert not orbit.stable
        assert 0.0 < 1.0 - orbit.multipliers[0].real < orbit.multiplier_error < 1e-3
    beside = gw.find_orbit(system, frequency=0.4795)
    assert beside.stable
    assert 0.0 < 1.0 - beside.multipliers[0].real < 1e-2


@pytest.mark.parametrize("count", [1, 2, 5, 8, 12])
def test_moves_of_multipliers_are_found_in_any_order(count, monkeypatch):
    random = np.random.default_rng(count)
    # far from one another, so that the nearest is the one that moved
    before = 0.1 * (1.0 + np.arange(count)) * np.exp(2j * np.arange(count))
    shifts = 0.01 * random.random(count)
    after = random.permutation(before + shifts * np.exp(1j * random.normal(size=count)))
    expected = (shifts / np.maximum(1.0, np.minimum(abs(before), abs(before + shifts)))).max()
    assert largest_move(before, after) == pytest.approx(expected, rel=0.01)
    in_numbers_or_arrays = largest_move(before, after)
    monkeypatch.setattr(floquet, "_FEW", 0 if count <= 8 else 100)
    assert largest_move(before, after) == pytest.approx(in_numbers_or_arrays, rel=1e-14)
