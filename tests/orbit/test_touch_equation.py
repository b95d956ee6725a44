"""Orbits with a prescribed depth of a touch, beside the closed form of the linear motion."""

import math

import numpy as np
import pytest

from gapwalk.errors import ConvergenceError
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.orbit import Shooting, find_orbit
from gapwalk.orbit.shooting import TouchEquation, touches

DAMPING, FORCE = 0.1, 0.3


def oscillator(frequency, stiffness=1e6):
    stop = Contact("stop", {"x": 1.0}, (Stage(1.0, stiffness, side=Side.POSITIVE),))
    harmonic = Harmonic(FORCE, {"x": 1.0})
    return System(["x"], [[1.0]], [[DAMPING]], contacts=[stop], harmonics=[harmonic], frequency=frequency)


def frequency_of(amplitude):
    """The lower frequency at which the linear motion has an amplitude."""
    middle = 1.0 - 0.5 * DAMPING**2
    return math.sqrt(middle - math.sqrt(middle**2 - 1.0 + (FORCE / amplitude) ** 2))


def posed():
    orbit = find_orbit(oscillator(frequency_of(1.0 - 1e-6)))
    equation = Shooting().pose(orbit.system, "frequency")
    scales = np.array([16.0, 16.0, 1.0])
    touching = TouchEquation(equation, orbit, touches(orbit)[:1], scales)
    return touching, touching.calibrate(touching.at(orbit), 1e-7)


def test_the_nearest_touch_of_a_motion_is_told_by_its_depth():
    orbit = find_orbit(oscillator(frequency_of(1.0 - 1e-3)))
    touch = touches(orbit)[0]
    assert touch.depth == pytest.approx(-1e-3, abs=1e-12)
    assert touch.acceleration == pytest.approx(-(orbit.system.frequency**2) * (1.0 - 1e-3), rel=1e-9)


def test_a_motion_that_misses_the_breakpoint_by_a_prescribed_depth_has_that_amplitude():
    touching, held = posed()
    for depth in (-1e-6, -1e-9, -1e-12, 0.0):
        held = touching.hold(held, depth)
        assert held.value == pytest.approx(frequency_of(1.0 + depth), abs=3e-15)


def test_a_motion_that_passes_the_breakpoint_meets_the_stop_with_the_velocity_of_its_depth():
    touching, held = posed()
    held = touching.hold(held, 0.0)
    for depth in (1e-12, 1e-11, 1e-10, 1e-9, 1e-8):
        held = touching.hold(held, depth)
        _, evaluation = touching.evaluation(held)
        entry = next(event for event in evaluation.evidence[0].contacts if event.enters)
        assert np.abs(evaluation.residual).max() < Shooting().tolerance
        assert entry.velocity**2 / 2.0 == pytest.approx(depth * held.value**2, rel=2e-3)


def test_where_no_acceleration_turns_the_deflection_no_depth_can_be_held():
    orbit = find_orbit(oscillator(0.3))
    equation = Shooting().pose(orbit.system, "frequency")
    touch = touches(orbit)[0]._replace(acceleration=0.0)
    with pytest.raises(ConvergenceError, match="segment before the touch is too short"):
        TouchEquation(equation, orbit, [touch], np.array([16.0, 16.0, 1.0]))


def struck(amplitude):
    stop = Contact("stop", {"x": 1.0}, (Stage(1.0, side=Side.POSITIVE),), law="rigid", restitution=0.8)
    return System(["x"], [[1.0]], [[DAMPING]], contacts=[stop], harmonics=[Harmonic(amplitude, {"x": 1.0})])


def test_an_impact_on_a_rigid_stop_is_one_touch_with_the_depth_of_its_velocity():
    # a state at the angle of an impact may be the one before it or the one after it
    for amplitude in (0.1002, 0.11, 0.3, 1.0):
        orbit = find_orbit(struck(amplitude))
        impacts = [event for event in orbit.events if event.enters]
        found = [touch for touch in touches(orbit) if touch.depth > 0.0]
        assert len(found) == len(impacts) > 0
        for touch, event in zip(sorted(found, key=lambda each: each.theta), impacts, strict=True):
            assert touch.theta == event.theta
            # x'' = A cos(theta) - 0.1 x' - 1 at the stop, just before the impact or just after it
            drive, rate = amplitude * math.cos(event.theta) - 1.0, event.velocity
            turning = min((drive - DAMPING * v for v in (rate, -0.8 * rate)), key=lambda a: abs(a - touch.acceleration))
            assert touch.acceleration == pytest.approx(turning, abs=1e-9)
            assert touch.depth == pytest.approx(-0.5 * rate**2 / turning, rel=1e-8)
