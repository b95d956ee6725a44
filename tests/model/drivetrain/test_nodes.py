"""Parts of a train without inertia, beside equations in absolute angles that are written here."""

import io

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.train import Drag, Gear, Inertia, Shaft, Train


def line(orbit: gw.Orbit, signal: str) -> complex:
    motion = gw.integrate(orbit.system, orbit.state, 1, 128)
    return 2.0 * complex(np.mean((motion.signal(signal) * np.exp(-1j * motion.theta))[:-1]))


@pytest.mark.parametrize("held", [True, False])
def test_a_maxwell_element_of_two_shafts_and_a_node(held: bool) -> None:
    """A spring in series with a damper beside a shaft: complex stiffness, torques and angles in closed form."""
    shafts = [
        Shaft("main", ("a", "ground" if held else "b"), stiffness=3.0, damping=0.1),
        Shaft("spring", ("a", "node"), stiffness=2.0),
        Shaft("damper", ("node", "ground" if held else "b"), damping=0.5),
    ]
    inertias = [Inertia("a", 1.0), Inertia("node", 0.0), *([] if held else [Inertia("b", 2.0)])]
    w = 1.3
    system = Train(inertias, shafts, harmonics=[gw.Harmonic(0.5, {"a": 1.0})], frequency=w).system()
    orbit = gw.find_orbit(system)
    stiffness = 3.0 + 0.1j * w + 2.0j * w * 0.5 / (2.0 + 0.5j * w)
    inertia = 1.0 if held else 2.0 / 3.0  # of a, or reduced
    twist = 0.5 * inertia / (stiffness - w * w * inertia)
    torque = twist * 2.0j * w * 0.5 / (2.0 + 0.5j * w)
    for signal in ("spring.torque", "damper.torque"):
        assert line(orbit, signal) == pytest.approx(torque, abs=1e-12)
    assert line(orbit, "main.torque") == pytest.approx(twist * (3.0 + 0.1j * w), abs=1e-12)
    turned = twist if held else (0.5 - torque - twist * (3.0 + 0.1j * w)) / -(w * w)
    assert line(orbit, "a.angle") == pytest.approx(turned, abs=1e-12)
    assert line(orbit, "node.angle") == pytest.approx(turned - torque / 2.0, abs=1e-12)
    assert line(orbit, "node.speed") == pytest.approx(1j * w * (turned - torque / 2.0), abs=1e-12)


def random_train(rng: np.random.Generator, *, turns: bool) -> tuple[Train, dict]:
    """Inertias 0, 2, 4 on a tree of shafts and gears with nodes 1 and 3 without inertia, a loop, a gap and drags."""
    names = ["j0", "n1", "j2", "n3", "j4"]
    inertia = [*rng.uniform(0.5, 2.0, 5)]
    inertia[1] = inertia[3] = 0.0
    ratio = float(rng.uniform(0.5, 2.0))
    linear = [(0, 1, 1.0), (1, 2, ratio), (2, 3, 1.0), (3, 4, 1.0), (1, 3, ratio)]
    k, c = rng.uniform(1.0, 4.0, 5), rng.uniform(0.1, 0.6, 5)
    links: list = []
    for number, (first, second, each) in enumerate(linear):
        name, between = f"l{number}", (names[first], names[second])
        numbers = {"stiffness": float(k[number]), "damping": float(c[number])}
        links.append(Shaft(name, between, **numbers) if each == 1.0 else Gear(name, between, each, **numbers))
    gap = Gear("gap", ("j0", "j4"), ratio, stiffness=5.0, clearance=0.1, damping=0.05)
    drags = [Drag("oil", ("j4", "ground"), linear=0.3), Drag("seal", ("j2", "j0"), linear=0.2)] if turns else []
    train = Train(
        [Inertia(*each) for each in zip(names, inertia, strict=True)],
        [each for each in links if isinstance(each, Shaft)],
        [*(each for each in links if isinstance(each, Gear)), gap],
        drags=drags,
        frequency=1.1,
        harmonics=[gw.Harmonic(0.7, {"j0": 1.0, "n1": 0.4})],
        reaction="j4" if turns else None,
    )
    return train, {"J": np.array(inertia), "linear": linear, "k": k, "c": c, "ratio": ratio, "turns": turns}


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_random_trains_with_nodes_have_the_equations_in_absolute_angles(seed: int, turns: bool) -> None:
    rng = np.random.default_rng(seed)
    train, given = random_train(rng, turns=turns)
    system = train.system()
    n, layout, coefficients = system.size, layout_of(system.structure), coefficients_of(system)
    assembly = system.structure.assembly
    numbers, lagging = assembly.numbers(system.values), assembly.lagging(system.values)
    for _ in range(3):
        q, v, theta = rng.normal(size=n), rng.normal(size=n), float(rng.uniform(0.0, 6.0))
        if turns:
            q[-1] = v[-1] = 0.0  # beside the torque that holds the mean
        a = accelerations(layout, coefficients, np.array([theta]), q[None], v[None])[0]
        angle, speed = (
            numbers.angles @ (q + lagging @ v),
            numbers.angles @ (v + lagging @ a),
        )
        torque = np.zeros(5)
        torque[0], torque[1] = 0.7 * np.cos(theta), 0.28 * np.cos(theta)
        for (first, second, ratio), k, c in zip(given["linear"], given["k"], given["c"], strict=True):
            found = k * (angle[first] - ratio * angle[second]) + c * (speed[first] - ratio * speed[second])
            torque[first] -= found
            torque[second] += ratio * found
        x, rate = angle[0] - given["ratio"] * angle[4], speed[0] - given["ratio"] * speed[4]
        found = 5.0 * (max(x - 0.1, 0.0) + min(x + 0.1, 0.0)) + 0.05 * rate
        torque[0] -= found
        torque[4] += given["ratio"] * found
        moved = numbers.angles @ a
        if turns:  # the drags at the mean speeds, 1.1 of j0, are balanced by the reaction
            speeds = 1.1 * np.array([1.0, 1.0, 1.0 / given["ratio"], 1.0 / given["ratio"], 1.0 / given["ratio"]])
            dragged, steady = (
                np.array([seal, 0.0, -seal, 0.0, -0.3 * each[4]])
                for each in (speeds + speed, speeds)
                for seal in [0.2 * (each[2] - each[0])]
            )
            torque += dragged
            torque[4] -= speeds @ steady / speeds[4]
        else:  # a free train turns as a whole beside its coordinates
            moved = moved + numbers.turning @ [1.0, 0.7 * np.cos(theta)]
        np.testing.assert_allclose(torque[[1, 3]], 0.0, atol=1e-10)
        np.testing.assert_allclose((given["J"] * moved)[[0, 2, 4]], torque[[0, 2, 4]], atol=1e-9)


