"""Second determination of special points: from both sides, with another discretisation.

What changes at a special point, and where, is determined from orbits on both sides of it, and their multipliers are
computed with another number of segments.

The criticality of a fold (the side to which it opens) is judged by the motions on both sides of it. A flip is judged by
doubled motions at growing amplitudes, shot in more segments than in the walk. Decisive is the smallest amplitude at
which their parameter differs from that of the flip by more than rounding, since the criticality is defined in the
limit. No contact may graze up to that amplitude.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.error_estimate import ErrorEstimator
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.floquet import is_on_border
from gapwalk.orbit.shooting import Shooting, ShootingEquation
from gapwalk.verification.walk_again import Track

_REACH = 1e-3  # arclength at which the sides of a special point are examined, unless its neighbours are nearer
_WIDE = 5e-3  # the same for a branch point, close to which no orbit can be corrected
_SECANT = 1e-4  # arclength over which a test function is linear
_SHARE = 0.4  # share of the distance to a neighbour; also the factor for a second, nearer examination
_NEARER = 5  # largest number of examinations
_AMPLITUDES = 1e-6 * 2.0 ** np.arange(12)  # scaled distances of doubled motions from the flip
_NOISE = 1e-13  # error of the scaled parameter of a doubled motion
_ROUNDING = 1e-16  # that error times the amplitude: near the flip a residual hardly determines the parameter
_AGREEING = 2  # number of amplitudes that must agree
_CLEAR = 30.0  # factor on the error above which a difference is significant


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
    first = seen = _look(second, special, reaches[0])
    for reach in reaches[1:]:
        if not seen.faults:
            return seen
        seen = _look(second, special, reach)
    return first if seen.faults else seen


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
    faults = [
        f"{point.instability.total} unstable multipliers {side} it, where {stored.total} are stored"
        for side, point, stored in (("before", a, special.before), ("after", b, special.after))
        if not is_on_border(point.orbit.multipliers) and point.instability.total != stored.total
    ]
    if special.kind is Kind.GRAZING:
        return _graze(second, special, a, b, reach, faults)
    signs = [special.kind.at(each) for each in (a, b)]
    if signs[0] * signs[1] > 0.0:
        return Sides((*faults, f"the test function of a {special.kind.value} does not change its sign"), None)
    if special.kind is Kind.BRANCH_POINT:
        return Sides(tuple(faults), _crossing(second, special, reach), a, b)
    return Sides(tuple(faults), _zero(second, special, reach, special.kind.at), a, b)


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


def nature_faults(
    track: Track, second: ErrorEstimator, special: SpecialPoint, before: BranchPoint, after: BranchPoint
) -> Iterator[str]:
    """Yield contradictions to the stated criticality of a special point; none if it cannot be determined again.

    Parameters
    ----------
    track
        The branch.
    second
        Estimator that computes the branch with another discretisation.
    special
        The special point.
    before, after
        Motions on both sides of it, with that discretisation.
    """
    if not special.nature:
        return
    try:
        if special.kind is Kind.FOLD:
            found = _fold(second, special, before, after)
        elif special.kind is Kind.FLIP and special.orbit.is_exact:
            found = _flip(track, special, before, after)
        else:
            return
    except NumericalError:
        return
    if found and found not in special.nature:
        yield f"its criticality is stated as {special.nature!r}, but is {found}"


def _fold(second: ErrorEstimator, special: SpecialPoint, before: BranchPoint, after: BranchPoint) -> str:
    here = second.at(special.point).value
    sides = [each.value - here for each in (before, after)]
    scaled = float(special.point.x[-1])
    width = abs(special.value) + (abs(special.value / scaled) if scaled else 1.0)
    if min(map(abs, sides)) < _CLEAR * _NOISE * width or sides[0] * sides[1] < 0.0:
        return ""
    return "lower" if sides[0] < 0.0 else "higher"


def _flip(track: Track, special: SpecialPoint, before: BranchPoint, after: BranchPoint) -> str:
    # the multiplier nearest to -1
    critical = [min(point.orbit.multipliers.tolist(), key=lambda mu: abs(mu + 1.0)) for point in (before, after)]
    outside = [abs(each) > 1.0 for each in critical]
    if outside[0] == outside[1]:
        return ""
    unstable = (before if outside[0] else after).value - special.value
    leaves = _leaves(track, special)
    if not leaves or not unstable:
        return ""
    return "supercritical" if leaves * unstable > 0.0 else "subcritical"


def _leaves(track: Track, special: SpecialPoint) -> float:
    """Return the side, as a sign, on which the doubled branch leaves a flip; 0 if it cannot be determined."""
    segments = track.segments + 1
    orbit, size = replace(special.orbit, period=2 * special.orbit.period), 2 * special.orbit.system.size
    equation = ShootingEquation(orbit.system, track.branch.parameter, orbit.period, Shooting(segments))
    known = track.corrector(len(special.point.x)).scales
    scales = np.append(np.tile(known[:size], segments), known[-1])
    start = np.append(equation.unknowns(orbit), special.value) / scales
    evaluation = equation.evaluate(start[:-1] * scales[:-1], special.value)
    across = np.append(np.linalg.svd(evaluation.by_unknowns * scales[:-1])[2][-1], 0.0)
    corrector = Corrector(equation, scales)
    error = _CLEAR * (special.uncertainty / abs(known[-1]) + _NOISE * (1.0 + abs(start[-1])))
    closings = tuple(2 * count for count in special.orbit.closings)
    sides: list[float] = []
    for amplitude in _AMPLITUDES:
        correction = corrector.correct(start + amplitude * across, across)
        if correction is None:
            continue
        shift = float(correction.x[-1] - start[-1])
        if abs(shift) > error + _CLEAR * _ROUNDING / amplitude:
            if corrector.point(correction, across, amplitude).orbit.closings != closings:
                break  # a contact grazes at a smaller amplitude than can be distinguished from the flip
            sides.append(float(np.sign(shift)))
        if len(sides) == _AGREEING:
            break
    return sides[0] if len(sides) == _AGREEING and len(set(sides)) == 1 else 0.0
