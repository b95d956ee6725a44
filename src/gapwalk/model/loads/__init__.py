"""Loads: one class in one file each, and one line here.

`gapwalk.model.loads.load.Load` is the protocol, and says what a kind of load must give.
"""

from gapwalk.model.loads.harmonic import Harmonic
from gapwalk.model.loads.load import LOADS, Line, Load, LoadForm, check_order, register

register(Harmonic)

__all__ = ["LOADS", "Harmonic", "Line", "Load", "LoadForm", "check_order", "register"]
