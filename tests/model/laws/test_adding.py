"""A force law and a load that were added in one file each go through everything."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.errors import ModelError, StoreError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import ParameterLine, coefficients_of
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.laws import CLEARANCE, LAWS, Law, register
from gapwalk.model.loads import LOADS
from gapwalk.model.problems import ModelFileError
from gapwalk.model.registry import Parameter
from gapwalk.results.codec import encode
from gapwalk.results.result_file import Part, ResultFile, reading
from tests.models import read_system
from tests.sampled_verification import SAMPLED, verified
from tests.tiers import in_campaign
from tests.toys import quadratic, unbalance, yielding

MODEL = """\
coordinates = ["x", "y"]
mass = [1.0, 2.0]
stiffness = [[1.5, -0.5], [-0.5, 1.0]]
damping = [0.1, 0.15]
mean = { x = 0.1 }
frequency = 0.8

[[contact]]
name = "stop"
deflection = { x = 1.0, y = -0.3 }
law = "quadratic"
clearance = 0.3
stiffness = 2.0
bend = 3.0
drag = 0.4

[[unbalance]]
moment = 0.9
acts_on = { x = 1.0 }

[[harmonic]]
amplitude = 0.05
order = 2
phase = 0.4
acts_on = { y = 1.0 }

[study]
kind = "response"
parameter = "frequency"
from = 0.8
to = 0.82
"""
NAMES = ("frequency", "unbalance1.moment", "stop.bend", "stop.drag", "stop.clearance", "stop.stiffness")


class Kept(NamedTuple):
    """What a file begins with."""

    system: gw.System


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "toy.toml"
    path.write_text(MODEL)
    return path


@pytest.fixture
def system(file: Path) -> gw.System:
    return gw.read_study(file).system


def right_hand_side(system: gw.System, theta: float, y) -> np.ndarray:
    """Over theta, from the named values: the formulas written a second time."""
    q, v, w = y[:2], y[2:], system.frequency
    x, rate = q[0] - 0.3 * q[1], v[0] - 0.3 * v[1]
    depth = max(abs(x) - system["stop.clearance"], 0.0)
    force = math.copysign(system["stop.stiffness"] * depth + system["stop.bend"] * depth**2, x)
    force += system["stop.drag"] * depth**2 * rate
    load = np.array([0.1 + system["unbalance1.moment"] * w**2 * math.cos(theta), 0.05 * math.cos(2 * theta + 0.4)])
    pull = system.matrix("stiffness") @ q + system.matrix("damping") @ v + force * np.array([1.0, -0.3])
    return np.concatenate((v, np.linalg.solve(system.matrix("mass"), load - pull))) / w


def test_python_and_the_file_make_the_same_system(system: gw.System) -> None:
    stop = gw.Contact(
        "stop", {"x": 1.0, "y": -0.3}, [gw.Stage(0.3, 2.0, numbers={"bend": 3.0})], law=quadratic.Quadratic(), drag=0.4
    )
    loads = [gw.Harmonic(0.05, {"y": 1.0}, 2, 0.4), unbalance.Unbalance(0.9, {"x": 1.0})]
    stiffness = [[1.5, -0.5], [-0.5, 1.0]]
    made = gw.System(["x", "y"], stiffness, [0.1, 0.15], [1.0, 2.0], [stop], {"x": 0.1}, loads, 0.8)
    assert made == system
    assert {"stop.bend", "stop.drag", "unbalance1.moment"} <= set(system.parameters)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bend = 3.0\n", "", "bend is missing; it is the force by the square of the penetration"),
        ("drag = 0.4", "drag = -0.4", "drag is -0.4; it must be >= 0"),
        ("drag = 0.4", "impact_damping = 0.4", 'impact_damping is 0.4, but law is "quadratic"'),
        ("bend = 3.0", "bend = 3.0\ncubic = 1.0", 'cubic is 1.0, but the law "quadratic" has no such parameter'),
        ('law = "quadratic"', 'law = "quadratik"', "did you mean quadratic?"),
        ("moment = 0.9\n", "", "moment is missing; it is the mass times its distance"),
        ("moment = 0.9", 'moment = 0.9\nname = "stop"', 'name is "stop", which is taken already'),
    ],
)
def test_the_file_is_checked(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "bad.toml").write_text(MODEL.replace(old, new))
    with pytest.raises(ModelFileError) as error:
        gw.read_study(tmp_path / "bad.toml")
    assert message in str(error.value)


def test_the_flow_is_that_of_the_formulas_and_its_derivatives_are_exact(system: gw.System) -> None:
    state, coefficients = np.array([0.7, -0.4, 0.3, 0.5]), coefficients_of(system)
    expected = solve_ivp(
        lambda t, y: right_hand_side(system, t, y),
        (0.0, PERIOD),
        state,
        "DOP853",
        rtol=1e-12,
        atol=1e-12,
        max_step=0.01,
    ).y[:, -1]
    directions = np.array([ParameterLine(system, name).coefficients(system[name])[1] for name in NAMES])
    arc = flow_of(system, *NAMES, transition=True).integrate(coefficients, state, direction=directions)
    assert arc.contacts
    np.testing.assert_allclose(arc.state, expected, atol=1e-9)

    def end(state, values=system) -> np.ndarray:
        return flow_of(values).integrate(coefficients_of(values), state).state

    step = 1e-5
    differences = [(end(state + step * unit) - end(state - step * unit)) / (2 * step) for unit in np.eye(4)]
    np.testing.assert_allclose(arc.transition, np.transpose(differences), atol=2e-8)
    for name, column in zip(NAMES, arc.sensitivity.T, strict=True):
        up, down = (system.at({name: system[name] + each}) for each in (step, -step))
        np.testing.assert_allclose(column, (end(state, up) - end(state, down)) / (2 * step), atol=2e-8, err_msg=name)


def test_small_motions_are_the_same_in_a_small_unit(system: gw.System) -> None:
    """Clearances in 1e-6 of the unit: the law's own parameters must follow the unit of length."""
    unit = 1e-6
    changes = {"stop.clearance": 0.3 * unit, "stop.bend": 3.0 / unit, "stop.drag": 0.4 / unit**2, "mean.x": 0.1 * unit}
    small = system.at({**changes, "unbalance1.moment": 0.9 * unit, "harmonic2.amplitude": 0.05 * unit})
    state = np.array([0.7, -0.4, 0.3, 0.5])
    ends = [flow_of(each).integrate(coefficients_of(each), size * state).state / size for each, size in
            ((system, 1.0), (small, unit))]  # fmt: skip
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-11)


