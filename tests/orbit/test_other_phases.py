"""Motions begun later, where the excitation is the same: they solve the same equation, and are the same motion."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.orbit import Shooting
from gapwalk.orbit.harmonic_balance import Balance


@pytest.mark.parametrize("method", [Shooting(), Shooting(segments=2), Balance(harmonics=60)])
@pytest.mark.parametrize("order", [1, 2])
def test_the_unknowns_of_a_motion_that_begins_later(method, order):
    """A mass that rests on a stop, excited at twice its own frequency: it answers every second time."""
    system = gw.System(
        ["x"],
        [[1.0]],
        [[0.1]],
        contacts=[gw.stop("stop", {"x": 1.0}, clearance=0.0, stiffness=10.0)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0}, order=order)],
        frequency=3.07 / order,
    )
    settled = gw.settle(system)
    period = settled.period * (2 if order == 2 and settled.period == 1 else 1)
    orbit = gw.find_orbit(system, period, settled.state, method=method)
    equation = method.pose(system, "frequency", period)
    places = orbit.strobes(period * order, 2.0 * np.pi / order)
    others = equation.with_other_phases(orbit)
    assert len(others) == period * order - 1
    assert np.abs(places[1] - places[0]).max() > 0.1
    for unknowns, place in zip(others, places[1:], strict=True):
        found = equation.evaluate(unknowns, system.frequency)
        assert np.abs(found.residual).max() < 1e-9
        assert equation.orbit(unknowns, system.frequency, found).state == pytest.approx(place, abs=1e-9)
