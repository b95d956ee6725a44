"""Determinants of bordered Jacobians, beside closed forms and NumPy's logarithms of determinants."""

import numpy as np
import pytest

from gapwalk import Balance, WalkOptions, find_orbit, follow
from gapwalk.continuation.corrector import bounded_product
from tests.systems import clutch


def test_determinants_by_shooting_are_those_of_the_multipliers_whatever_the_scales():
    branch = follow(find_orbit(clutch(), frequency=1.9), "frequency", to=1.5, walk=WalkOptions(largest_step=0.05))
    for point in branch.points[1:]:
        # Cramer's rule: the parameter's part of the tangent is the determinant without the border over that with it
        expected = np.prod(point.orbit.multipliers - 1.0)
        assert expected.imag == pytest.approx(0.0, abs=1e-12)
        assert point.determinant * point.tangent[-1] == pytest.approx(expected.real, rel=1e-4)


def test_determinants_of_hundreds_of_unknowns_are_numbers():
    method = Balance(harmonics=200, error=1.0)
    start = find_orbit(clutch(), frequency=1.3, method=method)
    branch = follow(start, "frequency", to=1.29, method=method, walk=WalkOptions(initial_step=0.5, largest_step=0.5))
    equation = method.pose(start.system, "frequency")
    for point in branch.points[1:]:
        assert len(point.x) > 400
        evaluation = equation.evaluate(equation.unknowns(point.orbit), point.value)
        sign, logarithm = np.linalg.slogdet(evaluation.by_unknowns)
        assert point.determinant * point.tangent[-1] == pytest.approx(sign * np.exp(logarithm), rel=1e-6)


def test_products_beyond_what_a_number_holds_keep_their_sign():
    assert bounded_product([2.0, -3.0, 0.5]) == -3.0
    assert bounded_product([1e200, 1e200, -1e-250]) == pytest.approx(-1e150)
    assert bounded_product([1e200, -1e200]) == pytest.approx(-1e300)
    assert bounded_product([-1e-200, -1e-200, 1.0]) == pytest.approx(1e-300)
