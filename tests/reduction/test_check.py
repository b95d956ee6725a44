"""What the full system says of motions and special points of a reduced one, against what it does itself."""

import math

import numpy as np
import pytest

from gapwalk import Balance, Branch, Harmonic, Kind, System, WalkOptions, backlash, find_orbit, follow, reduce
from gapwalk.errors import ModelError
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from tests.reduction.chains import rod, stiffness_of
from tests.tiers import in_campaign

METHOD = Balance(8, error=1.0)
WALK = WalkOptions(largest_step=0.05)


def response(system: System, parameter: str = "frequency", to: float = 0.5) -> Branch:
    orbit = find_orbit(system, start="rest", method=METHOD)
    return follow(orbit, parameter, to=to, method=METHOD, walk=WALK)


def amplitudes(orbit) -> np.ndarray:
    assert isinstance(orbit, BalancedOrbit)
    return orbit.deflections.lines


def difference(orbit, other) -> float:
    """As `OrbitCheck.error` is meant: sums of amplitudes of the difference, relative to those of the motion."""
    one, two = amplitudes(orbit), amplitudes(other)
    return np.abs(two - one).sum(axis=1).max() / np.abs(one[:, 1:]).sum(axis=1).max()


@pytest.mark.slow
def test_a_chain_of_a_hundred_with_three_clearances_has_its_special_points_within_the_estimate() -> None:
    full = rod(100, 3)
    theirs = response(full)
    assert len(theirs.special(Kind.FOLD)) == 2
    reduction = reduce(full, error=1e-2, up_to=0.5)
    assert reduction.system.size < 25
    ours = response(reduction.system)
    kinds = [[special.kind for special in branch.special_points] for branch in (ours, theirs)]
    assert kinds[0] == kinds[1]
    check = reduction.check(ours, METHOD)
    assert check.error == max(each.error for each in check.special) < 1e-4
    assert check.motion < 1e-2
    for each, exact in zip(check.special, theirs.special_points, strict=True):
        off = abs(each.special.value - exact.value)
        assert off <= each.error
        # and it says no more than needed, beside how well the walk has located the point
        assert each.error <= 1.2 * off + each.special.uncertainty + 1e-9
        assert each.corrected == pytest.approx(exact.value, abs=1e-9)


@pytest.mark.slow
def test_too_few_modes_are_told() -> None:
    """The reduced system has other special points; each is off by no more than its estimate, or not vouched for."""
    full = rod(60, 2)
    theirs = response(full)
    reduction = reduce(full, modes=1, up_to=0.5)
    assert reduction.error > 0.2
    ours = response(reduction.system)
    check = reduction.check(ours, METHOD)
    assert len(ours.special_points) != len(theirs.special_points)
    lost = [each for each in check.special if math.isinf(each.error)]
    assert lost
    assert math.isinf(check.error)
    for each in check.special:
        near = [other.value for other in theirs.special(each.special.kind)]
        assert min(abs(each.special.value - value) for value in near) <= each.error
    assert "not found nearby in the full system" in repr(check)
    assert "not found nearby" in repr(lost[0])


@pytest.mark.parametrize("frequency", [0.22, 0.31, 0.36, 0.45])
@pytest.mark.parametrize("modes", [2, 5, 9])
def test_a_motion_is_within_its_estimate(modes: int, frequency: float) -> None:
    """Of twelve motions, most of which meet their gaps, some of which the reduced system has all wrong."""
    full = rod(40, 2, frequency=frequency)
    reduction = reduce(full, modes=modes, up_to=0.5)
    orbit = find_orbit(reduction.system, start="settle", method=METHOD)
    check = reduction.check(orbit, METHOD)
    if math.isinf(check.error):
        assert modes < 9
        return
    exact = _nearest(full, reduction, orbit)
    assert difference(orbit, exact) <= check.error * (1.0 + 1e-6)
    assert check.error < 2.0 * difference(orbit, exact)


