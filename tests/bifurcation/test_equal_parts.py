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


def edge(square: float, low: float, high: float, damping: float = 0.02, depth: float = 0.3) -> float:
    """Return the frequency in a bracket at which a multiplier of ``x'' + c x' + (w^2 +- e) x = 0`` is -1."""

    def distance(frequency: float) -> float:
        half = np.pi / frequency
        parts = [expm(np.array([[0.0, 1.0], [-(square + sign * depth), -damping]]) * half) for sign in (1.0, -1.0)]
        return float(np.linalg.det(parts[0] @ parts[1] + np.eye(2)))

    return brentq(distance, low, high, xtol=1e-14)


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
