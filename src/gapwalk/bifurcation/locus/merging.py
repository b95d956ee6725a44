"""Where a fold locus of doubled motions ends: at a generalised flip, where they take half their period."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.doubling import halves_apart, is_close
from gapwalk.bifurcation.locus.curve import Secant, zero_along
from gapwalk.bifurcation.locus.equation import MultiplierEquation
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.point import BranchPoint

_SECANT = Secant(first=1e-3, exact=1e-9)  # as well as the coefficient is known
_OVER = 2.0  # distance within which the end must lie, in distances that were estimated


def distance_to_merging(before: BranchPoint | None, point: BranchPoint) -> float:
    """Arclength ahead at which the halves of an orbit will coincide; infinite if they do not come nearer."""
    if before is None or point.orbit.period % 2 or not is_close(point):
        return float("inf")
    past, now = (float(np.linalg.norm(halves_apart(each.orbit))) for each in (before, point))
    return (point.arclength - before.arclength) * now / (past - now) if now < past else float("inf")


def find_merging(corrector: Corrector, point: BranchPoint, distance: float) -> BranchPoint | None:
    """The end of a fold locus, where its orbits take half their period, at about a distance ahead; None if not found.

    The equation is singular there, because every flip of the parent solves it too. So the end is found on the locus
    of those flips: as the zero of their cubic coefficient, by the secant method.
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
