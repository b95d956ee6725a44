"""The references themselves: numbers of the literature, closed forms, and the balance of energy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from tests.dry import closed_forms
from tests.dry.event_reference import Reference
from tests.flow.dry_systems import clutch
from tests.tiers import keeps

TURN = 2.0 * math.pi


def oscillator(contacts, *, frequency=1.0, damping=0.0, amplitude=1.0, stiffness=1.0, mean=0.0) -> System:
    return System(
        ["x"],
        [[stiffness]],
        [[damping]],
        contacts=contacts,
        mean={"x": mean},
        harmonics=[Harmonic(amplitude, {"x": 1.0})],
        frequency=frequency,
    )


def wall(clearance: float, restitution: float) -> Contact:
    return Contact("wall", {"x": 1.0}, [Stage(clearance, side=Side.POSITIVE)], law="rigid", restitution=restitution)


def periodic(reference: Reference, state, tries: int = 12):
    """Find a periodic motion by Newton's method with differences; return it and its transition matrix."""
    state = np.array(state, dtype=float)

    def around(y):
        return reference.integrate(y, 0.0, TURN).state

    for _ in range(tries):
        steps = 1e-6 * np.eye(len(state))
        slopes = np.column_stack([(around(state + step) - around(state - step)) / 2e-6 for step in steps])
        move = np.linalg.solve(np.eye(len(state)) - slopes, around(state) - state)
        state = state + move
        if np.abs(move).max() < 1e-12:
            return state, slopes
    raise AssertionError("Newton's method does not converge")


@pytest.mark.parametrize(
    ("ratio", "amplitude", "guess"),
    [(0.8, 2.626104875724, [2.46031289, 0.78374321]), (1.2, 2.072384268013, [-1.90460778, 0.94718247])],
)
def test_den_hartog(ratio: float, amplitude: float, guess: list[float]) -> None:
    assert closed_forms.den_hartog(ratio, 0.3) == pytest.approx(amplitude, abs=1e-12)
    reference = Reference(oscillator([friction("f", {"x": 1.0}, 0.3)], frequency=ratio))
    state, _ = periodic(reference, guess)
    found = reference.integrate(state, 0.0, TURN)
    turns = [event.theta for event in found.events if event.theta]
    assert len(turns) == 2
    for theta in turns:
        assert abs(reference.integrate(state, 0.0, theta).state[0]) == pytest.approx(amplitude, abs=2e-12)
    assert found.heat[0] == pytest.approx(4.0 * 0.3 * amplitude, abs=1e-11)
    assert found.work.sum() == pytest.approx(found.heat[0], abs=1e-11)  # over a settled period nothing is stored


def test_an_impact_oscillator() -> None:
    assert closed_forms.one_impact_fold() == pytest.approx(0.09997075362831, abs=1e-14)
    (motion,) = [each for each in closed_forms.one_impact(1.0) if each.velocity < 0.0]
    assert motion.velocity == pytest.approx(-1.3565863500759, abs=1e-13)
    start = motion.phase % TURN
    found = Reference(oscillator([wall(1.0, 0.8)], damping=0.1)).integrate([1.0, motion.velocity], start, start + TURN)
    # it starts at the wall with the velocity after an impact, and ends there before or after the next one
    assert found.state[0] == pytest.approx(1.0, abs=1e-11)
    assert min(abs(found.state[1] - each) for each in (motion.velocity, -motion.velocity / 0.8)) < 1e-11


@keeps("1")
@pytest.mark.parametrize("periods", [1, 2])
def test_budd_and_dux(periods: int) -> None:
    frequency, r = 2.0 * periods, 0.7
    speed = closed_forms.budd_dux(periods, r)
    reference = Reference(oscillator([wall(0.0, r)], frequency=frequency))
    before, after = 0.25 * TURN + 0.3, 0.25 * TURN + 0.3 + periods * TURN
    state = reference.integrate([0.0, -r * speed], 0.25 * TURN, before).state
    found = reference.integrate(state, before, after)
    (impact,) = [event for event in found.events if event.kind == "contact"]
    assert impact.theta == pytest.approx(0.25 * TURN + periods * TURN, abs=1e-12)
    assert impact.rate == pytest.approx(speed, abs=1e-12)
    np.testing.assert_allclose(found.state, state, atol=1e-12)
    steps = 1e-6 * np.eye(2)
    slopes = [
        (reference.integrate(state + s, before, after).state - reference.integrate(state - s, before, after).state)
        / 2e-6
        for s in steps
    ]
    assert np.linalg.det(slopes) == pytest.approx(r**2, abs=1e-8)


def test_chatter_to_rest() -> None:
    system = oscillator([wall(0.0, 0.6)], amplitude=0.0, stiffness=0.0, mean=0.9)
    found = Reference(system).integrate([-0.4, 0.0], 0.0, 20.0)
    impacts = [event.theta for event in found.events if event.kind == "contact"]
    times, rest = closed_forms.chatter(0.4, 0.9, 0.6, len(impacts))
    np.testing.assert_allclose(impacts, times, atol=1e-9)  # the last flights take 1e-7
    np.testing.assert_allclose(impacts[:12], times[:12], atol=1e-12)
    (held,) = [event.theta for event in found.events if event.kind == "held"]
    assert 0.0 < rest - held < 1e-6
    np.testing.assert_allclose(found.state, 0.0, atol=1e-14)
    assert found.taken[0] == pytest.approx(0.9 * 0.4, abs=1e-13)


