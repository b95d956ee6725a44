"""Spectra: closed forms of linear systems, exact lines of orbits, names, and folding."""

from fractions import Fraction

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors import SpectrumOptions, settle, spectrum
from gapwalk.attractors.spectrum import line_name
from gapwalk.errors import ModelError
from gapwalk.model import Harmonic, System
from tests.systems import linear, viscous_stop


def response(system: System, order: int):
    """Complex amplitudes of the coordinates of `linear` at a multiple of W, from its equations of motion."""
    forces = {1: 0.7 * np.exp(0.3j) * np.array([1.0, -0.4]), 3: 0.2 * np.array([0.0, 1.0])}
    w = order * system.frequency
    mass, damping, stiffness = (system.matrix(name) for name in ("mass", "damping", "stiffness"))
    return np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, forces[order])


def test_a_linear_system_has_the_lines_of_its_transfer_function():
    system = linear()
    orbit = gw.find_orbit(system)
    for place, name in enumerate(system.coordinates):
        for dashes in range(3):
            found = spectrum(orbit, name + "'" * dashes)
            for order in (1, 3):
                expected = response(system, order)[place] * (1j * order * 0.8) ** dashes
                assert found.values[order] == pytest.approx(expected, abs=1e-10)
            others = [k for k in range(len(found.orders)) if k not in (0, 1, 3)]
            assert found.amplitudes[others].max() < 1e-10
            assert found.resolution == 0.0
    static = np.linalg.solve(system.matrix("stiffness"), [0.3, 0.0])
    assert spectrum(orbit, "a").values[0] == pytest.approx(static[0], abs=1e-11)


def test_lines_and_names_of_a_period_three_motion():
    settled = settle(gw.paper.case("15"), frequency=0.45)
    assert settled.orbit is not None
    found = spectrum(settled, "q1")
    assert found.period == 3
    assert found.orders[:4] == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert [peak.name for peak in found.peaks(3)] == ["W", "4W/3", "8W/3"]
    for order, name in ((Fraction(1), "h1.q1"), (Fraction(2, 3), "h2/3.q1"), (Fraction(8, 3), "h8/3.q1")):
        assert found.amplitude(float(order)) == pytest.approx(settled.orbit.measure(name), rel=1e-5)
    assert found.amplitude(0.5) == 0.0
    assert "W 2.413" in repr(found)
    # Parseval: the mean square is that of the lines
    square = found.amplitudes[0] ** 2 + 0.5 * (found.amplitudes[1:] ** 2).sum()
    assert np.sqrt(square) == pytest.approx(settled.orbit.measure("rms.q1"), rel=1e-9)


@pytest.mark.parametrize("signal", ["q1", "q1''", "stage2"])
def test_folding_is_bounded(signal):
    orbit = settle(gw.paper.case("15"), frequency=0.45).orbit
    assert orbit is not None
    rough = spectrum(orbit, signal, SpectrumOptions(tolerance=1e-3))
    fine = spectrum(orbit, signal, SpectrumOptions(tolerance=1e-8))
    assert len(fine.values) > len(rough.values)
    error = np.abs(fine.values[: len(rough.values)] - rough.values).max()
    assert 0 < error <= rough.folding <= 1e-3 * rough.amplitudes.max()
    assert fine.folding < rough.folding


def test_folding_is_told_where_the_force_jumps():
    found = spectrum(gw.find_orbit(viscous_stop()), "x''")  # lines fall with 1/order: no sampling is fine enough
    assert found.folding > 1e-6 * found.amplitudes.max()
    assert found.folding < 1e-3 * found.amplitudes.max()


@pytest.mark.parametrize("window", ["flattop", "hann"])
def test_two_frequencies_through_a_window(window):
    # free vibration of amplitude 0.35 beside the forced one: x = 0.35 cos t + F / (1 - W^2) cos W t
    frequency = np.sqrt(2) / 2
    forced = 0.1 / (1 - frequency**2)
    system = System(("x",), [[1.0]], harmonics=[Harmonic(0.1, {"x": 1.0})], frequency=frequency)
    settled = settle(system, [0.35 + forced, 0.0])
    found = spectrum(settled, "x", SpectrumOptions(window=window))
    assert found.period == 0
    tallest, second = found.peaks(2)
    assert tallest.order == pytest.approx(1 / frequency, abs=1 / 256)
    assert second.name == "W"
    start = settled.state[0] - forced, settled.state[1]  # what is left of the free vibration at theta = 0
    assert np.hypot(*start) == pytest.approx(0.35, abs=1e-9)
    tolerance = 2e-4 if window == "flattop" else 0.16  # Hann's scallop loss is up to 15 %
    assert tallest.amplitude == pytest.approx(0.35, rel=tolerance)
    assert second.amplitude == pytest.approx(forced, rel=tolerance)
    assert found.amplitude(2.5) < 1e-4
    assert 1.0 / 256 < found.resolution < 5.0 / 256


@pytest.mark.parametrize(
    ("order", "periods", "name"),
    [
        (0, (1,), "mean"),
        (1, (1,), "W"),
        (2.0, (3,), "2W"),
        (1 / 3, (3,), "W/3"),
        (5 / 3, (1, 2, 3), "5W/3"),
        (0.5, (4,), "W/2"),
        (0.2311, (1, 2, 3), "0.2311W"),
    ],
)
def test_names_of_lines(order, periods, name):
    assert line_name(order, periods) == name


def test_a_window_that_there_is_not():
    with pytest.raises(ModelError, match=r"window is 'curtain'; write the name of a window"):
        SpectrumOptions(window="curtain")


def test_a_signal_that_is_none():
    with pytest.raises(ModelError, match="there is no signal 'q7'"):
        spectrum(gw.find_orbit(linear()), "q7")
