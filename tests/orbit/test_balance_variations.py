"""Harmonic balance with displacements, numbers that vary over the angle, loads that grow, and forces by formulas.

Against sampling, differences, shooting, and orbits that SciPy found of other implementations (`tests.machines`).
"""

import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.loci import follow_locus
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.forces import Angles, contact_force
from gapwalk.loads import Rectangle
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import read_source
from gapwalk.orbit.harmonic_balance import balance_equation
from gapwalk.orbit.harmonic_balance.contact_forces import contact_forces_of, laws_of
from gapwalk.orbit.harmonic_balance.kernels import real_form
from gapwalk.orbit.harmonic_balance.linear_part import deflections_in, linear_of, waves
from gapwalk.verification.verify_orbits import imbalance
from tests.orbit.two_masses import two_masses
from tests.tiers import in_campaign, keeps, some_of

MACHINES = Path(__file__).parents[1] / "machines"
REFERENCES = json.loads((MACHINES / "references.json").read_text(encoding="utf-8"))["orbits"]


def oscillator(law: str, loads=(), forces=(), **numbers: float) -> gw.System:
    """Two masses, a contact of two stages, and one on the other side of a wall, with further loads and forces."""
    stages = (gw.Stage(0.3, 2.0, 0.5, gw.Side.BOTH, "soft"), gw.Stage(0.8, 3.0, 0.0, gw.Side.POSITIVE, "hard"))
    contacts = (
        gw.Contact("stop", {"q1": 1.0, "q2": -1.0}, stages, law=law, **numbers),
        gw.Contact("wall", {"q2": 1.0}, (gw.Stage(0.5, 4.0),), force={"q2": 0.7}),
        *forces,
    )
    return two_masses(contacts, loads)


def wave(amplitude: float, varies, order: int = 1, phase: float = 0.3, name: str = "wave", growth: int = 0):
    return gw.Harmonic(amplitude, varies=varies, order=order, phase=phase, name=name, growth=growth)


FORMULAS = (
    gw.force("lamp", {"q1": 1.0}, "-mu*(1 - x**2)*v + a*tanh(x)", mu=0.1, a=0.3),
    gw.force(
        "both",
        {"r": {"q1": 1.0}, "s": {"q1": 1.0, "q2": 0.5}},
        "b*r**2*s + c*s'*r + d*sin(r')",
        acts_on={"q2": 1.0, "q1": 0.2},
        b=0.2,
        c=0.1,
        d=0.2,
    ),
)
SYSTEMS = {
    "displacements": lambda: oscillator(
        "hunt-crossley",
        [wave(0.1, "stop.deflection", 3), wave(0.2, "wall.deflection", 1, -0.3, "base", 2)],
        impact_damping=0.4,
    ),
    "stiffness": lambda: oscillator(
        "viscous",
        [
            wave(0.3, "stop.stiffness"),
            wave(0.2, {"stop.hard.stiffness": 1.0, "wall.stiffness": -0.5}, 2, -0.3, "second"),
        ],
        viscous_damping=0.3,
    ),
    "damping": lambda: oscillator("viscous", [wave(0.3, "stop.viscous_damping", 2)], viscous_damping=0.4),
    "products": lambda: oscillator(
        "hunt-crossley",
        [
            wave(0.3, {"stop.stiffness": 1.0, "stop.impact_damping": 0.5}, 2, growth=1),
            wave(0.2, "stop.impact_damping", name="second"),
        ],
        impact_damping=0.4,
    ),
    "levels": lambda: oscillator(
        "viscous",
        [
            Rectangle(0.3, "stop.stiffness", share=0.4, phase=0.3, name="wave"),
            Rectangle(0.2, "wall.stiffness", order=2, share=0.6, phase=-2.0, name="second"),
            wave(0.2, "stop.stiffness", name="third"),
        ],
        viscous_damping=0.3,
    ),
    "levels of the damping": lambda: oscillator(
        "hunt-crossley",
        [
            Rectangle(0.3, {"stop.stiffness": 1.0, "stop.impact_damping": 0.7}, order=2, share=0.4, name="wave"),
            Rectangle(0.3, "stop.stiffness", share=0.6, phase=0.9, name="second"),
            wave(0.2, "stop.stiffness", name="third"),
        ],
        impact_damping=0.3,
    ),
    "growth": lambda: oscillator(
        "elastic",
        [
            gw.Harmonic(0.2, {"q2": 1.0}, order=3, growth=2, name="wave"),
            wave(0.1, "wall.deflection", name="second", growth=1),
        ],
    ),
    "formulas": lambda: oscillator(
        "hunt-crossley",
        [wave(0.3, "lamp.a", 2), wave(0.1, "both.s", name="second", growth=1)],
        FORMULAS,
        impact_damping=0.4,
    ),
    "kinks": lambda: oscillator(
        "viscous",
        [
            wave(0.3, "balls.k", 2),
            wave(0.1, "balls.deflection", name="second"),
            wave(0.2, "stop.stiffness", name="third"),
        ],
        [
            gw.force("drag", {"q1": 1.0}, "c*v*abs(v)", c=0.3),
            gw.force("balls", {"q2": 1.0, "q1": 0.2}, "k*(1 + h*v)*max(x - g, 0)**1.5", k=2.0, h=0.1, g=0.1),
        ],
        viscous_damping=0.3,
    ),
    "levels of a formula": lambda: oscillator(
        "elastic",
        [Rectangle(0.3, "drag.k", share=0.4, phase=0.3, name="wave")],
        [gw.force("drag", {"q1": 1.0}, "c*v*abs(v) + k*x**3", c=0.4, k=0.5)],
    ),
}
OTHERS = ("frequency", "harmonic1.amplitude", "stop.soft.stiffness", "stop.soft.clearance", "stop.deflection.q1")
ADDED = ("wave", "second", "third", "base", "lamp", "both", "balls", "drag")


