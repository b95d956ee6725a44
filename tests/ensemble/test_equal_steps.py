"""Motions by equal steps without events: against the exact flow for each law, and their notes against a fine motion."""

import gc
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.ensemble.lane_code import OF_CONTACT, OF_COORDINATE, OF_SIGNAL, WIDTH, code_of
from gapwalk.ensemble.lanes import Lanes, prefers_lanes, steps_of
from gapwalk.errors import UnfitError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.contact import force, friction
from gapwalk.model.laws import Hysteretic, Jenkins
from gapwalk.model.loads import Rectangle
from tests.systems import clutch, viscous_stop

FREQUENCY = 0.8


def oscillator(*contacts: Contact, loads: tuple = ()) -> System:
    load = Harmonic(0.6, {"x": 1.0})
    return System(("x",), [[1.0]], [[0.1]], contacts=contacts, harmonics=[load, *loads], frequency=FREQUENCY)


def stop(law: Any = "elastic", **numbers: Any) -> Contact:
    return Contact("stop", {"x": 1.0}, (Stage(0.4, 8.0, side=Side.POSITIVE),), None, law, **numbers)


def formula(text: str, **numbers: Any) -> Contact:
    return force("f", {"x": 1.0}, text, **numbers)


def slider(**numbers: Any) -> Contact:
    return friction("slider", {"x": 1.0}, **{"limit": 0.2, "stiffness": 3.0, **numbers})


def hosted(limit: float) -> System:
    stage = Stage(0.2, 4.0, side=Side.POSITIVE, numbers={"hysteresis": 0.3})
    host = Contact("stop", {"x": 1.0}, (stage,), None, Hysteretic("elastic"))
    element = Contact("slider", {"x": 1.0}, (), None, Jenkins("stages", "stop"), stiffness=3.0, limit=limit)
    return oscillator(element, host)


SMOOTH = {
    "van der Pol": oscillator(formula("-mu*(1 - x**2)*v", mu=0.5)),
    "functions": oscillator(formula("0.3*tanh(3*v) + 0.4*sin(x) + log(4 + x**2)*x/sqrt(1 + v**2) - x*exp(-x**2)")),
    "powers": oscillator(formula("(1 + x**2)**1.3*x + 2**(x/2)")),
}
KINKED = {
    "elastic": oscillator(stop()),
    "hunt-crossley": clutch(),
    "stages": oscillator(Contact("gap", {"x": 1.0}, (Stage(0.2, 2.0, name="a"), Stage(0.4, 4.0, name="b")))),
    "abs min max": oscillator(formula("c*v*abs(v) + k*max(x - 0.2, 0)**1.5 + d*min(v, 0.2)", c=0.3, k=4.0, d=0.2)),
    "displacement": oscillator(stop(), loads=(Harmonic(0.1, varies={"stop.deflection": 1.0}, order=3, phase=0.4),)),
    "clearance": oscillator(
        stop("hunt-crossley", impact_damping=0.3), loads=(Harmonic(0.1, varies={"stop.clearance": 1.0}, order=2),)
    ),
    "stiffness": oscillator(stop(), loads=(Harmonic(0.3, varies={"stop.stiffness": 1.0}, order=5, phase=0.4),)),
}
JUMPING = {
    "viscous": viscous_stop(),
    "pushing": oscillator(stop("pushing", viscous_damping=0.4)),
    "piecewise": oscillator(stop("piecewise", offset=0.1, even_quadratic=2.0)),
    "levels": oscillator(
        Contact("spring", {"x": 1.0}, (Stage(0.0, 1.0),)),
        loads=(Rectangle(0.4, {"spring.stiffness": 1.0}, order=2, share=0.4, phase=0.7),),
    ),
}
DRY = {
    "Jenkins": oscillator(slider()),
    "belt": oscillator(slider(speed=0.15)),
    "moving base": oscillator(slider(), loads=(Harmonic(0.2, varies={"slider.deflection": 1.0}, order=3, phase=0.4),)),
    "stages": hosted(0.1),
    "stages alone": hosted(0.0),
    "pressed": oscillator(slider(limit=None, coefficient=0.4, normal="stop"), stop()),
}
SYSTEMS = {
    **{f"smooth: {name}": (each, 30.0) for name, each in SMOOTH.items()},
    **{f"kinked: {name}": (each, 10.0) for name, each in KINKED.items()},
    **{f"jumping: {name}": (each, 3.0) for name, each in JUMPING.items()},
    **{f"dry: {name}": (each, 3.0) for name, each in DRY.items()},
}
"""Systems, each with the least ratio of the errors of a step and of an eighth of it."""


def draw(system: System, count: int, seed: int = 0) -> np.ndarray:
    states = np.random.default_rng(seed).normal(size=(count, system.state_size)) * 0.7
    states[:, 2 * system.size :] = 0.0
    return states


