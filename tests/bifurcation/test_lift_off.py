"""A part that rests on a rigid stop all the time, until it lifts off."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation.walk import EndReason
from tests.tiers import keeps


def pressed(load: float, side: int = 1, unit: float = 1.0, phase: float = 0.0, restitution: float = 0.3) -> gw.System:
    """A mass without a spring that a weight presses on its stop, and a load lifts."""
    word = "positive" if side > 0 else "negative"
    stop = gw.rigid_stop("teeth", {"x": 1.0}, 0.5 * unit, restitution=restitution, side=word)
    return gw.System(
        ["x"], [[0.0]], [[0.6]], contacts=[stop], mean={"x": 0.4 * side * unit},
        harmonics=[gw.Harmonic(load * unit, {"x": 1.0}, phase=phase)], frequency=1.0,
    )  # fmt: skip


@keeps("1-1.0-0.0-ends1")
@pytest.mark.parametrize("ends", [(0.3, 0.405), (0.402, 0.39)])
@pytest.mark.parametrize(("side", "unit", "phase"), [(1, 1.0, 0.0), (-1, 1e9, 2.1)])
def test_it_lifts_off_where_the_load_is_its_weight(ends: tuple[float, float], side: int, unit: float, phase: float):
    start, end = ends
    orbit = gw.find_orbit(pressed(start, side, unit, phase))
    branch = gw.follow(orbit, "harmonic1.amplitude", to=end * unit)
    assert branch.ends[-1].reason is EndReason.RANGE
    (found,) = branch.special_points
    assert str(found.kind) == "held-stop"
    assert abs(found.value - 0.4 * unit) <= found.uncertainty < 1e-12 * unit
    assert "all the time" in found.nature
    for point in branch.points:
        rests = point.value < 0.4 * unit
        assert point.orbit.rests(0) is rests
        if rests:
            assert point.orbit.pattern == f"held{'+' if side > 0 else '-'}"
        assert "open" not in point.orbit.pattern
        assert point.orbit.stable


@pytest.mark.slow
def test_it_comes_to_rest_where_it_lifts_off_at_the_start_of_the_period():
    """The last Newton step lets a motion rest whose impacts, all slower than that step, were those before it."""
    orbit = gw.find_orbit(pressed(0.401, phase=np.pi, restitution=0.5))
    branch = gw.follow(orbit, "harmonic1.amplitude", to=0.3995)
    (found,) = branch.special_points
    assert abs(found.value - 0.4) <= found.uncertainty < 1e-12
    assert all(point.orbit.rests(0) is (point.value < 0.4) for point in branch.points)


def test_a_part_between_two_that_rest_at_zero_deflection_is_held():
    """The stop has no clearance, so that its deflection is a difference that rounding alone keeps from zero."""
    stop = gw.rigid_stop("seat", {"x": 1.0, "y": -1.0}, 0.0, restitution=0.5)
    system = gw.System(
        ["x", "y"], [[0.1, 0.0], [0.0, 0.3]], 0.2 * np.eye(2), contacts=[stop], mean={"x": 1.0},
        harmonics=[gw.Harmonic(0.1, {"y": 1.0}, phase=1.0)], frequency=0.7,
    )  # fmt: skip
    orbit = gw.find_orbit(system)
    assert orbit.pattern == "held+"
    assert orbit.rests(0)
