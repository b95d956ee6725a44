"""Periods after which a motion nearly returns."""

import numpy as np

from gapwalk.attractors.convergence import recurrences


def test_an_alternating_decay_offers_one_and_two():
    k = np.arange(200)
    states = np.column_stack((1 + 0.01 * (-0.99) ** k, np.ones(200)))
    found = recurrences(states, 16, 0.05)
    assert [each.period for each in found] == [1, 2]
    assert found[1].distance < 0.1 * found[0].distance


def test_a_period_is_found_and_its_multiples_are_not():
    states = np.tile(np.eye(5), (20, 1))
    assert recurrences(states, 40, 0.05) == [(5, 0.0)]


def test_too_few_strobes_show_no_long_period():
    states = np.tile(np.eye(5), (1, 1))
    assert recurrences(states, 40, 0.05) == []
