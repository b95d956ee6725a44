"""Special points of sliding: along a branch, a phase of slip or of stick appears or vanishes.

The names are those of di Bernardo, Budd, Champneys and Kowalczyk (2008), Piecewise-smooth Dynamical Systems, chapter 8,
who call stick sliding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import product
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.friction_along_branch import (
    Located,
    changes_between,
    directions_left,
    find_changes,
    located_again,
    never_slips,
    position_of,
)
from gapwalk.bifurcation.friction_margin import Change, Instant, missed_by, own_phase
from gapwalk.bifurcation.special_point import (
    ROUNDING,
    SAFETY,
    ErrorEstimator,
    Kind,
    Search,
    Symbol,
    Zero,
    location_error,
)
from gapwalk.bifurcation.touch_map import Beyond, TouchMap, beyond
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, apart
from gapwalk.orbit.sticking import stick_words, text_of

if TYPE_CHECKING:
    from gapwalk.bifurcation.special_point import SpecialPoint

_EPS = float(np.finfo(float).eps)
_ALONG = (1e-5, 1e-4, 1e-6)  # arclengths over which the margin of an onset of slip tells its rate
_FARTHEST = 1e-6  # largest arclength within which two computations may place a change
_LENGTHS = (1e-8, 4e-8)  # arclengths from a change at which the length of its phase tells where it vanishes
_ROOT = 9.0  # growth of the square of that length between them, which is 4 for a root, and 16 for a line
_STAYS = 1e-3  # share of the distance that friction moves on one side of its onset, below which it stays on the other
_TOUCHES = 1e-4  # slip rate, as a share of its range, that is zero within the error of the point
_ASIDE = (1e-9, 1e-7, 1e-6, 1e-5, 1e-4)  # the same share, by which an orbit that touches is moved back
_BEFORE = 1e-4  # radians before a stick at which the rate still tells its derivatives
_NEAR = 1e-2  # radians around the touch within which a phase is its own
_SIGNS = {1: "+", -1: "-"}


class Sliding(Kind):
    """Kind of special point at which a phase of friction appears or vanishes."""

    turn = 0
    by_multipliers = False
    is_corner = True
    what: ClassVar[str]
    """Quantity that vanishes there, as in `gapwalk.orbit.sticking.Margin`."""
    touch_order: ClassVar[float]
    """Power of its value with which what the phase adds grows beyond, where friction sticks rigidly: an acceleration
    that grows over the length of the phase, to which a rate and a position are its integrals. (The last three are of
    theorems 8.1 to 8.4 in the book of di Bernardo and others.)"""
    tangency: ClassVar[int] = 0
    """Sign of the change of the reserve of the other direction where slip ends; 0 at kinds where slip does not end."""
    beyond_degenerate: ClassVar[str] = ""
    """Kind of the points of the same curve where that change has the other sign."""

    def owns(self, change: Change) -> bool:
        """Return True if a change of the sequence of phases is a point of this kind."""
        raise NotImplementedError

    def points_in(self, search: Search) -> list[Zero]:
        """Return all points of this kind in a step; see `find_changes`."""
        known = search.memo.get(Sliding)
        if known is None:
            found = find_changes(search.interval, search.before, search.first, search.last)
            known = search.memo[Sliding] = _new(search, found)
            search.corners += [each.point.arclength for each in known]
        return [
            Zero(
                self,
                each.point,
                each.spread,
                located_again(each.point.orbit, each.change),
                describe_friction(each.point.orbit, each.change),
                _EPS * float(np.abs(search.first.orbit.extremes[:, :2]).max()),
            )
            for each in known
            if self.owns(each.change)
        ]

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error from both sides: the branch may have a corner there."""
        halved = [each for each in search.memo.get(Sliding, []) if each.point is zero.point and each.before is not None]
        if halved:
            return _error_of_bracket(halved[0], second)
        sides = search.known_sides(zero.point)
        near = {point.arclength: point for point in (search.near(zero.point), *sides)}
        return location_error(zero, second, [*near.values()], () if len(sides) == 2 else (search.first, search.last))

    def nature(self, before: BranchPoint, after: BranchPoint) -> str:
        """Return how often each friction whose phases change sticks in a period, before and after the point."""
        names = [contact.name for contact in before.orbit.system.structure.contacts]
        texts = []
        for contact, phases in before.orbit.friction.items():
            words = stick_words(phases), stick_words(after.orbit.friction.get(contact, []))
            if words[0] != words[1]:
                texts.append(f"{names[contact]} {words[0]} -> {words[1]}")
        return ", ".join(texts)

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """See `Kind.examined`: the phase must be there on one side only."""
        changes = changes_between(before.orbit, after.orbit)
        own = [
            each
            for each in changes or []
            if self.owns(each) and describe_friction(special.orbit, each) == special.contact
        ]
        if not own:
            return [f"no phase of slip or stick of {special.contact} appears or vanishes as at a {self}"], None
        return [], located_again(special.orbit, own[0])

    def foretold(self, special: SpecialPoint) -> Beyond | None:
        """See `Kind.foretold`: what the phase adds is of higher order than its onset, so that a stable motion stays."""
        contact, _ = special.contact.rsplit(" ", 1)
        return self._foretold(special, [each.name for each in special.orbit.system.structure.contacts].index(contact))

    def _foretold(self, special: SpecialPoint, contact: int) -> Beyond | None:
        """Return the motion beyond from the multipliers on both sides."""
        stays = special.before.total == special.after.total == 0
        springs = contact in special.orbit.system.structure.memories
        order, leading = math.nan if springs else self.touch_order, complex(special.orbit.free_multipliers[0])
        return Beyond("goes on" if stays else "unknown", order, math.nan, leading)

    def residual(self, orbit: Orbit, multipliers: NDArray[np.complex128]) -> float:
        """Return the least margin of the kind, as a share of its range."""
        found = list[float]()
        for contact, side in product(orbit.friction, (1, -1)):
            with suppress(ConvergenceError, LookupError):
                found.append(missed_by(orbit, Instant(self.what, contact, side)))
        return min(found, default=math.nan)

    @property
    def no_locus(self) -> str:
        """Empty string, since it has a locus: the margin is zero along it."""
        return ""


