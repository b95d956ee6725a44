"""The energy of orbits: the work of the loads is what elements dissipate, each as a closed form says."""

import math
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.motion import sample
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Rigid
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import read_source
from gapwalk.orbit.energy import energy
from tests.flow.dry_systems import SYSTEMS, beginning, system

H = gw.Harmonic
SEEDS = range(40)
EXAMPLES = Path(__file__).parents[2] / "examples"


def settled(found, periods=60):
    """Return the orbit on which a motion settles."""
    return gw.find_orbit(found, start=sample(found, beginning(found), np.array([0.0, periods * math.tau])).states[-1])


@pytest.mark.parametrize("name", SYSTEMS)
def test_losses_are_the_work_of_the_loads(name):
    book = energy(settled(SYSTEMS[name]))
    assert abs(book.imbalance) < 1e-12
    assert book.supplied > 0.0
    assert all(each.energy >= -1e-15 for each in book.losses if each.kind in ("friction", "impacts"))


def random_system(seed):
    """Return a random system with springs, gaps, friction and impacts, up to three coordinates and varied loads."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    names = ("x", "y", "z")[:n]

    def definite(low, high):
        turned = np.linalg.qr(rng.normal(size=(n, n)))[0]
        matrix = turned @ np.diag(rng.uniform(low, high, n)) @ turned.T
        return (0.5 * (matrix + matrix.T)).tolist()

    def vector():
        return {name: float(value) for name, value in zip(names, rng.choice([-1.0, 1.0, 0.5], n), strict=True)}

    soft = {
        "viscous": {"law": "viscous", "viscous_damping": 0.2},
        "impact": {"law": "hunt-crossley", "impact_damping": 0.3},
        "none": {},
    }
    contacts = [
        Contact("gap", vector(), [Stage(float(rng.uniform(0.1, 0.5)), 2.0)], **soft[str(rng.choice([*soft]))]),
        friction("slide", vector(), float(rng.uniform(0.05, 0.2)), static=float(rng.choice([1.0, 1.3])))
        if rng.random() < 0.5
        else friction("spring", vector(), float(rng.uniform(0.05, 0.2)), stiffness=float(rng.uniform(1.0, 4.0))),
    ]
    if rng.random() < 0.4:
        contacts.append(friction("belt", {names[-1]: 1.0}, 0.1, speed=float(rng.uniform(-0.2, 0.2))))
    if rng.random() < 0.5:
        walls = [Stage(float(rng.uniform(0.3, 0.8)), side=Side.BOTH if rng.random() < 0.5 else Side.POSITIVE)]
        contacts.append(Contact("wall", {names[0]: 1.0}, walls, law=Rigid(), restitution=float(rng.uniform(0.2, 0.8))))
    if rng.random() < 0.4:
        contacts.append(gw.force("drag", {names[0]: 1.0}, "c*v*abs(v)", c=0.1))
    loads = [
        H(float(rng.uniform(0.3, 1.0)), vector(), name="first"),
        H(0.2, vector(), order=2, phase=1.0, name="second"),
    ]
    if rng.random() < 0.4:
        loads.append(H(0.05, varies="gap.deflection", phase=0.4, name="error"))
    if rng.random() < 0.4:
        loads.append(H(0.3, varies="gap.stiffness", phase=0.7, name="mesh"))
    mean = dict.fromkeys(names, 0.1)
    return gw.System(
        names,
        definite(0.5, 3.0),
        definite(0.05, 0.3),
        definite(0.5, 2.0),
        mean=mean,
        contacts=contacts,
        harmonics=loads,
        frequency=float(rng.uniform(0.4, 1.2)),
    )


@pytest.mark.slow
def test_losses_are_the_work_of_the_loads_of_random_systems():
    checked, worst = 0, 0.0
    for seed in SEEDS:
        try:
            orbit = settled(random_system(seed))
        except (ModelError, FlowError, gw.errors.ConvergenceError):
            continue  # two frictions on one deflection, or a motion that does not settle on this period
        if orbit.residual > 1e-10:
            continue
        worst = max(worst, abs(energy(orbit).imbalance))
        checked += 1
    assert checked >= 30
    assert worst < 1e-9


def test_friction_that_turns_dissipates_by_its_travel():
    """Den Hartog's oscillator slips all the time, four amplitudes in a period."""
    found = gw.System(("x",), [[1.0]], contacts=[friction("f", {"x": 1.0}, 0.3)], harmonics=[H(1.0, {"x": 1.0})])
    book = energy(gw.find_orbit(found.at(frequency=0.8)))
    assert book.of("f") == pytest.approx(4.0 * 0.3 * 2.626104875724, rel=1e-11)
    assert book.losses[0].power == pytest.approx(book.of("f") * 0.8 / math.tau, rel=1e-14)
    assert [each.kind for each in (*book.work, *book.losses)] == ["load", "friction"]
    assert book.losses[0].share == pytest.approx(1.0, abs=1e-13)


def test_jenkins_element_dissipates_the_area_of_its_loop():
    orbit = settled(SYSTEMS["jenkins"])
    amplitude, limit, stiffness = orbit.measure("half.x"), 0.3, 2.0
    assert energy(orbit).of("f") == pytest.approx(4.0 * limit * (amplitude - limit / stiffness), rel=1e-11)


