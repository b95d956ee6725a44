"""States without inertia: Maxwell elements, tyre relaxation, Bouc-Wen, coordinates without mass.

Reference values are closed forms (complex stiffness, eigenvalues of the equations of first order) and motions by SciPy
of equations that are written here, with z as a state of its own.
"""

import io
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.ensemble.batch_flow import batch_flow_of
from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.verification.independent_equations import Equations

K, C, W = 3.0, 0.1, 1.3
CHAIN = ((2.0, 0.5), (0.7, 3.0), (5.0, 0.02))
"""Stiffness and damping of Maxwell elements in parallel: relaxation times of .25, 4.3 and .004."""


def chained(chain=CHAIN, **more) -> gw.System:
    """One mass on a spring beside Maxwell elements."""
    states = [
        gw.State.of("maxwell", f"m{number}", {"x": 1.0}, stiffness=k, damping=c)
        for number, (k, c) in enumerate(chain, start=1)
    ]
    return gw.System(["x"], [[K]], [[C]], **({"harmonics": LOAD, "frequency": W, "states": states} | more))


LOAD = [gw.Harmonic(0.5, {"x": 1.0})]


def line(orbit: gw.Orbit, signal: str, order: int = 1) -> complex:
    motion = gw.integrate(orbit.system, orbit.state, 1, 512)
    return 2.0 * complex(np.mean((motion.signal(signal) * np.exp(-1j * order * motion.theta))[:-1]))


@pytest.mark.parametrize("method", [gw.Shooting(), gw.Balance(5)])
@pytest.mark.parametrize("frequency", [0.3, 1.3, 4.0])
def test_a_chain_has_its_complex_stiffness(frequency: float, method) -> None:
    orbit = gw.find_orbit(chained().at(frequency=frequency), method=method)
    relaxing = [k * 1j * frequency * c / (k + 1j * frequency * c) for k, c in CHAIN]
    x = 0.5 / (K - frequency**2 + 1j * frequency * C + sum(relaxing))
    assert line(orbit, "x") == pytest.approx(x, abs=1e-12)
    k, c = CHAIN[1]
    z = x * k / (k + 1j * frequency * c)
    assert line(orbit, "m2") == pytest.approx(z, abs=1e-12)
    assert line(orbit, "m2'") == pytest.approx(1j * frequency * z, abs=1e-12)
    assert line(orbit, "m2.force") == pytest.approx(k * (x - z), abs=1e-12)


def augmented(chain=CHAIN) -> np.ndarray:
    """Matrix of the equations of first order of x, x' and each z."""
    found = np.zeros((2 + len(chain), 2 + len(chain)))
    found[0, 1], found[1, :2] = 1.0, [-K - sum(k for k, _ in chain), -C]
    for row, (k, c) in enumerate(chain, start=2):
        found[1, row], found[row, 0], found[row, row] = k, k / c, -k / c
    return found


def test_multipliers_and_modes_are_those_of_first_order_equations() -> None:
    system = chained()
    values = np.linalg.eigvals(augmented())
    wanted = np.exp(2.0 * np.pi / W * values)
    found = gw.find_orbit(system).multipliers
    of_the_lags = [math.exp(-2.0 * math.pi)] * 3  # the frequency of the model is W
    for value in [*wanted, *of_the_lags]:
        assert np.abs(found - value).min() < 1e-7
    assert len(found) == len(wanted) + 3
    modes = gw.find_modes(system)
    pair = values[values.imag > 0.0]
    np.testing.assert_allclose(modes.frequencies, np.abs(pair), rtol=1e-12)
    np.testing.assert_allclose(modes.damping_ratios, -pair.real / np.abs(pair), rtol=1e-10)
    assert modes.coordinates == ("x", "m1", "m2", "m3")
    k, c = CHAIN[0]
    assert modes.shapes[1, 0] / modes.shapes[0, 0] == pytest.approx((k / (k + c * pair))[0], rel=1e-10)


