"""Agreement of two histories against closed forms, and two motions side by side."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.compare_motions import agreement, lines_of, orders_of
from gapwalk.errors import ModelError
from tests.systems import clutch, linear


def test_lines_are_those_of_a_sum_of_cosines_at_uneven_angles() -> None:
    theta = np.sort(np.random.default_rng(2).uniform(0.0, 40.0, 300))
    values = 7.0 + 2.0 * np.cos(0.5 * theta + 0.4) - 0.3 * np.sin(3.0 * theta)
    found = lines_of(theta, values, orders_of(2, 3.0))
    expected = np.zeros(6, dtype=complex)
    expected[0], expected[5] = 2.0 * np.exp(0.4j), 0.3j
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_agreement_of_two_cosines_is_known() -> None:
    theta = 2 * np.pi * np.arange(64) / 64
    found = agreement(theta, 5.0 + np.cos(theta), 2.0 * np.cos(theta + 0.3), np.array([1.0, 2.0]))
    assert found.rms == pytest.approx(np.sqrt((1 + 4 - 4 * np.cos(0.3)) / 2), rel=1e-12)
    assert found.relative == pytest.approx(np.sqrt(1 + 4 - 4 * np.cos(0.3)), rel=1e-12)
    assert found.correlation == pytest.approx(np.cos(0.3), rel=1e-12)
    first, second = found.lines
    assert (first.first, first.second, first.difference) == pytest.approx((1.0, 2.0, 1.0), rel=1e-12)
    assert first.shift == pytest.approx(0.3, rel=1e-12)
    assert second.first == pytest.approx(0.0, abs=1e-14)


def test_two_motions_side_by_side_have_the_lines_of_their_spectra() -> None:
    first, second = (gw.find_orbit(clutch(frequency=0.8, **{"stage2.impact_damping": b})) for b in (0.05, 0.2))
    found = gw.analysis.contrast(first, second, names=("light", "heavy"))
    assert [pair.signal for pair in found.pairs] == ["q1''", "stage2.force"]
    for pair in found.pairs:
        assert pair.agreement is not None
        for line in pair.agreement.lines[:10]:
            for amplitude, spectrum in zip((line.first, line.second), pair.spectra, strict=True):
                assert amplitude == pytest.approx(spectrum.amplitude(line.order), abs=1e-5 * spectrum.amplitudes.max())
        assert 0 < pair.agreement.relative < 1
    assert "light, heavy: q1'' differs by 0." in repr(found)


def test_motions_of_different_periods_are_seen_over_both() -> None:
    system = gw.paper.case("15").at(frequency=0.45)
    two, three = (gw.find_orbit(linear(), 2), gw.settle(system).orbit)
    assert three is not None
    pair = gw.analysis.contrast(gw.find_orbit(system), three, ["q1"]).pairs[0]
    assert pair.theta[-1] == pytest.approx(6 * np.pi)
    assert pair.agreement is not None
    assert pair.agreement.lines[0].order == pytest.approx(1 / 3)
    with pytest.raises(ModelError, match="no signal 'q1'"):
        gw.analysis.contrast(three, two, ["q1"])


def test_without_a_period_there_is_no_agreement() -> None:
    chaos = gw.settle(gw.paper.case("15").at(frequency=0.4), options=gw.SettleOptions(max_periods=64))
    found = gw.analysis.contrast(chaos, chaos, ["q1"])
    assert found.pairs[0].agreement is None
    assert "q1 no common period" in repr(found)
