"""Rigid stops in the batch integrator."""

import math
from contextlib import suppress

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.laws import Law, Rigid
from tests.ensemble.test_jenkins_elements import advanced, exact
from tests.tiers import some_of


def rigid(restitution, clearance=0.3, side=Side.POSITIVE, deflection=None, name="stop", force=None):
    stages = (Stage(clearance, 0.0, side=side),)
    return Contact(name, deflection or {"x": 1.0}, stages, force, Rigid(), restitution=restitution)


def oscillator(*contacts, loads=(), mean=0.0):
    loads = [Harmonic(0.6, {"x": 1.0}), *loads]
    return System(("x",), [[1.0]], [[0.1]], contacts=contacts, mean={"x": mean}, harmonics=loads, frequency=0.8)


def draw(system, count=24, seed=0):
    """States within the clearance of all stops."""
    random, structure = np.random.default_rng(seed), system.structure
    states = random.normal(size=(10 * count, 2 * system.size)) * 0.3
    for contact in structure.contacts:
        x = states[:, : system.size] @ system.vector(contact.vectors[0])
        states = states[np.abs(x) < 0.95 * system[f"{contact.name}.clearance"]]
    assert len(states) >= count
    return states[:count]


def bounced(height, load, restitution, time):
    """Position and velocity of a mass under a constant load towards a stop at 1: each bounce is as many times lower."""
    time -= math.sqrt(2.0 * (1.0 - height) / load)
    if time < 0.0:
        time += math.sqrt(2.0 * (1.0 - height) / load)
        return height + 0.5 * load * time**2, load * time
    speed = math.sqrt(2.0 * load * (1.0 - height))
    while restitution:
        speed *= restitution
        if time < 2.0 * speed / load:
            return 1.0 - speed * time + 0.5 * load * time**2, load * time - speed
        time -= 2.0 * speed / load
        if speed < 1e-15:
            break
    return 1.0, 0.0


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.7, 0.9, 1.0])
def test_bounces_follow_the_geometric_series_until_they_are_shorter_than_a_step(restitution):
    load, steps = 3.0, 200
    system = System(("x",), [[0.0]], contacts=[rigid(restitution, 1.0)], mean={"x": load}, frequency=1.0)
    heights = np.linspace(-1.0, 0.9, 20)
    states = np.stack((heights, 0.0 * heights), axis=1)
    for periods in (1, 3):
        ends = [bounced(height, load, restitution, periods * PERIOD) for height in heights]
        errors = np.abs(advanced(system, states, steps, periods) - ends).max(axis=1)
        step = PERIOD / steps
        if restitution < 1.0:
            assert errors.max() <= load * step  # a bounce shorter than a step is left out: its speed is lower than this
        assert np.median(errors) < 1e-11


