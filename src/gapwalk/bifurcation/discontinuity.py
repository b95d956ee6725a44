"""Discontinuities at which a branch ends: just beyond them, the motion from almost the same state is another one.

Most changes of a motion are continuous along a branch, be they as steep as a square root. Some are not. Friction whose
static coefficient is larger than the kinetic one may be let go of, or not, where another contact stops. A spring with
friction by the stages of its contact loses part of its force at once where a stage opens, however briefly. A branch
ends there, since the orbit's equation jumps by a finite amount. Steps towards such a point become ever shorter.

The equation is evaluated along the tangent, which meets the discontinuity if it is near. It is located by bisection. A
finite jump is as large just beyond it as at a thousand times the distance, where a square root is thirty times as
large; and just before it there is nothing of it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.special_point import describe_switch
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.dry_state import SlipEvent
from gapwalk.flow.flow import PERIOD
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit

REACH = 1e-6
"""Arclength within which a discontinuity is sought, ahead of the last point of a branch."""

_PROBES = (1e-11, 1e-10, 1e-9, 1e-8, 1e-7, REACH)  # distances ahead at which the equation is evaluated
_JUMP = 1e-7  # residual, as a share of the state, that a smooth or a steep change does not have at these distances
_NEAR, _FAR = 1e-12, 1e-9  # distances beyond the discontinuity at which residuals are compared
_SAME = 0.5  # least share of the residual far beyond it that is there at once
_BEFORE = 1e-3  # largest share of it just before the discontinuity
_LOCATED = 1e-13  # distance to which it is located
_MOVED = 1e-3  # radians by which an event may move meanwhile
_ELSEWHERE = "the start of the period: begin it elsewhere, with another phase of the loads"
_AT_ONCE = 1e-7  # radians within which events count as one


class Discontinuity(NamedTuple):
    """Discontinuity ahead of a point of a branch."""

    value: float  #: Value of the parameter.
    words: str  #: Sentence part that says what changes, and by how much.


def discontinuity_ahead(corrector: Corrector, point: BranchPoint) -> Discontinuity | None:
    """Return the discontinuity just ahead of a point, at which its branch ends; None if there is none."""
    size = max(float(np.abs(point.x[:-1]).max()), np.finfo(float).tiny)

    def residual(distance: float) -> float:
        try:
            evaluation = corrector.evaluate(point.x + distance * point.tangent)
        except NumericalError:
            return np.inf
        return float(np.abs(evaluation.residual / corrector.scales[:-1]).max()) / size

    near, far = 0.0, next((each for each in _PROBES if residual(each) > _JUMP), 0.0)
    if not far:
        return None
    while far - near > _LOCATED:
        middle = 0.5 * (near + far)
        near, far = (near, middle) if residual(middle) > _JUMP else (middle, far)
    jump, beyond = residual(far + _NEAR), residual(far + _FAR)
    if not _JUMP < jump < np.inf or residual(near) > _BEFORE * jump or not _SAME * beyond <= jump <= beyond / _SAME:
        return None
    try:
        sides = [
            corrector.uncorrected(point.x + each * point.tangent, point.tangent, point.arclength)
            for each in (near, far + _NEAR)
        ]
    except NumericalError:
        return None
    words = f"{_difference(sides[0].orbit, sides[1].orbit)}; its state after a period jumps by {jump:.1g} of itself"
    return Discontinuity(sides[0].value, words)


def _difference(first: Orbit, last: Orbit) -> str:
    """Return the first event of a motion that another one, which begins in almost the same state, does not have."""
    ours, theirs = (sorted([*each.events, *each.slips], key=lambda event: event.theta) for each in (first, last))
    for own, other in zip(ours, theirs, strict=False):
        if _key(own) != _key(other) or abs(own.theta - other.theta) > _MOVED:
            theta = min(own.theta, other.theta)
            together = [event for event in (*ours, *theirs) if abs(event.theta - theta) <= _AT_ONCE]
            names = sorted({_name(first, event) for event in together})
            words = f"beyond it, {', '.join(names)} behave{'' if names[1:] else 's'} otherwise at theta = {theta:.6g}"
            return f"{words}, {_ELSEWHERE}" if theta < _AT_ONCE else words
    more = max(ours[len(theirs) :], theirs[len(ours) :], key=len)
    if more and PERIOD * first.period - more[0].theta < _MOVED:
        return f"beyond it, {_name(first, more[0])} behaves otherwise at {_ELSEWHERE}"
    if more:
        return f"beyond it, {_name(first, more[0])} behaves otherwise at theta = {more[0].theta:.6g}"
    return "beyond it, its last events are others"


def coincidence(orbit: Orbit) -> str:
    """Return a sentence part on two events of different contacts or friction that coincide; empty if none do.

    Friction elements of one deflection stick together wherever it turns round.
    """
    events = sorted([*orbit.events, *(each for each in orbit.slips if each.theta)], key=lambda event: event.theta)
    for first, last in pairwise(events):
        names = _name(orbit, first), _name(orbit, last)
        if last.theta - first.theta <= _AT_ONCE and names[0] != names[1] and not _move_as_one(orbit, first, last):
            advice = "beyond, the second may come first, and the motion is another one: start there"
            return f"{names[0]} and {names[1]} change at once at theta = {first.theta:.6g}, and {advice}"
    return ""


def _move_as_one(orbit: Orbit, first: ContactEvent | SlipEvent, last: ContactEvent | SlipEvent) -> bool:
    if not (isinstance(first, SlipEvent) and isinstance(last, SlipEvent)):
        return False
    layout, coefficients = layout_of(orbit.system.structure), coefficients_of(orbit.system)
    vectors = [coefficients[layout.contacts[each.contact].deflection] for each in (first, last)]
    return np.array_equal(vectors[0], vectors[1])


def _key(event: ContactEvent | SlipEvent) -> tuple[int, int, int]:
    if isinstance(event, ContactEvent):
        return 0, event.switch, int(event.enters)
    return 1, event.contact, event.slip


def _name(orbit: Orbit, event: ContactEvent | SlipEvent) -> str:
    if isinstance(event, ContactEvent):
        return describe_switch(orbit, event.switch)
    return orbit.system.structure.contacts[event.contact].name
