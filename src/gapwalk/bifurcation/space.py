"""The space in which a branch is a curve, and motions are its points: of states, or of Fourier lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.orbit.orbit import Orbit

Knot = tuple[NDArray[np.float64], NDArray[np.float64], float]
"""A point of a curve, the unit tangent there, and its arclength."""


class Space(Protocol):
    """Scaled variables in which a branch is a curve, its parameter the last of them.

    Attributes
    ----------
    size
        How many variables, the first ones, tell a motion.
    scales
        Of all variables: physical = scale * scaled.
    """

    size: int
    scales: NDArray[np.float64]

    def knot(self, point: BranchPoint) -> Knot:
        """A point of the branch."""
        ...

    def places(self, orbit: Orbit) -> Sequence[NDArray[np.float64]]:
        """Where a motion lies, not scaled, begun at each of its phases; shape (size,) each."""
        ...

    def goal(self, orbit: Orbit, place: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """All variables of an orbit that lies at a place."""
        ...

    def correct(self, orbit: Orbit, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray | None:
        """The point of the branch on a plane, as finely resolved as an orbit; None if none is found."""
        ...

    def orbit_at(self, guess: NDArray[np.float64], value: float) -> Orbit | None:
        """The orbit of the branch at one value of the parameter, from a guess; None if none is found."""
        ...

    def tolerance(self, orbit: Orbit) -> float:
        """How far off the branch, relative to its size, an orbit may be that is one of its motions."""
        ...


def orbit_of(corrector: Corrector, correction: Correction | None, value: float) -> Orbit | None:
    """The orbit of a point that was found on a branch, if it was."""
    if correction is None:
        return None
    return corrector.equation.orbit(correction.x[:-1] * corrector.scales[:-1], value, correction.evaluation)
