"""Detection and location of every special point in one step of a walk, kind by kind.

It is checked that the special points between two points of a branch account for everything that changes between them.

Method: docs/numerics/notes/special-points.md
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

from gapwalk.bifurcation.branch import Branch, Unexplained
from gapwalk.bifurcation.friction_along_branch import unexplained_changes
from gapwalk.bifurcation.kinds.held_stop import held_changes, how_often
from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.special_point import VERTEX, ErrorEstimator, Kind, Search, SpecialPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import NumericalError
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.orbit.floquet import Instability, is_on_border, nearest_to_circle
from gapwalk.orbit.orbit import describe_switch, switch_named

_BESIDE = 1e-4  # arclength between special points that may be one
_SINGULAR = 1e-6  # distance from +1, and from a vertical tangent, of a branch point


class DetectorState(NamedTuple):
    """Memory of a detector between steps, per test function: its rate of change, and its last zeros."""

    rates: Mapping[Kind, float] = MappingProxyType({})
    recent: Mapping[Kind, tuple[float, ...]] = MappingProxyType({})


class Detector:
    """Detector of the special points of a walk, step by step.

    It remembers the rate at which each test function varied in the step before, and the last zeros found.
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
        """Return the special points between two neighbouring points, in order; `before` is the point before `first`."""
        search = Search(self.corrector, first, last, before, self._rates, self._recent)
        if self.corrector.is_dear:  # so that a step does not depend on whether the walk was resumed
            self._second.corrector.forget()
        for kind in self.kinds:
            kind.prepare(search)
        found = [zero for kind in self.kinds for zero in kind.points_in(search)]
        found.sort(key=lambda zero: zero.point.arclength)
        marks = [first.arclength, *(zero.point.arclength for zero in found), last.arclength]
        special, parameter = [], self.corrector.equation.parameter or ""
        for index, zero in enumerate(found, start=1):
            sides = search.sides(marks, index)
            nature = zero.kind.nature(*sides)
            if nature is None:
                continue
            try:
                error = float(zero.kind.error(search, zero, self._second))  # a plain number, for result files
            except NumericalError:
                error = math.inf
            counts = _instabilities(zero.kind, *sides)
            more = {"parameter": parameter, "multiplicity": zero.multiplicity}
            special.append(SpecialPoint(zero.kind, zero.point, *counts, error, zero.contact, nature, **more))
        return special

    @cached_property
    def _second(self) -> ErrorEstimator:
        return ErrorEstimator(self.corrector)


def _instabilities(kind: Kind, before: BranchPoint, after: BranchPoint) -> tuple[Instability, Instability]:
    """Return the numbers of unstable multipliers on both sides of a special point."""
    # Where the determinant of the Jacobian changes sign, one multiplier passes +1. In harmonic balance, however, the
    # multipliers belong to the motion, but folds and branch points to the truncated equation. So the multiplier may lie
    # on the same side of +1 at both points; its direction of motion then decides the numbers.
    sides = before.instability, after.instability
    signs = [point.determinant * float(point.tangent[-1]) for point in (before, after)]
    if not kind.moves_through_one or signs[0] * signs[1] >= 0.0 or sides[0].total != sides[1].total:
        return sides
    near, far = (kind.critical_multiplier(point.orbit.free_multipliers).real for point in (before, after))
    inner, outer = sides if near < far else sides[::-1]
    if max(near, far) <= 1.0:
        outer = outer._replace(above=outer.above + 1)
    elif min(near, far) > 1.0 and inner.above:
        inner = inner._replace(above=inner.above - 1)
    return (inner, outer) if near < far else (outer, inner)


def unexplained_of(branch: Branch) -> tuple[Unexplained, ...]:
    """Return all steps of a branch that its special points do not explain; none if nothing was missed."""
    return tuple(
        Unexplained(a.value, b.value, text)
        for number, (a, b, special) in enumerate(steps_of(branch))
        if branch.ends[-1].reason is not EndReason.CENTRE  # changes of the parameter and multipliers are rounding
        and not (number == 0 and branch.ends[0].reason is EndReason.BRANCHED)  # all test functions vanish there
        for text in unexplained(a, b, special, joining_points(branch))
    )


def as_one(
    points: Sequence[BranchPoint], special: Sequence[SpecialPoint]
) -> tuple[tuple[BranchPoint, ...], tuple[SpecialPoint, ...]]:
    """Return the points of a branch with special points of one kind and contact that lie within their errors as one."""
    # Rounding may let the same change come and go several times. Of these, the fewest are kept that explain what
    # changes over all of them, and the points of the walk between them are left out.
    kept, lost = list[SpecialPoint](), list[tuple[float, float]]()
    for group in _groups(special):
        ends = group[0].point.arclength, group[-1].point.arclength
        before = max((each for each in points if each.arclength < ends[0]), key=_place, default=None)
        after = min((each for each in points if each.arclength > ends[1]), key=_place, default=None)
        few = _fewest(group)
        if len(few) < len(group) and before and after and _may_replace(few, before, after):
            kept += few
            lost.append((before.arclength, after.arclength))
        else:
            kept += group
    inside = [each for each in points if not any(low < each.arclength < high for low, high in lost)]
    return tuple(inside), tuple(kept)


