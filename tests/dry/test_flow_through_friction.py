"""The flow through stick, slip and impacts: states against another integrator, derivatives against differences."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np
import pytest
from numpy.typing import NDArray

import gapwalk as gw
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.motion import DryModes, modes_along
from gapwalk.flow.single_friction import LoneFriction
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Coulomb, Hysteretic, Jenkins
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.orbit.sticking import FrictionGauge
from tests.dry import closed_forms
from tests.dry.event_reference import Reference
from tests.tiers import in_campaign, keeps

START = [0.31, 0.17, 0.23, -0.11]
LOAD = Harmonic(1.0, {"x": 1.0}, name="load")


def one(*contacts: Contact, stiffness=1.0, damping=0.05, frequency=0.5, load=LOAD) -> System:
    return System(["x"], [[stiffness]], [[damping]], contacts=contacts, harmonics=[load], frequency=frequency)


def two(*contacts: Contact, frequency=0.45) -> System:
    stiffness = [[2.0, -1.0], [-1.0, 1.5]]
    return System(["x", "y"], stiffness, np.eye(2) * 0.1, contacts=contacts, harmonics=[LOAD], frequency=frequency)


def wall(clearance: float, restitution: float, side=Side.POSITIVE) -> Contact:
    return Contact("wall", {"x": 1.0}, [Stage(clearance, side=side)], law="rigid", restitution=restitution)


def damper(**more) -> Contact:
    stages = [
        Stage(0.2, 3.0, name="a", numbers={"hysteresis": 0.2}),
        Stage(0.8, 5.0, name="b", numbers={"hysteresis": 0.4}),
    ]
    return Contact("c", {"x": 1.0}, stages, law=Hysteretic("viscous"), viscous_damping=0.1)


PRESS = Contact("c", {"x": 1.0}, [Stage(0.2, 3.0)])
BRAKE, PAD = friction("f", {"x": 1.0}, 0.3), friction("g", {"x": -1.0, "y": 1.0}, 0.4)
SYSTEMS = {
    "slip": (one(BRAKE, frequency=0.8, damping=0.0), ["frequency", "f.limit"]),
    "stick": (one(friction("f", {"x": 1.0}, 0.75)), ["frequency", "f.limit", "load.amplitude"]),
    "static": (one(friction("f", {"x": 1.0}, 0.5, static=1.4)), ["f.limit", "f.static"]),
    "belt": (one(friction("f", {"x": 1.0}, 0.5, static=1.4, speed=0.3)), ["f.limit", "f.speed"]),
    "two that stick": (two(BRAKE, PAD), ["frequency", "g.limit", "g.deflection.y", "stiffness.x.y"]),
    "along another direction": (
        two(friction("f", {"x": 1.0}, 0.3, static=1.3, force={"x": 1.0, "y": -0.4}), PAD),
        ["frequency", "f.static", "f.force.y"],
    ),
    "jenkins": (one(friction("f", {"x": 1.0}, 0.3, stiffness=2.0)), ["frequency", "f.limit", "f.stiffness"]),
    "iwan": (
        two(
            friction("f", {"x": 1.0}, 0.3, stiffness=3.0),
            friction("g", {"x": 1.0}, 0.2, stiffness=1.0),
            friction("h", {"y": 1.0, "x": -1.0}, 0.1, speed=0.05),
        ),
        ["f.limit", "g.stiffness", "h.speed"],
    ),
    "impacts": (one(wall(1.0, 0.8), damping=0.1, frequency=1.0), ["frequency", "wall.clearance", "wall.restitution"]),
    "chatter": (
        one(wall(0.35, 0.5), stiffness=0.2, frequency=0.3),
        ["frequency", "wall.clearance", "wall.restitution"],
    ),
    "stages": (
        one(damper(), Contact("cf", {"x": 1.0}, (), law=Coulomb("stages", "c")), stiffness=0.1),
        ["frequency", "c.a.hysteresis", "c.b.clearance"],
    ),
    "springs of stages": (
        one(damper(), Contact("cf", {"x": 1.0}, (), law=Jenkins("stages", "c"), stiffness=8.0), stiffness=0.1),
        ["c.a.hysteresis", "c.b.clearance", "cf.stiffness"],
    ),
    "normal": (
        two(PRESS, Contact("cf", {"y": 1.0}, (), law=Coulomb("normal", "c"), coefficient=0.3)),
        ["cf.coefficient", "c.clearance"],
    ),
    "springs that are pressed": (
        two(PRESS, Contact("cf", {"y": 1.0}, (), law=Jenkins("normal", "c"), coefficient=0.3, stiffness=3.0)),
        ["cf.coefficient", "c.clearance"],
    ),
}
each_system = pytest.mark.parametrize("name", SYSTEMS)


def start_of(system: System) -> np.ndarray:
    n = system.size
    return np.concatenate((START[:n], START[2 : 2 + n], np.zeros(system.state_size - 2 * n)))


@each_system
def test_the_state_is_that_of_another_integrator(name: str) -> None:
    system, _ = SYSTEMS[name]
    end = 2.0 * PERIOD if name in ("impacts", "stages") else PERIOD  # others have all kinds of events in one period
    arc = flow_of(system).integrate(coefficients_of(system), start_of(system), 0.0, end)
    expected = Reference(system).integrate(start_of(system), 0.0, end)
    assert arc.state == pytest.approx(expected.state, abs=1e-9)


@each_system
def test_derivatives_are_those_of_differences(name: str) -> None:
    system, names = SYSTEMS[name]
    start, h = start_of(system), 1e-6

    def end(state: np.ndarray, changed: System = system) -> np.ndarray:
        return flow_of(changed).integrate(coefficients_of(changed), state).state

    directions = np.array([ParameterLine(system, each).coefficients(system[each])[1] for each in names])
    flow = flow_of(system, *names, transition=True)
    arc = flow.integrate(coefficients_of(system), start, 0.0, PERIOD, directions)
    assert arc.transition is not None
    assert arc.sensitivity is not None
    steps = h * np.eye(len(start))
    slopes = np.column_stack([(end(start + step) - end(start - step)) / (2.0 * h) for step in steps])
    assert arc.transition == pytest.approx(slopes, abs=1e-7)
    by_numbers = [
        (end(start, system.at({each: system[each] + h})) - end(start, system.at({each: system[each] - h}))) / (2.0 * h)
        for each in names
    ]
    assert arc.sensitivity.reshape(len(start), -1) == pytest.approx(np.column_stack(by_numbers), abs=1e-7)


@pytest.mark.parametrize(("ratio", "amplitude"), [(0.8, 2.626104875724), (1.2, 2.072384268013)])
def test_den_hartogs_amplitudes(ratio: float, amplitude: float) -> None:
    orbit = gw.find_orbit(one(BRAKE, damping=0.0, frequency=ratio))
    assert [orbit.measure("max.x"), -orbit.measure("min.x")] == pytest.approx([amplitude] * 2, abs=1e-11)


@keeps("0.3-0.8-0")
@pytest.mark.parametrize(
    ("limit", "frequency", "stops"),
    [(0.3, 0.8, 0), (0.5, 0.4, 1), in_campaign(0.2, 0.2, 1), (0.2, 0.12, 2), in_campaign(0.25, 0.12, 2)],
)
def test_den_hartogs_motions_with_stops(limit: float, frequency: float, stops: int) -> None:
    """Motions without a stop, with one, and with two stops per half period, and what becomes of their changes."""
    system = one(friction("f", {"x": 1.0}, limit), damping=0.0, frequency=frequency)
    orbit, reference = gw.find_orbit(system), Reference(system)
    assert [event.slip for event in orbit.slips[1:]].count(0) == 2 * stops

    def around(state: np.ndarray) -> np.ndarray:
        return reference.integrate(state, 0.0, PERIOD).state

    assert around(orbit.state) == pytest.approx(orbit.state, abs=1e-9)
    for event in orbit.slips[1:]:
        position = flow_of(system).integrate(coefficients_of(system), orbit.state, 0.0, event.theta).state[0]
        assert position == pytest.approx(reference.integrate(orbit.state, 0.0, event.theta).state[0], abs=1e-9)
    h = 1e-5
    steps = h * np.eye(2)
    slopes = np.column_stack([(around(orbit.state + step) - around(orbit.state - step)) / (2.0 * h) for step in steps])
    found, expected = (np.sort_complex(each) for each in (orbit.multipliers, np.linalg.eigvals(slopes)))
    assert found == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("periods", [1, 2])
def test_one_impact_in_n_periods(periods: int) -> None:
    """Budd and Dux (1994): W = 2n, one impact in n periods; its velocity in closed form, and det M = r^2."""
    restitution, frequency = 0.8, 2.0 * periods
    velocity = closed_forms.budd_dux(periods, restitution)
    load = Harmonic(1.0, {"x": 1.0}, name="load", phase=math.pi / 2.0)
    system = one(wall(0.0, restitution), damping=0.0, frequency=frequency, load=load)
    # the impact is at theta = 0, where the load is largest: the orbit leaves with r V
    orbit = gw.find_orbit(system, periods, start=[-1e-12, -restitution * velocity])
    assert [event.velocity for event in orbit.events if event.enters] == pytest.approx([velocity], abs=1e-10)
    assert abs(np.prod(orbit.multipliers)) == pytest.approx(restitution**2, abs=1e-9)


def test_chatter_ends_where_the_geometric_series_does() -> None:
    height, gravity, restitution = 1.0, 2.0, 0.6
    system = System(["x"], [[0.0]], contacts=[wall(0.0, restitution)], mean={"x": gravity})
    arc = flow_of(system).integrate(coefficients_of(system), np.array([-height, 0.0]), 0.0, 2.0 * PERIOD)
    times, end = closed_forms.chatter(height, gravity, restitution, 20)
    hits = [event.theta for event in arc.contacts if event.enters]
    assert hits[:20] == pytest.approx(times, abs=1e-11)
    assert hits[-1] == pytest.approx(end, abs=1e-6)
    assert arc.state == pytest.approx([0.0, 0.0], abs=1e-15)


def test_changes_before_a_stop_that_is_held_move_dampers_on_their_way_to_it() -> None:
    """A motion that begins h before its stop bounces to it in a time of the order of the root of h."""
    system = System(
        ["x", "y"],
        [[0.8, -0.3], [-0.3, 0.5]],
        [[0.3, -0.2], [-0.2, 0.25]],
        mass=np.diag([1.3, 0.7]),
        contacts=[wall(0.2, 0.6), friction("f", {"y": 1.0}, 0.05)],
        mean={"x": 1.5},
        harmonics=[Harmonic(0.4, {"y": 1.0})],
        frequency=0.5,
    )
    start, flow = np.array([0.2, 0.1, 0.0, 0.4]), flow_of(system)
    found = flow_of(system, transition=True).integrate(coefficients_of(system), start, 0.0, 0.8)
    assert found.transition is not None

    def slope(h: float) -> np.ndarray:
        before = start - np.array([h, 0.0, 0.0, 0.0])
        return (found.state - flow.integrate(coefficients_of(system), before, 0.0, 0.8).state) / h

    # the remainder has the powers 1/2 and 1 of h
    once = [2.0 * slope(h / 4.0) - slope(h) for h in (1e-6, 2.5e-7)]
    assert found.transition[:, 0] == pytest.approx((4.0 * once[1] - once[0]) / 3.0, abs=1e-6)
    assert np.abs(found.transition[:, 0]).max() > 0.1


@pytest.mark.parametrize("name", ["belt", "two that stick", "along another direction", "stages", "normal"])
def test_a_gauge_reads_the_same_from_compiled_values_as_from_formulas(name: str) -> None:
    """Slip rate and reserve with their derivatives, with and without the flow's readings."""
    system = SYSTEMS[name][0]
    layout, coefficients, flow = layout_of(system.structure), coefficients_of(system), flow_of(system)
    assert flow.readings is not None
    states = np.random.default_rng(2).uniform(-1.0, 1.0, (4, system.state_size))
    reactions, count = len(system.structure.reactions), len(system.structure.friction)
    modes = DryModes(np.resize([0, 1], count).astype(np.int8), np.resize([True, False], reactions))
    gauges = [FrictionGauge(layout, system.structure.friction[0], known) for known in (flow.readings, None)]
    for theta, y in enumerate(states):
        quick, exact = (
            [
                *each.bound_and_force(coefficients, float(theta), y, modes),
                *each.motion(coefficients, float(theta), y, modes),
                *each.course(each.rate, coefficients, float(theta), y, modes, 1),
                *each.course(each.reserve, coefficients, float(theta), y, modes, -1)[:2],
            ]
            for each in gauges
        )
        assert np.array(quick, dtype=float) == pytest.approx(np.array(exact, dtype=float), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", ["iwan", "springs of stages", "springs that are pressed"])
def test_a_gauge_knows_how_states_move(name: str) -> None:
    """Against differences of the motion; a spring whose host is open has let go, and in slip it follows its limit."""
    system, h = SYSTEMS[name][0], 1e-4
    coefficients, structure = coefficients_of(system), system.structure
    gauge = FrictionGauge(layout_of(structure), structure.friction[0])
    shifts = h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    thetas = np.add.outer(np.linspace(0.0, 2.0 * PERIOD, 500)[1:-1], shifts).ravel()
    start = start_of(system)
    found = flow_of(system).sample(coefficients, start, np.append(0.0, thetas))
    modes = modes_along(structure, thetas, found.slips, found.holds)
    events = np.array([each.theta for each in (*found.contacts, *found.slips)])
    compared = set[tuple[int, bool]]()
    for middle in range(2, len(thetas), 5):
        if np.abs(events - thetas[middle]).min() < 3.0 * h:
            continue
        near = found.states[middle - 1 : middle + 4]
        along = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) @ near / (12.0 * h * coefficients[0])
        moves = gauge.motion(coefficients, float(thetas[middle]), near[2], modes.at(middle))
        assert moves == pytest.approx(along, abs=1e-7)
        compared.add((int(modes.slips[middle, 0]), bool(moves[2 * system.size])))
    assert {(1, False), (0, True)} <= compared if name == "iwan" else {(0, False), (0, True)} <= compared