def test_a_coordinate_without_mass_is_one_of_first_order() -> None:
    """The same Maxwell element as a node between a spring and a damper, in matrices."""
    k, c = CHAIN[0]
    node = gw.System(["x", "y"], [[K + k, -k], [-k, k]], [C, c], [1.0, 0.0], harmonics=LOAD, frequency=W)
    assert node.coordinates == ("x", "y_lag")
    assert "stiffness.x.y" in node.structure.names
    orbit, other = gw.find_orbit(node), gw.find_orbit(chained(CHAIN[:1]))
    assert line(orbit, "y") == pytest.approx(line(other, "m1"), abs=1e-13)
    np.testing.assert_allclose(np.sort(orbit.multipliers), np.sort(other.multipliers), atol=1e-9)
    stiffer = {"stiffness.x.x": K + 4.0, "stiffness.x.y": -4.0, "stiffness.y.x": -4.0, "stiffness.y.y": 4.0}
    wanted = 0.5 / (K - W**2 + 1j * W * C + 4j * W * c / (4.0 + 1j * W * c))
    assert line(gw.find_orbit(node.at(stiffer)), "x") == pytest.approx(wanted, abs=1e-13)


def test_an_overdamped_coordinate_alone() -> None:
    """c z' + k z = A cos(W t), and a load that acts on it."""
    system = gw.System(["z"], [[2.0]], [[0.5]], [[0.0]], harmonics=[gw.Harmonic(0.3, {"z": 1.0})], frequency=W)
    assert line(gw.find_orbit(system), "z") == pytest.approx(0.3 / (2.0 + 0.5j * W), abs=1e-13)


def test_tyre_relaxation() -> None:
    """A wheel with side slip: (length/speed) F' + F = stiffness v/speed."""
    length, speed, stiffness = 0.4, 12.0, 30.0
    state = gw.State("tyre", "(c*v/V - z)*V/L", {"x": 1.0}, force="z", L=length, V=speed, c=stiffness)
    system = gw.System(["x"], [[K]], [[C]], harmonics=LOAD, frequency=W, states=[state])
    slip = stiffness * 1j * W / speed / (1.0 + 1j * W * length / speed)
    x = 0.5 / (K - W**2 + 1j * W * C + slip)
    orbit = gw.find_orbit(system)
    assert line(orbit, "x") == pytest.approx(x, abs=1e-13)
    assert line(orbit, "tyre") == pytest.approx(slip * x, abs=1e-13)


def bouc_wen(n: int, **more) -> gw.System:
    numbers = {"stiffness": 2.0, "share": 0.2, "A": 1.1, "beta": 0.8, "gamma": 0.5} | more
    state = gw.State.of("bouc_wen", "h", {"x": 1.0}, n=n, **numbers)
    return gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(0.9, {"x": 1.0})], frequency=0.8, states=[state])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_bouc_wen_settles_where_scipy_does(n: int) -> None:
    system = bouc_wen(n)

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v, z = y
        force = 2.0 * (0.2 * x + 0.8 * z)
        slope = 1.1 * v - 0.8 * abs(v) * abs(z) ** (n - 1) * z - 0.5 * v * abs(z) ** n
        return [v, 0.9 * math.cos(0.8 * t) - 0.1 * v - x - force, slope]

    orbit = gw.find_orbit(system)
    motion = gw.integrate(system, orbit.state, 1, 8)
    period = 2.0 * math.pi / 0.8
    start = [motion.q[0, 0], motion.v[0, 0], motion.signal("h")[0]]
    found = solve_ivp(rates, (0.0, period), start, "DOP853", t_eval=motion.time, rtol=1e-12, atol=1e-13)
    for row, signal in enumerate(("x", "x'", "h")):
        np.testing.assert_allclose(found.y[row], motion.signal(signal), atol=1e-9)


@pytest.mark.slow
def test_a_branch_with_bouc_wen_is_verified() -> None:
    assert gw.verify(gw.follow(gw.find_orbit(bouc_wen(2)), "frequency", 0.81)).ok


