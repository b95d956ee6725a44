"""Where systems rest: compared with closed forms, and by forces that are computed in another way."""

from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.model.equilibria import Rest
from tests.independent import contact_force
from tests.systems import clutch

GEAR = Path(__file__).parents[2] / "examples" / "gear.toml"


def unbalanced(system: gw.System, x) -> float:
    """The largest static force that is left over at a position."""
    values, names = system.equations.parameters, system.coordinates
    force = np.array([values[f"mean.{name}"] for name in names]) - system.matrix("stiffness") @ x
    for form in system.structure.contacts:
        e = np.array([values[f"{form.name}.deflection.{name}"] for name in names])
        which = "deflection" if form.reciprocal else "force"
        d = np.array([values[f"{form.name}.{which}.{name}"] for name in names])
        force -= contact_force(form, values, e @ x, 0.0) * d
    return float(np.abs(force).max())


def positions(rest: Rest) -> list[list[float]]:
    return sorted(each.position.tolist() for each in rest.equilibria)


def test_a_loaded_gear_pair_rests_on_its_teeth() -> None:
    system = gw.read_study(GEAR).system
    (rest,) = gw.find_equilibria(system).equilibria
    assert rest.position == pytest.approx([1.0 + 0.1])
    assert (str(rest), rest.loose, rest.stable) == ("mesh closed+", 0, True)
    assert rest.contacts[0].force == pytest.approx(0.1)
    (back,) = gw.find_equilibria(system.at({"mean.x": -0.2})).equilibria
    assert back.position == pytest.approx([-1.2])
    assert str(back) == "mesh closed-"


def test_without_load_it_lies_free_in_its_gap() -> None:
    (rest,) = gw.find_equilibria(gw.read_study(GEAR).system.at({"mean.x": 0.0})).equilibria
    assert (str(rest), rest.loose) == ("mesh open, free to move in 1 direction", 1)
    assert abs(rest.position[0]) <= 1.0


def test_what_nothing_holds_rests_nowhere() -> None:
    stop = gw.Contact("stop", {"x": 1.0}, (gw.Stage(0.5, 3.0, side=gw.Side.POSITIVE),))
    system = gw.System(["x"], [[0.0]], contacts=[stop], mean={"x": -0.1})
    assert not gw.find_equilibria(system)
    assert positions(gw.find_equilibria(system.at({"mean.x": 0.3}))) == [pytest.approx([0.6])]


@pytest.mark.parametrize(("load", "text"), [(0.25, "stage2 closed+"), (0.05, "stage2 open"), (-0.3, "stage2 closed-")])
def test_a_clutch_in_the_paper_s_unsymmetric_form(load: float, text: str) -> None:
    system = clutch().at({"mean.q1": load, "mean.q3": load / 8})
    rest = gw.find_equilibria(system)
    assert rest.complete
    (one,) = rest.equilibria
    assert str(one) == text
    assert unbalanced(system, one.position) < 1e-14


def test_of_a_snap_through_all_three_positions_are_found() -> None:
    stop = gw.backlash("stop", {"x": 1.0}, 0.5, 3.0)
    rest = gw.find_equilibria(gw.System(["x"], [[-1.0]], contacts=[stop]))
    assert rest.complete
    assert positions(rest) == [pytest.approx([-0.75]), pytest.approx([0.0]), pytest.approx([0.75])]
    assert [each.stable for each in rest.equilibria] == [True, True, False]
    assert str(rest.equilibria[2]) == "stop open, unstable"


def test_softening_springs_are_tried_in_each_combination() -> None:
    soft = (gw.Stage(0.0, 2.0, name="a"), gw.Stage(1.0, -3.0, name="b"), gw.Stage(2.0, 5.0, name="c"))
    system = gw.System(["x"], [[0.0]], contacts=[gw.Contact("spring", {"x": 1.0}, soft)], mean={"x": 1.5})
    # 2 x = 1.5; 2 x - 3 (x - 1) = 1.5; 2 x - 3 (x - 1) + 5 (x - 2) = 1.5
    assert positions(gw.find_equilibria(system)) == [pytest.approx([x]) for x in (0.75, 1.5, 2.125)]


def test_what_is_free_to_move_is_put_into_its_gaps() -> None:
    pair = gw.Contact("pair", {"a": 1.0, "b": -1.0}, (gw.Stage(1.0, 2.0),), {"a": 0.9, "b": -0.9})
    gap = gw.backlash("gap", {"a": 1.0}, 0.1, 50.0)
    system = gw.System(["a", "b"], np.zeros((2, 2)), contacts=[pair, gap], mean={"a": 7.2, "b": -7.2})
    rest = gw.find_equilibria(system).equilibria
    assert [each.loose for each in rest if each.contacts[1].is_open] == [1]
    for each in rest:
        assert unbalanced(system, each.position) < 1e-12
        assert each.contacts[0].deflection == pytest.approx(5.0)