SYSTEMS = {
    "one": oscillator(rigid(0.8)),
    "both sides": oscillator(rigid(0.6, side=Side.BOTH)),
    "held": oscillator(rigid(0.5), mean=0.4),
    "moves": oscillator(rigid(0.7), loads=[Harmonic(0.1, varies="stop.deflection", order=3, phase=0.4)]),
    "force": System(
        ("x", "y"), [[2.0, -0.5], [-0.5, 1.0]], 0.2 * np.eye(2), mass=[[1.5, 0.2], [0.2, 0.8]],
        contacts=[rigid(0.6, 0.2, deflection={"x": 1.0, "y": 0.2}, force={"x": 1.0, "y": -0.1})],
        harmonics=[Harmonic(0.8, {"x": 1.0, "y": 0.3})], frequency=0.7,
    ),
    "modal": System(
        ("a", "b", "c", "d"), 2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1), 0.2 * np.eye(4),
        mass=np.diag([1.0, 0.7, 1.2, 0.5]), contacts=[rigid(0.6, 0.3, Side.BOTH, {"b": 1.0, "c": -0.5})],
        harmonics=[Harmonic(0.8, {"a": 1.0, "c": 0.3})], frequency=0.7,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", some_of([*SYSTEMS], "both sides", "held", "modal"))
def test_the_error_falls_with_the_third_power_of_the_step(name):
    system = SYSTEMS[name]
    states = draw(system)
    ends = exact(system, states)
    for own in ({}, {"frequency": system.frequency + 1e-13 * np.arange(len(states))}):
        errors = [np.abs(advanced(system, states, steps, **own) - ends).max(axis=1) for steps in (100, 800)]
        coarse, fine = (float(np.median(each)) for each in errors)
        assert errors[1].max() < 1e-4
        assert fine < 1e-7
        assert coarse / max(fine, 1e-14) > 100.0 or coarse < 1e-9


def pair(seed):
    """Two or three coordinates between two stops, of which one often strikes while the other is near."""
    random = np.random.default_rng(seed)
    names = ("x", "y", "z")[: int(random.integers(2, 4))]
    n = len(names)

    def definite(low, high):
        basis = np.linalg.qr(random.normal(size=(n, n)))[0]
        return basis @ np.diag(random.uniform(low, high, n)) @ basis.T

    def vector():
        return dict(zip(names, random.normal(size=n).tolist(), strict=True))

    stops = [
        rigid(float(random.choice([0.0, 0.4, 0.8])), random.uniform(0.2, 0.6), side, vector(), name)
        for name, side in (("one", Side.BOTH), ("other", Side.POSITIVE))
    ]
    return System(
        names, definite(0.5, 2.0), definite(0.1, 0.3), mass=definite(0.5, 2.0), contacts=stops,
        mean=dict(zip(names, (random.normal(size=n) * 0.2).tolist(), strict=True)),
        harmonics=[Harmonic(random.uniform(0.3, 1.0), vector()), Harmonic(0.2, vector(), 2)],
        frequency=random.uniform(0.5, 1.5),
    )  # fmt: skip


@pytest.mark.parametrize("seed", some_of(range(12), 0, 2))
def test_random_systems_with_two_stops_agree_with_the_exact_flow(seed):
    system = pair(seed)
    states, ends, known = draw(system, 16, seed), [], []
    for lane, state in enumerate(states):
        with suppress(FlowError):  # two stops that rattle together may be more than the exact flow can follow
            ends.append(exact(system, state[None])[0])
            known.append(lane)
    assert len(known) > 12
    errors = np.abs(advanced(system, states[known], 1600) - ends).max(axis=1)
    assert np.median(errors) < 1e-6
    assert np.quantile(errors, 0.8) < 1e-4  # stops that rattle together within steps have errors of first order


def test_an_impact_that_another_one_prevents_does_not_occur():
    """The mass y strikes its stop a moment before x would reach its own, and takes x along."""
    system = System(
        ("x", "y"), np.zeros((2, 2)), mass=[[1.0, -0.5], [-0.5, 1.0]], frequency=1.0,
        contacts=[rigid(0.5, 1.0, name="one"), rigid(0.5, 1.0, deflection={"y": 1.0}, name="other")],
    )  # fmt: skip
    # y reaches 1 first, within the same step; both move freely before
    step = PERIOD / 100
    states = np.array([[1.0 - 10.6 * 0.11 * step, 1.0 - 10.3 * step, 0.11, 1.0]] * 2)
    ends = exact(system, states)
    motion = gw.integrate(system, states[0], 1, 100)
    assert [event.switch for event in motion.events] == [1]
    assert advanced(system, states, 100) == pytest.approx(ends, abs=1e-9)


def test_a_law_with_a_reset_of_its_own_is_carried():
    class Bouncing(Law):
        """A rigid stop of one restitution."""

        name, words = "bouncing", "a rigid stop"
        stage_parameters = Rigid.stage_parameters

        def force(self, rate, stages, numbers):
            return 0.0 * rate

        def rebound(self, rate, numbers):
            return -0.8 * rate

    own = Contact("stop", {"x": 1.0}, (Stage(0.3, 0.0, side=Side.POSITIVE),), None, Bouncing())
    states = draw(SYSTEMS["one"])
    ends = advanced(SYSTEMS["one"], states, 200)
    assert advanced(oscillator(own), states, 200) == pytest.approx(ends, abs=1e-12)


def test_a_survey_counts_impacts_and_stays_within_the_clearance():
    system = SYSTEMS["both sides"]
    states = draw(system, 12)
    run = batch_flow_of(system, BatchOptions(error=1e-6, threads=1)).run(states, 3, survey=3)
    assert run.error <= 1e-6
    found = run.survey
    assert found is not None
    for lane, state in enumerate(states):
        motion = gw.integrate(system, state, 3, 2000)
        assert found.impacts[lane].sum() * 3 == pytest.approx(sum(event.enters for event in motion.events))
        assert found.high[lane, 0] == pytest.approx(motion.q.max(), abs=1e-3)
    assert not found.peak_force.any()


def test_two_stops_that_are_held_together_leave_the_rest_in_balance():
    """A mass is pushed against a wall, and another one against it: both rest."""
    contacts = [rigid(0.3, 1.0, name="wall"), rigid(0.3, 0.5, deflection={"y": 1.0, "x": -1.0}, name="between")]
    system = System(
        ("x", "y"), 0.1 * np.eye(2), 0.3 * np.eye(2), mass=[[1.0, 0.0], [0.0, 0.5]], contacts=contacts,
        mean={"x": 0.5, "y": 1.0}, harmonics=[Harmonic(0.1, {"y": 1.0})], frequency=1.0,
    )  # fmt: skip
    states = draw(system, 10) * 0.3
    for steps in (200, 800):  # their reactions are found one after the other, which leaves an error of first order
        assert advanced(system, states, steps, 12) == pytest.approx(
            np.array([[1.0, 1.5, 0.0, 0.0]] * 10), abs=0.2 * PERIOD / steps
        )


def test_impacts_that_it_cannot_carry_are_refused_by_name():
    system = SYSTEMS["one"]
    with pytest.raises(ModelError, match=r"state 1 is 0.4 beyond the rigid stop 'stop', and 1 of 2 states"):
        batch_flow_of(system).run([[0.0, 1.0], [0.7, 0.0]], 1)
    varies = oscillator(rigid(0.8), loads=[Harmonic(0.1, varies="stop.restitution", name="wave")])
    with pytest.raises(ModelError, match=r"'stop': its restitution varies.*varies = \"stop.deflection\""):
        batch_flow_of(varies).run([[0.0, 1.0]], 1)