def test_a_branch_over_the_frequency_has_true_slopes(system: gw.System) -> None:
    """The frequency enters through the load, too: Newton's method and the tangents need its whole derivative."""
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.9)
    assert branch.points[-1].value == pytest.approx(0.9)
    equation = gw.Shooting().pose(system, "frequency", 1)
    point = branch.points[len(branch.points) // 2]
    found, step = equation.evaluate(point.x[:-1], point.value), 1e-5
    residuals = [equation.evaluate(point.x[:-1], point.value + each).residual for each in (step, -step)]
    np.testing.assert_allclose(found.by_parameter, (residuals[0] - residuals[1]) / (2 * step), atol=1e-8)
    report = gw.verify(branch)
    assert report.ok, report


def test_harmonic_balance_finds_the_orbit(system: gw.System) -> None:
    method = gw.Balance(harmonics=40)
    exact, balanced = gw.find_orbit(system), gw.find_orbit(system, method=method)
    np.testing.assert_allclose(balanced.state, exact.state, atol=2e-5)
    np.testing.assert_allclose(np.sort_complex(balanced.multipliers), np.sort_complex(exact.multipliers), atol=1e-5)
    equation, step = method.pose(system, "frequency", 1), 1e-6
    unknowns = equation.unknowns(balanced)
    for name in NAMES:
        equation = method.pose(system, name, 1)
        here, value = equation.evaluate(unknowns, system[name]), system[name]
        up, down = (equation.evaluate(unknowns, value + each).residual for each in (step, -step))
        np.testing.assert_allclose(here.by_parameter, (up - down) / (2 * step), atol=1e-7, err_msg=name)


def test_the_batch_integrator_agrees_with_the_flow(system: gw.System) -> None:
    states = np.random.default_rng(1).uniform(-1.0, 1.0, (64, 4))
    run = batch_flow_of(system, BatchOptions(error=1e-5)).run(states, 3)
    flow, coefficients = flow_of(system), coefficients_of(system)
    exact = np.array([flow.integrate(coefficients, state, 0.0, 3 * PERIOD).state for state in states])
    assert run.error <= 1e-5
    np.testing.assert_allclose(run.states, exact, atol=2e-4)
    frequencies = np.linspace(0.7, 0.9, 64)  # the load then differs from lane to lane
    run = batch_flow_of(system, BatchOptions(error=1e-5)).run(states, 1, parameters={"frequency": frequencies})
    for state, frequency, found in zip(states[:8], frequencies, run.states, strict=False):
        each = system.at(frequency=frequency)
        np.testing.assert_allclose(found, flow_of(each).integrate(coefficients_of(each), state).state, atol=2e-4)


def test_equilibria_and_modes_know_the_law() -> None:
    stages = [gw.Stage(0.3, 2.0, side=gw.Side.POSITIVE, numbers={"bend": 3.0})]
    stop = gw.Contact("stop", {"x": 1.0}, stages, law="quadratic", drag=0.4)
    system = gw.System(["x"], [[0.5]], [[0.1]], contacts=[stop], mean={"x": 1.0})
    (rest,) = find_equilibria(system).equilibria
    x = brentq(lambda x: 0.5 * x + 2.0 * (x - 0.3) + 3.0 * (x - 0.3) ** 2 - 1.0, 0.3, 2.0)
    assert rest.position[0] == pytest.approx(x, rel=1e-10)
    assert rest.stiffness[0, 0] == pytest.approx(2.5 + 6.0 * (x - 0.3), rel=1e-9)
    assert rest.damping[0, 0] == pytest.approx(0.1 + 0.4 * (x - 0.3) ** 2, rel=1e-9)


YIELDING = MODEL.replace("quadratic", "yielding").replace("bend = 3.0\ndrag", "fading")


@pytest.mark.slow
@pytest.mark.parametrize("text", [MODEL, in_campaign(YIELDING)])
def test_a_study_runs_is_kept_and_drawn(tmp_path: Path, text: str) -> None:
    """In a process of its own, as a user would who imports the law and the load and then calls the command line."""
    file = tmp_path / "toy.toml"
    file.write_text(text)
    out = file.with_suffix(".gapwalk")
    calls = (
        ["check", str(file)],
        ["run", str(file), "--output", str(out)],
        ["show", str(out)],
        ["modes", str(file)],
        ["verify", str(out)],
        ["export", str(out), "--format", "png"],
    )
    program = "import sys, tests.toys.quadratic, tests.toys.unbalance, tests.toys.yielding\n"
    program += "from gapwalk.cli import main\n"
    program += "".join(f"if main({words}): sys.exit('{words[0]} failed')\n" for words in calls)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    result = gw.open_result(out)
    assert result.system == gw.read_study(file).system


def _yielding(**numbers: float) -> gw.System:
    stop = gw.Contact("stop", {"x": 1.0}, [gw.Stage(0.3, 2.0)], law=yielding.Yielding(), **numbers)
    return gw.System(["x"], [[0.5]], [[0.1]], contacts=[stop], harmonics=[gw.Harmonic(0.6, {"x": 1.0})])


@pytest.mark.parametrize("sampled", SAMPLED)
def test_a_law_that_is_no_polynomial_has_exact_derivatives_and_branches(sampled: int) -> None:
    """Its force jumps with the rate where the stage closes, so derivatives pass the events by the general rule."""
    system, state = _yielding(fading=0.4), np.array([0.5, 0.8])
    names = ("frequency", "stop.fading", "stop.clearance", "stop.stiffness")
    directions = np.array([ParameterLine(system, name).coefficients(system[name])[1] for name in names])
    arc = flow_of(system, *names, transition=True).integrate(coefficients_of(system), state, direction=directions)
    assert arc.contacts

    def end(start, each=system) -> np.ndarray:
        return flow_of(each).integrate(coefficients_of(each), start).state

    step = 1e-5
    differences = [(end(state + step * unit) - end(state - step * unit)) / (2 * step) for unit in np.eye(2)]
    np.testing.assert_allclose(arc.transition, np.transpose(differences), atol=2e-8)
    for name, column in zip(names, arc.sensitivity.T, strict=True):
        up, down = (system.at({name: system[name] + each}) for each in (step, -step))
        np.testing.assert_allclose(column, (end(state, up) - end(state, down)) / (2 * step), atol=2e-8, err_msg=name)
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.2)
    assert branch.points[-1].value == pytest.approx(1.2)
    assert verified(branch, sampled).ok


