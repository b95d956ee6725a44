"""The kinds of attractors: systems whose kind is known, and figure 15 against SciPy."""

import json
import pickle

import numpy as np
import pytest
from scipy.spatial import KDTree

import gapwalk as gw
from gapwalk.attractors import (
    Attractor,
    AttractorKind,
    ClassifyOptions,
    LyapunovOptions,
    SettleOptions,
    classify,
    identify,
    match,
    rotation,
    settle,
)
from gapwalk.errors import ModelError
from gapwalk.model import Harmonic, System
from gapwalk.results.codec import decode, encode, plain
from tests.attractors.references import figure15, next_strobes, strobes
from tests.attractors.test_lyapunov import ueda_system
from tests.computed import once
from tests.systems import linear
from tests.tiers import in_campaign

GOLDEN = (np.sqrt(5) - 1) / 2


@pytest.fixture(scope="module")
def fig15() -> System:
    return gw.paper.case("15")


@once
def from_rest(frequency: float) -> Attractor:
    """What figure 15 comes to from rest, at its default options."""
    return classify(gw.paper.case("15"), frequency=frequency)


def undamped(ratio: float) -> System:
    """An undamped oscillator, driven at 1 / ratio of its own frequency."""
    return System(("x",), [[1.0]], harmonics=[Harmonic(0.3, {"x": 1.0})], frequency=1 / ratio)


@pytest.mark.parametrize("ratio", [GOLDEN, 1.3, np.sqrt(7)])
def test_free_vibration_beside_the_forced_one_is_quasi_periodic(ratio):
    found = classify(undamped(ratio), [0.4, 0.1])
    if ratio == 1.3:  # commensurate: ten forcing periods are 13 of its own, and nothing is attracted
        assert found.kind is AttractorKind.UNDECIDED
        assert "after 10 forcing periods" in found.evidence[-1]
        return
    assert found.kind is AttractorKind.QUASI_PERIODIC
    assert found.period == 1
    assert found.rotation is not None
    assert found.rotation.number == pytest.approx(min(ratio % 1, -ratio % 1), abs=1e-12)
    assert found.lyapunov is not None
    assert found.lyapunov.exponents == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_damped_linear_system_is_periodic():
    found = classify(linear())
    assert found.label == "P1"
    assert found.kind is AttractorKind.PERIODIC
    assert found.multipliers is not None


def test_the_duffing_oscillator_where_its_kinds_are_known():
    # Ueda 1979: a strange attractor at k = 0.05, B = 7.5
    found = classify(ueda_system(), options=ClassifyOptions(lyapunov=LyapunovOptions(max_periods=2048)))
    assert found.kind is AttractorKind.CHAOTIC
    assert found.label == "chaos"
    assert classify(ueda_system(0.1, 0.3)).kind is AttractorKind.PERIODIC


@pytest.mark.parametrize("frequency", [0.45, 0.82])
def test_figure_15_period_three(frequency):
    found = from_rest(frequency)
    assert (found.kind, found.period) == (AttractorKind.PERIODIC, 3)
    assert found.strobes.shape == (3, 4)
    assert found.lyapunov is not None
    assert found.lyapunov.exponents[0] < 0


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "curves"), [in_campaign(0.855, 3), (1.12, 2)])
def test_figure_15_tori_agree_with_scipy(frequency, curves):
    found = from_rest(frequency)
    assert found.kind is AttractorKind.QUASI_PERIODIC
    assert found.period == curves
    assert found.rotation is not None
    assert found.rotation.error < 1e-6
    assert found.lyapunov is not None
    assert abs(found.lyapunov.per_period[0]) < 1e-5
    assert found.lyapunov.dimension == 1.0
    sample = found.strobes[: 150 + curves]
    # a kink in the middle of a step leaves an error of its square: 4 times less for each halving
    coarse, fine = (next_strobes(figure15(frequency), frequency, sample[:150], curves, n) for n in (400, 800))
    assert fine == pytest.approx(sample[curves:], abs=4e-5)
    assert np.abs(fine - sample[curves:]).max() < 0.4 * np.abs(coarse - sample[curves:]).max()


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "curves"), [(0.855, 3), (1.12, 2)])
def test_figure_15_tori_by_scipy_alone(frequency, curves):
    found = from_rest(frequency)
    independent = strobes(figure15(frequency), frequency, found.strobes[-1], 260 * curves, max_step=0.2)
    assert KDTree(found.strobes).query(independent)[0].max() < 0.02
    again = rotation(independent, curves)
    assert again is not None
    assert found.rotation is not None
    assert again.curves == curves
    assert again.number == pytest.approx(found.rotation.number, abs=1e-5)


@pytest.mark.slow
def test_a_young_torus_turns_with_the_angle_of_its_pair(fig15):
    # the period-3 motion is born stable at the Neimark-Sacker point near W = 0.86; just below it is a small torus
    start = [1.0643, 0.6204, 0.2334, -0.3085]
    inside = gw.find_orbit(fig15, 3, start, frequency=0.858)
    pair = max(inside.multipliers, key=lambda mu: mu.imag)
    assert 1 < abs(pair) < 1.001
    found = classify(inside.system, inside.state + 0.02)
    assert (found.kind, found.period) == (AttractorKind.QUASI_PERIODIC, 3)
    assert found.rotation is not None
    assert found.rotation.number == pytest.approx(np.angle(pair) / (2 * np.pi), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [0.2, in_campaign(0.4)])
