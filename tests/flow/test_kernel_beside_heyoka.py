"""The kernel of the flow beside heyoka: random systems of every kind of element, with derivatives, events and turns."""

import numpy as np
import pytest

from gapwalk.flow.equations import Equations
from gapwalk.flow.flow import Flow, flow_of
from gapwalk.model.coefficients import coefficients_of
from tests.flow.beside_heyoka import compared
from tests.flow.heyoka_flow import HeyokaFlow
from tests.systems import clutch
from tests.tiers import some_of


@pytest.mark.parametrize("number", some_of(range(300), *range(5), 23, 54, 76, 102, 150, 195, 270))
def test_both_agree(number: int) -> None:
    found = compared(number)
    assert found.faults == []
    assert found.state <= 1e-11
    assert found.matrix <= 1e-9
    assert found.column <= 1e-9


def test_a_wrong_number_is_seen() -> None:
    """The comparison is of two different computations."""
    equations = flow_of(clutch(), transition=True).equations
    flow, other = (kind(Equations(equations.layout, equations.pattern), transition=True) for kind in (Flow, HeyokaFlow))
    state = np.array([1.2, 0.1, 0.3, -0.2])
    arcs = [flow.integrate(coefficients_of(clutch()), state), other.integrate(coefficients_of(clutch()), state)]
    assert not np.array_equal(arcs[0].transition, arcs[1].transition)  # they round differently
    np.testing.assert_allclose(arcs[0].transition, arcs[1].transition, rtol=0, atol=1e-13)
    reversals = [arc.reversals for arc in arcs]
    assert len(reversals[0]) == 2
    np.testing.assert_allclose(*reversals, rtol=0, atol=1e-11)
    np.testing.assert_allclose(reversals[0][:, 4], 0.0, atol=1e-12)  # the rate of the only deflection, that of q1
    moved = other.integrate(coefficients_of(clutch(frequency=0.5001)), state)
    assert np.abs(arcs[0].state - moved.state).max() > 1e-6
