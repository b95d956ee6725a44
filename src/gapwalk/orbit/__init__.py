"""Periodic orbits by shooting, Newton's method, Floquet multipliers, and measures of one motion."""

from gapwalk.orbit.equation import Equation, Evaluation
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.floquet import Instability, classify, multipliers
from gapwalk.orbit.newton import Newton
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting, ShootingEquation

__all__ = [
    "Equation",
    "Evaluation",
    "Instability",
    "Newton",
    "Orbit",
    "Shooting",
    "ShootingEquation",
    "classify",
    "find_orbit",
    "multipliers",
]