def ends_of(system: System, states: np.ndarray, **more: Any) -> np.ndarray:
    coefficients = np.tile(coefficients_of(system), (len(states), 1))
    lanes = Lanes(system.structure, coefficients, states, kinds=(), **more)
    lanes.advance()
    return lanes.states


def exact(system: System, states: np.ndarray) -> np.ndarray:
    flow, coefficients = flow_of(system), coefficients_of(system)
    return np.array([flow.integrate(coefficients, state, 0.0, PERIOD).state for state in states])


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(difference**2)))


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_error_of_a_period_falls_as_the_step_does(name: str) -> None:
    system, least = SYSTEMS[name]
    states = draw(system, 2 * WIDTH + 3)
    known = exact(system, states)
    coarse, fine = (rms(ends_of(system, states, finer=finer) - known) for finer in (1.0, 8.0))
    assert coarse < 0.02
    assert fine < 2e-3
    assert coarse / fine > least


def test_friction_that_sticks_rigidly_has_a_small_error() -> None:
    system = oscillator(friction("brake", {"x": 1.0}, 0.3))
    states = draw(system, 20)
    known = exact(system, states)
    errors = [rms(ends_of(system, states, finer=finer) - known) for finer in (1.0, 8.0, 64.0)]
    assert errors[0] < 0.1  # 40 steps: its spring is hardly stiffer than that of the oscillator
    assert errors[1] < 0.01
    assert errors[2] < 0.3 * errors[1]


@pytest.mark.parametrize("count", [1, 5, 3 * WIDTH + 1])
def test_each_lane_has_its_own_numbers_in_one_register_and_in_several(count: int) -> None:
    system, random = clutch(), np.random.default_rng(3)
    systems = [
        system.at({"frequency": random.uniform(0.3, 0.9), "stage2.clearance": random.uniform(0.2, 1.0)})
        for _ in range(count)
    ]
    states = draw(system, count, 5)
    lanes = Lanes(system.structure, np.array([coefficients_of(each) for each in systems]), states, finer=6.0)
    lanes.advance()
    known = np.concatenate([exact(each, state[None]) for each, state in zip(systems, states, strict=True)])
    assert lanes.states == pytest.approx(known, abs=2e-3)
    alone = ends_of(systems[0], states[:1], finer=6.0 * lanes.steps[0] / Lanes(
        system.structure, coefficients_of(systems[0])[None], states[:1], finer=6.0).steps[0])  # fmt: skip
    assert alone[0] == pytest.approx(lanes.states[0], abs=2e-3)


def test_a_lane_that_gets_another_system_goes_on_with_it() -> None:
    one, other = clutch(), clutch(frequency=0.7)
    states = draw(one, 3)
    lanes = Lanes(one.structure, np.tile(coefficients_of(one), (3, 1)), states, finer=4.0)
    lanes.advance()
    lanes.put(np.array([1]), coefficients_of(other)[None], states[:1])
    before = lanes.states
    lanes.advance()
    assert lanes.states[1] == pytest.approx(exact(other, states[:1])[0], abs=2e-3)
    assert lanes.states[2] == pytest.approx(exact(one, before[2:])[0], abs=2e-3)


def test_the_work_of_friction_is_the_area_of_its_loop() -> None:
    heavy, limit, stiffness, most = 1e6, 0.3, 2.0, 2.0
    element = friction("slider", {"x": 1.0}, limit, stiffness=stiffness)
    system = System(("x",), [[heavy]], mass=[[heavy]], contacts=[element], frequency=1.0)
    state = np.array([[most, 0.0, limit / stiffness]])
    (x, v, z), without = (
        ends_of(system, state, finer=4.0)[0],
        ends_of(system.at({"slider.limit": 0.0}), state, finer=4.0),
    )
    lost = 0.5 * heavy * (without[0, 0] ** 2 + without[0, 1] ** 2 - x**2 - v**2)
    assert lost == pytest.approx(4.0 * limit * (most - limit / stiffness), rel=5e-3)
    assert z == pytest.approx(limit / stiffness, rel=1e-3)


