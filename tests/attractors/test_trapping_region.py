"""Traps: what is inside comes to rest on the orbit, by the exact flow and by SciPy."""

import numpy as np
import pytest

from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import trapping_region_of
from gapwalk.orbit import find_orbit
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.paper import case
from tests.independent import integrate
from tests.systems import linear
from tests.tiers import keeps

SET_15 = case("15").at(frequency=0.45)
STARTS = {1: (3.76, 1.98, -0.056, 0.314), 3: (2.697, 1.655, -0.735, -0.205)}


@pytest.fixture(scope="module", params=STARTS)
def orbit(request):
    return find_orbit(SET_15, request.param, STARTS[request.param])


def surface(region, phase, count, seed):
    """Random states on the ellipsoid about one strobe."""
    directions = np.random.default_rng(seed).normal(size=(count, 4))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return region.strobes[phase] + np.linalg.solve(region.shapes[phase], directions.T).T


@keeps("1")
def test_all_that_is_in_a_trap_comes_to_the_orbit(orbit):
    region = trapping_region_of(orbit)
    assert region.strobes == pytest.approx(stroboscopic(orbit))
    flow = Strobe(SET_15)
    returns = 600 // orbit.period
    for phase in range(orbit.period):
        for state in surface(region, phase, 12, seed=7 + phase):
            for _ in range(4):
                assert region.holds(state[None, :] * (1 - 1e-9) + region.strobes[phase] * 1e-9).all()
                state = flow.arc(state, orbit.period).state
            end = flow.arc(state, returns * orbit.period).state
            assert end == pytest.approx(region.strobes[phase], abs=1e-4)


def test_a_trap_is_of_use(orbit):
    """Most random states within a hundredth of the motion about the orbit are inside."""
    region = trapping_region_of(orbit)
    near = orbit.state + 0.03 * np.random.default_rng(1).uniform(-1.0, 1.0, (400, 4))
    assert region.holds(near).mean() > 0.5
    assert not region.holds(np.array([[0.0, 0.0, 0.0, 0.0], [np.nan] * 4, [np.inf] * 4])).any()


def test_scipy_goes_the_same_way():
    orbit = find_orbit(SET_15, 3, STARTS[3])
    region = trapping_region_of(orbit)
    state = surface(region, 0, 1, seed=5)[0]
    first = np.linalg.norm(region.shapes[0] @ (state - region.strobes[0]))
    for _ in range(2):
        state = integrate(SET_15, state, 3, max_step=0.05)
    assert np.linalg.norm(region.shapes[0] @ (state - region.strobes[0])) < 0.9 * first


def test_the_trap_of_a_linear_system_is_as_large_as_is_tried():
    orbit = find_orbit(linear(), 1, "rest")
    region = trapping_region_of(orbit)
    widest = 1.0 / np.linalg.svd(region.shapes[0] * np.repeat((1.0, 0.8), 2), compute_uv=False)[-1]
    assert widest == pytest.approx(0.5 * max(np.abs(orbit.state[:2]).max(), np.abs(orbit.state[2:]).max() / 0.8))


def test_an_unstable_orbit_has_no_trap():
    unstable = find_orbit(case("15").at(frequency=0.8), 1, "rest")
    assert not unstable.stable
    assert trapping_region_of(unstable) is None
