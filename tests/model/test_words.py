"""Numbers in sentences differ where the numbers do."""

import numpy as np

import gapwalk as gw
from gapwalk.model.words import between_words, range_words, told_apart


def test_ends_of_a_range_are_told_apart() -> None:
    assert range_words((700.0001, 700.0002), "speed") == "speed from 700.0001 to 700.0002"
    assert between_words((700.0001, 700.0002), "speed") == "between speed = 700.0001 and 700.0002"
    assert range_words((0.7, 1.3), "speed") == "speed from 0.7 to 1.3"
    assert told_apart(1.0, np.nextafter(1.0, 2.0)) == ("1", "1.0000000000000002")
    assert told_apart(700.0, 700.0) == ("700", "700")


def test_a_branch_that_returns_says_how_far_it_came() -> None:
    """Over the frequency down to the fold of a hardening spring, and back to the same value on the other motion."""
    spring, load = gw.force("spring", {"x": 1.0}, "x**3"), gw.Harmonic(0.1, {"x": 1.0})
    system = gw.System(["x"], [1.0], damping=[0.05], contacts=[spring], harmonics=[load], frequency=1.2)
    branch = gw.follow(gw.find_orbit(system, start=[0.0, 0.0]), "frequency", 1.0)
    assert branch.values[0] == branch.values[-1] == 1.2
    text = str(branch.summary()).partition(":")[0]
    assert text == f"period-1 motions over Ω from 1.2 by way of {min(branch.values):.10g} to 1.2"
    assert min(branch.values) >= branch.special("fold")[0].value - 1e-9
