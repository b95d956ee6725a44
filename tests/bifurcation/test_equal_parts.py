"""Several multipliers that become critical at once, in machines with equal parts."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.errors import ConvergenceError
from gapwalk.flow.symmetry import Symmetry, symmetries_of
from tests.bifurcation.equal_parts import equal_parts, ring
from tests.tiers import keeps


def edge(square: float, low: float, high: float, damping: float = 0.02, depth: float = 0.3) -> float:
    """Return the frequency in a bracket at which a multiplier of ``x'' + c x' + (w^2 +- e) x = 0`` is -1."""

    def distance(frequency: float) -> float:
        half = np.pi / frequency
        parts = [expm(np.array([[0.0, 1.0], [-(square + sign * depth), -damping]]) * half) for sign in (1.0, -1.0)]
        return float(np.linalg.det(parts[0] @ parts[1] + np.eye(2)))

    return brentq(distance, low, high, xtol=1e-14)


@keeps("3-double flip")
@pytest.mark.parametrize(("count", "words"), [(3, "double flip"), (4, "triple flip")])
def test_a_flip_of_equal_modes_is_found_located_and_named(count, words):
    system = ring(count)
    square = 1.0 + 0.2 * count
    edges = [edge(square, low, high) for low, high in ((2.0 * square**0.5, 3.2), (2.0, 2.0 * square**0.5))]
    first = 1.03 * max(edges)
    walk = gw.WalkOptions(initial_step=0.02, largest_step=0.2)
    branch = gw.follow(gw.find_orbit(system, frequency=first), "frequency", 0.98 * min(edges), walk=walk)
    assert [each.words["kind"] for each in branch.special_points] == [words, words]
    assert [each.value for each in branch.special_points] == pytest.approx(edges, abs=1e-11)
    assert max(each.uncertainty for each in branch.special_points) < 1e-10
    assert [each.after.total for each in branch.special_points] == [count - 1, 0]
    assert f"({words} at" in repr(branch.special_points[0])
    assert not branch.unexplained