def test_notes_are_those_of_the_exact_motion() -> None:
    system = clutch()
    state = draw(system, 1, 8)
    signals = np.zeros((1, system.size + 1 + 2 * len(layout_of(system.structure).orders)))
    signals[0, 0] = 1.0  # the first acceleration
    kinds = (*OF_CONTACT, *OF_COORDINATE, *OF_SIGNAL)
    lanes = Lanes(
        system.structure, coefficients_of(system)[None], state, kinds=kinds, signals=signals[None], finer=16.0
    )
    lanes.advance()  # sides are not known before
    begun = lanes.states[0]
    lanes.advance()
    steps = int(lanes.steps[0])
    theta = np.arange(steps + 1) * (PERIOD / steps)
    flow, coefficients, states = flow_of(system), coefficients_of(system), [begun]
    for one, two in pairwise(theta.tolist()):
        states.append(flow.integrate(coefficients, states[-1], one, two).state)
    y, theta = np.array(states[1:]), theta[1:]
    x, v, slip = y[:, :2], y[:, 2:4], y[:, 0]
    rate = y[:, 2]
    past = np.abs(slip) - 1.0
    push = np.where(past > 0.0, np.sign(slip) * past * (1.0 + 0.05 * np.sign(slip) * rate), 0.0)
    a = 0.25 + 0.25 * np.cos(theta) - 0.04 * v[:, 0] + 0.04 * v[:, 1] - 0.1 * x[:, 0] + 0.6 * x[:, 1] - 0.9 * push
    kept = {kind: lanes.note(kind)[0] for kind in kinds}
    side = np.where(past > 0.0, np.sign(slip), 0.0)
    closings = [int(((side[1:] == s) & (side[:-1] != s)).sum()) for s in (1.0, -1.0)]
    assert [kept["up"][0], kept["down"][0]] == closings
    assert sum(closings) > 0
    assert [kept["low"][0], kept["high"][0]] == pytest.approx([slip.min(), slip.max()], abs=1e-4)
    assert kept["least"] == pytest.approx(x.min(axis=0), abs=1e-4)
    assert kept["most"] == pytest.approx(x.max(axis=0), abs=1e-4)
    assert kept["total"] / steps == pytest.approx(x.mean(axis=0), abs=1e-4)
    assert kept["drift"] / steps == pytest.approx(v.mean(axis=0), abs=1e-4)
    assert kept["peak"][0] == pytest.approx(np.abs(push).max(), rel=1e-3)
    assert kept["power"][0] / steps == pytest.approx((push * rate).mean(), abs=1e-4)
    assert kept["energy"][0] / steps == pytest.approx((a**2).mean(), rel=1e-3)
    assert kept["fourth"][0] / steps == pytest.approx((a**4).mean(), rel=1e-3)
    assert kept["summit"][0] == pytest.approx(np.abs(a).max(), rel=1e-3)
    for kind in kinds:  # each alone is the same
        alone = Lanes(
            system.structure,
            coefficients_of(system)[None],
            state,
            kinds=[kind],
            signals=signals[None],
            finer=16.0,
        )
        alone.advance(2)
        assert alone.note(kind)[0] == pytest.approx(kept[kind], rel=1e-9)
    assert kept["approach"][0] == pytest.approx(np.abs(rate[1:][side[1:] * (side[:-1] == 0.0) != 0.0]).max(), abs=1e-2)


def test_a_motion_that_runs_away_is_marked_and_leaves_the_others() -> None:
    system = oscillator(formula("-0.01*x**3"))
    states = np.array([[0.1, 0.0], [40.0, 0.0], [0.2, 0.1]])
    lanes = Lanes(system.structure, np.tile(coefficients_of(system), (3, 1)), states)
    for _ in range(3):
        lanes.advance()
    assert lanes.diverged.tolist() == [False, True, False]
    assert np.isfinite(lanes.states[[0, 2]]).all()


def test_steps_follow_the_fastest_vibration_and_the_highest_order() -> None:
    def steps(system: System) -> float:
        return float(steps_of(layout_of(system.structure), coefficients_of(system)[None])[0])

    soft, stiff = oscillator(stop()), oscillator(stop()).at({"stop.stiffness": 8e6})
    assert steps(stiff) == pytest.approx(PERIOD * np.sqrt(8e6) / FREQUENCY / 0.44, rel=1e-3)
    assert steps(soft.at({"stop.stiffness": 1.0})) == 40.0  # of the order 1
    assert steps(KINKED["stiffness"]) == 200.0  # of the order 5


def test_what_equal_steps_cannot_carry_is_refused_by_name() -> None:
    def begin(system: System) -> None:
        Lanes(system.structure, coefficients_of(system)[None], np.zeros((1, system.state_size)))

    with pytest.raises(UnfitError, match=r"cannot include 'wall': it is a rigid stop; give it a stiffness"):
        begin(oscillator(gw.rigid_stop("wall", {"x": 1.0}, 0.4, 0.8)))
    with pytest.raises(UnfitError, match=r"cannot include 'brake': its static is not 1"):
        begin(oscillator(friction("brake", {"x": 1.0}, 0.3, static=1.5)))
    assert not prefers_lanes(oscillator(stop()))  # the exact flow is fast enough


@pytest.mark.slow
def test_code_that_is_no_longer_kept_leaves_the_other_code_alive() -> None:
    system, states = clutch(), draw(clutch(), 1)
    for kinds in [(), ("low",), ("peak",), ("least",)]:
        Lanes(system.structure, coefficients_of(system)[None], states, kinds=kinds).advance()
        code_of.cache_clear()  # a shared target machine ended with the first engine, and the process with it
        gc.collect()
