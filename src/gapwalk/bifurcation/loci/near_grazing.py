"""Orbits of a locus on which a contact is about to touch, found by the depth at which its deflection turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.loci.grazing_equation import MARGIN, TouchEquation
from gapwalk.bifurcation.loci.multiplier_equation import MultiplierEquation
from gapwalk.bifurcation.loci.solution_curve import Secant, zero_along
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.orbit import Orbit

_SECANT = Secant()


class NearGrazing:
    """Orbits of a locus of multipliers on which one deflection turns at a given depth beyond its breakpoint.

    The condition on the multipliers changes like the square root of that depth. The orbits of a given depth, however,
    form a smooth curve close to the grazing locus, and the condition is smooth along it. So the orbits are found by
    following that curve to the point where the condition holds.

    Parameters
    ----------
    corrector
        Corrector for the locus of multipliers.
    switch
        Stage and side, as an index into `Equations.switches`.
    """

    def __init__(self, corrector: Corrector, switch: int) -> None:
        equation = corrector.equation
        assert isinstance(equation, MultiplierEquation)
        self.equation, self.unit = equation, float(corrector.scales[0])
        self.margin = MARGIN * self.unit
        self._touch = TouchEquation(equation.plane, switch, 0.0, min(equation.tolerance, 0.1 * self.margin))
        self._scales = np.insert(corrector.scales, -2, PERIOD)

    def beside(self, point: BranchPoint, theta: float) -> NDArray[np.float64]:
        """Return the initial variables for orbits near a point of the locus, with the turning point at `theta`."""
        return np.insert(point.x, -2, theta / PERIOD)

    def turns_highest(self, start: NDArray[np.float64]) -> bool:
        """Return whether the deflection has a maximum there, seen from outside the breakpoint."""
        evaluation = self._touch.evaluate(start[:-1] * self._scales[:-1], float(start[-1] * self._scales[-1]))
        return evaluation.by_unknowns[-1, -2] < 0.0

    def at(self, depth: float, start: NDArray[np.float64]) -> Correction | None:
        """Return the orbit with a given depth, found along the curve of that depth; None if none is found."""
        corrector = Corrector(replace(self._touch, depth=depth), self._scales)
        return zero_along(corrector, start, self._criticality, _SECANT)

    def orbit(self, correction: Correction) -> Orbit:
        """Return the orbit of a correction."""
        x = correction.x * self._scales
        return self._touch.orbit(x[:-1], float(x[-1]), correction.evaluation)

    def _criticality(self, correction: Correction) -> float:
        return self.equation.criticality(correction.evaluation.evidence).value


def is_highest(correction: Correction) -> bool:
    """Return whether the deflection has a maximum on the orbit of a correction."""
    return bool(correction.evaluation.by_unknowns[-1, -2] < 0.0)  # the derivative of its rate by the angle


def on_locus(correction: Correction) -> NDArray[np.float64]:
    """Return the locus variables of the orbit of a correction: all except the angle of the turning point."""
    return np.delete(correction.x, -3)
