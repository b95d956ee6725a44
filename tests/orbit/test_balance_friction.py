"""Harmonic balance with Jenkins elements: against closed forms, sampling, differences, SciPy, the flow and shooting."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import Angles, contact_force, stages_of
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.contact import friction
from gapwalk.model.laws import Friction, Stages
from gapwalk.model.laws.friction import Hysteretic, Jenkins
from gapwalk.model.laws.law import Host
from gapwalk.orbit.harmonic_balance.contact_forces import contact_forces_of, laws_of
from gapwalk.orbit.harmonic_balance.kernels import real_form
from gapwalk.orbit.harmonic_balance.linear_part import deflections_in, waves
from tests.dry.event_reference import Reference
from tests.orbit.two_masses import two_masses
from tests.tiers import in_campaign, keeps, some_of

STAGES = (
    gw.Stage(0.3, 2.0, 0.5, gw.Side.BOTH, "soft", {"hysteresis": 0.15}),
    gw.Stage(0.8, 3.0, 0.0, gw.Side.POSITIVE, "hard", {"hysteresis": 0.3}),
)
PLAIN = tuple(gw.Stage(each.clearance, each.stiffness, each.cubic, each.side, each.name) for each in STAGES)


def one_mass(*contacts, **more) -> gw.System:
    given = {"stiffness": [[1.0]], "damping": [[0.05]], "frequency": 1.2, **more}
    return gw.System(
        coordinates=("x",), mass=[[1.0]], contacts=contacts, harmonics=(gw.Harmonic(1.0, {"x": 1.0}),), **given
    )


def stop(law: gw.laws.Law | str = "elastic", stages=PLAIN, **numbers):
    return gw.Contact("stop", {"q1": 1.0, "q2": -1.0}, stages, law=law, **numbers)


def hosted(deflection, limit: float, stiffness: float = 3.0):
    return gw.Contact("fr", deflection, (), law=Jenkins("stages", "stop"), limit=limit, stiffness=stiffness)


SYSTEMS = {
    "limit": lambda: two_masses([friction("fr", {"q1": 1.0}, 0.3, stiffness=2.0)]),
    "belt": lambda: two_masses([friction("fr", {"q1": 1.0}, 0.3, stiffness=2.0, speed=0.1)]),
    "Iwan": lambda: two_masses(
        [
            friction("fr", {"q1": 1.0, "q2": -0.5}, 0.3, stiffness=2.0, force={"q1": 1.0, "q2": -0.3}),
            friction("second", {"q1": 1.0}, 0.8, stiffness=1.0),
        ]
    ),
    "stages": lambda: two_masses([stop(Hysteretic("elastic"), STAGES), hosted({"q1": 1.0}, 0.05)]),
    "damped stages": lambda: two_masses(
        [stop(Hysteretic("viscous"), STAGES, viscous_damping=0.2), hosted({"q1": 1.0, "q2": -1.0}, 1e-3)]
    ),
    "normal": lambda: two_masses(
        [stop(), friction("fr", {"q1": 0.5, "q2": 1.0}, coefficient=0.3, normal="stop", stiffness=5.0, speed=0.05)]
    ),
    "displaced": lambda: two_masses(
        [friction("fr", {"q1": 1.0}, 0.3, stiffness=2.0)],
        [gw.Harmonic(0.2, varies={"fr.deflection": 1.0}, phase=0.9, name="sway")],
    ),
}
OTHERS = ("frequency", "harmonic1.amplitude", "mass.q1.q1", "stiffness.q1.q2")
OWN = ("fr", "second", "stop", "sway")


def lines_of(system: gw.System, count: int, seed: int, size: float = 1.0):
    rng, width = np.random.default_rng(seed), deflections_in(system.structure)
    lines = rng.normal(size=(width, count + 1)) + 1j * rng.normal(size=(width, count + 1))
    lines *= size * 0.7 ** np.arange(count + 1)
    lines[:, 0] = 0.1
    return lines


def forces_along(system: gw.System, lines, period: int = 1):
    laws = laws_of(layout_of(system.structure), coefficients_of(system))
    return contact_forces_of(lines, laws, period)


@pytest.mark.parametrize("amplitude", [0.2, 0.7, 3.0])
def test_the_first_harmonic_under_a_harmonic_deflection_is_that_of_the_closed_form(amplitude):
    """A hysteresis loop dissipates ``4 F (A - F / k)``; without slip the element is a spring."""
    stiffness, limit = 2.0, 0.9
    system = one_mass(friction("fr", {"x": 1.0}, limit, stiffness=stiffness))
    lines = np.array([[0.3, amplitude * np.exp(0.7j), 0.0]])
    found = forces_along(system, lines).memory.forces[0]
    line = found.lines[1] * np.exp(-0.7j)
    share = found.share.damper * 1j * system.frequency * amplitude + found.share.spring * amplitude
    slip = limit / stiffness
    angle = np.arccos(max(1.0 - 2.0 * slip / amplitude, -1.0))
    assert line.real + share.real == pytest.approx(
        stiffness * amplitude / np.pi * (angle - 0.5 * np.sin(2.0 * angle)), rel=1e-14
    )
    dissipated = np.pi * amplitude * (line + share).imag
    assert dissipated == pytest.approx(max(0.0, 4.0 * limit * (amplitude - slip)), rel=1e-13, abs=1e-14)
    assert found.lines[0] == pytest.approx(0.0, abs=1e-15)
    assert found.never_slips is (amplitude < slip)


def sampled(system: gw.System, lines, number: int, count: int):
    """Return the force of a slider that is dragged along a fine sample, and the angles."""
    layout, numbers = layout_of(system.structure), coefficients_of(system)
    slots, host = layout.contacts[number], layout.structure.host(number)
    phi = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    turns, k = waves(phi, lines.shape[1] - 1), 1j * np.arange(lines.shape[1])
    x, v = (turns @ lines.T).real, (turns @ (k * lines * system.frequency).T).real
    angles, stages = Angles(layout, numbers, phi), Stages(())
    if host is not None:
        moves, outside = [(x[:, host], v[:, host])], layout.contacts[host]
        stages.host = Host(stages_of(outside, angles, moves), contact_force(outside, angles, moves))
    law, own = slots.form.law, angles.named(slots.numbers, slots.waves)
    assert isinstance(law, Friction)
    reach = np.broadcast_to(law.limit(stages, own) / own["stiffness"], phi.shape).tolist()
    way = own["speed"] * 2.0 * np.pi / count / system.frequency
    steps, z, found = (np.diff(x[:, number], prepend=x[-1, number]) - way).tolist(), 0.0, np.empty(count)
    for _ in range(2):
        for place in range(count):
            z = min(max(z + steps[place], -reach[place]), reach[place])
            found[place] = z
    return own["stiffness"] * found, phi


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_force_is_that_of_a_slider_dragged_along_a_fine_sample(name):
    """The sample has an error of second order in its step; of the first where the limit jumps or has a kink."""
    system = SYSTEMS[name]()
    on_average, at_most = (2e-4, 3e-2) if "stages" in name else (6e-6, 4e-4) if name == "normal" else (5e-7, 1e-5)
    for seed in (7, 9):
        lines = lines_of(system, 6, seed)
        for each in forces_along(system, lines).memory.forces:
            force, phi = sampled(system, lines, each.slider.element.contact, 1 << 14)
            off = np.abs(each.stiffness[0] * each.extension(phi) - force)
            assert off.mean() < on_average * np.abs(force).max()
            assert off.max() < at_most * np.abs(force).max()
            k = np.arange(lines.shape[1])
            spectrum = 2.0 * np.exp(-1j * np.outer(np.arange(2 * len(k) - 1), phi)) @ force / len(phi)
            spectrum[0] *= 0.5
            damper = 1j * k * system.frequency * each.share.damper
            spectrum[: len(k)] -= (each.share.spring + damper) * lines[each.slider.element.place]
            assert np.abs(spectrum - each.lines).max() < 2.0 * on_average * np.abs(force).max()


@keeps("7-belt", "7-limit", "7-displaced", "7-damped stages")
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("seed", some_of([7, 8], 7))
def test_the_derivatives_are_those_of_central_differences(name, seed):
    system, step = SYSTEMS[name](), 1e-6
    x = real_form(lines_of(system, 6, seed)).ravel()
    equation = gw.Balance(6).pose(system, "frequency")
    moved = [
        equation.evaluate(x + step * e, 1.1).residual - equation.evaluate(x - step * e, 1.1).residual
        for e in np.eye(len(x))
    ]
    assert equation.evaluate(x, 1.1).by_unknowns == pytest.approx(np.array(moved).T / (2 * step), rel=1e-8, abs=2e-8)
    for parameter in (*OTHERS, *(each for each in system.parameters if each.split(".")[0] in OWN)):
        equation, value = gw.Balance(6).pose(system, parameter), system[parameter]
        difference = equation.evaluate(x, value + step).residual - equation.evaluate(x, value - step).residual
        found = equation.evaluate(x, value).by_parameter
        assert found == pytest.approx(difference / (2 * step), rel=1e-8, abs=2e-8), parameter


@pytest.mark.parametrize("mean_is_possible", [True, False])
def test_an_element_that_never_slips_has_no_mean_force_if_the_limit_allows_it(mean_is_possible):
    system, step = one_mass(friction("fr", {"x": 1.0}, 0.9, stiffness=2.0)), 1e-6
    lines = np.array([[0.2, 0.25, 0.05] if mean_is_possible else [0.2, 0.35, 0.2]], dtype=complex)
    (force,) = forces_along(system, lines).memory.forces
    largest = np.abs(2.0 * force.extension(np.linspace(0.0, 2.0 * np.pi, 20001))).max()
    assert force.never_slips
    assert (abs(force.lines[0]) < 1e-15) == mean_is_possible
    assert largest < 0.9 if mean_is_possible else largest == pytest.approx(0.9, rel=1e-7)
    x = real_form(lines).ravel()
    equation = gw.Balance(lines.shape[1] - 1).pose(system, "fr.limit")
    moved = [
        equation.evaluate(x + step * e, 0.9).residual - equation.evaluate(x - step * e, 0.9).residual
        for e in np.eye(len(x))
    ]
    found = equation.evaluate(x, 0.9)
    assert found.by_unknowns == pytest.approx(np.array(moved).T / (2 * step), rel=1e-8, abs=2e-8)
    difference = equation.evaluate(x, 0.9 + step).residual - equation.evaluate(x, 0.9 - step).residual
    assert found.by_parameter == pytest.approx(difference / (2 * step), rel=1e-8, abs=2e-8)


def test_the_amplitude_converges_to_that_of_an_event_driven_integration():
    """With forces that have kinks, lines of the motion decrease with the fourth power of their number."""
    system = one_mass(friction("fr", {"x": 1.0}, 0.3, stiffness=2.0))
    exact = gw.find_orbit(system)
    state = exact.state
    assert Reference(system).integrate(state, 0.0, PERIOD).state == pytest.approx(state, abs=1e-10)
    peak, errors = exact.measure("max.x"), []
    for harmonics in (5, 15, 45):
        orbit = gw.find_orbit(system, start=state, method=gw.Balance(harmonics, error=1.0))
        errors.append(abs(orbit.measure("max.x") - peak))
        assert orbit.state[2] == pytest.approx(state[2], abs=1e-9)  # it slips there
        assert len(orbit.slips) == len(exact.slips)
    assert errors[0] < 2e-3
    assert errors[1] < 5e-5
    assert errors[2] < 2e-6


@keeps("belt-80-1e-05-2e-06", "limit-80-3e-05-2e-06", "displaced-80-3e-05-5e-06", "stages-80-5e-05-0.004")
@pytest.mark.parametrize(
    ("name", "harmonics", "near", "alike"),
    [
        ("limit", 80, 3e-5, 2e-6),
        ("belt", 80, 1e-5, 2e-6),
        in_campaign("Iwan", 80, 1e-5, 5e-6),
        ("stages", 80, 5e-5, 4e-3),
        in_campaign("damped stages", 80, 2e-4, 2e-3),
        ("normal", 80, 1e-5, 1e-5),
        ("displaced", 80, 3e-5, 5e-6),
    ],
)
def test_states_and_multipliers_are_those_of_the_flow(name, harmonics, near, alike):
    """Where the limit jumps, multipliers depend on a velocity beside a kink, which converges with 1 / H."""
    system = SYSTEMS[name]()
    size = system.structure.state_size
    first = gw.find_orbit(system, start=np.zeros(size), method=gw.Balance(10, error=1.0))
    orbit = gw.find_orbit(system, start=first.state, method=gw.Balance(harmonics, error=1.0))
    assert orbit.state.shape == orbit.multipliers.shape == (size,)
    exact = gw.find_orbit(system, start=orbit.state)
    assert orbit.state == pytest.approx(exact.state, abs=near)
    assert [(each.contact, each.slip) for each in orbit.slips] == [(each.contact, each.slip) for each in exact.slips]
    assert [each.theta for each in orbit.slips] == pytest.approx([each.theta for each in exact.slips], abs=1e-3)
    flow, numbers, step = flow_of(system), coefficients_of(system), 1e-5
    moved = [
        flow.integrate(numbers, exact.state + step * e, 0.0, PERIOD).state
        - flow.integrate(numbers, exact.state - step * e, 0.0, PERIOD).state
        for e in np.eye(size)
    ]
    values = np.linalg.eigvals(np.array(moved).T / (2.0 * step))
    assert all(np.abs(orbit.multipliers - each).min() < alike for each in values)
    assert np.count_nonzero(orbit.multipliers == 0.0) >= len(system.structure.memories)
    motion = orbit.motion(64)
    assert motion.z.shape == (65, len(system.structure.memories))
    assert motion.z[0] == pytest.approx(motion.z[-1], abs=1e-12)
    assert motion.z == pytest.approx(exact.motion(64).z, abs=2e-3)
    assert orbit.strobes(2)[1] == pytest.approx(orbit.state, abs=1e-12)


def test_an_orbit_whose_element_never_slips_has_a_multiplier_1_that_does_not_count():
    system = one_mass(friction("fr", {"x": 1.0}, 4.0, stiffness=2.0))
    orbit = gw.find_orbit(system, start=np.zeros(3), method=gw.Balance(5))
    linear = one_mass(gw.Contact("c", {"x": 1.0}, (gw.Stage(50.0, 1.0),)), stiffness=[[3.0]])
    expected = gw.find_orbit(linear, start=np.zeros(2), method=gw.Balance(5))
    assert orbit.stuck == (0,)
    assert orbit.state == pytest.approx([*expected.state, expected.state[0]], abs=1e-13)
    assert orbit.multipliers[0] == 1.0
    assert np.sort_complex(orbit.multipliers[1:]) == pytest.approx(np.sort_complex(expected.multipliers), abs=1e-10)
    assert orbit.stable
    branch = gw.follow(orbit, "frequency", 1.5)
    assert all(point.orbit.stuck == (0,) for point in branch.points)
    assert not branch.special_points


@pytest.mark.parametrize(
    ("name", "to", "error", "near"), [("Iwan", 1.6, 1e-4, 1e-3), in_campaign("stages", 1.3, 1e-3, 5e-3)]
)
def test_a_walk_over_the_frequency_meets_the_orbits_of_shooting(name, to, error, near):
    system = SYSTEMS[name]()
    start = gw.find_orbit(system, start=np.zeros(system.structure.state_size), method=gw.Balance(error=error))
    branch = gw.follow(start, "frequency", to, walk=gw.WalkOptions(largest_step=0.1))
    assert branch.points[-1].value == pytest.approx(to)
    for point in branch.points[:: max(1, len(branch.points) // 3)]:
        exact = gw.find_orbit(point.orbit.system, start=point.orbit.state)
        assert point.orbit.state == pytest.approx(exact.state, abs=near)
        assert point.orbit.stable == exact.stable


@pytest.mark.parametrize(
    ("contacts", "loads", "method", "message"),
    [
        (
            [friction("brake", {"q1": 1.0}, 0.3)],
            (),
            gw.Balance(5),
            r"'brake'.*sticks rigidly.*stiffness = 100.*shooting",
        ),
        (
            [gw.Contact("wall", {"q1": 1.0}, (gw.Stage(0.5),), law="rigid", restitution=0.8)],
            (),
            gw.Balance(5),
            r"'wall'.*'rigid' reverses the rate.*stiffness = 1000.*shooting",
        ),
        (
            [friction("fr", {"q1": 1.0}, 0.3, stiffness=2.0)],
            (),
            gw.Balance(5, stability="hill"),
            r"'fr' has a memory.*stability = \"variational\"",
        ),
    ],
)
def test_friction_that_is_not_included_is_refused_by_name(contacts, loads, method, message):
    system = two_masses(contacts, loads)
    with pytest.raises(ModelError, match=message):
        gw.find_orbit(system, start=np.zeros(system.structure.state_size), method=method)
