"""Find and locate the points of codimension two in one step along a locus.

In the way of `gapwalk.bifurcation.detect`: a change of sign is located by bracketing, and wherever a test function
bends so much that it may dip through zero between two points, the step is halved until that doubt is gone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.grazing import Graze, describe_switch, find_grazing
from gapwalk.bifurcation.locus.functions import codim2_function, codim2_kinds, is_genuine
from gapwalk.bifurcation.locus.locus import Codim2
from gapwalk.bifurcation.locus.touch import TouchEquation
from gapwalk.bifurcation.stretch import Stretch
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.motion.flow import PERIOD
from gapwalk.orbit.survey import apart

_DOUBT = 0.5  # share of the bend over an interval by which a test function may dip between its ends; 1/8 for a parabola
_FINEST = 1e-5  # arclength below which two zeros are not told apart
_NOISE = 1e-8  # size of a test function that is nothing but rounding
_TOUCHING = 1e-7  # depth, in units of the unknowns, within which a turning point grazes
_MERGED = 0.1  # radians within which it is the one that grazes all along a grazing locus
_EXACT = 1e-13  # arclength to which zeros are located
_BESIDE = 1e-5  # arclength from a cusp at which the locus has taken up speed again
_TURNED = 0.5  # share of the change of a speed that is left over, beside a cusp, where it should only change its sign


class Finding(NamedTuple):
    """A point of codimension two: what happens, where, and which contact grazes, if any."""

    kind: Codim2
    point: BranchPoint
    contact: str = ""


def find_codim2(
    locus: Kind, corrector: Corrector, before: BranchPoint | None, first: BranchPoint, last: BranchPoint
) -> list[Finding]:
    """The points of codimension two between two neighbouring points, in order; `before` is the point before them.

    Raises
    ------
    NumericalError
        If a point of the locus between the two cannot be found.
    """
    stretch = Stretch(corrector, first, last)
    found = [
        Finding(Codim2.GRAZING, graze.point, describe_switch(graze.point.orbit, graze.switch))
        for graze in find_grazing(stretch, before, first, last)
        if not _is_echo(corrector, graze)
    ]
    for what in codim2_kinds(locus):
        function = codim2_function(locus, what, corrector, first)
        rate = None
        if before is not None and before.arclength < first.arclength:
            rate = (function(first) - function(before)) / (first.arclength - before.arclength)
        zeros = _search(function, stretch, first, last, rate)
        found += [Finding(what, point) for point in zeros if _is_genuine(locus, what, point, stretch)]
    return sorted(found, key=lambda finding: finding.point.arclength)


def _is_genuine(locus: Kind, what: Codim2, point: BranchPoint, stretch: Stretch) -> bool:
    """Whether a zero of a test function is what it is taken for.

    At a sharp cusp rounding leaves some speed in the plane. What tells it then is that both parameters turn back.
    """
    if is_genuine(locus, what, point):
        return True
    if what not in (Codim2.CUSP, Codim2.DEGENERATE_GRAZING):
        return False
    first, *_, last = (each.arclength for each in stretch.points)
    beside = min(_BESIDE, point.arclength - first, last - point.arclength)
    if beside <= 0.0:
        return False
    before, after = (stretch.at(point.arclength + way * beside).tangent[-2:] for way in (-1.0, 1.0))
    return bool((np.abs(after + before) < _TURNED * np.abs(after - before)).all())


def _is_echo(corrector: Corrector, graze: Graze) -> bool:
    """Whether a grazing locus has met its own touch alone, where the margin changes sides or its two turns merge."""
    equation = corrector.equation
    if not isinstance(equation, TouchEquation) or equation.switch != graze.switch:
        return False
    full, depths = PERIOD * equation.period, graze.point.orbit.turning_depths[graze.switch]
    own = float(graze.point.x[-3] * corrector.scales[-3]) % full
    touches = [theta for theta, depth in zip(*depths, strict=True) if abs(depth) < _TOUCHING * corrector.scales[0]]
    return all(apart(theta, own, full) < _MERGED for theta in touches)


def _search(
    function: Callable[[BranchPoint], float], stretch: Stretch, a: BranchPoint, b: BranchPoint, rate: float | None
) -> list[BranchPoint]:
    """All zeros between two points, given the rate of change before them, if any."""
    length, at_a, at_b = b.arclength - a.arclength, function(a), function(b)
    if not max(abs(at_a), abs(at_b)) >= _NOISE:
        return []  # undefined, or zero all along, as with multipliers that stay on the unit circle without damping
    if at_a * at_b < 0.0:
        from scipy.optimize import brentq  # imported late: it takes long

        root = brentq(lambda s: function(stretch.at(s)), a.arclength, b.arclength, xtol=_EXACT, rtol=1e-14)
        return [stretch.at(float(root))]
    bend = abs(at_b - at_a - rate * length) if rate is not None else abs(at_b - at_a)
    if length < _FINEST or min(abs(at_a), abs(at_b)) > _DOUBT * bend:
        return []
    middle = stretch.middle(a, b)
    left = _search(function, stretch, a, middle, rate)
    return left + _search(function, stretch, middle, b, (function(middle) - at_a) / (0.5 * length))
