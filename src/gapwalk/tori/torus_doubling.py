"""Doubling of a torus: the direction in which it loses or gains stability, and the smallest tori of twice the period.

Deviations ``w(psi)`` from a curve are carried to ``w -> DP(psi - rho) w(psi - rho)``. If the torus is reducible, the
eigenvalues of this operator are ``mu exp(2 pi i k rho)`` with the normal multipliers mu and all integers k (Jorba
2001, Nonlinearity 14, 943-976). One of them is -1 where the torus doubles: beside it are tori of twice as many curves.
Another one than that of the tangent is 1 where two families cross. If none is real, the direction turns over once along
the curve: the torus becomes one of half the rotation number, which is twice as long.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.tori.closed_curve import rotation_matrices, tangents
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_equation import TorusEquation

_EXACT = 1e-4  # distance of an eigenvalue from -1 or 1 at a located change of stability that is an error of it
_SIDEWAYS = 0.5  # share of a direction that is not along the curve, from which on it is another one than the tangent


class Change(StrEnum):
    """What happens where one normal exponent passes zero beside a fold; the value is in the event's words."""

    DOUBLES = "the tori of twice as many curves begin or end here"
    CROSSES = "another family of tori crosses here"
    TURNS_OVER = "its direction turns over along the curve: tori of half the rotation number begin or end here"


def change_at(torus: Torus) -> tuple[Change, NDArray[np.float64]]:
    """Return what happens at a torus with a normal exponent of zero, and the direction, shape (N, state_size)."""
    values, directions = _spectrum(torus)
    for change, target in ((Change.DOUBLES, -1.0), (Change.CROSSES, 1.0)):
        near = np.flatnonzero(np.abs(values - target) < _EXACT)
        sideways = [(place, _real(directions[place])) for place in near.tolist()]
        sideways = [each for each in sideways if target < 0.0 or _off_curve(torus, each[1]) > _SIDEWAYS]
        if sideways:
            place, direction = min(sideways, key=lambda each: abs(values[each[0]] - target))
            return change, direction
    place = int(np.argmin(np.abs(np.abs(values) - 1.0)))
    return Change.TURNS_OVER, _real(directions[place])


def _spectrum(torus: Torus) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return eigenvalues and eigenvectors, shape (N size, N, size), of the operator on deviations, in scaled states."""
    system = torus.system
    equation = TorusEquation(system, system.structure.names[0], torus.curves, torus.states)
    found = equation.linearise(np.append(torus.states, torus.rotation), float(system.values[0]))
    unit = system.state_scales()
    maps = found.transitions * unit / unit[:, None]
    back, _ = rotation_matrices(torus.count, -torus.rotation)
    count, size = torus.states.shape
    operator = np.einsum("jk,kab->jakb", back, maps).reshape(count * size, count * size)
    values, vectors = np.linalg.eig(operator)
    directions = np.asarray(vectors.T.reshape(-1, count, size) * unit, dtype=np.complex128)
    return np.asarray(values, dtype=np.complex128), directions


def _real(direction: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the real direction of a complex one with a common factor, with the largest entry 1."""
    largest = direction.ravel()[np.abs(direction).argmax()]
    return (direction / largest).real


def _off_curve(torus: Torus, direction: NDArray[np.float64]) -> float:
    """Return how far a direction leaves that of the tangents of the curve, as a share of it."""
    unit = torus.system.state_scales()
    along, given = (tangents(torus.states) / unit).ravel(), (direction / unit).ravel()
    along /= np.linalg.norm(along)
    return float(np.linalg.norm(given - (given @ along) * along) / np.linalg.norm(given))
