"""Verification of loci: a sample of the points of each is shot again, and the locus condition is checked."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.loci import Locus, LocusPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.balanced import imbalance
from gapwalk.verification.dop853 import Round, carry
from gapwalk.verification.multipliers import distance, reshoot
from gapwalk.verification.verification import Advance, Check, Ledger, Spot

_MOST = 40  # number of points of a locus that are checked


def verify_loci(ledger: Ledger, loci: Sequence[tuple[str, Locus]], advance: Advance | None = None) -> None:
    """Enter the checks of some loci, by their names."""
    for done, (name, locus) in enumerate(loci):
        if advance is not None:
            advance("loci", done, len(loci))
        numbers = sorted({round(place) for place in np.linspace(0, len(locus.points) - 1, _MOST)})
        points = [
            (Spot(name, f"point {number}", locus.points[number].values[0]), locus.points[number]) for number in numbers
        ]
        ledger.points += len(points)
        if not locus.points[0].orbit.is_exact:
            for spot, point in points:
                if (off := imbalance(point.orbit)) is not None:
                    ledger.enter(Check.LINES, spot, off.lines)
            ledger.note(
                "for balanced loci the lines are verified, but not the locus condition, which holds up to truncation"
            )
            continue
        rounds = carry([point.orbit for _, point in points])
        for (spot, point), around in zip(points, rounds, strict=True):
            _verify_point(ledger, spot, locus, point, around)


def _verify_point(ledger: Ledger, spot: Spot, locus: Locus, point: LocusPoint, around: Round) -> None:
    try:
        reshot = reshoot(point.orbit, 1, around.contraction)
    except NumericalError as error:
        ledger.enter(Check.MULTIPLIERS, spot, math.inf, str(error))
        return
    ledger.enter(Check.CLOSURE, spot, around.closure / reshot.growth)
    ledger.enter(Check.STAGES, spot, around.astray / reshot.growth)
    ledger.enter(Check.MULTIPLIERS, spot, distance(reshot.multipliers, point.orbit.multipliers))
    ledger.enter(Check.CONDITION, spot, _off(locus, point.orbit, reshot.multipliers))


def _off(locus: Locus, orbit: Orbit, multipliers: NDArray[np.complex128]) -> float:
    """Return the distance of an orbit from the bifurcation of a locus.

    It is a product over all multipliers. So a factor that is small for another reason, as at a point of codimension
    two, does no harm.
    """
    match locus.kind:
        case Kind.FOLD:
            factors = multipliers - 1.0
        case Kind.FLIP:
            factors = multipliers + 1.0
        case Kind.NEIMARK_SACKER:
            first, second = np.triu_indices(len(multipliers), 1)
            factors = multipliers[first] * multipliers[second] - 1.0
        case _:
            depths = [abs(depth) for turns in orbit.turning_depths for depth in turns.values]
            return min(depths, default=math.inf) / max(float(np.abs(orbit.extremes[:, :2]).max()), np.finfo(float).tiny)
    return float(np.prod(np.minimum(np.abs(factors), 1.0)))