def test_slopes_by_numbers_of_a_train_with_nodes() -> None:
    train, _ = random_train(np.random.default_rng(2), turns=True)
    system = train.system()
    for name in ("l0.stiffness", "l3.damping", "j4.inertia", "oil.linear", "frequency", "harmonic1.acts_on.n1"):
        slope = ParameterLine(system, name).coefficients(system[name])[1]
        step = 1e-5 * (1.0 + abs(system[name]))
        ends = [coefficients_of(system.at({name: system[name] + way * step})) for way in (1.0, -1.0)]
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2.0 * step), atol=2e-8 * (1.0 + np.abs(slope).max()))


@pytest.mark.slow
def test_harmonic_balance_equals_shooting() -> None:
    train, _ = random_train(np.random.default_rng(1), turns=False)
    first = gw.find_orbit(train.system())
    other = gw.find_orbit(train.system(), method=gw.Balance(31))
    assert line(other, "gap.torque") == pytest.approx(line(first, "gap.torque"), abs=1e-4)
    assert line(other, "n3.speed") == pytest.approx(line(first, "n3.speed"), abs=1e-4)


MODEL = """
reaction = "vehicle"
speed = "800 rpm"
mean = { engine = "10 N m" }
[[inertia]]
name = "engine"
inertia = "0.1 kg m^2"
[[inertia]]
name = "node"
inertia = "0 kg m^2"
[[inertia]]
name = "vehicle"
inertia = "20 kg m^2"
[[shaft]]
name = "clutch"
between = ["engine", "node"]
stiffness = "1000 N m/rad"
damping = "1 N m s/rad"
[[shaft]]
name = "hub"
between = ["node", "vehicle"]
stiffness = "3000 N m/rad"
[[harmonic]]
order = 2
amplitude = "50 N m"
acts_on = { engine = 1.0 }
[study]
kind = "settle"
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('damping = "1 N m s/rad"', "", "join them in series, as one shaft with stiffness = 750"),
        ('stiffness = "3000 N m/rad"', 'stiffness = "3000 N m/rad"\nclearance = "1 deg"', "must be > 0 beside hub"),
        ('inertia = "0 kg m^2"', 'inertia = "-1 kg m^2"', "it must be >= 0"),
    ],
)
def test_nodes_that_are_refused(old: str, new: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        gw.read_study(io.StringIO(MODEL.replace(old, new, 1)))


def test_a_node_in_units_and_an_inertia_that_comes_later() -> None:
    system = gw.read_study(io.StringIO(MODEL)).system
    motion = gw.integrate(system, gw.find_orbit(system).state, 1, 64)
    np.testing.assert_allclose(motion.signal("clutch.torque"), motion.signal("hub.torque"), atol=1e-10)
    with pytest.raises(ModelError, match="made without it"):
        system.at({"node.inertia": "0.1 kg m^2"})


def test_a_part_that_hangs_on_a_gap_alone_has_no_torque() -> None:
    loose = """
[[inertia]]
name = "loose"
inertia = "0 kg m^2"
[[gear]]
name = "mesh"
between = ["engine", "loose"]
ratio = 0.8
stiffness = "1e5 N m/rad"
damping = "1 N m s/rad"
clearance = "0.05 deg"
"""
    system = gw.read_study(io.StringIO(MODEL.replace("[[harmonic]]", loose + "[[harmonic]]", 1))).system
    orbit = gw.find_orbit(system)
    assert not orbit.events
    assert np.abs(gw.integrate(system, orbit.state, 1, 32).signal("mesh.torque")).max() < 1e-9
