"""Loci in two parameters: against branches in one, closed forms, SciPy, and one kind of locus against another."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from gapwalk.bifurcation import Kind, follow, switch, walk_out
from gapwalk.bifurcation.loci import Codim2, LocusEndReason, LocusTracer, follow_locus, start_locus
from gapwalk.continuation import WalkOptions
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.model import Contact, Harmonic, Stage, System
from gapwalk.orbit import Shooting, find_orbit
from gapwalk.paper import case
from tests.bifurcation.test_special_points import lowest_deflection, preloaded, symmetric
from tests.computed import once
from tests.systems import viscous_stop
from tests.tiers import in_campaign, keeps

WIDE = ((0.15, 2.0), (0.0, 1.0))


@once
def response(mean: float = 0.25, to: float = 0.25):
    """The frequency response of figure 13 at another mean load."""
    return follow(find_orbit(case("13").at({"mean.q1": mean}), frequency=2.0), "frequency", to=to)


@once
def locus(kind: Kind, index: int):
    """The locus of one special point of figure 13 in frequency and mean load."""
    return follow_locus(response().special(kind)[index], "frequency", "mean.q1", WIDE)


def nearest(branch, kind: Kind, value: float):
    return min(branch.special(kind), key=lambda special: abs(special.value - value))


@pytest.mark.parametrize("kind", [in_campaign(Kind.FOLD), in_campaign(Kind.FLIP), Kind.NEIMARK_SACKER, Kind.GRAZING])
def test_loci_pass_through_the_special_points_of_branches_at_other_loads(kind):
    specials, met = response().special(kind), 0
    for special in specials:
        found = follow_locus(special, "frequency", "mean.q1", ((0.15, 2.0), (0.24, 0.26)))
        assert min(np.linalg.norm(found.values - [special.value, 0.25], axis=1)) < 1e-8
        for end, point in zip(found.ends, (found.points[0], found.points[-1]), strict=True):
            if end.reason is LocusEndReason.RANGE:
                frequency, mean = end.values
                assert mean in (0.24, 0.26)
                other = nearest(response(mean), kind, frequency)
                if abs(other.value - frequency) > 1e-6:  # on a branch that is isolated at this load
                    other = nearest(branch_beside(point.orbit), kind, frequency)
                assert other.value == pytest.approx(frequency, abs=1e-8)
                met += 1
    assert met >= len(specials)


def branch_beside(orbit):
    """The branch that turns round at a fold, from an orbit on the side to which it opens."""
    for step in (1e-4, -1e-4):
        try:
            near = find_orbit(orbit.system, orbit.period, orbit.state, frequency=orbit.system.frequency + step)
        except ConvergenceError:
            continue
        if np.abs(near.state - orbit.state).max() < 0.1:
            return follow(near, "frequency", (0.15, 2.0))
    raise AssertionError("no orbit on either side of the fold")


@keeps("neimark-sacker-0", "grazing-4")
@pytest.mark.parametrize(
    ("kind", "index"),
    [(Kind.FOLD, 4), (Kind.FLIP, 0), in_campaign(Kind.FLIP, 4), (Kind.NEIMARK_SACKER, 0), (Kind.GRAZING, 4)],
)
def test_points_are_exact(kind, index):
    for point in locus(kind, index).points:
        multipliers, system = point.orbit.multipliers, point.orbit.system
        assert point.orbit.residual < 1e-9
        assert (system["frequency"], system["mean.q1"]) == pytest.approx(point.values, abs=1e-15)
        if kind is Kind.GRAZING:
            thetas, depths = np.hstack(point.orbit.turning_depths)
            touching = np.argmin(np.abs(depths))
            assert abs(depths[touching]) < 1e-9
            assert thetas[touching] == pytest.approx(point.angle, abs=1e-4)
        else:
            # beside a grazing contact the multipliers are known less well than the orbit
            assert np.abs(multipliers - np.exp(1j * point.angle)).min() < 1e-5


def test_the_linear_motion_first_grazes_on_a_curve_that_is_known_in_closed_form():
    branch = follow(find_orbit(preloaded(0.5)), "frequency", to=0.6)
    found = follow_locus(branch.special(Kind.GRAZING)[0], "frequency", "mean.q1", ((0.3, 2.0), (0.3, 1.5)))
    assert found.contact == "gap +"
    assert np.ptp(found.values, axis=0) == pytest.approx([0.5, 0.5], abs=0.5)
    for frequency, mean in found.values:
        assert lowest_deflection(preloaded(mean), frequency) == pytest.approx(1.0, abs=1e-9)


def test_two_folds_meet_at_a_cusp_and_vanish():
    closed = locus(Kind.FOLD, 4)
    cusps = closed.codim2(Codim2.CUSP)
    assert len(cusps) == 2
    frequency, mean = max((cusp.values for cusp in cusps), key=lambda values: values[1])

    def folds_beside(distance):
        values = [special.value for special in response(mean - distance).special(Kind.FOLD)]
        return sorted(value for value in values if abs(value - frequency) < 2e-3)

    widths = [np.ptp(folds_beside(distance)) for distance in (1e-4, 4e-4)]
    assert widths[1] / widths[0] == pytest.approx(8.0, rel=0.05)  # a semicubical parabola
    assert folds_beside(-1e-4) == []


@once
def beside_a_sharp_cusp():
    return follow(find_orbit(case("13").at({"mean.q3": 0.395, "frequency": 0.66}), start="settle"), "frequency", 0.61)


@keeps("within0-walk1-1", "within0-walk1-2", "within1-walk1-2")
@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("walk", [WalkOptions(), WalkOptions(initial_step=0.02, largest_step=0.1)])
@pytest.mark.parametrize("within", [(0.35, 0.4), (0.385, 0.395)])
def test_a_sharp_cusp_is_found_from_either_side_whatever_the_steps(number, walk, within):
    """Its speed in the plane is back within 1e-4 of arclength, so rounding leaves a share of it at the cusp itself."""
    fold = beside_a_sharp_cusp().special(Kind.FOLD)[number]
    locus = follow_locus(fold, "frequency", "mean.q3", ((0.61, 0.66), within), walk=walk)
    (cusp,) = locus.codim2(Codim2.CUSP)
    assert cusp.values == pytest.approx((0.6224486162, 0.3896359299), abs=1e-9)
    assert cusp.values[1] <= locus.values[:, 1].min() + 1e-12  # nothing is beyond it


@pytest.mark.slow
def test_a_closed_locus_is_the_same_from_wherever_it_is_begun():
    one, other = locus(Kind.FOLD, 4), locus(Kind.FOLD, 5)
    for found in (one, other):
        assert found.is_closed
        assert found.points[0].values == pytest.approx(found.points[-1].values, abs=1e-12)
        assert len(found.codim2(Codim2.GRAZING)) == 4
    for point in one.codim2_points:
        match = min(other.codim2(point.kind), key=lambda p: np.linalg.norm(np.subtract(p.values, point.values)))
        assert match.values == pytest.approx(point.values, abs=1e-8)
        assert match.contact == point.contact


@pytest.mark.slow
def test_a_locus_goes_round_the_corner_where_a_contact_grazes():
    # two folds of the response lie on one locus with a corner, which the grazing locus meets too
    one, other = locus(Kind.FOLD, 2), locus(Kind.FOLD, 3)
    assert np.sort([end.values for end in one.ends], axis=0) == pytest.approx(
        np.sort([end.values for end in other.ends], axis=0), abs=1e-8
    )
    corner = one.codim2(Codim2.GRAZING)[0]
    seen = locus(Kind.GRAZING, 4).codim2(Codim2.FOLD_GRAZING)[0]
    assert corner.contact == "stage2 -"
    assert corner.values == pytest.approx(seen.values, abs=1e-8)
    assert np.abs(corner.orbit.multipliers - 1.0).min() < 1e-8
    assert min(np.abs(depths).min() for _, depths in corner.orbit.turning_depths) < 1e-9
    index = next(k for k, p in enumerate(one.points) if p.arclength > corner.point.arclength)
    before, after = (np.subtract(one.points[k].values, corner.values) for k in (index - 1, index))
    angle = np.arccos(-before @ after / np.linalg.norm(before) / np.linalg.norm(after))
    assert angle > 0.1
    patterns = [point.orbit.pattern for point in one.points]
    assert len(set(patterns[:index])) == len(set(patterns[index:])) == 1
    assert patterns[0] != patterns[-1]


@pytest.mark.slow
def test_a_neimark_sacker_locus_ends_where_folds_or_flips_say_so():
    # each end is found twice: on the locus of pairs, and on that of a fold or a flip, by other equations
    special = nearest(response(0.45, 0.55), Kind.NEIMARK_SACKER, 0.6)
    found = follow_locus(special, "frequency", "mean.q1", WIDE)
    resonances = [point.values for point in locus(Kind.FOLD, 0).codim2(Codim2.RESONANCE_1_1)]
    for end in found.ends:
        assert end.reason is LocusEndReason.RESONANCE
        assert min(np.linalg.norm(np.subtract(resonances, end.values), axis=1)) < 1e-8
    assert found.points[0].angle == pytest.approx(0.0, abs=1e-4)

    special = nearest(response(0.16, 0.24), Kind.NEIMARK_SACKER, 0.294)
    found = follow_locus(special, "frequency", "mean.q1", ((0.24, 0.4), (0.1, 0.3)))
    kinds = [point.kind.value for point in found.codim2_points]
    assert kinds == ["1:2", "1:3", "1:4", "1:4", "1:3", "1:2"]
    for point in found.codim2_points:
        critical = np.exp(2j * np.pi / int(point.kind.value[-1]))
        assert np.abs(point.orbit.multipliers - critical).min() < (1e-5 if point.kind is Codim2.RESONANCE_1_2 else 1e-9)
    flip = nearest(response(0.16, 0.24), Kind.FLIP, 0.301)
    flips = follow_locus(flip, "frequency", "mean.q1", ((0.25, 0.36), (0.1, 0.2)))
    for end in found.ends:
        distances = np.subtract([p.values for p in flips.codim2(Codim2.RESONANCE_1_2)], end.values)
        assert min(np.linalg.norm(distances, axis=1)) < 1e-8


def test_a_flip_changes_its_nature_at_a_generalised_flip():
    found = locus(Kind.FLIP, 0).codim2(Codim2.GENERALISED_FLIP)
    assert len(found) == 1
    frequency, mean = found[0].values
    near = [nearest(response(mean + step, 1.1), Kind.FLIP, frequency).nature for step in (-0.01, 0.01)]
    assert set(near) == {"supercritical", "subcritical"}
    # there the fold of the doubled motions ends
    doubled = walk_out(switch(response().special(Kind.FLIP)[0], "frequency", (0.15, 2.0)))
    folds = follow_locus(doubled.special(Kind.FOLD)[0], "frequency", "mean.q1", ((0.15, 2.0), (0.2, 0.5)))
    assert folds.period == 2
    assert folds.ends[-1].reason is LocusEndReason.JOINED
    assert folds.ends[-1].values == pytest.approx((frequency, mean), abs=1e-8)
    # tangentially: its distance from the flip grows like a square
    distances = []
    for point in folds.points[-4:-2]:
        first, second = point.values
        distances.append((abs(second - mean), abs(nearest(response(second, 1.1), Kind.FLIP, first).value - first)))
    (far, wide), (near, narrow) = distances
    assert np.log(wide / narrow) / np.log(far / near) == pytest.approx(2.0, abs=0.1)


@once
def islands():
    """Figures 27 and 28: for each the folds of the isolated branch, over the amplitude of the excitation."""
    found = {}
    for figure, amplitude in (("27", 0.55), ("28", 0.45)):
        system, random = case(figure).at({"harmonic1.amplitude": amplitude}), np.random.default_rng(0)
        for _ in range(40):
            try:
                orbit = find_orbit(system, 1, random.normal(size=4) * [2, 2, 0.5, 0.5])
            except ArithmeticError:
                continue
            branch = follow(orbit, "harmonic1.amplitude", (0.0, 0.7))
            if branch.ends[-1].reason.name == "CLOSED":
                found[system.frequency] = branch.special(Kind.FOLD)
                break
    return found


@pytest.mark.slow
def test_the_islands_of_figures_27_and_28_lie_on_one_fold_locus():
    folds = islands()
    assert [len(specials) for specials in folds.values()] == [2, 2]
    for special in folds[0.25]:
        found = follow_locus(special, "frequency", "harmonic1.amplitude", ((0.24, 0.255), (0.3, 0.8)))
        assert [end.values[0] for end in found.ends] == [0.255, 0.255]
        assert sorted(end.values[1] for end in found.ends) == pytest.approx(
            sorted(each.value for each in folds[0.255]), abs=1e-8
        )
    # the island is cut off from the sea, and does not vanish, for lower frequencies: one locus from both its folds
    whole = follow_locus(folds[0.25][0], "frequency", "harmonic1.amplitude", ((0.24, 0.3), (0.3, 0.8)))
    assert len(whole.codim2(Codim2.CUSP)) == 1
    for special in folds[0.25]:
        distance = whole.values - [0.25, special.value]
        assert np.abs(distance).min(axis=0) == pytest.approx([0.0, 0.0], abs=3e-3)


def duffing(frequency: float) -> System:
    """x'' + 0.1 x' + x + x^3 = F cos(W t): a cubic contact without a gap."""
    spring = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.0, 1.0),))
    return System(
        ("x",), [[1.0]], [[0.1]], contacts=[spring], harmonics=[Harmonic(0.3, {"x": 1.0})], frequency=frequency
    )