def _error_of_bracket(located: Located, second: ErrorEstimator) -> float:
    """Estimate the error of a change that was located by the sequences of phases on both sides, not by its margin."""
    # It is the distance within which the second computation has the same sequences on both sides, and the one from
    # there to where the phase vanishes.
    before, after, contact = located.before, located.point, located.change.contact
    assert before is not None
    sides = [text_of(each.orbit.friction.get(contact, [])) for each in (before, after)]
    reach, blur = max(located.spread, _EPS), second.blur(after)
    while reach <= _FARTHEST:
        there = second.at(before, -reach), second.at(after, reach)
        if [text_of(each.orbit.friction.get(contact, [])) for each in there] == sides:
            width = abs(after.x[-1] and after.value / after.x[-1])
            along = width * (abs(float(after.tangent[-1])) * (reach + _unseen(located, second)) + blur.off)
            return SAFETY * (along + abs(second.at(after).value - after.value)) + ROUNDING * (abs(after.value) + width)
        reach *= 2.0
    return math.inf


def _unseen(located: Located, second: ErrorEstimator) -> float:
    """Return the arclength from a change of sequences to where its phase vanishes, if a quantity touches zero there."""
    # The length of such a phase grows as the root of the arclength. The flow leaves out those so brief that rounding
    # would decide on them.
    before, after, contact = located.before, located.point, located.change.contact
    assert before is not None
    is_longer = len(before.orbit.friction.get(contact, [])) > len(after.orbit.friction.get(contact, []))
    start, way = (before, -1.0) if is_longer else (after, 1.0)
    points = [second.at(start, way * away) for away in _LENGTHS]
    own = (own_phase(point.orbit, located.change, located.change.theta) for point in points)
    squares = [phase.length**2 for phase in own if phase is not None]
    if len(squares) < len(points) or not 1.0 < squares[1] / squares[0] < _ROOT:
        return 0.0  # another event cuts it short
    return abs(_LENGTHS[0] - squares[0] * (_LENGTHS[1] - _LENGTHS[0]) / (squares[1] - squares[0]))