def random_system(rng: np.random.Generator, numbers: dict[str, float]) -> gw.System:
    """Two masses, a coordinate without mass, two states of which one knows the other, a gap, and formulas of all."""
    moves = {"a": {"x": 1.0, "y": -1.0}, "b": {"y": 1.0}}
    own = {name: numbers[name] for name in ("p", "q1")}
    first = gw.State("s", "(a - z)*p - q1*z*u + W*0.1", moves, force="p*(a - s)*b", acts_on={"y": 1.0}, numbers=own)
    second = gw.State("u", "sin(x') - r*u + g*tanh(s)*y + 0.2*n", r=numbers["r"], g=numbers["g"])
    mass = [[1.3, 0.2, 0.0], [0.2, 0.8, 0.0], [0.0, 0.0, 0.0]]
    return gw.System(
        ["x", "y", "n"],
        numbers["k"] * np.array([[2.0, -0.5, -0.4], [-0.5, 1.5, -0.3], [-0.4, -0.3, 0.9]]),
        numbers["c"] * np.array([[0.3, 0.0, -0.1], [0.0, 0.2, -0.15], [-0.1, -0.15, 0.6]]),
        mass,
        contacts=[
            gw.force(
                "f", {"d": {"x": 1.0, "n": -0.5}, "e": {"u": 1.0}}, "h*d**3 + e", acts_on={"n": 1.0}, h=numbers["h"]
            ),
            gw.backlash("gap", {"x": 1.0}, 0.1, 4.0),
        ],
        mean={"x": 0.1, "n": 0.05},
        harmonics=[gw.Harmonic(0.4, {"x": 1.0, "n": 0.3}), gw.Harmonic(0.2, varies="s.p", order=2)],
        frequency=0.9,
        states=[first, second],
    )


def own_rates(numbers: dict[str, float], w: float, theta: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """x'', y'' and n', s', u' of the random system, from x, y, n, s, u and x', y'."""
    x, y, n, s, u = q
    k, c, p, q1, r, g, h = (numbers[name] for name in ("k", "c", "p", "q1", "r", "g", "h"))
    p = p * (1.0 + 0.2 * np.cos(2.0 * theta))
    load = 0.4 * np.cos(theta)
    f = h * (x - 0.5 * n) ** 3 + u
    damping = c * np.array([[0.3, 0.0, -0.1], [0.0, 0.2, -0.15], [-0.1, -0.15, 0.6]])
    stiffness = k * np.array([[2.0, -0.5, -0.4], [-0.5, 1.5, -0.3], [-0.4, -0.3, 0.9]])
    given = np.array([0.1 + load, 0.0, 0.05 + 0.3 * load]) - stiffness @ q[:3] - damping[:, :2] @ v
    given[2] -= f
    given[1] -= p * (x - y - s) * y
    given[0] -= 4.0 * (max(x - 0.1, 0.0) + min(x + 0.1, 0.0))
    rate = given[2] / damping[2, 2]
    given[:2] -= damping[:2, 2] * rate
    a = np.linalg.solve([[1.3, 0.2], [0.2, 0.8]], given[:2])
    slope = (x - y - s) * p - q1 * s * u + 0.1 * w
    return np.array([*a, rate, slope, np.sin(v[0]) - r * u + g * np.tanh(s) * y + 0.2 * n])


NUMBERS = ("k", "c", "p", "q1", "r", "g", "h")


@pytest.mark.parametrize("seed", range(12))
def test_random_systems_have_the_equations_that_are_written_here(seed: int) -> None:
    rng = np.random.default_rng(seed)
    numbers = dict(zip(NUMBERS, rng.uniform(0.4, 2.0, 7).tolist(), strict=True))
    system = random_system(rng, numbers).at(frequency=1.2)
    lag, layout = 1.0 / 0.9, layout_of(system.structure)
    for _ in range(5):
        q, v, theta = rng.normal(size=5), rng.normal(size=5), rng.uniform(0.0, 6.0)
        states = np.array([*q[:2], *(q[2:] + lag * v[2:])])
        a = accelerations(layout, coefficients_of(system), np.array([theta]), q[None], v[None])[0]
        found = np.array([*a[:2], *(v[2:] + lag * a[2:])])
        wanted = own_rates(numbers, 1.2, theta, states, v[:2])
        np.testing.assert_allclose(found, wanted, atol=1e-10)
        closed = np.array([[1.0 if sign * q[0] > 0.1 else 0.0 for sign in (1, -1)]])
        independent = Equations([system]).rates(np.array([theta]), np.array([[*q, *v, 0.0]]), closed)
        np.testing.assert_allclose(independent[0, 5:10] * 1.2, a, atol=1e-10)


@pytest.mark.parametrize(
    "name", ["s.p", "s.q1", "u.r", "u.g", "f.h", "frequency", "damping.n.n", "stiffness.x.n", "s.a.y"]
)
def test_slopes_by_every_number(name: str) -> None:
    rng = np.random.default_rng(3)
    system = random_system(rng, dict.fromkeys(NUMBERS, 0.9))
    slope = ParameterLine(system, name).coefficients(system[name])[1]
    step = 1e-5 * (1.0 + abs(system[name]))
    ends = [coefficients_of(system.at({name: system[name] + way * step})) for way in (1.0, -1.0)]
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2.0 * step), atol=1e-8)
    assert np.abs(slope).max() > 0.0


