"""Loads that vary a train, against equations written body by body in SI units, and against a plain system."""

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import coefficients_of, layout_of

DEGREE = math.pi / 180.0
RPM = math.pi / 30.0
BODIES = ("motor", "p1", "w1", "p2", "load")
INERTIA = {"motor": 0.05, "p1": 0.002, "w1": 0.01, "p2": 0.003, "load": 0.4}
GAP, SPEED = 0.05 * DEGREE, 1200.0


def varied() -> list:
    """Loads of all kinds: meshes, transmission errors, and a torque that grows with the speed."""
    return [
        gw.train.Counted(gw.Harmonic(0.2, varies="mesh1.stiffness", name="k1"), mesh="mesh1"),
        gw.train.Counted(gw.Rectangle(0.15, "mesh2.stiffness", share=0.6, phase="0.4 rad", name="k2"), mesh="mesh2"),
        gw.train.Counted(
            gw.Harmonic("0.002 deg", varies="mesh1.deflection", name="te1", order=2, phase="0.3 rad"), mesh="mesh1"
        ),
        gw.train.Counted(gw.Harmonic("3e-5 rad", varies="mesh2.deflection", name="te2"), mesh="mesh2"),
        gw.Harmonic("20 N m", {"motor": 1.0}, order=2, name="torque", growth=2, at="1000 rpm"),
    ]


def stages(**changes) -> gw.train.Train:
    """Two meshes, one with backlash, with varying stiffness and transmission errors, in mixed units."""
    given = {
        "inertias": [gw.train.Inertia(name, f"{value} kg m^2") for name, value in INERTIA.items()],
        "shafts": [
            gw.train.Shaft("input", ("motor", "p1"), stiffness="300 N m/deg", damping="0.5 N m s/rad"),
            gw.train.Shaft("middle", ("w1", "p2"), stiffness="3e4 N m/rad", damping="0.7 N m s/rad"),
        ],
        "gears": [
            gw.train.Gear(
                "mesh1",
                ("p1", "w1"),
                teeth=[24, 48],
                stiffness="2e5 N m/rad",
                damping="2 N m s/rad",
                clearance="0.05 deg",
            ),
            gw.train.Gear("mesh2", ("p2", "load"), teeth=[18, 54], stiffness="1e5 N m/rad", damping="3 N m s/rad"),
        ],
        "forces": [gw.train.Force("seal", ("p1", "motor"), "a*v + b*v*abs(v) + k*x**3", a="0.01 N m s/rad",
                                  b="0.002 N m s^2/rad^2", k="3e4 N m/deg^3")],
        "mean": {"motor": "50 N m"},
        "reaction": "load",
        "harmonics": varied(),
        "speed": f"{SPEED} rpm",
    }  # fmt: skip
    return gw.train.Train(**(given | changes))


def by_hand(t: float, angle: np.ndarray, speed: np.ndarray, shaken: bool = False) -> np.ndarray:
    """Accelerations of the bodies in rad/s^2: all in SI units, written without gapwalk."""
    turn = SPEED * RPM * t
    u = dict(zip(BODIES, angle, strict=True))
    v = dict(zip(BODIES, speed, strict=True))
    if shaken:
        u["motor"], v["motor"] = shake(t)
    torque = dict.fromkeys(BODIES, 0.0)
    torque["motor"] += 50.0 + 20.0 * (SPEED / 1000.0) ** 2 * math.cos(2 * turn)
    torque["load"] -= 50.0 * 6.0

    def join(first: str, second: str, ratio: float, force: float) -> None:
        torque[first] -= force
        torque[second] += ratio * force

    x, w = u["motor"] - u["p1"], v["motor"] - v["p1"]
    join("motor", "p1", 1.0, 300.0 / DEGREE * x + 0.5 * w)
    join("p1", "motor", 1.0, -0.01 * w - 0.002 * w * abs(w) - 3e4 / DEGREE**3 * x**3)
    join("w1", "p2", 1.0, 3e4 * (u["w1"] - u["p2"]) + 0.7 * (v["w1"] - v["p2"]))
    mesh, rate = 24 * turn, 24 * SPEED * RPM
    x = u["p1"] - 2 * u["w1"] + 0.002 * DEGREE * math.cos(2 * mesh + 0.3)
    w = v["p1"] - 2 * v["w1"] - 0.002 * DEGREE * 2 * rate * math.sin(2 * mesh + 0.3)
    depth = math.copysign(max(abs(x) - GAP, 0.0), x)
    join("p1", "w1", 2.0, 2e5 * (1 + 0.2 * math.cos(mesh)) * depth + 2.0 * w)
    mesh, rate = 9 * turn, 9 * SPEED * RPM
    high = math.cos(mesh + 0.4) > math.cos(0.6 * math.pi)
    factor = 1.15 if high else 1 - 0.15 * 0.6 / 0.4
    x = u["p2"] - 3 * u["load"] + 3e-5 * math.cos(mesh)
    w = v["p2"] - 3 * v["load"] - 3e-5 * rate * math.sin(mesh)
    join("p2", "load", 3.0, 1e5 * factor * x + 3.0 * w)
    return np.array([torque[name] / INERTIA[name] for name in BODIES])


def shake(t: float) -> tuple[float, float]:
    """The motion of the motor about its steady rotation."""
    w = SPEED * RPM
    wave = [(0.4 * DEGREE, 1, 0.2), (0.1 * DEGREE, 2, 0.0)]
    return (
        sum(size * math.cos(h * w * t + phase) for size, h, phase in wave),
        sum(-size * h * w * math.sin(h * w * t + phase) for size, h, phase in wave),
    )


ROWS = {"input": (1, -1, 0, 0, 0), "middle": (0, 0, 1, -1, 0), "mesh1": (0, 1, -2, 0, 0), "mesh2": (0, 0, 0, 1, -3)}


def shaken() -> gw.train.Train:
    """The same train, with the motion of the motor prescribed."""
    free = [gw.train.Inertia(name, f"{INERTIA[name]} kg m^2") for name in BODIES[1:]]
    return stages(
        inertias=[gw.train.Inertia("motor"), *free],
        mean={"load": "-300 N m"},
        reaction=None,
        harmonics=[
            *varied()[:4],
            gw.Harmonic("0.4 deg", varies="motor.angle", phase="0.2 rad", name="first"),
            gw.Harmonic("0.1 deg", varies="motor.angle", order=2, name="second"),
        ],
    )


@pytest.mark.parametrize("prescribed", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_the_equations_are_those_written_body_by_body(seed: int, prescribed: bool) -> None:
    random = np.random.default_rng(seed)
    system = (shaken() if prescribed else stages()).system()
    t = random.uniform(0.0, 0.2)
    angle, speed = random.normal(0, 2 * GAP, 5), random.normal(0, 3.0, 5)
    if prescribed:
        angle[0], speed[0] = 0.0, 0.0  # coordinates count the motor as steady
    rows = np.array([ROWS[name] for name in system.coordinates], float)
    found = accelerations(
        layout_of(system.structure),
        coefficients_of(system),
        system.frequency * t,
        rows @ angle / DEGREE,
        rows @ speed / DEGREE,
    )
    moved = by_hand(t, angle, speed, prescribed)
    if prescribed:
        moved[0] = 0.0
    np.testing.assert_allclose(found * DEGREE, rows @ moved, rtol=1e-11)
