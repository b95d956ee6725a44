"""Tracer of a family of tori in one direction, with resolution by need, events, and reasons for its end."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import Strobe
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, Range, ahead, check_range, hermite, length_of, zero_in_step
from gapwalk.continuation.curve import joined
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, Tracing, Walk, WalkOptions, WalkState
from gapwalk.errors import GapwalkError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.orbit.orbit_equation import solve
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.tori.tongue import LockedWindow, locked_window
from gapwalk.tori.torus import TURN, Torus, at_phases, has_tone, odd, phases, relative_size, resampled, tail, tangents
from gapwalk.tori.torus_equation import TorusOptions
from gapwalk.tori.torus_family import TorusEnd, TorusEndReason, TorusEvent, TorusEventKind, TorusFamily, TorusPoint
from gapwalk.tori.torus_start import (
    Change,
    Second,
    TorusStart,
    change_at,
    corrector_of,
    equation_of,
    record_at,
    start_beyond,
    starts_at,
    torus_at,
)

# Ends of families of tori: they shrink to an orbit, lose their smoothness, or lock to a periodic motion.

DENOMINATOR = 12
"""The largest denominator of resonances that are named, and whose locked motions are looked for."""

_RESONANT = 0.02  # distance of a rotation number from p/q, times q, within which the resonance is named
_SMALL = 1e-3  # size of a torus, over that of the motion, at which a failing walk has perhaps reached its orbit
_SMALLEST = 1e-8  # such a size below which a torus cannot be distinguished from its orbit
_INVERTED = -0.5  # cosine between successive curves below which the second one is the first, inverted
# distances within which the Neimark-Sacker point is looked for, in steps of the family: beyond the point its curves
# are the same, inverted, so that a step over it may change the parameter little
_BEYOND = (4.0, 40.0, 400.0)


def end_at(
    point: BranchPoint, reason: TorusEndReason, detail: str = "", window: LockedWindow | None = None
) -> TorusEnd:
    """Return the end of a family at one of its points."""
    return TorusEnd(reason, point.value, torus_at(point).rotation, detail, window)


def has_shrunk(before: BranchPoint, after: BranchPoint) -> bool:
    """Return True if a step has passed the orbit to which tori shrink: the curve beyond is the one before, inverted."""
    first, last = (_deviations(torus_at(point)) for point in (before, after))
    if first.shape != last.shape:
        return False
    return bool((first * last).sum() < _INVERTED * np.linalg.norm(first) * np.linalg.norm(last))


def shrunk(before: BranchPoint, after: BranchPoint, parameter: str) -> TorusEnd:
    """Return the end of a family that has shrunk to an orbit between two of its points, with that point if it is found.

    The orbit is found by Newton's method from the mean of the last curve, and followed to its Neimark-Sacker point.
    """
    torus = torus_at(before)
    point = _neimark_sacker(before, after, parameter)
    if point is None:
        return end_at(before, TorusEndReason.SHRINKS, f"its size was {torus.size:.2g}")
    return TorusEnd(TorusEndReason.SHRINKS, point.value, _turns(point, torus))


def halved(last: BranchPoint, corrector: Corrector) -> BranchPoint | None:
    """Return the torus of half the size of a small one, if the family shrinks from there on; None if it does not."""
    # The orbit in the middle solves the equation of its tori too, with any rotation number. So the Jacobian along a
    # family is the nearer to a singular one the smaller the tori are, and steps fail. Across, it stays regular: the
    # size is given, in the plane perpendicular to the deviations from the mean, and all others are unknown.
    normal, size = _outwards(last, corrector), relative_size(torus_at(last))
    if not _SMALLEST < size < _SMALL or last.tangent @ normal >= 0.0:
        return None
    found = corrector.correct(last.x - 0.5 * float(normal @ last.x) * normal, normal)
    if found is not None and not found.iterations:  # the tangent would be that of the guess
        found = corrector.correct(found.x, normal)
    if found is None:
        return None
    try:
        return corrector.point(found, -normal, last.arclength + length_of(found.x - last.x))
    except NumericalError:
        return None


def vanished(before: BranchPoint, after: BranchPoint, parameter: str) -> TorusEnd | None:
    """Return the end of a family whose last torus has half the size of the one before; None if it does not end there.

    Parameter and rotation number change in proportion to the size, or to a higher power of it. So what is left of the
    way to the Neimark-Sacker point is no more than the last change.
    """
    born = _neimark_sacker(after, before, parameter)
    if born is None:
        return None
    torus = torus_at(after)
    end = TorusEnd(TorusEndReason.SHRINKS, born.value, _turns(born, torus))
    ways = (end.value, after.value, before.value), (end.rotation, torus.rotation, torus_at(before).rotation)
    return end if all(abs(last - there) <= abs(last - first) for there, last, first in ways) else None


def _outwards(point: BranchPoint, corrector: Corrector) -> NDArray[np.float64]:
    """Return the direction in which a torus grows, as a unit vector of the scaled unknowns and the parameter."""
    states = torus_at(point).states
    away = np.append((states - states.mean(axis=0)).ravel(), (0.0, 0.0)) / corrector.scales
    return away / length_of(away)


def _turns(point: SpecialPoint, torus: Torus) -> float:
    """Return the rotation number of a Neimark-Sacker point, in the direction of the phase of a torus beside it."""
    turns = abs(float(np.angle(point.multiplier))) / TURN
    return turns if abs(turns - torus.rotation) < abs(1.0 - turns - torus.rotation) else 1.0 - turns


def _neimark_sacker(before: BranchPoint, after: BranchPoint, parameter: str) -> SpecialPoint | None:
    torus = torus_at(before)
    equation = ShootingEquation(torus.system, None, torus.curves)
    reach = max(abs(after.value - before.value), 1e-6 * abs(before.value))
    for longer in _BEYOND:
        try:
            orbit = equation.orbit(*_solved(equation, torus.states.mean(axis=0)))
            branch = follow(orbit, parameter, (before.value - longer * reach, before.value + longer * reach))
        except GapwalkError:
            return None
        found = branch.special(Kind.NEIMARK_SACKER)
        if found:
            return min(found, key=lambda each: abs(each.value - before.value))
    return None


def _solved(equation: ShootingEquation, start: NDArray[np.float64]):
    unknowns, evaluation = solve(equation, start, 0.0)
    return unknowns, 0.0, evaluation


def rough(last: BranchPoint, beyond: Torus, passed: Fraction | None) -> TorusEnd:
    """Return the end of a family whose tori need more samples than allowed, with the evidence."""
    torus = torus_at(last)
    why = f"the error is {beyond.error:.1g}{_roughness(beyond)}"
    near = resonance_near(torus.rotation) or passed
    if near is not None:
        why += f"; the rotation number is near {near}"
    return end_at(last, TorusEndReason.ROUGH, why)


def resonance_near(turns: float) -> Fraction | None:
    """Return the fraction of a small denominator next to a rotation number; None if there is none."""
    near = Fraction(turns).limit_denominator(DENOMINATOR)
    return near if abs(turns - near) < _RESONANT / near.denominator else None


def locked(last: BranchPoint, ratio: Fraction, window: LockedWindow | None) -> TorusEnd:
    """Return the end of a family whose motion locks to a fraction, with the motions that were found there."""
    torus = torus_at(last)
    words = f"the rotation number approaches {ratio}" + ("" if window is None else f"; {window.words}")
    words += _roughness(torus) if torus.grazes else ""
    return end_at(last, TorusEndReason.RESONANCE, words, window)


def _roughness(torus: Torus) -> str:
    """Return a clause with the tail of the series of a torus, and a contact that grazes along it."""
    words = f"; the tail of the series is {torus.tail:.1g} with {torus.count} samples"
    if torus.grazes:
        words += f"; a contact grazes along the torus ({torus.touches[0]} to {torus.touches[1]} contact events)"
    return words


def _deviations(torus: Torus) -> NDArray[np.float64]:
    return (torus.states - torus.states.mean(axis=0)) / torus.system.state_scales()


# Events along a family of tori: folds, changes of stability and resonances, located between two of its points.

_BISECTIONS = 8  # of a step in which a contact begins to graze
_FINER, _MOST_PHASES = 8, 1025  # phases at which it is seen: times the samples, and at most
_NAMED, _SOUGHT = 60, 20  # the largest denominators that are named in a leap, and whose locked motions are looked for


def events_between(before: BranchPoint, after: BranchPoint, corrector: Corrector, within: Range) -> list[TorusEvent]:
    """Locate what happens in a step between two tori, in order along it."""
    # One normal exponent passes zero at a fold too; that is no event of its own.
    first, last = torus_at(before), torus_at(after)
    found: list[tuple[float, TorusEvent]] = []

    def locate(kind: TorusEventKind, function: Callable[[BranchPoint], float]) -> tuple[float, TorusEvent, Torus]:
        share, point, width = zero_in_step(before, after, corrector, function)
        torus = torus_at(point)
        width += torus.error * abs(point.value)
        return share, _event(kind, point.value, width, torus.rotation, first, last), torus

    lost = max(first.unstable, last.unstable) - 1
    for kind in _changes(before, after):
        if kind is TorusEventKind.GRAZING:
            found.append(_graze(before, after, corrector))
        elif kind is TorusEventKind.FOLD:
            found.append(locate(kind, lambda point: float(point.tangent[-1]))[:2])
        else:
            share, event, torus = locate(kind, lambda point: float(torus_at(point).exponents[lost]))
            found.append((share, _explained(event, torus) if kind is TorusEventKind.CHANGE else event))
    for ratio in _between(first.rotation, last.rotation):
        share, event, _ = locate(
            TorusEventKind.RESONANCE, lambda point, ratio=ratio: torus_at(point).rotation - float(ratio)
        )
        near = min((before, after), key=lambda point, ratio=ratio: abs(torus_at(point).rotation - ratio))
        window = window_at(near, ratio, event.value, corrector, within)
        found.append((share, replace(event, ratio=ratio, window=window)))
    return [event for _, event in sorted(found, key=lambda each: each[0])]


def _event(
    kind: TorusEventKind, value: float, width: float, rotation: float, before: Torus, after: Torus, *more: Any
) -> TorusEvent:
    return TorusEvent(kind, value, width, rotation, before.unstable, after.unstable, *more)


def _changes(before: BranchPoint, after: BranchPoint) -> Iterator[TorusEventKind]:
    """Yield what differs between two tori of a family, other than their rotation numbers."""
    first, last, turns = torus_at(before), torus_at(after), before.tangent[-1] * after.tangent[-1] < 0.0
    changed = abs(first.unstable - last.unstable)
    if turns:
        yield TorusEventKind.FOLD
    if changed > int(turns):
        yield TorusEventKind.CHANGE if changed == 1 else TorusEventKind.PAIR
    if first.grazes is not last.grazes:
        yield TorusEventKind.GRAZING


def events_in_leap(before: BranchPoint, after: BranchPoint, corrector: Corrector, within: Range) -> list[TorusEvent]:
    """Return what happens between two tori on both sides of a leap, in which no other ones were found."""
    # Places are known to half of the leap, those of resonances better if their locked motions are found. If there is no
    # fraction of a small denominator between both tori, the simplest one is reported.
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
        found.append(_event(TorusEventKind.RESONANCE, place, error, float(ratio), first, last, ratio, window))
    rotation = 0.5 * (first.rotation + last.rotation)
    return found + [_event(kind, middle, width, rotation, first, last) for kind in _changes(before, after)]


def _interpolated(before: BranchPoint, after: BranchPoint, ratio: float, corrector: Corrector) -> tuple[float, float]:
    """Return the parameter at a rotation number in a leap, by the cubic with the slopes at both ends, and its error."""
    # The error is the distance from the straight line, but not more than the leap.
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
    """Locate where a contact begins or ceases to graze along the tori of a step, by bisection; with its share."""
    # It is seen at more phases than the samples. The share of phases at which the contact is passed grows like the root
    # of the distance from the graze, so what these phases still miss is known, and counts as error.
    first, last = torus_at(before), torus_at(after)
    low, high, middle = 0.0, 1.0, after
    clear, grazing = (after, before) if first.grazes else (before, after)
    passed = [_share_that_passes(torus_at(point)) for point in (clear, grazing)]
    kind = TorusEventKind.GRAZING
    if 0.0 < passed[0] < passed[1]:  # the samples of the end without it had missed it already
        off = (clear.value - grazing.value) * passed[0] ** 2 / (passed[1] ** 2 - passed[0] ** 2)
        turns = torus_at(clear).rotation
        return float(clear is after), _event(kind, clear.value + off, abs(off), turns, first, last)
    for _ in range(_BISECTIONS):
        share = 0.5 * (low + high)
        length = share * (after.arclength - before.arclength)
        found = corrector.point_near(hermite(before, after, share), before.tangent, before.arclength + length)
        if found is None:
            break
        middle = found
        low, high = (share, high) if bool(_share_that_passes(torus_at(middle))) is first.grazes else (low, share)
    width = (high - low) * abs(after.value - before.value)
    missed = abs(grazing.value - middle.value) / max(1.0, _phases_of(torus_at(grazing)) * passed[1]) ** 2
    return high, _event(kind, middle.value, width + missed, torus_at(middle).rotation, first, last)


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
    """Return the locked motions at a value of the parameter, next to the torus of a point; None if none are found."""
    # Nothing locks to a second tone, whose rotation number is imposed.
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


# Steps of a family of tori past resonances: where the next torus should be, and leaps over windows in which none is.
#
# Near a resonance p/q curves are distorted, and need the more samples the nearer it is; in a window around it there is
# no torus at all. So the length of each step is varied a little, such that its rotation number is far from fractions.
# Where steps become short, or the samples are no longer enough, the family is continued by leaps: each to a torus of a
# given rotation number, with the parameter free. For numbers that are far from all fractions tori exist on both sides
# of a window, and depend on the number as if there were none (smooth in the sense of Whitney, as KAM theory has it).

NEXT = (1.3, 0.8, 2.0, 3.0, 0.4)
"""Lengths of leaps, over that of the last one, that are tried while leaps succeed."""
FEW = (1.5, 2.0, 3.0, 4.0)
"""Lengths, over that of a good step, that are tried as soon as steps become short."""
MANY = (*FEW, 6.0, 8.0, 12.0, 16.0)
"""Lengths that are tried before a family ends."""

_REMEMBERED = 32  # steps among which a good one is looked for, before the walk crept into a resonance
_GOOD = 0.5  # change of the rotation number in a good step, as a share of the largest of them
_SHARES = np.linspace(1.0, 0.7, 25)  # of a step, among which the rotation number is chosen
_AROUND = np.linspace(0.8, 1.25, 31)  # of a leap, among which the rotation number is chosen
_DENOMINATORS = np.arange(1.0, 101.0)  # of the fractions that it avoids
_ALONG = 0.5  # change of the rotation number along a tangent, over that along a good step, below which it is distorted
_FARTHER = 3.0  # the longest leap over a resonance that has stopped a walk, over the longest step
_SHRUNK = 0.3  # size of a torus, over that before a leap, below which it may be no torus
_ROUGHER = 10.0  # error of a torus along which a contact grazes, over that before a leap, above which it is too rough
_FAR = 2.0  # distance of a torus from where a leap expects it, over the length of the leap, at which it is another one


class Stride(NamedTuple):
    """An accepted step, with the corrector of its end."""

    corrector: Corrector
    start: BranchPoint
    end: BranchPoint
    length: float

    @property
    def turned(self) -> float:
        """Change of the rotation number."""
        return torus_at(self.end).rotation - torus_at(self.start).rotation

    def along(self, corrector: Corrector) -> NDArray[np.float64]:
        """Return the change of all unknowns, as a vector of another corrector."""
        count = equation_of(corrector).count
        ends = [
            np.append(resampled(torus_at(point).states, count), (torus_at(point).rotation, point.value))
            for point in (self.start, self.end)
        ]
        return (ends[1] - ends[0]) / corrector.scales


class Strides:
    """The last steps of a walk."""

    def __init__(self, within: Range, options: TorusOptions, longest: float) -> None:
        self.within, self.options, self.longest = within, options, longest
        self._last: deque[Stride] = deque(maxlen=_REMEMBERED)

    def add(self, stride: Stride) -> None:
        """Add an accepted step."""
        self._last.append(stride)

    def restart(self, stride: Stride) -> None:
        """Forget all steps but one, which others are compared with."""
        self._last.clear()
        self._last.append(stride)

    @property
    def good(self) -> Stride | None:
        """The last step in which the rotation number changed much, before the walk crept into a resonance."""
        most = max((abs(stride.turned) for stride in self._last), default=0.0)
        return next((each for each in reversed(self._last) if abs(each.turned) >= _GOOD * most), None)

    def leap(self, last: BranchPoint, count: int, lengths: tuple[float, ...]) -> Stride | None:
        """Return a step from the last good one to the other side of a resonance; None if no torus is found there."""
        good = self.good
        if good is None or good.turned == 0.0:
            return None
        posed: tuple[Corrector, BranchPoint] | None = (good.corrector, good.end)
        if equation_of(good.corrector).count < count:
            posed = posed_with(good.corrector, good.end, count, self.within)
        return None if posed is None else self.leap_from(*posed, good, last, lengths)

    def leap_from(
        self, corrector: Corrector, point: BranchPoint, good: Stride, last: BranchPoint, lengths: tuple[float, ...]
    ) -> Stride | None:
        """Return a leap from a point, in the direction of a good step; see `leap`."""
        begun, passed = torus_at(point).rotation, torus_at(last).rotation
        for longer in lengths:
            turns = begun + good.turned * longer * _AROUND
            turns = turns[(turns - passed) * good.turned > 0.0]
            if not len(turns):
                continue
            aim = float(turns[int(np.argmin(nearness_to_fractions(turns)))])
            landed = self._landed(corrector, point, good, aim, self.longest * (1.0 if lengths is NEXT else _FARTHER))
            if landed is not None and landed[1].value not in self.within:
                return None
            if landed is not None:
                # the arclength of the family does not go back to the good step
                start = replace(point, arclength=max(last.arclength, point.arclength))
                leap = Stride(landed[0], start, landed[1], good.length)
                length = float(np.linalg.norm(leap.along(landed[0])))
                return leap._replace(end=replace(landed[1], arclength=start.arclength + length))
        return None

    def _landed(
        self, corrector: Corrector, point: BranchPoint, good: Stride, aim: float, longest: float
    ) -> tuple[Corrector, BranchPoint] | None:
        """Return the torus of a rotation number next to a point, with its corrector; None if there is none."""
        # It is looked for along the tangent, and along the good step: next to a resonance the tangent leads along it,
        # and where a contact grazes it is less certain than the direction between two tori.
        scale = float(corrector.scales[-2])
        change = (aim - torus_at(point).rotation) / scale
        normal = np.zeros(len(point.x))
        normal[-2] = 1.0
        step = good.along(corrector)
        distorted = abs(point.tangent[-2] * scale) * good.length < _ALONG * abs(good.turned)
        for along in (step,) if distorted else (point.tangent, step):
            guess = point.x + along * (change / along[-2])
            length = length_of(guess - point.x)
            found = corrector.correct(guess, normal) if length <= longest else None
            if found is not None and length_of(found.x - guess) <= _FAR * length:
                break
        else:
            return None
        try:
            landed = corrector.point(found, normal * np.sign(good.turned), point.arclength)
        except NumericalError:
            return None
        torus, before = torus_at(landed), torus_at(point)
        if torus.size < _SHRUNK * before.size or has_shrunk(point, landed):
            return None  # the orbit to which the tori shrink solves the equation with any rotation number
        if self._is_fine(torus, before):
            return corrector, landed
        finer = self.options.finer(torus.count)
        if finer is None or not torus.is_resolved:
            return None
        posed = posed_with(corrector, landed, finer, self.within)
        return posed if posed is not None and self._is_fine(torus_at(posed[1]), before) else None

    def _is_fine(self, torus: Torus, before: Torus) -> bool:
        """Return True if a leap may end at a torus: with the most samples, if it is nearly as accurate as required."""
        # If it is not, it is next to another resonance. Where a contact grazes along tori, their errors are larger;
        # then it must not be much less accurate than the one before.
        accuracy = self.options.accuracy
        if torus.grazes:
            return self.options.accepts(torus) and torus.error <= _ROUGHER * max(accuracy, before.error)
        return self.options.accepts(torus) and torus.error**2 <= accuracy * max(accuracy, self.options.tolerated)


def far_from_fractions(
    step: float, earlier: BranchPoint | None, previous: BranchPoint | None, point: BranchPoint, corrector: Corrector
) -> float:
    """Return a step that is not longer, and not much shorter, whose rotation number is far from fractions."""
    # Near fractions p/q with a small q curves need more samples, and the sum of ``1 / (q^2 |rho - p/q|)`` is large.
    scale = float(corrector.scales[-2])
    turns = np.array([ahead(earlier, previous, point, share * step)[0][-2] for share in _SHARES]) * scale
    return step * float(_SHARES[int(np.argmin(nearness_to_fractions(turns)))])


def nearness_to_fractions(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of ``1 / (q |q rho - p|)`` over small denominators q, for each rotation number."""
    parts = turns[:, None] * _DENOMINATORS
    away = np.maximum(np.abs(parts - np.rint(parts)), np.finfo(float).eps)
    return (1.0 / (_DENOMINATORS * away)).sum(axis=1)


