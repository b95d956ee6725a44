"""Where loci end at grazes, and where grazing loci name the same points: closed forms, and one against the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.loci import Codim2, LocusEndReason
from gapwalk.bifurcation.touch_map import touch_map
from tests.bifurcation.test_beyond_grazes import Grazing
from tests.computed import once


def oscillator(c: float, frequency: float, amplitude: float, restitution: float = 0.8) -> gw.System:
    """``x'' + c x' + x = F cos W t`` with a rigid stop at 1."""
    stop = gw.rigid_stop("stop", {"x": 1.0}, 1.0, restitution=restitution, side="positive")
    load, matrices = gw.Harmonic(amplitude, {"x": 1.0}, name="f"), {"mass": [[1.0]], "stiffness": [[1.0]]}
    return gw.System(["x"], **matrices, damping=[[c]], contacts=[stop], harmonics=[load], frequency=frequency)


def branch_of(c: float, frequency: float, restitution: float = 0.8) -> gw.Branch:
    """The motions of that oscillator over the amplitude, through its graze."""
    force = np.hypot(1.0 - frequency**2, c * frequency)
    moved = 0.7 * force / (1.0 - frequency**2 + 1j * c * frequency)
    system = oscillator(c, frequency, 0.7 * force, restitution)
    start = gw.find_orbit(system, start=[moved.real, (1j * frequency * moved).real])
    return gw.follow(start, "f.amplitude", (0.7 * force, 1.3 * force))


def resonance(c: float) -> tuple[float, float]:
    """Where the period is half the natural one: the square-root term vanishes."""
    frequency = 2.0 * math.sqrt(1.0 - c * c / 4.0)
    return frequency, float(np.hypot(1.0 - frequency**2, c * frequency))


@once
def with_folds() -> gw.Branch:
    return branch_of(0.1, 1.97)


def plane(frequency: float) -> tuple[tuple[float, float], tuple[float, float]]:
    return (0.92 * frequency, 1.1 * frequency), (1.0, 6.0)


@pytest.mark.parametrize("kind", ["fold", "grazing"])
def test_a_fold_locus_ends_at_the_resonant_graze(kind):
    place = resonance(0.1)
    locus = gw.follow_locus(with_folds().special(kind)[0], "frequency", "f.amplitude", plane(place[0]))
    (found,) = locus.codim2(Codim2.RESONANT_GRAZING)
    assert found.values == pytest.approx(place, abs=1e-9)
    assert found.contact == "stop +"
    assert max(found.errors) < 5e-9
    assert np.abs(np.subtract(found.values, place)) == pytest.approx([0.0, 0.0], abs=max(found.errors))
    if kind == "fold":
        end = next(end for end in locus.ends if end.reason is LocusEndReason.GRAZE)
        assert end.values == found.values
        assert "resonant grazing" in end.reason_words


def test_flips_touch_the_grazing_locus_like_a_parabola():
    c = 0.04  # Simpson and Ghosh: (F - Fg) / (W - 2 wd)^2 from 7.40 to 7.48
    place = resonance(c)
    locus = gw.follow_locus(branch_of(c, 2.1).special("flip")[0], "frequency", "f.amplitude", plane(2.1))
    (found,) = locus.codim2(Codim2.RESONANT_GRAZING)
    assert found.values == pytest.approx(place, abs=1e-9)
    away = locus.values[:, 0] - place[0]
    heights = locus.values[:, 1] - np.hypot(1.0 - locus.values[:, 0] ** 2, c * locus.values[:, 0])
    near = (away > 1e-4) & (away < 0.007)
    assert near.sum() >= 1
    assert ((heights[near] / away[near] ** 2 > 7.40) & (heights[near] / away[near] ** 2 < 7.48)).all()


@once
def doubled() -> gw.Branch:
    """Motions of period two of an oscillator whose one-impact motions have doubled."""
    low = 0.5 * math.hypot(1.0 - 2.2397**2, 0.2009 * 2.2397)
    return gw.follow(branch_of(0.2009, 2.2397).special("flip")[0], "f.amplitude", (low, 3.2 * low))


