"""Averages with errors: sequences whose means and errors are known in closed form."""

import numpy as np
import pytest

from gapwalk.attractors.lyapunov import average, birkhoff_mean, birkhoff_weights, block_error

GOLDEN = (np.sqrt(5) - 1) / 2


def test_the_weights_are_a_mean():
    weights = birkhoff_weights(1000)
    assert weights.sum() == pytest.approx(1.0, abs=1e-14)
    assert weights == pytest.approx(weights[::-1])
    assert weights.min() >= 0


def test_a_quasi_periodic_mean_converges_to_rounding():
    angles = 2 * np.pi * GOLDEN * np.arange(4000)
    values = np.exp(np.cos(angles + 0.3))[:, None]
    assert birkhoff_mean(values)[0] == pytest.approx(np.i0(1.0), abs=1e-13)  # mean of exp(cos) is a Bessel function
    found = average(values)
    assert abs(found.mean[0] - np.i0(1.0)) <= found.error[0] < 1e-9
    assert found.spread[0] == found.error[0]


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_the_error_of_a_correlated_sequence(memory):
    # autoregressive: the variance of the mean of N values is (1 + a) / (1 - a) / N times that of one value
    random = np.random.default_rng(5)
    count, samples = 8192, 60
    values = np.zeros((count + 200, samples))
    noise = random.normal(size=values.shape)
    for k in range(1, len(values)):
        values[k] = memory * values[k - 1] + noise[k]
    values = values[200:]
    expected = np.sqrt((1 + memory) / (1 - memory) / count / (1 - memory**2))
    errors = block_error(values)
    assert 0.9 * expected < np.median(errors) < 1.7 * expected  # the largest over block lengths: a little too careful
    found = average(values)
    assert np.mean(np.abs(found.mean) <= 2 * found.error) > 0.93
    assert found.error == pytest.approx(errors)
