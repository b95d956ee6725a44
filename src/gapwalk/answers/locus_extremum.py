"""Extremum of a locus: the largest or smallest value of one parameter on a curve of special points.

Between two points of the locus the slope of one parameter by the other changes its sign where the extremum lies. It is
exact at each point, from the derivatives of the locus equation, so that a bracketing method ends at rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.loci.follow_locus import follow_locus
from gapwalk.bifurcation.loci.locus import Locus, LocusPoint
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation
from gapwalk.bifurcation.loci.locus_start import equation_of, plane_of
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bracketed_root import zero_between_signs
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.walk_scales import powers_of_two
from gapwalk.errors import ConvergenceError
from gapwalk.orbit.shooting import Shooting

_EXACT = 1e-12  # relative width of the bracket at which the extremum is located
_EDGE = 1e-9  # share of a range within which a point lies at its end


class Extremum(NamedTuple):
    """Extremum of a locus within a range."""

    special: SpecialPoint  #: The special point there; its value is that of the extremal parameter.
    at: float  #: Value of the other parameter.
    error: float  #: Estimated error of the extremal value.
    is_edge: bool  #: True if it lies at an end of the range, beyond which the locus goes on.
    locus: Locus  #: The locus.

    @property
    def value(self) -> float:
        """The extremal value."""
        return self.special.value


def locus_extremum(
    special: SpecialPoint,
    parameter: str,
    over: str,
    to: tuple[tuple[float, float], tuple[float, float]],
    way: int,
) -> Extremum:
    """Follow a special point over one parameter to the extremum of another."""
    locus = follow_locus(special, parameter, over, to)
    points = list(locus.points)
    best = max(range(len(points)), key=lambda k: way * points[k].values[0])
    there = points[best]
    width = to[1][1] - to[1][0]
    is_edge = min(abs(there.values[1] - end) for end in to[1]) < _EDGE * width
    neighbours = [points[k] for k in (best - 1, best + 1) if 0 <= k < len(points)]
    curve = _Curve(special, locus, there, neighbours)
    if is_edge or len(neighbours) < 2:
        return Extremum(curve.special(there), there.values[1], _blur(there), is_edge, locus)
    low, high = sorted(point.values[1] for point in neighbours)
    try:
        at, value = curve.turning(low, high)
    except (ConvergenceError, ValueError):  # a cusp, or a corner: the point of the walk is the best there is
        spread = max(abs(point.values[0] - there.values[0]) for point in neighbours)
        return Extremum(curve.special(there), there.values[1], spread, False, locus)
    return Extremum(curve.special(curve.point(at)), at, _blur(there) + _EXACT * abs(value), False, locus)


class _Curve:
    """A locus near one of its points, as a function of the second parameter."""

    def __init__(self, special: SpecialPoint, locus: Locus, near: LocusPoint, neighbours: Sequence[LocusPoint]) -> None:
        self.first, self.locus, self.near, self.names = special, locus, near, (locus.first, locus.second)
        plane = plane_of(Shooting(), near.orbit, self.names)
        widths = [abs(value) or 1.0 for value in near.values]
        equation, unknowns, scales = equation_of(plane, _special(special, locus, near), widths)
        self._corrector = Corrector(equation, powers_of_two(scales))
        known = [(unknowns, near), *((equation.unknowns(each.orbit), each) for each in neighbours)]
        # guesses: points that are known, in scaled variables; on a narrow peak only the nearest one leads to a point
        self._known = [np.append(those, each.values[1]) / self._corrector.scales for those, each in known]

    def turning(self, low: float, high: float) -> tuple[float, float]:
        """Return where the first parameter is stationary between two values of the second, and its value there."""
        finest = _EXACT * abs(high - low)
        at = zero_between_signs(lambda value: self._solved(value)[1], low, high, absolute=finest, relative=1e-14)
        return at, self._solved(at)[0]

    def point(self, at: float) -> LocusPoint:
        """Return the point of the locus at a value of the second parameter."""
        correction = self._corrected(at)
        x = correction.x * self._corrector.scales
        equation = self._corrector.equation
        orbit = equation.orbit(x[:-1], float(x[-1]), correction.evaluation)
        values = orbit.system[self.names[0]], orbit.system[self.names[1]]
        return LocusPoint(values, orbit, self.near.angle, correction.x, self.near.tangent, self.near.arclength)

    def special(self, point: LocusPoint) -> SpecialPoint:
        """Return a point of the locus as a special point of the branch along the first parameter.

        The orbit of a graze keeps a small distance from the breakpoint; the value is that of the touch itself.
        """
        found, equation = _special(self.first, self.locus, point), self._corrector.equation
        if not isinstance(equation, GrazingEquation):
            return found
        correction, scales = self._corrected(point.values[1]), self._corrector.scales
        deeper = np.zeros(len(scales) - 1)
        deeper[-2] = -equation.depth  # the residual of the depth, before that of the rate
        moved = np.linalg.solve(correction.evaluation.by_unknowns * scales[:-1], deeper)[-1] * scales[-2]
        return replace(found, point=replace(found.point, value=found.value + float(moved)))

    def _solved(self, at: float) -> tuple[float, float]:
        """Return the first parameter at a value of the second, and its slope."""
        correction, scales = self._corrected(at), self._corrector.scales
        evaluation = correction.evaluation
        assert evaluation.by_parameter is not None
        slopes = np.linalg.solve(evaluation.by_unknowns * scales[:-1], -evaluation.by_parameter)
        return float(correction.x[-2] * scales[-2]), float(slopes[-1] * scales[-2])

    def _corrected(self, at: float):
        guess = min(self._known, key=lambda x: abs(x[-1] * self._corrector.scales[-1] - at))
        correction = self._corrector.at_value(guess, at)
        if correction is None:
            raise ConvergenceError(f"the locus has no point at {self.names[1]} = {at:.10g}")
        self._known.append(correction.x)
        return correction


def _special(special: SpecialPoint, locus: Locus, point: LocusPoint) -> SpecialPoint:
    """Return a point of a locus as a special point of the branch along the first parameter."""
    value = point.values[0]
    branch_point = BranchPoint(value, point.orbit, point.x, point.tangent, math.nan, math.nan)
    sides = point.orbit.instability
    return SpecialPoint(special.kind, branch_point, sides, sides, math.nan, locus.contact, parameter=locus.first)


def _blur(point: LocusPoint) -> float:
    """Return the rounding of a parameter of a point."""
    return 1e-10 * abs(point.values[0])
