"""Detection and location of every special point in one step of a walk, kind by kind.

Method: docs/numerics/special-points.md
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.error_estimate import ErrorEstimator
from gapwalk.bifurcation.kind import Kind
from gapwalk.bifurcation.kinds.zero_search import Search, Zero
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.errors import NumericalError
from gapwalk.orbit.floquet import Instability


class DetectorState(NamedTuple):
    """Memory of a detector between steps, per test function: its rate of change, and its last zeros."""

    rates: Mapping[Kind, float] = MappingProxyType({})
    recent: Mapping[Kind, tuple[float, ...]] = MappingProxyType({})


class Detector:
    """Detector of the special points of a walk, step by step.

    It remembers the rate at which each test function varied in the step before, and the last zeros found.

    Parameters
    ----------
    corrector
        Corrector for the branch.
    kinds
        The kinds to detect; by default all that are registered.
    """

    def __init__(self, corrector: Corrector, kinds: Sequence[Kind] | None = None) -> None:
        self.corrector = corrector
        self.kinds = sorted(Kind.known() if kinds is None else kinds, key=lambda kind: kind.turn)
        self.restore(DetectorState())

    @property
    def state(self) -> DetectorState:
        """Present memory of the detector."""
        return DetectorState(dict(self._rates), {kind: tuple(zeros) for kind, zeros in self._recent.items()})

    def restore(self, state: DetectorState) -> None:
        """Set the memory of the detector to an earlier state."""
        self._rates = dict(state.rates)
        self._recent = {kind: list(zeros) for kind, zeros in state.recent.items()}

    def inspect(self, first: BranchPoint, last: BranchPoint, before: BranchPoint | None = None) -> list[SpecialPoint]:
        """Return the special points between two neighbouring points, in order; `before` is the point before `first`.

        Raises
        ------
        NumericalError
            If an orbit between the two cannot be found.
        """
        search = Search(self.corrector, first, last, before, self._rates, self._recent)
        for kind in self.kinds:
            kind.prepare(search)
        found = [zero for kind in self.kinds for zero in kind.points_in(search)]
        found.sort(key=lambda zero: zero.point.arclength)
        marks = [first.arclength, *(zero.point.arclength for zero in found), last.arclength]
        special = []
        for index, zero in enumerate(found, start=1):
            sides = search.sides(marks, index)
            nature = zero.kind.nature(*sides)
            if nature is None:
                continue
            error = float(self._error(search, zero))  # a plain number, for result files
            counts = _instabilities(zero.kind, *sides)
            special.append(SpecialPoint(zero.kind, zero.point, *counts, error, zero.contact, nature))
        return special

    def _error(self, search: Search, zero: Zero) -> float:
        """Return the estimated error of the parameter at a special point, from its bracket and a second computation."""
        try:
            return zero.kind.error(search, zero, self._second)
        except NumericalError:
            return math.inf

    @cached_property
    def _second(self) -> ErrorEstimator:
        return ErrorEstimator(self.corrector)


def _instabilities(kind: Kind, before: BranchPoint, after: BranchPoint) -> tuple[Instability, Instability]:
    """Return the numbers of unstable multipliers on both sides of a special point.

    Where the determinant of the Jacobian changes sign, one multiplier passes +1. In harmonic balance, however, the
    multipliers belong to the motion, but folds and branch points to the truncated equation. So the multiplier may lie
    on the same side of +1 at both points; its direction of motion then decides the numbers.
    """
    sides = before.instability, after.instability
    signs = [point.determinant * float(point.tangent[-1]) for point in (before, after)]
    if not kind.moves_through_one or signs[0] * signs[1] >= 0.0 or sides[0].total != sides[1].total:
        return sides
    near, far = (kind.critical_multiplier(point.orbit.multipliers).real for point in (before, after))
    inner, outer = sides if near < far else sides[::-1]
    if max(near, far) <= 1.0:
        outer = outer._replace(above=outer.above + 1)
    elif min(near, far) > 1.0 and inner.above:
        inner = inner._replace(above=inner.above - 1)
    return (inner, outer) if near < far else (outer, inner)