def posed_with(
    corrector: Corrector, point: BranchPoint, count: int, within: Range
) -> tuple[Corrector, BranchPoint] | None:
    """Pose the equation again at a point, with its curve as reference and a number of samples; None if Newton fails."""
    torus = torus_at(point)
    curve = resampled(torus.states, count)
    equation = replace(equation_of(corrector), reference=curve)
    posed = corrector_of(equation, curve, 1e-3 * torus.size, within)
    unscaled, unscaled_point = point.tangent * corrector.scales, point.x * corrector.scales
    along = resampled(unscaled[:-2].reshape(torus.count, -1), count).ravel()
    tangent = np.append(along, unscaled[-2:]) / posed.scales
    tangent /= np.linalg.norm(tangent)
    x = np.append(curve.ravel(), unscaled_point[-2:]) / posed.scales
    try:
        lifted = posed.point_near(x, tangent, point.arclength)
    except NumericalError:
        return None
    return None if lifted is None else (posed, lifted)


_MUCH = 1e-2  # share of the accuracy below which a torus has more samples than it needs
_TAIL = 0.1  # tail of its series, over the accuracy, with which it has enough: the error is some 100 times smaller
_GROWN = 5.0  # growth of a curve beyond which its reference is another
_STILL = 1e-7  # change of the parameter in a step, over the largest so far, that counts as none
_ALIGNED = 0.5  # cosine between the tangents of a curve and of its reference below which the phase is fixed again
_SHORTEST = 1e-3  # step, as a share of the longest, to which the end of smoothness is located
_SHORT = 0.3  # step, over a good one, at which a leap over a resonance is tried
_SHORTER = 0.2  # factor on the step after which it is tried again
_AHEAD = (0.1, 0.3, 1.0, 3.0)  # places ahead at which locked motions are looked for, in good steps
Step = tuple[TorusPoint, list[TorusEvent]]


