"""Settling: where transients lead, and how slow ones are told from motions that have settled."""

import numpy as np
import pytest
from numpy.linalg import norm

import gapwalk as gw
from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.errors import FlowError, ModelError
from gapwalk.model import Harmonic, System
from gapwalk.orbit.orbit import stroboscopic
from tests.attractors.references import figure15, strobes
from tests.systems import clutch, linear
from tests.tiers import in_campaign, keeps


@pytest.fixture(scope="module")
def fig15() -> System:
    return gw.paper.case("15")


def test_a_linear_oscillator_comes_to_its_closed_form():
    system = System(("x",), [[1.0]], [[0.02]], harmonics=[Harmonic(0.3, {"x": 1.0}, phase=0.4)], frequency=0.8)
    found = settle(system, [40.0, -3.0])
    response = 0.3 * np.exp(0.4j) / (1 - 0.8**2 + 0.02j * 0.8)
    assert found.converged
    assert found.period == 1
    assert found.state == pytest.approx([response.real, (1j * 0.8 * response).real], abs=1e-12)
    assert found.periods < 200  # its transient halves every 9 periods: it is recognised long before it has died away


@pytest.mark.parametrize("follow", [settle, gw.classify])
def test_a_linear_oscillator_with_negative_damping_diverges(follow):
    system = System(("x",), [[1.0]], [[-0.08]], harmonics=[Harmonic(0.3, {"x": 1.0})], frequency=2.9)
    with pytest.raises(FlowError, match="diverges"):
        follow(system)


@pytest.mark.parametrize(("frequency", "period"), [(0.45, 3), (0.82, 3), (0.63, 1)])
def test_periodic_motions_of_figure_15_agree_with_scipy(fig15, frequency, period):
    found = settle(fig15, frequency=frequency)
    assert found.converged
    assert found.period == period
    assert found.orbit is not None
    assert found.orbit.stable
    again = strobes(figure15(frequency), frequency, found.state, period)
    assert again == pytest.approx(stroboscopic(found.orbit)[[*range(1, period), 0]], abs=2e-8)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["15", in_campaign("29")])
def test_what_is_recognised_early_is_what_a_long_wait_gives(case):
    # 300 periods were once too few at W = 0.45, and 1,500 enough
    random = np.random.default_rng(7)
    early = []
    for frequency in (0.45, *random.uniform(0.3, 1.6, 24)):
        system = gw.paper.case(case).at(frequency=float(frequency))
        found = settle(system, random.normal(size=4) * (2, 2, 1, 1))
        if found.orbit is None:
            continue
        early.append(found.periods)
        rate = np.abs(found.orbit.multipliers).max() ** (1 / found.orbit.period)
        last = Strobe(system).run(found.strobes[-1], min(6000, int(40 - 16 / np.log(rate))))[-1]
        assert norm(stroboscopic(found.orbit) - last, axis=1).min() < 1e-4
    assert len(early) > 15
    assert np.median(early) < 150


@keeps("0.001")
@pytest.mark.parametrize("distance", [1e-3, 1e-5, 1e-6])
def test_slow_transients_at_a_flip_are_told_apart(distance):
    # figure 13 flips at 1.331838029; period 2 lies below. A multiplier of 0.99999 would need a million periods
    flip = 1.3318380286
    below, above = (settle(clutch(frequency=flip + sign * distance)) for sign in (-1, 1))
    assert (below.period, above.period) == (2, 1)
    for found in (below, above):
        assert found.orbit is not None
        assert found.orbit.stable
        assert found.periods < 500


def test_a_start_on_an_unstable_motion_is_left():
    system = clutch(frequency=1.32)
    unstable = gw.find_orbit(system, start="rest")
    assert unstable.instability.label == "below"
    found = settle(system, unstable.state)
    assert found.period == 2
    assert "was next to an unstable motion" in found.evidence[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "few", "many", "kept"), [(0.858, 2000, 40_000, 12_000), in_campaign(0.8588, 4000, 100_000, 40_000)]
)
def test_a_start_next_to_a_weakly_unstable_motion_does_not_stay(fig15, frequency, few, many, kept):
    # beyond the Neimark-Sacker point at 0.859849 a deviation needs thousands of periods to grow to e times its size:
    # the averages of the whole motion hardly change for a long time, and yet it is not where it will be
    unstable = gw.find_orbit(fig15, 3, [1.0643, 0.6204, 0.2334, -0.3085], frequency=frequency)
    assert 1.00001 < np.abs(unstable.multipliers).max() < 1.001
    found = settle(unstable.system, unstable.state + 1e-4, SettleOptions(max_periods=few))
    assert "displaced from" in found.evidence[0]
    assert not found.converged
    assert "raise max_periods" in found.evidence[-1]
    found = settle(unstable.system, unstable.state + 1e-4, SettleOptions(max_periods=many))
    assert found.converged
    assert found.orbit is None
    torus = Strobe(unstable.system).run(unstable.state + 0.02, kept)[-1024:]
    sizes = [[np.ptp(each[k::3], axis=0).max() for k in range(3)] for each in (found.strobes, torus)]
    assert sorted(sizes[0]) == pytest.approx(sorted(sizes[1]), rel=0.01)


@pytest.mark.parametrize("frequency", [0.4, 0.2])
def test_chaos_settles_without_a_period(fig15, frequency):
    found = settle(fig15, frequency=frequency)
    assert found.converged
    assert found.period is None
    assert found.orbit is None
    assert found.periods >= 1024


def test_a_decay_within_fluctuations_is_seen(fig15):
    # this torus is approached at 1.4e-3 a period: after 1,000 periods a quarter of the way is still left
    few = settle(fig15, "rest", SettleOptions(max_periods=1200), frequency=0.856)
    assert not few.converged
    assert "raise max_periods" in few.evidence[-1]
    assert settle(fig15, "rest", frequency=0.856).converged


def test_the_longest_period_is_an_option(fig15):
    few = settle(fig15, "rest", SettleOptions(max_periods=3000, max_period=2), frequency=0.45)
    assert few.converged
    assert few.period is None
    assert "it repeats to" in few.evidence[-1]
    assert "after 3 forcing periods: raise max_period" in few.evidence[-1]


def test_the_record_gives_the_motion(fig15):
    found = settle(fig15, frequency=0.45)
    motion = found.motion()
    assert motion.theta[-1] == pytest.approx(6 * np.pi)
    assert np.hstack((motion.q[-1], motion.v[-1])) == pytest.approx(found.state, abs=1e-9)
    assert {record.contact for record in motion.contacts} == {"stage2"}
    assert "period 3, settled after" in repr(found)


def test_an_unforced_system_comes_to_rest():
    system = System(("x",), [[1.0]], [[0.1]], frequency=1.0)
    found = settle(system, [1.0, 0.0])
    assert found.period == 1
    assert found.state == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("start", ["soon", [1.0, 2.0]])
def test_starts_that_make_no_sense(start):
    with pytest.raises(ModelError):
        settle(linear(), start)