@cache
def system_of(name: str) -> gw.System:
    return SYSTEMS[name]()


@cache
def exact_of(name: str) -> gw.Orbit:
    """The orbit by shooting."""
    return gw.find_orbit(system_of(name))


def unknowns_of(system: gw.System, count: int, seed: int = 3) -> np.ndarray:
    """Lines of all deflections, which open and close every stage."""
    rng, width = np.random.default_rng(seed), deflections_in(system.structure)
    lines = (rng.normal(size=(width, count + 1)) + 1j * rng.normal(size=(width, count + 1))) * 0.7 ** np.arange(
        count + 1
    )
    lines[:, 0] = 0.1
    return lines


@keeps("displacements", "growth")
@pytest.mark.parametrize(
    "name", some_of(SYSTEMS, "displacements", "growth", "levels of the damping", "levels of a formula")
)
def test_the_derivatives_are_those_of_central_differences(name):
    system, step = system_of(name), 1e-4
    x = real_form(unknowns_of(system, 6)).ravel()
    equation = gw.Balance(6).pose(system, "frequency")

    def slopes(of, h: float) -> np.ndarray:
        return (of(h) - of(-h)) / (2.0 * h)

    def extrapolated(of) -> np.ndarray:
        """Of central differences with two steps: their error is of the fourth order, so that steps may be large."""
        return (4.0 * slopes(of, step) - slopes(of, 2.0 * step)) / 3.0

    moved = [extrapolated(lambda h, e=e: equation.evaluate(x + h * e, 1.1).residual) for e in np.eye(len(x))]
    assert equation.evaluate(x, 1.1).by_unknowns == pytest.approx(np.array(moved).T, rel=1e-8, abs=2e-9)
    added = [each for each in system.parameters if each.split(".")[0] in ADDED and "acts_on" not in each]
    for parameter in (*OTHERS, *added):
        equation, value = gw.Balance(6).pose(system, parameter), system[parameter]
        difference = extrapolated(lambda h, own=equation, at=value: own.evaluate(x, at + h).residual)
        assert equation.evaluate(x, value).by_parameter == pytest.approx(difference, rel=1e-7, abs=2e-9), parameter


