"""Loads: one class in one file each, and one line here.

`gapwalk.model.loads.load.Load` is the protocol, and says what a kind of load must give.
"""

from gapwalk.model.loads.harmonic import Harmonic
from gapwalk.model.loads.load import LOADS, Levels, Line, Load, LoadForm, check_order, register
from gapwalk.model.loads.measured import Measured
from gapwalk.model.loads.rectangle import Rectangle
from gapwalk.model.loads.steady import Steady

for _kind in (Harmonic, Measured, Rectangle, Steady):
    register(_kind)

__all__ = [
    "LOADS",
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
