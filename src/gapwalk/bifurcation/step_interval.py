"""Interval of a branch between two points: computes any point in it on request."""

from __future__ import annotations

from bisect import bisect_left

from gapwalk.bifurcation.crossing import Crossing
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.predictor import hermite
from gapwalk.errors import NumericalError

RESOLUTION = 1e-11
"""Arclength below which lengths are only rounding."""
_FINEST = 1e-6  # arclength below which two zeros are not distinguished
_SHARE = 1e-4  # the same as a share of a short step, for branches that bend so sharply that the steps are short
_ASTRAY = 0.3  # smallest cosine of the angle between a chord and a tangent in between; below it a turn was missed


class StepInterval:
    """Step interval: the orbits between two neighbouring points of a walk, by scaled arclength.

    Each new point is predicted by the cubic through its known neighbours and their tangents, then corrected in a plane
    across their chord. So points become cheaper as they become denser. Close to a crossing with another branch, points
    are interpolated instead; a crossing is added to `crossings` when it is found. Two zeros less than `finest` apart
    are not distinguished.
    """

    def __init__(self, corrector: Corrector, first: BranchPoint, last: BranchPoint) -> None:
        self.corrector = corrector
        self._points = [first, last]
        self._lengths = [first.arclength, last.arclength]
        self.crossings: list[Crossing] = []
        self.finest = min(_FINEST, max(RESOLUTION, _SHARE * (last.arclength - first.arclength)))

    @property
    def points(self) -> list[BranchPoint]:
        """All points known so far, in order."""
        return list(self._points)

    def at(self, arclength: float) -> BranchPoint:
        """Return the point at an arclength.

        Raises
        ------
        NumericalError
            If the corrector does not converge.
        """
        index = bisect_left(self._lengths, arclength)
        if index < len(self._lengths) and self._lengths[index] == arclength:
            return self._points[index]
        point = self._between(self._points[index - 1], self._points[index], arclength)
        self._points.insert(index, point)
        self._lengths.insert(index, arclength)
        return point

    def middle(self, first: BranchPoint, last: BranchPoint) -> BranchPoint:
        """Return the point halfway between two points."""
        return self.at(0.5 * (first.arclength + last.arclength))

    def _between(self, a: BranchPoint, b: BranchPoint, arclength: float) -> BranchPoint:
        for crossing in self.crossings:
            if arclength in crossing:
                return self.corrector.crossed(crossing.x(arclength), crossing.tangent(arclength), arclength)
        chord = b.x - a.x
        length = length_of(chord)
        share = (arclength - a.arclength) / (b.arclength - a.arclength)
        normal = chord / length if length > 1e-12 else a.tangent
        for guess in (hermite(a, b, share), a.x + share * chord):
            correction = self.corrector.correct(guess, normal)
            if correction is not None and correction.distance <= max(length, 1e-9):
                point = self.corrector.point(correction, a.tangent, arclength)
                if point.tangent @ normal >= _ASTRAY:
                    return point
        raise NumericalError(
            f"no orbit found between {a.value:.12g} and {b.value:.12g} on the branch, where one must be"
        )
