"""Check that the special points between two points of a branch account for everything that changes between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint, Unexplained
from gapwalk.bifurcation.kinds.grazing import describe_switch
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk import EndReason
from gapwalk.orbit.floquet import is_on_border

_SINGULAR = 1e-6  # distance from +1, and from a vertical tangent, of a branch point


def unexplained(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield, as sentences, the changes from one point to the next that the special points between do not explain."""
    yield from _stability(a, b, special)
    for kind in (each for each in Kind.known() if each.sign_change):
        signs = [_sign(kind, point) for point in (a, b)]
        found = sum(each.kind is kind or (kind.is_turning and each.is_vertex) for each in special)
        if all(signs) and (signs[0] == signs[1]) is not (found % 2 == 0):
            yield (
                f"{kind.sign_change}, with {found} points of the kind {kind} between"
                if found % 2 == 0
                else (f"{found} points of the kind {kind} lie between, but the test function does not change its sign")
            )
    yield from _contacts(a, b, special)


def _stability(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the inconsistencies in the number of unstable multipliers from one special point to the next."""
    count = None if _is_undecided(a) else a.instability.total
    for each in special:
        if count is not None and each.before.total != count:
            yield f"{count} unstable multipliers precede a {each.kind} that states {each.before.total} before it"
        count = each.after.total
    if count is not None and not _is_undecided(b) and b.instability.total != count:
        between = ", ".join(each.kind.value for each in special) or "nothing"
        yield f"{count} unstable multipliers become {b.instability.total}, with {between} between"


def _is_undecided(point: BranchPoint) -> bool:
    """Return whether a multiplier is so near the unit circle that its error decides on which side it lies."""
    orbit = point.orbit
    near = float(np.abs(np.abs(orbit.multipliers) - 1.0).min())
    return is_on_border(orbit.multipliers) or near < orbit.multiplier_error


def _sign(kind: Kind, point: BranchPoint) -> int:
    size = kind.at(point)
    if abs(size) < kind.noise or (_is_singular(point) if kind.moves_through_one else _is_undecided(point)):
        return 0
    return 1 if size > 0.0 else -1


def _is_singular(point: BranchPoint) -> bool:
    """Return whether a point is itself a branch point, as the first point of a bifurcating branch may be.

    Its tangent is then one of two null vectors and only known to a few digits.
    """
    near = abs(point.orbit.multipliers - 1.0).min()
    return bool(near < _SINGULAR) and abs(float(point.tangent[-1])) > _SINGULAR


def _contacts(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the stages whose number of closings changes by more than the grazing points between account for."""
    for switch, (now, then) in enumerate(zip(a.orbit.closings, b.orbit.closings, strict=True)):
        if a.orbit.system.gapless[switch] or b.orbit.system.gapless[switch]:
            continue  # without a gap nothing can touch
        name = describe_switch(a.orbit, switch)
        grazes = sum(each.kind is Kind.GRAZING and each.contact == name for each in special)
        change = abs(then - now)
        if change > grazes or (grazes - change) % 2:
            yield f"{name} closes {now} times, then {then} times, with {grazes} of its grazing points between"


def unexplained_of(branch: Branch) -> tuple[Unexplained, ...]:
    """Return all steps of a branch that its special points do not explain; none if nothing was missed."""
    return tuple(
        Unexplained(a.value, b.value, text)
        for number, (a, b, special) in enumerate(steps_of(branch))
        if not (number == 0 and branch.ends[0].reason is EndReason.BRANCHED)  # all test functions vanish there
        for text in unexplained(a, b, special)
    )


def steps_of(branch: Branch) -> Iterator[tuple[BranchPoint, BranchPoint, list[SpecialPoint]]]:
    """Yield pairs of neighbouring points with the special points between them; each special point occurs once."""
    left = list(branch.special_points)
    pairs = list(pairwise(branch.points))
    for number, (a, b) in enumerate(pairs):
        last = number == len(pairs) - 1
        count = next((i for i, each in enumerate(left) if each.point.arclength > b.arclength and not last), len(left))
        yield a, b, left[:count]
        del left[:count]
