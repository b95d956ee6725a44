"""The cubic coefficient of a flip: its sign tells whether doubled motions appear beyond it or vanish before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.locus.equation import MultiplierEquation
from gapwalk.motion.switching import ContactEvent

_STEPS = (6e-5, 6e-6)  # displacements in units of the state: beyond them curvature shows, below them rounding
_ALIKE = 0.05  # relative change of an impact's velocity within which displaced orbits touch in the same way
_PLACES = (-2.0, -1.0, 1.0, 2.0)
_FIRST = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0  # differences of fourth order at those places
_SECOND = np.array([-1.0, 16.0, 16.0, -1.0]) / 12.0
_SECOND_HERE = -30.0 / 12.0


def flip_coefficient(equation: MultiplierEquation, unknowns: NDArray[np.float64]) -> float:
    """The cubic coefficient at a flip, times ``w^T v``, which makes it smooth along its locus.

    With the map over m periods P, its critical vectors ``B v = -v`` and ``w^T B = -w^T`` (Kuznetsov, Elements of
    Applied Bifurcation Theory, section 5.4):

        w^T [ P'''(v, v, v) / 6 + P''(v, (1 - B)^-1 P''(v, v)) / 2 ]

    The derivatives along v come from differences of exact monodromy matrices. nan so close to a grazing contact that
    there are none at any length of motion that matters.

    Parameters
    ----------
    equation
        The equation of the flips.
    unknowns : shape (2n + 2,)
        State and both parameters at a flip.
    """
    state, (coefficients, slopes) = unknowns[:-2], equation.plane.coefficients(float(unknowns[-2]), float(unknowns[-1]))
    here = equation.plane.full_turn(coefficients, state, slopes)
    critical, monodromy = equation.criticality(here), equation.scaled(here)
    v, w = critical.directions[0], critical.covectors[0]
    for step in _STEPS:
        matrices = []
        for place in _PLACES:
            arc = equation.plane.full_turn(coefficients, state + place * step * equation.units * v, slopes)
            if not _alike(arc.contacts, here.contacts):
                break
            matrices.append(equation.scaled(arc))
        else:
            first = np.tensordot(_FIRST, matrices, 1) / step
            second = (np.tensordot(_SECOND, matrices, 1) + _SECOND_HERE * monodromy) / step**2
            bent = np.linalg.solve(np.eye(len(v)) - monodromy, first @ v)
            return float(w @ (second @ v / 6.0 + first @ bent / 2.0))
    return float("nan")


def _alike(some: list[ContactEvent], others: list[ContactEvent]) -> bool:
    """Whether two motions make the same contacts, at about the same velocities."""
    return len(some) == len(others) and all(
        a.switch == b.switch and a.enters is b.enters and abs(a.velocity - b.velocity) < _ALIKE * abs(b.velocity)
        for a, b in zip(some, others, strict=True)
    )
