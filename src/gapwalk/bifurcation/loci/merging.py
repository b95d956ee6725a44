"""End of a fold locus of doubled motions: a generalised flip, where they reach half their period."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.doubling import halves_apart, is_close
from gapwalk.bifurcation.loci.multiplier_equation import MultiplierEquation
from gapwalk.bifurcation.loci.solution_curve import Secant, zero_along
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Correction, Corrector

_SECANT = Secant(first=1e-3, exact=1e-9)  # the accuracy to which the coefficient is known
_OVER = 2.0  # largest distance of the end, in estimated distances


def distance_to_merging(before: BranchPoint | None, point: BranchPoint) -> float:
    """Return the arclength ahead at which the halves of an orbit will coincide; infinite if they do not approach."""
    if before is None or point.orbit.period % 2 or not is_close(point):
        return float("inf")
    past, now = (float(np.linalg.norm(halves_apart(each.orbit))) for each in (before, point))
    return (point.arclength - before.arclength) * now / (past - now) if now < past else float("inf")


def find_merging(corrector: Corrector, point: BranchPoint, distance: float) -> BranchPoint | None:
    """Locate the end of a fold locus, where its orbits reach half their period, at about a distance ahead.

    The equation is singular there, because every flip of the parent solves it too. So the end is located on the locus
    of those flips as the zero of their cubic coefficient, by the secant method. None if it is not found.
    """
    equation = corrector.equation
    assert isinstance(equation, MultiplierEquation)
    shared = np.append(equation.plane.shared(), [True, True])  # and both parameters
    plane, scales = equation.plane.halved(), corrector.scales[shared]
    flips = Corrector(replace(equation, plane=plane, kind=Kind.FLIP, scales=scales), scales)
    middle = equation.plane.mean_of_halves(point.orbit) / scales[:-2]

    def coefficient(correction: Correction) -> float:
        x = correction.x * scales
        assert isinstance(flips.equation, MultiplierEquation)
        return flips.equation.flip_coefficient(x[:-1], float(x[-1]))

    found = zero_along(flips, np.concatenate((middle, point.x[-2:])), coefficient, _SECANT)
    if found is None:
        return None
    end = np.zeros(len(point.x))
    end[shared] = found.x
    way = end - point.x
    length = float(np.linalg.norm(way))
    return corrector.uncorrected(end, way / length, point.arclength + length) if length < _OVER * distance else None
