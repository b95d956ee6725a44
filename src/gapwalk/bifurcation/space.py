"""Space in which a branch is a curve and motions are its points: of states, or of Fourier lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.orbit.orbit import Orbit

Knot = tuple[NDArray[np.float64], NDArray[np.float64], float]
"""Point of a curve, the unit tangent there, and its arclength."""


class Space(Protocol):
    """Scaled variables in which a branch is a curve; the parameter is the last variable.

    Attributes
    ----------
    size
        Number of leading variables that determine a motion.
    scales
        Scales of all variables: physical = scale * scaled.
    """

    size: int
    scales: NDArray[np.float64]

    def knot(self, point: BranchPoint) -> Knot:
        """Return the knot of a point of the branch."""
        ...

    def places(self, orbit: Orbit) -> Sequence[NDArray[np.float64]]:
        """Return the unscaled coordinates of a motion for each phase at which it may begin; shape (size,) each."""
        ...

    def goal(self, orbit: Orbit, place: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """Return all variables of an orbit that lies at a place."""
        ...

    def correct(self, orbit: Orbit, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray | None:
        """Return the point of the branch in a plane, resolved as finely as an orbit; None if none is found."""
        ...

    def orbit_at(self, guess: NDArray[np.float64], value: float) -> Orbit | None:
        """Return the orbit of the branch at one value of the parameter, from a guess; None if none is found."""
        ...

    def tolerance(self, orbit: Orbit) -> float:
        """Return the largest distance from the branch, relative to its size, of an orbit that counts as one of it."""
        ...


def orbit_of(corrector: Corrector, correction: Correction | None, value: float) -> Orbit | None:
    """Return the orbit of a corrected point of a branch; None if the correction failed."""
    if correction is None:
        return None
    return corrector.equation.orbit(correction.x[:-1] * corrector.scales[:-1], value, correction.evaluation)
