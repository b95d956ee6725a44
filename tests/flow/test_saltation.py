"""Derivatives through events: forces that jump whatever the rate, and rates that are reset."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import ParameterLine, coefficients_of
from gapwalk.model.laws import CLEARANCE, STIFFNESS, Law
from gapwalk.model.registry import Parameter
from gapwalk.model.units import QuantityKind


class Preloaded(Law):
    """A spring whose force begins at once, and a damper that acts while it touches."""

    name, words = "preloaded", "a spring with a preload"
    parameters = (Parameter("drag", None, "it is the coefficient of the damper", 0.0, 0.0, -1, 1),)
    stage_parameters = (
        CLEARANCE,
        STIFFNESS,
        Parameter("preload", QuantityKind.TORQUE, "it is the force at the breakpoint"),
    )

    def force(self, rate, stages, numbers):
        spring = stages.total(s.closed * (s.sign * s["preload"] + s["stiffness"] * s.depth) for s in stages)
        return spring + numbers["drag"] * stages.total(s.closed for s in stages) * rate


class Yielding(Preloaded):
    """The same with a spring that yields, which is no polynomial of the penetration."""

    name = "yielding"

    def force(self, rate, stages, numbers):
        spring = stages.total(
            s.closed * (s.sign * s["preload"] + s["stiffness"] * s.depth / (1.0 + s.depth * s.depth)) for s in stages
        )
        return spring + numbers["drag"] * stages.total(s.closed for s in stages) * rate


class Restitution(Law):
    """A rigid wall: the rate is reversed, and a share of it is left."""

    name, words = "restitution", "a rigid wall"
    parameters = (Parameter("restitution", None, "it is the share of the rate that is left", least=0.0),)
    stage_parameters = (CLEARANCE,)

    def force(self, rate, stages, numbers):
        return 0.0

    def rebound(self, rate, numbers):
        return -numbers["restitution"] * rate


def jumping(law: Law) -> gw.System:
    stage = gw.Stage(0.3, 2.0, numbers={"preload": 0.4})
    stop = gw.Contact("stop", {"x": 1.0, "y": -0.3}, [stage], {"x": 1.0, "y": -0.5}, law, drag=0.3)
    load = gw.Harmonic(1.5, {"x": 1.0})
    stiffness = [[1.5, -0.5], [-0.5, 1.0]]
    return gw.System(["x", "y"], stiffness, [0.1, 0.15], [1.0, 2.0], [stop], {"x": 0.1}, [load], 0.8)


def wall(**changes: float) -> gw.System:
    """COCO's demo 'impact': ``x'' + 0.1 x' + x = cos t`` with a wall at 1."""
    stages = [gw.Stage(1.0, side=gw.Side.POSITIVE)]
    stop = gw.Contact("stop", {"x": 1.0}, stages, law=Restitution(), restitution=0.8)
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=[gw.Harmonic(1.0, {"x": 1.0})])
    return system.at(changes)


def check_derivatives(system: gw.System, state: np.ndarray, names: list[str], impacts: int, tolerance: float) -> None:
    """The transition matrix and the sensitivities over a period against central differences."""
    directions = np.array([ParameterLine(system, name).coefficients(system[name])[1] for name in names])
    arc = flow_of(system, *names, transition=True).integrate(coefficients_of(system), state, direction=directions)
    assert len(arc.contacts) >= impacts

    def end(state: np.ndarray, values: gw.System = system) -> np.ndarray:
        return flow_of(values).integrate(coefficients_of(values), state).state

    step = 1e-6
    differences = [(end(state + step * unit) - end(state - step * unit)) / (2 * step) for unit in np.eye(len(state))]
    np.testing.assert_allclose(arc.transition, np.transpose(differences), atol=tolerance)
    assert arc.sensitivity is not None
    for name, column in zip(names, arc.sensitivity.T, strict=True):
        up, down = (system.at({name: system[name] + each}) for each in (step, -step))
        difference = (end(state, up) - end(state, down)) / (2 * step)
        np.testing.assert_allclose(column, difference, atol=tolerance, err_msg=name)


@pytest.mark.parametrize("law", [Preloaded(), Yielding()])
def test_a_force_that_jumps_whatever_the_rate(law: Law) -> None:
    names = ["frequency", "stop.preload", "stop.drag", "stop.clearance", "stop.force.y", "stop.deflection.y"]
    check_derivatives(jumping(law), np.array([0.7, -0.4, 0.3, 0.5]), names, 4, 1e-7)


def test_a_reset_of_the_rate() -> None:
    names = ["frequency", "stop.restitution", "stop.clearance", "stop.deflection.x", "mass.x.x"]
    check_derivatives(wall(), np.array([0.5, 1.5]), names, 1, 1e-6)


def test_a_reset_acts_along_the_force_of_the_contact() -> None:
    """Of two masses that collide the momentum is kept."""
    bodies = gw.Contact("hit", {"x": 1.0, "y": -1.0}, [gw.Stage(0.5)], law=Restitution(), restitution=0.6)
    system = gw.System(["x", "y"], [[1.0, -1.0], [-1.0, 1.0]], mass=[1.0, 3.0], contacts=[bodies])
    names = ["hit.restitution", "hit.clearance", "mass.y.y"]
    state = np.array([0.1, 0.0, 2.0, -0.1])
    check_derivatives(system, state, names, 1, 1e-6)
    arc = flow_of(system).integrate(coefficients_of(system), state)
    assert arc.state[2] + 3.0 * arc.state[3] == pytest.approx(2.0 - 0.3, abs=1e-12)


def test_restitution_gives_the_known_periodic_motion() -> None:
    """Velocity after the impact of the one-impact motion: -1.3565863500759, by root finding of the closed form."""
    system = wall()
    flow, coefficients = flow_of(system, transition=True), coefficients_of(system)
    state = np.array([0.0, -1.0])
    for _ in range(400):
        state = flow.integrate(coefficients, state).state
    for _ in range(8):  # Newton's method, by the transition matrix that passes the impact
        arc = flow.integrate(coefficients, state)
        state = state - np.linalg.solve(arc.transition - np.eye(2), arc.state - state)
    (impact,) = flow.integrate(coefficients, state).contacts
    assert -0.8 * impact.velocity == pytest.approx(-1.3565863500759, abs=1e-11)
    # the product of the multipliers: r^2 by the impact, and what the damper takes
    assert np.linalg.det(flow.integrate(coefficients, state).transition) == pytest.approx(0.64 * np.exp(-0.1 * PERIOD))


def test_a_continuous_force_costs_nothing() -> None:
    """No rule is asked for where neither the force jumps nor the state is reset."""
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[gw.backlash("gap", {"x": 1.0}, 0.5, impact_damping=0.1)])
    board = flow_of(system)._take()._switchboard
    assert board._jumps == [None, None]
    assert board._rebounds == [False, False]


@pytest.mark.slow
def test_the_motion_with_a_preload_is_that_of_another_integrator() -> None:
    system, state = jumping(Preloaded()), np.array([0.7, -0.4, 0.3, 0.5])

    def rates(theta: float, y: np.ndarray) -> np.ndarray:
        x, rate = y[0] - 0.3 * y[1], y[2] - 0.3 * y[3]
        depth = max(abs(x) - 0.3, 0.0)
        force = (np.sign(x) * (0.4 + 2.0 * depth) + 0.3 * rate) * (depth > 0.0)
        pull = system.matrix("stiffness") @ y[:2] + system.matrix("damping") @ y[2:] + force * np.array([1.0, -0.5])
        load = np.array([0.1 + 1.5 * np.cos(theta), 0.0])
        return np.concatenate((y[2:], (load - pull) / np.array([1.0, 2.0]))) / 0.8

    found = flow_of(system).integrate(coefficients_of(system), state).state
    expected = solve_ivp(rates, (0.0, PERIOD), state, "LSODA", rtol=1e-9, atol=1e-9, max_step=1e-4).y[:, -1]
    np.testing.assert_allclose(found, expected, atol=2e-4)