@pytest.mark.parametrize("name", ["slip", "stick", "static", "belt", "two that stick", "along another direction"])
def test_friction_that_changes_alone_is_decided_as_any_other(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The closed form of an end of slip gives what holding, projecting and delaying give in general."""
    system, names = SYSTEMS[name]
    flow, coefficients = flow_of(system, *names, transition=True), coefficients_of(system)
    direction = np.array([ParameterLine(system, each).coefficients(system[each])[1] for each in names])
    surveyed, grid = flow_of(system, survey=True), np.linspace(0.0, 2.0 * PERIOD, 9)

    def found() -> list:
        runs = []
        for start in np.random.default_rng(1).uniform(-1.0, 1.0, (6, system.state_size)):
            arc = flow.integrate(coefficients, start, 0.0, 2.0 * PERIOD, direction)
            runs.append((arc, surveyed.survey(coefficients, start, grid)[1]))
        return runs

    decided, alone = LoneFriction._turns_alone, []
    monkeypatch.setattr(LoneFriction, "_turns_alone", lambda *given: alone.append(decided(*given)) or alone[-1])
    quick = found()
    assert any(alone)
    monkeypatch.setattr(LoneFriction, "_turns_alone", lambda *given: False)
    monkeypatch.setattr(LoneFriction, "_lets_go_alone", lambda *given: False)
    for (arc, turns), (other, others) in zip(quick, found(), strict=True):
        assert [event[1:] for event in arc.slips] == [event[1:] for event in other.slips]
        held = [{hold.theta: hold.reactions for hold in each.holds}.values() for each in (arc, other)]  # the last holds
        assert [each for each, _ in groupby(held[0])] == [each for each, _ in groupby(held[1])]
        np.testing.assert_allclose(arc.state, other.state, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(arc.transition, other.transition, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(arc.sensitivity, other.sensitivity, rtol=1e-9, atol=1e-10)
        assert [turn.event for turn in turns] == [turn.event for turn in others]
        np.testing.assert_allclose([turn.theta for turn in turns], [turn.theta for turn in others], atol=1e-9)


@pytest.mark.parametrize("varied", [False, True])
def test_slip_that_pauses_for_a_moment_goes_on(varied: bool) -> None:
    """Next to grazing-sliding the end of a pause may be missed: the element then stuck beyond its limit, .15 off.

    The motion is continuous there. Where the limit varies, such a motion is refused instead.
    """
    ripple = gw.Harmonic(1.0, {"x": 1.0}, order=5, phase=0.9053223678792999, name="ripple")
    loads = [gw.Harmonic(1.0, {"x": 1.0}, name="load"), ripple]
    if varied:
        loads.append(gw.Harmonic(0.4, varies="f.limit", phase=0.9, name="vary"))
    contact = friction("f", {"x": 1.0}, 0.2, stiffness=20.0)
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[contact], harmonics=loads, frequency=0.7)

    def end(amplitude: float) -> NDArray[np.float64]:
        there = system.at({"ripple.amplitude": amplitude})
        return (
            flow_of(there)
            .integrate(coefficients_of(there), np.array([0.345584192064786, 0.8216181435011584, 0.0]))
            .state
        )

    start = 1.267072529269862 if varied else 1.2898774524114986
    expected, right = end(start + 1e-8), 0
    for ahead in 10.0 ** np.linspace(-14.0, -10.0, 81):
        try:
            found = end(start + ahead)
        except NumericalError:
            assert varied
            continue
        assert found == pytest.approx(expected, abs=1e-7)
        right += 1
    assert right > (40 if varied else 80)