def test_many_contacts_of_a_chain_are_no_hindrance() -> None:
    random = np.random.default_rng(3)
    train = gw.train.chain(30, 1.0, 4.0, held=True)
    for number in range(1, 31, 2):
        train = train.replaced(f"shaft{number}", clearance=float(random.uniform(0.01, 0.1)), cubic=float(number % 3))
    loads = {f"mean.disc{number}": float(random.normal()) for number in range(1, 31)}
    system = train.system().at(loads)
    rest = gw.find_equilibria(system)
    assert rest.complete
    (one,) = rest.equilibria
    # from the free end on, each shaft carries all torques before it
    carried = np.cumsum([loads[f"mean.disc{number}"] for number in range(1, 31)])
    for number, (torque, twist) in enumerate(zip(carried, one.position, strict=True), start=1):
        clearance = system[f"shaft{number}.clearance"] if number % 2 else 0.0
        cubic = float(number % 3) if number % 2 else 0.0
        depth = max(abs(twist) - clearance, 0.0) * np.sign(twist)
        assert 4.0 * depth + cubic * depth**3 == pytest.approx(torque, rel=1e-9)


def test_units_do_not_matter() -> None:
    for scale in (1e-9, 1e9):
        system = gw.read_study(GEAR).system.at({"mesh.clearance": scale, "mean.x": 0.1 * scale})
        assert positions(gw.find_equilibria(system)) == [pytest.approx([1.1 * scale])]
        stiff = gw.read_study(GEAR).system.at({"mesh.stiffness": scale, "mean.x": 0.1 * scale})
        assert positions(gw.find_equilibria(stiff)) == [pytest.approx([1.1])]


def test_of_very_many_combinations_a_way_through_them_is_gone() -> None:
    n = 9
    names = [f"x{number}" for number in range(n)]
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    gaps = [gw.backlash(f"gap{name}", {name: 1.0}, 0.1, 3.0, force={name: 1.1}) for name in names]  # no energy
    system = gw.System(names, stiffness, contacts=gaps, mean={"x2": 4.0, "x6": -3.0})
    rest = gw.find_equilibria(system)
    assert not rest.complete
    assert [unbalanced(system, each.position) < 1e-13 for each in rest.equilibria] == [True]


def test_negative_damping_is_not_stable() -> None:
    mesh = gw.Contact(
        "mesh", {"x": 1.0}, (gw.Stage(0.1, 9.0),), None, "hunt-crossley-as-printed", {"impact_damping": 0.3}
    )
    system = gw.System(["x"], [[1.0]], contacts=[mesh], mean={"x": 1.0})
    assert gw.find_equilibria(system).equilibria[0].stable
    back = gw.find_equilibria(system.at({"mean.x": -1.0})).equilibria[0]
    assert not back.stable  # as printed, it feeds energy in there


@pytest.mark.parametrize("law", ["k*(x**3 - 3*x**2 + 3*x - 1)", "k*(x**5 - 5*x**4 + 10*x**3 - 10*x**2 + 5*x - 1)"])
def test_a_multiple_root_is_a_rest(law: str) -> None:
    """There the slopes of the terms cancel each other but for rounding."""
    system = gw.System(["x"], [0.0], [0.1], contacts=[gw.force("spring", {"x": 1.0}, law, k=1.0)])
    found = gw.find_equilibria(system)
    assert [float(each.position[0]) for each in found.equilibria] == pytest.approx([1.0], rel=1e-3)
    assert found.complete


@pytest.mark.parametrize(("load", "stiffness", "known"), [(1.3, 2.0, 0), (0.5, 2.0, 1), (1.3, -0.2, 0), (4.0, -0.2, 1)])
def test_a_rest_within_a_jump_is_not_denied(load: float, stiffness: float, known: int) -> None:
    """At load 1.3 the mass rests on the breakpoint, where the stage pushes back with .3 of its .7."""
    stage = gw.Stage(1.0, stiffness, numbers={"preload": 0.7})
    stop = gw.Contact("stop", {"x": 1.0}, [stage], law="piecewise")
    found = gw.find_equilibria(gw.System(["x"], [1.0], [0.1], contacts=[stop], mean={"x": load}))
    assert len(found.equilibria) == known
    assert found.complete is (known == 1 and stiffness > 0.0)  # of a convex energy it is the only one
    assert any("(stop) is not computed" in note for note in found.notes) is not found.complete