@pytest.mark.parametrize("name", ["stiffness", "damping", "products", "levels", "kinks", "levels of a formula"])
def test_the_lines_of_the_forces_are_those_of_finely_sampled_ones(name):
    """The deflections alone: what is added to them is among their lines."""
    system, count, samples = system_of(name), 6, 1 << 16
    layout, numbers = layout_of(system.structure), coefficients_of(system)
    lines = unknowns_of(system, count)
    forces = contact_forces_of(lines, laws_of(layout, numbers))
    phi = 2.0 * np.pi * (np.arange(samples) + 0.5) / samples
    turns, k = waves(phi, count), np.arange(count + 1)
    x, v = (turns @ lines.T).real, (turns @ (1j * k * system.frequency * lines).T).real
    angles = Angles(layout, numbers, phi)
    moves = [[(x[:, c], v[:, c])] for c in range(len(layout.contacts))]
    sampled = np.stack(
        [contact_force(slots, angles, each) for slots, each in zip(layout.contacts, moves, strict=True)], 1
    )
    expected = 2.0 * (waves(-phi, 2 * count).T @ sampled) / samples
    expected[0] *= 0.5
    found = forces.parts[:, 0] + 1j * system.frequency * np.arange(2 * count + 1) * forces.parts[:, 2]
    # sampling errs by 1/samples where a force jumps, by its square elsewhere
    assert pytest.approx(expected, abs=3e-8 if name == "products" else 3e-4) == found.T


@pytest.mark.parametrize(
    "name", some_of(SYSTEMS, "displacements", "stiffness", "growth", "levels of the damping", "formulas")
)
def test_the_balanced_motion_tends_to_the_one_of_shooting(name):
    exact, states, multipliers, bounds = exact_of(name), [], [], []
    for harmonics in (10, 40, 120):
        orbit = gw.find_orbit(exact.system, method=gw.Balance(harmonics, error=1.0), start=exact.state)
        states.append(np.abs(orbit.state - exact.state).max())
        multipliers.append(np.abs(np.sort_complex(orbit.multipliers) - np.sort_complex(exact.multipliers)).max())
        bounds.append(orbit.truncation)
        # sampled by independent equations, which know nothing of this method
        assert imbalance(orbit).lines < 1e-8
        assert imbalance(orbit).astray < 1e-9
    assert states[2] < states[0] / 10
    assert multipliers[2] < max(multipliers[0] / 100, 1e-7)
    assert all(later < earlier for earlier, later in pairwise(bounds))


@keeps("products")
@pytest.mark.parametrize(
    "name",
    some_of(
        ["stiffness", "products", "levels", "levels of the damping", "formulas", "kinks"], "products", "levels", "kinks"
    ),
)
def test_the_multipliers_by_lines_tend_to_those_of_the_variational_pass(name):
    exact, errors = exact_of(name), []
    for harmonics in (20, 80):
        method = gw.Balance(harmonics, error=1.0, stability="hill")
        orbit = gw.find_orbit(exact.system, method=method, start=exact.state)
        errors.append(np.abs(np.sort_complex(orbit.multipliers) - np.sort_complex(exact.multipliers)).max())
    assert errors[1] < min(1e-3, errors[0] / 4)


def machine(name: str) -> gw.System:
    """The system of a model file."""
    model, problems = check_model(read_source(str(MACHINES / f"{name}.toml")))
    assert model is not None, problems
    return model.system


