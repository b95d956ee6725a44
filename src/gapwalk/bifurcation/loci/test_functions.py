"""Test functions along a locus: smooth, and zero at a point of codimension two.

==========================  ===========================================================================
cusp, degenerate grazing    signed speed in the parameter plane: the locus turns back there
1:1 and 1:2 on fold, flip   sum of the products of ``mu -+ 1`` over all multipliers but one
1:1 to 1:4 on a pair        cosine of its argument, minus that of the resonance
generalised flip            cubic coefficient
fold-, flip-                product of ``mu - 1`` or ``mu + 1`` over the multipliers that are not critical
-Neimark-Sacker             product of ``mu_i mu_j - 1`` over the pairs of those
==========================  ===========================================================================

(Kuznetsov, Elements of Applied Bifurcation Theory, chapters 9 and 10.) Factors larger than 1 in absolute value are
reduced to 1, so that a large multiplier cannot dominate the critical one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.condition import critical_pair
from gapwalk.bifurcation.loci.locus import Codim2
from gapwalk.bifurcation.loci.multiplier_equation import MultiplierEquation
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector

_TURNED = 1e-5  # speed in the parameter plane, relative to that along the locus, below which the locus turns back
_CIRCLE = 1e-5  # distance from the unit circle within which a pair counts as on it

_COSINES = {
    Codim2.RESONANCE_1_1: 1.0,
    Codim2.RESONANCE_1_2: -1.0,
    Codim2.RESONANCE_1_3: -0.5,
    Codim2.RESONANCE_1_4: 0.0,
}
_TURNING = {Kind.FOLD: Codim2.CUSP, Kind.GRAZING: Codim2.DEGENERATE_GRAZING}


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


def _critical(locus: Kind, multipliers: NDArray[np.complex128]) -> list[int]:
    """Return the indices of the multipliers that are critical all along a locus."""
    return list(critical_pair(multipliers)) if locus is Kind.NEIMARK_SACKER else locus.critical(multipliers).tolist()


def _product(factors: NDArray[np.complex128]) -> float:
    return float(np.prod(_cut(factors)).real)


def _product_of_all_but_one(factors: NDArray[np.complex128]) -> float:
    """Return the sum over i of the product of all factors but the i-th; smooth where two of them meet."""
    table = np.tile(_cut(factors), (len(factors), 1))
    np.fill_diagonal(table, 1.0)
    return float(table.prod(axis=1).sum().real)


def _cut(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return factors / np.maximum(1.0, np.abs(factors))
