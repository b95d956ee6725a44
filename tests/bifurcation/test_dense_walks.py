"""Completeness of detection on a sample; `make dense` does all branches of the paper and 200 random systems."""

import pytest

from gapwalk import find_orbit
from tests.bifurcation.dense.comparison import compare_walks
from tests.bifurcation.dense.random_systems import random_task
from tests.tiers import some_of


@pytest.mark.parametrize("seed", some_of([20, 36], 20))
def test_nothing_is_missed_or_invented_beside_a_walk_with_20_times_smaller_steps(seed):
    system, parameter, to = random_task(seed)
    comparison = compare_walks(str(seed), find_orbit(system), parameter, to, max_points=100)
    assert comparison.agrees, str(comparison)
    assert comparison.shared >= 3
    assert comparison.apart < 1e-9
