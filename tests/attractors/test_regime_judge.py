"""Regimes of many motions: judged on maps whose answers are in the books, and on systems beside the exact flow."""

import numpy as np
import pytest

from gapwalk.attractors.many_motions import ContactFigures, motions_of
from gapwalk.attractors.regimes import Regime, RegimeOptions, judge, regime_word, settle_doubts
from gapwalk.orbit import find_orbit
from tests.systems import clutch, linear

PLAIN = RegimeOptions(forces=False)


class MapMotions:
    """A map x -> f(x, a) in place of a flow: each motion has its own a."""

    error = 0.0

    def __init__(self, function, values):
        self.function, self.values = function, np.asarray(values, dtype=float)

    def advance(self, states, periods):
        for _ in range(periods):
            states = self.function(states, self.values)
        return states

    def strobes(self, states, periods, after=0):
        states = self.advance(states, after)
        track = []
        for _ in range(periods):
            states = self.function(states, self.values)
            track.append(states)
        return np.array(track)

    def contacts(self, states, periods):
        nothing = np.zeros((len(states), 0))
        return ContactFigures(self.advance(states, periods), nothing, nothing, nothing, nothing)

    def part(self, which):
        return MapMotions(self.function, self.values[which])


def logistic(states, a):
    with np.errstate(over="ignore", invalid="ignore"):  # beyond a = 4 it diverges
        x = a * states[:, 0] * (1.0 - states[:, 0])
    return np.column_stack((x, 0.3 * states[:, 1]))


def rotation(states, a):
    """Round the unit circle by a turn each time; the radius contracts to 1."""
    z = states[:, 0] + 1j * states[:, 1]
    z = z / np.abs(z) * (1.0 + 0.5 * (np.abs(z) - 1.0)) * np.exp(2j * np.pi * a)
    return np.column_stack((z.real, z.imag))


def judged(function, values, start, options=PLAIN):
    states = np.tile(np.asarray(start, dtype=float), (len(values), 1))
    return judge(MapMotions(function, values), states, np.ones_like(states), options)


def test_the_logistic_map_has_the_periods_of_the_books():
    """May 1976, Nature 261, 459-467: doublings at 3, 3.449490, 3.544090, 3.564407, 3.568759; the window of period 3."""
    values = [2.8, 3.2, 3.5, 3.55, 3.567, 3.5695, 3.83, 3.845, 3.7389149, 3.63]  # the last but one: superstable
    found = judged(logistic, values, (0.3, 0.1), RegimeOptions(forces=False, max_period=32))
    assert found.periods.tolist() == [1, 2, 4, 8, 16, 32, 3, 6, 5, 6]
    assert np.all(found.regimes == Regime.PERIODIC)


def test_a_slow_transient_is_no_longer_period():
    """Beside the flip at 3 the multiplier is 2 - a: at 2.9999 the motion alternates for 100,000 iterations."""
    found = judged(logistic, [2.99, 2.997, 3.001, 3.01, 2.9999], (0.3, 0.1))
    assert found.periods.tolist() == [1, 1, 2, 2, 0]
    assert found.regimes[-1] == Regime.QUASI_PERIODIC  # neither parting nor coming together: the exact flow must tell


def test_a_spiral_into_a_point_is_not_taken_for_a_period_that_it_nearly_has():
    def about_one(states, a):
        z = (states[:, 0] - 1.0 + 1j * states[:, 1]) * 0.99 * np.exp(2j * np.pi * a)
        return np.column_stack((1.0 + z.real, z.imag))

    found = judged(about_one, [1 / 3 + 1e-4, 1 / 7 - 1e-5, 0.2], (1.4, 0.1))
    assert found.periods.tolist() == [1, 1, 1]


def test_the_logistic_map_is_chaotic_with_the_exponent_ln_2():
    found = judged(logistic, [4.0, 3.9, 3.7, 3.8282], (0.3, 0.1))
    assert np.all(found.regimes == Regime.CHAOTIC)  # the last one creeps past a period of 3 in between
    assert found.exponents[0] == pytest.approx(np.log(2.0), abs=0.02)
    assert not found.periods.any()


def test_a_rotation_is_quasi_periodic_or_locked():
    found = judged(rotation, [(np.sqrt(5) - 1) / 2, np.sqrt(2) - 1, 2 / 7, 3 / 16], (0.4, 0.2))
    assert found.regimes.tolist() == [Regime.QUASI_PERIODIC, Regime.QUASI_PERIODIC, Regime.PERIODIC, Regime.PERIODIC]
    assert found.periods.tolist() == [0, 0, 7, 16]
    assert np.all(np.abs(found.exponents[:2]) < 1e-3)


def test_motions_that_run_away_are_told_from_the_others():
    found = judged(logistic, [4.5, 3.2], (0.3, 0.1))
    assert found.regimes.tolist() == [Regime.RUNAWAY, Regime.PERIODIC]
    assert found.periods.tolist() == [0, 2]


def test_one_motion_does_not_change_the_verdict_on_another():
    values = [2.8, 3.2, 3.83, 4.0, 3.5695]
    whole = judged(logistic, values, (0.3, 0.1))
    alone = [judged(logistic, [value], (0.3, 0.1)) for value in values]
    assert whole.periods.tolist() == [each.periods[0] for each in alone]
    assert whole.exponents == pytest.approx([each.exponents[0] for each in alone], nan_ok=True)


def test_an_undamped_oscillator_is_quasi_periodic_and_a_damped_one_is_not():
    """Free vibration at its own frequency beside the forced one: two frequencies, for ever."""
    systems = [linear(damping=damping) for damping in (0.0, 0.1)]
    for system, regime in zip(systems, (Regime.QUASI_PERIODIC, Regime.PERIODIC), strict=True):
        states = np.array([[0.5, -0.2, 0.1, 0.3]])
        found = judge(motions_of(system, states), states, system.state_scales()[None], RegimeOptions())
        assert found.regimes.tolist() == [regime]


def test_forces_and_impacts_are_those_of_the_orbit():
    system = clutch(frequency=0.6)
    states = np.zeros((1, 4))
    found = judge(motions_of(system, states), states, system.state_scales()[None], RegimeOptions())
    orbit = find_orbit(system, int(found.periods[0]), found.states[0])
    assert orbit.stable
    peak = max(orbit.measure("max.stage2"), -orbit.measure("min.stage2"))
    assert found.peaks[0, 0] == pytest.approx(peak, rel=2e-3)
    assert found.impacts[0, 0] == sum(orbit.closings) / orbit.period


def test_a_doubtful_motion_that_spirals_into_an_orbit_is_called_periodic():
    system = linear(damping=1e-5)  # its free vibration takes 10^5 forcing periods to die away
    states = find_orbit(system).state[None, :] + 0.02
    fast = judge(motions_of(system, states), states, system.state_scales()[None], PLAIN)
    assert fast.regimes.tolist() == [Regime.QUASI_PERIODIC]
    exact = settle_doubts(fast, [lambda: system])
    assert exact.regimes.tolist() == [Regime.PERIODIC]
    assert exact.periods.tolist() == [1]


def test_words_and_options():
    assert regime_word(Regime.PERIODIC, 3) == "period 3"
    assert regime_word(Regime.CHAOTIC, 0) == "chaotic"
    assert [Regime(k).text for k in (-2, -1, 0, 1)] == ["diverges", "undecided", "periodic", "quasi-periodic"]