def test_the_batch_integrator_carries_a_law_that_is_no_polynomial_and_jumps() -> None:
    system = _yielding(fading=0.4)
    states = np.random.default_rng(0).normal(size=(20, 2)) * 0.6
    run = batch_flow_of(system, BatchOptions(error=1e-5)).run(states, 2)
    flow, coefficients = flow_of(system), coefficients_of(system)
    ends = [flow.integrate(coefficients, state, 0.0, 2 * PERIOD).state for state in states]
    assert run.states == pytest.approx(np.array(ends), abs=3e-4)


def test_what_a_backend_cannot_carry_it_refuses_by_name() -> None:
    system = _yielding()
    with pytest.raises(ModelError, match="cannot include 'stop': its force law 'yielding' is not a polynomial"):
        gw.find_orbit(system, method=gw.Balance())


def test_a_law_that_is_no_polynomial_has_equilibria() -> None:
    """Its force is k xi / (1 + xi^2) on top of 0.5 x: bracketed by SciPy, with the slope by hand."""
    system = _yielding(fading=0.4).at({"mean.x": 0.9})

    def left(x: float) -> float:
        return 0.5 * x + 2.0 * (x - 0.3) / (1.0 + (x - 0.3) ** 2) - 0.9

    root = brentq(left, 0.3, 1.0, xtol=1e-15)
    rest = find_equilibria(system)
    (one,) = rest.equilibria
    assert (one.position[0], rest.complete) == (pytest.approx(root, abs=1e-14), False)
    depth = root - 0.3
    assert one.stiffness.item() == pytest.approx(0.5 + 2.0 * (1.0 - depth**2) / (1.0 + depth**2) ** 2, rel=1e-13)
    assert one.damping.item() == pytest.approx(0.1 + 0.4 / (1.0 + depth**2), rel=1e-13)


