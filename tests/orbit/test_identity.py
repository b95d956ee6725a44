"""When orbits are the same motion: whole forcing periods later, or later by what the excitation repeats after."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ConvergenceError
from gapwalk.orbit.orbit import is_same, phases, repeats


def stop(order: int, frequency: float) -> gw.System:
    """A mass on a spring before a hard stop, pushed `order` times in a forcing period."""
    return gw.System(
        ["x"],
        [[1.0]],
        [[0.02]],
        contacts=[gw.stop("stop", {"x": 1.0}, 0.5, 1000.0, impact_damping=0.05)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0}, order=order)],
        frequency=frequency,
    )


@pytest.mark.parametrize(("orders", "count"), [((1,), 1), ((3,), 3), ((2, 4), 2), ((2, 3), 1), ((), 1)])
def test_the_excitation_repeats_as_often_as_all_orders_do(orders, count) -> None:
    harmonics = [gw.Harmonic(1.0, {"x": 1.0}, order=order) for order in orders]
    assert repeats(gw.System(["x"], [[1.0]], [[0.1]], harmonics=harmonics, frequency=1.0)) == count


def test_phases_are_states_a_third_of_a_period_apart() -> None:
    system = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(1.0, {"x": 1.0}, 3)], frequency=0.5)
    orbit = gw.find_orbit(system)
    found = solve_ivp(
        lambda t, y: [y[1], np.cos(1.5 * t) - y[0] - 0.1 * y[1]],
        (0.0, 8 * np.pi / 3),
        orbit.state,
        rtol=1e-11,
        atol=1e-12,
        t_eval=[0.0, 4 * np.pi / 3, 8 * np.pi / 3],
    )
    assert phases(orbit) == pytest.approx(found.y.T, abs=1e-8)


@pytest.mark.parametrize("method", [None, gw.Balance(24, error=0.05)])
def test_a_motion_that_comes_a_third_of_a_period_later_is_the_same(method) -> None:
    """The one of period 3 under one push a period is of period 1 under three, in three phases."""
    three = next(
        found.orbit
        for found in gw.search(stop(1, 4.75), "frequency", [4.75], options=gw.SearchOptions(starts=24)).found
        if found.orbit.period == 3
    )
    one = gw.find_orbit(stop(3, 4.75 / 3), start=three.state, method=method)
    later = gw.find_orbit(stop(3, 4.75 / 3), start=three.strobes(3)[1], method=method)
    assert np.abs(one.state - later.state).max() > 0.1
    assert is_same(one, later, 1e-6)
    branch = gw.follow(one, "frequency", 1.6, method=method)
    assert Curve(branch).holds(later)


def test_an_island_is_one_branch_in_all_phases() -> None:
    """Under three pushes a period the same islands as under one, one branch each."""
    islands = []
    for order in (1, 3):
        options = {
            "max_period": 3 // order,
            "search_values": (4.75 / order,),
            "search": gw.SearchOptions(starts=16),
            "workers": 1,
        }
        tree = gw.diagram(stop(order, 5.4 / order), "frequency", (2.9 / order, 5.4 / order), **options)
        roots = [member.branch for member in tree.members if member.begins is None and member.period == 3 // order]
        islands.append([branch for branch in roots if branch.ends[-1].reason is EndReason.CLOSED])
    (once,), (thrice,) = islands
    folds = [[special.value for special in branch.special("fold")] for branch in (once, thrice)]
    assert sorted(folds[0]) == pytest.approx(sorted(3.0 * value for value in folds[1]), rel=1e-9)


def test_a_motion_of_a_shorter_period_is_not_walked_as_one_of_a_longer() -> None:
    system = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=2.0)
    orbit = gw.find_orbit(system, 2)
    with pytest.raises(ConvergenceError, match=r"= 2 repeats after 1 forcing period, so it is not a motion of "):
        gw.follow(orbit, "frequency", 1.5)
    with pytest.raises(ConvergenceError, match=r"repeats after 2 forcing periods, .* write period = 2, or start on"):
        gw.follow(gw.find_orbit(gw.paper.case("13"), 4, frequency=0.72), "frequency", 0.8)
