"""The drawing of a machine: what connects what, by the numbers of the model, and texts that do not meet."""

from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from benchmarks.chain import chain
from gapwalk.model.system import System
from gapwalk.plot.machine.elements import BASE, Machine, length_of, svg_of
from gapwalk.plot.machine.layout import NARROW, WIDE, machine_of, scene_of
from gapwalk.studies import read_studies
from tests.model.drivetrain.test_train import random_tree

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("clutch", "train", "idle", "belt", "impact_damper", "pendulum", "rod", "reducer", "rub", "damper", "bearing")


def system_of(name: str) -> System:
    return read_studies(EXAMPLES / f"{name}.toml")[0].system


def row(machine: Machine, number: int, size: int) -> np.ndarray:
    found = np.zeros(size)
    for place, factor in machine.bodies[number].row if number != BASE else ():
        found[place] = factor
    return found


@pytest.mark.parametrize("name", [*NAMES, *range(8)])
def test_a_gap_closes_on_the_drawing_where_it_does_in_the_equations(name) -> None:
    system = random_tree(name).system() if isinstance(name, int) else system_of(name)
    machine, drawn = machine_of(system), 0
    for link in machine.links:
        moved = row(machine, link.ends[0], system.size) - row(machine, link.ends[1], system.size)
        for contact in {each.contact for each in link.elements if each.contact}:
            form = next(each for each in system.structure.contacts if each.name == contact)
            deflection = system.vector(form.vectors[0])
            factor = (deflection @ moved) / (moved @ moved)
            np.testing.assert_allclose(deflection, factor * moved, atol=1e-9 * abs(factor))
            assert np.sign(factor) == link.sign
            drawn += 1
    assert drawn == len(system.structure.contacts)


def test_springs_are_those_of_the_stiffness_matrix() -> None:
    k = {("base", "a"): 3.0, ("a", "b"): 2.0, ("b", "c"): 5.0, ("base", "c"): -0.5}
    stiffness = [[5.0, -2.0, 0.0], [-2.0, 7.0, -5.0], [0.0, -5.0, 4.5]]
    for masses in (np.ones(3), np.array([1.0, 2.0, 4.0])):  # as it is, and divided by the masses
        system = gw.System(["a", "b", "c"], np.array(stiffness) / masses[:, None])
        machine = machine_of(system)
        names = [*(body.name for body in machine.bodies), "base"]
        found = {
            tuple(sorted((names[i], names[j]))): float(each.words.split(", ")[1])
            for (i, j), each in ((link.ends, each) for link in machine.links for each in link.elements)
        }
        assert found == {tuple(sorted(ends)): pytest.approx(value) for ends, value in k.items()}
        assert [body.mass for body in machine.bodies] == pytest.approx(masses / masses[0] * machine.bodies[0].mass)


def test_a_clutch_of_relative_coordinates_is_a_chain_of_inertias() -> None:
    """Padmanabhan and Singh, section 2.2: 1/J1 : 1/J2 : 1/J3 = .36 : .54 : .45 give the matrices of figure 13."""
    machine = machine_of(system_of("clutch"))
    inverse = np.array([1.0 / body.mass for body in machine.bodies])
    np.testing.assert_allclose(inverse / inverse[0], np.array([0.36, 0.54, 0.45]) / 0.36, rtol=1e-9)
    # no momentum, and the coordinates are the differences of neighbours
    rows = np.array([row(machine, k, 2) for k in range(3)])
    np.testing.assert_allclose((1.0 / inverse) @ rows, 0.0, atol=1e-12)
    np.testing.assert_allclose(rows[:-1] - rows[1:], np.eye(2), atol=1e-12)
    assert [body.loads for body in machine.bodies] == [("harmonic1", "mean"), (), ("mean",)]


def test_a_bracket_that_no_chain_explains_is_drawn_as_coupled_coordinates() -> None:
    system = gw.System(["a", "b"], [[2.0, -1.0], [0.5, 1.0]])
    machine = machine_of(system)
    assert "not symmetric" in machine.notes[0]
    assert [each.kind for link in machine.links for each in link.elements] == ["coupling", "spring", "spring"]


def test_of_many_coordinates_only_the_contacts_are_drawn() -> None:
    whole = chain(100)
    machine = machine_of(whole)
    assert [body.name for body in machine.bodies] == ["x100"]
    assert "100 coordinates" in machine.notes[0]
    assert machine.bodies[0].loads == ("harmonic1",)


