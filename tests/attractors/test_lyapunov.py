"""Lyapunov exponents: eigenvalues of linear systems, traces, and SciPy."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.lyapunov import LyapunovOptions, lyapunov, lyapunov_run, of_multipliers
from gapwalk.attractors.rattle import quadrature
from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import settle
from gapwalk.errors import ModelError
from gapwalk.model import Contact, Harmonic, Stage, System
from tests.attractors.references import figure15, largest_exponent, ueda
from tests.systems import linear, viscous_stop


def ueda_system(damping: float = 0.05, force: float = 7.5) -> System:
    """The same as `references.ueda`: a cubic contact without a gap."""
    spring = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    return System(("x",), [[0.0]], [[damping]], contacts=[spring], harmonics=[Harmonic(force, {"x": 1.0})])


@pytest.mark.parametrize("damping", [0.1, 4.0])
def test_a_linear_system_has_the_real_parts_of_its_eigenvalues(damping):
    system = linear(damping)
    inverse = np.linalg.inv(system.matrix("mass"))
    block = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-inverse @ system.matrix("stiffness"), -inverse @ system.matrix("damping")]]
    )
    expected = np.sort(np.linalg.eigvals(block).real)[::-1]
    found = lyapunov(system, [0.3, 0.1, 0.0, -0.2], LyapunovOptions(max_periods=1024))
    assert found.exponents == pytest.approx(expected, abs=1e-7)
    assert np.all(np.abs(found.exponents - expected) <= 5 * found.errors + 1e-11)
    assert found.regular
    assert found.dimension == 0.0


def test_the_exponents_of_an_orbit_are_those_of_its_multipliers():
    orbit = settle(gw.paper.case("15"), frequency=0.82).orbit
    assert orbit is not None
    direct = lyapunov(orbit.system, orbit.state, LyapunovOptions(max_periods=3072))
    expected = of_multipliers(orbit.system, orbit.multipliers, 3)
    assert direct.exponents == pytest.approx(expected.exponents, abs=1e-6)
    span = 3 * 2 * np.pi / 0.82
    assert expected.exponents[0] == pytest.approx(np.log(abs(orbit.multipliers[0])) / span)


def test_the_sum_is_the_divergence_of_the_flow():
    # of an orbit: -(trace of C) - n1 beta mean |g|, exactly; C as in figure 15
    orbit = settle(gw.paper.case("15"), frequency=0.45).orbit
    assert orbit is not None
    along = quadrature(orbit.system, orbit.state, 3)
    x = along.motion.q[:, 0]
    g = np.maximum(x - 1, 0) + np.minimum(x + 1, 0)
    mean = along.weights @ np.abs(g) / along.weights.sum()
    found = of_multipliers(orbit.system, orbit.multipliers, 3)
    assert found.exponents.sum() == pytest.approx(-(0.04 + 0.06) - 0.9 * 0.05 * mean, abs=1e-10)


def test_the_sum_where_the_force_jumps():
    # a damper that acts in contact only: the sum is -c/m - c_contact * (share of the time in contact)
    orbit = settle(viscous_stop()).orbit
    assert orbit is not None
    closes, opens = (next(e.theta for e in orbit.events if e.enters is way) for way in (True, False))
    share = (opens - closes) % (2 * np.pi) / (2 * np.pi)
    found = of_multipliers(orbit.system, orbit.multipliers, orbit.period)
    assert orbit.closings == (1,)
    assert found.exponents.sum() == pytest.approx(-0.08 - 0.4 * share, abs=1e-10)


def test_chaos_of_the_duffing_oscillator_has_a_positive_exponent_and_its_constant_divergence():
    system = ueda_system()
    found = lyapunov(system, settle(system).state, LyapunovOptions(max_periods=1024))
    assert found.exponents[0] > 5 * found.errors[0]
    assert found.exponents.sum() == pytest.approx(-0.05, abs=1e-12)
    assert not found.regular


@pytest.mark.slow
def test_chaos_of_the_duffing_oscillator_agrees_with_scipy():
    system = ueda_system()
    state = settle(system).state
    found = lyapunov(system, state)
    strobes = Strobe(system).run(state, 4000)[::40].T
    expected, error = largest_exponent(ueda(0.05, 7.5), 1.0, strobes, 60, steps=40)
    assert abs(found.exponents[0] - expected) < 4 * np.hypot(error, found.errors[0])
    assert found.exponents[0] == pytest.approx(expected, rel=0.06)
    assert found.exponents.sum() == pytest.approx(-0.05, abs=1e-12)  # constant divergence
    assert not found.regular
    assert found.dimension == pytest.approx(1 + found.exponents[0] / abs(found.exponents[1]))


@pytest.mark.slow
def test_chaos_of_figure_15_agrees_with_scipy():
    system = gw.paper.case("15").at(frequency=0.4)
    state = settle(system).state
    found = lyapunov(system, state)
    strobes = Strobe(system).run(state, 3200)[::40].T
    expected, error = largest_exponent(figure15(0.4), 0.4, strobes, 50, steps=150)
    assert abs(found.exponents[0] - expected) < 4 * np.hypot(error, found.errors[0])
    assert found.exponents[0] == pytest.approx(expected, rel=0.08)
    assert found.errors[0] < 0.05 * found.exponents[0]
    assert found.converged


@pytest.mark.slow
def test_a_shorter_average_has_an_error_that_holds():
    system = ueda_system()
    state = settle(system).state
    long = lyapunov(system, state, LyapunovOptions(max_periods=8192, relative=0.0, absolute=0.0))
    starts = Strobe(system).run(state, 480)[::60]
    short = [lyapunov(system, start, LyapunovOptions(max_periods=512)) for start in starts]
    off = np.array([(each.exponents[0] - long.exponents[0]) / each.errors[0] for each in short])
    assert np.sqrt(np.mean(off**2)) < 1.8
    assert np.abs(off).max() < 4.5
    assert not short[0].converged
    assert long.errors[0] < 0.5 * np.median([each.errors[0] for each in short])


def test_the_exponents_of_what_settle_and_find_orbit_return():
    system = linear().at(frequency=1.3)
    settled, orbit = gw.settle(system), gw.find_orbit(system)
    known = gw.analysis.lyapunov(system, orbit.state).exponents
    for motion in (settled, orbit, gw.classify(system)):
        assert gw.analysis.lyapunov(motion).exponents == pytest.approx(known, abs=1e-9)
    for wrong in ((system,), (settled, settled.state)):
        with pytest.raises(ModelError, match=r"write lyapunov\(motion\)"):
            gw.analysis.lyapunov(*wrong)


def test_chaos_that_is_sure_needs_no_more_periods() -> None:
    gap = Contact("gap", {"x": 1.0}, (Stage(0.4, 30.0),))
    load = Harmonic(1.9, {"x": 1.0}, name="load")
    wild = System(("x",), [[0.1]], [[0.1]], contacts=[gap], harmonics=[load], mean={"x": 0.2}, frequency=0.8)
    state = settle(wild).state
    (few, strobes), (many, _) = (lyapunov_run(wild, state, sure=sure) for sure in (5.0, np.inf))
    assert few.periods < len(strobes) == 256 < many.periods
    assert few.exponents[0] > 5.0 * few.errors[0]
    assert abs(few.exponents[0] - many.exponents[0]) < 4.0 * np.hypot(few.errors[0], many.errors[0])
