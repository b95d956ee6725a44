"""Changes of the sequence of slip and stick along a branch: which phase appears or vanishes, and exactly where.

One phase vanishes at each such point, between the phase before and the phase after it. At that point a *margin* of the
orbit is zero. It is defined on both sides and continuous:

- Where the slip rate reverses its sign, the margin is the *reserve* of the force there: friction sticks if the force
  that it needs for that is within its bound.
- Where stick ends in slip of one direction or of the other, the margin is the difference of the reserves of both: there
  the bounds vanish, as where the contact that presses opens.
- Where slip is interrupted by stick, the margin is the least slip rate. With stick, it is the value that the rate would
  reach if slip went on, to leading order: ``-g'^2 / (2 g'')`` of the rate g where slip ends.
- Where stick is interrupted by slip, the margin is the least reserve, and with slip the value that it would reach.

di Bernardo, Budd, Champneys and Kowalczyk (2008), Piecewise-smooth Dynamical Systems, chapter 8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress

from gapwalk.bifurcation.held_friction import Held, held_in
from gapwalk.bifurcation.onset_of_slip import (
    Change,
    Located,
    instant_of,
    locate_onsets,
    margin,
    modes_around,
    never_slips,
    own_phase,
)
from gapwalk.bifurcation.step_interval import StepInterval, zero_between
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.friction_gauge import FrictionGauge
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, apart
from gapwalk.orbit.sticking import FrictionPhase, Margin, friction_phases, text_of

_SMALLEST = 1e-11  # arclength below which a step is not divided any more
_MOST = 4  # number of phases that may vanish at once, as in symmetric motions
_RESERVE = 1e-8  # share of its bound by which a force must fall short of it not to have reached it
_BESIDE = 1e-5  # arclength at which the sequence is examined on both sides of a change
_NARROW = 1e-4  # arclength of a step below which it is not
_MOVED = 0.5  # radians by which a margin may move between two points
_DOUBT = 0.5  # share of its bend by which a margin may have moved between two points; 1/8 for a parabola
_NEAR = 0.05  # share of its range within which a least value that appears counts as near zero
_FAR, _LONG = 0.6, 4e-3  # the same in steps of more than this arclength
_BIRTH = 2e-4  # arclength to which the appearance of such a value is narrowed down
_JUMPS = 1e-11  # arclength from a located point within which the margin is that small too
_UNSEEN = 1e-6  # arclength within which the margin of a change is zero if it was found by halving
_TOUCH = 1e-6  # margin of a located point, relative to the margins at the ends of its bracket, that is only rounding


def changes_between(first: Orbit, last: Orbit) -> list[Change] | None:
    """Return the phases that only one of two neighbouring orbits has; None if several changes cannot be separated."""
    if not (first.is_exact and last.is_exact):
        return []
    found: list[Change] = []
    for contact in sorted({*first.friction, *last.friction}):
        poor, rich = sorted((each.friction.get(contact, []) for each in (first, last)), key=len)
        tries = (_removed(contact, rich, text_of(poor), most) for most in range(_MOST + 1))
        removed = next((each for each in tries if each is not None), None)  # with the fewest phases
        if removed is None:
            return None
        found += removed or _reached(contact, first, last)
    return found


def _reached(contact: int, first: Orbit, last: Orbit) -> list[Change]:
    """Return the onset of slip if friction sticks in both orbits, but its force reaches its bound in the last one.

    The motion then moves along the edge of the continuum, and back into it only if a step leads there.
    """
    if contact not in first.stuck or not never_slips(last, contact):
        return []
    slips = [phase for phase in friction_phases(last.slips, contact, PERIOD * last.period) if phase.mode]
    if not slips:
        return []
    change = Change(contact, 0, slips[0].mode, 0, slips[0].start, True)
    try:
        reserve = margin(first, change, change.theta)[1]
    except LookupError:
        return []
    return [change] if reserve > _RESERVE * abs(_bound(first, change)) else []


def _bound(orbit: Orbit, change: Change) -> float:
    """Return the force at which slip begins, at the angle of a change."""
    gauge, now = FrictionGauge(layout_of(orbit.system.structure), change.contact), instant_of(orbit, change.theta)
    return float(
        gauge.bound_and_force(coefficients_of(orbit.system), now.theta, now.state, gauge.sticking(now.modes))[0]
    )


def _removed(contact: int, phases: list[FrictionPhase], text: str, most: int) -> list[Change] | None:
    """Return the shortest phases without which the others have the given cyclic sequence of modes."""
    own = text_of(phases)
    if len(own) == len(text) and own in text + text:
        return []
    if len(own) <= len(text) or not most:
        return None
    for place in sorted(range(len(phases)), key=lambda number: phases[number].length)[:_MOST]:
        phase, past, following = phases[place], phases[place - 1], phases[(place + 1) % len(phases)]
        rest = [*phases[place + 1 :], *phases[:place]]
        if past.mode == following.mode:
            merged = FrictionPhase(past.mode, past.start, past.start + past.length + phase.length + following.length)
            rest = [merged] if len(rest) == 1 else [*rest[1:-1], merged]
        others = _removed(contact, rest, text, most - 1)
        if others is not None:
            around = past.mode, phase.mode, following.mode
            return [Change(contact, *around, phase.start, text == "0", modes_around(rest).count(around)), *others]
    return None


def find_changes(
    interval: StepInterval, before: BranchPoint | None, first: BranchPoint, last: BranchPoint
) -> list[Located]:
    """Find the changes of friction between two neighbouring points of a walk, in order; `before` is the point before.

    A step in which they cannot be told apart is halved, and one in which changes that cancel each other may hide.
    """
    changes, length = changes_between(first.orbit, last.orbit), last.arclength - first.arclength
    if changes == [] and not (
        length > interval.finest and _may_change(before, first, last, held_in(interval.corrector))
    ):
        return []
    if changes:
        onsets = [change for change in changes if change.alone]
        found = [_locate(interval, first, last, change) for change in changes if not change.alone]
        located = [*locate_onsets(interval, first, last, onsets), *(each for each in found if each is not None)]
        # the force may be at its other bound already
        if len(located) == len(changes) or (len(onsets) == len(changes) and located):
            return _refined(interval, before, first, last, sorted(located, key=lambda each: each.point.arclength))
    if length < _SMALLEST:
        return [_locate_beside(interval, first, last, change) for change in changes or []]
    middle = interval.middle(first, last)
    return find_changes(interval, before, first, middle) + find_changes(interval, first, middle, last)


def _may_change(before: BranchPoint | None, first: BranchPoint, last: BranchPoint, held: Held) -> bool:
    """Return True if changes that cancel each other may hide between two points of a walk with the same sequence.

    Springs that are held do not slip.
    """
    if not any(any(phase.mode for phase in phases) for phases in first.orbit.friction.values()):
        return False
    full, length = PERIOD * first.orbit.period, last.arclength - first.arclength
    now, then = ([each for each in point.orbit.margins if each.contact not in held] for point in (first, last))
    past = None if before is None or first.arclength <= before.arclength else before.orbit.margins
    ratio = math.nan if past is None or before is None else length / (first.arclength - before.arclength)
    for own in now:
        following = _become(own, then, full)
        if following is None:
            continue
        preceding = None if past is None else _become(own, past, full)
        if preceding is not None:
            bend = abs((following.value - own.value) - ratio * (own.value - preceding.value))
            if min(abs(own.value), abs(following.value)) < _DOUBT * bend:
                return True
    if length <= _BIRTH:
        return False
    lonely = [each for each in now if _become(each, then, full) is None]
    lonely += [each for each in then if _become(each, now, full) is None]
    near = _NEAR if length <= _LONG else _FAR
    return any(each.what != "stop" and 0.0 <= each.value < near * each.range for each in lonely)


def _become(own: Margin, others: Sequence[Margin], full: float) -> Margin | None:
    """Return the margin among others that one has become."""
    alike = [
        each
        for each in others
        if (each.contact, each.what, each.side) == (own.contact, own.what, own.side)
        and apart(each.theta, own.theta, full) < _MOVED
    ]
    return min(alike, key=lambda each: apart(each.theta, own.theta, full), default=None)


def _refined(
    interval: StepInterval, before: BranchPoint | None, first: BranchPoint, last: BranchPoint, located: list[Located]
) -> list[Located]:
    """Return located changes with those in the rest of the step.

    The changes at the ends of the step may be the sum of several, of which only one has been located.
    """
    length = last.arclength - first.arclength
    beside = min(_BESIDE, 1e-3 * length)
    low, high = located[0].point.arclength - beside, located[-1].point.arclength + beside
    if length < _NARROW or any(each.change.alone for each in located):
        return located
    if low <= first.arclength or high >= last.arclength:
        return located
    ends = interval.at(low), interval.at(high)
    outer = [(before, first, ends[0]), (ends[0], ends[1], last)]
    left, right = ([part] if changes_between(part[1].orbit, part[2].orbit) != [] else [] for part in outer)
    if not left and not right:
        return located
    # where nothing changes any more, the margin that vanishes at the end would let the part be halved over and over
    return [each for part in [*left, (first, *ends), *right] for each in find_changes(interval, *part)]


def _locate_beside(interval: StepInterval, first: BranchPoint, last: BranchPoint, change: Change) -> Located:
    """Locate a change between two points that halving has found: by its margin, or where it has none, as their place.

    The flow leaves out slip and stick so brief that rounding would decide on them, so the sequence changes a little
    beside the zero of the margin.
    """
    low, high = (interval.points[place].arclength for place in (0, -1))
    with suppress(NumericalError):
        before, after = (interval.at(min(max(last.arclength + shift, low), high)) for shift in (-_UNSEEN, _UNSEEN))
        if before is not after and (found := _locate(interval, before, after, change)) is not None:
            return found
    return Located(last, change, last.arclength - first.arclength, first)


def _locate(interval: StepInterval, first: BranchPoint, last: BranchPoint, change: Change) -> Located | None:
    """Locate the zero of the margin of one change; None if its margin cannot be tracked over the step."""
    known: Located | None = interval.located.get(change)
    if known is not None and first.arclength < known.point.arclength < last.arclength:
        return known  # found before the step was divided
    tracked: dict[float, tuple[float, float]] = {}

    def value(arclength: float) -> float:
        if arclength not in tracked:
            nearest = min(tracked, key=lambda known: abs(known - arclength), default=None)
            theta = change.theta if nearest is None else tracked[nearest][0]
            point = interval.at(arclength)
            if (change, theta) not in point.memo:  # the ends of a step that is divided are asked again
                point.memo[change, theta] = margin(point.orbit, change, theta)
            tracked[arclength] = point.memo[change, theta]
        return tracked[arclength][1]

    rich = _has(first.orbit, change), _has(last.orbit, change)
    ends = (last, first) if rich[1] and not rich[0] else (first, last)
    try:
        sizes = value(ends[0].arclength), value(ends[1].arclength)
        # where a bound vanishes, the margin is zero wherever the phase is not, and its sign there is only rounding
        if sizes[0] * sizes[1] >= 0.0 or min(map(abs, sizes)) <= _TOUCH * max(map(abs, sizes)):
            return None
        # where the margin jumps, it has no zero, and the step is divided
        root, converged = zero_between(value, first.arclength, last.arclength, jumps=False)
        if not converged:
            return None
        # where the margin jumps, one of several phases was tracked on one side, and another one on the other side
        around = [size for place, (_, size) in tracked.items() if abs(place - root) <= _JUMPS]
        if max(map(abs, [value(root), *around])) > _TOUCH * max(map(abs, sizes)):
            return None
    except LookupError:
        return None
    point, found = interval.at(root), change._replace(theta=tracked[root][0])
    point.memo[found] = tracked[root][1]
    interval.located[change] = Located(point, found, 1e-12)
    return interval.located[change]


def _has(orbit: Orbit, change: Change) -> bool:
    return own_phase(orbit, change, change.theta) is not None


def unexplained_changes(first: Orbit, last: Orbit, explained: Callable[[int], int]) -> list[str]:
    """Return, as sentences, the changes of friction between two orbits that the points between do not explain.

    `explained` returns the number of such points of a contact, by its number.
    """
    found = []
    if not (first.system.structure.friction and first.is_exact and last.is_exact):
        return []
    for contact in sorted({*first.friction, *last.friction}):
        texts = [text_of(each.friction.get(contact, [])) for each in (first, last)]
        if len(texts[0]) == len(texts[1]) and texts[0] in texts[1] * 2:
            continue
        count = explained(contact)
        if not count or (abs(len(texts[1]) - len(texts[0])) > 2 * count and "0" not in texts):
            name = first.system.structure.contacts[contact].name
            found.append(
                f"{name} goes through {texts[0]} per period before this step and through {texts[1]} after it, with "
                f"{count} points of sliding between"
            )
    return found


def located_again(orbit: Orbit, change: Change) -> Callable[[BranchPoint], float]:
    """Return the margin of a change as a function of a point of the branch near an orbit; nan if it is not found."""

    def function(point: BranchPoint) -> float:
        if change in point.memo:
            return point.memo[change]
        try:
            return margin(point.orbit, change, change.theta)[1]
        except LookupError:
            raise NumericalError("the motion has no phase of friction of the kind there") from None

    return function
