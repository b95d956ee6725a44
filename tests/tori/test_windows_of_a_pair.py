"""Motions of two masses with a stop between their Neimark-Sacker points, against SciPy's DOP853 with contact events."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from tests.tiers import in_campaign, keeps
from tests.tori.closed_forms import nlvib_pair

STIFFNESS = np.array([[1.0, -1.0], [-1.0, 2.0]])
DAMPING = np.array([[0.03, -0.03], [-0.03, 0.06]])


class Meets:
    """The event of SciPy at which the first mass meets its stop, or leaves it."""

    terminal, direction = True, 0.0

    def __call__(self, t, y):
        return y[0] - 1.0


def simulated(frequency: float, state, count: int) -> np.ndarray:
    """Strobes of the pair by another integrator, whose steps are short enough for short touches: it sees ends alone."""
    period = 2.0 * math.pi / frequency
    state, time, strobes = np.array(state), 0.0, []
    touches = state[0] > 1.0

    meets = Meets()
    while len(strobes) < count:
        meets.direction = -1.0 if touches else 1.0
        pushed = 100.0 if touches else 0.0

        def slope(t, y, pushed=pushed):
            force = -STIFFNESS @ y[:2] - DAMPING @ y[2:]
            return *y[2:], force[0] - pushed * (y[0] - 1.0), force[1] + 0.1 * math.cos(frequency * t)

        end = period * (len(strobes) + 1)
        found = solve_ivp(slope, (time, end), state, "DOP853", events=meets, rtol=1e-10, atol=1e-12, max_step=0.1)
        time, state = found.t[-1], found.y[:, -1]
        if found.status == 1:
            touches = not touches
            state[0] = 1.0 + (1e-15 if touches else -1e-15)
        else:
            strobes.append(state)
    return np.array(strobes)


@keeps("0.618-4", "0.588-7")
@pytest.mark.parametrize(
    ("frequency", "period"),
    [
        *[(0.588, 7), (0.6135, 8), (0.618, 4)],
        *(in_campaign(*each) for each in [(0.5825, 8), (0.5945, 6), (0.597, 10), (0.614, 32)]),
    ],
)
def test_periodic_motions_repeat_in_another_simulation(frequency: float, period: int) -> None:
    settled = gw.settle(nlvib_pair(), frequency=frequency)
    assert settled.orbit is not None
    assert settled.orbit.stable
    assert settled.period == period
    strobes = simulated(frequency, settled.orbit.state, 2 * period)
    apart = [np.abs(strobes[each:] - strobes[:-each]).max() for each in range(1, period + 1)]
    assert apart[-1] < 1e-6
    assert min(apart[:-1]) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("blocks", [8, in_campaign(24)])
def test_chaotic_motions_part_in_another_simulation(blocks: int) -> None:
    """Neighbours part by the largest exponent, which is per unit of time."""
    frequency, distance = 0.6075, 1e-7
    attractor = gw.classify(nlvib_pair(), frequency=frequency)
    assert attractor.label == "chaos"
    assert attractor.lyapunov is not None
    one = gw.settle(nlvib_pair(), frequency=frequency).strobes[-1]
    other, growth = one + distance * np.array([1.0, 0.0, 0.0, 0.0]), 0.0
    for block in range(blocks):
        one, other = (simulated(frequency, each, 5)[-1] for each in (one, other))
        apart = np.linalg.norm(other - one)
        other = one + (other - one) * distance / apart
        growth += math.log(apart / distance) if block >= 4 else 0.0
    exponent = growth / ((blocks - 4) * 5) * frequency / (2.0 * math.pi)
    assert exponent > 0.5 * attractor.lyapunov.exponents[0]
    assert attractor.lyapunov.exponents[0] > 0.015


@pytest.mark.slow
def test_the_periods_4_to_16_are_on_branches() -> None:
    options = {
        "max_period": 16,
        "search_values": 40,
        "search": gw.SearchOptions(starts=32, periods=20, newton_starts=0),
    }
    found = gw.diagram(nlvib_pair().at(frequency=0.62), "frequency", (0.581, 0.62), **options)
    assert {*range(4, 17)} <= {member.period for member in found.members}
    stable = {
        period: [
            point.value
            for member in found.members
            if member.period == period
            for point in member.branch.points
            if point.stable
        ]
        for period in range(4, 17)
    }
    assert all(stable.values())
    assert min(stable[6]) < 0.587
    assert max(stable[6]) > 0.6
    assert min(stable[7]) < 0.5843
    assert max(stable[7]) > 0.5955


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "start", "folds", "stable"),
    [
        (0.6089727435721526, [1.021951, 0.639575, 0.194971, -0.031184], (0.6008837, 0.6111049), True),
        in_campaign(0.5920732219818438, [0.920752, 0.598261, 0.246509, 0.145162], (0.5883728, 0.5995406), False),
    ],
)
def test_period_17_is_on_branches_too(frequency, start, folds, stable) -> None:
    """They are found from strobes of chaotic motions; each ends where its first motion comes back."""
    branch = gw.follow(gw.find_orbit(nlvib_pair(), 17, start, frequency=frequency), "frequency", (0.5, 0.8))
    assert branch.closed
    values = [each.value for each in branch.special("fold")]
    assert (min(values), max(values)) == pytest.approx(folds, abs=1e-7)
    assert any(point.stable for point in branch.points) is stable
