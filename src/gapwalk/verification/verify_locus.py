"""Verification of loci: a sample of the points of each is shot again, and the locus condition is checked."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gapwalk.bifurcation.loci import Locus, LocusPoint
from gapwalk.errors import NumericalError
from gapwalk.verification.balanced import imbalance
from gapwalk.verification.dop853 import Round, carry
from gapwalk.verification.verification import Advance, Check, Ledger, Spot
from gapwalk.verification.verify_special_points import distance, reshoot

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
    ledger.enter(Check.CONDITION, spot, locus.kind.residual(point.orbit, reshot.multipliers))
