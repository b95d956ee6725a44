"""Walks of systems with forces by formulas, and the box in which orbits are sought, beside SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.bifurcation.isolated.search_starts import state_box
from gapwalk.continuation.corrector import Range, linear_growth
from gapwalk.continuation.walk import EndReason
from gapwalk.model.contact import force, stop
from tests.tiers import keeps

PARAMETRIC = gw.Harmonic(0.2, varies={"spring.k": 1.0}, name="parametric", order=2)


def one(text: str, amplitude: float, frequency: float, *more, damping: float = 0.1, loads=(), **numbers) -> gw.System:
    contacts = [force("spring", {"x": 1.0}, text, **numbers), *more]
    drive = gw.Harmonic(amplitude, {"x": 1.0}, name="drive")
    return gw.System(["x"], [[0.0]], [[damping]], contacts=contacts, harmonics=[drive, *loads], frequency=frequency)


def coupled() -> gw.System:
    spring = force(
        "spring", {"r": {"p": 1.0}, "s": {"q": 1.0, "p": -0.5}}, "a*r*s**2 + b*r**3", acts_on={"p": 1.0}, a=0.5, b=0.3
    )
    load = gw.Harmonic(0.3, {"p": 1.0, "q": 0.2})
    return gw.System(
        ["p", "q"], np.diag([1.0, 2.0]), 0.1 * np.eye(2), contacts=[spring], harmonics=[load], frequency=1.5
    )


def _coupled_rates(t: float, y, w: float) -> list[float]:
    p, q, u, v = y
    s, drive = q - 0.5 * p, 0.3 * math.cos(w * t)
    return [u, v, drive - p - 0.1 * u - 0.5 * p * s**2 - 0.3 * p**3, 0.2 * drive - 2.0 * q - 0.1 * v]


def _mathieu_rates(t: float, y, w: float) -> list[float]:
    x, v = y
    pull = (1.0 + 0.2 * math.cos(2.0 * w * t)) * x + 10.0 * max(x - 0.5, 0.0)
    return [v, 0.05 * math.cos(w * t) - 0.1 * v - pull]


CASES = {
    "van der Pol": (
        lambda: one("k*x - mu*(1 - x**2)*v", 2.0, 1.1, damping=0.0, k=1.0, mu=0.1),
        lambda t, y, w: [y[1], 2.0 * math.cos(w * t) - y[0] + 0.1 * (1.0 - y[0] ** 2) * y[1]],
    ),
    "Helmholtz and Duffing": (
        lambda: one("k*x + a*x**2 + b*x**3", 0.2, 1.6, k=1.0, a=0.3, b=0.5),
        lambda t, y, w: [y[1], 0.2 * math.cos(w * t) - 0.1 * y[1] - y[0] - 0.3 * y[0] ** 2 - 0.5 * y[0] ** 3],
    ),
    "pendulum": (
        lambda: one("k*sin(x)", 0.2, 1.6, k=1.0),
        lambda t, y, w: [y[1], 0.2 * math.cos(w * t) - 0.1 * y[1] - math.sin(y[0])],
    ),
    "coupled": (coupled, _coupled_rates),
    "Mathieu with a stop": (
        lambda: one("k*x", 0.05, 1.7, stop("stop", {"x": 1.0}, 0.5, 10.0), loads=[PARAMETRIC], k=1.0),
        _mathieu_rates,
    ),
}


@keeps("van der Pol", "Mathieu with a stop")
@pytest.mark.parametrize("name", CASES)
def test_branches_of_formulas_reach_the_ends_of_their_range(name: str) -> None:
    """At the ends and in the middle, SciPy's motion over one period of the equations by hand repeats."""
    make, rates = CASES[name]
    system = make()
    w = system.frequency
    branch = gw.follow(gw.find_orbit(system), "frequency", (0.6 * w, 1.3 * w))
    values = [point.value for point in branch.points]
    assert (values[0], values[-1]) == (pytest.approx(0.6 * w), pytest.approx(1.3 * w))
    for point in (branch.points[0], branch.points[len(values) // 2], branch.points[-1]):
        end = 2.0 * math.pi / point.value
        motion = solve_ivp(
            rates,
            (0.0, end),
            point.orbit.state,
            "DOP853",
            rtol=1e-12,
            atol=1e-13,
            args=(point.value,),
            max_step=end / 200,
        )
        assert motion.y[:, -1] == pytest.approx(point.orbit.state, abs=1e-6)


def test_a_drag_does_not_hold_a_floating_part() -> None:
    """Without any restoring force the orbit may be shifted; a spring by a formula holds it."""
    for text, held in (("c*v + 0*x", False), ("c*v + k*x", True)):
        numbers = {"c": 0.3} | ({"k": 0.4} if held else {})
        far = stop("stop", {"x": 1.0}, 50.0, 3.0)
        system = one(text, 0.5, 1.5, far, damping=0.0, **numbers)
        lag = math.atan2(0.3 * 1.5, 1.5**2)
        size = 0.5 / math.hypot(1.5**2, 0.3 * 1.5)
        state = [-size * math.cos(lag), -size * 1.5 * math.sin(lag)] if not held else "settle"
        branch = gw.follow(gw.find_orbit(system, start=state), "frequency", (1.4, 1.6))
        assert (branch.ends[0].reason == EndReason.FLOATING) is not held


def test_linear_growth_is_the_peak_of_the_linear_response() -> None:
    """A linear formula is a spring and a damper, and a displacement prescribed in it is a load."""
    moved = gw.Harmonic(0.3, varies={"spring.deflection": 1.0}, name="ground")
    system = one("k*x + c*v", 0.0, 1.0, damping=0.0, loads=[moved], k=4.0, c=0.2)
    values = np.linspace(1.0, 4.0, 300_001)
    response = 0.3 * np.abs((4.0 + 0.2j * values) / (4.0 - values**2 + 0.2j * values))
    assert linear_growth(system, "frequency", Range(1.0, 4.0, is_relative=True)) == pytest.approx(
        response.max(), rel=1e-6
    )
    curved = one("k*x + b*x**3", 0.1, 1.0, k=4.0, b=1.0)
    assert linear_growth(curved, "frequency", Range(1.0, 4.0, is_relative=True)) == 0.0


@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_the_box_of_a_search_contains_wells_and_limit_cycles(unit: float) -> None:
    well = state_box(one("k*x + b*x**3", 0.01 * unit, 1.1, k=-1.0, b=1.0 / unit**2))
    assert 1.0 < well[0] / unit < 10.0
    cycle = state_box(one("k*x - mu*(1 - x**2/a**2)*v", 0.01 * unit, 1.1, damping=0.0, k=1.0, mu=0.1, a=unit))
    assert 2.0 < cycle[0] / unit < 20.0  # the limit cycle of van der Pol has the amplitude 2
    linear = state_box(one("k*x + b*x**3", 0.01 * unit, 1.1, k=1.0, b=1e-9 / unit**2))
    assert 0.02 < linear[0] / unit < 0.2  # the length at which it bends is out of reach
