"""Chains of masses that the tests of reductions share."""

from __future__ import annotations

import numpy as np

from gapwalk import Harmonic, System, backlash


def stiffness_of(size: int, spring: float = 1.0, *, free: bool = False) -> np.ndarray:
    """The stiffness of a chain of equal springs between two walls, or of a free one."""
    matrix = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    if free:
        matrix[0, 0] = matrix[-1, -1] = 1.0
    return spring * matrix


def rod(size: int, gaps: int = 2, load: float = 1.0, frequency: float = 0.2) -> System:
    """A rod between two walls, cut into masses, with gaps to ground along it; the same rod whatever the size."""
    names = tuple(f"q{index}" for index in range(size))
    stiffness = stiffness_of(size, (size / 10.0) ** 2)
    damping = 0.05 * np.eye(size) + 0.01 * stiffness
    places = np.linspace(0.5 * size / gaps, size - 0.5 * size / gaps, gaps).astype(int)
    contacts = [
        backlash(f"gap{k}", {names[place]: 1.0}, 0.1 + 0.05 * k, 0.2 * size, impact_damping=0.1)
        for k, place in enumerate(places)
    ]
    drive = Harmonic(0.01 * load * size, {names[size // 20]: 1.0})
    return System(names, stiffness, damping, contacts=contacts, harmonics=[drive], frequency=frequency)
