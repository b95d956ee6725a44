"""Sobol points without SciPy's statistics: the same, bit for bit."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import qmc

from gapwalk.model.sobol_points import sobol_points


@pytest.mark.parametrize(("dimension", "power"), [(1, 0), (1, 5), (2, 1), (4, 7), (7, 3), (40, 6), (300, 2)])
def test_points_are_those_of_scipy(dimension, power) -> None:
    for seed in range(3):
        expected = qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random_base2(power)
        assert np.array_equal(sobol_points(dimension, power, np.random.default_rng(seed)), expected)


def test_they_need_no_statistics() -> None:
    script = (
        "import sys, numpy as np\n"
        "from gapwalk.model.sobol_points import sobol_points\n"
        "sobol_points(4, 3, np.random.default_rng(1))\n"
        "print('scipy.stats' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


def test_a_dimension_without_direction_numbers_is_refused() -> None:
    with pytest.raises(ValueError, match="the dimension is 30000; the direction numbers end at 21201"):
        sobol_points(30_000, 0, np.random.default_rng(1))
