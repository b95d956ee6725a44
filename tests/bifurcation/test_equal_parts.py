"""Several multipliers that become critical at once, in machines with equal parts."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.flow.symmetry import Symmetry, symmetries_of
from tests.bifurcation.equal_parts import equal_parts, ring


def edge(square: float, low: float, high: float, damping: float = 0.02, depth: float = 0.3) -> float:
    """Return the frequency in a bracket at which a multiplier of ``x'' + c x' + (w^2 +- e) x = 0`` is -1."""

    def distance(frequency: float) -> float:
        half = np.pi / frequency
        parts = [expm(np.array([[0.0, 1.0], [-(square + sign * depth), -damping]]) * half) for sign in (1.0, -1.0)]
        return float(np.linalg.det(parts[0] @ parts[1] + np.eye(2)))

    return brentq(distance, low, high, xtol=1e-14)


@pytest.mark.parametrize(("count", "words"), [(3, "double flip"), (4, "triple flip")])
def test_a_flip_of_equal_modes_is_found_located_and_named(count, words):
    system = ring(count)
    square = 1.0 + 0.2 * count
    edges = [edge(square, low, high) for low, high in ((2.0 * square**0.5, 3.2), (2.0, 2.0 * square**0.5))]
    first = 1.03 * max(edges)
    branch = gw.follow(gw.find_orbit(system, frequency=first), "frequency", 0.98 * min(edges))
    assert [each.words["kind"] for each in branch.special_points] == [words, words]
    assert [each.value for each in branch.special_points] == pytest.approx(edges, abs=1e-11)
    assert max(each.uncertainty for each in branch.special_points) < 1e-10
    assert [each.after.total for each in branch.special_points] == [count - 1, 0]
    assert f"({words} at" in repr(branch.special_points[0])
    assert not branch.unexplained


def test_random_systems_with_two_equal_parts_have_that_symmetry():
    rng = np.random.default_rng(0)
    for _ in range(5):
        assert Symmetry((1, 0), (1, 1), 0.0) in symmetries_of(equal_parts(rng))
