"""Zeros in a bracket: against closed forms, and with the number of evaluations."""

import math
import subprocess
import sys

import pytest

from gapwalk.bifurcation.bracketed_zero import EXACT, zero_between


def _counted(function):
    places = []

    def counted(place):
        places.append(place)
        return function(place)

    return counted, places


@pytest.mark.parametrize(
    ("function", "low", "high", "exact", "most"),
    [
        (lambda x: math.exp(x) - 1.2, 0.1, 0.3, math.log(1.2), 6),
        (lambda x: math.sin(x) - 0.004, 0.0, 0.01, math.asin(0.004), 5),
        (lambda x: (x - 0.003) * (1.0 if x < 0.003 else 100.0), 0.0, 0.01, 0.003, 8),  # a kink at the zero
        (lambda x: math.copysign(abs(x - 0.003) ** 0.5, x - 0.003), 0.0, 0.01, 0.003, 40),  # a vertical tangent
        (lambda x: x**3 - 2e-9, 0.0, 0.01, 2e-9 ** (1 / 3), 30),
    ],
)
def test_zeros_of_closed_forms_are_found_with_few_evaluations(function, low, high, exact, most):
    counted, places = _counted(function)
    zero, converged = zero_between(counted, low, high)
    assert converged
    assert zero == pytest.approx(exact, abs=2.0 * EXACT)
    assert zero in places
    assert len(places) <= most


def test_known_values_beside_the_bracket_bring_the_first_place_nearer():
    exact, away = math.log(3.0) / 8.0, []
    for beside in ({}, {0.12: math.exp(0.96) - 3.0, 0.15: math.exp(1.2) - 3.0}):
        counted, places = _counted(lambda x: math.exp(8.0 * x) - 3.0)
        zero, _ = zero_between(counted, 0.13, 0.14, beside)
        assert zero == pytest.approx(exact, abs=2.0 * EXACT)
        away.append(abs(places[2] - exact))
    assert away[1] < 0.02 * away[0]


def test_jumps_are_bracketed_or_given_up_at_once():
    counted, places = _counted(lambda x: 1.0 if x > 0.3 else -2.0)
    zero, converged = zero_between(counted, 0.0, 1.0)
    assert converged
    assert zero == pytest.approx(0.3, abs=2.0 * EXACT)
    places.clear()
    assert not zero_between(counted, 0.0, 1.0, jumps=False)[1]
    assert len(places) < 8


def test_rounding_at_the_zero_costs_few_evaluations():
    counted, places = _counted(lambda x: math.sin(x - 0.3) + 3e-12 * math.sin(1e15 * x))
    zero, converged = zero_between(counted, 0.2, 0.35)
    assert converged
    assert zero == pytest.approx(0.3, abs=1e-11)
    assert len(places) < 16


def test_a_zero_at_an_end_is_returned():
    assert zero_between(lambda x: x, 0.0, 1.0) == (0.0, True)


@pytest.mark.slow
def test_special_points_are_located_without_loading_scipy_optimize():
    """It takes longer to load than a whole walk."""
    lines = (
        "import sys, gapwalk as gw",
        "branch = gw.follow(gw.find_orbit(gw.paper.case('13'), frequency=1.9), 'frequency', 1.2)",
        "print({str(each.kind) for each in branch.special_points} >= {'flip', 'grazing'})",
        "print('scipy.optimize' in sys.modules)",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]
