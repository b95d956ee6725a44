"""Families of tori, against closed forms and the Neimark-Sacker points of branches."""

import math
from typing import Any, cast

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.tori.torus_family import TorusEndReason, TorusEventKind
from tests.tori.closed_forms import one_circle, two_circles


def settled(system):
    return gw.tori.find_torus(gw.settle(system, [1.5, 0.2, 0.1, 0.0]))


@pytest.mark.slow
def test_rotation_numbers_of_circles_in_closed_form():
    system = one_circle(math.sqrt(8.7))
    family = gw.tori.follow_tori(settled(system), "frequency", (2.93, 3.05))
    rotations = np.where(family.rotations > 0.5, 1.0 - family.rotations, family.rotations)
    assert rotations == pytest.approx(1.0 / family.values, abs=1e-10)
    assert [family.points[0].value, family.points[-1].value] == pytest.approx([2.93, 3.05])
    (third,) = [each for each in family.events if str(each.ratio) in ("1/3", "2/3")]
    # all motions of the torus are periodic there: any parametrisation of the circle solves the equation
    assert third.value == pytest.approx(3.0, abs=1e-7)
    assert abs(third.value - 3.0) <= third.uncertainty
    assert third.window is None or third.window.width < 1e-9  # the oscillators are apart: nothing locks


def test_a_fold_of_tori_and_the_orbit_to_which_they_shrink_in_closed_form():
    """The outer circle is stable down to the fold at a = 0; the inner one is unstable and shrinks to rest at a = 4."""
    family = gw.tori.follow_tori(settled(two_circles(1.0)), "excitation.a", (-1.0, 4.5))
    ends = sorted(family.ends, key=lambda end: end.reason is not TorusEndReason.SHRINKS)
    (fold,) = [each for each in family.events if each.kind is TorusEventKind.FOLD]
    assert fold.value == pytest.approx(0.0, abs=1e-9)
    assert {fold.before, fold.after} == {0, 1}
    assert ends[0].reason is TorusEndReason.SHRINKS
    assert ends[0].value == pytest.approx(4.0, abs=1e-9)
    assert ends[1].reason is TorusEndReason.RANGE
    for point in family.points:
        square = point.torus.states[:, 0] ** 2 + point.torus.states[:, 2] ** 2
        outer = square.mean() > 2.0
        expected = 2.0 + (1.0 if outer else -1.0) * np.sqrt(max(point.value, 0.0))
        assert square == pytest.approx(np.full(len(square), expected), abs=1e-7)
        assert point.torus.stable == outer or point.value < 1e-6


