"""Gradients of special points: against closed forms, differences of located points, a scaling law, and loci."""

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.loci.gradient import main_movers
from gapwalk.paper import case

# Central differences of located folds of figure 13, to nine digits (computed beside this code).
FOLDS = {
    "stage2.clearance": (-0.085321548, -0.045833757),
    "mean.q1": (0.055784511, -0.008675649),
    "harmonic1.amplitude": (0.242660282, 0.141918971),
    "stiffness.q1.q1": (0.433998230, 0.496514564),
    "stage2.impact_damping": (-0.062067419, -0.274119379),
}


@pytest.fixture(scope="module")
def clutch() -> gw.Branch:
    """Walk the response of figure 13 over its folds, flips and grazing points."""
    system = case("13")
    return gw.follow(gw.find_orbit(system.at(frequency=1.45)), "frequency", 0.3)


def test_folds_move_as_differences_of_located_folds(clutch: gw.Branch) -> None:
    folds = [point for point in clutch.special_points if point.kind == "fold" and point.value > 0.6]
    assert len(folds) == 2
    for column, fold in enumerate(folds):
        found = fold.gradient(*FOLDS)
        assert found.slopes == pytest.approx([row[column] for row in FOLDS.values()], abs=2e-9)


def test_the_orders_of_one_load_are_one_mover() -> None:
    loads = [
        gw.Harmonic(0.3, {"x": 1.0}, 2),
        gw.Harmonic(0.1, {"x": 1.0}, 4),
        gw.Harmonic(0.2, {"y": 1.0}, 2, name="other"),
    ]
    system = gw.System(["x", "y"], np.eye(2), harmonics=loads)
    shares = {
        "harmonic2.amplitude": 0.4,
        "harmonic2.acts_on.x": 0.4,
        "harmonic4.amplitude": -0.1,
        "stiffness.x.x": 0.35,
    }
    shares |= {"other.amplitude": 0.2, "harmonic4.phase": 0.01}
    found = main_movers(system, shares)
    assert [name for name, _ in found] == ["stiffness.x.x", "load on x", "other.amplitude", "harmonic4.phase"]
    assert dict(found)["load on x"] == pytest.approx(0.3)


def test_lengths_scale(clutch: gw.Branch) -> None:
    """Multiply all lengths by one factor: no special point moves."""
    kinds = set()
    for point in clutch.special_points:
        found = point.gradient()
        grow = [name.startswith("mean") or name.endswith(("clearance", "amplitude")) for name in found.names]
        lengths = np.flatnonzero(grow)
        inverse = [k for k, name in enumerate(found.names) if name.endswith("impact_damping")]
        moved = found.slopes * found.values
        assert abs(moved[lengths].sum() - moved[inverse].sum()) < 1e-8 * np.abs(moved).max()
        kinds.add(point.kind.value)
    assert kinds == {"fold", "flip", "grazing", "neimark-sacker"}


def test_graze_of_a_linear_oscillator_in_closed_form() -> None:
    """The amplitude F / |1 - W^2 + i c W| reaches the gap: its derivatives give those of W."""
    gap, load, damping = 2.0, 0.7, 0.1
    system = gw.System(
        ["x"],
        stiffness=[[1.0]],
        damping=[[damping]],
        contacts=[gw.stop("stop", {"x": 1.0}, clearance=gap, stiffness=9.0)],
        harmonics=[gw.Harmonic(load, {"x": 1.0})],
        frequency=0.5,
    )
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.9)
    graze = next(point for point in branch.special_points if point.kind == "grazing")
    w = graze.value
    square = (1.0 - w**2) ** 2 + (damping * w) ** 2
    assert load / math.sqrt(square) == pytest.approx(gap, rel=1e-9)
    by_w = -4.0 * w * (1.0 - w**2) + 2.0 * damping**2 * w
    expected = {
        "stop.clearance": -2.0 * load**2 / gap**3 / by_w,
        "harmonic1.amplitude": 2.0 * load / gap**2 / by_w,
        "damping.x.x": -2.0 * damping * w**2 / by_w,
        "stiffness.x.x": -2.0 * (1.0 - w**2) / by_w,
        "mass.x.x": 2.0 * w**2 * (1.0 - w**2) / by_w,
        "stop.stiffness": 0.0,
    }
    found = graze.gradient(*expected)
    assert found.slopes == pytest.approx(list(expected.values()), abs=1e-9)
    assert found["damping.x.x"] == found.slopes[2]


@pytest.mark.slow
def test_flips_and_neimark_sacker_points_move_as_located_ones(clutch: gw.Branch) -> None:
    """Central differences of points that other walks locate."""
    for kind in ("flip", "neimark-sacker"):
        point = next(each for each in clutch.special_points if each.kind == kind)
        for name in ("mean.q1", "stage2.stiffness"):
            here = point.orbit.system[name]
            slope = point.gradient(name)[name]
            moved = [_located(point, name, here * (1.0 + way)) for way in (-1e-4, 1e-4)]
            assert (moved[1] - moved[0]) / (2e-4 * here) == pytest.approx(slope, rel=1e-6, abs=1e-8)


def _located(point: gw.SpecialPoint, name: str, value: float) -> float:
    """Return where the same special point lies at another value of a parameter, located by another walk."""
    system = point.orbit.system.at({name: value, "frequency": point.value - 0.004})
    branch = gw.follow(gw.find_orbit(system, point.orbit.period, point.orbit.state), "frequency", point.value + 0.004)
    near = [each.value for each in branch.special_points if each.kind == point.kind]
    return min(near, key=lambda each: abs(each - point.value))


def test_gradient_by_harmonic_balance(clutch: gw.Branch) -> None:
    """The points of the truncated equation move nearly as the exact ones."""
    method, names = gw.Balance(harmonics=16), ("stage2.clearance", "stage2.stiffness", "mean.q1")
    start = gw.find_orbit(case("13").at(frequency=0.66), method=method)
    balanced = gw.follow(start, "frequency", 0.65, method=method)
    ours, theirs = (
        next(point for point in branch.special_points if point.kind == "flip" and point.value < 0.7)
        for branch in (clutch, balanced)
    )
    assert theirs.gradient(*names).slopes == pytest.approx(ours.gradient(*names).slopes, abs=1e-3)


def test_the_gradients_of_a_branch_are_a_table(clutch: gw.Branch) -> None:
    found = gw.analysis.gradients(clutch.special_points[:3], ["mean.q1", "stage2.stiffness"])
    header, *rows = found.tables()["gradients"]()
    assert len(rows) == 6
    assert list(header)[2:] == ["parameter", "value", "slope", "error", "percent.per.percent"]
    assert [row[4] for row in rows] == [slope for each in found.found for slope in each.slopes]
    assert "stage2.stiffness" in str(found.summary())


def test_what_has_no_gradient_is_refused(clutch: gw.Branch) -> None:
    point = clutch.special_points[0]
    with pytest.raises(gw.errors.ModelError, match="name other parameters"):
        point.gradient("frequency")
    with pytest.raises(gw.errors.ModelError, match="clearanse"):
        point.gradient("stage2.clearanse")


def test_the_summary_begins_with_what_moves_most(clutch: gw.Branch) -> None:
    found = clutch.special_points[0].gradient("mean.q3", "stage2.stiffness")
    lines = str(found.summary()).splitlines()
    assert "what moves it most" in lines[0]
    assert [line.split()[0] for line in lines[3:5]] == [found.names[k] for k in found.order]
    assert abs(found.elasticities[found.order[0]]) > abs(found.elasticities[found.order[1]])
