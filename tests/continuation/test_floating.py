"""Walks past the graze of a gear that floats on its bearing: a branch that bends within 1e-10."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.continuation.walk import EndReason
from gapwalk.orbit.floating import floats, unheld


def train(firing: float) -> gw.train.Train:
    """Flywheel, hub, loose gear, output and vehicle, in physical units; hardly anything holds the loose gear."""
    base: Any = gw  # quantities with units are texts
    parts: Any = gw.train
    return parts.Train(
        inertias=[
            parts.Inertia(name, f"{value} kg m^2")
            for name, value in [("flywheel", 0.14), ("hub", 0.004), ("loose", 0.002), ("output", 0.01), ("vehicle", 4)]
        ],
        shafts=[
            parts.Shaft(
                "clutch",
                ("flywheel", "hub"),
                stiffness="2.5 N m/deg",
                damping="0.2 N m s/rad",
                impact_damping="0.01 s/rad",
                stages=(base.Stage("3 deg", "19.5 N m/deg"),),
            ),
            parts.Shaft("input", ("hub", "output"), stiffness="9200 N m/rad", damping="0.6 N m s/rad"),
            parts.Shaft("bearing", ("loose", "output"), stiffness="1e-6 N m/rad", damping="0.01 N m s/rad"),
            parts.Shaft("halfshafts", ("output", "vehicle"), stiffness="320 N m/rad", damping="0.6 N m s/rad"),
        ],
        gears=[
            parts.Gear(
                "mesh", ("hub", "loose"), 1.0, clearance="0.1 deg", stiffness="1e4 N m/rad", impact_damping="0.01 s/rad"
            )
        ],
        mean={"flywheel": "5 N m"},
        reaction="vehicle",
        harmonics=[base.Harmonic(f"{firing} N m", {"flywheel": 1.0}, 2, name="firing")],
        speed="1100 rpm",
    )


def swing(system: gw.System, speed: float) -> float:
    """By how much the mesh swings beyond its clearance, about its own mean, while all gaps are open."""
    w = system.at(speed=speed).equations.frequency
    dynamic = system.matrix("stiffness") - w**2 * system.matrix("mass") + 1j * w * system.matrix("damping")
    load = system.equations["firing.amplitude"] * system.vector("firing.acts_on")
    swings = abs(complex(system.vector("mesh.deflection") @ np.linalg.solve(dynamic, load)))
    return swings - system.equations["mesh.clearance"]


def reach(system: gw.System, speed: float) -> float:
    """How far the mesh deflects beyond its clearance while all gaps are open: by the dynamic stiffness."""
    mean = np.linalg.solve(system.matrix("stiffness"), system.vector("mean"))
    return float(system.vector("mesh.deflection") @ mean) + swing(system, speed)


@pytest.mark.slow
def test_a_walk_passes_the_graze_of_a_gear_that_hardly_anything_holds():
    system = train(8.0).system()
    branch = gw.follow(gw.find_orbit(system, speed=990.0), "speed", 880.0)
    assert branch.ends[-1].reason is EndReason.RANGE
    assert len(branch.points) < 200
    (graze,) = branch.special("grazing")
    assert abs(graze.value - brentq(lambda speed: reach(system, speed), 900.0, 990.0, xtol=1e-9)) < 1e-5


@pytest.mark.slow
def test_a_five_inertia_train_walks_from_1100_to_700_rpm():
    branch = gw.follow(gw.find_orbit(train(9.7).system()), "speed", 700.0)
    assert branch.ends[-1].reason is EndReason.RANGE


def with_drag_alone(firing: float) -> gw.System:
    """The same train, with nothing but drag in the bearing of the loose gear."""
    return train(firing).replaced("bearing", stiffness=None).system()


@pytest.mark.slow
def test_a_bearing_that_only_drags_rattles_as_in_the_limit_of_a_soft_one():
    dragging, soft = (
        gw.follow(gw.find_orbit(system), "speed", 700.0) for system in (with_drag_alone(9.7), train(9.7).system())
    )
    assert dragging.ends[-1].reason is EndReason.RANGE
    assert gw.verify(dragging).ok
    assert [each.kind for each in dragging.special_points] == [each.kind for each in soft.special_points]
    for one, other in zip(dragging.special_points, soft.special_points, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-7)


@pytest.mark.parametrize(("firing", "speed"), [(2.0, 1100.0), (6.0, 990.0)])
def test_a_gear_that_only_drags_and_lies_free_in_its_mesh_is_said_to_float(firing: float, speed: float):
    branch = gw.follow(gw.find_orbit(with_drag_alone(firing), speed=speed), "speed", 900.0)
    end = branch.ends[-1]
    assert end.reason is EndReason.FLOATING
    assert end.reason.is_failure
    assert "mesh touches nowhere, and no other spring restrains the floating part" in end.detail
    assert "give bearing a stiffness, however small" in end.detail
    assert len(branch.points) == 1
    assert not floats(gw.find_orbit(with_drag_alone(9.7)), unheld(with_drag_alone(9.7)))
    assert not unheld(train(8.0).system()).size


@pytest.fixture(scope="module")
def there_and_back() -> tuple[gw.Branch, gw.Branch]:
    """The walk with 6 N m from 1100 to 700 rpm, and the one back from its last orbit."""
    down = gw.follow(gw.find_orbit(train(6.0).system()), "speed", 700.0)
    return down, gw.follow(down.points[-1].orbit, "speed", 1100.0)


@pytest.mark.slow
def test_a_walk_passes_a_graze_beyond_which_vanishing_impacts_hold_the_gear_both_ways(
    there_and_back: tuple[gw.Branch, gw.Branch],
):
    exact = brentq(lambda speed: reach(train(6.0).system(), speed), 880.0, 900.0, xtol=1e-9)
    for branch in there_and_back:
        assert branch.ends[-1].reason is EndReason.RANGE
        assert not branch.unexplained
        assert len(branch.points) < 250
        (graze,) = branch.special_points
        assert graze.kind == "grazing"
        assert abs(graze.value - exact) < graze.uncertainty < 1e-3
        # from below the graze on, the mesh just touches once on one side, and the motion stays stable; a point of the
        # walk may lie at the graze itself, where either is right to the error that is stated
        apart = [point for point in branch.points if abs(point.value - exact) > graze.uncertainty]
        assert len(apart) >= len(branch.points) - 2
        assert all(point.orbit.closings == (0, 0, point.value < exact, 0) for point in apart)
        assert all(point.orbit.stable for point in branch.points)


def test_vanishing_impacts_balance_the_bearing(there_and_back: tuple[gw.Branch, gw.Branch]):
    """Momentum: over a period the mesh gives the loose gear what its bearing's spring takes from it.

    All else that acts on the gear is the bearing's damping, whose mean is nought in a periodic motion.
    """
    for branch in there_and_back:
        for point in [point for point in branch.points if point.value < 891.0][:: len(branch.points) // 8]:
            orbit = point.orbit
            system = orbit.system
            bearing, mesh = system.matrix("stiffness")[2], system.vector("mesh.deflection")[2]
            spring = float(bearing @ orbit.extremes[:, 2])
            (enters, leaves) = orbit.events
            duration = (leaves.theta - enters.theta) / system.equations.frequency
            depth = 0.25 * abs(enters.velocity) * duration  # of a parabola; as long as nothing else counts
            impulse = system.equations["mesh.stiffness"] * 2.0 / 3.0 * depth * duration
            mean = impulse * system.equations.frequency / (2.0 * np.pi)
            assert abs(mesh * mean + spring) < 1e-2 * abs(spring)


def test_a_walk_turns_where_the_floating_gear_touches_both_flanks():
    """With 8 N m the mesh uses up its play from flank to flank: there the branch has a fold, and turns back."""
    system = train(8.0).system()
    branch = gw.follow(gw.find_orbit(system), "speed", 700.0)
    touch = branch.special("grazing")[-1]
    (fold,) = branch.special("fold")
    assert touch.contact == "mesh -"
    assert abs(touch.value - brentq(lambda speed: swing(system, speed), 860.0, 880.0, xtol=1e-9)) < 1e-3
    assert abs(fold.value - touch.value) < 1e-2


def test_a_part_that_is_pressed_on_a_stiff_stop_does_not_float():
    """It is pressed by 1 N on a stop of 1e7 N/m beyond a gap of 1,000 m: a depth of a ten-thousand-millionth of it."""
    stop = gw.Contact("stop", {"x": 1.0}, [gw.Stage(1000.0, 1e7, side="positive")])
    loads: Any = {"mean": {"x": 1.0}, "harmonics": [gw.Harmonic(0.2, {"x": 1.0})]}
    mass = gw.System(["x"], [[0.0]], [[100.0]], contacts=[stop], frequency=50.0, **loads)
    orbit = gw.find_orbit(mass, start=[1000.0 + 1e-7, 0.0])
    depths = orbit.turning_depths[0].values
    assert 0.0 < min(depths) < max(depths) < 2e-7
    assert not floats(orbit, unheld(mass))
