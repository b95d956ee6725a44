"""A spring with friction and rigid friction on one deflection turn round at one instant, which has one event."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import friction
from tests.dry.event_reference import Reference

TURN = 2.0 * math.pi
PARTS = [friction("joint", {"x": 1.0}, 0.2, stiffness=3.0), friction("brake", {"x": 1.0}, 0.1)]


@pytest.mark.parametrize("contacts", [PARTS, PARTS[::-1]], ids=["spring first", "rigid first"])
def test_both_turn_round_whichever_event_comes_first(contacts) -> None:
    load = gw.Harmonic(1.0, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], [[0.05]], contacts=contacts, harmonics=[load], frequency=0.7)
    flow, coefficients, reference = flow_of(system), coefficients_of(system), Reference(system)
    numbers = np.random.default_rng(18)
    for _ in range(6):
        state = np.array([*numbers.normal(size=2), 0.0])
        expected = reference.integrate(state, 0.0, TURN).state
        for _ in range(8):  # rounding decides which comes first
            near = state * (1.0 + 1e-15 * numbers.normal(size=3))
            found = flow.integrate(coefficients, near, 0.0, TURN).state
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10)
