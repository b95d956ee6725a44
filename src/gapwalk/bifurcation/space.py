"""Space in which a branch is a curve and motions are its points: of states at some angles, for a branch by shooting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.orbit.orbit import Orbit, phases

Knot = tuple[NDArray[np.float64], NDArray[np.float64], float]
"""Point of a curve, the unit tangent there, and its arclength."""


class StateSpace:
    """Scaled variables in which a branch is a curve; the parameter is the last variable.

    Here they are the states at some angles, by shooting the starts of the segments. A method whose unknowns are of
    another kind derives a class, which is registered with `gapwalk.bifurcation.membership.space_of`.

    Parameters
    ----------
    branch, points
        The branch, and points of it.

    Attributes
    ----------
    size
        Number of leading variables that determine a motion.
    scales
        Scales of all variables: physical = scale * scaled.
    corrector
        Corrector for the branch.
    """

    def __init__(self, branch: Branch, points: Sequence[BranchPoint]) -> None:
        self.size, self._period = 2 * branch.system.size, branch.period
        segments = (len(points[0].x) - 1) // self.size
        physical = np.abs([np.append(point.orbit.state, point.value) for point in points]).sum(axis=0)
        scaled = np.abs([np.append(point.x[: self.size], point.x[-1]) for point in points]).sum(axis=0)
        scales = np.divide(physical, scaled, out=np.ones_like(physical), where=scaled > 0.0)
        self.scales = np.append(np.tile(scales[:-1], segments), scales[-1])
        method = points[0].orbit.posed_in(len(points[0].x) - 1)
        self.corrector = Corrector(method.pose(branch.system, branch.parameter, branch.period), self.scales)

    def knot(self, point: BranchPoint) -> Knot:
        """Return the knot of a point of the branch."""
        return point.x, point.tangent, point.arclength

    def places(self, orbit: Orbit) -> Sequence[NDArray[np.float64]]:
        """Return the unscaled coordinates of a motion for each phase at which it may begin; shape (size,) each."""
        return list(phases(orbit))

    def goal(self, orbit: Orbit, place: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """Return all variables of an orbit that lies at a place."""
        if len(self.scales) == self.size + 1:
            return np.append(place / self.scales[:-1], value)
        unknowns = self.corrector.equation.unknowns(replace(orbit, state=place, period=self._period))
        return np.append(unknowns / self.scales[:-1], value)

    def correct(self, orbit: Orbit, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray | None:
        """Return the point of the branch in a plane, resolved as finely as an orbit; None if none is found."""
        correction = self.corrector.correct(guess, normal)
        return None if correction is None else correction.x

    def orbit_at(self, guess: NDArray[np.float64], value: float) -> Orbit | None:
        """Return the orbit of the branch at one value of the parameter, from a guess; None if none is found."""
        correction = self.corrector.at_value(guess, value)
        if correction is None:
            return None
        return self.corrector.equation.orbit(correction.x[:-1] * self.scales[:-1], value, correction.evaluation)

    def tolerance(self, orbit: Orbit) -> float:
        """Return the largest distance from the branch, relative to its size, of an orbit that counts as one of it."""
        return 0.0
