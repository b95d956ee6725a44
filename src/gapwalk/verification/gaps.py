"""Check that a branch connects each of its points to the next: orbits are sought between them, and must lie there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import lift
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import length_of
from gapwalk.continuation.predictor import hermite
from gapwalk.errors import NumericalError
from gapwalk.verification.walk_again import Track

_OFF = 0.1  # largest distance of the orbit between from the cubic through both points, in distances of the points
_TURN = 0.6  # largest angle between a tangent and the chord, in radians
_DEEPEST = 7  # largest number of successive halvings of a gap
_LONGER = 0.3  # largest relative difference between the distance of two points and the arclength between them
_TOGETHER = 1e-6  # distance below which two points are one
_SHARES = (0.5, 0.4, 0.62)  # places at which an orbit is sought: close to a crossing of branches correction fails


def gap(track: Track, a: BranchPoint, b: BranchPoint) -> float:
    """Return how much the branch between two neighbouring points deviates from the cubic through them.

    1 is the largest accepted figure: an orbit between them lies off the cubic through both points by a tenth of their
    distance, or a tangent, at a point or between, is 0.6 rad off the chord. If the figure is larger, the gap is halved.
    It is infinite if there is no orbit between. The distance must also equal the arclength between them within 30 %.
    """
    ahead = b.arclength - a.arclength
    if len(a.x) != len(b.x):  # harmonics may grow along a branch
        coarse, fine = sorted((a, b), key=lambda point: len(point.x))
        corrector = track.corrector_at(fine)
        lifted = lift(coarse, corrector, track.equation_at(fine))
        if lifted is None:
            return math.inf
        a, b = (lifted, b) if coarse is a else (a, lifted)
    length = length_of(b.x - a.x)
    # a branch may connect any two points by a long detour
    far = abs(length - ahead) / (_LONGER * abs(ahead) + _TOGETHER)
    return max(far, _gap(track, a, b, 0))


def _gap(track: Track, a: BranchPoint, b: BranchPoint, depth: int) -> float:
    if length_of(b.x - a.x) < _TOGETHER:
        return 0.0
    middle, figure = between(track, a, b)
    if middle is None or figure <= 1.0 or depth == _DEEPEST:
        return figure
    return max(_gap(track, a, middle, depth + 1), _gap(track, middle, b, depth + 1))


def between(track: Track, a: BranchPoint, b: BranchPoint) -> tuple[BranchPoint | None, float]:
    """Return an orbit about half way between two points, and its deviation from that place; see `gap`."""
    chord = b.x - a.x
    length = length_of(chord)
    way, corrector = chord / length, track.corrector_at(a)
    turn = max(_angle(a.tangent, way), _angle(b.tangent, way)) / _TURN
    first = BranchPoint(a.value, a.orbit, a.x, a.tangent, a.determinant, 0.0)
    last = BranchPoint(b.value, b.orbit, b.x, b.tangent, b.determinant, length)
    for share in _SHARES:
        for guess in (hermite(first, last, share), a.x + share * chord):
            try:
                correction = corrector.correct(guess, way)
                if correction is None or length_of(correction.x - guess) > 0.5 * length:
                    continue
                middle = corrector.point(correction, way, a.arclength + share * (b.arclength - a.arclength))
            except NumericalError:
                continue
            off = length_of(correction.x - hermite(first, last, share)) / length / _OFF
            return middle, max(off, turn, _angle(middle.tangent, way) / _TURN)
    return None, math.inf


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the angle between two unit vectors, in radians."""
    return 2.0 * math.asin(min(1.0, length_of(a - b) / 2.0))