def _nearest(full: System, reduction, orbit):
    """The full system's orbit by Newton's method from the lines of the reduced one."""
    from gapwalk.orbit.orbit_equation import solve

    equation = METHOD.pose(full)
    unknowns, evaluation = solve(equation, METHOD.pose(reduction.system).unknowns(orbit), 0.0)
    return equation.orbit(unknowns, 0.0, evaluation)


def test_the_estimate_holds_for_shooting_too() -> None:
    """Both systems shot: the amplitudes of the deflection in time differ by no more than harmonic balance says."""
    full = rod(8, 1, load=2.0, frequency=0.3)
    reduction = reduce(full, modes=1, up_to=0.35)
    one, two = find_orbit(full), find_orbit(reduction.system)
    assert one.pattern == two.pattern
    assert "1+" in one.pattern
    check = reduction.check(two)
    assert check.harmonics == 15
    x, y = one.motion(256).deflections, reduction.expand(two, 256).deflections
    size = 0.5 * np.ptp(x)
    assert 1e-3 < np.abs(x - y).max() / size <= check.error


@pytest.mark.slow
@pytest.mark.parametrize("walk", [WALK, in_campaign(WalkOptions())])
def test_a_branch_by_shooting_along_a_load_is_checked(walk: WalkOptions) -> None:
    """The fold over the amplitude; the reduced system is walked by shooting, the full one by balance."""
    names = tuple(f"q{index}" for index in range(10))
    full = System(
        names,
        stiffness_of(10),
        0.04 * np.eye(10),
        contacts=[backlash("gap", {"q4": 1.0}, 0.5, 2.0)],
        harmonics=[Harmonic(0.01, {"q4": 1.0})],
        frequency=0.38,
    )
    method = Balance(15, error=1.0)
    reduction = reduce(full, modes=5, up_to=0.4)
    ours = follow(find_orbit(reduction.system, start="rest"), "harmonic1.amplitude", to=0.25, walk=walk)
    start = find_orbit(full, start="rest", method=method)
    theirs = follow(start, "harmonic1.amplitude", to=0.25, method=method, walk=walk)
    check = reduction.check(ours)
    for kind in (Kind.FOLD, Kind.GRAZING):
        found = [each for each in check.special if each.special.kind is kind]
        exact = theirs.special(kind)
        assert len(found) == len(exact) >= 1
        for each, other in zip(found, exact, strict=True):
            assert abs(each.special.value - other.value) <= each.error + 1e-5  # by truncation
            assert each.corrected == pytest.approx(other.value, abs=1e-5)
            assert each.error < 2e-2


@pytest.mark.slow
def test_a_parameter_of_a_kept_coordinate_has_its_own_value_in_the_full_system() -> None:
    """Under a load on all coordinates, that on a kept one contains what the others give at rest."""
    full = rod(20, 1, load=0.3).at({f"mean.q{k}": 0.002 for k in range(20)})
    reduction = reduce(full, error=2e-2, up_to=0.25)
    name = "mean.q10"
    begin, wide = reduction.system[name], 0.06
    assert begin > 5.0 * full[name]
    ours = response(reduction.system, name, begin + wide)
    theirs = response(full, name, full[name] + wide)
    assert theirs.special(Kind.GRAZING)
    check = reduction.check(ours, METHOD)
    found = [each.corrected - begin + full[name] for each in check.special]
    assert found == pytest.approx([each.value for each in theirs.special_points], abs=1e-7)


def test_what_cannot_be_checked_is_refused() -> None:
    full = rod(20, 2)
    reduction = reduce(full, modes=5, up_to=0.5)
    orbit = find_orbit(full, start="rest", method=METHOD)
    with pytest.raises(ModelError, match="not the reduced one at some values"):
        reduction.check(orbit)
    own = find_orbit(reduction.system, start="rest", method=METHOD)
    with pytest.raises(ModelError, match=r"as in Balance\(harmonics=20\)"):
        reduction.check(own, "balance")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="give an orbit or a branch"):
        reduction.check(reduction)  # type: ignore[arg-type]
