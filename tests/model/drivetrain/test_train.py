"""Drive trains become the equations of motion that one would write down by hand, whatever their parts."""

import copy
import pickle

import numpy as np
import pytest
from scipy.linalg import eigh

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.model import System
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.results.codec import WholeSystem, parameters_of, system_of
from tests.results.again import again


def branched(**changes) -> gw.train.Train:
    """Seven bodies: a rigid gear, elastic ones, a branch, a loop of two shafts in parallel, three clearances."""
    given = {
        "inertias": [gw.train.Inertia(name, value) for name, value in
                     [("a", 0.3), ("b", 0.02), ("c", 0.05), ("d", 0.4), ("e", 1.7), ("f", 0.6), ("g", 0.09)]],
        "shafts": [
            gw.train.Shaft("clutch", ("a", "b"), stiffness=8.0, damping=0.05, stages=(gw.Stage(0.1, 30.0, 2.0),)),
            gw.train.Shaft("half", ("e", "d"), stiffness=11.0, damping=0.02),
            gw.train.Shaft("spline", ("d", "e"), stiffness=50.0, clearance=0.02, viscous_damping=0.3),
            gw.train.Shaft("branch", ("b", "f"), stiffness=5.0),
        ],
        "gears": [
            gw.train.Gear("rigid", ("b", "c"), 1.25),
            gw.train.Gear("mesh", ("d", "c"), -0.4, stiffness=70.0, damping=0.01, clearance=0.03, impact_damping=0.2),
            gw.train.Gear("side", ("c", "g"), 2.5, stiffness=20.0),
        ],
        "mean": {"a": 1.5, "e": -0.7},
        "harmonics": [gw.Harmonic(0.6, {"a": 1.0, "g": -0.5}, 2, 0.3, "firing")],
        "frequency": 1.3,
    }  # fmt: skip
    return gw.train.Train(**(given | changes))


def rates_by_hand(train: gw.train.Train, angle, speed, t: float) -> dict[str, float]:
    """Accelerations of all deflections, body by body: the rigid gear by its Lagrange multiplier."""
    names = [inertia.name for inertia in train.inertias]
    size = len(names)
    torque = np.array([train.mean.get(name, 0.0) for name in names])
    for each in train.harmonics:
        factor = each.amplitude * np.cos(each.order * train.frequency * t + each.phase)
        torque += factor * np.array([each.acts_on.get(name, 0.0) for name in names])
    pulls, rigid = {}, []
    for link in (*train.shafts, *train.gears):
        row = np.zeros(size)
        row[names.index(link.between[0])] = 1.0
        if link.between[1] != "ground":
            row[names.index(link.between[1])] = -getattr(link, "ratio", 1.0)
        pulls[link.name] = row
        if link.stiffness is None and not link.stages and isinstance(link, gw.train.Gear):
            rigid.append(row)
            continue
        x, v = row @ angle, row @ speed
        force = link.damping * v
        stages = list(link.stages)
        if link.clearance is None:
            force += (link.stiffness or 0.0) * x
        else:
            stages.insert(0, gw.Stage(link.clearance, link.stiffness, link.cubic))
        spring = 0.0
        for stage in stages:
            depth = np.sign(x) * max(abs(x) - stage.clearance, 0.0)
            spring += stage.stiffness * depth + stage.cubic * depth**3
        touches = any(abs(x) > stage.clearance for stage in stages)
        impact, viscous = (link.numbers.get(f"{kind}_damping", 0.0) for kind in ("impact", "viscous"))
        force += spring + impact * abs(spring) * v + viscous * v * touches
        torque -= force * row
    constraints = np.array(rigid).reshape(len(rigid), size)
    inertia = np.diag([each.inertia for each in train.inertias])
    none = np.zeros((len(rigid), len(rigid)))
    matrix = np.block([[inertia, constraints.T], [constraints, none]])
    acceleration = np.linalg.solve(matrix, np.concatenate((torque, np.zeros(len(rigid)))))[:size]
    return {name: float(row @ acceleration) for name, row in pulls.items()}


