"""Arnold tongues against averaging, direct integration by SciPy, and the Neimark-Sacker points at their tips."""

import io
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.tori.tongue import Tongue, TongueTipKind
from tests.computed import once
from tests.results.again import again
from tests.tiers import in_campaign

RANGES = ((2.9, 3.1), (0.0, 0.5))


def ring(mu: float, force: float, frequency: float) -> gw.System:
    """An oscillator with the limit cycle x = cos t at any mu, and a force."""
    damper = gw.force("ring", {"x": 1.0}, "mu*(x*x + v*v - 1)*v", mu=mu)
    return gw.System(
        ["x"], [[1.0]], [[0.0]], contacts=[damper], harmonics=[gw.Harmonic(force, {"x": 1.0})], frequency=frequency
    )


@once
def third(mu: float) -> Tongue:
    """The tongue in which a force of nearly three times the natural frequency locks the oscillator to a third of it."""
    torus = gw.tori.find_torus(gw.settle(ring(mu, 0.3, 3.0 + 0.4 * mu)))
    window = gw.tori.find_window(torus, "1/3", "frequency", 3.0, RANGES[0])
    assert [each.value for each in window.folds] == [window.low, window.high]
    return gw.tori.follow_tongue(window, "frequency", "harmonic1.amplitude", RANGES)


@pytest.mark.slow
def test_the_width_of_a_tongue_is_that_of_averaging() -> None:
    """x = r cos(t + phi) + b cos 3t with b = -F/8 gives phi' = -s - mu r b sin 3 phi, and r^2 = 1 - 14 b^2.

    So |s| < mu r F / 8 for a detuning of the force to 3 (1 + s), up to mu^2 and F^3.
    """
    force = 0.1
    expected = 0.75 * force * (1.0 - 7.0 * force**2 / 64.0)
    away = [third(mu).width(force) / mu / expected - 1.0 for mu in (0.1, 0.05)]
    assert abs(away[1]) < 4e-4
    assert away[0] / away[1] == pytest.approx(4.0, abs=1.0)  # second order in mu


def test_without_a_force_both_sides_meet_at_three_times_the_natural_frequency() -> None:
    tongue = third(0.1)
    assert tongue.tip is not None
    assert tongue.tip.kind is TongueTipKind.MEETING
    np.testing.assert_allclose(tongue.tip.values, (3.0, 0.0), atol=1e-6)
    assert (tongue.period, tongue.curves, tongue.complete, tongue.failures) == (3, 1, True, ())
    assert np.isnan(tongue.width(0.6))


@pytest.mark.parametrize(
    ("share", "locks"), [in_campaign(-0.1, False), in_campaign(0.1, True), (0.9, True), (1.1, False)]
)
def test_motions_lock_between_the_sides_and_not_beyond(share: float, locks: bool) -> None:
    mu, force = 0.1, 0.2
    low, high = third(mu).edges(force)
    frequency = low + share * (high - low)

    def slope(t, y):
        x, v = y
        return v, -x - mu * (x * x + v * v - 1.0) * v + force * math.cos(frequency * t)

    strobes = 3 * 2.0 * math.pi / frequency * np.arange(200, 800)
    found = solve_ivp(slope, (0.0, strobes[-1]), [1.0, 0.0], "DOP853", t_eval=strobes, rtol=1e-9, atol=1e-11).y
    spread = np.ptp(found[:, -400:], axis=1).max()
    assert bool(spread < 1e-4) is locks
    assert locks or spread > 0.5  # it drifts round the whole circle


def test_both_sides_are_verified_by_another_integrator() -> None:
    assert gw.verify(third(0.1)).ok


