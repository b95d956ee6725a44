"""Detection and location of the points of codimension two in one step along a locus.

As in `gapwalk.bifurcation.detector`, a change of sign is located by bracketing. Wherever a test function bends so much
that it may cross zero twice between two points, the step is halved until that is excluded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.grazing import Graze, describe_switch, find_grazing
from gapwalk.bifurcation.loci.grazing_equation import TouchEquation
from gapwalk.bifurcation.loci.locus import Codim2
from gapwalk.bifurcation.loci.test_functions import codim2_function, codim2_kinds, is_genuine
from gapwalk.bifurcation.step_interval import StepInterval
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.survey import apart

_DOUBT = 0.5  # share of its bend by which a test function may dip between the ends of an interval; 1/8 for a parabola
_FINEST = 1e-5  # arclength below which two zeros are not distinguished
_NOISE = 1e-8  # absolute value of a test function that is only rounding
_TOUCHING = 1e-7  # depth, in units of the unknowns, within which a turning point grazes
_MERGED = 0.1  # radians from the turning point that grazes all along a grazing locus, within which it is the same one
_EXACT = 1e-13  # arclength to which zeros are located
_BESIDE = 1e-5  # arclength from a cusp at which the parameters change at normal speed again
_TURNED = 0.5  # largest sum of the tangents on both sides of a cusp, where they should be opposite, by their difference


class Finding(NamedTuple):
    """Point of codimension two: its kind, its place, and the contact that grazes, if any."""

    kind: Codim2
    point: BranchPoint
    contact: str = ""


def find_codim2(
    locus: Kind, corrector: Corrector, before: BranchPoint | None, first: BranchPoint, last: BranchPoint
) -> list[Finding]:
    """Return the points of codimension two between two neighbouring points, in order; `before` is the point before.

    Raises
    ------
    NumericalError
        If a point of the locus between the two cannot be found.
    """
    interval = StepInterval(corrector, first, last)
    found = [
        Finding(Codim2.GRAZING, graze.point, describe_switch(graze.point.orbit, graze.switch))
        for graze in find_grazing(interval, before, first, last)
        if not _is_echo(corrector, graze)
    ]
    for what in codim2_kinds(locus):
        function = codim2_function(locus, what, corrector, first)
        rate = None
        if before is not None and before.arclength < first.arclength:
            rate = (function(first) - function(before)) / (first.arclength - before.arclength)
        zeros = _search(function, interval, first, last, rate)
        found += [Finding(what, point) for point in zeros if _is_genuine(locus, what, point, interval)]
    return sorted(found, key=lambda finding: finding.point.arclength)


def _is_genuine(locus: Kind, what: Codim2, point: BranchPoint, interval: StepInterval) -> bool:
    """Return whether a zero of a test function is a point of the expected kind.

    At a sharp cusp, rounding leaves some speed in the parameter plane. It is then accepted if both parameters turn
    back.
    """
    if is_genuine(locus, what, point):
        return True
    if what not in (Codim2.CUSP, Codim2.DEGENERATE_GRAZING):
        return False
    first, *_, last = (each.arclength for each in interval.points)
    beside = min(_BESIDE, point.arclength - first, last - point.arclength)
    if beside <= 0.0:
        return False
    before, after = (interval.at(point.arclength + way * beside).tangent[-2:] for way in (-1.0, 1.0))
    return bool((np.abs(after + before) < _TURNED * np.abs(after - before)).all())


def _is_echo(corrector: Corrector, graze: Graze) -> bool:
    """Return whether the touch belongs to a grazing locus itself, where the margin changes sides or its turns merge."""
    equation = corrector.equation
    if not isinstance(equation, TouchEquation) or equation.switch != graze.switch:
        return False
    full, depths = PERIOD * equation.period, graze.point.orbit.turning_depths[graze.switch]
    own = float(graze.point.x[-3] * corrector.scales[-3]) % full
    touches = [theta for theta, depth in zip(*depths, strict=True) if abs(depth) < _TOUCHING * corrector.scales[0]]
    return all(apart(theta, own, full) < _MERGED for theta in touches)


def _search(
    function: Callable[[BranchPoint], float], interval: StepInterval, a: BranchPoint, b: BranchPoint, rate: float | None
) -> list[BranchPoint]:
    """Return all zeros between two points, given the rate of change before them, if any."""
    length, at_a, at_b = b.arclength - a.arclength, function(a), function(b)
    if not max(abs(at_a), abs(at_b)) >= _NOISE:
        return []  # undefined, or zero everywhere, as with multipliers on the unit circle without damping
    if at_a * at_b < 0.0:
        from scipy.optimize import brentq  # imported late, because the import is slow

        root = brentq(lambda s: function(interval.at(s)), a.arclength, b.arclength, xtol=_EXACT, rtol=1e-14)
        return [interval.at(float(root))]
    bend = abs(at_b - at_a - rate * length) if rate is not None else abs(at_b - at_a)
    if length < _FINEST or min(abs(at_a), abs(at_b)) > _DOUBT * bend:
        return []
    middle = interval.middle(a, b)
    left = _search(function, interval, a, middle, rate)
    return left + _search(function, interval, middle, b, (function(middle) - at_a) / (0.5 * length))
