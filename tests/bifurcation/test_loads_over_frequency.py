"""Derivatives by the frequency under loads that grow with it: against central differences, and in other coordinates."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.loci.balanced_plane import BalancedPlane
from gapwalk.bifurcation.loci.locus_equations import ShotPlane
from gapwalk.loads import Measured, Rectangle, Steady, orders_of
from gapwalk.model.loads import Harmonic
from gapwalk.model.measured.measured_table import SpeedTable
from gapwalk.orbit import Shooting
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.orbit import sensitivity
from tests.tiers import in_campaign, some_of

W, STIFFNESS = 0.9, 4.0
PLAIN = Harmonic(0.5, {"x": 1.0}, phase=0.3)
ANGLES = np.linspace(0.0, 2.0 * np.pi, 61)
CURVE = orders_of(ANGLES, 0.2 + 0.3 * np.sin(ANGLES) - 0.1 * np.cos(2.0 * ANGLES))
TABLE = SpeedTable((0.2, 0.6, 1.3, 2.0), (1.0, 0.7, 1.6, 1.5), "gas.csv")

ACTING = {
    "constant": [PLAIN],
    "growth 1": [Harmonic(0.5, {"x": 1.0}, phase=0.3, growth=1, at=1.2), Harmonic(0.2, {"y": 1.0}, order=2)],
    "unbalance": [Harmonic(0.5, {"x": 1.0}, phase=0.3, growth=2), Harmonic(0.2, {"y": 1.0}, order=2, growth=1)],
    "formula": [Harmonic(0.4, {"x": 1.0}, over_speed="1 + 0.3*W**2"), Steady(0.2, {"y": 1.0}, over_speed="exp(-W)")],
    "table": [Harmonic(0.4, {"x": 1.0}, over_speed=TABLE), Steady(0.1, {"x": 1.0}, over_speed=TABLE, growth=1)],
    "measured": [Measured.of(CURVE, {"x": 1.0}, phase=0.4, growth=2, scale=1.3)],
}
VARYING = {
    "displacement": [PLAIN, Harmonic(0.1, varies="stop.deflection", order=2, phase=0.7)],
    "growing displacement": [PLAIN, Harmonic(0.1, varies="stop.deflection", order=2, phase=0.7, growth=1)],
    "growing clearance": [PLAIN, Harmonic(0.05, varies="stop.clearance", order=3, phase=0.7, growth=2)],
    "measured displacement": [PLAIN, Measured.of(CURVE, varies="stop.deflection", over_speed=TABLE)],
    "stiffness": [PLAIN, Harmonic(0.3, varies="stop.stiffness", order=3, phase=0.7, growth=1)],
    "rectangle": [Harmonic(0.5, {"x": 1.0}, growth=2), Rectangle(0.3, {"stop.stiffness": 1.0}, order=3, phase=0.7)],
}
STATE = np.array([0.6, -0.4, 0.3, 0.5])
SOME = some_of([*ACTING, *VARYING], "growth 1", "unbalance", "table", "growing displacement", "stiffness", "rectangle")


def system_of(loads, frequency: float = W) -> gw.System:
    stop = gw.stop("stop", {"x": 1.0, "y": -0.5}, clearance=0.3, stiffness=STIFFNESS, impact_damping=0.05)
    return gw.System(
        ["x", "y"],
        [[1.3, -0.3], [-0.3, 0.9]],
        [[0.16, -0.01], [-0.01, 0.15]],
        [[1.0, 0.1], [0.1, 2.0]],
        contacts=[stop],
        mean={"x": 0.1},
        harmonics=loads,
        frequency=frequency,
    )


def difference(function, at: float = W, step: float = 2e-4):
    """The derivative of a function, by central differences of three steps, extrapolated."""

    def central(h):
        return (function(at + h) - function(at - h)) / (2.0 * h)

    coarse, medium, fine = central(step), central(step / 2.0), central(step / 4.0)
    return (16.0 * (4.0 * fine - medium) - (4.0 * medium - coarse)) / 45.0


def assert_close(found, expected) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("period", [1, 2])
@pytest.mark.parametrize("name", SOME)
def test_the_slope_of_shooting_is_exact(name: str, period: int) -> None:
    equation = Shooting().pose(system_of((ACTING | VARYING)[name]), "frequency", period)
    expected = difference(lambda value: equation.evaluate(STATE, value).residual)
    assert_close(equation.evaluate(STATE, W).by_parameter, expected)


@pytest.mark.parametrize("name", ACTING)
def test_so_is_that_of_harmonic_balance(name: str) -> None:
    system = system_of(ACTING[name])
    equation = Balance(8).pose(system, "frequency", 1)
    lines = np.random.default_rng(2).normal(0.0, 0.4, 17)
    expected = difference(lambda value: equation.evaluate(lines, value).residual)
    assert_close(equation.evaluate(lines, W).by_parameter, expected)
    plane = BalancedPlane(system, ("frequency", "stop.stiffness"), 1, Balance(8), 8)
    assert_close(plane.place(lines, W, STIFFNESS).jacobian[:, -2], expected)


@pytest.mark.parametrize("name", some_of([*ACTING, *VARYING], "growth 1", "table", "stiffness"))
def test_so_are_those_of_loci(name: str) -> None:
    plane = ShotPlane(system_of((ACTING | VARYING)[name]), ("frequency", "stop.stiffness"), 1, Shooting())
    place = plane.place(STATE, W, STIFFNESS)
    expected = difference(lambda value: plane.place(STATE, value, STIFFNESS).residual)
    assert_close(place.jacobian[:, -2], expected)
    derivatives = plane.turning(0, place, 2.0)[1]
    turned = difference(lambda value: plane.turning(0, plane.place(STATE, value, STIFFNESS), 2.0)[0])
    assert_close(derivatives[:, -2], turned)
    assert_close(derivatives[:, 4], difference(lambda theta: plane.turning(0, place, theta)[0], 2.0))


@pytest.mark.parametrize("name", [in_campaign("unbalance"), "table", "growing displacement", in_campaign("stiffness")])
def test_an_orbit_has_the_slope_of_its_neighbours(name: str) -> None:
    system = system_of((ACTING | VARYING)[name])
    orbit = gw.find_orbit(system)
    expected = difference(lambda value: gw.find_orbit(system, frequency=value, start=orbit.state).state, step=1e-3)
    assert_close(sensitivity(orbit, ["frequency"]).state[:, 0], expected)
    point = gw.follow(orbit, "frequency", (W - 0.01, W + 0.01)).points
    at = min(point, key=lambda each: abs(each.value - W))
    scales = np.append(at.orbit.state, at.value) / at.x
    assert_close((at.tangent * scales)[:-1] / (at.tangent * scales)[-1], expected)


@pytest.mark.parametrize("method", [Shooting(), Balance()])
@pytest.mark.parametrize("factors", [(0.0, 0.0, 1.0, 1.5), (1.0, 1.0, 2.0, 1.5)])
def test_a_factor_that_rests_where_a_walk_begins_counts_later(factors, method) -> None:
    table = SpeedTable((0.5, 0.8, 1.5, 2.0), factors, "gas.csv")
    loads = [PLAIN, Harmonic(0.4, {"y": 1.0}, over_speed=table, name="late")]
    branch = gw.follow(gw.find_orbit(system_of(loads, 0.6)), "frequency", 1.3, method=method)
    assert branch.points[-1].value == 1.3
    plain = [PLAIN, Harmonic(0.4 * float(table.value(1.3)), {"y": 1.0}, name="late")]
    known = gw.find_orbit(system_of(plain, 1.3), start=branch.points[-1].orbit.state)
    assert np.abs(branch.points[-1].orbit.state - known.state).max() < (1e-9 if method == Shooting() else 2e-3)


def shaken(frequency: float = 0.8, *, relative: bool) -> gw.System:
    """An oscillator with a stop on a base that moves by cos(W t): in coordinates of the base, or in fixed ones."""
    spring = gw.Contact("spring", {"x": 1.0}, [gw.Stage(0.0, 1.0)], law="viscous", viscous_damping=0.1)
    stop = gw.stop("stop", {"x": 1.0}, clearance=1.0, stiffness=3.0, impact_damping=0.05)
    names = {"spring.deflection": -1.0, "stop.deflection": -1.0}
    base = Harmonic(0.3, {"x": 1.0}, growth=2) if relative else Harmonic(0.3, varies=names)
    return gw.System(["x"], [[0.0]], contacts=[spring, stop], harmonics=[base], frequency=frequency)


@pytest.mark.slow
def test_the_acceleration_of_a_base_is_its_motion_in_other_coordinates() -> None:
    """In all of a branch: multipliers and special points; and the folds of a family with their locus."""
    trees = [
        gw.follow(gw.find_orbit(shaken(0.8, relative=relative)), "frequency", (0.8, 2.2)) for relative in (True, False)
    ]
    ours, theirs = ([(special.kind, special.value) for special in tree.special_points] for tree in trees)
    assert len(ours) >= 4
    assert [kind for kind, _ in ours] == [kind for kind, _ in theirs]
    np.testing.assert_allclose([value for _, value in ours], [value for _, value in theirs], rtol=1e-8)
    folds = [next(each for each in tree.special_points if each.kind == "fold") for tree in trees]
    ranges = ((0.7, 2.2), (2.5, 3.5))
    loci = [gw.follow_locus(fold, "frequency", "stop.stiffness", ranges) for fold in folds]
    ends = [sorted(tuple(end.values) for end in locus.ends) for locus in loci]
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-7)


def test_families_join_the_same_points_in_both_coordinates() -> None:
    found = []
    for relative in (True, False):
        family = gw.family(shaken(relative=relative), "frequency", (1.2, 1.7), over={"stop.stiffness": [2.9, 3.1]})
        found.append([(each.kind, each.fate, np.array(each.curve)) for each in family.connections[0]])
    ours, theirs = found
    assert len(ours) >= 1
    for (kind, fate, curve), (other, its_fate, its_curve) in zip(ours, theirs, strict=True):
        assert (kind, fate) == (other, its_fate)
        np.testing.assert_allclose(curve[[0, -1]], its_curve[[0, -1]], rtol=1e-8)