@pytest.mark.slow
def test_a_window_that_is_narrower_than_a_guess_is_found() -> None:
    """The rotation number of the torus is far from 2/7, and the window is 3e-4 wide, 2e-3 from the guess."""
    torus = gw.tori.find_torus(gw.settle(ring(0.5, 0.5, 1.45)), gw.tori.TorusOptions(accuracy=1e-6))
    ratio = "2/7" if torus.rotation < 0.5 else "5/7"
    window = gw.tori.find_window(torus, ratio, "frequency", 1.445, (1.4, 1.5))
    assert window.is_whole
    assert window.orbit.period == 7
    assert window.width == pytest.approx(2.8e-4, rel=0.1)
    middle = 0.5 * (window.low + window.high)
    assert gw.settle(ring(0.5, 0.5, middle), window.orbit.state).period == 7
    assert gw.settle(ring(0.5, 0.5, window.low - 5e-5), window.orbit.state).period != 7


@pytest.mark.slow
def test_the_tip_is_the_neimark_sacker_point_whose_multipliers_turn_by_the_fraction() -> None:
    """Figure 15's window of 1/9, against the locus of the Neimark-Sacker point from which its tori come."""
    case = gw.paper.case("15")
    torus = gw.tori.find_torus(gw.settle(case, frequency=1.13))
    window = gw.tori.find_window(torus, "1/9", "frequency", 1.132, (1.12, 1.14))
    tongue = gw.tori.follow_tongue(window, "frequency", "harmonic1.amplitude", ((1.0, 1.3), (0.1, 0.5)))
    assert tongue.tip is not None
    assert tongue.tip.kind is TongueTipKind.NEIMARK_SACKER
    start = gw.find_orbit(case.at(frequency=1.113), 2, gw.settle(case, frequency=1.113).strobes[-1])
    (born,) = gw.follow(start, "frequency", 1.12).special("neimark-sacker")
    locus = gw.follow_locus(born, "frequency", "harmonic1.amplitude", ((1.05, 1.25), (0.2, 0.55)))
    # the locus passes the angle of the fraction twice
    away = np.array([point.angle for point in locus.points]) - 2.0 * np.pi / 9.0
    (passed,) = np.nonzero(away[1:] * away[:-1] < 0.0)
    shares = away[passed] / (away[passed] - away[passed + 1])
    places = locus.values[passed] + shares[:, None] * (locus.values[passed + 1] - locus.values[passed])
    assert len(places) == 2
    assert np.abs(places / tongue.tip.values - 1.0).max(axis=1).min() < 1e-4
    orbit = gw.find_orbit(
        case.at({"frequency": tongue.tip.values[0], "harmonic1.amplitude": tongue.tip.values[1]}),
        2,
        locus.points[passed[1]].orbit.state,
    )
    assert orbit.multipliers[:2] == pytest.approx(np.exp([2j * np.pi / 9.0, -2j * np.pi / 9.0]), abs=1e-7)
    # towards the tip the width falls like the power 9/2 - 1 of the distance, up to a share in proportion to it
    widths = [tongue.width(tongue.tip.values[1] + away) for away in (0.0005, 0.001, 0.002)]
    powers = np.diff(np.log(widths)) / math.log(2.0)
    assert powers[1] < powers[0] < 3.5
    assert 2.0 * powers[0] - powers[1] == pytest.approx(3.5, abs=0.1)


STUDY = """
coordinates = ["x"]
stiffness = [[1.0]]
damping = [[0.0]]

[[force]]
name = "ring"
deflection = { x = 1.0 }
law = "mu*(x*x + v*v - 1)*v"
mu = 0.8

[[harmonic]]
amplitude = 0.502
acts_on = { x = 1.0 }

[study]
kind = "tori"
parameter = "frequency"
from = 1.29
to = 1.323
max_period = 1
accuracy = 1e-5
samples = 17
workers = 1
tongues = { parameter = "harmonic1.amplitude", from = 0.4, to = 0.6 }
"""


def test_a_tongue_is_kept_and_drawn(tmp_path) -> None:
    tongue = third(0.1)
    kept = again(tongue)
    assert (kept.tip, kept.ratio) == (tongue.tip, tongue.ratio)
    np.testing.assert_array_equal(kept.sides[0].values, tongue.sides[0].values)
    gw.plot.save([kept], tmp_path / "tongue.png")


