"""Step over a corner of a branch, where the sequence of slip and stick changes.

Where a phase of stick begins within slip, neighbouring motions become one from there on. So the derivatives of the
orbit's equation jump, and the branch has a corner: on the other side its direction is that of the derivatives there. It
may even turn back. Steps along the old direction shrink, or fail, before such a corner. The step over it evaluates the
derivatives a little beyond it, follows their direction, and is accepted if the orbit there has the other sequence.

Where the motion jumps there is no corner: friction whose static coefficient is larger than the kinetic one sticks for a
while as soon as its slip rate touches zero. The branch ends there. A branch on the other side, if there is one, is
another one: a step of the size of the jump would reach it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.error_estimate import ROUNDING, SAFETY, ErrorEstimator
from gapwalk.bifurcation.friction_changes import changes_between
from gapwalk.bifurcation.kinds.sliding import Sliding, describe_friction
from gapwalk.bifurcation.special_point import KINDS, SpecialPoint
from gapwalk.bifurcation.stiff_graze import discontinuity_ahead
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sticking import text_of

_PROBES = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5)  # distances beyond the corner at which the derivatives are evaluated
_STEPS = (1e-6, 1e-5, 1e-7, 1e-4)  # lengths of the step over the corner
_ASTRAY = 0.5  # distance of the corrected point from the guess, as a share of the step, beyond which it is astray
_REACHED = 1e-12  # distance from the corner at which it is reached
_FARTHEST = 1e-4  # distance within which rounding may place it
_TURNED = 1e-3  # radians by which the direction on the other side must differ from going back


class Passage(NamedTuple):
    """Result of a step over a corner: both points, the special points at the corner, and the length of the step."""

    corner: BranchPoint
    point: BranchPoint
    special: list[SpecialPoint]
    distance: float


def pass_corner(corrector: Corrector, point: BranchPoint) -> Passage | None:
    """Return the step over a corner from a point just before it; None if there is none near."""
    here = sequence(point.orbit)
    if not point.orbit.slips or not any(_sequence_at(corrector, point, probe) not in {(), here} for probe in _PROBES):
        return None
    if discontinuity_ahead(corrector, point) is not None:
        return None
    corner = _corner(corrector, point)
    for way, length in _ways(corrector, corner):
        beyond = _beyond(corrector, corner, way, length)
        if beyond is not None and sequence(beyond.orbit) != here:
            beyond = _first_beyond(corrector, corner, way, beyond)
            special = _special(corrector, corner, beyond)
            return Passage(corner, beyond, special, beyond.arclength - corner.arclength)
    return None


def _beyond(corrector: Corrector, corner: BranchPoint, way: NDArray[np.float64], length: float) -> BranchPoint | None:
    """Return the point at a distance from a corner in a direction; None if there is none."""
    guess, arclength = corner.x + length * way, corner.arclength + length
    return corrector.point_near(guess, way, arclength, near=1e-3 * length, within=_ASTRAY * length)


def _first_beyond(
    corrector: Corrector, corner: BranchPoint, way: NDArray[np.float64], beyond: BranchPoint
) -> BranchPoint:
    """Return the point beyond a corner before the sequence changes once more, which it may do within the step over it.

    The two changes together may look like a third one.
    """
    here, length = sequence(corner.orbit), beyond.arclength - corner.arclength
    first: BranchPoint | None = None
    for probe in (each for each in _PROBES if each < length):
        nearer = _beyond(corrector, corner, way, probe)
        if nearer is None or sequence(nearer.orbit) == here:
            continue
        if sequence(nearer.orbit) != sequence((first or nearer).orbit):
            break
        if sequence(nearer.orbit) == sequence(beyond.orbit):
            return beyond
        first = nearer
    return first or beyond


def _corner(corrector: Corrector, point: BranchPoint) -> BranchPoint:
    """Return the last point ahead, within a short distance, that is reached along the direction at a point."""
    here, low, high = sequence(point.orbit), 0.0, _PROBES[0]
    last, limit = point, _PROBES[-1]
    while high - low > _REACHED:
        correction = corrector.correct(point.x + high * point.tangent, point.tangent, near=1e-3 * high)
        reached = correction is not None and length_of(correction.x - last.x) < 2.0 * (high - low)
        if correction is not None and reached:
            trial = corrector.point(correction, point.tangent, point.arclength + high)
            reached = sequence(trial.orbit) == here
            last, low = (trial, high) if reached else (last, low)
        if not reached:
            limit = high
        high = 2.0 * high if limit == _PROBES[-1] and reached else 0.5 * (low + limit)
        if low >= _PROBES[-1]:
            break
    return last


def sequence(orbit: Orbit) -> tuple[object, ...]:
    """Return the sequences of slip and stick of all friction in one period, and its modes at the start."""
    start = tuple(event.slip for event in orbit.slips if not event.theta)
    return tuple((contact, text_of(phases)) for contact, phases in orbit.friction.items()), start


def _ways(corrector: Corrector, corner: BranchPoint) -> Iterator[tuple[NDArray[np.float64], float]]:
    """Iterate over directions beyond the corner, each with lengths of the step."""
    known: list[NDArray[np.float64]] = []
    for probe in _PROBES:
        try:
            jacobian = corrector.jacobian(corner.x + probe * corner.tangent)
        except NumericalError:
            continue
        direction = np.linalg.svd(jacobian)[2][-1]
        for way in (direction, -direction):
            back = float(way @ -corner.tangent)
            if back > 1.0 - 0.5 * _TURNED**2 or any(float(way @ each) > 1.0 - 0.5 * _TURNED**2 for each in known):
                continue
            known.append(way)
            for length in _STEPS:
                yield way, length


def _error(corrector: Corrector, corner: BranchPoint) -> float:
    """Estimate the error of the parameter at a corner: how far from it rounding decides on the sequence."""
    reach, width = _REACHED, float(corrector.scales[-1])
    try:
        blur = ErrorEstimator(corrector).blur(corner)
    except NumericalError:
        return math.inf
    motions = [corner, *blur.asides]
    while True:
        before, after = ({_sequence_at(corrector, each, way * reach) for each in motions} for way in (-1.0, 1.0))
        if len(before) == 1 and before.isdisjoint(after):  # beyond it they may differ among each other
            break
        reach *= 2.0
        if reach > _FARTHEST:
            return math.inf
    across = width * (abs(float(corner.tangent[-1])) * reach + blur.off)
    return SAFETY * across + ROUNDING * (abs(corner.value) + width)


def _sequence_at(corrector: Corrector, point: BranchPoint, distance: float) -> tuple[object, ...]:
    """Return the sequence of the motion, which need not be periodic, a little along the tangent; none if it fails."""
    try:
        ahead = corrector.uncorrected(point.x + distance * point.tangent, point.tangent, point.arclength)
    except NumericalError:
        return ()
    return sequence(ahead.orbit)


def _special(corrector: Corrector, corner: BranchPoint, point: BranchPoint) -> list[SpecialPoint]:
    """Return the special points at the corner: one for each phase that appears or vanishes.

    In a symmetric motion there are two or more. The last of them has what changes in the multipliers.
    """
    found: list[SpecialPoint] = []
    before = corner.orbit.instability
    error, parameter = _error(corrector, corner), corrector.equation.parameter or ""
    for change in changes_between(corner.orbit, point.orbit) or []:
        for kind in KINDS.values():
            if isinstance(kind, Sliding) and kind.owns(change):
                words = kind.nature(corner, point)
                name = describe_friction(corner.orbit, change)
                found.append(SpecialPoint(kind, corner, before, before, error, name, words, parameter=parameter))
    return [*found[:-1], *(replace(each, after=point.orbit.instability) for each in found[-1:])]