def test_a_double_branch_point_is_where_the_linear_equation_of_the_difference_has_a_multiplier_of_one():
    system = springs()
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.3)
    found = branch.special("branch-point")
    assert [(each.words["kind"], round(each.value, 6)) for each in found] == [
        ("double branch-point", 1.44876),
        ("double branch-point", 1.593137),
    ]
    assert not branch.unexplained
    for each in found:
        # independent of the flow: the common motion and a difference of two parts, by DOP853
        frequency, state = each.value, each.orbit.state[[0, 3]]

        def rates(time, y, frequency=frequency):
            x, v, *differences = y
            force = 0.5 * np.cos(frequency * time)
            found = [v, force - 0.1 * v - x - x**3]
            for q, w in (differences[:2], differences[2:]):
                found += [w, -0.1 * w - (1.36 + 3.0 * x**2) * q]
            return found

        start = [*state, 1.0, 0.0, 0.0, 1.0]
        end = solve_ivp(rates, (0.0, 2.0 * np.pi / frequency), start, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        assert end[:2] == pytest.approx(state, abs=1e-9)
        values = np.linalg.eigvals(end[2:].reshape(2, 2).T)
        assert np.abs(values - 1.0).min() < 1e-7
    with pytest.raises(ConvergenceError, match="2 multipliers become critical at once"):
        gw.follow(found[0], "frequency", (1.3, 1.8))


def test_a_diagram_keeps_the_rest_beside_a_double_branch_point():
    found = gw.diagram(springs(), "frequency", (1.3, 1.65))
    (branch,) = found.branches
    assert [each.words["kind"] for each in branch.special_points] == [
        "double branch-point",
        "fold",
        "double branch-point",
    ]
    assert len(found.failures) == 2  # one sentence for each of the points
    for sentence, value in zip(found.failures, (1.448759755, 1.593137407), strict=True):
        assert f"leaves {value} could not be walked: 2 multipliers become critical at once" in sentence


def springs() -> gw.System:
    """Return three equal Duffing oscillators under equal loads, each coupled to both others."""
    names = ["a", "b", "c"]
    return gw.System(
        names,
        mass=[1.0] * 3,
        damping=[0.1] * 3,
        stiffness=(np.eye(3) + 0.12 * (3.0 * np.eye(3) - np.ones((3, 3)))).tolist(),
        contacts=[gw.force(f"s{name}", {name: 1.0}, law="p*x*x*x", p=1.0) for name in names],
        harmonics=[gw.Harmonic(0.5, dict.fromkeys(names, 1.0))],
        frequency=1.65,
    )


def test_random_systems_with_two_equal_parts_have_that_symmetry():
    rng = np.random.default_rng(0)
    for _ in range(5):
        assert Symmetry((1, 0), (1, 1), 0.0) in symmetries_of(equal_parts(rng).system)


def alone(count: int) -> gw.System:
    """Return equal Duffing oscillators under equal loads that are not coupled at all."""
    names = [f"x{place}" for place in range(count)]
    return gw.System(
        names,
        mass=[1.0] * count,
        damping=[0.1] * count,
        stiffness=np.eye(count).tolist(),
        contacts=[gw.force(f"s{name}", {name: 1.0}, law="p*x*x*x", p=0.2) for name in names],
        harmonics=[gw.Harmonic(0.3, dict.fromkeys(names, 1.0))],
        frequency=0.7,
    )


@pytest.mark.parametrize(("count", "words", "to"), [(2, "double fold", 1.4), (3, "triple fold", 1.8)])
def test_equal_parts_that_turn_back_together_have_a_multiple_fold_where_one_part_alone_has_its_fold(count, words, to):
    single = gw.follow(gw.find_orbit(alone(1)), "frequency", to).special("fold")
    branch = gw.follow(gw.find_orbit(alone(count)), "frequency", to)
    found = branch.special_points
    assert [each.words["kind"] for each in found] == [words, words]
    assert [each.value for each in found] == pytest.approx([each.value for each in single], abs=1e-11)
    assert [each.nature for each in found] == [each.nature for each in single]
    assert [each.after.total for each in found] == [count, 0]
    assert not branch.unexplained
    with pytest.raises(ConvergenceError, match=f"{count} multipliers become critical at once at the {words}"):
        found[0].gradient("damping.x0.x0")


@pytest.mark.slow
def test_a_diagram_has_the_branches_of_parts_that_are_on_different_motions_between_two_double_folds():
    found = gw.diagram(alone(2), "frequency", (0.7, 1.4))
    first, *others = found.members
    assert not found.failures
    assert [(each.begins.parent, each.joins.parent) for each in others] == [(first.name, first.name)] * 2
    for each in others:
        point = each.branch.points[len(each.branch.points) // 2]
        motions = [
            gw.find_orbit(alone(1), start=point.orbit.state[place::2], frequency=point.value) for place in (0, 1)
        ]
        assert [motion.state for motion in motions] == [
            pytest.approx(point.orbit.state[k::2], abs=1e-8) for k in (0, 1)
        ]
        low, high = sorted(motion.measure("max.x0") for motion in motions)
        assert high - low > 0.1
    assert gw.verify(found).ok


@pytest.mark.slow
def test_a_torus_bifurcation_of_two_equal_machines_is_double():
    eye, names, contacts = np.eye(2), ["a0", "b0", "a1", "b1"], []
    for place in "01":
        contacts += [gw.force(f"ground{place}", {f"a{place}": 1.0}, law="p*x*x*x", p=1.0)]
        contacts += [gw.force(f"link{place}", {f"a{place}": 1.0, f"b{place}": -1.0}, law="p*x*x*x", p=0.0042)]
    system = gw.System(
        names,
        mass=np.kron(eye, np.diag([1.0, 0.05])),
        damping=np.kron(eye, [[0.015, -0.013], [-0.013, 0.013]]),
        stiffness=np.kron(eye, [[1.0453, -0.0453], [-0.0453, 0.0453]]),
        contacts=contacts,
        harmonics=[gw.Harmonic(0.11, {"a0": 1.0, "a1": 1.0})],
        frequency=1.08,
    )
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.25)
    # those of one machine alone are simple, at the same values
    assert [(each.words["kind"], round(each.value, 9), each.after.total) for each in branch.special_points] == [
        ("double neimark-sacker", 1.112711239, 4),
        ("double neimark-sacker", 1.195736669, 0),
        ("double fold", 1.214626225, 2),
        ("double fold", 1.206219457, 0),
    ]
    assert not branch.unexplained