def text_boxes(system: System, width: float) -> list[tuple[float, float, float, float]]:
    found = []
    for shape in scene_of(system, width).shapes:
        if shape.kind == "text" and shape.text:
            (point,), long = shape.points, length_of(shape.text)
            left = point.x - (0.0 if shape.anchor == "start" else 0.5 * long)
            found.append((left, point.y - 8.0, left + long, point.y + 2.5))
    return found


@pytest.mark.parametrize("width", [NARROW, WIDE])
@pytest.mark.parametrize("name", [*NAMES, "chain"])
def test_texts_are_inside_and_do_not_meet(name, width) -> None:
    system = chain(10) if name == "chain" else system_of(name)
    boxes, scene = text_boxes(system, width), scene_of(system, width)
    assert all(x0 >= 0.0 and x1 <= width and y0 >= 0.0 and y1 <= scene.height for x0, y0, x1, y1 in boxes)
    meet = [
        (a, b)
        for k, a in enumerate(boxes)
        for b in boxes[:k]
        if min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])
    ]
    assert meet == []


def test_every_link_is_drawn_once_in_a_tree_with_branches_and_loops() -> None:
    rng = np.random.default_rng(7)
    for size in (2, 5, 9, 14):
        stiffness = np.zeros((size, size))
        for i, j in {tuple(sorted(rng.choice(size, 2, replace=False).tolist())) for _ in range(2 * size)}:
            stiffness[i, j] = stiffness[j, i] = -1.0
        stiffness += np.diag(-stiffness.sum(axis=1) + (rng.random(size) < 0.3))
        system = gw.System([f"q{k}" for k in range(size)], stiffness)
        machine, scene = machine_of(system), scene_of(system, NARROW)
        springs = [part.words for part in scene.parts if part.kind == "spring"]
        assert sorted(springs) == sorted(each.words for link in machine.links for each in link.elements)
        bodies = [part.name for part in scene.parts if part.kind == "body" and "goes on" not in part.words]
        assert sorted(bodies) == sorted(system.coordinates)


def test_svg_says_what_there_is() -> None:
    text = svg_of(scene_of(system_of("idle")))
    assert "<title>Machine: flywheel, hub, gear; contacts 2nd stage, 3rd stage, mesh</title>" in text
    assert "mesh: spring with a gap of ±0.1 deg" in text
    assert text.count("<svg") == text.count("</svg>") == 1
    assert text.count("<g>") == text.count("</g>")


@pytest.mark.parametrize("name", ["train", "idle", "clutch", *range(4)])
def test_the_arrow_of_a_load_points_where_it_alone_would_accelerate_its_body(name) -> None:
    system = random_tree(name).system() if isinstance(name, int) else system_of(name)
    machine, plain, drawn = machine_of(system), system.equations, 0
    for load in plain.structure.driving:
        pushed = [(k, push) for k, body in enumerate(machine.bodies) for push in body.pushes if push.name == load.name]
        acceleration = np.linalg.solve(plain.matrix("mass"), plain.vector(load.shape))
        for number, push in pushed if len(pushed) == 1 else ():
            assert np.sign(row(machine, number, system.size) @ acceleration) == push.way
            drawn += 1
    assert drawn or isinstance(name, int)


def test_loads_on_coordinates_point_along_them_and_say_their_order_if_they_have_no_name() -> None:
    loads = [
        gw.Harmonic(1.0, {"a": -1.0}),
        gw.Harmonic(1.0, {"a": -1.0, "b": 2.0}, order=3),
        gw.Harmonic(0.1, {"b": -1.0}, order=2, name="mesh"),
    ]
    machine = machine_of(gw.System(["a", "b"], [[2.0, -1.0], [-1.0, 1.0]], harmonics=loads))
    a, b = ([(push.label, push.way) for push in body.pushes] for body in machine.bodies)
    assert a == [("order 1", -1), ("order 3", -1)]
    assert b == [("order 3", 1), ("mesh", -1)]
    scene = scene_of(gw.System(["a", "b"], [[2.0, -1.0], [-1.0, 1.0]], harmonics=loads))
    heads = [[point.x for point in each.points] for each in scene.shapes if each.look == "load-head"]
    assert [tip < min(rest) for tip, *rest in heads] == [True, True, False]  # a: left; b: both