def consistent(train: gw.train.Train, seed: int):
    """Random angles or speeds of all inertias that respect the rigid gears, and the deflections of all links."""
    random = np.random.default_rng(seed)
    turned = dict(zip([each.name for each in train.inertias], random.normal(0, 0.2, len(train.inertias)), strict=True))
    body = {name: name for name in turned}
    for gear in train.gears:  # in a tree each rigid gear joins two bodies that had nothing to do with each other
        if gear.is_rigid:
            first, second = gear.between
            factor = turned[first] / (gear.ratio * turned[second])
            moved = body[second]
            for name in [each for each in body if body[each] == moved]:
                turned[name] *= factor
                body[name] = body[first]
    turned["ground"] = 0.0
    deflections = {
        link.name: turned[link.between[0]] - getattr(link, "ratio", 1.0) * turned[link.between[1]]
        for link in (*train.shafts, *train.gears)
    }
    turned.pop("ground")
    return np.array([*turned.values()]), deflections


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_equations_are_those_written_body_by_body(seed: int, held: bool) -> None:
    train = branched()
    if held:
        walls = [gw.train.Shaft("wall", ("f", "ground"), stiffness=3.0, damping=0.4),
                 gw.train.Shaft("other", ("a", "ground"), stiffness=2.0, clearance=0.01)]  # fmt: skip
        train = branched(shafts=[*train.shafts, *walls])
    system = train.system()
    assert system.size == (7 - 1 - 1 if not held else 7 - 1)
    angle, x = consistent(train, seed)
    speed, v = consistent(train, seed + 10)
    q, rate = ([each[name] for name in system.coordinates] for each in (x, v))
    expected = rates_by_hand(train, angle, speed, 0.9)
    coefficients = coefficients_of(system)
    found = accelerations(layout_of(system.structure), coefficients, 0.9 * 1.3, np.array(q), np.array(rate))
    assert found == pytest.approx([expected[name] for name in system.coordinates], rel=1e-11)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("first", [False, True])
def test_a_drag_closes_a_loop_wherever_it_stands_in_the_list(first: bool, held: bool) -> None:
    drags = [gw.train.Shaft("bearing", ("a", "f"), damping=0.3)]
    if held:
        wall = gw.train.Shaft("wall", ("f", "ground"), stiffness=3.0)
        drags = [gw.train.Shaft("oil", ("a", "ground"), damping=0.2), *drags, wall]
    given = branched().shafts
    train = branched(shafts=[*drags, *given] if first else [*given, *drags])
    system = train.system()
    assert "bearing" not in system.coordinates
    angle, x = consistent(train, 1)
    speed, v = consistent(train, 11)
    q, rate = (np.array([each[name] for name in system.coordinates]) for each in (x, v))
    expected = rates_by_hand(train, angle, speed, 0.9)
    found = accelerations(layout_of(system.structure), coefficients_of(system), 0.9 * 1.3, q, rate)
    assert found == pytest.approx([expected[name] for name in system.coordinates], rel=1e-11)
    assert again(system).coordinates == system.coordinates


def random_tree(seed: int) -> gw.train.Train:
    """A tree of up to eight bodies in random order, with rigid and elastic links, free or held at one or two places."""
    random = np.random.default_rng(seed)
    names = [f"b{number}" for number in range(int(random.integers(2, 9)))]
    shafts, gears = [gw.train.Shaft("first", (names[0], names[1]), stiffness=4.0, damping=0.3)], []
    for number, name in enumerate(names[2:], start=2):
        ends = [name, names[int(random.integers(number))]]
        random.shuffle(ends)
        pair, ratio = (ends[0], ends[1]), float(random.choice([-1, 1]) * random.uniform(0.3, 3))
        springs = {"stiffness": float(random.uniform(1, 9)), "clearance": random.choice([None, 0.05])}
        match int(random.integers(3)):
            case 0:
                gears.append(gw.train.Gear(f"rigid{number}", pair, ratio))
            case 1:
                gears.append(gw.train.Gear(f"gear{number}", pair, ratio, **springs, damping=0.1))
            case _:
                shafts.append(gw.train.Shaft(f"shaft{number}", pair, **springs))
    for number in range(int(random.integers(3))):
        shafts.append(gw.train.Shaft(f"wall{number}", (str(random.choice(names)), "ground"), stiffness=2.0 + number))
    inertias = [gw.train.Inertia(name, float(random.uniform(0.1, 5))) for name in names]
    return gw.train.Train(inertias, shafts, gears, {names[-1]: 0.7}, [gw.Harmonic(0.4, {names[0]: 1.0})], frequency=1.3)