@pytest.mark.slow
def test_a_file_asks_for_tongues(tmp_path) -> None:
    path = tmp_path / "ring.gapwalk"
    finding = gw.run(gw.read_study(io.StringIO(STUDY)), path).finding
    assert finding is not None
    found = finding.record
    assert found.complete
    assert found.failures == ()
    assert {each.period for each in found.tongues} == {13}
    place, tongue = 0, found.tongues[0]
    assert str(tongue.ratio) in ("2/13", "11/13")
    assert tongue.tip is not None
    # at the tip the orbit of period 1 has multipliers on the unit circle, with the angle of the fraction
    frequency, amplitude = tongue.tip.values
    orbit = gw.find_orbit(ring(0.8, amplitude, frequency))
    np.testing.assert_allclose(np.abs(orbit.multipliers), 1.0, atol=1e-7)
    np.testing.assert_allclose(np.abs(np.angle(orbit.multipliers)), 4.0 * np.pi / 13.0, atol=1e-7)
    kept = gw.open_result(path).finding
    assert kept is not None
    stored = kept.record
    assert stored.tongues[place].tip.values == tongue.tip.values
    assert list(stored.tables()) == ["tori", "events", "ends", "tongues"]
    assert "tongue 2/13" in str(stored.summary()) or "tongue 11/13" in str(stored.summary())
    assert gw.verify(path).ok
    gw.plot.save(list(stored.tongues), tmp_path / "tongues.png")
    gw.save_html(gw.open_result(path), tmp_path / "ring.html")


@pytest.mark.slow
def test_a_window_in_which_a_family_ends_has_a_tongue_too() -> None:
    """The range ends just beyond a window of 2/13 at 1.3218."""
    text = STUDY.replace("amplitude = 0.502", "amplitude = 0.5").replace("to = 1.323", "to = 1.32194")
    finding = gw.run(gw.read_study(io.StringIO(text))).finding
    assert finding is not None
    found = finding.record
    # leaps also meet windows of 3/20, 2e-12 wide, whose tongues may be too narrow to be followed: that is said
    assert [each for each in found.failures if "3/20" not in each] == []
    last = found.families[0].ends[1].window
    assert last is not None
    assert [side.period for side in found.tongues[-1].sides] == [13, 13]
    for side, fold in zip(found.tongues[-1].sides, last.folds, strict=True):
        assert abs(side.values[:, 0] - fold.value).min() < 1e-9


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ('tongues = { parameter = "harmonic1.amplitude", from = 0.6, to = 0.9 }', "has 0.502, outside of it"),
        ('tongues = { parameter = "frequency", from = 0.6, to = 0.9 }', "which is the first one"),
        ('tongues = { parameter = "harmonic2.amplitude", from = 0.6, to = 0.9 }', "harmonic2"),
    ],
)
def test_impossible_tongues_are_refused(given: str, words: str) -> None:
    old = STUDY.splitlines()[-1]
    with pytest.raises(ModelError, match=words):
        gw.run(gw.read_study(io.StringIO(STUDY.replace(old, given))))


def test_windows_and_tongues_that_do_not_exist_are_refused() -> None:
    torus = gw.tori.find_torus(gw.settle(ring(0.1, 0.3, 3.04)))
    with pytest.raises(ModelError, match="write a fraction"):
        gw.tori.find_window(torus, "third", "frequency", 3.0, (2.9, 3.1))
    with pytest.raises(ModelError, match="outside the range"):
        gw.tori.find_window(torus, "1/3", "frequency", 3.0, (3.01, 3.1))
    with pytest.raises(ModelError, match="repeat after 1001 forcing periods"):
        gw.tori.find_window(torus, "333/1001", "frequency", 3.0, (2.9, 3.1))
    with pytest.raises(ConvergenceError, match="no orbits of 2 forcing periods"):
        gw.tori.find_window(torus, "1/2", "frequency", 3.0, (2.9, 3.1))
    window = gw.tori.find_window(torus, "1/3", "frequency", 3.0, (2.999, 3.001))
    assert not window.is_whole
    with pytest.raises(ModelError, match="has no two folds"):
        gw.tori.follow_tongue(window, "frequency", "harmonic1.amplitude", RANGES)
