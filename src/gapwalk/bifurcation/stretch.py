"""A stretch of a branch between two points: any point between them, computed when it is asked for."""

from __future__ import annotations

from bisect import bisect_left

from gapwalk.bifurcation.crossing import Crossing
from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.predictor import hermite
from gapwalk.errors import NumericalError

RESOLUTION = 1e-11
"""Arclength below which lengths are made of rounding."""
_FINEST = 1e-6  # arclength below which two zeros are not told apart
_SHARE = 1e-4  # the same as a share of a short step: the walk goes in such where the branch bends as sharply
_ASTRAY = 0.3  # cosine of the angle between a chord and a tangent between its ends; beyond, it turned unseen


class Stretch:
    """The orbits between two neighbouring points of a walk, by scaled arclength.

    Each new point is predicted by the cubic through its known neighbours and their tangents, then corrected on a
    plane across their chord, so points grow cheaper as they grow denser. Close to a crossing with another branch,
    which is entered in `crossings` when it is found, they are interpolated instead. Two zeros less than `finest` apart
    are not told apart.
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
        """The point at an arclength.

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
        """The point halfway between two points."""
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
