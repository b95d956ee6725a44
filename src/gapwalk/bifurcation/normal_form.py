"""Cubic coefficient of a flip: its sign decides between a supercritical and a subcritical flip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.switching import ContactEvent

_STEPS = (6e-5, 6e-6)  # displacements in units of the unknowns: longer ones show curvature, shorter ones rounding
_ALIKE = 0.05  # relative change of an impact velocity within which displaced orbits make the same contact
_PLACES = (-2.0, -1.0, 1.0, 2.0)
_FIRST = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0  # fourth-order differences at those places
_SECOND = np.array([-1.0, 16.0, 16.0, -1.0]) / 12.0
_SECOND_HERE = -30.0 / 12.0

Matrix = tuple[NDArray[np.float64], Sequence[ContactEvent]]
"""Derivative of a map or of an equation at a point, in units of its unknowns, and the contacts of the motion there."""


class Cubic(NamedTuple):
    """Cubic coefficient of a flip.

    Attributes
    ----------
    value
        The coefficient; nan if contacts graze within every displacement that was tried.
    error
        Difference from the coefficient by second-order differences: the effect of curvature or of rounding.
    step
        Displacement, in units of the unknowns, over which it was measured.
    """

    value: float
    error: float
    step: float


def flip_coefficient(
    matrix_at: Callable[[NDArray[np.float64]], Matrix],
    here: Matrix,
    unknowns: NDArray[np.float64],
    units: NDArray[np.float64],
    critical: tuple[NDArray[np.float64], NDArray[np.float64]],
    response: NDArray[np.float64],
    steps: Sequence[float] = _STEPS,
) -> Cubic:
    """Compute the cubic coefficient at a flip, times ``w^T v``, which makes it smooth along the flip locus.

    With the map over m periods P, its critical vectors ``B v = -v`` and ``w^T B = -w^T`` (Kuznetsov, Elements of
    Applied Bifurcation Theory, section 5.4):

        w^T [ P'''(v, v, v) / 6 + P''(v, R^-1 P''(v, v)) / 2 ],    R = 1 - B

    An equation ``F = 0`` of the doubled motions, with ``F' v = 0`` and ``w^T F' = 0``, has the same coefficient with F
    in place of P, and ``R = -F'`` on the motions of half the period (the reduction of Lyapunov and Schmidt).

    The derivatives along v are differences of exact matrices P' or F', over the longest of the steps within which no
    contact grazes: beyond a grazing point the map, and hence its derivatives, are different ones.

    Parameters
    ----------
    matrix_at
        Function that returns the matrix P' or F' and the contacts for given unknowns.
    here
        Its value at the flip.
    unknowns, units : shape (N,)
        Unknowns at the flip, and their units.
    critical
        v and w.
    response : shape (N, N)
        R.
    steps
        Displacements to try, in units of the unknowns.
    """
    v, w = critical
    for step in steps:
        matrices = []
        for place in _PLACES:
            matrix, contacts = matrix_at(unknowns + place * step * units * v)
            if not _alike(contacts, here[1]):
                break
            matrices.append(matrix)
        else:

            def coefficient(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
                bent = np.linalg.solve(response, first @ v)
                return float(w @ (second @ v / 6.0 + first @ bent / 2.0))

            first = np.tensordot(_FIRST, matrices, 1) / step
            second = (np.tensordot(_SECOND, matrices, 1) + _SECOND_HERE * here[0]) / step**2
            value = coefficient(first, second)
            _, before, after, _ = matrices
            coarser = coefficient((after - before) / (2.0 * step), (after + before - 2.0 * here[0]) / step**2)
            return Cubic(value, abs(coarser - value), step)
    return Cubic(float("nan"), float("inf"), 0.0)


def _alike(some: Sequence[ContactEvent], others: Sequence[ContactEvent]) -> bool:
    """Return whether two motions make the same contacts, at nearly the same velocities."""
    return len(some) == len(others) and all(
        a.switch == b.switch and a.enters is b.enters and abs(a.velocity - b.velocity) < _ALIKE * abs(b.velocity)
        for a, b in zip(some, others, strict=True)
    )