def test_figure_15_chaos(frequency):
    found = from_rest(frequency)
    assert found.kind is AttractorKind.CHAOTIC
    assert found.lyapunov is not None
    assert found.lyapunov.exponents[0] > 30 * found.lyapunov.errors[0]
    assert found.lyapunov.dimension > 1.0
    assert found.rotation is None
    assert "positive" in found.evidence[-1]


def test_a_long_period_is_found_after_all(fig15):
    options = ClassifyOptions(SettleOptions(max_period=2), LyapunovOptions(max_periods=1024))
    found = classify(fig15, "rest", options, frequency=0.45)
    assert (found.kind, found.period) == (AttractorKind.PERIODIC, 3)


@pytest.mark.slow
def test_a_period_of_256_is_that_of_a_doubling():
    # two masses that collide (docs/gallery/collide.md): a band of 16 curves that locked has doubled four times
    pair = gw.System(
        ["a", "b"],
        stiffness=[[1.0, 0.0], [0.0, 4.0]],
        damping=[[0.05, 0.0], [0.0, 0.1]],
        contacts=[gw.stop("gap", {"a": 1.0, "b": -1.0}, clearance=0.5, stiffness=30.0, impact_damping=0.1)],
        harmonics=[gw.Harmonic(0.3, {"a": 1.0})],
    )
    before, found = (classify(pair, frequency=frequency) for frequency in (0.9429, 0.94285))
    assert (before.kind, before.period) == (AttractorKind.PERIODIC, 128)
    assert (found.kind, found.period) == (AttractorKind.PERIODIC, 256)
    assert before.orbit is not None
    assert found.orbit is not None
    assert found.orbit.stable
    # seen without any transient: on its way there the orbit of half the period loses its stability in a flip
    walk = gw.WalkOptions(max_points=40)
    branch = gw.follow(before.orbit, "frequency", to=0.9427, walk=walk)
    (flip,) = branch.special(gw.Kind.FLIP)
    assert 0.94285 < flip.value < 0.9429
    halves = np.array(found.strobes).reshape(2, 128, -1)
    apart = np.abs(halves[1] - halves[0]).max(axis=1)
    assert 1e-5 < apart.max() < 0.01  # two motions that were one, not a torus that happens to return


@pytest.mark.slow
def test_what_is_too_short_to_tell_is_undecided(fig15):
    options = ClassifyOptions(lyapunov=LyapunovOptions(max_periods=256), errors=1e6)
    found = classify(fig15, "rest", options, frequency=0.4)
    assert found.kind is AttractorKind.UNDECIDED
    assert found.label == "?"
    assert found.evidence


def test_matching(fig15):
    at = fig15.at(frequency=0.45)
    random = np.random.default_rng(0)
    starts = random.normal(size=(12, 4)) * (1, 1, 0.5, 0.5)
    known = []
    labels = []
    for start in starts:
        settled = settle(at, start)
        index = match(known, settled)
        if index is None:
            known.append(identify(settled))
            index = len(known) - 1
        labels.append(index)
        assert match(known, known[index]) == index
        assert match(known, known[index].strobes) == index
        assert match(known, known[index].strobes[-1]) == index
        assert match(known, known[index].strobes[:1] + 0.1) is None
    assert {each.label for each in known} == {"P1", "P3"}
    assert len(known) == 2
    assert set(labels) == {0, 1}


def test_matching_of_tori_and_chaos():
    torus, random = from_rest(1.12), np.random.default_rng(0)
    at = torus.system
    starts = (settle(at, start) for start in random.normal(size=(20, 4)))
    orbit = next(identify(each) for each in starts if each.period)
    assert (torus.label, orbit.label) == ("2 x torus", "P1")
    later = settle(at, torus.strobes[-1], SettleOptions(max_periods=1500))
    assert match([orbit, torus], later) == 1
    assert match([orbit, torus], later.strobes[:16]) == 1
    assert match([orbit], later) is None
    assert match([], later) is None
    with pytest.raises(ModelError, match="must be"):
        match([torus], np.zeros(3))
    chaos = from_rest(0.2)
    assert match([chaos], settle(chaos.system, [2.0, 1.0, 0.0, 0.0])) == 0
    assert match([chaos], chaos.strobes + np.array([0.3, 0, 0, 0])) is None


@pytest.mark.parametrize("frequency", [0.45, 1.12, 0.2])
def test_plain_values_and_pickles_lose_nothing(frequency):
    found = from_rest(frequency)
    kept = encode(found, Attractor, found.system)
    same = decode(kept, Attractor, found.system)
    assert encode(same, Attractor, found.system) == kept
    assert json.dumps(plain(same)) == json.dumps(plain(found))
    assert np.array_equal(same.strobes, found.strobes)
    if found.orbit is not None:
        assert same.orbit is not None
        assert same.orbit.pattern == found.orbit.pattern
    copied = pickle.loads(pickle.dumps(found))
    assert encode(copied, Attractor, found.system) == kept
    assert repr(copied) == repr(found) == repr(same)
    with pytest.raises(ValueError, match=r"belong to this system|states of its system"):
        decode(kept, Attractor, ueda_system())


@pytest.mark.parametrize("options", [{"zero": 0.0}, {"errors": 0.5}])
def test_options_that_make_no_sense(options):
    with pytest.raises(ModelError, match="must"):
        ClassifyOptions(**options)
