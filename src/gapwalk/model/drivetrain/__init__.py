"""Drive trains: inertias, shafts and gears by name, and how they become equations of motion."""

from gapwalk.model.drivetrain.bearing import Bearing
from gapwalk.model.drivetrain.nondimensional import NonDimensional, PaperNumbers, Scales, nondimensional, paper_numbers
from gapwalk.model.drivetrain.planetary import Planetary
from gapwalk.model.drivetrain.train import Train, chain
from gapwalk.model.drivetrain.train_orders import Counted
from gapwalk.model.drivetrain.train_parts import GROUND, Drag, Force, Friction, Gear, Inertia, Shaft

__all__ = [
    "GROUND",
    "Bearing",
    "Counted",
    "Drag",
    "Force",
    "Friction",
    "Gear",
    "Inertia",
    "NonDimensional",
    "PaperNumbers",
    "Planetary",
    "Scales",
    "Shaft",
    "Train",
    "chain",
    "nondimensional",
    "paper_numbers",
]