def _new(search: Search, found: list[Located]) -> list[Located]:
    """Return located changes without those where a force reaches its bound again, without slip in the meantime."""
    # Once it has reached it, the motion is at the edge of a continuum, and steps may lead a little into it and back.
    # The memory of the walk has the contacts whose forces have, numbered from 1, with the sign of the direction.
    reached = search.recent(Kind.SLIP_ONSET)
    for key in {*reached}:
        if not never_slips(search.first.orbit, int(abs(key)) - 1):
            reached.remove(key)
    kept = []
    for each in found:
        key = float((each.change.contact + 1) * each.change.side)
        if each.change.alone and key in reached:
            continue
        if each.change.alone and never_slips(search.last.orbit, each.change.contact):
            reached.append(key)
        kept.append(each)
    return kept


class CrossingSliding(Sliding):
    """Crossing-sliding: where the slip rate reverses, friction begins or ceases to stick for a moment."""

    what, touch_order, tangency, beyond_degenerate = "stop", 2.0, -1, "switching-sliding"
    symbol = Symbol("crossing-sliding", "", "x", 5.0, "purple", (0.0, (9.0, 1.6)))

    def owns(self, change: Change) -> bool:
        """See `Sliding.owns`: from slip to slip the other way, with stick between."""
        return change.reverses and change.mode == 0


class SwitchingSliding(Sliding):
    """Switching-sliding: before it sticks, friction begins or ceases to slip back for a moment."""

    what, touch_order, tangency, beyond_degenerate = "stop", 3.0, 1, "crossing-sliding"
    symbol = Symbol("switching-sliding", "", "1", 6.0, "purple", (0.0, (4.5, 1.1, 1.0, 1.1)))

    def owns(self, change: Change) -> bool:
        """See `Sliding.owns`: from slip to stick, with slip the other way between."""
        return change.reverses and change.mode != 0


class GrazingSliding(Sliding):
    """Grazing-sliding: within slip the slip rate just touches zero, and friction begins or ceases to stick there."""

    what, touch_order = "rate", 1.0
    symbol = Symbol("grazing-sliding", "", "2", 6.0, "purple", (0.0, (2.4, 1.3)))

    def owns(self, change: Change) -> bool:
        """See `Sliding.owns`: slip, stick, and slip in the same direction."""
        return not change.reverses and change.before != 0

    def _foretold(self, special: SpecialPoint, contact: int) -> Beyond | None:
        """Return the motion beyond by the map of the touch, which is linear on either side."""
        touch = slide_map(special.orbit, contact, 1 if special.contact.endswith("+") else -1)
        return beyond(touch) if touch else super()._foretold(special, contact)


def slide_map(orbit: Orbit, contact: int, side: int) -> TouchMap | None:
    """Return the map of a moment of stick within slip to a side; None if several begin at once, or by a spring."""
    # Where the slip rate would reverse by d it becomes zero instead, and slip goes on when it would have been least:
    # so to leading order the rate changes by d there, at once.
    structure, full, n = orbit.system.structure, PERIOD * orbit.period, orbit.system.size
    touches = [each.theta for each in orbit.margins if each.what == "rate" and abs(each.value) < _TOUCHES * each.range]
    for phases in orbit.friction.values():  # it may be found where it sticks for an instant
        touches += [each.start - _BEFORE for each in phases if not each.mode and each.length < _NEAR]
    layout, coefficients = layout_of(structure), coefficients_of(orbit.system)
    slots, flow, state = layout.contacts[contact], flow_of(orbit.system, transition=True), orbit.state
    more = coefficients[slots.numbers["static"]] if "static" in slots.numbers else 1.0
    if contact in structure.memories or len(touches) != 1 or more != 1.0:
        return None
    theta, vector, size = touches[0] % full, np.zeros(len(state)), float(np.abs(orbit.extremes[:, :2]).max())
    along, push, speed = side * coefficients[slots.deflection], coefficients[slots.force], orbit.system.frequency * size
    vector[n : 2 * n], way = push / float(along @ push), vector
    for share in _ASIDE:
        found = flow.vary(coefficients, state, np.array([0.0, theta, full]))
        row = -along @ found.transitions[1][n : 2 * n]
        if not any(each.contact == contact and apart(each.theta % full, theta, full) < _NEAR for each in found.slips):
            # where the rate is least, by a parabola
            window = theta + 0.1 * _NEAR * np.arange(-2.0, 3.0)
            rates = along @ flow.vary(coefficients, state, np.array([0.0, *window])).states[1:, n : 2 * n].T
            bend, slope, _ = np.polyfit(window - theta, rates, 2)
            theta -= 0.5 * float(slope / bend)
            found = flow.vary(coefficients, state, np.array([0.0, theta, full]))
            row = -along @ found.transitions[1][n : 2 * n]
            there = found.states[1] + _ASIDE[0] * speed * vector
            after = flow.vary(coefficients, there, np.array([theta, full])).transitions[1]
            return TouchMap(1.0, 1.0, row, after @ vector, after @ found.transitions[1], size)
        way = row if state is orbit.state else way
        if not way.any():
            break
        state = orbit.state - share * speed * way / float(way @ way)
    return None