def test_doubled_motions_end_where_those_of_half_their_period_are_resonant():
    branch, place = doubled(), resonance(0.2009)
    own = {}
    for special in branch.special_points:
        locus = gw.follow_locus(special, "frequency", "f.amplitude", ((1.4, 3.3), (0.4, 24.0)))
        assert not any(end.reason.is_failure for end in locus.ends), locus.ends
        for found in locus.codim2(Codim2.RESONANT_GRAZING):
            if found.values[0] < 2.0:
                assert found.values == pytest.approx(place, abs=1e-9)
            else:  # their own, of which folds, flips and grazes tell apart from each other
                own[special.kind] = found
    assert {*own} == {"fold", "flip", "grazing"}
    for found in own.values():
        apart = np.abs(np.subtract(found.values, own["grazing"].values))
        assert (apart < np.add(found.errors, own["grazing"].errors)).all()


@pytest.mark.parametrize(("kind", "slope"), [("fold", None), ("flip", (7.40, 7.48))])
def test_other_loci_begin_at_the_resonant_graze(kind, slope):
    c, place = 0.04, resonance(0.04)
    graze = branch_of(c, 2.1).special("grazing")[0]
    (start,) = gw.follow_locus(graze, "frequency", "f.amplitude", plane(2.0)).codim2(Codim2.RESONANT_GRAZING)
    locus = gw.follow_locus(start, "frequency", "f.amplitude", plane(2.0), kind=kind)
    (found,) = locus.codim2(Codim2.RESONANT_GRAZING)
    assert found.values == pytest.approx(place, abs=1e-9)
    if slope:  # Simpson and Ghosh
        away = locus.values[:, 0] - place[0]
        height = locus.values[:, 1] - np.hypot(1.0 - locus.values[:, 0] ** 2, c * locus.values[:, 0])
        near = (away > 1e-4) & (away < 0.007)
        assert near.any()
        assert ((height[near] / away[near] ** 2 > slope[0]) & (height[near] / away[near] ** 2 < slope[1])).all()


def test_the_locus_that_begins_is_named():
    graze = branch_of(0.04, 2.1).special("grazing")[0]
    (start,) = gw.follow_locus(graze, "frequency", "f.amplitude", plane(2.0)).codim2(Codim2.RESONANT_GRAZING)
    with pytest.raises(gw.errors.ModelError, match=r"write the kind that begins there, one of \('fold', 'flip'"):
        gw.follow_locus(start, "frequency", "f.amplitude", plane(2.0))
    with pytest.raises(gw.errors.ModelError, match="leave kind out"):
        gw.follow_locus(graze, "frequency", "f.amplitude", plane(2.0), kind="flip")


def test_folds_end_where_a_touch_of_a_damper_that_pushes_changes_the_multipliers():
    # by the multipliers with a light touch on one locus, by those without it and the map of the touch on the other
    stages = [gw.Stage(1.0, 18.9, side="positive")]
    stop = gw.Contact("stop", {"x": 1.0}, stages, law="pushing", viscous_damping=0.82)
    load, matrices = gw.Harmonic(0.3, {"x": 1.0}, name="f"), {"mass": [1.0], "stiffness": [1.0], "damping": [0.0857]}
    system = gw.System(["x"], **matrices, contacts=[stop], harmonics=[load], frequency=1.2517)
    branch = gw.follow(gw.find_orbit(system), "f.amplitude", (0.3, 0.7))
    folds, grazes = (
        gw.follow_locus(branch.special(kind)[0], "frequency", "f.amplitude", ((1.005, 1.3), (0.05, 1.0)))
        for kind in ("fold", "grazing")
    )
    ends = [end for end in folds.ends if end.reason is LocusEndReason.GRAZE]
    assert ends
    assert all("fold grazing" in end.reason_words for end in ends)
    others = [found.values for found in grazes.codim2(Codim2.FOLD_GRAZING)]
    for end in ends:
        assert min(np.abs(np.subtract(end.values, other)).max() for other in others) < 1e-9


