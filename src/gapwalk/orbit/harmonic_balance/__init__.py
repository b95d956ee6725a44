"""Harmonic balance: the second method for orbits."""

from gapwalk.orbit.harmonic_balance.balance import Balance, BalancedOrbit
from gapwalk.orbit.harmonic_balance.linear_part import Series

__all__ = ["Balance", "BalancedOrbit", "Series"]
