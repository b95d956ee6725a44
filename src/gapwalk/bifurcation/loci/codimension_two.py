"""Detection and location of the points of codimension two in one step along a locus.

As in `gapwalk.bifurcation.detector`, a change of sign of a test function is located by bracketing. Wherever a test
function bends so much that it may cross zero twice between two points, the step is halved until that is excluded. The
test functions are smooth, and zero at a point of codimension two:

==========================  ===========================================================================
cusp, degenerate grazing    signed speed in the parameter plane: the locus turns back there
1:1 and 1:2 on fold, flip   sum of the products of ``mu -+ 1`` over all multipliers but one
1:1 to 1:4 on a pair        cosine of its argument, minus that of the resonance
generalised flip            cubic coefficient
fold-, flip-                product of ``mu - 1`` or ``mu + 1`` over the multipliers that are not critical
-Neimark-Sacker             product of ``mu_i mu_j - 1`` over the pairs of those
==========================  ===========================================================================

(Kuznetsov, Elements of Applied Bifurcation Theory, chapters 9 and 10.) Factors larger than 1 in absolute value are
reduced to 1, so that a large multiplier cannot dominate the critical one. A fold locus of doubled motions ends at a
generalised flip, where they reach half their period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.branch_start import halves_apart, is_close
from gapwalk.bifurcation.kinds.condition import critical_pair
from gapwalk.bifurcation.kinds.grazing import Graze, describe_switch, find_grazing
from gapwalk.bifurcation.loci.locus import Codim2
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation, MultiplierEquation, Secant, zero_along
from gapwalk.bifurcation.step_interval import StepInterval
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.measures import apart

_TURNED = 1e-5  # speed in the parameter plane, relative to that along the locus, below which the locus turns back
_CIRCLE = 1e-5  # distance from the unit circle within which a pair counts as on it

_COSINES = {
    Codim2.RESONANCE_1_1: 1.0,
    Codim2.RESONANCE_1_2: -1.0,
    Codim2.RESONANCE_1_3: -0.5,
    Codim2.RESONANCE_1_4: 0.0,
}
_TURNING = {Kind.FOLD: Codim2.CUSP, Kind.GRAZING: Codim2.DEGENERATE_GRAZING}
_DOUBT = 0.5  # share of its bend by which a test function may dip between the ends of an interval; 1/8 for a parabola
_FINEST = 1e-5  # arclength below which two zeros are not distinguished
_NOISE = 1e-8  # absolute value of a test function that is only rounding
_TOUCHING = 1e-7  # depth, in units of the unknowns, within which a turning point grazes
_MERGED = 0.1  # radians from the turning point that grazes all along a grazing locus, within which it is the same one
_EXACT = 1e-13  # arclength to which zeros are located
_BESIDE = 1e-5  # arclength from a cusp at which the parameters change at normal speed again
_CUSP = 0.5  # largest sum of the tangents on both sides of a cusp, where they should be opposite, by their difference
_SECANT = Secant(first=1e-3, exact=1e-9)  # the accuracy to which the coefficient is known
_OVER = 2.0  # largest distance of the end, in estimated distances


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


def _is_echo(corrector: Corrector, graze: Graze) -> bool:
    """Return whether the touch belongs to a grazing locus itself, where the margin changes sides or its turns merge."""
    equation = corrector.equation
    if not isinstance(equation, GrazingEquation) or equation.switch != graze.switch:
        return False
    full, depths = PERIOD * equation.period, graze.point.orbit.turning_depths[graze.switch]
    own = float(graze.point.x[-3] * corrector.scales[-3]) % full
    touches = [theta for theta, depth in zip(*depths, strict=True) if abs(depth) < _TOUCHING * corrector.scales[0]]
    return all(apart(theta, own, full) < _MERGED for theta in touches)


def codim2_kinds(kind: Kind) -> tuple[Codim2, ...]:
    """Return the kinds of points that are detected on a locus of one kind, besides grazing contacts."""
    match kind:
        case Kind.FOLD:
            return Codim2.CUSP, Codim2.RESONANCE_1_1, Codim2.FOLD_FLIP, Codim2.FOLD_NEIMARK_SACKER
        case Kind.FLIP:
            return Codim2.RESONANCE_1_2, Codim2.FOLD_FLIP, Codim2.FLIP_NEIMARK_SACKER, Codim2.GENERALISED_FLIP
        case Kind.NEIMARK_SACKER:
            return *_COSINES, Codim2.FOLD_NEIMARK_SACKER, Codim2.FLIP_NEIMARK_SACKER
        case _:
            return (
                Codim2.DEGENERATE_GRAZING,
                Codim2.FOLD_GRAZING,
                Codim2.FLIP_GRAZING,
                Codim2.NEIMARK_SACKER_GRAZING,
            )


def codim2_function(
    locus: Kind, what: Codim2, corrector: Corrector, first: BranchPoint
) -> Callable[[BranchPoint], float]:
    """Return the test function of one kind of point on a locus; `first` is the point at which a step begins."""
    if what in _TURNING.values():
        heading = first.tangent[-2:] / (float(np.linalg.norm(first.tangent[-2:])) or 1.0)
        return lambda point: float(point.tangent[-2:] @ heading)

    def function(point: BranchPoint) -> float:
        known = point.memo.get(what)
        if known is None:
            known = point.memo[what] = _compute(locus, what, corrector, point)
        return known

    return function


def _compute(locus: Kind, what: Codim2, corrector: Corrector, point: BranchPoint) -> float:
    if what is Codim2.GENERALISED_FLIP:
        assert isinstance(corrector.equation, MultiplierEquation)
        coefficient = corrector.equation.flip_coefficient(point.x[:-1] * corrector.scales[:-1], point.value)
        return coefficient * _product(point.orbit.multipliers - 1.0)  # the factor removes its poles, at fold-flips
    return multiplier_test(locus, what, point.orbit.multipliers)


def _product(factors: NDArray[np.complex128]) -> float:
    return float(np.prod(_cut(factors)).real)


def _cut(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return factors / np.maximum(1.0, np.abs(factors))


def multiplier_test(locus: Kind, what: Codim2, multipliers: NDArray[np.complex128]) -> float:
    """Evaluate the test function of a kind that is defined by the multipliers."""
    critical = _critical(locus, multipliers)
    others = np.delete(multipliers, critical)
    match what:
        case Codim2.RESONANCE_1_1 | Codim2.RESONANCE_1_2 if locus is not Kind.NEIMARK_SACKER:
            target = 1.0 if what is Codim2.RESONANCE_1_1 else -1.0
            return _product_of_all_but_one(multipliers - target)
        case Codim2.RESONANCE_1_1 | Codim2.RESONANCE_1_2 | Codim2.RESONANCE_1_3 | Codim2.RESONANCE_1_4:
            return 0.5 * float(multipliers[critical].sum().real) - _COSINES[what]
        case Codim2.FOLD_FLIP:
            return _product(others + (1.0 if locus is Kind.FOLD else -1.0))
        case Codim2.FOLD_GRAZING:
            return _product(others - 1.0)
        case Codim2.FLIP_GRAZING:
            return _product(others + 1.0)
        case Codim2.FOLD_NEIMARK_SACKER | Codim2.FLIP_NEIMARK_SACKER if locus is Kind.NEIMARK_SACKER:
            return _product(others - (1.0 if what is Codim2.FOLD_NEIMARK_SACKER else -1.0))
        case _:
            first, second = np.triu_indices(len(others), 1)
            return _product(others[first] * others[second] - 1.0)


def _critical(locus: Kind, multipliers: NDArray[np.complex128]) -> list[int]:
    """Return the indices of the multipliers that are critical all along a locus."""
    return list(critical_pair(multipliers)) if locus is Kind.NEIMARK_SACKER else locus.critical(multipliers).tolist()


def _product_of_all_but_one(factors: NDArray[np.complex128]) -> float:
    """Return the sum over i of the product of all factors but the i-th; smooth where two of them meet."""
    table = np.tile(_cut(factors), (len(factors), 1))
    np.fill_diagonal(table, 1.0)
    return float(table.prod(axis=1).sum().real)


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
    return bool((np.abs(after + before) < _CUSP * np.abs(after - before)).all())


def is_genuine(locus: Kind, what: Codim2, point: BranchPoint) -> bool:
    """Return whether a zero of the test function is a point of the expected kind."""
    if what in _TURNING.values():
        return float(np.linalg.norm(point.tangent[-2:])) < _TURNED  # both components vanish: not a turn of 90 degrees
    if locus is Kind.NEIMARK_SACKER:
        return True
    if what in (Codim2.FOLD_NEIMARK_SACKER, Codim2.FLIP_NEIMARK_SACKER, Codim2.NEIMARK_SACKER_GRAZING):
        multipliers = point.orbit.multipliers
        others = np.delete(multipliers, _critical(locus, multipliers))
        complex_ones = others[np.abs(others.imag) > _CIRCLE]
        return bool(np.any(np.abs(np.abs(complex_ones) - 1.0) < _CIRCLE))  # excludes neutral saddles
    return True


def ends_locus(locus: Kind, what: Codim2) -> bool:
    """Return whether a locus ends at a point of codimension two, because its pair is real beyond it."""
    return locus is Kind.NEIMARK_SACKER and what in (Codim2.RESONANCE_1_1, Codim2.RESONANCE_1_2)


def distance_to_merging(before: BranchPoint | None, point: BranchPoint) -> float:
    """Return the arclength ahead at which the halves of an orbit will coincide; infinite if they do not approach."""
    if before is None or point.orbit.period % 2 or not is_close(point):
        return float("inf")
    past, now = (float(np.linalg.norm(halves_apart(each))) for each in (before, point))
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