def _may_replace(few: Sequence[SpecialPoint], before: BranchPoint, after: BranchPoint) -> bool:
    """Return True if a few special points say all that happens between two points; none cannot if the branch turns."""
    turns = float(before.tangent @ after.tangent) < 0.0
    return not any(unexplained(before, after, few)) and (bool(few) or not turns)


def _place(point: BranchPoint) -> float:
    return point.arclength


def _groups(special: Sequence[SpecialPoint]) -> list[list[SpecialPoint]]:
    """Return successive special points in groups of those that lie within their errors."""
    groups: list[list[SpecialPoint]] = []
    for each in special:
        if groups and any(_is_within(each, other) for other in groups[-1]):
            groups[-1].append(each)
        else:
            groups.append([each])
    return groups


def _is_within(one: SpecialPoint, other: SpecialPoint) -> bool:
    errors = sum(each.uncertainty for each in (one, other) if math.isfinite(each.uncertainty))
    is_beside = abs(one.point.arclength - other.point.arclength) < _BESIDE
    return is_beside and abs(one.value - other.value) <= errors


def _fewest(group: Sequence[SpecialPoint]) -> list[SpecialPoint]:
    """Return one of each odd number of alike special points, the surest, with the stabilities on both sides of all."""
    alike: dict[tuple[Kind, str], list[SpecialPoint]] = {}
    for each in group:
        alike.setdefault((each.kind, each.contact), []).append(each)
    odd = [min(each, key=lambda one: one.uncertainty) for each in alike.values() if len(each) % 2]
    odd.sort(key=lambda each: each.point.arclength)
    sides = [group[0].before] * len(odd) + [group[-1].after]
    return [replace(each, before=sides[place], after=sides[place + 1]) for place, each in enumerate(odd)]


def joining_points(branch: Branch) -> list[BranchPoint]:
    """Return the ends of a branch at which it joins the branch from which it had branched off."""
    ends = zip((branch.points[0], branch.points[-1]), (branch.ends[0], branch.ends[-1]), strict=True)
    return [point for point, end in ends if end.reason is EndReason.JOINED]


def steps_of(branch: Branch) -> Iterator[tuple[BranchPoint, BranchPoint, list[SpecialPoint]]]:
    """Yield pairs of neighbouring points with the special points between them; each special point occurs once."""
    left = deque(branch.special_points)
    for a, b in pairwise(branch.points):
        is_last = b is branch.points[-1]
        between = []
        while left and (is_last or left[0].point.arclength <= b.arclength):
            between.append(left.popleft())
        yield a, b, between


def unexplained(
    a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint], joining: Sequence[BranchPoint] = ()
) -> Iterator[str]:
    """Yield, as sentences, the changes from one point to the next that the special points between do not explain."""
    # Of the points, `joining` are ends where the branch joins another. A step was cut off there, at the vertex of the
    # branch, after all of it had been explained. What remains of the test functions that vanish at a vertex has no
    # sign.
    yield from _stability(a, b, special)
    for kind in (each for each in Kind.known() if each.sign_change):
        signs = [0.0 if point in joining and _is_vertex(point, kind) else _sign(kind, point) for point in (a, b)]
        found = sum(_passes(kind, each, a, b, special) for each in special)
        if all(signs) and (signs[0] == signs[1]) is not (found % 2 == 0):
            yield (
                f"{kind.sign_change}, with {found} points of the kind {kind} between"
                if found % 2 == 0
                else (f"{found} points of the kind {kind} lie between, but the test function does not change its sign")
            )
    yield from _corners(a, b, special)
    yield from _contacts(a, b, special)
    yield from _stops(a, b, special)
    yield from _friction(a, b, special)


def _passes(kind: Kind, special: SpecialPoint, a: BranchPoint, b: BranchPoint, others: Sequence[SpecialPoint]) -> int:
    """Return how often the test function of a kind changes its sign at a special point of this or another kind."""
    # A multiplier that jumps across +1 turns the branch. If that of a motion with a symmetry does, where both sides of
    # a rigid stop graze at once, a branch without the symmetry may begin instead, and this one does not turn.
    if kind in (special.kind, Kind.BRANCH_POINT) and special.kind.is_turning:  # the branch turns, and others cross
        return 1 if kind is special.kind else special.multiplicity - 1
    if kind is special.kind:
        return special.multiplicity
    at_once = any(
        each.kind is Kind.GRAZING and each.contact != special.contact and _is_at(each, special) for each in others
    )
    leaps = abs(special.before.above - special.after.above) if special.is_corner and at_once else 0
    turned = float(a.tangent[-1] * b.tangent[-1]) < 0.0
    crosses = leaps > 0 and (leaps % 2 == 0) is turned  # two that leap are one with the symmetry, and one without
    if kind.is_turning:
        return special.is_vertex or (turned if crosses else special.turns)
    return special.passes_flip if kind is Kind.FLIP else kind is Kind.BRANCH_POINT and crosses