@pytest.mark.slow
def test_a_family_connects_two_neimark_sacker_points():
    case = gw.paper.case("13")
    branch = gw.follow(gw.find_orbit(case, 2, frequency=1.23), "frequency", (1.15, 1.26))
    first, second = sorted(branch.special(gw.Kind.NEIMARK_SACKER), key=lambda each: -each.value)
    assert (first.value, second.value) == pytest.approx((1.196729044, 1.183716615), abs=1e-8)
    family = gw.tori.follow_tori(first, "frequency", (1.1, 1.3))
    begin, end = family.ends
    assert begin.reason is TorusEndReason.BORN
    assert end.reason is TorusEndReason.SHRINKS
    assert end.value == pytest.approx(second.value, abs=1e-10)
    assert end.rotation == pytest.approx(abs(np.angle(second.multiplier)) / (2 * np.pi), abs=1e-8)
    assert all(point.torus.stable for point in family.points)
    assert max(point.torus.error for point in family.points) < 1e-9
    middle = family.points[len(family.points) // 2]
    assert gw.verify(middle.torus).ok
    # a motion settles where the family says, independently of it
    met = gw.tori.find_torus(gw.settle(case, middle.torus.state() * 1.0001, frequency=middle.value))
    assert met.rotation == pytest.approx(middle.torus.rotation, abs=1e-9)


@pytest.mark.slow
def test_the_end_at_a_strong_resonance_names_the_locked_motion():
    case = gw.paper.case("13")
    branch = gw.follow(gw.find_orbit(case, frequency=0.372), "frequency", 0.376)
    (start,) = branch.special(gw.Kind.NEIMARK_SACKER)
    family = gw.tori.follow_tori(start, "frequency", (0.37, 0.38))
    end = family.ends[1]
    assert end.reason is TorusEndReason.RESONANCE
    assert "approaches 1/3; period 3, stable" in end.detail
    assert end.value == pytest.approx(0.3778009, abs=1e-6)
    assert gw.settle(case, family.points[-1].torus.state(), frequency=end.value + 2e-5).period == 3


def test_only_neimark_sacker_points_bear_tori():
    branch = gw.follow(gw.find_orbit(gw.paper.case("13"), frequency=1.35), "frequency", 1.3)
    (flip,) = branch.special(gw.Kind.FLIP)
    with pytest.raises(ModelError, match=r"no tori begin at a point of the kind 'flip'"):
        gw.tori.follow_tori(flip, "frequency", (1.2, 1.4))
    with pytest.raises(ModelError, match=r"gw.tori.find_torus\(settled\)"):
        gw.tori.follow_tori(cast(Any, branch.points[0].orbit), "frequency", (1.2, 1.4))


def test_a_kept_rotation_number_in_closed_form():
    """The rotation number of two tones is the ratio of their frequencies, which change together if it is kept."""
    mass = gw.System(["x"], [[1.0]], [[0.2]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=1.3)
    ratio = (1.0 + math.sqrt(5.0)) / 2.0
    torus = gw.tori.two_tones(mass, gw.tori.Tone(0.3, {"x": 1.0}, 1.3 * ratio))
    family = gw.tori.follow_tori(torus, "frequency", (1.25, 1.4), second=("tone.frequency", (1.0, 2.2)))
    assert family.second_values == pytest.approx(ratio * family.values, abs=1e-9)
    assert family.rotations == pytest.approx(np.full(len(family.points), torus.rotation), abs=1e-14)
    assert family.values[0] == pytest.approx(1.25)
    # the second parameter leaves its range first
    assert family.ends[1].reason is TorusEndReason.RANGE
    assert "tone.frequency" in family.ends[1].detail
    assert family.second_values.max() < 2.2
    assert "is kept by tone.frequency" in str(family.summary())


@pytest.fixture(scope="module")
def kept():
    """A torus of figure 13, and the family that keeps its rotation number."""
    torus = gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=0.672))
    family = gw.tori.follow_tori(torus, "frequency", (0.6719, 0.6725), second=("harmonic1.amplitude", (0.2, 0.3)))
    return torus, family


@pytest.mark.slow
def test_a_kept_rotation_number_as_by_families_in_which_it_varies(kept):
    case, (torus, curve) = gw.paper.case("13"), kept
    first, second = curve.points[0], curve.second_values[0]
    assert first.value == pytest.approx(0.6719)
    assert abs(second - 0.25) > 1e-4
    # from a settled motion at the frequency of one end, the amplitude alone is varied until the rotation number is met
    other = gw.tori.find_torus(gw.settle(case, frequency=first.value))
    assert abs(other.rotation - torus.rotation) > 1e-5
    family = gw.tori.follow_tori(other, "harmonic1.amplitude", float(second))
    assert family.points[-1].torus.rotation == pytest.approx(torus.rotation, abs=1e-9)


def test_tori_of_a_kept_rotation_number_shrink_to_an_orbit_whose_critical_multipliers_turn_by_it(kept):
    torus, curve = kept
    end = curve.ends[1]
    assert end.reason is TorusEndReason.SHRINKS
    system = curve.points[-1].torus.system
    branch = gw.follow(gw.find_orbit(system, 2, curve.points[-1].torus.state()), "frequency", (0.6722, 0.6726))
    (point,) = branch.special(gw.Kind.NEIMARK_SACKER)
    assert point.value == pytest.approx(end.value, abs=1e-8)
    assert abs(np.angle(point.multiplier)) / (2.0 * np.pi) == pytest.approx(torus.rotation, abs=1e-6)
    with pytest.raises(ModelError, match="which is the first one"):
        gw.tori.follow_tori(torus, "frequency", 0.673, second=("frequency", (0.6, 0.7)))
    with pytest.raises(ModelError, match="only if the walk starts from a torus"):
        gw.tori.follow_tori(point, "frequency", 0.673, second=("harmonic1.amplitude", (0.2, 0.3)))