class TorusTracer(Iterator[Step]):
    """Iterator over the tori of a family in one direction."""

    def __init__(self, beginning: TorusStart, walk: WalkOptions, options: TorusOptions) -> None:
        fine, first = beginning.fineness, walk.first_step
        walk = replace(walk, initial_step=fine * first, smallest_step=fine * walk.smallest_step) if fine < 1.0 else walk
        self.beginning, self.options, self.steps = beginning, options, walk
        self.corrector, self._moved = beginning.corrector, 0.0
        self._strides = Strides(beginning.within, options, walk.largest_step)
        self._leaping: Stride | None = None  # the step that leaps continue, as long as they succeed
        self._halving = False  # True if the last step has halved the size of the torus, where others fail
        self._untried = np.inf  # step below which a leap has not been tried since the last good step
        self.first, self.end = record_at(beginning.first), None
        self.walk = self._walk_from(WalkState(None, beginning.first, walk.first_step, 0))
        self._pose_again(self.walk.state, beginning.first)

    @property
    def is_closed(self) -> bool:
        """True if the family has closed on itself."""
        return self.end is not None and self.end.reason is TorusEndReason.CLOSED

    def stopped(self, last: TorusPoint) -> TorusEnd:
        """Return the end; that it was stopped at the last torus if it has none yet."""
        return self.end or TorusEnd(TorusEndReason.STOPPED, last.value, last.torus.rotation)

    def __next__(self) -> Step:
        while True:
            if self.end is not None:
                raise StopIteration
            state = self.walk.state
            leapt = self._leap_on(state.point) if self._leaping is not None else None
            if leapt is None and self._halving:
                leapt = self._halve(state.point)
            if leapt is None and self._is_short(state):
                leapt = self._pass(state, FEW)
            if leapt is not None:
                return leapt
            self._place_step(state)
            try:
                point = next(self.walk)
            except StopIteration:
                leapt = self._ended(state)
                if leapt is None:
                    raise
                return leapt
            torus = torus_at(point)
            if has_shrunk(state.point, point):
                self.end = shrunk(state.point, point, equation_of(self.corrector).parameter)
            elif (past := self._past_second(state.point, point)) is not None:
                self.end = past
            elif (ratio := self._creeps_to(state.point, point)) is not None:
                leapt = self._lock(state.point, ratio, self._window(state.point, ratio))
                if leapt is not None:
                    return leapt
            elif not self.options.accepts(torus):
                leapt = self._refine(state, point)
                if leapt is not None:
                    return leapt
            else:
                break
        if self.end is not None:
            raise StopIteration
        self._strides.add(Stride(self.corrector, state.point, point, point.arclength - state.point.arclength))
        events = events_between(state.point, point, self.corrector, self.beginning.within)
        self._pose_again(self.walk.state, point)
        return record_at(point), events

    def _walk_from(self, state: WalkState) -> Walk:
        return Walk(state.point, self.beginning.within, self.corrector, self.steps, state, trust=0.0, branched=True)

    def _place_step(self, state: WalkState) -> None:
        """Vary the next step a little, so that its torus is not next to a resonance."""
        if self.beginning.second is None:
            self.walk.step = far_from_fractions(state.step, state.earlier, state.previous, state.point, self.corrector)

    def _is_short(self, state: WalkState) -> bool:
        """Return True if steps have become short, or much shorter since a leap was tried."""
        good = self._strides.good
        if good is None or state.step >= _SHORT * good.length:
            self._untried = np.inf
            return False
        return state.step < self._untried

    def _pose_again(self, state: WalkState, point: BranchPoint) -> None:
        """Pose the equation again if the curve has moved far from its reference, or has more samples than it needs."""
        torus = torus_at(point)
        if torus.error < _MUCH * self.options.accuracy and torus.count > self.options.samples:
            fewer = self._enough(torus)
            if fewer < torus.count:
                self._pose(point, fewer, state)
                return
        equation = equation_of(self.corrector)
        unit = equation.system.state_scales()
        old, new = tangents(equation.reference / unit).ravel(), tangents(torus.states / unit).ravel()
        cosine = float(old @ new) / float(np.linalg.norm(old) * np.linalg.norm(new))
        grown = float(np.linalg.norm(new) / np.linalg.norm(old))
        if cosine < _ALIGNED or not 1.0 / _GROWN < grown < _GROWN:
            self._pose(point, torus.count, state)

    def _enough(self, torus: Torus) -> int:
        """Return the number of samples, two thirds of the present ones or fewer, with which a curve is accurate."""
        unit, count = torus.system.state_scales(), torus.count
        while True:
            fewer = max(odd(2 * count // 3), odd(self.options.samples - 1))
            if fewer >= count or tail(resampled(torus.states, fewer) / unit) > _TAIL * self.options.accuracy:
                return count
            count = fewer

    def _pose(self, point: BranchPoint, count: int, state: WalkState) -> bool:
        """Pose the equation with another number of samples, or reference, and continue at a point; return if it did."""
        posed = posed_with(self.corrector, point, count, self.beginning.within)
        if posed is None:
            return False
        self.corrector, lifted = posed
        self.walk = self._walk_from(WalkState(None, lifted, state.step, state.count))
        return True

    def _past_second(self, last: BranchPoint, beyond: BranchPoint) -> TorusEnd | None:
        """Return the end of a family whose second parameter has left its range; None if it has not."""
        second = self.beginning.second
        if second is None or torus_at(beyond).system[second.name] in second.within:
            return None
        words = f"{second.name} = {torus_at(last).system[second.name]:.8g} is near the end of its range"
        return end_at(last, TorusEndReason.RANGE, words)

    def _near_resonance(self, torus: Torus) -> Fraction | None:
        """Return the resonance next to a torus; None if there is none, or the rotation number is kept."""
        return resonance_near(torus.rotation) if self.beginning.second is None else None

    def _resonance_ahead(self, torus: Torus) -> Fraction | None:
        """Return the strongest resonance that a few good steps would pass; None if there is none."""
        good = self._strides.good
        if good is None or good.turned == 0.0 or self.beginning.second is not None:
            return None
        return simplest(*sorted((torus.rotation, torus.rotation + FEW[-1] * good.turned)))

    def _creeps_to(self, before: BranchPoint, after: BranchPoint) -> Fraction | None:
        """Return the fraction that the rotation number approaches while the parameter stands still; None otherwise."""
        moved = abs(after.value - before.value)
        if moved > _STILL * self._moved:
            self._moved = max(self._moved, moved)
            return None
        first, last = torus_at(before).rotation, torus_at(after).rotation
        near = self._near_resonance(torus_at(after))
        return near if near is not None and abs(last - near) < abs(first - near) else None

    def _refine(self, state: WalkState, rejected: BranchPoint) -> Step | None:
        """Return to a state with more samples, or with a shorter step if they are the most."""
        # A resonance may be in the way: leap over it and return the step, or end if nothing helps.
        if state.step < self._untried and not torus_at(rejected).grazes:
            leapt = self._pass(state, FEW)
            if leapt is not None:
                return leapt
        more = self.options.finer(torus_at(state.point).count)
        if more is not None and self._pose(state.point, more, state):
            return None
        if more is None and rejected.arclength - state.point.arclength > _SHORTEST * self.steps.largest_step:
            self.walk.go_back(state, rejected)
            return None
        leapt = self._pass(state, MANY)
        if leapt is None:
            self.end = self._locked_beside(state.point) or rough(
                state.point, torus_at(rejected), self._crept(state.point)
            )
        return leapt

    def _locked_beside(self, last: BranchPoint) -> TorusEnd | None:
        """Return the end of a family whose last torus is in a window of locked motions, or next to one; else None."""
        for ratio in (self._near_resonance(torus_at(last)), self._crept(last), self._resonance_ahead(torus_at(last))):
            window = None if ratio is None else self._window(last, ratio)
            if ratio is not None and window is not None and window.distance(last.value) <= window.width:
                return locked(last, ratio, window)
        return None

    def _crept(self, last: BranchPoint) -> Fraction | None:
        """Return the simplest fraction to which the rotation number has come since the last good step; None if none."""
        good = self._strides.good
        if good is None or self.beginning.second is not None:
            return None
        low, high = sorted((torus_at(good.end).rotation, torus_at(last).rotation))
        return simplest(low, high) if low < high else None

    def _pass(self, state: WalkState, lengths: tuple[float, ...]) -> Step | None:
        """Return the step over a resonance, by a leap, or from the motion beyond a locked window; None if none is."""
        self._untried = _SHORTER * state.step
        leap = self._strides.leap(state.point, equation_of(self.corrector).count, lengths)
        if leap is not None:
            return self._leapt(state.point, leap)
        near = self._resonance_ahead(torus_at(state.point))
        if near is None or (lengths is FEW and near.denominator > DENOMINATOR):
            return None
        return self._past_window(state.point, near, self._window(state.point, near))

    def _leap_on(self, last: BranchPoint) -> Step | None:
        """Return the next leap after one that succeeded; None if there is none, and steps are taken again."""
        before, self._leaping = self._leaping, None
        assert before is not None
        leap = self._strides.leap_from(self.corrector, last, before, last, NEXT)
        return None if leap is None else self._leapt(last, leap)

    def _leapt(self, last: BranchPoint, leap: Stride) -> Step:
        """Continue at the end of a leap, and return the step with what happened on the way."""
        events = events_in_leap(last, leap.end, self.corrector, self.beginning.within)
        self.corrector, self._leaping, self._untried = leap.corrector, leap, np.inf
        self._strides.restart(leap)
        self.walk = self._walk_from(WalkState(None, leap.end, leap.length, self.walk.state.count + 1))
        self._pose_again(self.walk.state, leap.end)
        return record_at(leap.end), events

    def _halve(self, last: BranchPoint) -> Step | None:
        """Return the step to a torus of half the size, and record the end if they shrink; None if there is none."""
        point = halved(last, self.corrector)
        self._halving = point is not None
        if point is None:
            return None
        self.end = vanished(last, point, equation_of(self.corrector).parameter)
        self.walk = self._walk_from(WalkState(None, point, self.walk.step, self.walk.state.count + 1))
        events = events_between(last, point, self.corrector, self.beginning.within)
        return record_at(point), events

    def _window(self, last: BranchPoint, ratio: Fraction) -> LockedWindow | None:
        """Return the locked motions at the last torus, or ahead of it; None if none are found."""
        good = self._strides.good
        ahead = 0.0 if good is None else good.end.value - good.start.value
        for value in (last.value, *(last.value + share * ahead for share in _AHEAD)):
            if value in self.beginning.within:
                window = window_at(last, ratio, value, self.corrector, self.beginning.within)
                if window is not None:
                    return window
        return None

    def _lock(self, last: BranchPoint, ratio: Fraction, window: LockedWindow | None) -> Step | None:
        """Continue beyond a window in which the motion locks, and return the first step there; else record the end."""
        leapt = self._past_window(last, ratio, window)
        if leapt is None:
            self.end = locked(last, ratio, window)
        return leapt

    def _past_window(self, last: BranchPoint, ratio: Fraction, window: LockedWindow | None) -> Step | None:
        """Return the first step beyond a window in which the motion locks; None if no torus is found there."""
        good = self._strides.good
        way = 0.0 if good is None else float(np.sign(good.end.value - good.start.value))
        if window is None or good is None or not way:
            return None
        parameter, within = equation_of(self.corrector).parameter, self.beginning.within
        beyond = start_beyond(torus_at(last), window, parameter, way, within, last.value, self.options)
        if beyond is None:
            return None
        self.corrector, self._moved = beyond.corrector, 0.0
        self._strides.restart(good)
        self._leaping = good
        away = float(np.linalg.norm(beyond.first.x[-2:] - last.x[-2:]))
        first = replace(beyond.first, arclength=last.arclength + away, memo={})
        self.walk = self._walk_from(WalkState(None, first, good.length, self.walk.state.count + 1))
        middle, kind = 0.5 * (window.low + window.high), TorusEventKind.RESONANCE
        tori = torus_at(last), torus_at(first)
        event = _event(kind, middle, 0.5 * window.width, float(ratio), *tori, ratio, window)
        return record_at(first), [event]

    def _ended(self, state: WalkState) -> Step | None:
        """Record the end of the walk; where it ended at a resonance, try to leap over it and return the step."""
        end, torus = self.walk.end, torus_at(state.point)
        assert end is not None
        if end.reason is not EndReason.STEP:
            self.end = end_at(self.walk.point, TorusEndReason.of(end.reason), end.detail)
            return None
        leapt = self._halve(state.point) or self._pass(state, MANY)
        if leapt is not None:
            return leapt
        self.end = self._locked_beside(state.point)
        near = self._near_resonance(torus)
        if self.end is None and torus.error > self.options.accuracy:
            self.end = rough(state.point, torus, self._crept(state.point))
        elif self.end is None and near is not None:
            self.end = locked(state.point, near, None)
        elif self.end is None:
            self.end = end_at(state.point, TorusEndReason.STEP, end.detail)
        return None


# Continuation of tori along a parameter, by pseudo-arclength in the curve, its rotation number and the parameter.
#
# Method: docs/numerics/notes/tori.md

STEPS = WalkOptions(initial_step=0.01, smallest_step=1e-5, largest_step=0.05, max_points=1000)
"""Default options of the steps: a motion that changes by its own size, or all of the range, counts as 1."""

TorusReport = Callable[[TorusPoint, list[TorusEvent]], None]
"""Function called with each new torus and the events before it."""


@shows_progress(lambda count, point, events: f"{count} tori, at {point.value:.6g}")
def follow_tori(
    start: Torus | SpecialPoint | TorusEvent,
    parameter: str,
    to: float | tuple[float, float],
    *,
    second: tuple[str, tuple[float, float]] | None = None,
    walk: WalkOptions | None = None,
    options: TorusOptions | None = None,
    report: TorusReport | None = None,
) -> TorusFamily:
    """Follow a family of tori along a parameter, stable or unstable, from where it begins or from one of its tori.

    Along it, folds, changes of stability and resonances are located; at resonances the locked periodic motions are
    looked for. The rotation number varies freely, so that narrow resonances are stepped over; or it is kept, and a
    second parameter varies with the first one.

    Parameters
    ----------
    start
        A Neimark-Sacker point, at which tori begin; a torus, from `gw.tori.find_torus`; or a torus doubling among the
        events of a family, at which tori of twice as many curves begin.
    parameter
        Name of the parameter, such as ``"frequency"``.
    to
        The value at which to stop; or two values, between which the family is followed. From a torus it is followed in
        both directions.
    second
        Name and range of a second parameter that varies so that the rotation number of the first torus stays.
    walk
        Options of the steps, in units of the size of the motion and of the range.
    options
        Accuracy, and number of samples of a curve.
    report
        Called with each new torus and the events before it.

    Returns
    -------
    TorusFamily
        The tori, events and both ends, in one direction.

    Raises
    ------
    ModelError
        For a start at which no tori begin, a range that does not contain it, a system with friction or rigid stops, or
        a free motion.
    ConvergenceError
        If no torus is found next to a Neimark-Sacker point; the message says whether it is near a strong resonance.
    Interrupted
        After Ctrl-C; its `found` is the family so far.

    Examples
    --------
    >>> import gapwalk as gw
    >>> torus = gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=0.672))
    >>> family = gw.tori.follow_tori(torus, "frequency", (0.671, 0.673))
    >>> family.parameter
    'frequency'
    """
    options, walk = options or TorusOptions(), walk or STEPS
    system = _system_of(start)
    if parameter not in system.structure.names:
        system.structure.place(parameter)  # raises the error that names near parameters
    within = check_range(system[parameter], to).along(parameter, system)
    other = None if second is None else _second(second, parameter, system)
    beginnings = starts_at(start, parameter, within, options, walk, isinstance(to, tuple), other)

    def record(tracing: Tracing[TorusStart, Any, Step]) -> TorusFamily:
        name = beginnings[0].second.name if beginnings[0].second else ""
        turned = joined(tracing, beginnings[0].end, lambda point: replace(point, arclength=-point.arclength), _turned)
        return TorusFamily(parameter, *turned, name)

    return Tracing(beginnings, lambda start, _: TorusTracer(start, walk, options)).to_end(record, report)


def _system_of(start: Torus | SpecialPoint | TorusEvent) -> System:
    if isinstance(start, SpecialPoint):
        return start.orbit.system
    if isinstance(start, TorusEvent):
        if start.torus is None:
            raise ModelError(f"no tori begin at an event of the kind {start.kind.value!r}; they do at torus doublings")
        return start.torus.system
    return start.system


def _second(given: tuple[str, tuple[float, float]], parameter: str, system: System) -> Second:
    name, to = given
    system.structure.place(name)
    if name == parameter:
        raise ModelError(f"the second parameter is {name!r}, which is the first one; name another")
    return Second(name, check_range(system[name], to).along(name, system))


def _turned(event: TorusEvent) -> TorusEvent:
    return replace(event, before=event.after, after=event.before)