@pytest.mark.parametrize("seed", range(40))
def test_so_are_those_of_any_tree(seed: int) -> None:
    train = random_tree(seed)
    system = train.system()
    angle, x = consistent(train, seed)
    speed, v = consistent(train, seed + 1000)
    q, rate = ([each[name] for name in system.coordinates] for each in (x, v))
    expected = rates_by_hand(train, angle, speed, 0.9)
    coefficients = coefficients_of(system)
    found = accelerations(layout_of(system.structure), coefficients, 0.9 * 1.3, np.array(q), np.array(rate))
    assert found == pytest.approx([expected[name] for name in system.coordinates], rel=1e-10, abs=1e-10)
    equations = System.from_values(system.structure.equations, system.equations.values)
    assert coefficients_of(equations) == pytest.approx(coefficients, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(30))
def test_so_are_those_of_any_tree_of_which_drags_alone_join_parts(seed: int) -> None:
    train, random = random_tree(seed), np.random.default_rng(seed)
    drags = ("first", *(shaft.name for shaft in train.shafts if "shaft" in shaft.name and random.random() < 0.5))
    for name in drags:
        train = train.replaced(name, stiffness=None, clearance=None, damping=float(random.uniform(0.1, 2.0)))
    system = train.system()
    slips = [name.endswith("_slip") for name in system.coordinates]
    angle, x = consistent(train, seed)
    speed, v = consistent(train, seed + 1000)
    parts = [name.removesuffix("_slip") for name in system.coordinates]
    q, rate = (np.array([each[name] for name in parts]) for each in (x, v))
    expected = rates_by_hand(train, angle, speed, 0.9)
    leaks = system.structure.assembly.numbers(system.values).leaks
    assert [leak > 0.0 for leak in leaks] == slips
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    found = accelerations(layout, coefficients, 0.9 * 1.3, q, rate - leaks * q) + leaks * (rate - leaks * q)
    assert found == pytest.approx([expected[name] for name in parts], rel=1e-10, abs=1e-10)
    equations = System.from_values(system.structure.equations, system.equations.values)
    assert coefficients_of(equations) == pytest.approx(coefficients, rel=1e-9, abs=1e-9)


