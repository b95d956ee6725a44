"""Drive trains: inertias, shafts and gears by name, and how they become equations of motion."""

from gapwalk.model.drivetrain.nondimensional import NonDimensional, PaperNumbers, Scales, nondimensional, paper_numbers
from gapwalk.model.drivetrain.train import Train, chain
from gapwalk.model.drivetrain.train_orders import Counted
from gapwalk.model.drivetrain.train_parts import GROUND, Force, Friction, Gear, Inertia, Shaft

__all__ = [
    "GROUND",
    "Counted",
    "Force",
    "Friction",
    "Gear",
    "Inertia",
    "NonDimensional",
    "PaperNumbers",
    "Scales",
    "Shaft",
    "Train",
    "chain",
    "nondimensional",
    "paper_numbers",
]
