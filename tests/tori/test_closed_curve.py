"""Closed curves by trigonometric interpolation."""

import numpy as np
import pytest

from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.tori.torus import TURN, at_phases, of_quasi_periodic, phases, resampled, rotation_matrices, tail, tangents


def curve(psi):
    """A curve with harmonics up to 4, and its derivative."""
    values = np.column_stack((np.cos(psi) - 0.3 * np.sin(4 * psi), 2.0 + np.sin(2 * psi)))
    slopes = np.column_stack((-np.sin(psi) - 1.2 * np.cos(4 * psi), 2.0 * np.cos(2 * psi)))
    return values, slopes


@pytest.mark.parametrize("turns", [0.0, 0.1379, 0.5, -0.4])
def test_rotation_is_exact_for_the_harmonics_of_a_curve(turns):
    psi = phases(11)
    matrix, slope = rotation_matrices(11, turns)
    values, slopes = curve(psi + TURN * turns)
    assert matrix @ curve(psi)[0] == pytest.approx(values, abs=1e-14)
    assert slope @ curve(psi)[0] == pytest.approx(TURN * slopes, abs=1e-12)


def test_interpolation_and_derivative_are_exact():
    psi = np.array([0.3, 2.2, -5.0])
    samples = curve(phases(9))[0]
    assert at_phases(samples, psi) == pytest.approx(curve(psi)[0], abs=1e-14)
    assert tangents(samples) == pytest.approx(curve(phases(9))[1], abs=1e-13)
    assert resampled(samples, 21) == pytest.approx(curve(phases(21))[0], abs=1e-14)
    assert tail(samples) > 0.1
    assert tail(resampled(samples, 21)) < 1e-14


def test_a_curve_is_found_from_its_orbit():
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    orbit = curve(TURN * golden * np.arange(3000))[0]
    found = of_quasi_periodic(orbit, golden, 15, birkhoff_weights(3000))
    assert found == pytest.approx(curve(phases(15))[0], abs=1e-12)
