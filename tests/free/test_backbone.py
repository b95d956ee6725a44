"""Backbones against closed forms: free flight in a gap, a bilinear spring, Duffing's oscillator; and two masses."""

import numpy as np
import pytest
from scipy.special import ellipk

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.free.free_shooting import potential_of

LOAD = [gw.Harmonic(0.1, {"x": 1.0})]


def oscillator(stiffness: float, *contacts: gw.Contact, frequency: float = 1.0) -> gw.System:
    return gw.System(["x"], [stiffness], [0.1], mass=[1.0], contacts=contacts, harmonics=LOAD, frequency=frequency)


def test_free_flight_between_two_springs():
    """With springs of stiffness 1 beyond +-b the period is ``2 pi + 4 b / (X - b)`` at the amplitude X."""
    b = 0.5
    gap = gw.backlash("gap", {"x": 1.0}, clearance=b, stiffness=1.0)
    line = gw.free.backbone(oscillator(0.0, gap, frequency=0.3), [1.0], (0.05, 0.95))
    amplitudes = line.half("x")
    assert amplitudes.min() < 0.6
    assert amplitudes.max() > 4.0
    assert 2 * np.pi / line.values == pytest.approx(2 * np.pi + 4 * b / (amplitudes - b), rel=1e-10)


def test_a_bilinear_spring():
    """A stop without clearance: half a period each with the frequencies w1 and w2, at any amplitude."""
    stop = gw.stop("stop", {"x": 1.0}, clearance=0.0, stiffness=3.0)
    line = gw.free.backbone(
        oscillator(1.0, stop), 1, (0.5, 3.0), options=gw.free.BackboneOptions(largest_amplitude=2.0)
    )
    assert line.values == pytest.approx(np.full(len(line.values), 2 * 1.0 * 2.0 / (1.0 + 2.0)), rel=1e-10)


def test_duffing():
    """``x'' + x + x^3 = 0`` has the period ``4 K(m) / sqrt(1 + X^2)`` with ``m = X^2 / (2 (1 + X^2))``."""
    cubic = gw.force("spring", {"x": 1.0}, law="x*x*x")
    line = gw.free.backbone(oscillator(1.0, cubic), 1, (0.5, 4.0))
    x = line.half("x")
    assert x.max() > 3.0
    period = 4.0 * ellipk(x**2 / (2.0 * (1.0 + x**2))) / np.sqrt(1.0 + x**2)
    assert 2 * np.pi / line.values == pytest.approx(period, rel=1e-10)
    assert line.energies == pytest.approx(0.5 * x**2 + 0.25 * x**4, rel=1e-9)
    assert all(point.stable for point in line.points)


def test_two_masses_swing_back_the_same_way():
    stop = gw.stop("stop", {"a": 1.0}, clearance=1.0, stiffness=20.0)
    stiffness, load = [[1.0, -1.0], [-1.0, 2.0]], [gw.Harmonic(0.1, {"b": 1.0})]
    system = gw.System(["a", "b"], stiffness, [0.05, 0.05], contacts=[stop], harmonics=load, frequency=0.7)
    first, second = (gw.free.backbone(system, mode) for mode in (1, 2))
    modes = gw.find_modes(system, "open")
    assert [first.values[0], second.values[0]] == pytest.approx(modes.frequencies, rel=1e-9)
    for line in (first, second):
        assert len(line.points) > 20
        for point in line.points[:: len(line.points) // 5]:
            motion = line.motion(point)
            assert motion.q[-1] == pytest.approx(point.start, abs=1e-8 * max(1.0, abs(point.start).max()))
            # the energy at the stop is that of the springs: constant along the motion
            middle = len(motion.q) // 3
            kinetic = 0.5 * float(motion.v[middle] @ motion.v[middle])
            potential = potential_of(gw.free.without_losses(system), motion.q[middle])
            assert kinetic + potential == pytest.approx(point.energy, rel=1e-8)
    assert "backbone of mode 1" in str(first.summary())


def test_what_has_no_free_vibration_is_refused():
    brake = gw.friction("brake", {"x": 1.0}, 0.1)
    with pytest.raises(ModelError, match="dry friction or rigid stops"):
        gw.free.backbone(oscillator(1.0, brake))
    drag = gw.force("drag", {"x": 1.0}, law="v*abs(v)")
    with pytest.raises(ModelError, match="do not run backwards"):
        gw.free.backbone(oscillator(1.0, drag))
    with pytest.raises(ModelError, match="modes 1 to 1"):
        gw.free.backbone(oscillator(1.0), 3)
    gap = gw.backlash("gap", {"x": 1.0}, clearance=0.5, stiffness=1.0)
    with pytest.raises(ModelError, match=r"give positions to release"):
        gw.free.backbone(oscillator(0.0, gap))