class AddingSliding(Sliding):
    """Adding-sliding: within stick the force just touches its bound, and a phase of slip divides the stick in two."""

    what, touch_order = "reserve", 2.0
    symbol = Symbol("adding-sliding", "", "+", 6.0, "purple", (0.0, (0.9, 1.1)))

    def owns(self, change: Change) -> bool:
        """See `Sliding.owns`: stick, slip, and stick again."""
        return not change.reverses and change.before == 0 and not change.alone


class SlipOnset(Sliding):
    """Onset of slip: friction that never slips begins to, as its force just touches its bound."""

    what = "reserve"
    symbol = Symbol("onset of slip", "", "h", 5.0, "purple", (0.0, (5.0, 1.1, 1.0, 1.1, 1.0, 1.1)))

    def foretold(self, special: SpecialPoint) -> None:
        """See `Kind.foretold`: before it, the motion is one of a continuum."""

    def owns(self, change: Change) -> bool:
        """See `Sliding.owns`: slip where there was stick all the time."""
        return not change.reverses and change.before == 0 and change.alone

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """See `Kind.examined`: there is slip on one side, or friction is pushed along without net slip."""
        # Then its force just reaches one of its bounds, or was led a little away from it, and its position moves in the
        # direction of slip. On the other side it is kept exactly.
        faults, function = super().examined(special, before, after)
        if faults:
            name, sign = special.contact.rsplit(" ", 1)
            contact = [each.name for each in special.orbit.system.structure.contacts].index(name)
            kept = position_of(special.orbit, contact)
            sides = [position_of(each.orbit, contact) - kept for each in (before, after)]
            stays, moves = sorted(sides, key=abs)
            sticks = all(never_slips(each.orbit, contact) for each in (before, after))
            if sticks and abs(stays) < _STAYS * abs(moves) and moves * int(f"{sign}1") > 0.0:
                return [], None
        return faults, function

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error on the side on which friction never slips: beyond, slip depends on the root."""
        # If it ceases to slip in both directions, but is found to reach only one of its bounds, its position is none
        # that it has where slip ends, and that place is only known to the step.
        doubt = 0.0
        changes = [each.change for each in search.memo.get(Sliding, []) if each.point is zero.point]
        for contact in {each.contact for each in changes}:
            found = {each.change.side for each in search.memo[Sliding] if each.change.contact == contact}
            if len(directions_left(search.first.orbit, search.last.orbit, contact)) > len(found):
                doubt = abs(search.last.value - search.first.value)
        near = _beside(search, zero.point)
        return math.inf if near is None else max(doubt, location_error(zero, second, [near]))


def _beside(search: Search, point: BranchPoint) -> BranchPoint | None:
    """Return a point near another one whose friction keeps the same positions; None if it slips on both sides."""
    corrector = search.corrector
    for distance in _ALONG:
        for way in (-distance, distance):
            beside = corrector.point_ahead(point, way)
            if beside is not None and {*point.orbit.stuck} <= {*beside.orbit.stuck}:
                return beside
    return None


def describe_friction(orbit: Orbit, change: Change) -> str:
    """Return the contact and the direction of slip of a change, such as ``lining +``."""
    return f"{orbit.system.structure.contacts[change.contact].name} {_SIGNS[change.side]}"
