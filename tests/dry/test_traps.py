"""Traps of dry friction: multipliers that are exactly 0 or 1, continua of orbits, and sections within stick or slip."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.lyapunov import lyapunov
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError
from gapwalk.flow.motion import signal_of
from gapwalk.model.contact import Contact, friction
from gapwalk.model.laws.friction import Hysteretic
from gapwalk.orbit.orbit import sensitivity, signal_along
from tests.dry.event_reference import Reference
from tests.results.again import again
from tests.tiers import in_campaign, keeps

TURN = 2.0 * math.pi
DAMPING, SPRING = 0.05, 5.0


def oscillator(*contacts: Contact, frequency: float = 0.8, phase: float = 0.0, mean: float = 0.0) -> gw.System:
    """A unit oscillator under a unit load, with contacts."""
    load = gw.Harmonic(1.0, {"x": 1.0}, phase=phase)
    return gw.System(
        ["x"], [[1.0]], [[DAMPING]], contacts=contacts, mean={"x": mean}, harmonics=[load], frequency=frequency
    )


def jenkins(limit: float, **more: float) -> gw.System:
    return oscillator(friction("brake", {"x": 1.0}, limit, stiffness=SPRING), **more)


def coulomb(limit: float, **more: float) -> gw.System:
    return oscillator(friction("brake", {"x": 1.0}, limit), **more)


def chain(limit: float, stiffness: float | None, frequency: float = 0.9) -> gw.System:
    """Two masses with friction between them and a gap."""
    gap = gw.backlash("gap", {"x": 1.0}, clearance=0.5, stiffness=5.0)
    brake = friction("brake", {"x": 1.0, "y": -1.0}, limit, stiffness=stiffness)
    return gw.System(
        ["x", "y"],
        [[2.0, -1.0], [-1.0, 1.5]],
        [[0.08, 0.0], [0.0, 0.06]],
        contacts=[gap, brake],
        mean={"x": 0.1},
        harmonics=[gw.Harmonic(0.3, {"x": 1.0})],
        frequency=frequency,
    )


def differences(system: gw.System, state: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """The monodromy matrix by central differences of an independent integrator, for extensions within their limits."""
    reference = Reference(system)

    def around(y):
        return reference.integrate(y, 0.0, TURN).state

    return np.column_stack([(around(state + d) - around(state - d)) / (2.0 * step) for d in step * np.eye(len(state))])


def sums(multipliers: np.ndarray) -> list[complex]:
    """Sums of their powers, which do not depend on their order."""
    return [complex(np.sum(multipliers**k)) for k in (1, 2, 3)]


@keeps("system1")
@pytest.mark.parametrize(
    "system", [jenkins(0.3), coulomb(0.8, frequency=0.3), *map(in_campaign, [chain(0.1, 2.0), chain(0.1, None)])]
)
def test_where_friction_slips_a_multiplier_is_exactly_0_if_it_forgets_and_the_others_are_those_of_another_code(system):
    orbit = gw.find_orbit(system)
    assert not orbit.stuck
    assert np.all(np.abs(Reference(system).integrate(orbit.state, 0.0, TURN).state - orbit.state) < 1e-9)
    sticks = system.structure.memories or any(event.slip == 0 for event in orbit.slips)
    assert (0.0 in orbit.multipliers.tolist()) is bool(sticks)
    expected = np.linalg.eigvals(differences(system, orbit.state))
    assert sums(orbit.multipliers) == pytest.approx(sums(expected), abs=3e-6)
    shot = gw.find_orbit(system, start=orbit.state, method=gw.Shooting(3))
    assert sums(shot.multipliers) == pytest.approx(sums(orbit.multipliers), abs=1e-9)


@pytest.mark.parametrize("segments", [1, 3])
def test_an_element_that_never_slips_is_a_spring_and_its_multiplier_is_exactly_1(segments: int):
    system = jenkins(30.0)
    orbit = gw.find_orbit(system, method=gw.Shooting(segments))
    assert orbit.stuck == (0,)
    assert orbit.multipliers[0] == 1.0
    roots = np.roots([1.0, DAMPING, 1.0 + SPRING])
    assert sorted(orbit.multipliers[1:], key=lambda mu: mu.imag) == pytest.approx(
        sorted(np.exp(roots * TURN / 0.8), key=lambda mu: mu.imag), abs=1e-12
    )
    assert orbit.free_multipliers[-1] == 0.0
    assert orbit.stable
    assert "brake never slips: its extension is kept" in str(orbit.summary())
    # the state of rest has no extension, and the slider has stayed where it was
    assert orbit.state[2] == pytest.approx(orbit.state[0], abs=1e-9)


def test_friction_that_sticks_throughout_has_the_multipliers_1_and_0():
    orbit = gw.find_orbit(coulomb(2.0), start=[0.3, 0.0])
    assert orbit.stuck == (0,)
    assert orbit.multipliers.tolist() == [1.0, 0.0]
    assert orbit.stable
    assert orbit.state.tolist() == pytest.approx([0.3, 0.0], abs=1e-8)
    assert "its position is kept" in repr(orbit)


def test_an_orbit_is_kept_where_its_friction_was_left():
    """A start with another position of the slider leads to another orbit of the continuum."""
    orbit = gw.find_orbit(jenkins(30.0), start=[0.2, 0.0, 0.5])
    assert orbit.state[0] - orbit.state[2] == pytest.approx(-0.3, abs=1e-8)
    mean = (orbit.extremes[0, 0] + orbit.extremes[0, 1]) / 2.0
    assert mean == pytest.approx(-0.3 * SPRING / (1.0 + SPRING), abs=1e-8)  # the statics of two springs


def onsets(limit: float) -> list[float]:
    """The frequencies at which the amplitude of the linear system just reaches the limit."""
    stiffness, most = 1.0 + SPRING, SPRING / limit
    # (K - W^2)^2 + c^2 W^2 = most^2
    return sorted(math.sqrt(w) for w in np.roots([1.0, DAMPING**2 - 2.0 * stiffness, stiffness**2 - most**2]) if w > 0)


@keeps("ends0")
@pytest.mark.parametrize("ends", [(0.5, 4.0), (4.0, 0.5)])
def test_a_walk_through_onset_and_end_of_slip_has_no_false_points(ends: tuple[float, float]):
    first, second = onsets(1.5)
    start = gw.find_orbit(jenkins(1.5, frequency=ends[0]))
    branch = gw.follow(start, "frequency", ends[1], walk=gw.WalkOptions(largest_step=0.04))
    assert branch.ends[1].reason.name == "RANGE"
    # the onset of slip is no fold and no branch point
    assert {str(each.kind) for each in branch.special_points} == {"slip-onset"}
    found = sorted({round(each.value, 8) for each in branch.special_points})
    assert found == pytest.approx([first, second], abs=1e-8)
    assert branch.unexplained == ()
    values = np.array([point.value for point in branch.points])
    stuck = np.array([bool(point.orbit.stuck) for point in branch.points])
    inside = (values > first) & (values < second)
    assert np.array_equal(stuck, ~inside)
    assert 0 < inside.sum() < len(values)
    for point in branch.points[::5]:
        amplitude = 1.0 / math.hypot(1.0 + SPRING - point.value**2, DAMPING * point.value)
        if point.orbit.stuck:
            assert point.orbit.extremes[0, :2] == pytest.approx([amplitude, -amplitude], abs=1e-8)  # centred
        else:
            end = Reference(point.orbit.system).integrate(point.orbit.state, 0.0, TURN).state
            assert end == pytest.approx(point.orbit.state, abs=1e-8)


@pytest.mark.parametrize(
    ("system", "to", "slips"),
    [
        (jenkins(0.3, frequency=0.5), 1.5, True),
        (jenkins(300.0, frequency=0.5), 4.0, False),
        (coulomb(0.3, frequency=0.5), 2.0, True),
        (coulomb(2.0, frequency=0.5), 4.0, False),
    ],
)
def test_a_walk_along_friction_that_always_or_never_slips_has_no_false_points(
    system: gw.System, to: float, slips: bool
):
    branch = gw.follow(gw.find_orbit(system), "frequency", to)
    assert branch.ends[1].reason.name == "RANGE"
    assert branch.special_points == ()
    assert branch.unexplained == ()
    assert {not point.orbit.stuck for point in branch.points} == {slips}
    assert all(point.orbit.stable for point in branch.points)


def test_without_symmetry_the_branch_is_that_of_a_spring_from_the_place_of_the_slider():
    """Its folds and grazing points are those of a system with a spring in place of the element."""
    spring, mean, limit = 4.0, 0.4, 100.0
    gap = gw.backlash("gap", {"x": 1.0}, clearance=0.6, stiffness=2.0)

    def made(stiffness: float, mean: float, *contacts: Contact) -> gw.System:
        load = gw.Harmonic(1.0, {"x": 1.0})
        return gw.System(
            ["x"], [[stiffness]], [[0.15]], contacts=[gap, *contacts], mean={"x": mean}, harmonics=[load], frequency=2.3
        )

    system = made(1.0, mean, friction("brake", {"x": 1.0}, limit, stiffness=spring))
    orbit = gw.find_orbit(system, start=[0.0, 0.0, -0.05])
    branch = gw.follow(orbit, "frequency", 3.0)
    slider = orbit.state[0] - orbit.state[2]
    assert slider == pytest.approx(0.05, abs=1e-8)
    expected = gw.follow(gw.find_orbit(made(1.0 + spring, mean + spring * slider)), "frequency", 3.0)
    assert branch.unexplained == ()
    assert len([each for each in branch.special_points if each.kind == "fold"]) == 2
    assert [each.kind for each in branch.special_points] == [each.kind for each in expected.special_points]
    assert [each.value for each in branch.special_points] == pytest.approx(
        [each.value for each in expected.special_points], abs=1e-8
    )
    kept = np.array([point.orbit.state[0] - point.orbit.state[2] for point in branch.points])
    assert kept == pytest.approx(slider, abs=1e-8)


def test_the_slope_of_an_orbit_that_never_slips_is_that_of_the_linear_system():
    system = jenkins(30.0)
    orbit = gw.find_orbit(system)
    step = 1e-3
    ends = [gw.find_orbit(system.at(frequency=0.8 + way * step), start=orbit.state).state for way in (-1.0, 1.0)]
    found = sensitivity(orbit, ["frequency"]).state[:, 0]
    assert found == pytest.approx((ends[1] - ends[0]) / (2.0 * step), abs=2e-6)
    assert found[0] == pytest.approx(found[2], abs=1e-9)


@pytest.mark.parametrize("limit", [0.3, 0.8])
def test_the_section_may_fall_into_stick_and_into_slip(limit: float):
    """The phase of the load moves theta = 0 through the whole motion."""
    seen = set()
    for make in (jenkins, coulomb):
        amplitudes = []
        for phase in np.linspace(0.1, TURN, 12, endpoint=False):
            orbit = gw.find_orbit(make(limit, frequency=0.3, phase=float(phase)))
            amplitudes.append(orbit.extremes[0, 0])
            seen.add((make.__name__, orbit.slips[0].slip))
        assert amplitudes == pytest.approx([amplitudes[0]] * 12, abs=1e-10)
    assert len(seen) >= 5  # at a limit of 0.3, Coulomb's friction may slip throughout


def test_exponents_of_a_motion_that_forgets_are_minus_infinity():
    system = jenkins(0.3)
    orbit = gw.find_orbit(system)
    found = lyapunov(system, orbit.state)
    expected = np.log(np.abs(orbit.multipliers[:2])) * system.frequency / TURN
    assert found.exponents[:2] == pytest.approx(expected, abs=1e-6)
    assert found.exponents[2] == -math.inf
    assert found.dimension == 0.0


def test_a_motion_settles_on_an_orbit_that_never_slips():
    found = gw.classify(jenkins(30.0), start=[0.5, 0.1])
    assert found.label == "P1"
    assert found.orbit is not None
    assert found.orbit.stuck == (0,)
    assert any("never slips" in text for text in found.evidence)
    assert found.lyapunov is not None
    assert found.lyapunov.dimension == 0.0


def test_friction_of_a_stage_that_stays_open_keeps_nothing():
    """It neither slips nor sticks, and its extension is 0."""
    stage = gw.Stage(50.0, 2.0, numbers={"hysteresis": 0.1})
    damper = Contact("clutch", {"x": 1.0}, [stage], law=Hysteretic("elastic"))
    system = oscillator(damper, friction("rub", {"x": 1.0}, stages_of="clutch", stiffness=SPRING))
    orbit = gw.find_orbit(system)
    assert orbit.stuck == ()
    assert orbit.state[2] == 0.0
    assert orbit.multipliers[-1] == 0.0


def test_slips_are_kept_in_files():
    for system in (jenkins(0.3), jenkins(30.0)):
        orbit = gw.find_orbit(system)
        read = again(orbit)
        assert read.slips == orbit.slips
        assert read.stuck == orbit.stuck
        assert np.array_equal(read.state, orbit.state)


def test_a_state_names_its_extensions():
    system = chain(0.1, 2.0)
    assert system.state_names == ("x", "y", "x'", "y'", "brake.extension")
    assert system.state_scales(2.0, 3.0).tolist() == [2.0, 2.0, 6.0, 6.0, 2.0]
    with pytest.raises(ModelError, match=r"brake.extension\), not .*; the first 4 are enough"):
        gw.find_orbit(system, start=[0.0, 0.0, 0.0])
    assert gw.find_orbit(system, start=[0.0] * 4).state.shape == (5,)
    motion = gw.find_orbit(system).motion()
    assert motion.signal("brake.extension") == pytest.approx(motion.z[:, 0])
    assert np.abs(motion.z).max() == pytest.approx(0.1 / 2.0, abs=1e-12)


@pytest.mark.parametrize("system", [jenkins(0.3), coulomb(0.8, frequency=0.3), chain(0.1, 2.0), chain(0.2, None)])
def test_accelerations_and_forces_are_those_of_the_modes(system: gw.System):
    """Where nothing jumps, they are the derivatives of the motion, and they balance."""
    motion = gw.find_orbit(system).motion(4096)
    assert {event.slip for event in motion.slips} == {1, -1, 0}
    slopes = np.gradient(np.hstack((motion.q, motion.v)), motion.time, axis=0, edge_order=2)
    smooth = np.abs(np.hstack((motion.v, motion.a)) - slopes).max(axis=1) < 1e-4
    assert smooth.mean() > 0.99
    n, contacts = system.size, system.structure.contacts
    load = np.array([np.cos(motion.theta) * amplitude for amplitude in ([1.0] if n == 1 else [0.3, 0.0])]).T
    inner = motion.a + motion.q @ system.matrix("stiffness").T + motion.v @ system.matrix("damping").T
    pushes = np.array([system.vector(contact.vectors[0]) for contact in contacts])
    assert inner + motion.forces @ pushes == pytest.approx(load + system.vector("mean"), abs=1e-12)


def test_the_slope_of_a_signal_of_friction_is_that_of_neighbouring_orbits():
    system, angles, step = jenkins(0.3), np.linspace(0.2, 6.0, 7), 1e-5
    orbit = gw.find_orbit(system)
    for name in ("x", "x''", "brake.force", "brake.extension"):
        signal = signal_of(system, name)
        found = sensitivity(orbit, ["frequency", "brake.limit"]).signal(signal, angles)
        for column, (parameter, value) in enumerate((("frequency", 0.8), ("brake.limit", 0.3))):
            ends = [
                signal_along(
                    gw.find_orbit(system.at({parameter: value + way * step}), start=orbit.state), signal, angles
                )
                for way in (-1.0, 1.0)
            ]
            expected = (ends[1] - ends[0]) / (2.0 * step)
            assert found.by_parameters[:, column] == pytest.approx(expected, abs=1e-5)


def test_the_centre_of_a_deflection_that_other_friction_stops_is_found() -> None:
    """A spring that never slips is centred by the extremes of its deflection, where the rate has corners."""
    brakes = [friction("f", {"x": 1.0}, 0.5), friction("j", {"x": 1.0}, 3.0, stiffness=0.5)]
    load = [gw.Harmonic(1.0, {"x": 1.0})]
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=brakes, harmonics=load, frequency=0.70)
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.74, walk=gw.WalkOptions(largest_step=0.1))
    assert branch.ends[-1].reason is EndReason.RANGE
    for point in branch.points:
        x, _, extension = point.orbit.state
        assert extension == pytest.approx(x - point.orbit.extremes[0, :2].mean(), abs=1e-12)