def test_a_held_contact_is_released() -> None:
    # x'' = -sin(t) beside the stop: it presses while the load is positive, and is released where that is 0
    system = oscillator([wall(0.5, 0.6)], stiffness=0.0)
    found = Reference(system.at({"harmonic1.phase": -0.5 * math.pi})).integrate([0.5, 0.0], 0.0, 5.0)
    (released,) = [event for event in found.events if event.kind == "contact"]
    assert (released.theta, released.mode) == (pytest.approx(math.pi, abs=1e-11), 0)
    t = 5.0 - math.pi
    np.testing.assert_allclose(found.state, [0.5 - t + math.sin(t), -1.0 + math.cos(t)], atol=1e-10)


@pytest.mark.parametrize("stiffness", [10.0, 1e4])
def test_a_soft_impact_is_one_with_restitution(stiffness: float) -> None:
    damping = 0.3 * math.sqrt(stiffness)
    stop = Contact(
        "stop", {"x": 1.0}, [Stage(0.0, stiffness, side=Side.POSITIVE)], law="viscous", viscous_damping=damping
    )
    found = Reference(oscillator([stop], amplitude=0.0, stiffness=0.0)).integrate([-0.5, 1.0], 0.0, 3.0)
    assert found.state[1] == pytest.approx(-closed_forms.soft_restitution(stiffness, damping), abs=1e-11)


def test_a_jenkins_element_under_a_harmonic_motion() -> None:
    heavy = System(
        ["x"], [[1e8]], mass=[[1e8]], contacts=[friction("f", {"x": 1.0}, 0.3, stiffness=2.0)], frequency=1.0
    )
    reference = Reference(heavy)
    state = reference.integrate([1.0, 0.0, 0.0], 0.0, TURN).state
    heat = reference.integrate(state, 0.0, TURN).heat[0]
    assert heat == pytest.approx(closed_forms.jenkins_loss(2.0, 0.3, 1.0), abs=1e-7)


def chain(parts) -> System:
    """Three masses with springs and dampers, under two harmonics."""
    return System(
        ["a", "b", "c"],
        [[3.0, -1.0, 0.0], [-1.0, 2.5, -1.0], [0.0, -1.0, 2.0]],
        0.06 * np.eye(3) + 0.02 * np.ones((3, 3)),
        mass=np.diag([1.0, 0.8, 1.3]),
        contacts=parts,
        mean={"b": 0.1},
        harmonics=[Harmonic(0.9, {"a": 1.0}), Harmonic(0.5, {"b": 0.4, "c": 1.0}, 2, 0.7)],
        frequency=0.9,
    )


def everything() -> System:
    spring = Contact("spring", {"b": 1.0}, [Stage(0.1, 2.0)], law="viscous", viscous_damping=0.1)
    return chain(
        [
            friction("rigid", {"b": 1.0, "c": -1.0}, 0.25, static=1.3),
            friction("ground", {"a": 1.0}, 0.1),
            friction("slider", {"a": 1.0, "b": -1.0}, 0.1, stiffness=3.0),
            friction("belt", {"c": 1.0}, 0.05, speed=0.3),
            Contact("elastic", {"c": 1.0}, [Stage(0.2, 3.0)]),
            friction("pressed", {"b": 1.0}, coefficient=0.2, normal="elastic", stiffness=2.0),
            spring,
            Contact("stop", {"a": 1.0}, [Stage(0.5)], law="rigid", restitution=0.5),
        ]
    )


@pytest.mark.slow
def test_the_work_of_loads_is_dissipated() -> None:
    system = everything()
    reference = Reference(system)
    state = np.array([0.208, -0.002, -0.0065, 0.177, 0.331, 0.331, 0.0009, 0.0])

    def energy(y):
        q, v = y[:3], y[3:6]
        springs = sum(0.5 * k * max(abs(q[place]) - gap, 0.0) ** 2 for place, gap, k in ((1, 0.1, 2.0), (2, 0.2, 3.0)))
        own = 0.5 * v @ system.matrix("mass") @ v + 0.5 * q @ system.matrix("stiffness") @ q
        return own + springs + 0.5 * 3.0 * y[6] ** 2 + 0.5 * 2.0 * y[7] ** 2

    found = reference.integrate(state, 0.0, TURN)
    kinds = {event.kind for event in found.events} | {event.mode for event in found.events if event.kind == "slip"}
    assert kinds >= {"contact", "slip", 1, -1, 0}
    # of what elements take, springs keep a part: the rest is heat
    viscous = found.taken[6] - 0.5 * 2.0 * np.diff([max(abs(y[1]) - 0.1, 0.0) ** 2 for y in (state, found.state)])[0]
    dry = found.heat.sum() + found.taken[7] + viscous
    belt = found.heat[3] - found.taken[3]  # it drives with its speed
    balance = found.work.sum() + belt - found.damped - dry - (energy(found.state) - energy(state))
    assert balance == pytest.approx(0.0, abs=1e-11)


@pytest.mark.slow
@keeps("1.2315204596-guess1")
@pytest.mark.parametrize(
    ("frequency", "guess"),
    [
        (1.3319237942, [0.99770272, 0.84508698, 0.45558945, -0.50742147]),
        (1.2315204596, [1.74689408, -0.01878571, 0.57156223, -0.61843846]),
    ],
)
def test_flips_of_the_clutch_with_friction(frequency: float, guess: list[float]) -> None:
    """Check two flips that a throw-away script found on another integrator, with Coulomb friction in figure 13."""
    _, slopes = periodic(Reference(clutch(0.005).at(frequency=frequency)), guess)
    assert np.abs(np.linalg.eigvals(slopes) + 1.0).min() < 1e-6
