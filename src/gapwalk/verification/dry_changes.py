"""Comparison of the stored events of an orbit with friction or rigid stops with those that verification finds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from gapwalk.orbit.orbit import Orbit

_PERIOD = 2.0 * math.pi
_SOFTEST = 3e-5  # speed of an impact over that of the motion whose depth, its square, is within the bound of closure
_TOGETHER = 1e-3  # radians within which two records of an impact may be one


class Change(NamedTuple):
    """An event: ``"contact"`` with the number of a switch, or ``"slip"`` with that of a contact; the mode after it.

    `slope` is the derivative of its guard over the angle, as a share of the size of the motion.
    """

    kind: str
    number: int
    mode: int
    theta: float
    slope: float


def mismatch(orbit: Orbit, changes: Sequence[Change]) -> float:
    """Compare the stored events of an orbit with those that were found, and return the largest difference.

    Where modes differ over some angle, it is that angle times the slope of the guard: about how far the motion is then
    on the wrong side. Impacts are compared one by one, but for the last ones of those that end in a held contact.
    """
    rigid = {switch for _, switch in orbit.system.structure.reactions if switch >= 0}
    end = _PERIOD * orbit.period
    stored = [Change("contact", each.switch, int(each.enters), each.theta, 1.0) for each in orbit.events]
    stored += [Change("slip", each.contact, each.slip, each.theta, 1.0) for each in orbit.slips]
    worst = 0.0
    for key in sorted({(each.kind, each.number) for each in (*stored, *changes)}):
        theirs, ours = ([each for each in those if (each.kind, each.number) == key] for those in (stored, changes))
        if key[0] == "contact" and key[1] in rigid:
            worst = max(worst, _of_impacts(theirs, ours, end))
        else:
            if key[0] == "contact":  # the mode at the start follows from the first event
                begun = 1 - theirs[0].mode if theirs else ours[0].mode
                theirs = [Change(*key, begun, 0.0, 1.0), *theirs]
            worst = max(worst, _of_modes(theirs, ours, end))
    return worst


def _of_modes(theirs: Sequence[Change], ours: Sequence[Change], end: float) -> float:
    """Return the longest angle over which modes differ, times the steepest slope of a guard at its ends.

    Where only the stored motion has a phase, its guard is zero at both ends: its slope is of the order of that angle.
    Where only the other one has it, the stored motion is on the wrong side of the guard at which it begins. The guard
    at which it ends belongs to the phase: a force that just exceeds its bound may be followed by a steep slip rate.
    """
    if not theirs or not ours:
        return math.inf
    every = [(each.theta, 0, each) for each in theirs] + [(each.theta, 1, each) for each in ours]
    every.sort(key=lambda each: each[:2])  # events of one motion at the same angle stay in their order
    modes, worst, within = [theirs[0].mode, ours[0].mode], 0.0, list[tuple[float, int, Change]]()
    for event in every:
        theta, side, each = event
        modes[side] = each.mode
        within = [*within, event] if within or modes[0] != modes[1] else []
        if within and modes[0] == modes[1]:
            slopes = [abs(other.slope) for _, side, other in within if side]
            slope = slopes[0] if len(slopes) == len(within) else max(slopes, default=0.0)
            length = theta - within[0][0]
            worst, within = max(worst, length * (slope or length)), []
    return max(worst, end - within[0][0]) if within else worst


def _of_impacts(theirs: Sequence[Change], ours: Sequence[Change], end: float) -> float:
    worst, left = 0.0, list(theirs)
    angles = [each.theta for each in (*theirs, *ours)]
    alone = []
    for each in ours:
        near = [other for other in left if other.mode == each.mode and _apart(other, each, end) < _TOGETHER]
        if near:
            match = min(near, key=lambda other, each=each: _apart(other, each, end))
            left.remove(match)
            worst = max(worst, abs(each.slope) * _apart(match, each, end))
        else:
            alone.append(each)
    for each in (*alone, *left):
        others = sorted(abs(each.theta - angle) for angle in angles)[1:]  # without itself
        if abs(each.slope) < _SOFTEST:  # the motion misses it by so little that errors of integration decide
            worst = max(worst, each.slope**2)
        elif not others or others[0] > _TOGETHER:
            return math.inf
    return worst


def _apart(a: Change, b: Change, end: float) -> float:
    return min(abs(a.theta - b.theta), end - abs(a.theta - b.theta))
