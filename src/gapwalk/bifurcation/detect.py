"""Find and locate every special point in one step of a walk, kind by kind."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.kind import Kind
from gapwalk.bifurcation.kinds.search import Search, Zero
from gapwalk.bifurcation.second import SecondOpinion
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.floquet import Instability


class DetectorState(NamedTuple):
    """What a detector remembers from step to step, by test function: its rate of change, and its last zeros."""

    rates: Mapping[Kind, float] = MappingProxyType({})
    recent: Mapping[Kind, tuple[float, ...]] = MappingProxyType({})


class Detector:
    """Finds the special points of a walk, step by step.

    It remembers the step before, for the rate at which each test function varies, and the last zeros found.

    Parameters
    ----------
    corrector
        Corrects onto the branch.
    kinds
        The kinds to look for; by default all that are registered.
    """

    def __init__(self, corrector: Corrector, kinds: Sequence[Kind] | None = None) -> None:
        self.corrector = corrector
        self.kinds = sorted(Kind.known() if kinds is None else kinds, key=lambda kind: kind.turn)
        self.restore(DetectorState())

    @property
    def state(self) -> DetectorState:
        """What it remembers now."""
        return DetectorState(dict(self._rates), {kind: tuple(zeros) for kind, zeros in self._recent.items()})

    def restore(self, state: DetectorState) -> None:
        """Remember what a detector remembered at an earlier time."""
        self._rates = dict(state.rates)
        self._recent = {kind: list(zeros) for kind, zeros in state.recent.items()}

    def inspect(self, first: BranchPoint, last: BranchPoint, before: BranchPoint | None = None) -> list[SpecialPoint]:
        """The special points between two neighbouring points, in the order of the walk; `before` is the one before.

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
            error = float(self._error(search, zero))  # a plain number, as a result file has it
            counts = _instabilities(zero.kind, *sides)
            special.append(SpecialPoint(zero.kind, zero.point, *counts, error, zero.contact, nature))
        return special

    def _error(self, search: Search, zero: Zero) -> float:
        """Estimated error of the parameter at a special point: its bracket, and what a second opinion says."""
        try:
            return zero.kind.error(search, zero, self._second)
        except NumericalError:
            return math.inf

    @cached_property
    def _second(self) -> SecondOpinion:
        return SecondOpinion(self.corrector)


def _instabilities(kind: Kind, before: BranchPoint, after: BranchPoint) -> tuple[Instability, Instability]:
    """Unstable multipliers on both sides of a special point.

    Where the Jacobian changes the sign of its determinant, one multiplier passes +1. By harmonic balance multipliers
    are those of the motion, but folds and branch points those of the truncated equation. So on one of both sides the
    multiplier may be where it is on the other: which way it goes then tells the numbers.
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
