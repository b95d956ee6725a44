"""Loads: one class in one file each, and one line here.

`gapwalk.model.loads.load.Load` is the protocol, and says what a kind of load must give.
"""

from gapwalk.model.loads.cylinder import Cylinder
from gapwalk.model.loads.load import (
    LOADS,
    Harmonic,
    Levels,
    Line,
    Load,
    LoadForm,
    Rectangle,
    Steady,
    check_order,
    register,
)
from gapwalk.model.loads.measured import Measured

for _kind in (Harmonic, Measured, Rectangle, Steady, Cylinder):
    register(_kind)

__all__ = [
    "LOADS",
    "Cylinder",
    "Harmonic",
    "Levels",
    "Line",
    "Load",
    "LoadForm",
    "Measured",
    "Rectangle",
    "Steady",
    "check_order",
    "register",
]
