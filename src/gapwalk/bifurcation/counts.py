"""Whether what changes from one point of a branch to the next is explained by the special points between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint, Unexplained
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import EndReason
from gapwalk.orbit.floquet import is_on_border

_SINGULAR = 1e-6  # distance from +1, and from a vertical tangent, of a branch point


def unexplained(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """What has changed from one point to the next and is not explained by the special points between, in sentences."""
    yield from _stability(a, b, special)
    for kind in (each for each in Kind.known() if each.sign_change):
        signs = [_sign(kind, point) for point in (a, b)]
        found = sum(each.kind is kind or (kind.is_turning and each.is_vertex) for each in special)
        if all(signs) and (signs[0] == signs[1]) is not (found % 2 == 0):
            yield (
                f"{kind.sign_change}, with {found} points of the kind {kind} between"
                if found % 2 == 0
                else (f"{found} points of the kind {kind} lie between, but the test function keeps its sign")
            )
    yield from _contacts(a, b, special)


def _stability(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Where the numbers of unstable multipliers do not follow from one another."""
    count = None if _is_undecided(a) else a.instability.total
    for each in special:
        if count is not None and each.before.total != count:
            yield f"{count} unstable multipliers come to a {each.kind} that counts {each.before.total} before it"
        count = each.after.total
    if count is not None and not _is_undecided(b) and b.instability.total != count:
        between = ", ".join(each.kind.value for each in special) or "nothing"
        yield f"{count} unstable multipliers become {b.instability.total}, with {between} between"


def _is_undecided(point: BranchPoint) -> bool:
    """Whether a multiplier is so near the unit circle that its error decides on which side of it it is."""
    orbit = point.orbit
    near = float(np.abs(np.abs(orbit.multipliers) - 1.0).min())
    return is_on_border(orbit.multipliers) or near < orbit.multiplier_error


def _sign(kind: Kind, point: BranchPoint) -> int:
    size = kind.at(point)
    if abs(size) < kind.noise or (_is_singular(point) if kind.moves_through_one else _is_undecided(point)):
        return 0
    return 1 if size > 0.0 else -1


def _is_singular(point: BranchPoint) -> bool:
    """Whether a point is itself a branch point, as the first of a branch that begins at another may be.

    Its tangent is one of two null vectors, known to some digits only.
    """
    near = abs(point.orbit.multipliers - 1.0).min()
    return bool(near < _SINGULAR) and abs(float(point.tangent[-1])) > _SINGULAR


def _contacts(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Which stages close more or less often than the grazing points between account for."""
    for switch, (now, then) in enumerate(zip(a.orbit.closings, b.orbit.closings, strict=True)):
        if a.orbit.system.gapless[switch] or b.orbit.system.gapless[switch]:
            continue  # without a gap nothing can touch
        name = describe_switch(a.orbit, switch)
        grazes = sum(each.kind is Kind.GRAZING and each.contact == name for each in special)
        change = abs(then - now)
        if change > grazes or (grazes - change) % 2:
            yield f"{name} closes {now} times, then {then} times, with {grazes} of its grazing points between"


def unexplained_of(branch: Branch) -> tuple[Unexplained, ...]:
    """All steps of a branch that its special points do not explain; none where nothing was missed."""
    return tuple(
        Unexplained(a.value, b.value, text)
        for number, (a, b, special) in enumerate(steps_of(branch))
        if not (number == 0 and branch.ends[0].reason is EndReason.BRANCHED)  # all test functions vanish there
        for text in unexplained(a, b, special)
    )


def steps_of(branch: Branch) -> Iterator[tuple[BranchPoint, BranchPoint, list[SpecialPoint]]]:
    """Neighbouring points with the special points between them; each special point occurs once."""
    left = list(branch.special_points)
    pairs = list(pairwise(branch.points))
    for number, (a, b) in enumerate(pairs):
        last = number == len(pairs) - 1
        count = next((i for i, each in enumerate(left) if each.point.arclength > b.arclength and not last), len(left))
        yield a, b, left[:count]
        del left[:count]
