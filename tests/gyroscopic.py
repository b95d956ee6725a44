"""Rotors drawn at random: gyroscopic terms in the damping matrix, gaps, and a load."""

import numpy as np
from numpy.typing import NDArray

import gapwalk as gw
from tests.bifurcation.alike.machine import Machine


def gyroscopic_system(rng: np.random.Generator) -> gw.System:
    """Draw a rotor; see `gyroscopic_machine`."""
    return gyroscopic_machine(rng).system


def gyroscopic_machine(rng: np.random.Generator) -> Machine:
    """Draw a rotor with two to four coordinates, light damping and one or two gaps."""
    n = int(rng.integers(2, 5))
    names = [f"x{place}" for place in range(n)]
    mass, stiffness, losses = (_positive(rng, n, spread) for spread in (0.2, 0.5, 0.3))
    turning = rng.normal(size=(n, n))
    turning = rng.uniform(0.3, 1.5) * (turning - turning.T)
    contacts = [
        gw.backlash(f"gap{place}", {names[place]: 1.0}, float(rng.uniform(0.5, 2.0)), float(rng.uniform(1.0, 10.0)))
        for place in range(int(rng.integers(1, 3)))
    ]
    load = gw.Harmonic(float(rng.uniform(0.05, 0.3)), {str(rng.choice(names)): 1.0})
    return Machine(tuple(names), stiffness, 0.05 * losses + turning, mass, tuple(contacts), (load,), 0.5, 2.5)


def eigenvalues(system: gw.System, *, closed: float = 0.0) -> NDArray[np.float64]:
    """Return the natural frequencies without losses, by NumPy; `closed` is the share of contact springs that acts."""
    mass, stiffness, damping = (system.matrix(which) for which in ("mass", "stiffness", "damping"))
    for form in system.structure.contacts:
        vector = system.vector(form.push)
        stiffness = stiffness + closed * system[f"{form.name}.stiffness"] * np.outer(vector, vector)
    turning, n = 0.5 * (damping - damping.T), system.size
    rates = np.linalg.solve(mass, np.hstack((stiffness, turning)))
    found = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-rates]]))
    return np.sort(found.imag)[n:]


def _positive(rng: np.random.Generator, n: int, spread: float) -> NDArray[np.float64]:
    factor = np.eye(n) + spread * rng.normal(size=(n, n))
    return factor @ factor.T