def test_linear_oscillator():
    found = gw.System(("x",), [[1.0]], [[0.1]], harmonics=[H(1.0, {"x": 1.0})], frequency=0.7)
    orbit = gw.find_orbit(found)
    book = energy(orbit)
    amplitude = 1.0 / math.hypot(1.0 - 0.7**2, 0.1 * 0.7)
    assert book.of("damping") == pytest.approx(math.pi * 0.1 * 0.7 * amplitude**2, rel=1e-12)
    assert book.duration == pytest.approx(math.tau / 0.7, rel=1e-15)


def test_impact_loses_kinetic_energy():
    orbit = settled(SYSTEMS["impact"])
    book = energy(orbit)
    approach = [event.velocity for event in orbit.events if event.enters]
    assert book.of("w") == pytest.approx(sum(0.5 * (1.0 - 0.8**2) * v**2 for v in approach), rel=1e-11)


def test_belt_gives_what_friction_dissipates_beyond_its_load():
    """Steady sliding on a belt: the friction dissipates limit times the speed of the belt, which the belt gives."""
    found = system(("x",), [[1.0]], [friction("f", {"x": 1.0}, 0.5, speed=5.0)], loads=[gw.Harmonic(0.3, {"x": 1.0})])
    book = energy(gw.find_orbit(found))
    given = next(each for each in book.work if each.kind == "moving base")
    assert given.power == pytest.approx(0.5 * 5.0, rel=1e-12)
    assert book.of("f") == pytest.approx(given.energy, rel=1e-11)


def test_displacement_and_varying_stiffness_do_work():
    mesh = Contact("mesh", {"x": 1.0}, [Stage(0.4, 3.0)], law="viscous", viscous_damping=0.2)
    loads = [
        H(0.6, {"x": 1.0}),
        H(0.1, varies="mesh.deflection", name="error"),
        H(0.3, varies="mesh.stiffness", name="k"),
    ]
    found = gw.System(("x",), [[1.0]], [[0.1]], contacts=[mesh], harmonics=loads, frequency=0.5)
    book = energy(gw.find_orbit(found))
    assert abs(book.imbalance) < 1e-13
    kinds = {each.kind: each.energy for each in book.work}
    assert {*kinds} == {"load", "displacement", "variation"}
    assert all(abs(value) > 1e-4 for value in kinds.values())


def test_work_of_a_moving_wall():
    """A rigid stop that moves does work at impacts, and while it is held."""
    wall = Contact("w", {"x": 1.0}, [Stage(0.1, side=Side.POSITIVE)], law=Rigid(), restitution=0.5)
    loads = [H(1.0, {"x": 1.0}), H(0.05, varies="w.deflection", phase=0.6, name="sway")]
    found = gw.System(("x",), [[0.2]], [[0.1]], contacts=[wall], harmonics=loads, frequency=0.3)
    orbit = settled(found)
    book = energy(orbit)
    assert orbit.motion().modes.held.any()
    assert abs(book.imbalance) < 1e-12
    assert abs(next(each for each in book.work if each.kind == "displacement").energy) > 1e-3


def test_equations_divided_by_masses_have_an_energy():
    """In the clutch of figure 13 the contact acts on both coordinates; its energy is that of the inertias."""
    stage = [Stage(1.0, 1.0)]
    push, law = {"q1": 0.9, "q3": -0.54}, {"law": "hunt-crossley", "impact_damping": 0.05}
    found = gw.System(
        ("q1", "q3"),
        [[0.1, -0.6], [-0.06, 1.1]],
        [[0.04, -0.04], [-0.04, 0.06]],
        mean={"q1": 0.25, "q3": 0.25},
        contacts=[Contact("stage2", {"q1": 1.0}, stage, force=push, **law)],
        harmonics=[H(0.25, {"q1": 1.0})],
        frequency=0.6,
    )
    book = energy(gw.find_orbit(found))
    assert abs(book.imbalance) < 1e-11
    assert {each.kind for each in book.losses} == {"damping"}


def test_energy_is_refused_where_it_is_unknown():
    found = gw.System(
        ("x", "y"),
        [[1.0, 0.0], [0.0, 2.0]],
        [[0.1, 0.0], [0.0, 0.1]],
        [[1.0, 0.5], [0.1, 1.0]],
        harmonics=[H(1.0, {"x": 1.0})],
        frequency=0.4,
    )
    with pytest.raises(ModelError, match="mass matrix is not symmetric"):
        energy(gw.find_orbit(found))
    balanced = gw.find_orbit(SYSTEMS["jenkins"].at(frequency=0.5), method=gw.Balance(5, error=1.0))
    with pytest.raises(ModelError, match="neglects higher harmonics"):
        energy(balanced)
    with pytest.raises(ModelError, match="no element named 'brake' loses energy"):
        energy(settled(SYSTEMS["jenkins"])).of("brake")


def test_energy_describes_itself():
    book = energy(settled(SYSTEMS["belt"]))
    text = str(book.summary())
    assert "moving base" in text
    assert "work less losses" in text
    assert book.to_dict()["losses"][1]["element"] == "f"
    work = list(book.tables()["work"]())
    assert work[0] == ["element", "kind", "energy", "power", "share"]
    assert len(work) == 3


@pytest.mark.parametrize("name", ["train", "drivetrain", "reducer", "mesh"])
def test_losses_of_trains_are_those_of_their_links(name):
    """In the first one, gears vibrate two thousand times in a period of the excitation."""
    found = check_model(read_source(EXAMPLES / f"{name}.toml"))[0].system
    book = energy(gw.find_orbit(found))
    assert abs(book.imbalance) < 1e-11
