"""A force law made of a formula: its names, its parameters, its force and guards, and equality by content."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from gapwalk.errors import ModelError
from gapwalk.model.laws import LAWS, Elastic, Stages
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, Expression, FormulaError


def stages(modes: list[Any], **deflections: tuple[Any, Any]) -> Stages:
    """Return the arguments of a formula: no stages, but deflections with their rates."""
    found: Any = Stages([])
    found.deflections, found.modes, found.functions = deflections, modes, NUMPY_FUNCTIONS
    return found


def test_the_force_is_that_of_the_formula() -> None:
    law = Expression("k*x + a*x**3 - mu*(1 - x**2)*v")
    assert [each.name for each in law.parameters] == ["k", "a", "mu"]
    assert all(each.kind is None and each.default is None and each.least is None for each in law.parameters)
    assert "k*x + a*x**3 - mu*(1 - x**2)*v" in law.parameters[0].words
    assert law.stage_parameters == ()
    assert law.mode_count == 0
    x, v = np.random.default_rng(1).normal(size=(2, 5))
    numbers = {"k": 2.0, "a": 0.5, "mu": 0.3}
    force = law.force(v, stages([], x=(x, v)), numbers)
    np.testing.assert_allclose(force, 2.0 * x + 0.5 * x**3 - 0.3 * (1.0 - x**2) * v, rtol=1e-14)
    assert law.guards(v, stages([], x=(x, v)), numbers) == []


def test_several_deflections_have_rates_of_their_own() -> None:
    law = Expression("k*x*y**2 + c*(x' - y')*abs(x' - y') + max(v, 0)", ("x", "y"))
    assert [each.name for each in law.parameters] == ["k", "c", "v"]  # v is a rate only where x is alone
    given = {"x": (0.5, 0.1), "y": (2.0, 0.4)}
    numbers = {"k": 3.0, "c": 10.0, "v": 1.0}
    assert law.guards(0.1, stages([0.0, 1.0], **given), numbers) == pytest.approx([-0.3, 1.0])
    assert law.mode_count == 2
    assert law.force(0.1, stages([0.0, 1.0], **given), numbers) == pytest.approx(6.0 - 10.0 * 0.09 + 1.0)
    assert law.force(0.1, stages([1.0, 0.0], **given), numbers) == pytest.approx(6.0 + 10.0 * 0.09)


def test_the_width_of_an_edge_is_given_with_the_numbers() -> None:
    law = Expression("k*max(x, 0)**1.5")
    given = {"k": 2.0, "_edge": 0.1}
    assert law.guards(0.0, stages([1.0, 0.0], x=(0.04, 0.0)), given) == pytest.approx([0.04, -0.06])
    exact = law.force(0.0, stages([1.0, 1.0], x=(0.04, 0.0)), {"k": 2.0})
    inside = law.force(0.0, stages([1.0, 0.0], x=(0.04, 0.0)), given)
    assert exact == pytest.approx(2.0 * 0.04**1.5, rel=1e-15)
    assert inside == pytest.approx(exact, rel=1e-3)
    assert inside != exact


@pytest.mark.parametrize(
    ("text", "damped"), [("k*x", False), ("k*x*v", True), ("c*x'", True), ("x*abs(x)", False), ("max(v, 0)**2", True)]
)
def test_a_rate_is_damping(text: str, damped: bool) -> None:
    assert Expression(text).is_damped is damped


def test_laws_are_equal_by_content() -> None:
    law = Expression("k*x + c*v")
    same = Expression("(k * x) + c*v")
    assert law == same
    assert hash(law) == hash(same)
    assert law != Expression("k*x + c*x'")
    assert law != Expression("k*x + c*v", ("x", "v"))
    assert law != Elastic()
    assert Expression("q*w", ("q", "w")) != Expression("q*w", ("w", "q"))
    for again in (pickle.loads(pickle.dumps(law)), copy.deepcopy(law), eval(repr(law))):
        assert again == law
        assert again.parameters == law.parameters
    assert "expression" not in LAWS


@pytest.mark.parametrize(
    ("text", "variables", "words"),
    [
        ("k*x", ("x", "y"), "neither on the deflection y nor on its rate y'"),
        ("k*x", ("q",), "neither on the deflection q"),
        ("k", ("x",), "neither on the deflection x"),
        ("k*x", (), "one or more deflections"),
        ("k*x", ("x", "x"), "different names"),
        ("k*x", ("x", "2y"), "cannot have the name '2y'"),
        ("k*x", ("x'",), "cannot have the name"),
        ("k*x", ("_edge",), "cannot have the name '_edge'"),
        ("k*max", ("max",), "cannot have the name 'max'"),
    ],
)
def test_names_that_a_formula_cannot_use_are_refused(text: str, variables: tuple[str, ...], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Expression(text, variables)


def test_an_error_of_the_formula_is_raised_at_once() -> None:
    with pytest.raises(FormulaError, match=r"write \*\* for a power") as caught:
        Expression("k*x^2")
    assert caught.value.column == 4
