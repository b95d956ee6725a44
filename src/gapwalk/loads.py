"""Loads, and what a load of your own needs."""

from gapwalk.model.loads import Harmonic, Line, Load, Mean, register
from gapwalk.model.parameter import Parameter

__all__ = ["Harmonic", "Line", "Load", "Mean", "Parameter", "register"]
