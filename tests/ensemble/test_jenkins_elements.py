"""Jenkins elements in the batch integrator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.ensemble.batch_flow import BlockPlan, Blocks, batch_of
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.contact import friction
from gapwalk.model.laws import Hysteretic, Jenkins
from tests.tiers import keeps, some_of

STIFFNESS, LIMIT, FREQUENCY = 3.0, 0.2, 0.8


def oscillator(*contacts, loads=()):
    loads = [Harmonic(0.6, {"x": 1.0}), *loads]
    return System(("x",), [[1.0]], [[0.1]], contacts=contacts, harmonics=loads, frequency=FREQUENCY)


def slider(**numbers):
    return friction("slider", {"x": 1.0}, **{"limit": LIMIT, "stiffness": STIFFNESS, **numbers})


def advanced(system, states, steps, periods=1, **parameters):
    """The states after some periods, without a comparison with the exact flow."""
    batch = batch_of(system, states, parameters)
    blocks = Blocks(BlockPlan(batch.linear, batch.pattern, steps), batch.states, 0, 0, False, 1)
    blocks.advance(periods)
    return blocks.states


def exact(system, states):
    flow, coefficients = flow_of(system), coefficients_of(system)
    return np.array([flow.integrate(coefficients, state, 0.0, PERIOD).state for state in states])


def draw(system, count=40, seed=0):
    """States whose elements stick."""
    random = np.random.default_rng(seed)
    states = random.normal(size=(count, system.state_size)) * 0.8
    inside = 0.9 * LIMIT / STIFFNESS
    states[:, 2 * system.size :] = random.uniform(-inside, inside, (count, system.state_size - 2 * system.size))
    return states


def rms(difference):
    return float(np.sqrt(np.mean(difference**2)))


@pytest.mark.parametrize("most", [0.5, 2.0])
def test_it_takes_from_a_heavy_oscillator_the_area_of_its_loop(most):
    heavy, limit, stiffness = 1e6, 0.3, 2.0
    element = friction("slider", {"x": 1.0}, limit, stiffness=stiffness)
    system = System(("x",), [[heavy]], mass=[[heavy]], contacts=[element], frequency=1.0)
    (x, v, z), *_ = advanced(system, np.array([[most, 0.0, limit / stiffness]] * 2), 400)
    lost = 0.5 * heavy * (most**2 - x**2 - v**2)
    assert lost == pytest.approx(4.0 * limit * (most - limit / stiffness), rel=1e-4)
    assert z == pytest.approx(limit / stiffness, rel=1e-5)


def test_an_element_that_never_slips_is_a_spring():
    states = np.array([[0.4, 0.1, 0.0], [-0.2, 0.3, 0.0]])
    stuck = advanced(oscillator(slider(limit=50.0)), states, 200, 3)
    spring = Contact("spring", {"x": 1.0}, (Stage(0.0, STIFFNESS),))
    states[:, 2] = 0.0
    offset = states[:, 0].copy()
    other = System(
        ("x",), [[1.0]], [[0.1]], contacts=[spring], harmonics=[Harmonic(0.6, {"x": 1.0})], frequency=FREQUENCY
    )
    for lane in (0, 1):  # its spring is relaxed where the motion begins
        shifted = other.at({"mean.x": STIFFNESS * offset[lane]})
        assert stuck[lane, :2] == pytest.approx(advanced(shifted, states[[lane, lane], :2], 200, 3)[0], abs=1e-7)
        assert stuck[lane, 2] == pytest.approx(stuck[lane, 0] - offset[lane], abs=1e-6)


SYSTEMS = {
    "one": oscillator(slider()),
    "a belt": oscillator(slider(speed=0.15)),
    "a moving base": oscillator(
        slider(), loads=[Harmonic(0.2, varies="slider.deflection", order=3, phase=0.4)]
    ),
    "three coordinates": System(
        ("x", "y", "z"), np.diag([2.0, 1.5, 1.0]), 0.1 * np.eye(3), mass=np.eye(3) + 0.2,
        contacts=[
            slider(), friction("other", {"y": 1.0, "z": -1.0}, 0.1, stiffness=5.0),
            Contact("gap", {"x": 1.0, "y": -1.0}, (Stage(0.3, 4.0),)),
        ],
        harmonics=[Harmonic(0.6, {"x": 1.0, "z": 0.4})], frequency=FREQUENCY,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", some_of([*SYSTEMS], "one", "three coordinates"))
def test_the_error_falls_with_the_third_power_of_the_step(name):
    system = SYSTEMS[name]
    states = draw(system)
    states[:, 2 * system.size + 1 :] *= 0.25
    ends = exact(system, states)
    for own in ({}, {"frequency": FREQUENCY + 1e-13 * np.arange(len(states))}):
        coarse, fine = (rms(advanced(system, states, steps, **own) - ends) for steps in (100, 800))
        assert fine < 1e-5
        assert coarse / fine > 100.0  # 64 for the second power, 512 for the third


def with_hysteresis(limit):
    stage = Stage(0.2, 4.0, side=Side.POSITIVE, numbers={"hysteresis": 0.3})
    host = Contact("stop", {"x": 1.0}, (stage,), None, Hysteretic("elastic"))
    return oscillator(
        Contact("slider", {"x": 1.0}, (), None, Jenkins("stages", "stop"), stiffness=STIFFNESS, limit=limit), host
    )


def by_events(state, limit, hysteresis=0.3, clearance=0.2):
    """SciPy's integrator over the modes (closed, slip) of an element by stages, one after the other."""
    theta, y = 0.0, np.array(state)
    closed, slip = y[0] > clearance, 0
    for _ in range(200):
        most = limit + hysteresis * closed

        def slope(theta, y, closed=closed, slip=slip, most=most):
            pull = (slip * most if slip or not most else STIFFNESS * y[2]) + closed * 4.0 * (y[0] - clearance)
            sticks = not slip and most > 0.0
            a = 0.6 * math.cos(theta) - 0.1 * y[1] - y[0] - pull
            return [y[1] / FREQUENCY, a / FREQUENCY, sticks * y[1] / FREQUENCY]

        guards = [(lambda t, y: y[0] - clearance, -1 if closed else 1)]
        if slip:
            guards.append((lambda t, y: y[1], -slip))
        elif most:
            guards += [(lambda t, y, s=s, most=most: s * STIFFNESS * y[2] - most, 1) for s in (1, -1)]
        events = []
        for guard, direction in guards:

            def event(t, y, guard=guard):
                return guard(t, y)

            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
            events.append(event)
        found = solve_ivp(slope, (theta, PERIOD), y, "DOP853", rtol=1e-11, atol=1e-12, events=events, max_step=0.1)
        theta, y = found.t[-1], found.y[:, -1].copy()
        if found.status != 1:
            return y
        which = next(number for number, times in enumerate(found.t_events) if len(times))
        if which:
            slip = 0 if slip else (1 if y[2] > 0.0 else -1)
            continue
        closed = not closed
        y[2] = np.clip(y[2], -(limit + hysteresis * closed) / STIFFNESS, (limit + hysteresis * closed) / STIFFNESS)
        full = limit > 0.0 and abs(y[2]) * STIFFNESS > limit * (1.0 - 1e-9) and y[2] * y[1] > 0.0
        slip = int(math.copysign(1.0, y[2])) if not closed and full else 0
    raise AssertionError


