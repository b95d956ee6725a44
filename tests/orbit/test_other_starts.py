"""Orbits that no transient leads to: of a gear pair between its flips, beside an independent integrator."""

import math

import numpy as np
import pytest

from gapwalk.errors import ConvergenceError
from gapwalk.model import Harmonic, System, backlash
from gapwalk.orbit import find_orbit
from tests.independent import integrate as reference


def gear(frequency: float, damping: float = 0.1, stiffness: float = 0.0) -> System:
    """A gear pair under a mean load, whose motion of period 1 is unstable at many frequencies."""
    mesh = backlash("mesh", {"x": 1.0}, 1.0, 1.0)
    load = [Harmonic(0.2, {"x": 1.0})]
    return System(("x",), [[stiffness]], [[damping]], None, [mesh], {"x": 0.1}, load, frequency)


@pytest.mark.parametrize("frequency", [1.6, 1.5, 1.4, 1.0, 0.3])
def test_an_unstable_orbit_is_found_from_other_starts(frequency):
    system = gear(frequency)
    orbit = find_orbit(system)
    assert not orbit.stable
    assert reference(system, orbit.state) == pytest.approx(orbit.state, abs=1e-7)


def test_what_was_tried_is_said_where_there_is_no_orbit():
    # undamped, at its natural frequency: the motion grows for ever
    system = System(("x",), [[1.0]], harmonics=[Harmonic(1.0, {"x": 1.0})], frequency=1.0)
    with pytest.raises(ConvergenceError) as error:
        find_orbit(system)
    for words in ("a transient from rest", "states that nearly repeat", "frequency 0.8", "Damping is zero"):
        assert words in str(error.value)
    assert 'start = "settle"' not in str(error.value)  # the default, which was used


def test_an_orbit_of_negative_damping_is_found_although_motions_grow():
    system = gear(2.0, damping=-0.1, stiffness=1.0)
    orbit = find_orbit(system)
    load = 0.2 / complex(1.0 - 4.0, -0.2)
    mean = 0.1
    assert orbit.state == pytest.approx([mean + load.real, (2j * load).real], abs=1e-10)
    assert np.abs(orbit.multipliers) == pytest.approx(math.exp(0.05 * math.pi), rel=1e-10)