def _is_at(other: SpecialPoint, special: SpecialPoint) -> bool:
    return other.point.arclength == special.point.arclength


def _stability(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the inconsistencies in the number of unstable multipliers from one special point to the next."""
    count = None if _is_undecided(a) else a.instability.total
    for each in special:
        if count is not None and each.before.total != count:
            yield f"{count} unstable multipliers precede a {each.kind}, but it states {each.before.total} before it"
        count = each.after.total
    if count is not None and not _is_undecided(b) and b.instability.total != count:
        between = ", ".join(each.kind.value for each in special) or "nothing"
        yield f"{count} unstable multipliers become {b.instability.total}, with {between} between"


def _corners(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the grazes with stable motions where a multiplier must be unbounded: where a force that jumps is touched.

    Where friction sticks, or a stop is held, all that a touch changes may be lost.
    """
    corners = [each for each in special if each.kind is Kind.GRAZING and each.is_corner]
    unbounded = jumping_switches(a.orbit.system) if corners else ()
    corners = [each for each in corners if switch_named(a.orbit, each.contact) in unbounded]
    if any(point.orbit.slips or any(count for count, _ in point.orbit.held.values()) for point in (a, b) if corners):
        return
    changes = a.orbit.closing_changes(b.orbit) if corners else []
    for each in corners:
        group = [other for other in corners if _is_at(other, each)]
        switch = switch_named(a.orbit, each.contact) or 0
        only = sum(other.contact == each.contact for other in corners) == 1
        sides = {"before": group[0].before, "after": group[-1].after}
        touching = [("after" if changes[switch] > 0 else "before")] if only else [*sides]
        if all(sides[side].total == 0 for side in touching):
            yield f"no multiplier is unstable {' or '.join(touching)} {each.contact} grazes, but one is unbounded"


def _is_undecided(point: BranchPoint) -> bool:
    """Return True if a multiplier is so near the unit circle that its error decides on which side it lies."""
    known = point.memo.get(_is_undecided)
    if known is None:
        orbit = point.orbit
        near = nearest_to_circle(orbit.free_multipliers)
        known = point.memo[_is_undecided] = is_on_border(orbit.free_multipliers) or near < orbit.multiplier_error
    return known


def _sign(kind: Kind, point: BranchPoint) -> float:
    """Return the sign of a test function at a point, 1 or -1; 0 if it is not significant."""
    # The first point of a bifurcating branch may be a branch point itself. Its tangent is then one of two null vectors
    # and only known to a few digits.
    known = point.memo.get((_sign, kind))
    if known is None:
        value = kind.at(point)
        if abs(value) < kind.noise:
            is_unclear = True
        elif not kind.moves_through_one:
            is_unclear = _is_undecided(point)
        else:
            near = min(abs(each - 1.0) for each in point.orbit.free_multipliers.tolist())
            is_unclear = near < _SINGULAR and abs(float(point.tangent[-1])) > _SINGULAR
        known = point.memo[_sign, kind] = 0.0 if is_unclear else math.copysign(1.0, value)
    return known


def _is_vertex(point: BranchPoint, kind: Kind) -> bool:
    """Return whether a test function of a kind would vanish at a point if the branch turned back just there."""
    return kind.moves_through_one and abs(float(point.tangent[-1])) < VERTEX


def _contacts(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the stages whose number of closings changes by more than the grazing points between account for."""
    changes = a.orbit.closing_changes(b.orbit)
    if not special and not any(changes):
        return
    for switch, (now, then, change) in enumerate(zip(a.orbit.closings, b.orbit.closings, changes, strict=True)):
        if a.orbit.system.gapless[switch] or b.orbit.system.gapless[switch]:
            continue  # without a gap nothing can touch
        name = describe_switch(a.orbit, switch)
        grazes = sum(each.kind is Kind.GRAZING and each.contact == name for each in special)
        if abs(change) > grazes or (grazes - change) % 2:
            times = f"{now} times per period before this step, {then} times after it"
            yield f"{name} closes {times}, and grazes {grazes} times in it"


def _stops(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the rigid stops that are held otherwise, where no point between tells it."""
    for switch in held_changes(a, b):
        name = describe_switch(a.orbit, switch)
        if not any(each.kind is Kind.HELD_STOP and each.contact == name for each in special):
            held = [how_often(each.orbit, switch) for each in (a, b)]
            yield f"{name} is held {held[0]} times per period before this step, {held[1]} after it"


def _friction(a: BranchPoint, b: BranchPoint, special: Sequence[SpecialPoint]) -> Iterator[str]:
    """Yield the changes of slip and stick that the special points of sliding between do not account for."""
    names = [contact.name for contact in a.orbit.system.structure.contacts]

    def explained(contact: int) -> int:
        own = {f"{names[contact]} +", f"{names[contact]} -"}
        return sum(isinstance(each.kind, Sliding) and each.contact in own for each in special)

    yield from unexplained_changes(a.orbit, b.orbit, explained)
