"""Signals: names, sums, and derivatives by a complex step against those of real steps."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapwalk.errors import ModelError
from gapwalk.flow.motion import Motion, Signal, integrate, signal_names, signal_of
from gapwalk.model.coefficients import ParameterLine
from tests.systems import clutch, random_systems


def test_a_sum_of_signals_is_their_sum_with_a_name() -> None:
    motion = integrate(clutch(), np.array([1.2, 0.3, 0.0, 0.1]))
    signal = signal_of(motion.system, {"q1''": 0.5, "q3": -2, "stage2": 1.0})
    expected = 0.5 * motion.a[:, 0] - 2 * motion.q[:, 1] + motion.forces[:, 0]
    np.testing.assert_allclose(signal.of(motion), expected, rtol=1e-15, atol=1e-15)
    assert signal.name == "0.5 q1'' - 2 q3 + stage2"
    assert signal_of(motion.system, {"q3'": -1.0, "q1": 1.0}).name == "-q3' + q1"
    assert signal_of(motion.system, "q1''") == signal_of(motion.system, {"q1''": 1.0}) == Signal((("q1''", 1.0),))


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(random_systems(), st.integers(0, 2**32 - 1))
def test_slopes_are_those_of_small_real_steps(system, seed) -> None:
    """Also where stages are closed, with cubic springs and every law of damping."""
    random, n = np.random.default_rng(seed), system.size
    theta, states, along = random.uniform(0, 6, 9), random.normal(0, 2, (9, 2 * n)), random.normal(size=(9, 2 * n))
    name, step = system.structure.names[int(random.integers(len(system.structure.names)))], 1e-6
    line = ParameterLine(system, name)
    coefficients = line.coefficients(system[name])[1]

    def moved(sign: int) -> Motion:
        q = states + sign * step * along
        there = line.system_at(system[name] + sign * step)
        return Motion(there, theta + sign * step * 0.7, q[:, :n], q[:, n:], ())

    for known in signal_names(system):
        signal = Signal(((known, 1.0),))
        slope = signal.slope(Motion(system, theta, states[:, :n], states[:, n:], ()), along, coefficients, 0.7)
        difference = (signal.of(moved(1)) - signal.of(moved(-1))) / (2 * step)
        np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-6 * (1 + np.abs(difference).max()))


def test_what_is_no_signal_is_refused() -> None:
    with pytest.raises(ModelError, match=r"there is no signal .*; did you mean q"):
        signal_of(clutch(), "q2'")
    with pytest.raises(ModelError, match="the factor of q1 is nan; it must be a finite number"):
        signal_of(clutch(), {"q1": float("nan")})
    with pytest.raises(ModelError, match="a signal names at least one"):
        signal_of(clutch(), {})
