"""Loci by harmonic balance: against loci by shooting, balanced branches, differences, and themselves more finely."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest

from gapwalk.bifurcation import Kind, follow, switch, walk_out
from gapwalk.bifurcation.loci import Codim2, Locus, LocusEndReason, LocusTracer, follow_locus, start_locus
from gapwalk.continuation import WalkOptions
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.orbit import find_orbit
from gapwalk.orbit.harmonic_balance import Balance, BalancedOrbit
from gapwalk.orbit.method import Method
from gapwalk.paper import case
from tests.bifurcation.test_locus import WIDE, assert_derivatives_agree, islands, locus, nearest, response
from tests.bifurcation.test_many_degrees import rod
from tests.computed import once
from tests.systems import viscous_stop
from tests.tiers import in_campaign, keeps, some_of

NEAR = ((0.15, 2.0), (0.24, 0.26))
KINDS = (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER, Kind.GRAZING)
COARSE = WalkOptions(largest_step=0.05)
GROWING, GROWS = ((0.76, 0.9), (0.17, 0.27)), 1


def balance(harmonics: int) -> Balance:
    """With as many harmonics, whatever they lack."""
    return Balance(harmonics, error=1.0)


@once
def balanced(mean: float = 0.25):
    """The frequency response of figure 13 at a mean load, with ten harmonics."""
    system = case("13").at({"mean.q1": mean})
    return follow(find_orbit(system, frequency=2.0, method=balance(10)), "frequency", to=0.25, method=balance(10))


def apart(one: Locus, other: Locus) -> float:
    """Largest distance of the points of codimension two of a locus from those of their kind on another."""
    return max(
        min(np.linalg.norm(np.subtract(point.values, each.values)) for each in other.codim2(point.kind))
        for point in one.codim2_points
    )


@keeps("grazing")
@pytest.mark.parametrize("kind", some_of(KINDS, Kind.FOLD, Kind.GRAZING))
def test_balanced_loci_are_those_of_shooting_but_for_the_truncation(kind):
    special = response().special(kind)[0]
    exact = follow_locus(special, "frequency", "mean.q1", NEAR)
    assert {end.reason for end in exact.ends} == {LocusEndReason.RANGE}
    errors = []
    for harmonics in (5, 10, 20):
        found = follow_locus(special, "frequency", "mean.q1", NEAR, walk=COARSE, method=balance(harmonics))
        assert all(isinstance(point.orbit, BalancedOrbit) for point in found.points)
        assert {point.orbit.harmonics for point in found.points} == {harmonics}
        errors.append(np.abs(np.subtract([e.values for e in found.ends], [e.values for e in exact.ends])).max())
    if kind is Kind.GRAZING:  # of a motion that is linear up to there
        assert max(errors) < 1e-9
        return
    assert errors[1] < 1e-4
    assert errors[2] < 1e-5
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]


@keeps("neimark-sacker")
@pytest.mark.parametrize("kind", some_of(KINDS, Kind.FLIP, Kind.NEIMARK_SACKER))
def test_balanced_loci_pass_through_the_special_points_of_balanced_branches(kind):
    special = balanced().special(kind)[0]
    found = follow_locus(special, "frequency", "mean.q1", NEAR, walk=COARSE, method=balance(10))
    assert min(np.linalg.norm(found.values - [special.value, 0.25], axis=1)) < 1e-8
    for end in found.ends:
        frequency, mean = end.values
        assert mean in (0.24, 0.26)
        assert nearest(balanced(mean), kind, frequency).value == pytest.approx(frequency, abs=1e-8)


@pytest.mark.slow
def test_a_closed_balanced_locus_has_the_corners_and_cusps_of_shooting():
    special, exact = response().special(Kind.FOLD)[4], locus(Kind.FOLD, 4)
    errors = []
    for harmonics in (10, 30):
        found = follow_locus(special, "frequency", "mean.q1", WIDE, walk=COARSE, method=balance(harmonics))
        assert found.is_closed
        assert len(found.codim2(Codim2.CUSP)) == 2
        assert [point.contact for point in found.codim2_points if point.contact] == [
            point.contact for point in exact.codim2_points if point.contact
        ]
        errors.append(max(apart(exact, found), apart(found, exact)))
    assert errors[0] < 2e-4
    assert errors[1] < 5e-6


@pytest.mark.slow
def test_the_islands_of_figures_27_and_28_lie_on_one_balanced_fold_locus():
    special, plane = islands()[0.25][0], ((0.24, 0.3), (0.3, 0.8))
    exact = follow_locus(special, "frequency", "harmonic1.amplitude", plane)
    found = follow_locus(special, "frequency", "harmonic1.amplitude", plane, walk=COARSE, method=balance(20))
    (cusp,), (expected,) = found.codim2(Codim2.CUSP), exact.codim2(Codim2.CUSP)
    assert cusp.values == pytest.approx(expected.values, abs=1e-5)
    assert [end.values for end in found.ends] == [pytest.approx(end.values, abs=1e-5) for end in exact.ends]
    other = islands()[0.25][1]  # the island's other end
    assert np.abs(found.values - [0.25, other.value]).min(axis=0) == pytest.approx([0.0, 0.0], abs=3e-3)
    assert [len(specials) for specials in islands().values()] == [2, 2]


@pytest.mark.slow
def test_a_neimark_sacker_locus_has_the_resonances_of_shooting():
    special, exact = response().special(Kind.NEIMARK_SACKER)[0], locus(Kind.NEIMARK_SACKER, 0)
    found = follow_locus(special, "frequency", "mean.q1", WIDE, walk=COARSE, method=balance(20))
    assert found.is_closed
    assert [point.kind for point in found.codim2_points] == [Codim2.RESONANCE_1_3] * 2
    assert apart(exact, found) < 2e-5
    for point in found.codim2_points:
        assert np.abs(point.orbit.multipliers - np.exp(2j * np.pi / 3)).min() < 1e-9


@pytest.mark.slow
def test_a_grazing_locus_has_the_points_of_shooting_and_no_echo_of_its_own_touch():
    special, exact = response().special(Kind.GRAZING)[4], locus(Kind.GRAZING, 4)
    found = follow_locus(special, "frequency", "mean.q1", WIDE, walk=COARSE, method=balance(20))
    assert [point.kind for point in found.codim2_points] == [point.kind for point in exact.codim2_points]
    assert apart(exact, found) < 3e-4  # of the degenerate point, which is least sure
    assert found.contact == "stage2 -"
    for point in found.points:
        assert isinstance(point.orbit, BalancedOrbit)
        assert point.orbit.deflections.states(np.array([point.angle]))[0] == pytest.approx([-1.0, 0.0], abs=1e-9)


@pytest.mark.slow
def test_a_fold_of_doubled_motions_ends_at_a_generalised_flip():
    flip, ranges = response().special(Kind.FLIP)[0], ((0.15, 2.0), (0.2, 0.5))
    fold = walk_out(switch(flip, "frequency", (0.15, 2.0))).special(Kind.FOLD)[0]
    exact = follow_locus(fold, "frequency", "mean.q1", ranges, walk=COARSE)
    found = follow_locus(fold, "frequency", "mean.q1", ranges, walk=COARSE, method=balance(10))
    assert (found.period, found.ends[-1].reason) == (2, LocusEndReason.JOINED)
    assert found.ends[-1].values == pytest.approx(exact.ends[-1].values, abs=2e-4)
    # the end is found twice: on the locus of folds, and on that of the flips of the parent
    flips = follow_locus(flip, "frequency", "mean.q1", ranges, walk=COARSE, method=balance(10))
    (generalised,) = flips.codim2(Codim2.GENERALISED_FLIP)
    assert generalised.values == pytest.approx(found.ends[-1].values, abs=1e-8)


@pytest.mark.slow
def test_a_viscous_stop_has_corners_too():
    special = nearest(follow(find_orbit(viscous_stop(1.0)), "frequency", (0.3, 1.0)), Kind.FOLD, 0.4494)
    ranges = ((0.3, 1.0), (0.25, 0.5))
    exact = follow_locus(special, "frequency", "stop.clearance", ranges)
    found = follow_locus(special, "frequency", "stop.clearance", ranges, walk=COARSE, method=balance(60))
    assert [point.kind for point in found.codim2_points] == [point.kind for point in exact.codim2_points]
    assert apart(exact, found) < 2e-5
    # where ten harmonics are enough for the motion, but have no fold near there, it begins with more
    beginnings = start_locus(special, "frequency", "stop.clearance", ranges, Balance(error=1e-2))
    assert {beginning.first.orbit.harmonics for beginning in beginnings} == {22}


@pytest.mark.slow
@pytest.mark.parametrize("ends", [1, in_campaign(2)])
def test_many_degrees_of_freedom_and_several_contacts(ends: int):
    """A Neimark-Sacker point whose multipliers come from eigenvectors: on the locus, and on branches beside it."""

    def pairs(damping: float):
        start = find_orbit(rod(40).at({"gap0.impact_damping": damping}), start="rest", method=balance(5))
        walk = WalkOptions(largest_step=0.02)
        return follow(start, "frequency", to=0.2716, method=balance(5), walk=walk).special(Kind.NEIMARK_SACKER)

    ranges, steps = ((0.27, 0.28), (0.04, 0.06)), WalkOptions(initial_step=0.2, largest_step=0.5)
    names = ("frequency", "gap0.impact_damping")
    found = follow_locus(pairs(0.05)[1], *names, ranges, method=balance(5), walk=steps)
    for end in found.ends[:ends]:
        frequency, damping = end.values
        assert damping in (0.04, 0.06)
        assert min(abs(each.value - frequency) for each in pairs(damping)) < 1e-8


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_agree_with_differences(kind):
    beginning = start_locus(balanced().special(kind)[0], "frequency", "mean.q1", WIDE, balance(10))[0]
    equation, scales, x = beginning.equation, beginning.corrector.scales, beginning.first.x
    if kind is Kind.GRAZING:  # beside it, because differences across it are none
        x = x + 1e-3 * np.cos(np.arange(len(x)))
    assert_derivatives_agree(equation, scales, x)


def growing(method: Balance) -> Locus:
    """A locus of flips on which ever more harmonics count."""
    special = response().special(Kind.FLIP)[2]
    return follow_locus(special, "frequency", "mean.q1", GROWING, walk=COARSE, method=method)


def test_harmonics_grow_along_a_locus():
    found = growing(Balance(error=7.5e-5))
    counts = [point.orbit.harmonics for point in found.points]
    assert min(counts) < max(counts)
    assert max(point.orbit.truncation for point in found.points) <= 7.5e-5
    assert {end.reason for end in found.ends} == {LocusEndReason.RANGE}
    exact = follow_locus(response().special(Kind.FLIP)[2], "frequency", "mean.q1", GROWING)
    assert [end.values for end in found.ends] == [pytest.approx(end.values, abs=1e-4) for end in exact.ends]


def test_too_few_harmonics_end_a_locus_with_what_to_change():
    found = growing(Balance(10, error=7.5e-5))
    (end,) = (end for end in found.ends if end.reason is LocusEndReason.COARSE)
    assert end.reason.is_failure
    assert "take harmonics = 20 or more" in end.detail
    assert max(point.orbit.truncation for point in found.points) <= 7.5e-5
    with pytest.raises(ConvergenceError, match="take harmonics = 20 or more"):
        growing(Balance(10, error=1e-6))


@pytest.mark.slow
def test_a_tracer_goes_on_bit_for_bit_from_its_state():
    special = response().special(Kind.FLIP)[2]
    beginning = start_locus(special, "frequency", "mean.q1", GROWING, Balance(error=7.5e-5))[GROWS]
    whole = list(LocusTracer(beginning, COARSE))
    counts = [step.point.orbit.harmonics for step in whole]
    grown = counts.index(max(counts))
    assert 0 < grown < len(whole) - 2
    tracer, steps = LocusTracer(beginning, COARSE), []
    for count in (grown, grown + 1):
        steps += itertools.islice(tracer, count - len(steps))
        rest = LocusTracer(beginning, COARSE, resume=pickle.loads(pickle.dumps(tracer.state)))
        again = [*steps, *rest]
        assert [step.point.values for step in again] == [step.point.values for step in whole]
        assert [len(step.codim2) for step in again] == [len(step.codim2) for step in whole]


def test_another_method_is_refused():
    class Guess(Method):
        name = "guess"

    with pytest.raises(ModelError, match=r"a locus cannot be followed by the method guess; write Shooting\(\)"):
        follow_locus(response().special(Kind.FLIP)[0], "frequency", "mean.q1", WIDE, method=Guess())  # pyright: ignore
