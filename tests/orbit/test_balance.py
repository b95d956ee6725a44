"""Harmonic balance: forces, derivatives and motions against sampling, differences, closed forms and shooting."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import gapwalk as gw
from gapwalk import Balance, Contact, Harmonic, Side, Stage, System, backlash, find_orbit
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.flow.forces import contact_forces
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.harmonic_balance.contact_forces import contact_forces_of, laws_of
from gapwalk.orbit.harmonic_balance.kernels import real_form
from gapwalk.orbit.harmonic_balance.linear_part import waves
from gapwalk.paper import case
from tests.bifurcation.alike.kinds import rotor
from tests.orbit.two_masses import two_masses
from tests.tiers import some_of

LAWS = (
    ("elastic", {}),
    ("viscous", {"viscous_damping": 0.3}),
    ("hunt-crossley", {"impact_damping": 0.4}),
    ("hunt-crossley-as-printed", {"impact_damping": 0.4}),
)


def oscillator(law: str = "hunt-crossley", **coefficients: float) -> System:
    """Two masses, a contact of two stages with a cubic term on one side, and one with a single stage on the other."""
    stages = (Stage(0.3, 2.0, 0.5, Side.BOTH, "soft"), Stage(0.8, 3.0, 0.0, Side.POSITIVE, "hard"))
    contacts = (
        Contact("stop", {"q1": 1.0, "q2": -1.0}, stages, law=law, **coefficients),
        Contact("wall", {"q2": 1.0}, (Stage(0.5, 4.0),), force={"q2": 0.7}),
    )
    return two_masses(contacts)


@pytest.fixture(scope="module")
def lines() -> np.ndarray:
    """A motion of both deflections that opens and closes every stage."""
    rng = np.random.default_rng(3)
    lines = (rng.normal(size=(2, 6)) + 1j * rng.normal(size=(2, 6))) * 0.8 ** np.arange(6)
    lines[:, 0] = 0.1
    return lines


@pytest.mark.parametrize(("law", "coefficients"), LAWS)
def test_the_lines_of_the_forces_are_those_of_finely_sampled_ones(law, coefficients, lines) -> None:
    system, count, samples = oscillator(law, **coefficients), lines.shape[1] - 1, 1 << 16
    layout, numbers = layout_of(system.structure), coefficients_of(system)
    forces = contact_forces_of(lines, laws_of(layout, numbers))
    phi = 2.0 * np.pi * (np.arange(samples) + 0.5) / samples
    wave, k = waves(phi, count), np.arange(count + 1)
    x, v = (wave @ lines.T).real, (wave @ (1j * k * system.frequency * lines).T).real
    # positions whose deflections are x: q2 from the wall, q1 = stop + q2
    q, rates = np.column_stack((x.sum(axis=1), x[:, 1])), np.column_stack((v.sum(axis=1), v[:, 1]))
    sampled = contact_forces(layout, numbers, phi, q, rates)
    expected = 2.0 * (waves(-phi, 2 * count).T @ sampled) / samples
    expected[0] *= 0.5
    spring, damper = forces.parts[:, 0], forces.parts[:, 2]
    found = spring + 1j * system.frequency * np.arange(2 * count + 1) * damper
    # sampling errs by 1/samples where the viscous force jumps, by its square elsewhere
    assert pytest.approx(expected, abs=3e-4 if law == "viscous" else 2e-8) == found.T


@pytest.mark.parametrize(("law", "coefficients"), LAWS)
def test_the_jacobian_is_that_of_central_differences(law, coefficients, lines) -> None:
    equation = Balance(5).pose(oscillator(law, **coefficients), "frequency")
    x, step = real_form(lines).ravel(), 1e-6
    found = equation.evaluate(x, 1.1).by_unknowns
    moved = [
        equation.evaluate(x + step * e, 1.1).residual - equation.evaluate(x - step * e, 1.1).residual
        for e in np.eye(len(x))
    ]
    assert found == pytest.approx(np.array(moved).T / (2 * step), abs=2e-8)


@pytest.mark.parametrize(
    "name",
    [
        "frequency",
        "mass.q1.q2",
        "stiffness.q1.q2",
        "damping.q2.q2",
        "mean.q1",
        "harmonic2.phase",
        "harmonic1.amplitude",
        "stop.deflection.q1",
        "wall.force.q2",
        "stop.soft.clearance",
        "stop.soft.cubic",
        "stop.hard.stiffness",
        "stop.impact_damping",
    ],
)
def test_the_derivative_by_a_parameter_is_that_of_central_differences(name, lines) -> None:
    system = oscillator(impact_damping=0.4)
    equation, value = Balance(5).pose(system, name), system[name]
    x, step = real_form(lines).ravel(), 1e-6
    difference = equation.evaluate(x, value + step).residual - equation.evaluate(x, value - step).residual
    assert equation.evaluate(x, value).by_parameter == pytest.approx(difference / (2 * step), rel=1e-8, abs=1e-8)


def test_a_gap_of_no_width_is_a_linear_spring() -> None:
    """With clearance 0 on both sides the system is linear, and its response is a matrix inverse."""
    system = System(
        coordinates=("q1", "q2"),
        stiffness=[[1.0, -0.3], [-0.3, 1.4]],
        damping=[[0.05, 0.0], [0.0, 0.08]],
        contacts=(backlash("gap", {"q1": 1.0, "q2": -1.0}, 0.0, 2.0),),
        mean={"q2": 0.3},
        harmonics=(Harmonic(0.7, {"q1": 1.0}, phase=0.6), Harmonic(0.2, {"q2": 1.0}, order=3)),
        frequency=0.9,
    )
    orbit = find_orbit(system, method=Balance(4), start="rest")
    stiffness = np.array([[3.0, -2.3], [-2.3, 3.4]])
    damping, loads = np.diag([0.05, 0.08]), {0: [0, 0.3], 1: [0.7 * np.exp(0.6j), 0], 3: [0, 0.2]}
    q, v = np.zeros(2), np.zeros(2)
    for order, load in loads.items():
        w = 0.9 * order
        line = np.linalg.solve(stiffness - w**2 * np.eye(2) + 1j * w * damping, load)
        q, v = q + line.real, v + (1j * w * line).real
    assert orbit.state == pytest.approx(np.concatenate((q, v)), abs=1e-12)
    generator = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    expected = np.exp(np.linalg.eigvals(generator) * 2 * np.pi / 0.9)
    assert np.sort_complex(orbit.multipliers) == pytest.approx(np.sort_complex(expected), abs=1e-9)


@pytest.mark.parametrize(("law", "coefficients"), LAWS)
def test_the_balanced_motion_tends_to_the_one_of_shooting(law, coefficients) -> None:
    system = oscillator(law, **coefficients)
    exact = find_orbit(system)
    errors, bounds, multipliers = [], [], []
    for harmonics in (10, 40, 160):
        orbit = find_orbit(system, method=Balance(harmonics, error=1.0), start=exact.state)
        errors.append(float(np.abs(orbit.state - exact.state).max()))
        bounds.append(orbit.truncation)
        multipliers.append(np.abs(np.sort(np.abs(orbit.multipliers)) - np.sort(np.abs(exact.multipliers))).max())
    # velocities of a motion whose force jumps (viscous) converge with 1/H, others with its square at least
    assert errors[2] < errors[0] / (10 if law == "viscous" else 200)
    assert multipliers[2] < max(multipliers[0] / 10, 1e-6)
    assert all(later < earlier for earlier, later in pairwise(bounds))


@pytest.mark.parametrize(("name", "frequency"), [("10a", 0.55), ("12", 0.62), ("9b", 1.25)])
def test_both_kinds_of_stability_tend_to_the_multipliers_of_shooting(name, frequency) -> None:
    """Figure 10a has no spring to ground: only its contact holds it."""
    exact = find_orbit(case(name), frequency=frequency)
    assert any(exact.closings)
    off = {
        stability: [
            np.abs(np.sort_complex(orbit.multipliers) - np.sort_complex(exact.multipliers)).max()
            for harmonics in (10, 40)
            for orbit in [find_orbit(exact.system, method=Balance(harmonics, 1.0, stability), start=exact.state)]
        ]
        for stability in ("variational", "hill")
    }
    assert off["variational"][1] < min(1e-4, off["variational"][0] / 10)
    assert off["hill"][1] < min(2e-2, off["hill"][0] / 4)


def test_a_motion_of_twice_the_period_needs_half_harmonics() -> None:
    system = case("9b").at(frequency=1.27)
    exact = find_orbit(system, period=2)
    orbit = find_orbit(system, period=2, method=Balance(20), start=exact.state)
    assert orbit.state == pytest.approx(exact.state, abs=1e-4)
    assert orbit.measure("h1/2.q1") == pytest.approx(exact.measure("h1/2.q1"), abs=1e-5)
    assert orbit.measure("h1/2.q1") > 0.01
    doubled = Balance(20).pose(system, None, 4)
    spread = doubled.evaluate(doubled.unknowns(replace(orbit, period=4)), 0.0)
    assert np.abs(spread.residual).max() < 1e-9


def test_the_measures_of_a_balanced_motion_are_those_of_shooting() -> None:
    exact = find_orbit(case("12"), frequency=0.62)
    orbit = find_orbit(exact.system, method=Balance(60), start=exact.state)
    assert orbit.pattern == exact.pattern
    for measure in ("max.q1", "min.q3", "mean.q1", "rms.q3", "half.q1", "h1.q1", "max.stage2"):
        assert orbit.measure(measure) == pytest.approx(exact.measure(measure), abs=2e-5)
    assert [event.theta for event in orbit.events] == pytest.approx([e.theta for e in exact.events], abs=1e-4)
    assert [event.velocity for event in orbit.events] == pytest.approx([e.velocity for e in exact.events], abs=1e-3)


def test_as_many_harmonics_are_taken_as_the_error_needs() -> None:
    exact = find_orbit(case("12"), frequency=0.62)
    orbits = [find_orbit(exact.system, method=Balance(error=error), start=exact.state) for error in (1e-3, 1e-5)]
    assert [orbit.truncation < error for orbit, error in zip(orbits, (1e-3, 1e-5), strict=True)] == [True, True]
    errors = [np.abs(orbit.state - exact.state)[:2].max() for orbit in orbits]
    assert errors[1] < 1e-5 < errors[0] < 1e-3


def test_too_few_harmonics_are_refused_with_what_to_change() -> None:
    with pytest.raises(ConvergenceError, match=r"beyond H = 3 amount to .* take harmonics = 6 or more"):
        find_orbit(case("12"), frequency=0.62, method=Balance(3))


def test_stability_without_sense_is_refused() -> None:
    with pytest.raises(ModelError, match='one of "variational", "hill"'):
        Balance(stability="floquet")


def test_harmonics_below_the_order_of_the_excitation_are_refused() -> None:
    with pytest.raises(ModelError, match="order 2; write harmonics = 2 or more"):
        find_orbit(case("20a"), method=Balance(1))


@pytest.mark.parametrize("share", [0.8, 1.3])
@pytest.mark.parametrize("seed", some_of(range(8), 0, 1, 2, 4, 6))
def test_rotors_below_and_above_their_first_touch_are_those_of_shooting(seed: int, share: float) -> None:
    """Gyroscopic terms in both methods; the load brings the largest deflection to a share of its clearance."""
    system = rotor(seed).system
    small = gw.find_orbit(system.at({"harmonic1.amplitude": 1e-3}))
    deflected = [
        small.measure(f"half.x{place}") / system[f"{form.name}.clearance"]
        for place, form in enumerate(system.structure.contacts)
    ]
    loaded = system.at({"harmonic1.amplitude": 1e-3 * share / max(deflected)})
    shot = gw.find_orbit(loaded)
    assert bool(shot.events) or share < 1.0
    balanced = gw.find_orbit(loaded, shot.period, shot.state, method=gw.Balance())
    q, own = shot.motion(64).q, balanced.motion(64).q
    assert np.abs(own - q).max() <= (1.5 * balanced.truncation + 1e-12) * np.abs(q).max()