def test_the_symmetric_form_says_the_same() -> None:
    system = branched().system()
    equations = System.from_values(system.structure.equations, system.equations.values)
    assert coefficients_of(equations) == pytest.approx(coefficients_of(system), rel=1e-11, abs=1e-11)
    for which in ("mass", "damping", "stiffness"):
        np.testing.assert_allclose(system.matrix(which), system.matrix(which).T, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("name", [*branched().system().structure.names])
def test_every_number_of_a_part_may_vary(name: str) -> None:
    system = branched(shafts=[*branched().shafts, gw.train.Shaft("wall", ("g", "ground"), stiffness=3.0)]).system()
    value = system[name]
    step = 1e-5 * max(abs(value), 0.1)
    exact = ParameterLine(system, name).coefficients(value)[1]
    values = [system.values.copy() for _ in range(2)]
    for sign, each in zip((1, -1), values, strict=True):
        each[system.structure.place(name)] += sign * step
    ends = [coefficients_of(System.from_values(system.structure, each)) for each in values]
    assert exact == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6, abs=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize("count", [2, 5, 40])
def test_a_free_chain_vibrates_as_the_closed_form_says(count: int) -> None:
    system = gw.train.chain(count, 0.7, 3.0).system()
    expected = 2 * np.sqrt(3.0 / 0.7) * np.sin(np.arange(1, count) * np.pi / (2 * count))
    assert gw.find_modes(system).frequencies == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("count", [1, 5, 40])
def test_so_does_a_chain_held_at_its_end(count: int) -> None:
    system = gw.train.chain(count, 0.7, 3.0, held=True).system()
    expected = 2 * np.sqrt(3.0 / 0.7) * np.sin((2 * np.arange(count) + 1) * np.pi / (2 * (2 * count + 1)))
    assert gw.find_modes(system).frequencies == pytest.approx(expected, rel=1e-12)


def test_three_inertias_in_line_are_those_of_the_paper() -> None:
    one, two, three, first, second, drag, beta = 0.2, 0.03, 1.1, 4.0, 7.0, 0.05, 0.3
    train = gw.train.Train(
        [gw.train.Inertia("I1", one), gw.train.Inertia("I2", two), gw.train.Inertia("I3", three)],
        [
            gw.train.Shaft(
                "q1", ("I1", "I2"), stiffness=first, damping=drag, stages=(gw.Stage(0.1, 40.0),), impact_damping=beta
            ),
            gw.train.Shaft("q3", ("I2", "I3"), stiffness=second),
        ],
        mean={"I1": 0.9, "I3": -0.9},
        harmonics=[gw.Harmonic(0.5, {"I1": 1.0})],
        frequency=11.0,
    )
    # equations (1) to (18): divided by the reduced inertias, the force of the second stage in both equations
    a, b = one * two / (one + two), two * three / (two + three)
    contact = gw.Contact(
        "q1",
        {"q1": 1.0},
        (gw.Stage(0.1, 40.0, name="stage2"),),
        {"q1": 1 / a, "q3": -1 / two},
        "hunt-crossley",
        {"impact_damping": beta},
    )
    by_hand = gw.System(
        ["q1", "q3"],
        stiffness=[[first / a, -second / two], [-first / two, second / b]],
        damping=[[drag / a, 0.0], [-drag / two, 0.0]],
        contacts=[contact],
        mean={"q1": 0.9 / one, "q3": 0.9 / three},
        harmonics=[gw.Harmonic(0.5, {"q1": 1 / one})],
        frequency=11.0,
    )
    system = train.system()
    assert coefficients_of(system) == pytest.approx(coefficients_of(by_hand), rel=1e-13)
    ours, theirs = (gw.find_orbit(each) for each in (system, by_hand))
    assert ours.state == pytest.approx(theirs.state, rel=1e-8)
    assert ours.multipliers == pytest.approx(theirs.multipliers, rel=1e-6)
    assert ours.pattern == theirs.pattern


def test_a_rigid_gear_reflects_what_is_behind_it() -> None:
    geared = gw.train.Train(
        [
            gw.train.Inertia("a", 0.3),
            gw.train.Inertia("b", 0.02),
            gw.train.Inertia("c", 0.5),
            gw.train.Inertia("d", 0.8),
        ],
        [gw.train.Shaft("in_", ("a", "b"), stiffness=8.0), gw.train.Shaft("out", ("c", "d"), stiffness=90.0)],
        [gw.train.Gear("pair", ("b", "c"), -3.0)],
    )
    ratio = -3.0
    reflected = gw.train.Train(
        [
            gw.train.Inertia("a", 0.3),
            gw.train.Inertia("b", 0.02 + 0.5 / ratio**2),
            gw.train.Inertia("d", 0.8 / ratio**2),
        ],
        [
            gw.train.Shaft("in_", ("a", "b"), stiffness=8.0),
            gw.train.Shaft("out", ("b", "d"), stiffness=90.0 / ratio**2),
        ],
    )
    ours, theirs = (gw.find_modes(each.system()) for each in (geared, reflected))
    assert ours.frequencies == pytest.approx(theirs.frequencies, rel=1e-13)
    assert geared.system().at({"pair.ratio": 2.0}) != geared.system()


def test_zeros_stay_zeros_so_a_chain_has_few_coefficients() -> None:
    system = gw.train.chain(60, 0.7, 3.0, 0.1).system()
    assert np.count_nonzero(coefficients_of(system)) == 1 + 2 * (3 * 59 - 2)  # 1/W, two tridiagonal matrices


def test_an_unbalanced_train_accelerates_and_its_deflections_carry_that() -> None:
    train = gw.train.chain(3, 2.0, 5.0)
    loaded = gw.train.Train(train.inertias, train.shafts, mean={"disc1": 6.0}).system()
    assembly = loaded.structure.assembly
    assert isinstance(assembly, TrainAssembly)
    numbers = assembly.numbers(loaded.values)
    np.testing.assert_allclose(numbers.turning[:, 0], 1.0)
    assert numbers.unbalanced == pytest.approx(6.0, rel=1e-14)
    (rest,) = gw.find_equilibria(loaded).equilibria
    assert rest.position == pytest.approx([4.0 / 5.0, 2.0 / 5.0])  # each shaft accelerates what is behind it


def test_a_reaction_keeps_the_balance_through_gears() -> None:
    train = gw.train.Train(
        [gw.train.Inertia("a", 1.0), gw.train.Inertia("b", 2.0)],
        gears=[gw.train.Gear("mesh", ("a", "b"), 4.0, stiffness=10.0)],
        mean={"a": 3.0},
        reaction="b",
    )
    system = train.system()
    assert "mean.b" not in system.structure.names
    for load in (3.0, 5.0):
        (rest,) = gw.find_equilibria(system.at({"mean.a": load})).equilibria
        assert rest.position == pytest.approx([load / 10.0])


def test_one_part_may_be_replaced() -> None:
    train = gw.train.chain(4, 1.0, 2.0).replaced("shaft2", clearance=0.1)
    assert [contact.name for contact in train.system().structure.contacts] == ["shaft2"]
    assert train.system()["shaft2.clearance"] == 0.1
    assert train.replaced("disc3", inertia=9.0).system()["disc3.inertia"] == 9.0
    with pytest.raises(ModelError, match="no part 'shaft22'; did you mean shaft2"):
        train.replaced("shaft22", clearance=0.1)


def two(**changes) -> gw.train.Train:
    given = {
        "inertias": [gw.train.Inertia("a", 1.0), gw.train.Inertia("b", 2.0), gw.train.Inertia("c", 3.0)],
        "shafts": [gw.train.Shaft("ab", ("a", "b"), stiffness=1.0), gw.train.Shaft("bc", ("b", "c"), stiffness=1.0)],
    }
    return gw.train.Train(**(given | changes))


AB, BC = two().shafts
Gear, Inertia = gw.train.Gear, gw.train.Inertia


def beside(name: str, between: tuple[str, str] = ("b", "c"), **numbers) -> dict[str, list[gw.train.Shaft]]:
    """The shaft ab, and another one."""
    return {"shafts": [AB, gw.train.Shaft(name, between, **numbers)]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inertias": []}, "inertias is empty"),
        ({"shafts": []}, "neither shafts nor gears"),
        (beside("bc", ("b", "d"), stiffness=1.0), "bc joins 'd', which is no inertia; they are a"),
        ({"shafts": [AB]}, "c is not connected to a"),
        (beside("bc", ("b", "ground"), stiffness=1.0), "c is not connected to the ground"),
        (beside("bc", ("b", "b"), stiffness=1.0), "bc joins b to itself"),
        (beside("bc", ("ground", "c"), stiffness=1.0), "write the ground second"),
        (beside("ab", stiffness=1.0), "ab has the name ab of another part"),
        (beside("a", stiffness=1.0), "a has the name a of another part"),
        (beside("mean", stiffness=1.0), "mean is taken as a name"),
        (beside("b c", stiffness=1.0), "shaft name 'b c': write a word"),
        (beside("bc"), "bc has no stiffness; write stiffness = ..."),
        (beside("bc", stiffness=0.0), "bc.stiffness is 0; it must be > 0"),
        (beside("bc", clearance=0.1), "bc has a clearance, but no stiffness beyond it"),
        (beside("bc", stiffness=1.0, damping=-1.0), "bc.damping is -1; it must be >= 0"),
        (beside("bc", stiffness=1.0, impact_damping=0.1), "bc has impact_damping, but no clearance"),
        (beside("bc", stages=(gw.Stage(0.2), gw.Stage(0.1))), "bc is refused: stages out of order"),
        (beside("bc", stiffness=1.0, clearance=-0.1), "clearance is -0.1"),
        ({"shafts": [AB], "gears": [Gear("bc", ("b", "c"), 0.0)]}, "bc.ratio is 0; it must be the speed of"),
        ({"shafts": [AB, BC], "gears": [Gear("ac", ("a", "ground"), 2.0)]}, "a gear joins two inertias"),
        ({"shafts": [AB], "gears": [Gear("bc", ("b", "c"), 2.0, damping=1.0)]}, "bc has damping, but no stiffness"),
        (
            {"shafts": [AB, BC], "gears": [Gear("ac", ("a", "c"), 2.0, stiffness=1.0)]},
            "ac closes a loop, and its ratio is 2, but by the other way round it is 1: the train is locked",
        ),
        (
            {"shafts": [BC], "gears": [Gear("one", ("a", "b"), 2.0), Gear("two", ("b", "a"), 2.0)]},
            "two closes a loop, and its ratio is 2, but by the other way round it is 0.5",
        ),
        (
            {
                "shafts": [AB, BC, gw.train.Shaft("wall", ("a", "ground"), stiffness=1.0)],
                "gears": [Gear("ac", ("a", "c"), 2.0, stiffness=1.0)],
            },
            "ac closes a loop, and its ratio is 2, but by the other way round it is 1: the train is locked",
        ),
        ({"gears": [Gear("rigid", ("a", "b"), 1.0)]}, "ab never deflects"),
        ({"shafts": [], "gears": [Gear("ab", ("a", "b"), 2.0), Gear("bc", ("b", "c"), 2.0)]}, "nothing vibrates"),
        (
            {"inertias": [Inertia("a", 0.0), *two().inertias[1:]]},
            "a.inertia is 0, and ab alone holds it, so that no torque acts there",
        ),
        ({"inertias": [Inertia("a", "1"), *two().inertias[1:]]}, "a.inertia is '1'; it must be a number"),
        ({"inertias": [Inertia("a", np.nan), *two().inertias[1:]]}, "a.inertia is nan; it must be a finite number"),
        ({"mean": {"d": 1.0}}, "mean names 'd', which is no inertia; they are a, b, c"),
        ({"harmonics": [gw.Harmonic(1.0, {"d": 1.0})]}, "harmonic1.acts_on names 'd', which is no inertia"),
        ({"reaction": "d"}, "reaction is 'd', which is no inertia"),
        ({"reaction": "c", "mean": {"c": 1.0}}, "mean.c and reaction = 'c' are both given"),
        (
            {
                "reaction": "c",
                "shafts": [
                    AB,
                    gw.train.Shaft("wall", ("c", "ground"), stiffness=1.0),
                    gw.train.Shaft("floor", ("a", "ground"), stiffness=1.0),
                ],
            },
            "reaction is 'c', but the ground alone joins a to another part of the train",
        ),
        ({"frequency": 0.0}, "frequency is 0.0; it must be > 0"),
        (beside("c", damping=0.1), "c has the name c of another part"),
        (
            {
                "shafts": [
                    gw.train.Shaft("bc_slip", ("a", "b"), stiffness=1.0),
                    gw.train.Shaft("bc", ("b", "c"), damping=0.1),
                ]
            },
            "bc_slip names the slip of bc; choose another one for the part",
        ),
    ],
)
def test_a_mistake_has_one_sentence(changes, message: str) -> None:
    with pytest.raises(ModelError) as error:
        two(**changes)
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_what_cannot_be_is_refused_later_too() -> None:
    system = branched().system()
    with pytest.raises(ModelError, match=r"a\.inertia is -1; it must be > 0"):
        system.at({"a.inertia": -1.0})
    with pytest.raises(ModelError, match=r"did you mean 'spline\.clearance'"):
        system.at({"spline.clearence": 1.0})
    with pytest.raises(ModelError, match=r"spline\.clearance is -1\.0; it must be >= 0"):
        system.at({"spline.clearance": -1.0})


