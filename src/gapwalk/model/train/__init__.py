"""Drive trains: inertias, shafts and gears by name, and how they become equations of motion."""

from gapwalk.model.train.paper_numbers import PaperNumbers, paper_numbers
from gapwalk.model.train.parts import GROUND, Gear, Inertia, Shaft
from gapwalk.model.train.scales import NonDimensional, Scales, nondimensional
from gapwalk.model.train.train import Train, chain

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
