"""A system is a frozen value of named parameters that refuses what cannot be."""

import copy
import pickle

import numpy as np
import pytest

from gapwalk.errors import ModelError
from gapwalk.model import Contact, Harmonic, Side, Stage, System, backlash

STIFFNESS = [[0.1, -0.6], [-0.06, 1.1]]


def make(**changes) -> System:
    given = {
        "coordinates": ["q1", "q3"],
        "stiffness": STIFFNESS,
        "damping": [[0.04, -0.03], [-0.02, 0.06]],
        "contacts": [backlash("stage2", {"q1": 1.0}, 1.0, force={"q1": 0.9, "q3": -0.54}, impact_damping=0.05)],
        "mean": {"q1": 0.25, "q3": 0.5},
        "harmonics": [Harmonic(0.25, {"q1": 1.0}, phase=0.1)],
        "frequency": 0.5,
    }
    return System(**(given | changes))


def test_every_number_is_a_named_parameter() -> None:
    assert dict(make().parameters) == {
        "frequency": 0.5,
        "mass.q1.q1": 1.0, "mass.q1.q3": 0.0, "mass.q3.q1": 0.0, "mass.q3.q3": 1.0,
        "damping.q1.q1": 0.04, "damping.q1.q3": -0.03, "damping.q3.q1": -0.02, "damping.q3.q3": 0.06,
        "stiffness.q1.q1": 0.1, "stiffness.q1.q3": -0.6, "stiffness.q3.q1": -0.06, "stiffness.q3.q3": 1.1,
        "mean.q1": 0.25, "mean.q3": 0.5,
        "harmonic1.amplitude": 0.25, "harmonic1.phase": 0.1,
        "harmonic1.acts_on.q1": 1.0, "harmonic1.acts_on.q3": 0.0,
        "stage2.deflection.q1": 1.0, "stage2.deflection.q3": 0.0,
        "stage2.force.q1": 0.9, "stage2.force.q3": -0.54,
        "stage2.clearance": 1.0, "stage2.stiffness": 1.0, "stage2.cubic": 0.0,
        "stage2.impact_damping": 0.05,
    }  # fmt: skip


def test_stages_of_one_contact_have_names_of_their_own() -> None:
    stages = (Stage(1.0, 2.0, name="soft"), Stage(3.0, 4.0, 5.0, Side.POSITIVE, "hard"))
    system = make(contacts=[Contact("clutch", {"q1": 1.0}, stages, law="viscous", viscous_damping=0.2)])
    names = [name for name in system.structure.names if name.startswith("clutch")]
    assert names == [
        "clutch.deflection.q1", "clutch.deflection.q3",
        "clutch.soft.clearance", "clutch.soft.stiffness", "clutch.soft.cubic",
        "clutch.hard.clearance", "clutch.hard.stiffness", "clutch.hard.cubic",
        "clutch.viscous_damping",
    ]  # fmt: skip
    assert system["clutch.hard.cubic"] == 5.0


def test_the_matrices_come_back() -> None:
    system = make()
    np.testing.assert_array_equal(system.matrix("stiffness"), STIFFNESS)
    np.testing.assert_array_equal(system.matrix("damping"), [[0.04, -0.03], [-0.02, 0.06]])
    np.testing.assert_array_equal(system.matrix("mass"), np.eye(2))


def test_at_gives_another_system_of_the_same_structure() -> None:
    system = make()
    other = system.at({"stage2.clearance": 0.5}, frequency=2)
    assert (other["stage2.clearance"], other.frequency) == (0.5, 2.0)
    assert (system["stage2.clearance"], system.frequency) == (1.0, 0.5)
    assert other.structure is system.structure
    changed = {name for name, value in other.parameters.items() if value != system[name]}
    assert changed == {"stage2.clearance", "frequency"}


def test_two_clearances_may_change_places_in_one_change() -> None:
    stages = (Stage(1.0, name="a"), Stage(2.0, name="b"))
    system = make(contacts=[Contact("c", {"q1": 1.0}, stages)])
    assert system.at({"c.a.clearance": 3.0, "c.b.clearance": 4.0})["c.b.clearance"] == 4.0
    with pytest.raises(ModelError, match=r"c\.b\.clearance is 2\.0; it must exceed"):
        system.at({"c.a.clearance": 3.0})
    with pytest.raises(ModelError, match=r"c\.b\.clearance is 1\.0; it must exceed"):
        system.at({"c.b.clearance": 1.0})


def test_equal_systems_are_equal_and_hash_alike() -> None:
    assert make() == make()
    assert hash(make()) == hash(make())
    assert make() != make(frequency=0.6)
    assert make() != make(harmonics=[])
    assert make() != "a system"


def test_a_system_never_changes() -> None:
    system = make()
    with pytest.raises(AttributeError, match="never changes"):
        system.frequency = 1.0
    with pytest.raises(ValueError, match="read-only"):
        system.values[0] = 1.0
    given = np.array(system.values)
    System.from_values(system.structure, given)  # takes the array over, so nobody else may write to it
    with pytest.raises(ValueError, match="read-only"):
        given[0] = 99.0


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda system: pickle.loads(pickle.dumps(system))])
def test_copies_are_equal_and_frozen(duplicate) -> None:
    system = make()
    other = duplicate(system)
    assert other == system
    assert not other.values.flags.writeable