def test_drive_trains_know_the_law_and_the_load(tmp_path: Path) -> None:
    inertias = [gw.train.Inertia("a", 1.0), gw.train.Inertia("b", 2.0)]
    stage = gw.Stage(0.3, 2.0, numbers={"bend": 2.0})
    shaft = gw.train.Shaft("s", ("a", "b"), damping=0.1, law="quadratic", drag=0.4, stages=[stage])
    loads = [unbalance.Unbalance(0.5, {"a": 1.0})]
    system = gw.train.Train(inertias, [shaft], mean={"a": 0.1, "b": -0.1}, harmonics=loads, frequency=0.8).system()
    (tmp_path / "train.toml").write_text("""\
frequency = 0.8
mean = { a = 0.1, b = -0.1 }
inertia = [{ name = "a", inertia = 1.0 }, { name = "b", inertia = 2.0 }]
unbalance = [{ moment = 0.5, acts_on = { a = 1.0 } }]

[[shaft]]
name = "s"
between = ["a", "b"]
damping = 0.1
law = "quadratic"
drag = 0.4
stage = [{ clearance = 0.3, stiffness = 2.0, bend = 2.0 }]
""")
    assert read_system(tmp_path / "train.toml") == system
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.9)
    assert gw.verify(branch).ok


@pytest.mark.parametrize(
    ("whole", "of_stages", "message"),
    [
        ("damping", (CLEARANCE,), "has a parameter 'damping', but that is another key of its table"),
        ("stiffness", (CLEARANCE,), "has a parameter 'stiffness', but that is another key"),
        ("own", (CLEARANCE, Parameter("side", None, "it is a side")), "has a parameter 'side', but that is another"),
        ("own", (), "the first is the clearance"),
    ],
)
def test_a_law_whose_tables_could_not_be_read_is_not_registered(whole: str, of_stages, message: str) -> None:
    class Clash(Law):
        name, words = "clash", "a law that names its parameters badly"
        parameters = (Parameter(whole, LAWS["viscous"].parameters[0].kind if whole == "damping" else None, "it is"),)
        stage_parameters = of_stages

        def force(self, rate, stages, numbers):
            return numbers[whole] * stages.total(s.closed * s.depth for s in stages)

    with pytest.raises(ModelError, match=message):
        register(Clash())
    assert "clash" not in LAWS


@pytest.mark.parametrize(
    ("registry", "name", "words"), [(LAWS, "quadratic", "force law"), (LOADS, "unbalance", "load")]
)
def test_a_result_with_a_law_or_load_that_is_not_registered_is_refused_by_name(
    tmp_path: Path, system: gw.System, monkeypatch, registry: dict, name: str, words: str
) -> None:
    kept, path = Part("kept", Kept), tmp_path / "result"
    with ResultFile(path, kept.entry(Kept(system)), exists=False) as file:
        file.write()
    with reading(path) as parts:
        assert parts.one(kept) == Kept(system)
        monkeypatch.delitem(registry, name)
        with pytest.raises(StoreError, match=f"result cannot be read: there is no {words} '{name}'.*Import the module"):
            parts.one(kept)


def test_a_law_that_is_not_registered_is_not_kept(tmp_path: Path, system: gw.System, monkeypatch) -> None:
    monkeypatch.delitem(LAWS, "quadratic")
    with pytest.raises(ModelError, match=r"law: Quadratic\(\) cannot be kept .* a force law that is registered"):
        encode(system, gw.System)
