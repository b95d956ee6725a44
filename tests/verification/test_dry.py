"""Verification of orbits with friction and rigid stops, by an integrator that finds their events itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import gapwalk as gw
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Jenkins
from gapwalk.model.laws.friction import Hysteretic
from gapwalk.verification import Check, verify_orbits
from gapwalk.verification.friction_dop853 import DryRound, _Motion, brackets, carry
from gapwalk.verification.friction_equations import Change, Key, mismatch
from gapwalk.verification.verify_branch import confirm
from tests.dry.trials.random_systems import random_system
from tests.tiers import keeps

PASSES = ("contact", 0)
LOAD = [gw.Harmonic(1.0, {"x": 1.0})]


def oscillator(contacts, *, damping=0.0, frequency=1.0, load=LOAD) -> gw.System:
    return gw.System(["x"], [[1.0]], [[damping]], contacts=contacts, harmonics=load, frequency=frequency)


def stop(restitution: float, clearance: float = 1.0) -> Contact:
    stages = [Stage(clearance, side=Side.POSITIVE)]
    return Contact("stop", {"x": 1.0}, stages, law="rigid", restitution=restitution)


def damper() -> list[Contact]:
    stages = [
        Stage(0.2, 1.0, name="one", numbers={"hysteresis": 0.1}),
        Stage(0.5, 2.0, name="two", numbers={"hysteresis": 0.2}),
    ]
    spring = Contact("damper", {"x": 1.0}, stages, law=Hysteretic("elastic"))
    return [spring, Contact("dry", {"x": 1.0}, (), None, Jenkins("stages", "damper"), {"stiffness": 3.0})]


SYSTEMS = {
    "slip": oscillator([friction("f", {"x": 1.0}, 0.3)], frequency=0.8),
    "stick": oscillator([friction("f", {"x": 1.0}, 0.3, static=1.2)], frequency=0.3),
    "belt": oscillator([friction("f", {"x": 1.0}, 0.3, speed=0.4)], damping=0.1, frequency=0.6),
    "jenkins": oscillator([friction("j", {"x": 1.0}, 0.3, stiffness=2.0)], damping=0.1),
    "stages": oscillator(damper(), damping=0.1, frequency=1.3),
    "impact": oscillator([stop(0.8)], damping=0.1),
    "held": oscillator([stop(0.5, 0.1)], damping=0.1, frequency=0.4),
}


def found(name: str) -> tuple[gw.Orbit, DryRound]:
    orbit = gw.find_orbit(SYSTEMS[name], start="settle")
    (around,) = carry([orbit])
    assert isinstance(around, DryRound)
    return orbit, around


@pytest.mark.parametrize("name", SYSTEMS)
def test_orbit_events_and_multipliers_are_those_of_another_integrator(name: str) -> None:
    orbit, around = found(name)
    assert around.closure < 1e-10
    assert around.astray < 1e-9
    assert any(event.theta for event in around.changes)
    np.testing.assert_allclose(around.extremes, orbit.extremes[:, :2], atol=1e-6)
    assert around.transition is not None
    powers = [(around.transition, orbit.multipliers)]
    powers.append((around.transition @ around.transition, orbit.multipliers**2))
    for matrix, multipliers in powers:
        assert np.trace(matrix) == pytest.approx(multipliers.sum().real, abs=1e-8)


def test_phases_of_stick_make_multipliers_zero() -> None:
    orbit, around = found("stick")
    assert {event.mode for event in around.changes} == {1, 0, -1}
    assert around.transition is not None
    assert abs(np.linalg.det(around.transition)) < 1e-12
    assert orbit.multipliers[-1] == 0.0


def test_another_state_does_not_close() -> None:
    orbit, _ = found("stages")
    state = orbit.state.copy()
    state[1] += 1e-6
    (around,) = carry([replace(orbit, state=state)])
    assert around.closure > 1e-8


@pytest.mark.parametrize("name", ["stick", "jenkins"])
def test_other_slip_events_are_found_out(name: str) -> None:
    orbit, _ = found(name)
    late = tuple(event._replace(theta=event.theta + 1e-4 * (event.theta > 0.0)) for event in orbit.slips)
    assert carry([replace(orbit, slips=late)])[0].astray > 1e-5
    assert carry([replace(orbit, slips=orbit.slips[:-1])])[0].astray > 1e-2
    turned = (*orbit.slips[:-1], orbit.slips[-1]._replace(slip=orbit.slips[-1].slip + 1))
    assert carry([replace(orbit, slips=turned)])[0].astray > 1e-2


def test_other_impacts_are_found_out() -> None:
    orbit, _ = found("impact")
    late = tuple(event._replace(theta=event.theta + 1e-4) for event in orbit.events)
    assert carry([replace(orbit, events=late)])[0].astray > 1e-5
    assert carry([replace(orbit, events=())])[0].astray > 1.0


def test_a_branch_with_friction_is_verified() -> None:
    orbit, _ = found("slip")
    confirm(gw.follow(orbit, "frequency", 0.81, walk=gw.WalkOptions(largest_step=0.2)))


@keeps("1e-08")
@pytest.mark.parametrize("depth", [3e-5, 1e-7, 1e-8])
def test_a_touch_that_is_much_shorter_than_a_step_is_seen(depth: float) -> None:
    brake = friction("f", {"x": 1.0}, 0.3)
    most = gw.find_orbit(oscillator([brake], damping=0.1)).extremes.max()
    wall = Contact("wall", {"x": 1.0}, [Stage(most * (1.0 - depth), 1e4)])
    orbit = gw.find_orbit(oscillator([brake, wall], damping=0.1))
    (around,) = carry([orbit])
    assert isinstance(around, DryRound)
    assert sum(change.kind == "contact" and change.mode == 1 for change in around.changes) == 2
    assert around.closure < Check.CLOSURE.bound
    assert around.astray < 1e-9


@pytest.mark.parametrize("speed", [1e-5, 1e-7])
def test_an_impact_less_deep_than_the_error_has_its_multipliers(speed: float) -> None:
    """The motion between impacts is linear: Phi (h, -r u - p) = (h, u - p), from 1 - h = x and p = x' of the forced."""
    restitution, flow = 0.8, np.array([[0.0, 1.0], [-1.0, -0.1]])
    around = expm(2.0 * np.pi * flow)
    h, minus_p = np.linalg.solve(around - np.eye(2), [0.0, speed] + restitution * speed * around[:, 1])
    forced = np.array([1.0 - h, -minus_p])  # 10 A sin(t), 10 A cos(t)
    angle = np.arctan2(*forced)
    turning = 0.1 * np.hypot(*forced) * np.cos(angle) - 1.0 - 0.1 * np.array([speed, -restitution * speed])
    state = expm(-angle * flow) @ [h, speed + minus_p] + [0.0, np.hypot(*forced)]
    reset = [[-restitution, 0.0], [(turning[1] + restitution * turning[0]) / speed, -restitution]]
    expected = expm((2.0 * np.pi - angle) * flow) @ reset @ expm(angle * flow)
    load = [gw.Harmonic(0.1 * float(np.hypot(*forced)), {"x": 1.0})]
    orbit = gw.find_orbit(oscillator([stop(restitution)], damping=0.1, load=load), start=state)
    (found,) = carry([orbit])
    assert isinstance(found, DryRound)
    np.testing.assert_allclose(found.transition, expected, rtol=3e-3)
    assert np.trace(found.transition) == pytest.approx(orbit.multipliers.sum().real, rel=1e-4)


