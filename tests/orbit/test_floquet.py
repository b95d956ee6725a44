"""Multipliers of products, and their classification."""

import numpy as np
import pytest

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
    ],
)
def test_classification(values, expected, label):
    instability = classify(np.array(values, dtype=complex))
    assert instability == Instability(*expected)
    assert instability.label == label
    assert instability.total == expected[0] + expected[1] + 2 * expected[2]


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
