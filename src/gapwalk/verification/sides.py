"""A special point seen from both sides: what changes there, and where, found by an equation posed otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.bifurcation.second import SecondOpinion
from gapwalk.continuation.corrector import length_of
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.motion.flow import PERIOD
from gapwalk.orbit.floquet import is_on_border

_REACH = 1e-3  # arclength from which a special point is looked at, where its neighbours are not nearer
_WIDE = 5e-3  # the same for a branch point, close to which no orbit can be held
_SECANT = 1e-4  # arclength over which a test function is straight
_SHARE = 0.4  # of the way to a neighbour; also by which a special point is looked at from nearer
_NEARER = 5  # times that this is done


@dataclass(frozen=True)
class Sides:
    """What a special point looks like from both sides.

    Attributes
    ----------
    faults
        What is not as it is said to be, in sentences.
    value
        The parameter where its test function is zero; None where that cannot be told.
    before, after
        The motions on both sides of it, of the branch posed otherwise; None where they are not told.
    held
        Whether motions can be held on both sides of it.
    """

    faults: tuple[str, ...]
    value: float | None
    before: BranchPoint | None = None
    after: BranchPoint | None = None
    held: bool = True


def look(
    second: SecondOpinion, special: SpecialPoint, next_to_it: Sequence[BranchPoint], changes: Sequence[BranchPoint]
) -> Sides:
    """Look at a special point from both sides.

    Parameters
    ----------
    second
        The branch, posed otherwise.
    special
        The special point.
    next_to_it
        The points or special points next to it.
    changes
        The special points, or ends of the branch, next to it: from beyond those something else would be seen.
    """
    from_afar = _reach(special, next_to_it)
    reaches = [from_afar * _SHARE**power for power in range(_NEARER)]
    if special.kind is Kind.BRANCH_POINT:  # close to which no orbit can be held
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
    """The arclength from which a special point is looked at, such that it is nearer than others."""
    reach = _WIDE if special.kind is Kind.BRANCH_POINT else _REACH
    distances = [length_of(each.x - special.point.x) for each in others if len(each.x) == len(special.point.x)]
    return min([reach, *(_SHARE * distance for distance in distances)])


def _look(second: SecondOpinion, special: SpecialPoint, reach: float) -> Sides:
    """What a special point looks like from one distance on both sides."""
    try:
        a, b = second.at(special.point, -reach), second.at(special.point, reach)
    except NumericalError as error:
        return Sides((str(error),), None, held=False)
    faults = list(_counts(special, a, b))
    if special.kind is Kind.GRAZING:
        return _graze(second, special, a, b, reach, faults)
    signs = [special.kind.at(each) for each in (a, b)]
    if signs[0] * signs[1] > 0.0:
        return Sides((*faults, f"the test function of a {special.kind.value} keeps its sign"), None)
    if special.kind is Kind.BRANCH_POINT:
        return Sides(tuple(faults), _crossing(second, special, reach), a, b)
    return Sides(tuple(faults), _zero(second, special, reach, special.kind.at), a, b)


def _counts(special: SpecialPoint, a: BranchPoint, b: BranchPoint) -> Iterator[str]:
    """Where the numbers of unstable multipliers on both sides are not those that are stored."""
    for side, point, stored in (("before", a, special.before), ("after", b, special.after)):
        if not is_on_border(point.orbit.multipliers) and point.instability.total != stored.total:
            yield f"{point.instability.total} unstable multipliers {side} it, where {stored.total} are stored"


def _zero(
    second: SecondOpinion, special: SpecialPoint, reach: float, function: Callable[[BranchPoint], float]
) -> float | None:
    """The parameter where a function of the point is zero, by a secant from the special point on."""
    shift = min(reach, _SECANT)
    try:
        here, beside = second.at(special.point), second.at(special.point, shift)
    except NumericalError:
        return None
    first, last = function(here), function(beside)
    if first == last:
        return None
    return here.value - (beside.value - here.value) * first / (last - first)


def _crossing(second: SecondOpinion, special: SpecialPoint, reach: float) -> float | None:
    """The parameter where the branch posed otherwise crosses another.

    Just beyond the reach a contact may graze, so that polynomials through points up to there would tell less: those up
    to a share of it are taken.
    """
    for share in (_SHARE, 1.0):
        try:
            return second.crossing(special.point, share * reach)
        except NumericalError:
            continue
    return None


def _graze(
    second: SecondOpinion, special: SpecialPoint, a: BranchPoint, b: BranchPoint, reach: float, faults: list[str]
) -> Sides:
    """A grazing point: the contact pattern differs on both sides, and the depth of an extremum is zero between."""
    names = [describe_switch(special.orbit, switch) for switch in range(len(special.orbit.closings))]
    if special.contact not in names:
        return Sides((*faults, f"there is no contact {special.contact!r}"), None)
    switch = names.index(special.contact)
    if a.orbit.closings[switch] == b.orbit.closings[switch]:
        return Sides((*faults, f"{special.contact} closes as often on both sides"), None)
    turns = special.orbit.turning_depths[switch]
    theta = turns.thetas[int(np.argmin(np.abs(turns.values)))]
    full = PERIOD * special.orbit.period

    def depth(point: BranchPoint) -> float:
        found = point.orbit.turning_depths[switch]
        return found.values[found.nearest(theta, full)]

    return Sides(tuple(faults), _zero(second, special, reach, depth))
