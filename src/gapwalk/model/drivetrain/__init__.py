"""Drive trains: inertias, shafts and gears by name, and how they become equations of motion."""

from gapwalk.model.drivetrain.paper_numbers import PaperNumbers, paper_numbers
from gapwalk.model.drivetrain.train import Train, chain
from gapwalk.model.drivetrain.train_parts import GROUND, Gear, Inertia, Shaft
from gapwalk.model.drivetrain.train_scales import NonDimensional, Scales, nondimensional

__all__ = [
    "GROUND",
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
