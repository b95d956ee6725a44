"""A curve moved to other numbers of its system: its points corrected where they are, without a walk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.loci.locus import Codim2, LocusPoint, test_function, tested
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.event_rule import jumping_switches

MOVED = 120
"""Points of a moved curve: a picture that is as wide as a page shows no more bends."""
_CRITICAL = {"below": Kind.FLIP, "pair": Kind.NEIMARK_SACKER}


class Mark(NamedTuple):
    """Special point between two neighbouring points of a curve, by interpolation."""

    kind: Kind
    #: first, last: The points, and the share of the way between them.
    first: BranchPoint
    last: BranchPoint
    share: float
    value: float  #: Value of the parameter.

    def measure(self, name: str) -> float:
        """Return a measure of the motion there."""
        first, last = self.first.measure(name), self.last.measure(name)
        return first + self.share * (last - first)


def moved(own: Corrector, points: Sequence[BranchPoint | LocusPoint]) -> list[BranchPoint]:
    """Return points of the curve of a corrector, near those of a curve of another system with the same parts."""
    # Each is sought in the plane across the old curve, so that folds do no harm. A point that is not found is left out.
    found = list[BranchPoint]()
    shift, length = np.zeros(len(own.scales)), 0.0
    for point in points:
        try:
            correction = own.correct(point.x + shift, point.tangent) or own.correct(point.x, point.tangent)
            if correction is None:
                continue
            length += float(np.linalg.norm(correction.x - found[-1].x)) if found else 0.0
            found.append(own.point(correction, point.tangent, length))
        except NumericalError:
            continue
        shift = correction.x - point.x
    return found


def thinned(points: Sequence[BranchPoint]) -> Iterator[BranchPoint]:
    """Yield every so many points, and all beside a fold or a change of stability."""
    every = -(-len(points) // MOVED)
    kinds = [(each.tangent[-1] > 0.0, each.instability.label, each.orbit.closings) for each in points]
    for place, point in enumerate(points):
        around = kinds[max(place - 1, 0) : place + 2]
        if place % every == 0 or place == len(points) - 1 or any(kind != kinds[place] for kind in around):
            yield point


def marks(points: Sequence[BranchPoint], scale: float) -> Iterator[Mark]:
    """Yield the folds, flips, Neimark-Sacker points and grazes between points; `scale` is that of the parameter."""
    for first, last in pairwise(points):
        along = [float(each.tangent[-1]) for each in (first, last)]
        labels = {each.instability.label for each in (first, last)}
        grazes = dict(_grazes(first, last))
        for depths in grazes.values():
            yield _mark(Kind.GRAZING, first, last, depths, scale)
        if jumping_switches(last.orbit.system) & {*grazes}:  # whatever else changes there changes by the graze
            continue
        if along[0] * along[1] < 0.0:
            yield _mark(Kind.FOLD, first, last, along, scale)
        for kind in {_CRITICAL[label] for label in labels & {*_CRITICAL}} if len(labels) > 1 else ():
            values = [kind.function(each) for each in (first, last)]
            if values[0] * values[1] < 0.0:
                yield _mark(kind, first, last, values, scale)


def _grazes(first: BranchPoint, last: BranchPoint) -> Iterator[tuple[int, list[float]]]:
    """Yield number and depths, at two points, of each contact that touches another number of times at the second."""
    for switch in np.flatnonzero(np.not_equal(first.orbit.closings, last.orbit.closings)).tolist():
        depths = [min(each.orbit.turning_depths[switch].values, key=abs, default=0.0) for each in (first, last)]
        if depths[0] * depths[1] < 0.0:
            yield switch, depths


def codim2_marks(kind: Kind, corrector: Corrector, points: Sequence[BranchPoint]) -> Iterator[tuple[str, float, float]]:
    """Yield kind and place of the points of codimension two between points of a locus, by interpolation."""
    for first, last in pairwise(points):
        tests = [(each, test_function(kind, each, corrector, first)) for each in tested(kind)]
        found = [(each, [function(first), function(last)]) for each, function in tests]
        grazes = () if isinstance(corrector.equation, GrazingEquation) else _grazes(first, last)
        for what, (a, b) in (*found, *((Codim2.GRAZING, depths) for _, depths in grazes)):
            if a * b < 0.0:
                x = hermite(first, last, a / (a - b))[-2:] * corrector.scales[-2:]
                yield what.value, float(x[0]), float(x[1])


def _mark(kind: Kind, first: BranchPoint, last: BranchPoint, values: Sequence[float], scale: float) -> Mark:
    share = values[0] / (values[0] - values[1])
    return Mark(kind, first, last, share, float(hermite(first, last, share)[-1]) * scale)