SMOOTH = ("duffing", "two_cubic", "cubic_chain", "van_der_pol", "helmholtz_duffing", "truss", "mathieu", "pendulum")


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_machines_have_the_orbits_that_scipy_found(name):
    """Their series converges: states to 1e-9, multipliers to 1e-7, and the derivative of the orbit by the frequency."""
    first = REFERENCES[name][0]["parameters"]
    for reference in REFERENCES[name]:
        if reference["parameters"] != first:
            continue
        system, state = machine(name).at(frequency=reference["frequency"]), np.array(reference["state"])
        orbit = gw.find_orbit(system, reference["cycles"], state, method=gw.Balance(40))
        assert orbit.state == pytest.approx(state, abs=1e-9 * np.abs(state).max())
        expected = np.sort_complex([complex(*each) for each in reference["multipliers"]])
        assert np.sort_complex(orbit.multipliers) == pytest.approx(expected, abs=1e-7)
        # the derivative of each deflection at theta = 0 is the sum of those of its cosines
        equation = gw.Balance(40).pose(system, "frequency", reference["cycles"])
        evaluation = equation.evaluate(equation.unknowns(orbit), system.frequency)
        slopes = -np.linalg.solve(evaluation.by_unknowns, evaluation.by_parameter).reshape(
            len(orbit.deflections.lines), -1
        )
        vectors = linear_of(layout_of(system.structure), coefficients_of(system)).deflections
        known = vectors @ np.array(reference["slope_by_frequency"])[: system.size]
        assert slopes[:, : equation.count + 1].sum(axis=1) == pytest.approx(known, abs=1e-8 * np.abs(known).max())


@pytest.mark.parametrize("name", ["mathieu_stop", "meissner", "gear_rectangle", "hertz", "drag"])
def test_machines_with_kinks_tend_to_the_orbits_that_scipy_found(name):
    for reference in REFERENCES[name]:
        system, state = machine(name).at(frequency=reference["frequency"]), np.array(reference["state"])
        orbit = gw.find_orbit(system, reference["cycles"], state, method=gw.Balance(80))
        assert orbit.state == pytest.approx(state, abs=1e-5 * np.abs(state).max())
        expected = np.sort_complex([complex(*each) for each in reference["multipliers"]])
        assert np.sort_complex(orbit.multipliers) == pytest.approx(expected, abs=2e-5)


def test_mathieu_s_equation_has_a_multiplier_of_1_at_its_characteristic_value():
    """``x'' + (a - 2 q cos 2t) x = 0``, q = 1, has a solution of the period 2 pi at a1 = 1.8591080725143634."""
    a = 1.8591080725143634
    spring = gw.force("spring", {"x": 1.0}, "a*x", a=a)
    loads = [wave(-2.0 / a, "spring.a", 2, 0.0)]
    system = gw.System(("x",), [[0.0]], [[0.0]], contacts=[spring], harmonics=loads, frequency=1.0)
    orbit = gw.find_orbit(system, start="rest", method=gw.Balance(40))
    assert orbit.multipliers.sum().real == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "to", "count"),
    [in_campaign("stiffness", 1.13, 3), in_campaign("formulas", 1.3, 3), in_campaign("kinks", 1.26, 1)],
)
def test_a_balanced_branch_has_the_special_points_of_shooting(name, to, count):
    method = gw.Balance(30, error=1.0)
    branches = [gw.follow(exact_of(name), "frequency", to, method=each) for each in (None, method)]
    exact, found = ([(str(each.kind), each.value) for each in branch.special_points] for branch in branches)
    assert len(exact) >= count
    assert [kind for kind, _ in exact] == [kind for kind, _ in found]
    assert [value for _, value in found] == pytest.approx([value for _, value in exact], abs=1e-5)
    if name == "stiffness":  # and the locus of its first flip
        ends = []
        for branch, each in zip(branches, (None, method), strict=True):
            flip = branch.special("flip")[0]
            locus = follow_locus(flip, "frequency", "wave.amplitude", ((1.09, 1.12), (0.29, 0.31)), method=each)
            ends.append(sorted(end.values for end in locus.ends))
        assert np.array(ends[1]) == pytest.approx(np.array(ends[0]), abs=2e-5)


