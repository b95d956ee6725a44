"""The step-size law on corrections whose ideal step is known."""

import numpy as np
import pytest

from gapwalk.continuation.corrector import Correction
from gapwalk.continuation.walk import WalkOptions, next_step, shorter_step
from gapwalk.errors import ModelError

OPTIONS = WalkOptions(largest_step=1e3, initial_step=0.1, iterations=3)


def newton(error: float, constant: float, tolerance: float = 1e-12) -> Correction:
    """What the corrector would report if Newton's errors obeyed e' = constant e^2 exactly."""
    first, iterations, last = error, 0, 0.0
    while error > tolerance:
        following = constant * error**2
        last, error = error - following, following
        iterations += 1
    return Correction(np.zeros(3), None, iterations, first, last)


def test_the_law_leads_to_the_wanted_number_of_iterations():
    # a predictor whose error is step^2, on a branch without curvature
    step = 1e-3
    for _ in range(30):
        step = next_step(step, newton(step**2, 5.0), 0.0, OPTIONS)
    assert newton(step**2, 5.0).iterations in (3, 4)
    assert 0.02 < step < 0.5


def test_too_many_iterations_shorten_the_step():
    slow = newton(0.15, 6.0)
    assert slow.iterations > 4
    assert next_step(1.0, slow, 0.0, OPTIONS) < 1.0


def test_a_sharp_turn_shortens_the_step():
    easy = newton(1e-6, 1.0)
    assert next_step(1.0, easy, OPTIONS.largest_turn, OPTIONS) < 1.0
    assert next_step(1.0, easy, 0.0, OPTIONS) == 2.0
    assert shorter_step(1.0) < 0.5


def test_a_smallest_step_above_the_largest_is_refused():
    with pytest.raises(ModelError, match=r"smallest_step <= largest_step, but they are 1"):
        WalkOptions(smallest_step=1.0)


def test_the_first_step_lies_between_the_bounds() -> None:
    assert WalkOptions().first_step == 0.002
    assert WalkOptions(largest_step=0.001).first_step == 0.001
    assert WalkOptions(smallest_step=0.005).first_step == 0.005