def test_the_random_system_moves_as_scipy_integrates_it() -> None:
    rng = np.random.default_rng(5)
    numbers = dict.fromkeys(NUMBERS, 0.9)
    system = random_system(rng, numbers).at(frequency=1.2)
    start = np.array([0.05, 0.1, 0.02, 0.0, 0.1, 0.3, -0.2, 0.0, 0.0, 0.0])
    motion = gw.integrate(system, start, 3, 16)
    names = ("x", "y", "n", "s", "u")

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        found = own_rates(numbers, 1.2, 1.2 * t, state[:5], state[5:])
        return np.array([*state[5:], *found[2:], *found[:2]])

    begin = [*(motion.signal(name)[0] for name in names), *start[5:7]]
    found = solve_ivp(rates, (0.0, motion.time[-1]), begin, "DOP853", t_eval=motion.time, rtol=1e-11, atol=1e-12)
    for row, name in enumerate(names):
        np.testing.assert_allclose(motion.signal(name), found.y[row], atol=1e-7)


FOLDING = """
coordinates = ["x"]
stiffness = [1.0]
damping = [0.02]
frequency = 1.0
[[contact]]
name = "gap"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 1.5
[[maxwell]]
name = "rubber"
deflection = { x = 1.0 }
stiffness = 0.3
damping = 0.05
[[harmonic]]
amplitude = 0.2
acts_on = { x = 1.0 }
[study]
kind = "response"
parameter = "frequency"
from = 1.35
to = 1.05
"""


@pytest.mark.slow
def test_a_branch_with_folds_beside_a_gap_is_verified_and_read_again(tmp_path) -> None:
    study = gw.read_study(io.StringIO(FOLDING))
    path = tmp_path / "result.gapwalk"
    (branch,) = gw.run(study, path).branches
    assert [str(each.kind) for each in branch.special_points].count("fold") == 2
    assert gw.verify(path).ok
    again = gw.open_result(path)
    assert again.system.structure == study.system.structure
    assert again.system.structure.assembly.states == ("rubber",)
    assert again.branches[0].special_points[0].value == branch.special_points[0].value
    assert again.branches[0].special_points[0].orbit.system == branch.special_points[0].orbit.system


def test_harmonic_balance_of_bouc_wen_is_near_shooting() -> None:
    system = bouc_wen(1)
    orbit = gw.find_orbit(system, method=gw.Balance(41))
    assert line(orbit, "x") == pytest.approx(line(gw.find_orbit(system), "x"), abs=2e-5)


