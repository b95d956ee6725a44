"""Drive trains: their parts, chains of equal parts, scales, and the numbers of Padmanabhan and Singh (1995)."""

from gapwalk.model.drivetrain import (
    Gear,
    Inertia,
    NonDimensional,
    PaperNumbers,
    Scales,
    Shaft,
    Train,
    chain,
    nondimensional,
    paper_numbers,
)
from gapwalk.model.drivetrain.train_parts import Link
from gapwalk.model.units import Quantity, Units

__all__ = [
    "Gear",
    "Inertia",
    "Link",
    "NonDimensional",
    "PaperNumbers",
    "Quantity",
    "Scales",
    "Shaft",
    "Train",
    "Units",
    "chain",
    "nondimensional",
    "paper_numbers",
]
