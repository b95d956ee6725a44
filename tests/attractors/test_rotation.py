"""Rotation numbers: rigid rotations, the sine circle map, and clouds that have none."""

import numpy as np
import pytest
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import pdist, squareform

from gapwalk.attractors.rotation import _least_length, rotation

GOLDEN = (np.sqrt(5) - 1) / 2


def bent(phases):
    """A closed curve in four dimensions that is neither round nor star-shaped in any plane of two coordinates."""
    t = 2 * np.pi * np.asarray(phases)
    return np.column_stack(
        (
            np.cos(t) + 1.4 * np.cos(2 * t + 0.4),
            np.sin(t) - 0.9 * np.sin(3 * t),
            0.5 * np.cos(t + 1) + np.sin(4 * t),
            3.0 + 1e-3 * np.sin(t),
        )
    )


def sine_circle(omega: float, coupling: float, count: int):
    """Lift of the sine circle map ``x -> x + omega - K / 2 pi sin(2 pi x)``."""
    lift = np.empty(count)
    lift[0] = 0.1
    for k in range(1, count):
        lift[k] = lift[k - 1] + omega - coupling / (2 * np.pi) * np.sin(2 * np.pi * lift[k - 1])
    return lift


@pytest.mark.parametrize("number", [GOLDEN, 0.2 * np.sqrt(2), 1 / 3 + 1e-4, 0.4983, 0.0137])
def test_a_rigid_rotation_on_a_bent_curve(number):
    found = rotation(bent(number * np.arange(4096)))
    assert found is not None
    assert found.curves == 1
    assert found.number == pytest.approx(min(number, 1 - number), abs=1e-8)
    assert abs(found.number - min(number, 1 - number)) <= 10 * found.error + 1e-14
    assert found.roughness < 1.1


def test_the_sine_circle_map_agrees_with_the_mean_of_its_lift():
    lift = sine_circle(0.437, 0.85, 400_000)
    expected = (lift[-1] - lift[0]) / (len(lift) - 1)  # exact to one turn over the length
    found = rotation(bent(lift[:4096]))
    assert found is not None
    assert found.number == pytest.approx(min(expected, 1 - expected), abs=3e-6)


@pytest.mark.parametrize("curves", [2, 3, 7])
def test_several_curves_visited_in_turn(curves):
    phases = 0.2 * np.sqrt(3) * np.arange(6000) / curves
    place = np.arange(6000) % curves
    states = bent(phases) * (0.3 + 0.1 * place[:, None]) + np.column_stack([5.0 * place, place**2, -place, 0 * place])
    found = rotation(states)
    assert found is not None
    assert found.curves == curves
    assert found.number == pytest.approx(
        0.2 * np.sqrt(3), abs=1e-7 if curves > 3 else 1e-8
    )  # the more curves, the fewer strobes on each


def test_the_order_of_the_strobes_is_what_counts():
    states = bent(GOLDEN * np.arange(2048))
    shuffled = np.random.default_rng(2).permutation(states)
    assert rotation(shuffled) is None


def test_a_rotation_that_has_not_gone_round_is_not_guessed():
    # so near to 1/3 that the strobes cover less than the whole curve
    assert rotation(bent((1 / 3 + 1e-5) * np.arange(4096))) is None
    assert rotation(bent((1 / 2 - 2e-5) * np.arange(4096))) is None


@pytest.mark.parametrize(("count", "size"), [(2, 1), (257, 2), (300, 6)])
def test_the_shortest_tree_is_that_of_scipy(count, size):
    states = np.random.default_rng(count).normal(size=(count, size))
    expected = minimum_spanning_tree(squareform(pdist(states))).sum()
    assert _least_length(states) == pytest.approx(expected, rel=1e-12)
    assert _least_length(np.repeat(states, 3, axis=0)) == pytest.approx(expected, rel=1e-12)


def test_a_cloud_has_none():
    random = np.random.default_rng(1)
    assert rotation(random.normal(size=(2048, 4))) is None
    henon = np.zeros((2148, 2))
    for k in range(1, len(henon)):
        x, y = henon[k - 1]
        henon[k] = 1 - 1.4 * x * x + y, 0.3 * x
    assert rotation(henon[100:]) is None


def test_two_frequencies_on_top_of_the_forcing_are_not_one():
    k = np.arange(4096)
    a, b = 2 * np.pi * GOLDEN * k, 2 * np.pi * 0.2 * np.sqrt(2) * k
    assert rotation(np.column_stack((np.cos(a) + np.cos(b), np.sin(a) - 0.8 * np.sin(b)))) is None