@pytest.mark.parametrize("strikes", [True, False])
def test_an_impact_at_the_section_comes_where_the_stored_motion_has_it(strikes: bool) -> None:
    orbit, _ = found("impact")
    impact, end = max(orbit.events, key=lambda each: each.theta), 2.0 * np.pi
    shifted = orbit.system.at(**{"harmonic1.phase": impact.theta})
    rate = -0.8 * impact.velocity if strikes else impact.velocity
    others = [each._replace(theta=each.theta - impact.theta + end) for each in orbit.events if each is not impact]
    begun = impact._replace(theta=end - 1e-12 if strikes else 1e-12)
    moved = replace(orbit, system=shifted, state=np.array([1.0, rate]), events=(begun, *others))
    assert carry([moved])[0].closure < 1e-9
    assert carry([replace(moved, state=np.array([1.0, -rate]))])[0].closure > 0.1


def test_a_dip_that_the_interpolation_hides_is_found() -> None:
    def exact(shares: np.ndarray, key: Key) -> np.ndarray:
        return (shares - 0.43) ** 2 - (1e-8 if key == PASSES else -1e-8)

    def searched() -> dict[Key, tuple[float, np.ndarray]]:
        search = brackets()
        shares, key = next(search)
        try:
            while True:
                samples = {each: exact(shares, each) + 1e-5 for each in (PASSES, ("contact", 1))}
                shares, key = search.send(samples if key is None else exact(shares, key))
        except StopIteration as done:
            return done.value

    ((found, (before, after)),) = searched().items()
    assert found == PASSES
    assert 0.4298 < before <= 0.4299 < after[0] < 0.4301


@pytest.mark.slow
def test_motions_that_are_followed_together_are_those_that_are_followed_alone() -> None:
    """They fall into modes of their own, and one of them fails."""
    orbits = [gw.find_orbit(SYSTEMS["jenkins"].at(frequency=value), start="settle") for value in (1.0, 0.3, 1.7)]
    broken = replace(orbits[1], state=np.full(3, np.nan))
    together = carry([*orbits, broken])
    assert together[-1].closure == np.inf
    for one, (alone,) in zip(together, ([*carry([orbit])] for orbit in orbits), strict=False):
        assert isinstance(one, DryRound)
        assert isinstance(alone, DryRound)
        assert [each[:3] for each in one.changes] == [each[:3] for each in alone.changes]
        np.testing.assert_allclose(one.transition, alone.transition, atol=1e-12)


