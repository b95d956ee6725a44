"""A drive train with units for several tests, and the same numbers in SI units by hand."""

import math

import numpy as np

import gapwalk as gw
from gapwalk.model import System
from gapwalk.model.coefficients import ParameterLine

DEGREE = math.pi / 180.0

FLYWHEEL, HUB, BOX = 0.14, 0.005, 0.03
FIRST, SECOND, SHAFT = 2.0 / DEGREE, 28.0 / DEGREE, 1e4
DAMPING, SHAFT_DAMPING, BETA, GAP = 0.3, 0.5, 0.05, 3.0 * DEGREE
MEAN, SIZE, ORDER = 20.0, 100.0, 2


def physical(speed: str = "1500 rpm") -> gw.train.Train:
    """Flywheel, hub and gearbox in kg m^2, N m, deg and rpm."""
    return gw.train.Train(
        [
            gw.train.Inertia("flywheel", "0.14 kg m^2"),
            gw.train.Inertia("hub", "50 kg cm^2"),
            gw.train.Inertia("box", "0.03 kg m²"),
        ],
        [
            gw.train.Shaft(
                "clutch",
                ("flywheel", "hub"),
                stiffness="2 N m/deg",
                damping="0.3 N m s/rad",
                stages=(gw.Stage("3 deg", "28 Nm/deg"),),
                impact_damping="0.05 s/rad",
            ),
            gw.train.Shaft("input", ("hub", "box"), stiffness="1e4 N m/rad", damping="0.5 N m s/rad"),
        ],
        mean={"flywheel": "20 N m", "box": "-20 N m"},
        harmonics=[gw.Harmonic("100 N m", {"flywheel": 1.0}, order=ORDER)],
        speed=speed,
    )


def by_hand(speed: float = 1500.0) -> gw.train.Train:
    """The same in SI units."""
    return gw.train.Train(
        [gw.train.Inertia("flywheel", FLYWHEEL), gw.train.Inertia("hub", HUB), gw.train.Inertia("box", BOX)],
        [
            gw.train.Shaft(
                "clutch",
                ("flywheel", "hub"),
                stiffness=FIRST,
                damping=DAMPING,
                stages=(gw.Stage(GAP, SECOND),),
                impact_damping=BETA,
            ),
            gw.train.Shaft("input", ("hub", "box"), stiffness=SHAFT, damping=SHAFT_DAMPING),
        ],
        mean={"flywheel": MEAN, "box": -MEAN},
        harmonics=[gw.Harmonic(SIZE, {"flywheel": 1.0})],
        frequency=ORDER * speed * math.pi / 30.0,
    )


def check_slopes(system: System) -> None:
    """Compare the derivatives of all coefficients by each number with extrapolated differences, to 1e-8."""
    for name in system.structure.names:
        line, value = ParameterLine(system, name), system[name]
        middle, slope = line.coefficients(value)
        steps, found = (abs(value) or 1.0) / 64.0 / 2.0 ** np.arange(4), []
        for step in steps:  # Romberg's scheme: the error is of order step^8
            ahead, behind = (line.coefficients(value + sign * step)[0] for sign in (1.0, -1.0))
            row = [(ahead - behind) / (2.0 * step)]
            for level, before in enumerate(found[-1] if found else [], start=1):
                row.append(row[-1] + (row[-1] - before) / (4.0**level - 1.0))
            found.append(row)
        expected = found[-1][-1]
        rounding = 1e-13 * (np.abs(middle) + 1e-3) / steps[-1]  # of the differences; some coefficients are 0
        assert np.all(np.abs(slope - expected) <= 1e-8 * np.abs(expected) + rounding), name
