"""Harmonic balance: the second way to pose orbits."""

from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.balance.orbit import BalancedOrbit
from gapwalk.orbit.balance.series import Series

__all__ = ["Balance", "BalancedOrbit", "Series"]
