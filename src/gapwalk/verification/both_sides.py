"""Check of a special point from both sides, with another discretisation: what changes there, and where."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.error_estimate import ErrorEstimator
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import length_of
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.floquet import is_on_border

_REACH = 1e-3  # arclength at which the sides of a special point are examined, unless its neighbours are nearer
_WIDE = 5e-3  # the same for a branch point, close to which no orbit can be corrected
_SECANT = 1e-4  # arclength over which a test function is linear
_SHARE = 0.4  # share of the distance to a neighbour; also the factor for a second, nearer examination
_NEARER = 5  # largest number of examinations


@dataclass(frozen=True)
class Sides:
    """Result of examining a special point from both sides.

    Attributes
    ----------
    faults
        Contradictions to what is stored, as sentences.
    value
        The parameter where its test function is zero; None if it cannot be computed.
    before, after
        The motions on both sides of it, with another discretisation; None if they were not computed.
    held
        True if motions can be corrected on both sides of it.
    """

    faults: tuple[str, ...]
    value: float | None
    before: BranchPoint | None = None
    after: BranchPoint | None = None
    held: bool = True


def look(
    second: ErrorEstimator, special: SpecialPoint, next_to_it: Sequence[BranchPoint], changes: Sequence[BranchPoint]
) -> Sides:
    """Examine a special point from both sides.

    Parameters
    ----------
    second
        The branch with another discretisation.
    special
        The special point.
    next_to_it
        The points or special points next to it.
    changes
        The special points, or ends of the branch, next to it: beyond those other changes would be included.
    """
    from_afar = _reach(special, next_to_it)
    reaches = [from_afar * _SHARE**power for power in range(_NEARER)]
    if special.kind is Kind.BRANCH_POINT:  # close to it no orbit can be corrected
        reaches.insert(1, _reach(special, changes))
    first = None
    for reach in reaches:
        seen = _look(second, special, reach)
        if not seen.faults:
            return seen
        first = first or seen
    assert first is not None
    return first


def _reach(special: SpecialPoint, others: Sequence[BranchPoint]) -> float:
    """Return the arclength at which a special point is examined: closer to it than its neighbours are."""
    reach = _WIDE if special.kind is Kind.BRANCH_POINT else _REACH
    distances = [length_of(each.x - special.point.x) for each in others if len(each.x) == len(special.point.x)]
    return min([reach, *(_SHARE * distance for distance in distances)])


def _look(second: ErrorEstimator, special: SpecialPoint, reach: float) -> Sides:
    """Examine a special point at one distance on both sides."""
    try:
        a, b = second.at(special.point, -reach), second.at(special.point, reach)
    except NumericalError as error:
        return Sides((str(error),), None, held=False)
    faults = list(_counts(special, a, b))
    if special.kind is Kind.GRAZING:
        return _graze(second, special, a, b, reach, faults)
    signs = [special.kind.at(each) for each in (a, b)]
    if signs[0] * signs[1] > 0.0:
        return Sides((*faults, f"the test function of a {special.kind.value} does not change its sign"), None)
    if special.kind is Kind.BRANCH_POINT:
        return Sides(tuple(faults), _crossing(second, special, reach), a, b)
    return Sides(tuple(faults), _zero(second, special, reach, special.kind.at), a, b)


def _counts(special: SpecialPoint, a: BranchPoint, b: BranchPoint) -> Iterator[str]:
    """Yield where the numbers of unstable multipliers on both sides are not those that are stored."""
    for side, point, stored in (("before", a, special.before), ("after", b, special.after)):
        if not is_on_border(point.orbit.multipliers) and point.instability.total != stored.total:
            yield f"{point.instability.total} unstable multipliers {side} it, where {stored.total} are stored"


def _zero(
    second: ErrorEstimator, special: SpecialPoint, reach: float, function: Callable[[BranchPoint], float]
) -> float | None:
    """Return the parameter where a function of the point is zero, by a secant from the special point."""
    shift = min(reach, _SECANT)
    try:
        here, beside = second.at(special.point), second.at(special.point, shift)
    except NumericalError:
        return None
    first, last = function(here), function(beside)
    if first == last:
        return None
    return here.value - (beside.value - here.value) * first / (last - first)


def _crossing(second: ErrorEstimator, special: SpecialPoint, reach: float) -> float | None:
    """Return the parameter where the branch crosses another, with another discretisation.

    A contact may graze just beyond the reach, so that polynomials through points up to there would be less accurate.
    Therefore points up to a share of it are used first.
    """
    for share in (_SHARE, 1.0):
        try:
            return second.crossing(special.point, share * reach)
        except NumericalError:
            continue
    return None


def _graze(
    second: ErrorEstimator, special: SpecialPoint, a: BranchPoint, b: BranchPoint, reach: float, faults: list[str]
) -> Sides:
    """Examine a grazing point: the contact pattern must change there, and the depth of an extremum be zero."""
    names = [describe_switch(special.orbit, switch) for switch in range(len(special.orbit.closings))]
    if special.contact not in names:
        return Sides((*faults, f"there is no contact {special.contact!r}"), None)
    switch = names.index(special.contact)
    if a.orbit.closings[switch] == b.orbit.closings[switch]:
        return Sides((*faults, f"{special.contact} closes equally often on both sides"), None)
    turns = special.orbit.turning_depths[switch]
    theta = turns.thetas[int(np.argmin(np.abs(turns.values)))]
    full = PERIOD * special.orbit.period

    def depth(point: BranchPoint) -> float:
        found = point.orbit.turning_depths[switch]
        return found.values[found.nearest(theta, full)]

    return Sides(tuple(faults), _zero(second, special, reach, depth))
