"""Gears that move in their bearings, against equations in metres."""

import io
import math

import numpy as np
import pytest
from scipy.linalg import eigh

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.train import Bearing, Gear, Inertia, Shaft, Train

R1, R2, M1, M2, K1, K2, K = 0.04, 0.07, 1.2, 2.5, 2e8, 1.5e8, 3e8
J1, J2, J3, TWIST = 0.001, 0.006, 0.05, 4000.0

PAIR = """
speed = "1200 rpm"
[[inertia]]
name = "pinion"
inertia = "0.001 kg m^2"
[[inertia]]
name = "wheel"
inertia = "0.006 kg m^2"
[[inertia]]
name = "load"
inertia = "0.05 kg m^2"
[[shaft]]
name = "shaft"
between = ["wheel", "load"]
stiffness = "4000 N m/rad"
[[gear]]
name = "mesh"
between = ["pinion", "wheel"]
ratio = 1.75
stiffness = "480000 N m/rad"
[[bearing]]
name = "front"
carries = "pinion"
radius = "40 mm"
mass = "1.2 kg"
stiffness = "200 N/um"
[[bearing]]
name = "rear"
carries = "wheel"
radius = "70 mm"
mass = "2.5 kg"
stiffness = "1.5e8 N/m"
angle = 30
"""


def test_modes_of_a_gear_pair_are_those_in_metres() -> None:
    """With y along the line of action: delta = r1 t1 - r2 t2 + y1 - y2, the wheel's way at 30 degrees to it."""
    mesh = np.array([R1, -R2, 0.0, 1.0, -math.cos(math.radians(30.0))])
    twist = np.array([0.0, 1.0, -1.0, 0.0, 0.0])
    stiffness = K * np.outer(mesh, mesh) + TWIST * np.outer(twist, twist) + np.diag([0.0, 0.0, 0.0, K1, K2])
    wanted = np.sqrt(np.maximum(eigh(stiffness, np.diag([J1, J2, J3, M1, M2]), eigvals_only=True), 0.0))
    system = gw.read_model(io.StringIO(PAIR))
    assert np.array(gw.find_modes(system).frequencies) == pytest.approx(wanted[1:], rel=1e-9)
    assert system.parameters["front.stiffness"] == pytest.approx(K1 * R1**2)


def test_a_clearance_of_a_bearing_is_an_angle_of_the_gear() -> None:
    text = PAIR.replace('"200 N/um"', '"200 N/um"\nclearance = "20 um"')
    system = gw.read_model(io.StringIO(text))
    assert system["front.clearance"] * system.units.of(gw.model.units.QuantityKind.ANGLE).factor == pytest.approx(5e-4)


def test_two_bearings_hold_a_gear_in_its_plane() -> None:
    """A mesh at 25 degrees moves along both: with equal springs as one bearing along the line of action does."""
    own = {"carries": "a", "radius": 0.5, "mass": 3.0, "stiffness": 80.0}
    bodies = [Inertia("a", 1.0), Inertia("b", 2.0)]
    gears = [Gear("mesh", ("b", "a"), -1.5, stiffness=40.0)]
    plane = [Bearing("x", **own, angle={"mesh": 25.0}), Bearing("y", **own, angle={"mesh": -65.0})]
    one, two = (Train(bodies, [], gears, bearings=each).system() for each in ([Bearing("x", **own)], plane))
    found, wanted = (np.array(gw.find_modes(each).frequencies) for each in (two, one))
    across = math.sqrt(80.0 / 3.0)
    assert found == pytest.approx(sorted([*wanted, across]))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"carries": "nobody"}, "which is no inertia"),
        ({"carries": "c"}, "no teeth that could move it"),
        ({"angle": {"other": 0.0}}, "no gear of a"),
        ({"mass": 0.0}, "must be a number > 0"),
        ({"radius": "40 kg"}, 'such as "2 m"'),
        ({"stiffness": "many"}, 'such as "2 N/m"'),
    ],
)
def test_errors_of_bearings_say_what_to_write(changes: dict, words: str) -> None:
    own = {"carries": "a", "radius": 0.5, "mass": 3.0, "stiffness": 80.0} | changes
    bodies = [Inertia(each, 1.0) for each in "abc"]
    gears, shafts = [Gear("mesh", ("b", "a"), 1.5, stiffness=40.0)], [Shaft("s", ("a", "c"), stiffness=2.0)]
    with pytest.raises(ModelError) as error:
        Train(bodies, shafts, gears, bearings=[Bearing("x", **own)])
    assert words in str(error.value)
