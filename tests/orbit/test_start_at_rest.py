"""The start at rest of systems whose rigid stops are displaced: teeth that rattle on a flank that is moved."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.flow.motion import integrate

GAP, DRAG, BASE, BOUNCE = 0.1, 0.02, 0.75, 0.7


def rattle(size: float = 1.0, phase: float = 0.0, sign: float = 1.0) -> gw.System:
    """A loose gear with a drag between rigid teeth, on a pinion whose motion is prescribed; in units of a size."""
    return gw.train.Train(
        [gw.train.Inertia("pinion"), gw.train.Inertia("loose", 1.0)],
        gears=[
            gw.train.Gear("mesh", ("pinion", "loose"), 1.0, stiffness="rigid", clearance=GAP * size, restitution=BOUNCE)
        ],
        mean={"loose": -DRAG * sign * size},
        harmonics=[gw.Harmonic(sign * BASE * size, varies="pinion.angle", phase=phase)],
    ).system()


def settled_angles(periods: int) -> np.ndarray:
    """Angle and rate of the loose gear at the ends of periods, from its free flights between impacts."""
    t, angle, rate, found = 0.0, BASE, 0.0, []
    for period in range(periods):
        while t < (end := 2.0 * math.pi * (period + 1)):

            def beyond(s, t=t, angle=angle, rate=rate):
                return np.abs(BASE * np.cos(t + s) - angle - rate * s + 0.5 * DRAG * s * s) - GAP

            grid = np.linspace(1e-9, end - t, 2001)
            outside = beyond(grid) > 0.0
            hits = np.flatnonzero(outside[1:] & ~outside[:-1])
            step = end - t if not len(hits) else brentq(beyond, grid[hits[0]], grid[hits[0] + 1], xtol=1e-15)
            angle, rate = angle + rate * step - 0.5 * DRAG * step * step, rate - DRAG * step
            t += step
            if len(hits):
                base = -BASE * math.sin(t)
                rate = base - BOUNCE * (rate - base)
        found.append((angle, rate))
    return np.array(found)


def test_a_loose_gear_settles_on_a_moving_flank() -> None:
    expected = settled_angles(30)
    assert np.abs(expected[-1] - expected[-2]).max() < 1e-9
    assert gw.settle(rattle()).period == 1
    orbit = gw.find_orbit(rattle())  # its coordinate is the angle of the pinion less that of the gear
    np.testing.assert_allclose(-orbit.state, expected[-1], atol=1e-8)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("phase", [0.0, 1.0, math.pi])
def test_it_begins_within_its_teeth_in_any_units_and_phase(size: float, phase: float) -> None:
    for sign in (1.0, -1.0):
        system = rattle(size, phase, sign)
        start = state_at_rest(system)
        displaced = sign * BASE * math.cos(phase)
        assert start.tolist() == pytest.approx([-displaced * size, 0.0], rel=1e-12)
        assert integrate(system, start).impacts


def test_what_the_stops_allow_stays_at_zero() -> None:
    """Of two stops only the one that is carried beyond its clearance moves its coordinate."""
    sizes = {"near": 0.1, "far": 0.5}
    stops = [
        gw.Contact(name, {q: 1.0}, [gw.Stage(0.2)], law="rigid", restitution=0.5)
        for name, q in zip(sizes, "xy", strict=True)
    ]
    loads = [gw.Harmonic(size, varies=f"{name}.deflection", name=f"u_{name}") for name, size in sizes.items()]
    system = gw.System(["x", "y"], np.eye(2), 0.1 * np.eye(2), contacts=stops, harmonics=loads)
    assert state_at_rest(system).tolist() == pytest.approx([0.0, -0.5, 0.0, 0.0], abs=1e-15)
