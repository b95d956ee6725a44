"""Variations, jumps, growth and forces by formula in the second equations of motion, beside SciPy with its own events.

The accelerations are typed here by hand, with plain numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.model.contact import Contact, Side, Stage, force
from gapwalk.model.loads import Harmonic
from gapwalk.model.loads.load import Rectangle
from gapwalk.verification.dop853 import carry
from gapwalk.verification.independent_equations import Equations
from tests.tiers import in_campaign, some_of

W = 0.8
TAU = 2.0 * math.pi


def gear() -> gw.System:
    """A gear pair with backlash, a transmission error, and a stiffness that varies smoothly and jumps."""
    loads = [
        Harmonic(0.05, varies="mesh.deflection", order=1, phase=0.4, name="error"),
        Harmonic(0.1, {"x": 1.0}, name="torque"),
        Harmonic(0.1, varies="mesh.stiffness", order=2, phase=1.0, name="wave"),
        Rectangle(0.2, {"mesh.stiffness": 1.0}, order=2, share=0.6, phase=0.3),
    ]
    mesh = Contact("mesh", {"x": 1.0}, [Stage(1.0, 1.0)])
    return gw.System(["x"], [[0.0]], [[0.08]], contacts=[mesh], mean={"x": 0.2}, harmonics=loads, frequency=W)


def mesh_depth(t: float, y: Sequence[float]) -> float:
    return abs(y[0] + 0.05 * math.cos(W * t + 0.4)) - 1.0


def at_high(t: float) -> bool:
    return math.cos(2.0 * W * t + 0.3) > math.cos(0.6 * math.pi)


def gear_rates(t: float, y: Sequence[float]) -> list[float]:
    x = y[0] + 0.05 * math.cos(W * t + 0.4)
    level = 0.2 if at_high(t) else -0.2 * 0.6 / 0.4
    stiffness = 1.0 + 0.1 * math.cos(2.0 * W * t + 1.0) + level
    depth = max(abs(x) - 1.0, 0.0) * math.copysign(1.0, x)
    return [y[1], 0.2 + 0.1 * math.cos(W * t) - 0.08 * y[1] - stiffness * depth]


def drag() -> gw.System:
    """Quadratic drag, a product of two deflections and their rates, a Hertz contact and an unbalance."""
    contacts = [
        force("drag", {"x": 1.0}, "c*v*abs(v)", c=0.3),
        force(
            "pair",
            {"r": {"x": 1.0}, "s": {"y": 1.0}},
            "k*r*s + a*(r' - s')*s**2",
            acts_on={"x": 1.0, "y": -0.5},
            k=0.2,
            a=0.05,
        ),
        force("hertz", {"x": 1.0, "y": -1.0}, "k*max(x - gap, 0)**1.5", k=4.0, gap=0.3),
    ]
    loads = [
        Harmonic(0.8, {"x": 1.0}, growth=2, at=0.9, name="unbalance"),
        Harmonic(0.2, varies="pair.k", order=2, name="wave"),
        Harmonic(0.1, varies="hertz.deflection", order=1, name="shift"),
        Harmonic(0.1, varies="pair.r", order=3, name="sway"),
    ]
    return gw.System(
        ["x", "y"],
        [[1.0, -0.2], [-0.2, 1.5]],
        [[0.05, 0.0], [0.0, 0.05]],
        contacts=contacts,
        mean={"x": 0.1},
        harmonics=loads,
        frequency=W,
    )


def hertz_depth(t: float, y: Sequence[float]) -> float:
    return y[0] - y[1] + 0.1 * math.cos(W * t) - 0.3


def drag_rates(t: float, s: Sequence[float]) -> list[float]:
    x, y, v, w = s
    r, r_rate = x + 0.1 * math.cos(3.0 * W * t), v - 0.3 * W * math.sin(3.0 * W * t)
    pair = 0.2 * (1.0 + 0.2 * math.cos(2.0 * W * t)) * r * y + 0.05 * (r_rate - w) * y**2
    hertz = 4.0 * max(hertz_depth(t, s), 0.0) ** 1.5
    load = 0.8 * (W / 0.9) ** 2 * math.cos(W * t)
    a = 0.1 + load - x + 0.2 * y - 0.05 * v - 0.3 * v * abs(v) - pair - hertz
    b = 0.2 * x - 1.5 * y - 0.05 * w + 0.5 * pair + hertz
    return [v, w, a, b]


def stop() -> gw.System:
    """A viscous stop whose clearance varies, on one side."""
    contact = Contact("stop", {"x": 1.0}, [Stage(0.4, 3.0, side=Side.POSITIVE)], law="viscous", viscous_damping=0.1)
    loads = [Harmonic(0.6, {"x": 1.0}), Harmonic(0.1, varies="stop.clearance", order=2, phase=0.5, name="gap")]
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=[contact], harmonics=loads, frequency=W)


def stop_depth(t: float, y: Sequence[float]) -> float:
    return y[0] - 0.1 * math.cos(2.0 * W * t + 0.5) - 0.4


def stop_rates(t: float, y: Sequence[float]) -> list[float]:
    depth, rate = stop_depth(t, y), y[1] + 0.2 * W * math.sin(2.0 * W * t + 0.5)
    return [y[1], 0.6 * math.cos(W * t) - y[0] - 0.1 * y[1] - (3.0 * depth + 0.1 * rate if depth > 0.0 else 0.0)]


CASES = {
    "gear": (gear, gear_rates, [mesh_depth, lambda t, y: math.cos(2 * W * t + 0.3) - math.cos(0.6 * math.pi)]),
    "drag": (drag, drag_rates, [hertz_depth, lambda t, y: y[2]]),
    "stop": (stop, stop_rates, [stop_depth]),
}


def by_scipy(rates: Callable, guards: Sequence[Callable], start: np.ndarray, end: float) -> tuple[np.ndarray, float]:
    """State after a time, and the integral of the divergence: DOP853, begun again at each zero of a guard."""

    def divergence(t: float, y: np.ndarray) -> float:
        n, step = len(y) // 2, 1e-6  # the accelerations are quadratic in the rates, or linear
        total = 0.0
        for i in range(n, 2 * n):
            aside = np.eye(2 * n)[i] * step
            total += (rates(t, y + aside)[i] - rates(t, y - aside)[i]) / (2.0 * step)
        return total

    def every(t: float, z: np.ndarray) -> list[float]:
        return [*rates(t, z[:-1]), divergence(t, z[:-1])]

    events = [lambda t, z, guard=guard: guard(t, z[:-1]) for guard in guards]
    for event in events:
        event.terminal = True
    t, z = 0.0, np.append(start, 0.0)
    while t < end:
        # a step away from the kink at which it stands, so that the kink is not found again
        tiny = min(1e-9, end - t)
        z, t = z + tiny * np.array(every(t + 0.5 * tiny, z)), t + tiny
        if t >= end:
            break
        found = solve_ivp(every, (t, end), z, "DOP853", events=events, rtol=1e-12, atol=1e-13, max_step=0.05)
        t, z = float(found.t[-1]), found.y[:, -1]
    return z[:-1], float(z[-1])


def orbit_of(name: str) -> gw.Orbit:
    system = CASES[name][0]()
    start = gw.integrate(system, np.zeros(2 * system.size), 60, samples=4)
    return gw.find_orbit(system, 1, [*start.q[-1], *start.v[-1]])


@pytest.mark.parametrize("name", CASES)
def test_the_second_equations_are_those_typed_by_hand(name: str) -> None:
    make, rates, _ = CASES[name]
    system, random = make(), np.random.default_rng(3)
    n, count = system.size, 200
    states, times = random.normal(size=(count, 2 * n)), random.uniform(0.0, 30.0, count)
    equations, theta = Equations([system]), W * times
    full = np.column_stack((states, np.zeros(count)))
    closed = (equations.depths(equations.deflections(theta, states[:, :n])) > 0.0) * 1.0
    found = equations.rates(theta, full, closed)[:, : 2 * n] * W
    expected = [rates(t, y) for t, y in zip(times.tolist(), states.tolist(), strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_many_systems_at_once_are_each_as_alone(name: str) -> None:
    system, random = CASES[name][0](), np.random.default_rng(4)
    n, load = system.size, system.structure.harmonics[0].name
    many = [system.at({"frequency": W + 0.1 * k, f"{load}.amplitude": 0.1 + 0.05 * k}) for k in range(4)]
    states, theta = random.normal(size=(4, 2 * n)), random.uniform(0.0, 6.0, 4)
    full, together = np.column_stack((states, np.zeros(4))), Equations(many)
    closed = (together.depths(together.deflections(theta, states[:, :n])) > 0.0) * 1.0
    found = together.rates(theta, full, closed)
    for k, each in enumerate(many):
        here = slice(k, k + 1)
        np.testing.assert_allclose(found[k], Equations([each]).rates(theta[here], full[here], closed[here])[0])


@pytest.mark.parametrize("name", some_of(CASES, "gear"))
def test_orbits_close_and_volumes_shrink_as_scipy_says(name: str) -> None:
    _, rates, guards = CASES[name]
    orbit = orbit_of(name)
    (around,) = carry([orbit])
    assert around.closure < 1e-11
    assert around.error < 1e-10
    assert around.astray < 1e-11
    assert around.contraction == pytest.approx(math.log(abs(np.prod(orbit.multipliers))), rel=1e-9)
    assert around.extremes == pytest.approx(orbit.extremes[:, :2], abs=1e-8)
    end, contraction = by_scipy(rates, guards, orbit.state, TAU / W)
    np.testing.assert_allclose(end, orbit.state, atol=1e-8)
    assert around.contraction == pytest.approx(contraction, rel=1e-6)
    # beside the orbit: the other integrator and SciPy arrive at the same state
    aside = replace(orbit, state=orbit.state + 1e-5)
    (around,) = carry([aside])
    units = np.repeat([np.abs(around.extremes).max(), np.abs(orbit.motion().v).max()], orbit.system.size)
    gap = (by_scipy(rates, guards, aside.state, TAU / W)[0] - aside.state) / units
    assert around.closure == pytest.approx(np.abs(gap).max(), rel=2e-3)


@pytest.mark.slow
def test_kinks_are_found_to_rounding_and_keep_the_order_of_the_method() -> None:
    contact = force("drag", {"x": 1.0}, "c*v*abs(v)", c=0.3)
    system = gw.System(
        ["x"], [[1.0]], [[0.05]], contacts=[contact], harmonics=[Harmonic(1.0, {"x": 1.0})], frequency=0.7
    )
    orbit = gw.find_orbit(system, 1, [1.0, 0.0])
    (around,) = carry([orbit])
    assert around.closure < 1e-12
    angles = [angle for angle, _ in around.kinks]
    assert angles == pytest.approx(orbit.turns[0].thetas, abs=1e-12)  # where the rate vanishes
    assert len(angles) == 2


@pytest.mark.parametrize(("name", "to"), [in_campaign("gear", 0.9), ("stop", 0.9)])
def test_a_walk_verifies_and_a_wrong_number_is_found(name: str, to: float) -> None:
    branch = gw.follow(orbit_of(name), "frequency", to=to, verify=True)
    assert len(branch.points) > 3
    load = branch.system.structure.harmonics[0].name
    point = branch.points[2]
    other = point.orbit.system.at({f"{load}.amplitude": point.orbit.system[f"{load}.amplitude"] * 1.0001})
    wrong = replace(point, orbit=replace(point.orbit, system=other), memo={})
    found = gw.verify(replace(branch, points=(*branch.points[:2], wrong, *branch.points[3:])))
    assert ("closure", "point 2") in {(each.check.word, each.spot.item) for each in found.breaches}