@pytest.mark.slow
def test_a_gear_pair_with_transmission_error_and_mesh_stiffness_of_8_harmonics():
    """Backlash on both sides; teeth part near the resonance, by balance as by shooting."""
    loads = [wave(0.2 / order**1.5, "mesh.stiffness", order, 0.7 * order, f"mesh{order}") for order in range(1, 9)]
    system = gw.System(
        ("x",),
        [[0.0]],
        [[0.1]],
        contacts=[gw.backlash("mesh", {"x": 1.0}, 0.1, 1.0)],
        mean={"x": 0.1},
        harmonics=[*loads, wave(0.03, "mesh.deflection", 1, 0.2, "error")],
        frequency=1.5,
    )
    exact = gw.follow(gw.find_orbit(system), "frequency", 0.6)
    branch = gw.follow(exact.points[0].orbit, "frequency", 0.6, method=gw.Balance(40, error=1.0))
    found = [[(str(each.kind), each.value) for each in one.special_points] for one in (exact, branch)]
    assert {"fold", "grazing"} <= {kind for kind, _ in found[0]}
    assert [kind for kind, _ in found[0]] == [kind for kind, _ in found[1]]
    assert [value for _, value in found[1]] == pytest.approx([value for _, value in found[0]], abs=1e-4)
    assert gw.verify(branch).ok


def test_harmonics_below_the_order_of_a_displacement_are_refused():
    with pytest.raises(ModelError, match="order 3; write harmonics = 3 or more"):
        gw.find_orbit(system_of("displacements"), method=gw.Balance(2))


def test_a_formula_that_changes_too_fast_is_refused():
    system = oscillator("elastic", forces=[gw.force("clutch", {"q1": 1.0}, "f*tanh(v/e)", f=0.1, e=1e-9)])
    equation = gw.Balance(8).pose(system)
    with pytest.raises(NumericalError, match="'clutch' unresolved; its formula changes too fast"):
        equation.evaluate(real_form(unknowns_of(system, 8)).ravel(), 0.0)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_motion_is_one_of_twice_the_period_too(name):
    exact = exact_of(name)
    orbit = gw.find_orbit(exact.system, method=gw.Balance(12, error=1.0), start=exact.state)
    twice = gw.Balance(12, error=1.0).pose(exact.system, "frequency", 2)
    unknowns = twice.unknowns(orbit)
    evaluation = twice.evaluate(unknowns, exact.system.frequency)
    assert np.abs(evaluation.residual).max() < 1e-9
    multipliers = twice.orbit(unknowns, exact.system.frequency, evaluation).multipliers
    assert np.sort_complex(multipliers) == pytest.approx(np.sort_complex(orbit.multipliers**2), abs=2e-5)


def test_eigenvectors_of_many_degrees_of_freedom_have_the_multipliers_of_full_matrices(monkeypatch):
    n = 17
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    names = tuple(f"q{k}" for k in range(n))
    loads = [wave(0.3, "stop.stiffness", 2), wave(0.05, "stop.deflection", name="second")]
    loads.append(Rectangle(0.2, "stop.stiffness", order=1, share=0.4, name="third"))
    loads.append(wave(0.3, "stop.viscous_damping", name="fourth"))
    stop = gw.Contact("stop", {"q8": 1.0}, [gw.Stage(0.3, 1.0)], law="viscous", viscous_damping=0.1)
    loads.append(gw.Harmonic(0.3, {"q3": 1.0}))
    system = gw.System(
        names, stiffness, 0.05 * stiffness + 0.02 * np.eye(n), contacts=[stop], harmonics=loads, frequency=0.3
    )
    orbits = []
    for least in (16, 18):
        monkeypatch.setattr(balance_equation, "_MANY", least)
        orbits.append(gw.find_orbit(system, start="rest", method=gw.Balance(30, error=1.0)))
    assert any(orbits[0].closings)
    modal, full = (np.sort(np.abs(orbit.multipliers))[::-1] for orbit in orbits)
    assert modal[:8] == pytest.approx(full[:8], abs=1e-3)
