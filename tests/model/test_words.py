"""Numbers in sentences differ where the numbers do."""

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.model.words import between_words, range_words, told_apart, with_error


def test_ends_of_a_range_are_told_apart() -> None:
    assert range_words((700.0001, 700.0002), "speed") == "speed from 700.0001 to 700.0002"
    assert between_words((700.0001, 700.0002), "speed") == "between speed = 700.0001 and 700.0002"
    assert range_words((0.7, 1.3), "speed") == "speed from 0.7 to 1.3"
    assert told_apart(1.0, np.nextafter(1.0, 2.0)) == ("1", "1.0000000000000002")
    assert told_apart(700.0, 700.0) == ("700", "700")


@pytest.mark.parametrize(
    ("value", "error", "figures", "text"),
    [
        (578.2, 10.0, 1, "580 ± 10"),
        (578.2, 9.7, 1, "580 ± 10"),
        (578.2, 9.7, 2, "578.2 ± 9.7"),
        (1234567.0, 4e4, 1, "1230000 ± 40000"),
        (0.12345, 0.00123, 2, "0.1235 ± 0.0012"),
        (999.9855225812, 5e-10, 1, "999.9855225812 ± 5e-10"),
        (3.2e-7, 1e-9, 1, "3.20e-07 ± 1e-09"),
        (0.3, 10.0, 1, "0 ± 10"),
        (-5.5, math.nan, 1, "-5.5"),
        (-5.5, math.inf, 1, "-5.5"),
        (2.0 / 3.0, 0.0, 1, "0.66666667"),
    ],
)
def test_a_value_and_its_error_have_equal_decimals(value: float, error: float, figures: int, text: str) -> None:
    assert with_error(value, error, figures=figures) == text


def test_a_branch_that_returns_says_how_far_it_came() -> None:
    """Over the frequency down to the fold of a hardening spring, and back to the same value on the other motion."""
    spring, load = gw.force("spring", {"x": 1.0}, "x**3"), gw.Harmonic(0.1, {"x": 1.0})
    system = gw.System(["x"], [1.0], damping=[0.05], contacts=[spring], harmonics=[load], frequency=1.2)
    branch = gw.follow(gw.find_orbit(system, start=[0.0, 0.0]), "frequency", 1.0)
    assert branch.values[0] == branch.values[-1] == 1.2
    text = str(branch.summary()).partition(":")[0]
    assert text == f"period-1 motions over Ω from 1.2 by way of {min(branch.values):.10g} to 1.2"
    assert min(branch.values) >= branch.special("fold")[0].value - 1e-9
