"""The judge of settled motions, on sequences whose future is known; see also tests/studies/test_transient.py."""

import numpy as np
import pytest

from gapwalk.attractors.settle import TOLERANCES, judge_returns, recurrences


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


def returning(period: int, rate: float, length: int) -> np.ndarray:
    """Strobes of an orbit of that period, approached by a factor of `rate` a forcing period, shape (length, 1, 2)."""
    k = np.arange(length)
    angle = 2.0 * np.pi * k / period
    away = 0.1 * rate**k
    return np.column_stack((np.cos(angle) + away, np.sin(angle) - 0.5 * away))[:, None]


def test_the_distance_still_to_go_is_that_at_the_end():
    for rate, length in ((0.9, 100), (0.99, 600), (0.998, 3000)):
        found = judge_returns(returning(3, rate, length), 16)
        assert 0.5 < found.missing[0] / (0.1 * rate ** (length - 1)) < 2.0


def test_one_motion_among_many_is_judged_as_alone():
    rates = (0.5, 0.8, 0.9, 0.99)
    tracks = [returning(period, rate, 200) for period, rate in zip((1, 2, 3, 5), rates, strict=True)]
    together, alone = judge_returns(np.hstack(tracks), 16), [judge_returns(track, 16) for track in tracks]
    assert together.periods.tolist() == [each.periods[0] for each in alone] == [1, 2, 3, 0]
    assert together.missing == pytest.approx([each.missing[0] for each in alone], rel=1e-12)


def test_a_growth_is_neither_arriving_nor_steady():
    found = judge_returns(returning(2, 1.01, 400), 16)
    assert found.missing[0] == np.inf
    assert not found.steady[0]


def test_a_torus_is_steady_and_a_small_return_is_not():
    turns = 2.0 * np.pi * 0.6180339887 * np.arange(400)
    circle = np.column_stack((np.cos(turns), np.sin(turns)))[:, None]
    assert judge_returns(circle, 12).steady[0]
    assert not judge_returns(1.0 + 0.01 * TOLERANCES.large * circle, 12).steady[0]
