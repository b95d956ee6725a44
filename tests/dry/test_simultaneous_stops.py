"""Events at one instant, of which the integrator tells one: ends of slip, turning points, and stops that are held."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.verification.friction_dop853 import DryRound, carry
from tests.bifurcation.alike.kinds import friction as friction_machine
from tests.dry.event_reference import Reference
from tests.sampled_verification import verified
from tests.tiers import in_campaign, keeps

TURN = 2.0 * math.pi
PARTS = [friction("joint", {"x": 1.0}, 0.2, stiffness=3.0), friction("brake", {"x": 1.0}, 0.1)]


@keeps("spring first")
@pytest.mark.parametrize("contacts", [PARTS, PARTS[::-1]], ids=["spring first", "rigid first"])
def test_both_turn_round_whichever_event_comes_first(contacts) -> None:
    load = gw.Harmonic(1.0, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], [[0.05]], contacts=contacts, harmonics=[load], frequency=0.7)
    flow, coefficients, reference = flow_of(system), coefficients_of(system), Reference(system)
    numbers = np.random.default_rng(18)
    for _ in range(4):
        state = np.array([*numbers.normal(size=2), 0.0])
        expected = reference.integrate(state, 0.0, TURN).state
        for _ in range(4):  # rounding decides which comes first
            near = state * (1.0 + 1e-15 * numbers.normal(size=3))
            found = flow.integrate(coefficients, near, 0.0, TURN).state
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10)


def test_springs_that_began_to_stick_together_slip_again_together() -> None:
    """Each reaches its limit where both had stuck. Of the two events one is told; in 2 of 100 the other was lost."""
    machine = friction_machine(21).in_units(1e-6, 1e-3, 1e3)
    system = machine.system.at(frequency=float.fromhex("0x1.141501c126de0p+10"))
    places = ["-0x1.74287172ec847p-21", "-0x1.25208463f676fp-18", "0x1.2e83d6330d84ap-25", "0x1.7b50db3f9c3fdp-26"]
    start = np.array([float.fromhex(each) for each in (*places, "0x1.fb940068cf859p-26")])
    flow, coefficients, numbers = flow_of(system), coefficients_of(system), np.random.default_rng(21)
    for _ in range(200):
        near = start * (1.0 + 1e-15 * numbers.normal(size=len(start)))
        moved = flow.integrate(coefficients, near, 0.0, TURN).state
        np.testing.assert_allclose(moved, start, rtol=0.0, atol=1e-9 * np.abs(start).max())  # it is an orbit


@pytest.mark.parametrize("phase", np.linspace(0.0, 6.0, 9))
def test_turning_points_beside_an_event_that_changes_nothing(phase: float) -> None:
    """The gap never closes, so friction that it presses has no force, but an event where b and c turn."""
    contacts = [
        friction("pair", {"b": 1.0, "c": -1.0}, 10.0),
        Contact("gap", {"b": 1.0}, [Stage(50.0, 3.0)]),
        friction("pressed", {"b": 1.0}, coefficient=0.3, normal="gap", stiffness=2.0),
    ]
    load = gw.Harmonic(1.0, {"b": 1.0}, phase=phase)
    system = gw.System(
        ["b", "c"],
        [[1.0, 0.0], [0.0, 0.0]],
        [[0.1, 0.0], [0.0, 0.0]],
        contacts=contacts,
        harmonics=[load],
        frequency=0.9,
    )
    settled = np.conj(1.0 / (1.0 - 2.0 * 0.9**2 + 0.1j * 0.9)) * np.exp(-1j * phase)  # two masses are one
    state = np.array([settled.real, settled.real, 0.9 * settled.imag, 0.9 * settled.imag, 0.0])
    grid = np.array([0.0, TURN])
    _, turns, _ = flow_of(system, survey=True).survey(coefficients_of(system), state, grid)
    for coordinate in (0, 1):
        own = [turn.positions[coordinate] for turn in turns if turn.event == coordinate]
        np.testing.assert_allclose([max(own), min(own)], [abs(settled), -abs(settled)], rtol=1e-13)


@pytest.mark.slow
def test_a_stop_stays_held_where_friction_beside_it_turns_round() -> None:
    contacts = [
        friction("ground", {"a": 1.0}, 0.2),
        Contact("stop", {"b": 1.0, "a": -0.7}, [Stage(0.3, side=Side.POSITIVE)], law="rigid", restitution=0.6),
    ]
    load = gw.Harmonic(1.3, {"a": 1.0})
    system = gw.System(
        ["a", "b"],
        [[2.0, -1.0], [-1.0, 1.5]],
        [[0.05, 0.0], [0.0, 0.05]],
        contacts=contacts,
        mean={"b": 2.0},
        harmonics=[load],
        frequency=0.8,
    )
    flow, coefficients, reference = flow_of(system), coefficients_of(system), Reference(system)
    numbers = np.random.default_rng(15)
    for _ in range(3):
        state = np.array([*(0.3 * numbers.normal(size=2) - [0.0, 0.5]), *numbers.normal(size=2)])
        expected = reference.integrate(state, 0.0, 2.0 * TURN).state
        np.testing.assert_allclose(flow.integrate(coefficients, state, 0.0, 2.0 * TURN).state, expected, atol=1e-10)


@pytest.mark.parametrize("restitution", [0.0, 0.8])
def test_a_mass_at_rest_on_a_stop_is_pressed_on_it_again_when_friction_gives_way(restitution: float) -> None:
    """Friction keeps the mass on the stop while the load pulls, and gives way where it pushes: then the stop holds."""
    contacts = [
        Contact("stop", {"x": 1.0}, [Stage(0.2, side=Side.POSITIVE)], law="rigid", restitution=restitution),
        friction("brake", {"x": 1.0}, 0.7),
    ]
    system = gw.System(["x"], [[0.1]], contacts=contacts, harmonics=[gw.Harmonic(1.0, {"x": 1.0})], frequency=0.3)
    flow, coefficients = flow_of(system), coefficients_of(system)
    # the load pushes with cos(theta) - .02: it exceeds the friction around 0, and pulls harder than it around pi
    away = math.acos(-0.68)
    free = solve_ivp(
        lambda theta, y: [y[1] / 0.3, (math.cos(theta) - 0.1 * y[0] + 0.7) / 0.3],
        (away, math.pi),
        [0.2, 0.0],
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    for start in (-away + 0.01, -1.5, -0.9, 0.0, 1.0):
        arc = flow.integrate(coefficients, np.array([0.2, 0.0]), start, away - 0.01)
        np.testing.assert_allclose(arc.state, [0.2, 0.0], atol=1e-15)
        arc = flow.integrate(coefficients, np.array([0.2, 0.0]), start, math.pi)
        np.testing.assert_allclose(arc.state, free.y[:, -1], atol=1e-10)


def test_a_stop_that_friction_lets_go_opens_in_the_log() -> None:
    """Static friction 1 presses a on its stop until it slips, at 1.5 cos(angle - 0.927) = 1; sliding, it is 0.5."""
    contacts = [
        friction("drag", {"b": 1.0, "a": -1.0}, 0.5, static=2.0),
        Contact("stop", {"a": 1.0}, [Stage(1.0, side=Side.POSITIVE)], law="rigid", restitution=0.3),
    ]
    load = gw.Harmonic(1.5, {"b": 1.0}, phase=-0.927)
    rest, damping = np.zeros((2, 2)), 0.1 * np.eye(2)
    system = gw.System(["a", "b"], rest, damping, contacts=contacts, mean={"a": -0.75}, harmonics=[load])
    arc = flow_of(system).integrate(coefficients_of(system), np.array([1.0, 0.0, 0.0, 0.0]), 0.0, 1.0)
    (opens,) = arc.contacts
    assert not opens.enters
    assert opens.theta == pytest.approx(0.927 - math.acos(2.0 / 3.0), abs=1e-12)
    assert arc.state[0] == pytest.approx(1.0 - 2.5 * (1.0 - opens.theta) + 25.0 * -math.expm1(0.1 * opens.theta - 0.1))


def _linear(frequency: float, phase: float, theta: np.ndarray) -> np.ndarray:
    """Return the steady motion of a free mass under 0.5 cos(theta) + cos(3 theta + phase), and twice its derivative."""
    lines = [
        (order, lag, 1.0 - (order * frequency) ** 2 + 0.1j * order * frequency) for order, lag in ((1, 0.0), (3, phase))
    ]
    lines = [
        (order, (0.5 if order == 1 else 1.0) * np.exp(1j * (order * theta + lag)) / under)
        for order, lag, under in lines
    ]
    return np.array([sum(((1j * order) ** power * wave).real for order, wave in lines) for power in range(3)])


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "sampled"), [(2.0, 4), *(in_campaign(phase, 0) for phase in (0.5, 2.0, 4.0))])
def test_a_branch_goes_on_where_both_sides_of_a_stop_graze_at_once(phase: float, sampled: int) -> None:
    """The linear response touches both sides of a rigid stop at once; beyond, it strikes both of them."""

    def reach(frequency: float) -> float:
        theta = np.linspace(0.0, TURN, 400)
        theta = theta[[np.argmax(_linear(frequency, phase, theta)[0])]]
        for _ in range(4):
            theta = theta - np.divide(*_linear(frequency, phase, theta)[1:])
        return float(_linear(frequency, phase, theta)[0, 0])

    graze = brentq(lambda frequency: reach(frequency) - 1.0, 1.15, 1.4, xtol=1e-14)
    loads = [gw.Harmonic(0.5, {"x": 1.0}), gw.Harmonic(1.0, {"x": 1.0}, 3, phase)]
    stop = Contact("stop", {"x": 1.0}, [Stage(1.0, side=Side.BOTH)], law="rigid", restitution=0.8)
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=loads, frequency=1.6)
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.1, walk=gw.WalkOptions(max_points=60, largest_step=0.03))
    assert {(each.kind, each.contact) for each in branch.special_points} == {
        ("grazing", "stop -"),
        ("grazing", "stop +"),
    }
    for each in branch.special_points:
        assert each.value == pytest.approx(graze, abs=each.uncertainty)
        assert each.uncertainty < 1e-11
    beyond = [point for point in branch.points if point.arclength > branch.special_points[0].point.arclength]
    assert len(beyond) > 10
    assert {point.orbit.closings for point in beyond} == {(1, 1)}
    assert verified(branch, sampled).ok


def _anvil(restitution: float, mass: float, side: float) -> gw.System:
    """Return a mass a that is pressed on the ground, and a mass b that hits it, or the sum of both, from above."""
    ground = Contact("ground", {"a": 1.0}, [Stage(0.1, side=Side.POSITIVE)], law="rigid", restitution=restitution)
    hammer = Contact("hammer", {"b": 1.0, "a": side}, [Stage(0.5, side=Side.POSITIVE)], law="rigid", restitution=0.6)
    load = gw.Harmonic(1.5, {"b": 1.0})
    damping, masses = 0.1 * np.eye(2), np.diag([mass, 1.0])
    contacts = [ground, hammer]
    return gw.System(["a", "b"], np.eye(2), damping, masses, contacts, {"a": 1.0}, [load], frequency=1.1)


@pytest.mark.parametrize(
    ("restitution", "mass", "side", "expected"),
    [
        (0.0, 4.0, -1.0, (0.0, 1.0 - 1.6 * 0.8)),  # the hammer rebounds, the ground stays held
        (0.5, 4.0, -1.0, (-0.5 * 1.6 * 0.2, 1.0 - 1.6 * 0.8)),  # the impulse goes to the ground and back
        (0.0, 4.0, 1.0, (-1.6 * 0.2, 1.0 - 1.6 * 0.8)),  # it pulls the mass off the ground
        (0.5, 4.0, 1.0, (-1.6 * 0.2, 1.0 - 1.6 * 0.8)),
        (0.0, 1.0, -1.0, (0.0, 0.0)),  # b hits a again and again, each time with a fifth of its rate
    ],
)
def test_an_impulse_on_a_stop_that_is_held(
    restitution: float, mass: float, side: float, expected: tuple[float, float]
) -> None:
    system = _anvil(restitution, mass, side)
    flow, coefficients = flow_of(system), coefficients_of(system)
    gap = 0.5 - side * 0.1
    arc = flow.integrate(coefficients, np.array([0.1, gap - 1e-6, 0.0, 2.0]), 0.0, 2e-6)
    assert arc.state[2:] == pytest.approx(np.array(expected) * 2.0, abs=1e-5)
    orbit = gw.find_orbit(system)
    (around,) = carry([orbit])
    assert isinstance(around, DryRound)
    assert around.transition is not None
    assert around.closure < 1e-10
    assert around.astray < 1e-10
    np.testing.assert_allclose(
        sorted(np.abs(np.linalg.eigvals(around.transition))), sorted(np.abs(orbit.multipliers)), atol=1e-8
    )


@pytest.mark.slow
def test_a_spring_at_its_limit_goes_back_when_the_friction_that_kept_it_lets_go() -> None:
    """All that moves is one mass: at this instant its acceleration is rounding, of either sign."""
    contacts = [friction("brake", {"x": 1.0}, 0.5), friction("joint", {"x": 1.0}, 0.2, stiffness=2.0)]
    load = gw.Harmonic(1.0, {"x": 1.0})
    system = gw.System(["x"], [[0.5]], [[0.05]], contacts=contacts, harmonics=[load], frequency=0.7)
    flow, coefficients, reference = flow_of(system), coefficients_of(system), Reference(system)
    for position in np.random.default_rng(165).uniform(0.7, 1.0, 12):
        state = np.array([position, 0.0, 0.1])  # the brake sticks until the load no longer holds both springs
        expected = reference.integrate(state, 0.0, TURN).state
        np.testing.assert_allclose(flow.integrate(coefficients, state, 0.0, TURN).state, expected, rtol=0.0, atol=1e-10)
