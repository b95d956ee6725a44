"""Symmetries of systems that are known by construction, and their defects on motions in closed form."""

import numpy as np
import pytest

from gapwalk import Contact, Harmonic, Side, Stage, System, backlash, find_orbit
from gapwalk.flow.symmetry import Symmetry, finds_all, symmetries_of
from gapwalk.model.contact import friction
from gapwalk.model.laws import Hysteretic, Jenkins, Rigid

INVERSION = Symmetry((0,), (-1,), 0.5)


def gap(**changes) -> System:
    given = {
        "contacts": [backlash("gap", {"x": 1.0}, 1.0, 20.0, impact_damping=0.1)],
        "harmonics": [Harmonic(0.5, {"x": 1.0})],
        "frequency": 0.9,
    }
    return System(["x"], [[1.0]], [[0.1]], **(given | changes))


def test_a_symmetric_gap_moves_alike_with_the_other_sign_half_a_period_later():
    assert symmetries_of(gap()) == (INVERSION,)


@pytest.mark.parametrize(
    "changes",
    [
        {"mean": {"x": 1e-6}},
        {"harmonics": [Harmonic(0.5, {"x": 1.0}), Harmonic(1e-6, {"x": 1.0}, 2)]},
        {"contacts": [Contact("stop", {"x": 1.0}, (Stage(1.0, 20.0, side=Side.POSITIVE),))]},
        {"contacts": [Contact("stop", {"x": 1.0}, (Stage(1e9, 20.0, side=Side.POSITIVE),))]},
        {"mean": {"x": 1e-6}, "contacts": [backlash("gap", {"x": 1.0}, 1e9, 20.0)]},
    ],
)
def test_a_mean_an_even_order_or_one_stop_leaves_no_symmetry(changes):
    assert symmetries_of(gap(**changes)) == ()


def test_an_odd_order_keeps_it():
    assert symmetries_of(gap(harmonics=[Harmonic(0.5, {"x": 1.0}), Harmonic(0.2, {"x": 1.0}, 3, 0.4)])) == (INVERSION,)


def two_masses(first: float, load: float = 0.0) -> System:
    stops = [Contact(f"stop{k}", {f"q{k}": 1.0}, (Stage(0.5, 10.0, side=Side.POSITIVE),)) for k in (1, 2)]
    stiffness = [[2.0, -1.0], [-1.0, 2.0]]
    loads = [Harmonic(0.3, {"q1": 1.0, "q2": 1.0 + load})]
    return System(["q1", "q2"], stiffness, np.eye(2) * 0.1, np.diag([first, 1.0]), stops, {}, loads, 0.8)


def test_two_equal_masses_change_places():
    assert symmetries_of(two_masses(1.0)) == (Symmetry((1, 0), (1, 1), 0.0),)
    assert symmetries_of(two_masses(1.0 + 1e-6)) == ()
    assert symmetries_of(two_masses(1.0, 1e-6)) == ()


def test_the_defect_tells_a_motion_that_has_lost_it():
    inside = find_orbit(gap(harmonics=[Harmonic(0.05, {"x": 1.0})]))  # linear: symmetric to rounding
    assert INVERSION.defect(inside.extremes) < 1e-10
    moved = np.array([[1.2, -1.0, 0.05, 0.7]])
    assert INVERSION.defect(moved) == pytest.approx(0.2 / 1.1)
    assert INVERSION.defect(1e-12 * moved, floor=1.0) < 1e-11


def test_breakpoints_change_places_too():
    assert INVERSION.moves_switches(gap()) == (1, 0)
    assert Symmetry((1, 0), (1, 1), 0.0).moves_switches(two_masses(1.0)) == (1, 0)


def test_only_some_symmetries_are_looked_for_in_large_systems():
    assert finds_all(two_masses(1.0))
    n = 5
    load = [Harmonic(0.1, {"q1": 1.0, "q5": 1.0})]
    names = [f"q{k}" for k in range(1, n + 1)]
    stiffness = np.diag([2.0] * n) - np.eye(n, k=1) - np.eye(n, k=-1)
    chain = System(names, stiffness, np.eye(n) * 0.1, harmonics=load, frequency=1.0)
    assert not finds_all(chain)
    assert Symmetry((4, 3, 2, 1, 0), (1,) * n, 0.0) in symmetries_of(chain)


def dry(*contacts, names=("x",), stiffness=((1.0,),)):
    """Return a system whose loads and springs are symmetric."""
    damping = (0.1 * np.eye(len(names))).tolist()
    loads = [Harmonic(1.0, dict.fromkeys(names, 1.0))]
    return System(names, [[*row] for row in stiffness], damping, contacts=contacts, harmonics=loads)


def wall(clearance, side, name="wall"):
    """Return a rigid stop."""
    return Contact(name, {"x": 1.0}, [Stage(clearance, side=side)], law=Rigid(), restitution=0.5)


def hosted(first, second):
    """Return springs on both sides whose stages have friction of their own."""
    stages = [
        Stage(0.2, 3.0, side=Side.POSITIVE, name="a", numbers={"hysteresis": first}),
        Stage(0.2, 3.0, side=Side.NEGATIVE, name="b", numbers={"hysteresis": second}),
    ]
    base = Contact("c", {"x": 1.0}, stages, law=Hysteretic("elastic"))
    return base, Contact("cf", {"x": 1.0}, (), law=Jenkins("stages", "c"), stiffness=8.0)


@pytest.mark.parametrize(
    ("contacts", "is_symmetric"),
    [
        ([friction("f", {"x": 1.0}, 0.3, stiffness=2.0)], True),
        ([friction("f", {"x": 1.0}, 0.3, stiffness=2.0, speed=0.1)], False),
        ([friction("f", {"x": 1.0}, 0.3, static=1.2)], True),
        ([friction("f", {"x": 1.0}, 0.3, speed=0.1)], False),
        ([wall(1.0, Side.BOTH)], True),
        ([wall(1.0, Side.POSITIVE)], False),
        ([wall(1.0, Side.POSITIVE), wall(1.0, Side.NEGATIVE, "other")], True),
        ([wall(1.0, Side.POSITIVE), wall(1.2, Side.NEGATIVE, "other")], False),
        (hosted(0.2, 0.2), True),
        (hosted(0.2, 0.4), False),
    ],
)
def test_friction_and_rigid_stops_keep_or_break_the_symmetry(contacts, is_symmetric):
    expected = (Symmetry((0,), (-1,), 0.5),) if is_symmetric else ()
    assert symmetries_of(dry(*contacts)) == expected


@pytest.mark.parametrize(("stiffness", "count"), [(2.0, 3), (3.0, 1)])
def test_springs_of_friction_decide_on_exchanges(stiffness, count):
    first = friction("f", {"x": 1.0}, 0.3, stiffness=2.0)
    second = friction("g", {"y": 1.0}, 0.3, stiffness=stiffness)
    found = symmetries_of(dry(first, second, names=("x", "y"), stiffness=((2.0, -1.0), (-1.0, 2.0))))
    assert len(found) == count