def test_friction_that_keeps_all_at_rest_is_verified() -> None:
    brakes = [friction("j", {"x": 1.0}, 0.3, stiffness=2.0), friction("f", {"x": 1.0}, 1.2)]
    (around,) = carry([gw.find_orbit(oscillator(brakes, damping=0.1))])
    assert around.closure < Check.CLOSURE.bound
    assert around.astray == 0.0
    assert not around.extremes.any()


def test_two_events_at_one_angle_are_compared_in_their_order() -> None:
    """As at switching-sliding: before it sticks, friction slips the other way for no time."""
    orbit, _ = found("stick")
    begun, end, *others = [event for event in orbit.slips if event.contact == 0]
    changes = [Change("slip", 0, each.slip, each.theta, 1.0) for each in (begun, end, *others)]
    assert mismatch(replace(orbit, events=()), changes) == 0.0
    back = Change("slip", 0, -begun.slip, end.theta, 1.0)
    assert mismatch(replace(orbit, events=()), [changes[0], back, *changes[1:]]) == 0.0


def test_a_phase_that_is_too_short_to_be_found_again_counts_by_its_depth() -> None:
    orbit, _ = found("stick")
    changes = [Change("slip", each.contact, each.slip, each.theta, 1.0) for each in orbit.slips]
    last = orbit.slips[-1]
    for length in (1e-5, 1e-2):
        pause = [last._replace(theta=last.theta + 0.01, slip=-1 if last.slip >= 0 else 0)]
        pause.append(last._replace(theta=pause[0].theta + length))
        more = replace(orbit, events=(), slips=(*orbit.slips, *pause))
        assert mismatch(more, changes) == pytest.approx(length**2)


def test_a_phase_that_only_the_other_motion_has_counts_by_the_guard_at_which_it_begins() -> None:
    """Where a force touches its bound: the slip rate afterwards is steep, but the force exceeds it by little."""
    orbit, _ = found("stick")
    changes = [Change("slip", each.contact, each.slip, each.theta, 1.0) for each in orbit.slips]
    last, length = changes[-1], 1e-4
    mode = -1 if last.mode >= 0 else 0
    begins = last._replace(theta=last.theta + 0.01, mode=mode, slope=-1e-5)
    ends = last._replace(theta=begins.theta + length, slope=-0.5)
    stored = replace(orbit, events=())
    assert mismatch(stored, [*changes, begins, ends]) == pytest.approx(length * 1e-5)
    # where the stored motion changes too, the steepest slope counts
    late = orbit.slips[-1]._replace(theta=ends.theta + length, slip=mode)
    back = late._replace(theta=late.theta + 1e-9, slip=last.mode)
    more = replace(stored, slips=(*orbit.slips, late, back))
    assert mismatch(more, [*changes, begins._replace(theta=late.theta - length)]) > 0.01 * length


@pytest.mark.slow
def test_a_pause_of_slip_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the contact that presses opens next to a reversal, steps would stay those of a pause."""
    system = random_system(38)
    branch = gw.follow(gw.find_orbit(system.at(frequency=0.83)), "frequency", 0.825)
    (special,) = branch.special("adding-sliding")
    taken, advance = list[float](), _Motion._advance

    def counted(self: _Motion, stop: float):
        taken.append(self.theta)
        return (yield from advance(self, stop))

    monkeypatch.setattr(_Motion, "_advance", counted)
    (around,) = carry([special.orbit])
    assert around.closure < Check.CLOSURE.bound
    assert len(taken) < 200  # 5,348 with pauses that do not end


def test_a_stop_on_which_a_step_has_ended_is_struck() -> None:
    """As at the stored angle of a slow impact, near the end of chatter: the gap is then zero to the last digit."""
    system = oscillator([stop(0.8)], damping=0.1, load=[gw.Harmonic(3.0, {"x": 1.0})])
    motion = _Motion(gw.find_orbit(system, start="settle"))
    motion.states[:, :2] = 1.0, 1e-8
    assert motion._hops() == {("contact", 0): 0.0}
    motion.states[:, :2] = 1.0, -1e-8  # it has left
    assert motion._hops()["contact", 0] == pytest.approx(1e-8, rel=1e-6)


def test_an_impact_that_only_one_motion_has_counts_by_its_depth() -> None:
    orbit, _ = found("impact")
    own = [Change("contact", each.switch, 1, each.theta, 1.0) for each in orbit.events]
    assert mismatch(orbit, own) == 0.0
    for slope, expected in ((1e-6, 1e-12), (1e-3, np.inf)):
        assert mismatch(orbit, [*own, own[0]._replace(theta=own[0].theta + 1.0, slope=slope)]) == expected


@pytest.mark.slow
def test_orbits_that_a_rough_integration_does_not_close_are_integrated_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def rough(orbits, report=None, exact=1e-6):
        return carry(orbits, report, exact)

    monkeypatch.setattr(verify_orbits, "carry", rough)
    orbit = gw.find_orbit(SYSTEMS["impact"], start="settle")
    (around,) = rough([orbit])
    assert around.closure > 1e-9
    branch = gw.follow(orbit, "frequency", 1.001, walk=gw.WalkOptions(max_points=3))
    assert gw.verify(branch).worst(Check.CLOSURE).passes