def test_repr_says_what_it_is() -> None:
    assert repr(make()) == "System(coordinates=q1, q3; contacts=stage2; frequency=0.5)"
    assert "contacts=none" in repr(make(contacts=[]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coordinates": []}, "coordinates is empty"),
        ({"coordinates": ["q1", "q1"]}, "coordinate name 'q1' is used twice"),
        ({"coordinates": ["q1", "q 3"]}, "coordinate name 'q 3': write a word"),
        ({"stiffness": [[1.0]]}, "stiffness has shape (1, 1); it must be (2, 2)"),
        ({"damping": [[1.0, 2.0], [3.0]]}, "damping is [[1.0, 2.0], [3.0]]; it must be a matrix"),
        ({"mass": [[1.0, 2.0], [2.0, 4.0]]}, "mass is singular (its rows are [[1.0, 2.0], [2.0, 4.0]])"),
        ({"mass": [[1.0, 0.0], [0.0, -2.0]]}, "mass gives q3 the inertia -2; it must be > 0"),
        ({"mass": [[1.0, 2.0], [2.0, 1.0]]}, "mass is not positive definite (its rows are [[1.0, 2.0], [2.0, 1.0]])"),
        ({"stiffness": [[1.0, np.nan], [0.0, 1.0]]}, "stiffness.q1.q3 is nan; it must be a finite number"),
        ({"mean": {"q2": 1.0}}, "mean names 'q2', which is no coordinate; they are q1, q3"),
        ({"mean": {"q1": np.inf}}, "mean.q1 is inf"),
        ({"frequency": 0.0}, "frequency is 0.0; it must be > 0"),
        ({"frequency": np.nan}, "frequency is nan"),
        ({"harmonics": [Harmonic(1.0, {"x": 1.0})]}, "harmonic1.acts_on names 'x'"),
        ({"harmonics": [Harmonic(1.0, {"q1": 1.0})] * 2}, "harmonic name 'harmonic1' is used twice"),
        ({"harmonics": [Harmonic(1.0, {"q1": 1.0}, name="mean")]}, "harmonic name 'mean' is taken"),
        ({"contacts": [backlash("harmonic1", {"q1": 1.0}, 1.0)]}, "harmonic name 'harmonic1' is taken"),
        ({"contacts": [backlash("a.b", {"q1": 1.0}, 1.0)]}, "contact name 'a.b': write a word"),
        ({"contacts": [backlash("gap", {"x": 1.0}, 1.0)]}, "gap.deflection names 'x'"),
        ({"contacts": [backlash("gap", {"q1": 1.0}, 1.0, force={"x": 1.0})]}, "gap.force names 'x'"),
    ],
)
def test_what_cannot_be_is_refused(changes, message: str) -> None:
    with pytest.raises(ModelError) as error:
        make(**changes)
    assert message in str(error.value)


def test_a_mass_is_that_of_a_kinetic_energy_or_of_mixed_equations() -> None:
    energy = np.array([[1.0, -0.5], [-0.5, 1.0]])
    assert (make(mass=energy).matrix("mass") == energy).all()
    for mass in (energy[::-1] * [[1.0], [2.0]], -2.0 * np.array([[1.0, 0.1], [0.0, 1.0]]), 1e-200 * energy):
        assert (make(mass=mass).matrix("mass") == mass).all()  # rows exchanged; multiplied by -2; in another unit
    assert (make(mass=[1e-12, 1e12] * np.eye(2)).matrix("mass") == np.diag([1e-12, 1e12])).all()


def test_all_reasons_are_given_at_once() -> None:
    with pytest.raises(ModelError) as error:
        make(stiffness=[[1.0]], mean={"x": 1.0}, coordinates=["q1", "q1"])
    assert len(str(error.value).splitlines()) >= 3


def test_a_large_singular_mass_is_not_printed() -> None:
    n = 50
    with pytest.raises(ModelError, match="mass is singular; every"):
        System([f"x{i}" for i in range(n)], stiffness=np.eye(n), mass=np.ones((n, n)))
    with pytest.raises(ModelError, match="x0 and x1 and x2 and 47 others have neither inertia nor damping"):
        System([f"x{i}" for i in range(n)], stiffness=np.eye(n), mass=np.zeros((n, n)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stage2.clearence": 1.0}, "did you mean 'stage2.clearance'"),
        ({"clearance": 1.0}, "'stage2.clearance'"),
        ({"stage2.clearance": -1.0}, "stage2.clearance is -1.0; it must be >= 0"),
        ({"stage2.clearance": "1"}, "it must be a number"),
        ({"stage2.clearance": True}, "it must be a number"),
        ({"stage2.clearance": np.nan}, "it must be a finite number"),
        ({"stage2.clearance": 10**400}, "too many digits"),
        ({"mass.q1.q1": 0.0}, "mass is singular"),
        ({"mass.q1.q1": -1.0}, "mass gives q1 the inertia -1; it must be > 0"),
        ({"frequency": -1.0}, "frequency is -1.0; it must be > 0"),
    ],
)
def test_at_refuses_what_cannot_be(changes, message: str) -> None:
    with pytest.raises(ModelError) as error:
        make().at(changes)
    assert message in str(error.value)


@pytest.mark.parametrize("value", [2, 2.0, np.float64(2.0), np.float32(2.0), np.int64(2)])
def test_at_takes_any_kind_of_number(value) -> None:
    assert make().at(frequency=value).frequency == 2.0