def test_a_load_may_vary_a_number_of_a_state() -> None:
    """Of both of its formulas; the number stands once among those of the system."""
    load = gw.Harmonic(0.3, varies="m1.stiffness", order=2)
    system = chained(CHAIN[:1], harmonics=[*LOAD, load])
    assert [name for name in system.structure.names if name.endswith("stiffness")] == ["m1.stiffness"]
    motion = gw.integrate(system, gw.find_orbit(system).state, 1, 64)
    k, c = CHAIN[0]
    k = k * (1.0 + 0.3 * np.cos(2.0 * motion.theta))
    stretched = motion.signal("x") - motion.signal("m1")
    np.testing.assert_allclose(motion.signal("m1.force"), k * stretched, atol=1e-13)
    np.testing.assert_allclose(motion.signal("m1'"), k * stretched / c, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"rate": "(x - z)*k/c"}, "k is missing"),
        ({"rate": "(x - z)*k", "k": 1.0, "kk": 2.0}, "kk, which is none of its numbers"),
        ({"rate": "x - ) z"}, "column 5"),
        ({"rate": "x - z", "force": "a", "a": 1.0}, "neither the state z nor a deflection"),
        ({"rate": "-z'"}, "own rate"),
        ({"rate": "x - z", "k": math.nan}, "finite number"),
    ],
)
def test_states_that_are_refused(given: dict, words: str) -> None:
    rate = given.pop("rate")
    with pytest.raises(ModelError, match=words.replace("(", r"\(")):
        gw.System(["x"], [[1.0]], states=[gw.State("s", rate, {"x": 1.0}, **given)])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"damping": [0.1, 0.0]}, "y has neither inertia nor damping"),
        ({"damping": [0.1, -0.2]}, "is negative"),
        ({"contacts": [gw.backlash("gap", {"y": 1.0}, 0.1, 2.0)]}, "mass gives y no inertia, but gap deflects with it"),
        ({"contacts": [gw.force("f", {"y": 1.0}, "a*v", a=1.0)]}, "depends on the rate of y"),
    ],
)
def test_coordinates_without_mass_that_are_refused(change: dict, words: str) -> None:
    keys = {"stiffness": [[2.0, -1.0], [-1.0, 1.0]], "damping": [0.1, 0.2], "mass": [1.0, 0.0]}
    with pytest.raises(ModelError, match=words):
        gw.System(["x", "y"], **(keys | change))


def test_a_mass_cannot_be_added_later_and_energies_are_refused() -> None:
    node = gw.System(["x", "y"], [[2.0, -1.0], [-1.0, 1.0]], [0.1, 0.2], [1.0, 0.0], harmonics=LOAD)
    with pytest.raises(ModelError, match="made without one"):
        node.at({"mass.y.y": 1.0})
    with pytest.raises(ModelError, match="the energy is not known"):
        gw.analysis.energy(gw.find_orbit(node))


@pytest.mark.slow
def test_the_batch_integrator_and_a_run_up_move_as_scipy_does() -> None:
    """Of many motions at once, and while the speed grows; the lag is that of the speed of the model all the time."""
    system, speeds = chained(CHAIN[:2]), [0.7, 1.3, 2.0]
    still = np.zeros(system.state_size)
    run = batch_flow_of(system).run([still] * 3, 4, parameters={"frequency": speeds})
    for frequency, state in zip(speeds, run.states, strict=True):
        motion = gw.integrate(system.at(frequency=frequency), still, 4, 8)
        np.testing.assert_allclose(state, motion.states[-1], atol=1e-4)
    found = gw.ask.run_up(system, gw.ask.SpeedCourse.ramp(0.8, 1.6, 0.8 / 30.0), state=still, samples=32)
    matrix = augmented(CHAIN[:2])

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        load = 0.5 * math.cos(0.8 * t + 0.4 * t * t / 30.0)
        return matrix @ state + np.array([0.0, load, 0.0, 0.0])

    wanted = solve_ivp(rates, (0.0, 30.0), np.zeros(4), "DOP853", t_eval=found.time[:-1:16], rtol=1e-10, atol=1e-12)
    for row, signal in enumerate(("x", "x'", "m1", "m2")):
        np.testing.assert_allclose(found.signal(signal)[:-1:16], wanted.y[row], atol=1e-5)
