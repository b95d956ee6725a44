"""Events along a family of tori: folds, changes of stability and resonances, located between two of its points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from gapwalk.attractors.section import Strobe
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.walk_scales import Range
from gapwalk.continuation.zero_in_step import zero_in_step
from gapwalk.tori.closed_curve import at_phases, phases
from gapwalk.tori.locked_window import LockedWindow, locked_window
from gapwalk.tori.tone_clock import has_tone
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_doubling import Change, change_at
from gapwalk.tori.torus_ends import DENOMINATOR
from gapwalk.tori.torus_family import TorusEvent, TorusEventKind
from gapwalk.tori.torus_start import equation_of, torus_at

_BISECTIONS = 8  # of a step in which a contact begins to graze
_FINER, _MOST_PHASES = 8, 1025  # phases at which it is seen: times the samples, and at most
_NAMED, _SOUGHT = 60, 20  # the largest denominators that are named in a leap, and whose locked motions are looked for


def events_between(before: BranchPoint, after: BranchPoint, corrector: Corrector, within: Range) -> list[TorusEvent]:
    """Locate what happens in a step between two tori, in order along it.

    One normal exponent passes zero at a fold too; that is no event of its own.
    """
    first, last = torus_at(before), torus_at(after)
    found: list[tuple[float, TorusEvent]] = []
    located: list[Torus] = []

    def locate(kind: TorusEventKind, function: Callable[[BranchPoint], float]) -> TorusEvent:
        share, point, width = zero_in_step(before, after, corrector, function)
        width += torus_at(point).error * abs(point.value)
        event = TorusEvent(kind, point.value, width, torus_at(point).rotation, first.unstable, last.unstable)
        found.append((share, event))
        located.append(torus_at(point))
        return event

    turns = before.tangent[-1] * after.tangent[-1] < 0.0
    if turns:
        locate(TorusEventKind.FOLD, lambda point: float(point.tangent[-1]))
    changed = abs(first.unstable - last.unstable)
    if changed > int(turns):
        lost = max(first.unstable, last.unstable) - 1
        kind = TorusEventKind.CHANGE if changed == 1 else TorusEventKind.PAIR
        event = locate(kind, lambda point: float(torus_at(point).exponents[lost]))
        if changed == 1:
            share, _ = found[-1]
            found[-1] = share, _explained(event, located[-1])
    if first.grazes is not last.grazes:
        found.append(_graze(before, after, corrector))
    for ratio in _between(first.rotation, last.rotation):
        event = locate(TorusEventKind.RESONANCE, lambda point, ratio=ratio: torus_at(point).rotation - float(ratio))
        near = min((before, after), key=lambda point, ratio=ratio: abs(torus_at(point).rotation - ratio))
        share, _ = found[-1]
        found[-1] = share, replace(event, ratio=ratio, window=window_at(near, ratio, event.value, corrector, within))
    return [event for _, event in sorted(found, key=lambda each: each[0])]


def events_in_leap(before: BranchPoint, after: BranchPoint, corrector: Corrector, within: Range) -> list[TorusEvent]:
    """Return what happens between two tori on both sides of a leap, in which no other ones were found.

    Places are known to half of the leap, those of resonances better if their locked motions are found. If there is no
    fraction of a small denominator between both tori, the simplest one is reported.
    """
    first, last = torus_at(before), torus_at(after)
    middle, width = 0.5 * (before.value + after.value), 0.5 * abs(after.value - before.value)
    ratios = _between(first.rotation, last.rotation)
    if not ratios:
        ratios = [each for each in [simplest(*sorted((first.rotation, last.rotation)))] if each.denominator <= _NAMED]
    found: list[TorusEvent] = []
    for ratio in ratios:
        share = (float(ratio) - first.rotation) / (last.rotation - first.rotation)
        places = before.value + np.array([share, 0.5, 0.5 * share, 0.5 + 0.5 * share]) * (after.value - before.value)
        windows = (window_at(before, ratio, value, corrector, within) for value in places.tolist())
        window = next((each for each in windows if each is not None), None) if ratio.denominator <= _SOUGHT else None
        place, error = _interpolated(before, after, float(ratio), corrector)
        if window is not None:
            place, error = 0.5 * (window.low + window.high), 0.5 * window.width
        kind = TorusEventKind.RESONANCE
        found.append(TorusEvent(kind, place, error, float(ratio), first.unstable, last.unstable, ratio, window))
    changed, turns = abs(first.unstable - last.unstable), before.tangent[-1] * after.tangent[-1] < 0.0
    kinds = [TorusEventKind.FOLD] if turns else []
    if changed > int(turns):
        kinds.append(TorusEventKind.CHANGE if changed == 1 else TorusEventKind.PAIR)
    if first.grazes is not last.grazes:
        kinds.append(TorusEventKind.GRAZING)
    rotation = 0.5 * (first.rotation + last.rotation)
    return found + [TorusEvent(kind, middle, width, rotation, first.unstable, last.unstable) for kind in kinds]


def _interpolated(before: BranchPoint, after: BranchPoint, ratio: float, corrector: Corrector) -> tuple[float, float]:
    """Return the parameter at a rotation number in a leap, by the cubic with the slopes at both ends, and its error.

    The error is the distance from the straight line, but not more than the leap.
    """
    scales = corrector.scales[-2:]
    turns = torus_at(after).rotation - torus_at(before).rotation
    share, change = (ratio - torus_at(before).rotation) / turns, after.value - before.value
    straight = before.value + share * change
    slopes = [float(point.tangent[-1] * scales[1] / (point.tangent[-2] * scales[0])) for point in (before, after)]
    first, last = (slope * turns - change for slope in slopes)
    bent = share * (1.0 - share) * ((1.0 - share) * first - share * last)
    error = min(abs(bent), 0.5 * abs(change))
    return straight + float(np.clip(bent, -error, error)), error


def _explained(event: TorusEvent, torus: Torus) -> TorusEvent:
    """Return the event of one normal exponent with what happens there; a doubling keeps its torus."""
    change, _ = change_at(torus)
    if change is Change.DOUBLES:
        return replace(event, kind=TorusEventKind.DOUBLING, torus=torus, detail=change.value)
    return replace(event, detail=change.value)


def _graze(before: BranchPoint, after: BranchPoint, corrector: Corrector) -> tuple[float, TorusEvent]:
    """Locate where a contact begins or ceases to graze along the tori of a step, by bisection; with its share.

    It is seen at more phases than the samples. The share of phases at which the contact is passed grows like the root
    of the distance from the graze, so what these phases still miss is known, and counts as error.
    """
    first, last = torus_at(before), torus_at(after)
    low, high, middle = 0.0, 1.0, after
    clear, grazing = (after, before) if first.grazes else (before, after)
    passed = [_share_that_passes(torus_at(point)) for point in (clear, grazing)]
    kind = TorusEventKind.GRAZING
    if 0.0 < passed[0] < passed[1]:  # the samples of the end without it had missed it already
        off = (clear.value - grazing.value) * passed[0] ** 2 / (passed[1] ** 2 - passed[0] ** 2)
        turns = torus_at(clear).rotation
        return float(clear is after), TorusEvent(
            kind, clear.value + off, abs(off), turns, first.unstable, last.unstable
        )
    for _ in range(_BISECTIONS):
        share = 0.5 * (low + high)
        correction = corrector.correct(hermite(before, after, share), before.tangent)
        if correction is None:
            break
        length = share * (after.arclength - before.arclength)
        middle = corrector.point(correction, before.tangent, before.arclength + length)
        low, high = (share, high) if bool(_share_that_passes(torus_at(middle))) is first.grazes else (low, share)
    width = (high - low) * abs(after.value - before.value)
    missed = abs(grazing.value - middle.value) / max(1.0, _phases_of(torus_at(grazing)) * passed[1]) ** 2
    return high, TorusEvent(
        kind, middle.value, width + missed, torus_at(middle).rotation, first.unstable, last.unstable
    )


def _phases_of(torus: Torus) -> int:
    """Return the number of phases at which contact events are counted."""
    return max(torus.count, min(_FINER * torus.count, _MOST_PHASES))


def _share_that_passes(torus: Torus) -> float:
    """Return the share of phases from which the motion has another number of contact events than from most."""
    strobe = Strobe(torus.system)
    places = at_phases(torus.states, phases(_phases_of(torus)))
    counts = np.array([len(strobe.arc(state, torus.curves).contacts) for state in places])
    return float(np.mean(counts != np.bincount(counts).argmax()))


def window_at(
    point: BranchPoint, ratio: Fraction, value: float, corrector: Corrector, within: Range
) -> LockedWindow | None:
    """Return the locked motions at a value of the parameter, next to the torus of a point; None if none are found.

    Nothing locks to a second tone, whose rotation number is imposed.
    """
    if has_tone(torus_at(point).system):
        return None
    parameter = equation_of(corrector).parameter
    return locked_window(torus_at(point), ratio, parameter, value, (within.low, within.high))


def _between(first: float, last: float) -> list[Fraction]:
    """Return the fractions of small denominators between two rotation numbers, in the order in which they come."""
    low, high = sorted((first, last))
    found = {
        Fraction(part, whole)
        for whole in range(1, DENOMINATOR + 1)
        for part in range(int(np.ceil(low * whole)), int(np.floor(high * whole)) + 1)
        if low < part / whole < high
    }
    return sorted(found, reverse=last < first)


def simplest(low: float, high: float) -> Fraction:
    """Return the fraction of the smallest denominator between two numbers from 0 to 1, along the Stern-Brocot tree."""
    below, above = Fraction(0), Fraction(1)
    while True:
        found = Fraction(below.numerator + above.numerator, below.denominator + above.denominator)
        if found <= low:
            below = found
        elif found >= high:
            above = found
        else:
            return found
