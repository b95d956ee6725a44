"""Motions beyond points of sliding: a published onset of chaos, orders of what a phase adds, and exact matrices."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.kinds.sliding import slide_map
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of


def belt(frequency: float) -> gw.System:
    """The dry-friction oscillator of di Bernardo, Kowalczyk and Nordmark (2003), on a belt of speed 1."""
    falls = gw.force("falls", {"y": 1.0}, "a*(u-v)-b*(u-v)*(u-v)*(u-v)", numbers={"a": 1.5, "b": 0.45, "u": 1.0})
    return gw.System(
        ["y"],
        mass=[[1.0]],
        stiffness=[[1.0]],
        contacts=[gw.friction("belt", {"y": 1.0}, 1.5, speed=1.0), falls],
        harmonics=[gw.Harmonic(0.1, {"y": 1.0})],
        frequency=frequency,
    )


def test_the_sudden_onset_of_chaos_at_a_published_grazing_sliding():
    orbit = gw.settle(belt(1.7085)).orbit
    assert (orbit.period, orbit.pattern) == (4, "belt slips")
    special = gw.follow(orbit, "frequency", (1.7075, 1.709)).special("grazing-sliding")[0]
    assert special.value == pytest.approx(1.7077997, abs=5e-8)
    assert (special.beyond.verdict, special.beyond.order) == ("chaos at once", 1.0)
    touch = slide_map(special.orbit, 0, -1)
    across = np.linalg.eigvals(touch.monodromy + np.outer(touch.vector, touch.covector))
    off = []
    for distance in (1e-7, 1e-9):
        sticks = gw.find_orbit(belt(special.value - distance), 4, special.orbit.state)
        assert sticks.pattern == "belt 1 stick"
        off.append(abs(across[np.argmax(abs(across))] - sticks.multipliers[0].real))
    assert off[1] < 0.2 * off[0] < 2e-4  # it falls with the root of the distance
    beyond = gw.settle(belt(special.value - 1e-5), start=special.orbit.state)
    assert beyond.orbit is None


def order_of(special: gw.SpecialPoint) -> float:
    """The power with which states beyond a point differ from the extrapolation of those before it."""
    orbit, flow, numbers = special.orbit, flow_of(special.orbit.system), coefficients_of(special.orbit.system)
    way, differences = np.array([0.7, -0.4]) * np.abs(orbit.state).max(), []
    for share in (1e-3, 2.5e-4):
        states = [
            flow.integrate(numbers, orbit.state + place * share * way, 0.0, PERIOD).state
            for place in (1, 0, -1, -2, -3)
        ]
        differences.append(np.abs(np.array([1.0, -4.0, 6.0, -4.0, 1.0]) @ states).max())
    return float(np.log(differences[0] / differences[1]) / np.log(4.0))


@pytest.mark.parametrize("seed", [0, 6])
def test_a_phase_adds_what_the_order_of_its_kind_says(seed):
    random = np.random.default_rng(seed)
    loads = [gw.Harmonic(1.0, {"x": 1.0})]
    brake = gw.friction("brake", {"x": 1.0}, random.uniform(0.2, 0.8))
    loads.append(gw.Harmonic(random.uniform(0.5, 3), {"x": 1.0}, order=3, phase=random.uniform(0, 6)))
    system = gw.System(
        ["x"], mass=[[1.0]], stiffness=[[1.0]], damping=[[0.05]], contacts=[brake], harmonics=loads, frequency=0.9
    )
    found = {}
    for special in gw.follow(gw.find_orbit(system), "frequency", 0.5).special_points:
        if special.beyond is not None and special.orbit.slips[0].slip:  # the section is not in stick
            assert special.beyond.verdict == "goes on"
            found[str(special.kind)] = special.beyond.order
            assert order_of(special) == pytest.approx(special.beyond.order, abs=0.2)
    assert len(found) > 1