def test_the_ratios_on_a_loop_are_no_parameters() -> None:
    train = two(gears=[gw.train.Gear("ac", ("a", "c"), 1.0, stiffness=2.0)]).system()
    assert "ac.ratio" not in train.structure.names
    assert train.coordinates == ("ab", "bc")
    inertia = np.diag([1.0, 2.0, 3.0])
    stiffness = np.array([[3.0, -1.0, -2.0], [-1.0, 2.0, -1.0], [-2.0, -1.0, 3.0]])
    squares = eigh(stiffness, inertia, eigvals_only=True)
    assert gw.find_modes(train).frequencies ** 2 == pytest.approx(squares[1:], rel=1e-12)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda system: pickle.loads(pickle.dumps(system))])
def test_copies_are_equal(duplicate) -> None:
    system = branched().system()
    assert duplicate(system) == system
    assert hash(duplicate(system).structure) == hash(system.structure)


def test_a_train_survives_a_file_of_results() -> None:
    for train in (branched(), two(gears=[gw.train.Gear("ac", ("a", "c"), 1.0, stiffness=2.0)], reaction="b")):
        system = train.system()
        assert again(system) == system
        parameters = parameters_of(system)
        parameters.pop("frequency")
        with pytest.raises(ValueError, match="not those"):
            system_of(WholeSystem(system.structure, parameters))


def test_ratios_of_a_long_train_multiply_without_a_limit() -> None:
    """The last inertia turns 1e20 times slower than the first, and the elimination must not take that for rounding."""
    inertias = [Inertia(f"i{number}", 1.0) for number in range(31)]
    shaft = gw.train.Shaft("s", ("i0", "i1"), stiffness=1.0)
    gears = [Gear(f"g{k}", (f"i{k}", f"i{k + 1}"), 5.0, stiffness=1.0) for k in range(1, 30)]
    system = gw.train.Train(inertias, [shaft], gears).system()
    assert system.structure.assembly.numbers(system.values).speeds[-1] == pytest.approx(5.0**-29, rel=1e-12)
