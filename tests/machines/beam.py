"""NLvib 12: a clamped beam with a cubic spring at its end, by finite elements and harmonic balance (30 coordinates)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.linalg import eigh
from scipy.sparse import coo_matrix

from tests.machines.balance import Balance

HERE = Path(__file__).parent
ELEMENTS, LENGTH, SIDE, MODULUS, DENSITY = 15, 2.7, 0.01, 45e9, 1780.0
CUBIC, FORCE, ALPHA, BETA = 4.0, 2e-3, 1.25e-4, 2.5e-4


def matrices():
    """Assemble mass and stiffness of Euler-Bernoulli elements, clamped left: deflection and slope of each node."""
    h, area, inertia = LENGTH / ELEMENTS, SIDE**2, SIDE**4 / 12
    stiffness = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    mass = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    scale = np.array([1.0, h, 1.0, h])  # the slopes have the unit of a deflection over a length
    stiffness, mass = stiffness * np.outer(scale, scale), mass * np.outer(scale, scale)
    size = 2 * (ELEMENTS + 1)
    m, k = np.zeros((size, size)), np.zeros((size, size))
    for i in range(0, size - 2, 2):
        k[i : i + 4, i : i + 4] += MODULUS * inertia / h**3 * stiffness
        m[i : i + 4, i : i + 4] += DENSITY * area * h / 420 * mass
    return m[2:, 2:], k[2:, 2:]


def write():
    """Write the matrices that `beam.toml` names."""
    for name, matrix in zip(("mass", "stiffness"), matrices(), strict=True):
        lower = coo_matrix(np.tril(matrix))
        mmwrite(
            HERE / f"beam_{name}.mtx", lower + coo_matrix(np.tril(matrix, -1)).T, symmetry="symmetric", precision=17
        )


def balanced(harmonics):
    """Pose harmonic balance in the modes of the linear beam, whose equations are well scaled; and the modes."""
    mass, stiffness = matrices()
    squares, modes = eigh(stiffness, mass)
    end = modes[-2]

    def cubic(q):
        return np.outer(end, CUBIC * (end @ q) ** 3)

    damping = np.diag(ALPHA + BETA * squares)
    parts = np.eye(len(mass)), damping, np.diag(squares), cubic, FORCE * end
    return Balance(*parts, harmonics, 8 * harmonics), modes


def orbits(frequencies=(6.9, 7.0, 7.05), harmonics=9):
    """Periodic responses: the state at theta = 0, the amplitude of order 1 at the end; the error by more harmonics."""
    found = []
    for w in frequencies:
        states = []
        for h in (harmonics, harmonics + 2):
            system, modes = balanced(h)
            x = system.correct(system.first(6.5))
            for step in np.linspace(6.5, w, 12)[1:]:  # along the upper branch
                x[-1] = step
                x = system.correct(x)
            q = x[:-1].reshape(2 * h + 1, -1) @ modes.T
            order = np.arange(1, h + 1) * w
            states.append(np.concatenate((q[0] + q[1::2].sum(axis=0), order @ q[2::2])))
        entry = {"frequency": w, "state": states[1].tolist(), "order_1": float(np.hypot(*q[1:3, -2]))}
        found.append(entry | {"error": float(np.max(np.abs(states[1] - states[0])))})
    return found


if __name__ == "__main__":
    write()
