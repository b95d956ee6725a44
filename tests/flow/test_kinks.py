"""Kinks of formulas that coincide with one another, with breakpoints, and with turning points, beside SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.flow.flow import FlowError, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import Contact, Side, Stage, force
from gapwalk.model.loads import Harmonic

W = 0.7
LOAD = Harmonic(1.0, {"x": 1.0})


def system(*contacts: Contact) -> gw.System:
    return gw.System(["x"], [[1.0]], [[0.05]], contacts=contacts, harmonics=[LOAD], frequency=W)


def reference(law, periods: int) -> np.ndarray:
    def rates(t, y):
        return [y[1], math.cos(W * t) - y[0] - 0.05 * y[1] - law(*y)]

    end = periods * 2.0 * math.pi / W
    return solve_ivp(rates, (0.0, end), [0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-13, max_step=0.02).y[:, -1]


def test_two_forces_with_the_same_kink_are_as_one() -> None:
    two = [force("first", {"x": 1.0}, "c*v*abs(v)", c=0.1), force("second", {"x": -2.0}, "b*abs(v)*v", b=0.025)]
    found = gw.integrate(system(*two), np.zeros(2), 20, samples=4)
    expected = reference(lambda x, v: 0.3 * v * abs(v), 20)
    np.testing.assert_allclose([found.q[-1, 0], found.v[-1, 0]], expected, atol=1e-10)


def test_a_kink_at_a_breakpoint_changes_both() -> None:
    spring = Contact("spring", {"x": 1.0}, [Stage(0.3, 2.0, side=Side.POSITIVE)])
    formula = force("formula", {"x": 1.0}, "k*max(x - gap, 0)", k=3.0, gap=0.3)
    found = gw.integrate(system(spring, formula), np.zeros(2), 20, samples=4)
    expected = reference(lambda x, v: 5.0 * max(x - 0.3, 0.0), 20)
    np.testing.assert_allclose([found.q[-1, 0], found.v[-1, 0]], expected, atol=2e-9)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_extremes_are_found_where_the_rate_has_a_kink(count: int) -> None:
    drags = [force(f"drag{k}", {"x": 1.0}, "c*v*abs(v)", c=0.3 / count) for k in range(count)]
    orbit = gw.find_orbit(system(*drags), 1, [1.0, 0.0])
    motion = orbit.motion(8192)
    largest = orbit.extremes[0]
    assert motion.q.max() <= largest[0] + 1e-12
    assert largest[:2] == pytest.approx([motion.q.max(), motion.q.min()], abs=1e-6)
    for turns in orbit.turns:
        assert len(turns.thetas) == 2
        assert sorted(turns.values) == pytest.approx(sorted(largest[:2]), abs=1e-13)


def test_a_motion_that_begins_where_a_formula_has_no_slope_is_refused_with_the_way_out():
    radial = {"x": {"x": 1.0}, "y": {"y": 1.0}}
    law = "k*max(sqrt(x**2 + y**2) - g, 0)*x/sqrt(x**2 + y**2)"
    ring = force("ring", radial, law, acts_on={"x": 1.0}, k=10.0, g=1.0)
    rotor = gw.System(["x", "y"], np.eye(2), 0.1 * np.eye(2), contacts=[ring], harmonics=[Harmonic(0.2, {"x": 1.0})])
    with pytest.raises(FlowError, match=r"cannot begin in the state \(0, 0, 0, 0\).*no finite value or slope"):
        flow_of(rotor).integrate(coefficients_of(rotor), np.zeros(4), 0.0, 1.0)
    assert np.isfinite(flow_of(rotor).integrate(coefficients_of(rotor), np.full(4, 0.1), 0.0, 1.0).state).all()


def stribeck(amplitude: float, frequency: float) -> gw.System:
    falls = force("fall", {"x": 1.0}, "-Fs*d*v/(1 + d*abs(v))", Fs=1.0, d=1.0)
    return gw.System(
        ["x"],
        mass=[[1.0]],
        stiffness=[[1.0]],
        damping=[[0.05]],
        contacts=[gw.friction("dry", {"x": 1.0}, 1.0), falls],
        harmonics=[Harmonic(amplitude, {"x": 1.0})],
        frequency=frequency,
    )


@pytest.mark.parametrize(("amplitude", "largest"), [(1.2, 1.96630022243), (2.0, 2.0767806884189)])
def test_the_falling_law_of_stribeck_is_written_beside_friction(amplitude: float, largest: float) -> None:
    """In stick the kink of abs(v) lies on the motion. Right: an event-driven DOP853 of its own."""
    orbit = gw.settle(stribeck(amplitude, 0.5)).orbit
    assert orbit is not None
    assert orbit.measure("max.x") == pytest.approx(largest, abs=1e-9)


def test_a_kink_is_passed_where_slip_turns_round_with_hardly_any_acceleration() -> None:
    """At a point of crossing-sliding the acceleration after the turn is rounding, and so is the slope of the kink."""
    state = np.array([float.fromhex("0x1.125d4025cdfa0p+1"), float.fromhex("0x1.9ccc449bdcb9ep-2")])
    found = gw.integrate(stribeck(1.2, float.fromhex("0x1.3546324c08aacp-1")), state)
    np.testing.assert_allclose(found.states[-1], state, atol=1e-9)
    assert [event.slip for event in found.slips] == [1, -1, 1]


def test_a_block_on_a_belt_with_the_falling_law_has_its_cycle() -> None:
    falls = force("fall", {"x": 1.0}, "-d*(v - vb)/(1 + d*abs(v - vb))", d=3.0, vb=0.2)
    belt = gw.friction("belt", {"x": 1.0}, 1.0, speed=0.2)
    block = gw.System(["x"], mass=[[1.0]], stiffness=[[1.0]], contacts=[belt, falls])
    assert gw.free.find_self_excited(block, start=[0.0, 0.1]).duration == pytest.approx(12.00103129483, abs=1e-9)


@pytest.mark.parametrize("held", ["friction", "stop"])
def test_modes_wait_while_all_that_moves_them_is_held(held: str) -> None:
    """Two masses stick and slip in turn, or rest on a stop; the root has the same values, and no modes."""
    names, ends = ["x", "y"], []
    for size in ("abs(v)", "sqrt(v*v + 1e-9)"):
        contacts = [gw.friction("first", {"x": 1.0}, 0.9), gw.friction("second", {"y": -1.0}, 0.75, static=1.2)]
        if held == "stop":
            contacts[0] = gw.rigid_stop("first", {"x": 1.0}, 0.3, 0.0, side="positive")
        contacts += [force(f"drag_{each}", {each: 1.0}, f"a*v*{size}", a=0.3) for each in names]
        contacts.append(force("between", {"x": 1.0, "y": -1.0}, f"-a*v/(1 + 3*{size})", a=0.2))
        moved = gw.System(
            names,
            mass=np.diag([1.5, 0.8]),
            stiffness=[[2.0, -0.8], [-0.8, 1.9]],
            damping=0.1 * np.eye(2),
            contacts=contacts,
            harmonics=[Harmonic(1.6, {"x": 1.0}), Harmonic(1.1, {"y": 1.0}, 2, 0.7)],
            frequency=0.6,
        )
        ends.append(flow_of(moved).integrate(coefficients_of(moved), np.zeros(4), 0.0, 8.0 * math.pi))
    assert len(ends[0].slips) == len(ends[1].slips) > 8
    np.testing.assert_allclose(ends[0].state, ends[1].state, atol=1e-5)


def test_a_motion_is_found_from_rest_beside_a_place_without_a_slope() -> None:
    """A shaft in a clearance all around: the circle of the form of its force that has a slope at the centre."""
    law, other = "k*max(sqrt(a*a+b*b)-g,0)*C/sqrt(a*a+b*b)", "k*(1 - g/sqrt(max(a**2 + b**2, g**2)))*C"
    states = []
    for formula in (law, other):
        forces = [
            gw.force(f"b{name}", {"a": {"x": 1.0}, "b": {"y": 1.0}}, formula.replace("C", name),
                     acts_on={coordinate: 1.0}, k=20.0, g=0.3)
            for name, coordinate in (("a", "x"), ("b", "y"))
        ]  # fmt: skip
        turning = [gw.Harmonic(0.5, {"x": 1.0}, name="h"), gw.Harmonic(0.5, {"y": 1.0}, phase=1.5, name="v")]
        system = gw.System(["x", "y"], np.eye(2), 0.1 * np.eye(2), contacts=forces, harmonics=turning, frequency=0.7)
        states.append(gw.find_orbit(system).state)
    assert states[0] == pytest.approx(states[1], rel=1e-9)
