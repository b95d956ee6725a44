"""Equilibria do not depend on which part of the balance has a term, nor on units."""

import numpy as np
import pytest

import gapwalk as gw


@pytest.mark.parametrize("length", [1e-9, 1e-4, 1.0, 1e4, 1e9])
@pytest.mark.parametrize("written", ["matrix", "formula", "two formulas"])
def test_two_double_wells_have_nine_rests(length: float, written: str) -> None:
    """``k x^3 - x = 0`` for each of two coordinates: -1, 0, 1, of which 0 is unstable, in units of ``k^-1/2``."""
    k = 1.0 / length**2
    law = "k*x**3 - x" if written == "formula" else "k*x**3"
    contacts = [gw.force(f"f{name}", {name: 1.0}, law, k=k) for name in "ab"]
    if written == "two formulas":
        contacts += [gw.force(f"g{name}", {name: 1.0}, "-s*x", s=1.0) for name in "ab"]
    stiffness = -np.eye(2) if written == "matrix" else np.zeros((2, 2))
    found = gw.find_equilibria(gw.System(["a", "b"], stiffness, 0.3 * np.eye(2), contacts=contacts)).equilibria
    places = sorted(tuple(np.round(each.position / length, 6) + 0.0) for each in found)
    assert places == [(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)]
    assert [tuple(abs(np.round(each.position / length))) == (1.0, 1.0) for each in found] == [
        each.stable for each in found
    ]


def test_a_formula_that_balances_another_one_has_its_length() -> None:
    """``x^5 - x^3`` by two contacts: rests at -1, 0, 1."""
    contacts = [gw.force(f"f{name}", {name: 1.0}, "k*x**5", k=1e-8) for name in "ab"]
    contacts += [gw.force(f"g{name}", {name: 1.0}, "-k*x**3", k=1e-4) for name in "ab"]
    system = gw.System(["a", "b"], np.zeros((2, 2)), 0.3 * np.eye(2), contacts=contacts)
    assert len(gw.find_equilibria(system).equilibria) == 9
