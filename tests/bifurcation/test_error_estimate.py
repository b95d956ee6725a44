"""Stated errors of special points: they cover the truth, and none is stated where it cannot be told."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from gapwalk import stop
from gapwalk.bifurcation import Branch, Kind, follow
from gapwalk.bifurcation.special_point import Zero, _location_error, _Seen
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.orbit import find_orbit
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.orbit_equation import places_beside, roundings
from gapwalk.orbit.shooting import ShootingEquation
from tests.orbit.test_edges import oscillator
from tests.tiers import in_campaign, keeps


def two_stages() -> System:
    """A symmetric gap of two stages: its symmetric motions have branch points."""
    stages = (
        Stage(0.20252991376213203, 13.01846879987457, name="s1"),
        Stage(0.5796835263946352, 13.737950887958013, name="s2"),
    )
    contact = Contact("c", {"x": 1.0}, stages, law="viscous", viscous_damping=0.15)
    loads = [Harmonic(0.7997351240115564, {"x": 1.0})]
    return System(["x"], [[0.3]], [[0.08763205483255498]], contacts=[contact], harmonics=loads, frequency=2.0)


def preloaded_stop() -> System:
    """A one-sided stop whose response turns at W = 1.627 and 1.377."""
    return System(
        ["x"],
        [[1.0]],
        [[0.044070158960306326]],
        contacts=[stop("c", {"x": 1.0}, 0.33963748056188836, 23.73108721424004)],
        mean={"x": -0.3994226696680987},
        harmonics=[Harmonic(0.664603840637584, {"x": 1.0})],
        frequency=2.0,
    )


@cache
def walked(system: System, to: float, method: Balance | None) -> Branch:
    return follow(find_orbit(system, method=method), "frequency", to, method=method)


def bifurcations(branch: Branch):
    return [special for special in branch.special_points if special.kind is not Kind.GRAZING]


@keeps("two_stages-0.6-5")
@pytest.mark.parametrize(
    ("make", "to", "count"), [(two_stages, 0.6, 5), in_campaign(two_stages, 6.0, 2), (preloaded_stop, 1.3, 2)]
)
def test_balanced_folds_and_branch_points_are_as_exact_as_they_say(make, to, count):
    exact, balanced = (bifurcations(walked(make(), to, method)) for method in (None, Balance()))
    assert len(exact) == len(balanced) == count
    for shot, other in zip(exact, balanced, strict=True):
        assert (other.kind, other.change, other.nature) == (shot.kind, shot.change, shot.nature)
        assert abs(other.value - shot.value) <= other.uncertainty
        assert other.uncertainty < 1e-3
        assert shot.uncertainty < 1e-9


def test_folds_change_the_number_of_unstable_multipliers_by_one_also_where_truncation_shifts_them():
    for method in (None, Balance(), Balance(8, error=1.0)):
        for fold in walked(preloaded_stop(), 1.3, method).special(Kind.FOLD):
            assert abs(fold.after.total - fold.before.total) == 1


def test_the_rounding_of_a_residual_is_a_few_units_of_the_last_digit_and_the_same_each_time():
    system = preloaded_stop()
    equation, orbit = ShootingEquation(system, "frequency"), find_orbit(system)
    evaluation = equation.evaluate(orbit.state, system.frequency)
    scales = np.append(equation.scales(1.0), 1.0)
    x = np.append(orbit.state, system.frequency)

    def sampled():
        places = places_beside(x, scales)
        return roundings(x, evaluation, places, [equation.evaluate(each[:-1], float(each[-1])) for each in places])

    samples = sampled()
    assert samples.shape == (4, 2)
    assert 1e-17 < np.abs(samples).max() < 1e-13
    assert np.array_equal(samples, sampled())


@cache
def beside_a_stiff_stop(first: float, to: float) -> Branch:
    system = oscillator(stiff=1e5, side=Side.POSITIVE, mean=0.0, frequency=first)
    return follow(find_orbit(system), "frequency", to)


@pytest.mark.parametrize(("first", "to"), [(1.6, 0.3), (0.3, 1.6)])
def test_no_fold_is_invented_where_the_branch_turns_within_rounding(first, to):
    """Beside a stop of stiffness 1e5 the branch turns within 1e-13; walked downwards two of the folds came twice."""
    folds = beside_a_stiff_stop(first, to).special(Kind.FOLD)
    assert len(folds) == 4
    for fold in folds:
        assert abs(fold.after.total - fold.before.total) == 1
        assert fold.nature
        assert math.isfinite(fold.uncertainty)
    ways = [fold.nature for fold in folds]
    assert all(one != other for one, other in pairwise(ways))


def test_folds_beside_a_stiff_stop_are_the_same_walked_from_both_ends():
    down, up = (beside_a_stiff_stop(*ends).special(Kind.FOLD) for ends in ((1.6, 0.3), (0.3, 1.6)))
    for one, other in zip(down, reversed(up), strict=True):
        assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty


def test_an_error_is_not_stated_where_nothing_is_critical():
    branch = walked(preloaded_stop(), 1.3, None)
    here, beside = branch.points[30], branch.points[31]
    for kind in (Kind.FOLD, Kind.FLIP):
        zero = Zero(kind, here, 1e-13, kind.at)
        error = _location_error(zero, _Seen(here, 0.0), _Seen(here, 0.0), _Seen(beside, 1.0))
        assert error == math.inf


def test_an_error_is_not_stated_where_the_test_function_does_not_vary():
    fold = walked(preloaded_stop(), 1.3, None).special(Kind.FOLD)[0].point
    beside = walked(preloaded_stop(), 1.3, None).points[0]
    zero = Zero(Kind.FOLD, fold, 1e-13, Kind.FOLD.at)
    for value in (0.0, np.nan):
        error = _location_error(zero, _Seen(fold, 0.0), _Seen(fold, 0.0), _Seen(beside, value))
        assert error == math.inf
