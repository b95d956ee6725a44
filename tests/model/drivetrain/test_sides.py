"""Freewheels, which act on one side, and gaps whose middle is not at zero, against own equations in absolute angles."""

import io
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.train import Gear, Inertia, Shaft, Train

JS = np.array([0.4, 0.1, 3.0])


def line(**gap) -> Train:
    """A motor, a part behind a gap, and a wheel."""
    return Train(
        [Inertia("motor", 0.4), Inertia("part", 0.1), Inertia("wheel", 3.0)],
        [
            Shaft("clutch", ("motor", "part"), **{"stiffness": 40.0, "clearance": 0.1, "damping": 0.05} | gap),
            Shaft("shaft", ("part", "wheel"), stiffness=8.0, damping=0.2),
        ],
        mean={"motor": 0.6},
        reaction="wheel",
        harmonics=[gw.Harmonic(2.0, {"motor": 1.0})],
        frequency=3.0,
    )


def closes(system, force) -> None:
    """Integrate a period in absolute angles from the state of the orbit, and compare the deflections."""
    orbit = gw.find_orbit(system)
    assert orbit.events
    first = np.concatenate(
        [system.structure.assembly.numbers(system.values).angles @ half for half in np.split(orbit.state, 2)]
    )

    def rhs(time: float, y: np.ndarray) -> np.ndarray:
        x, v = y[0] - y[1], y[3] - y[4]
        clutch = force(x) + 0.05 * v
        shaft = 8.0 * (y[1] - y[2]) + 0.2 * (y[4] - y[5])
        torques = np.array([0.6 + 2.0 * math.cos(3.0 * time) - clutch, clutch - shaft, shaft - 0.6])
        return np.concatenate((y[3:], torques / JS))

    found = solve_ivp(rhs, (0.0, 2.0 * np.pi / 3.0), first, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.01)
    for half in (0, 3):
        start, end = first[half : half + 3], found.y[half : half + 3, -1]
        assert np.diff(end) == pytest.approx(np.diff(start), abs=2e-8)


def test_a_freewheel_carries_torque_on_one_side() -> None:
    closes(line(clearance=0.0, side="positive").system(), lambda x: 40.0 * max(x, 0.0))


@pytest.mark.parametrize("centre", [0.1, 0.04, -0.07])
def test_a_gap_lies_about_its_centre(centre: float) -> None:
    def force(x: float) -> float:
        return 40.0 * (max(x - centre - 0.1, 0.0) + min(x - centre + 0.1, 0.0))

    closes(line(centre=centre).system(), force)


def test_a_rigid_freewheel_keeps_its_ends_from_passing() -> None:
    system = line(stiffness=None, clearance=0.0, side="positive", restitution=0.3, damping=0.0).system()
    orbit = gw.find_orbit(system)
    motion = orbit.motion(2001)
    assert motion.signal("clutch").max() <= 1e-9
    assert motion.signal("clutch").min() < -1e-4
    assert orbit.measure("mean.shaft.torque") == pytest.approx(0.6, rel=1e-3)  # its damper jumps at impacts


def test_a_freewheel_that_overruns_for_ever_is_said() -> None:
    with pytest.raises(ConvergenceError, match=r"Clutch acts on one side only, .* it overruns for ever"):
        gw.find_orbit(line(clearance=0.0, side="negative").system())


def test_units_and_files_know_sides_and_centres() -> None:
    text = """
speed = "600 rpm"
[[inertia]]
name = "a"
inertia = "1 kg m^2"
[[inertia]]
name = "b"
inertia = "2 kg m^2"
[[gear]]
name = "mesh"
between = ["a", "b"]
ratio = 2
stiffness = "10 N m/rad"
clearance = "0.1 deg"
centre = "{centre}"
side = "{side}"
[[harmonic]]
varies = "mesh.stiffness"
amplitude = 0.1
"""
    system = gw.read_model(io.StringIO(text.format(centre="0.1 deg", side="both")))
    assert [system[f"mesh.{each}.clearance"] for each in ("positive", "negative")] == pytest.approx([0.2, 0.0])
    assert len(system.structure.variations) == 4  # with the cubic terms
    system = gw.read_model(io.StringIO(text.format(centre="0.05 deg", side="negative")))
    assert system["mesh.clearance"] == pytest.approx(0.05)
    with pytest.raises(ModelError, match=r"centre = 0\.05"):
        gw.read_model(io.StringIO(text.format(centre="0.3 deg", side="both")))
    contact = gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0, centre=-1.0)])
    assert [(each.side, each.clearance) for each in contact.stages] == [("positive", 0.0), ("negative", 2.0)]


def test_a_side_or_a_centre_without_a_gap_is_refused() -> None:
    for what in ({"side": "positive"}, {"centre": 0.1}):
        with pytest.raises(ModelError, match="no clearance"):
            Train([Inertia("a", 1.0), Inertia("b", 1.0)], gears=[Gear("g", ("a", "b"), 2.0, stiffness=1.0, **what)])
