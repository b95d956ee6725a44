"""The gear pair of Kahraman and Singh (1991) as a model file: mesh stiffness and transmission error of three orders.

The folds are those of another program, which integrates the equation of the deflection by DOP853.
"""

import io

import pytest

import gapwalk as gw

KAHRAMAN = """
title = "gear pair of Kahraman and Singh (1991)"
reaction = "wheel"
mean = { pinion = 0.1 }
frequency = 0.88
inertia = [{ name = "pinion", inertia = 2.0 }, { name = "wheel", inertia = 2.0 }]
harmonic = [
    { name = "k1", order = 1, varies = "mesh.stiffness", amplitude = -0.2 },
    { name = "k2", order = 2, varies = "mesh.stiffness", amplitude = -0.1 },
    { name = "k3", order = 3, varies = "mesh.stiffness", amplitude = -0.05 },
    { name = "e1", order = 1, varies = "mesh.deflection", amplitude = -0.01 },
    { name = "e2", order = 2, varies = "mesh.deflection", amplitude = -0.004 },
    { name = "e3", order = 3, varies = "mesh.deflection", amplitude = -0.002 },
]
[[gear]]
name = "mesh"
between = ["pinion", "wheel"]
ratio = 1.0
stiffness = 1.0
damping = 0.1
clearance = 1.0
"""


def test_the_gear_pair_has_its_folds() -> None:
    assert len(KAHRAMAN.splitlines()) < 40
    branch = gw.follow(gw.find_orbit(gw.read_model(io.StringIO(KAHRAMAN))), "frequency", 0.42)
    found = [each.value for each in branch.special_points if each.kind == gw.Kind.FOLD]
    assert found == pytest.approx([0.5981531173, 0.8358376791, 0.4370070933, 0.4553240678], abs=1e-9)
