"""Machines for the page: a train of five inertias in units, a chain of ten masses, and the clutch of figure 13."""

from tests.explorer.conftest import CLUTCH

FIVE = """\
title = "Five inertias from the engine to the vehicle, with backlash in the gearbox"
speed = "1500 rpm"
mean = { engine = "4 N m" }
reaction = "vehicle"
inertia = [
    { name = "engine", inertia = "0.14 kg m^2" },
    { name = "hub", inertia = "0.005 kg m^2" },
    { name = "output", inertia = "0.02 kg m^2" },
    { name = "wheels", inertia = "0.8 kg m^2" },
    { name = "vehicle", inertia = "6 kg m^2" },
]
shaft = [
    { name = "clutch", between = ["engine", "hub"], stiffness = "20 N m/deg", damping = "0.6 N m s/rad" },
    { name = "propshaft", between = ["output", "wheels"], stiffness = "60 N m/deg", damping = "0.6 N m s/rad" },
    { name = "tyres", between = ["wheels", "vehicle"], stiffness = "50 N m/deg", damping = "8 N m s/rad" },
]

[[gear]]
name = "third"
between = ["hub", "output"]
ratio = 1.3
stiffness = "400 N m/deg"
damping = "1 N m s/rad"
clearance = "0.05 deg"

[[harmonic]]
name = "firing"
order = 2
amplitude = "120 N m"
acts_on = { engine = 1.0 }

[study]
kind = "response"
parameter = "speed"
from = "2000 rpm"
to = "1300 rpm"
measure = "half.third"
"""

_ROWS = [[2.0 * (i == j) - 1.0 * (abs(i - j) == 1) for j in range(10)] for i in range(10)]
CHAIN = f"""\
title = "Chain of ten masses that ends at a stop"
coordinates = {[f"x{i + 1}" for i in range(10)]}
stiffness = {_ROWS}
damping = {[[round(0.05 * each, 3) for each in row] for row in _ROWS]}

[[contact]]
name = "stop"
deflection = {{ x10 = 1.0 }}
clearance = 0.2
stiffness = 4.0
side = "positive"

[[harmonic]]
amplitude = 0.5
acts_on = {{ x10 = 1.0 }}

[study]
kind = "response"
parameter = "frequency"
from = 2.5
to = 0.5
measure = "max.x10"
""".replace("'", '"')

MACHINES = {"five": FIVE, "chain": CHAIN, "clutch": CLUTCH.read_text(encoding="utf-8")}
