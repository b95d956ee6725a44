"""Harmonic balance: the second way to pose orbits."""

from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.harmonic_balance.balanced_orbit import BalancedOrbit
from gapwalk.orbit.harmonic_balance.series import Series

__all__ = ["Balance", "BalancedOrbit", "Series"]