def scipy_fold(frequency: float, guess):
    """State and amplitude at a fold of the Duffing oscillator, by SciPy: ``x(T) = x(0)`` and ``det(M - 1) = 0``."""

    def equations(unknowns):
        x, v, force = unknowns

        def rhs(t, y):
            slope = -1.0 - 3.0 * y[0] ** 2
            pull = force * np.cos(frequency * t) - 0.1 * y[1] - y[0] - y[0] ** 3
            return [y[1], pull, y[4], y[5], slope * y[2] - 0.1 * y[4], slope * y[3] - 0.1 * y[5]]

        start = [x, v, 1.0, 0.0, 0.0, 1.0]
        end = solve_ivp(rhs, (0.0, 2 * np.pi / frequency), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        monodromy = end[2:].reshape(2, 2)
        return [end[0] - x, end[1] - v, np.linalg.det(monodromy - np.eye(2))]

    found = root(equations, guess, method="hybr", tol=1e-12)
    assert found.success
    return found.x


@pytest.mark.slow
def test_the_folds_of_the_duffing_oscillator_agree_with_scipy():
    branch = follow(find_orbit(duffing(0.9)), "frequency", (0.9, 2.5))
    found = follow_locus(branch.special(Kind.FOLD)[0], "frequency", "harmonic1.amplitude", ((1.0, 2.5), (0.05, 0.6)))
    assert len(found.codim2(Codim2.CUSP)) == 1
    # one harmonic of amplitude A alone: F^2 = s ((1 - W^2 + 3 s / 4)^2 + (c W)^2) with s = A^2, c = 0.1, has a cusp at
    frequency = (np.sqrt(3.0) * 0.1 + np.sqrt(0.03 + 4.0)) / 2.0
    excess = frequency**2 - 1.0
    force = np.sqrt(excess / 1.125 * (excess**2 / 9.0 + 0.01 * frequency**2))
    assert found.codim2(Codim2.CUSP)[0].values == pytest.approx((frequency, force), abs=1e-3)
    for point in found.points[:: len(found.points) // 5]:
        frequency, amplitude = point.values
        x, v, force = scipy_fold(frequency, [*(point.orbit.state + 1e-5), amplitude * (1 + 1e-5)])
        assert force == pytest.approx(amplitude, abs=1e-8)
        assert (x, v) == pytest.approx(point.orbit.state, abs=1e-6)


@pytest.mark.slow
def test_a_viscous_stop_has_corners_too():
    # the force jumps at contact, so do the sensitivities
    branch = follow(find_orbit(viscous_stop(1.0)), "frequency", (0.3, 1.0))
    special = nearest(branch, Kind.FOLD, 0.4494)
    found = follow_locus(special, "frequency", "stop.clearance", ((0.3, 1.0), (0.25, 0.5)))
    assert len(found.codim2(Codim2.GRAZING)) >= 1
    for end in found.ends:
        assert end.reason is LocusEndReason.RANGE
        frequency, clearance = end.values
        assert clearance in (0.25, 0.5)
        other = follow(find_orbit(viscous_stop(1.0).at({"stop.clearance": clearance})), "frequency", (0.3, 1.0))
        assert nearest(other, Kind.FOLD, frequency).value == pytest.approx(frequency, abs=1e-8)


def assert_derivatives_agree(equation, scales, x) -> None:
    """The derivatives of an equation at a place, in scaled unknowns, against differences."""
    evaluation = equation.evaluate(x[:-1] * scales[:-1], x[-1] * scales[-1])
    jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * scales
    for column, unit in zip(jacobian.T, np.eye(len(x)), strict=True):
        ends = [(x + sign * 1e-6 * unit) * scales for sign in (1.0, -1.0)]
        residuals = [equation.evaluate(end[:-1], end[-1]).residual for end in ends]
        slope = (residuals[0] - residuals[1]) / 2e-6
        assert column == pytest.approx(slope, abs=1e-5 * max(1.0, np.abs(jacobian).max()))


@pytest.mark.parametrize("kind", [Kind.FOLD, Kind.NEIMARK_SACKER, Kind.GRAZING])
def test_derivatives_agree_with_differences(kind):
    beginning = start_locus(response().special(kind)[0], "frequency", "mean.q1", WIDE)[0]
    equation, scales, x = beginning.equation, beginning.corrector.scales, beginning.first.x
    if kind is Kind.GRAZING:  # beside it, because differences across it are none
        x = x + 1e-3 * np.cos(np.arange(len(x)))
    assert_derivatives_agree(equation, scales, x)


@pytest.mark.parametrize(
    ("plane", "counts"), [(((0.15, 2.0), (0.245, 0.255)), (3, 6, 9)), in_campaign(WIDE, (20, 60, 100))]
)
def test_a_tracer_goes_on_bit_for_bit_from_its_state(plane, counts):
    beginning = start_locus(response().special(Kind.FOLD)[4], "frequency", "mean.q1", plane)[0]
    whole = list(LocusTracer(beginning))
    resume, at = None, 0
    for count in (*counts, len(whole) + 1):  # each goes on where the one before was left, and the last to the end
        tracer = LocusTracer(beginning, resume=resume)
        steps = list(itertools.islice(tracer, count - at))
        assert [step.point.values for step in steps] == [step.point.values for step in whole[at:count]]
        assert [len(step.codim2) for step in steps] == [len(step.codim2) for step in whole[at:count]]
        resume, at = pickle.loads(pickle.dumps(tracer.state)), count
    assert at > counts[-1] < len(whole)
    reported = []
    follow_locus(
        response().special(Kind.FOLD)[4], "frequency", "mean.q1", plane, report=lambda *step: reported.append(step)
    )
    assert [point.values for point, _ in reported[: len(whole)]] == [step.point.values for step in whole]


def test_ends_have_reasons():
    special = response().special(Kind.FLIP)[0]
    stopped = follow_locus(special, "frequency", "mean.q1", WIDE, walk=WalkOptions(max_points=5))
    assert [end.reason for end in stopped.ends] == [LocusEndReason.POINTS] * 2
    narrow = follow_locus(special, "frequency", "mean.q1", ((1.3, 1.4), (0.25, 1.0)))
    assert narrow.ends[0].reason is LocusEndReason.START
    assert narrow.ends[1].values[0] in (1.3, 1.4)
    assert narrow.ends[1].reason is LocusEndReason.RANGE
    assert "the edge of the range was reached, at (1.3, " in str(narrow.ends[1])
    assert (narrow.values[:, 0] >= 1.3).all()
    assert (narrow.values[:, 1] >= 0.25).all()
    assert "Locus(flip, period 1, frequency and mean.q1" in repr(narrow)
    assert narrow.measure("half.q1").shape == (len(narrow.points),)


def test_bad_requests_are_refused_with_one_line():
    flip, grazing = response().special(Kind.FLIP)[0], response().special(Kind.GRAZING)[0]
    crossing = follow(find_orbit(symmetric()), "frequency", to=0.8).special(Kind.BRANCH_POINT)[0]
    for special, first, second, to, options, words in (
        (crossing, "frequency", "harmonic1.amplitude", ((0.1, 3), (0, 2)), {}, "a branch point has no locus"),
        (response().points[0], "frequency", "mean.q1", WIDE, {}, "not at BranchPoint"),
        (flip, "frequency", "frequency", WIDE, {}, "both parameters are 'frequency'"),
        (flip, "frequency", "mean.q2", WIDE, {}, "there is no parameter 'mean.q2'"),
        (flip, "frequency", "mean.q1", ((0.2, 1.0), (0.0, 1.0)), {}, "outside the range from 0.2 to 1"),
        (grazing, "frequency", "mean.q1", ((0.2, 2.0), (0.3, 1.0)), {}, "starts at mean.q1 = 0.25, outside"),
        (flip, "frequency", "mean.q1", ((2.0, 0.2), (0.0, 1.0)), {}, "its first value must be the smaller one"),
        (flip, "frequency", "mean.q1", (0.2, 2.0), {}, "write a range for each parameter"),
        (flip, "frequency", "mean.q1", ((-1.0, 2.0), (0.0, 1.0)), {}, "frequency is -1.0; it must be > 0"),
        (flip, "frequency", "mean.q1", WIDE, {"method": Shooting(3)}, "a locus is followed with one"),
    ):
        with pytest.raises(ModelError) as raised:
            follow_locus(special, first, second, to, **options)
        assert words in str(raised.value)
        assert "\n" not in str(raised.value)
