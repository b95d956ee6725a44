"""Periodic orbits by shooting, Newton's method, Floquet multipliers, and measures of one motion."""

from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.floquet import Instability, classify, multipliers
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.method import Method, register
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Equation, Evaluation, Newton, OrbitEquation
from gapwalk.orbit.shooting import Shooting, ShootingEquation

for _method in (Shooting, Balance):  # the default comes first
    register(_method)

__all__ = [
    "Balance",
    "Equation",
    "Evaluation",
    "Instability",
    "Method",
    "Newton",
    "Orbit",
    "OrbitEquation",
    "Shooting",
    "ShootingEquation",
    "classify",
    "find_orbit",
    "multipliers",
    "register",
]