@keeps("0.0")
@pytest.mark.parametrize("limit", [0.0, 0.1])
def test_an_element_of_a_stage_agrees_with_scipy_with_an_error_of_second_order(limit):
    system = with_hysteresis(limit)
    states = draw(system, 24)
    states[:, 2] = np.where(states[:, 0] > 0.2, states[:, 2], 0.3 * limit * states[:, 2])
    ends = np.array([by_events(state, limit) for state in states])
    coarse, fine = (rms(advanced(system, states, steps) - ends) for steps in (100, 1600))
    assert fine < 1e-5
    assert coarse / fine > 100.0  # 256 for the second power of the step


def test_an_element_pressed_by_a_stop_agrees_with_many_small_steps():
    stop = Contact("stop", {"x": 1.0}, (Stage(0.2, 4.0),))
    system = oscillator(
        friction("slider", {"x": 1.0}, coefficient=0.4, normal="stop", stiffness=STIFFNESS), stop,
        loads=[Harmonic(0.1, varies="stop.deflection", order=2)],
    )  # fmt: skip
    states = draw(system, 24)
    states[:, 2] = 0.0
    x, v, z = states.T.copy()
    count = 60_000
    h = PERIOD / FREQUENCY / count
    for theta in (np.arange(count) + 0.5) * (PERIOD / count):
        middle = x + 0.5 * h * v
        moved = middle + 0.1 * math.cos(2.0 * theta)
        push = 4.0 * np.maximum(np.abs(moved) - 0.2, 0.0)
        most = 0.4 * push / STIFFNESS
        z = np.clip(z + h * v, -most, most)
        v = v + h * (0.6 * math.cos(theta) - 0.1 * v - middle - np.sign(moved) * push - STIFFNESS * z)
        x = middle + 0.5 * h * v
    assert advanced(system, states, 800) == pytest.approx(np.stack((x, v, z), axis=1), abs=3e-4)


def test_extensions_beyond_the_limit_begin_at_it():
    system = oscillator(slider())
    beyond, at = (np.array([[0.3, 0.5, z], [0.3, -0.5, -z]]) for z in (7.0, LIMIT / STIFFNESS))
    assert advanced(system, beyond, 100).tolist() == advanced(system, at, 100).tolist()


def test_a_run_keeps_the_error_that_was_asked_for_and_surveys_the_force():
    system = oscillator(slider())
    states = draw(system, 30)
    run = batch_flow_of(system, BatchOptions(error=1e-5, threads=1)).run(states, 2, every=1, survey=1)
    assert run.error <= 1e-5
    assert run.states.shape == (30, 3)
    assert run.strobes is not None
    assert run.survey is not None
    assert np.abs(run.strobes[0] - exact(system, states)).max() < 1e-3
    assert run.survey.peak_force == pytest.approx(LIMIT, rel=1e-9)  # all slip


def test_friction_that_it_cannot_carry_is_refused_by_name():
    rigid = oscillator(friction("brake", {"x": 1.0}, 0.3))
    with pytest.raises(ModelError, match=r"cannot include 'brake': it sticks rigidly.*give it a stiffness"):
        batch_flow_of(rigid).run(np.zeros((2, 2)), 1)
    with pytest.raises(ModelError, match=r"with 3 of them \(x, x', extension of slider\)"):
        batch_flow_of(oscillator(slider())).run(np.zeros((2, 2)), 1)