@pytest.mark.parametrize(("seed", "turns"), [(43, False), (40, True)])
def test_where_a_touch_of_a_damper_that_pushes_moves_a_multiplier_across_there_is_no_fold_or_flip(seed, turns):
    grazing = Grazing("pushing", seed)
    within = 0.997 * grazing.amplitude, 1.001 * grazing.amplitude
    start = gw.find_orbit(grazing.system(-0.002), start=grazing.start(-0.002))
    branch = gw.follow(start, "harmonic1.amplitude", within)
    graze = branch.special_points[0]
    assert graze.kind == "grazing"
    assert graze.value == pytest.approx(grazing.amplitude, rel=1e-10)
    assert (graze.before.total, graze.after.total, graze.turns, graze.passes_flip) == (0, 1, turns, not turns)
    # the same by the map of the touch: det(mu - M - b c) has another sign than without the touch
    touch = touch_map(graze.orbit, 0)
    mu = 1.0 if turns else -1.0
    assert touch.determinant(mu) * np.linalg.det(mu * np.eye(2) - touch.monodromy) < 0.0
    assert not [each for each in branch.special_points[1:] if abs(each.value - graze.value) < 1e-6]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_loci_of_random_rigid_oscillators_end_at_named_points(seed):
    random = np.random.default_rng([seed, 5])
    c, frequency, restitution = random.uniform(0.03, 0.25), random.uniform(1.9, 2.4), random.uniform(0.5, 0.95)
    branch, place = branch_of(c, frequency, restitution), resonance(c)
    for special in branch.special_points:
        if special.kind not in ("fold", "flip", "grazing"):
            continue
        locus = gw.follow_locus(special, "frequency", "f.amplitude", ((1.7, 2.5), (0.5, 12.0)))
        assert not any(end.reason.is_failure for end in locus.ends), locus.ends
        for end in locus.ends:
            if end.reason is LocusEndReason.GRAZE:
                assert end.values == pytest.approx(place, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40, 46))
@pytest.mark.parametrize("kind", ["rigid", "preloaded", "soft", "pushing"])
def test_loci_of_random_oscillators_end_at_points_that_two_of_them_name(kind, seed):
    grazing = Grazing(kind, seed)
    low, high = 0.5 * grazing.amplitude, 1.6 * grazing.amplitude
    within = (0.6 * grazing.frequency, 1.5 * grazing.frequency), (0.2 * low, 6.0 * grazing.amplitude)
    branch = gw.follow(gw.find_orbit(grazing.system(-0.5)), "harmonic1.amplitude", (low, high))
    grazes, ends = [], []
    for special in branch.special_points:
        if special.kind in ("fold", "flip", "grazing"):
            locus = gw.follow_locus(special, "frequency", "harmonic1.amplitude", within)
            assert not any(end.reason.is_failure for end in locus.ends), locus.ends
            named = [each for each in locus.codim2_points if each.contact or "grazing" in each.kind]
            here = [each for each in named if each.values in [end.values for end in locus.ends]]
            grazes += named if special.kind == "grazing" else []
            ends += here if special.kind != "grazing" else []
    for end in ends:
        apart = [np.abs(np.subtract(end.values, each.values)) / np.add(end.errors, each.errors) for each in grazes]
        assert min(map(max, apart)) < 1.0


def test_with_two_coordinates_fold_flip_and_square_root_part():
    # the responses of the touch, computed again at the located motions, vanish one by one
    grazing = Grazing("rigid", 0)
    assert len(grazing.names) == 2
    start = gw.find_orbit(grazing.system(-0.01), start=grazing.start(-0.01))
    low, high = 0.99 * grazing.amplitude, 1.01 * grazing.amplitude
    special = gw.follow(start, "harmonic1.amplitude", (low, high)).special("grazing")[0]
    within = (0.5 * grazing.frequency, 1.1 * grazing.frequency), (0.1 * low, 3.0 * high)
    locus = gw.follow_locus(special, "frequency", "harmonic1.amplitude", within)
    for kind, multiplier in ((Codim2.GRAZING_MEETS_FOLD, 1.0), (Codim2.GRAZING_MEETS_FLIP, -1.0)):
        assert locus.codim2(kind)
        for found in locus.codim2(kind):
            touch = touch_map(found.orbit, 0)
            size = np.linalg.norm(touch.covector) * np.linalg.norm(touch.vector)
            assert abs(touch.response(multiplier)) < 1e-6 * size
            assert abs(touch.sequence(1)[0]) > 1e-5 * size
