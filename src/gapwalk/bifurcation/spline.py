"""Smooth curve through points, and distances of other points from it, for comparisons of branches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_DENSE = 12  # samples of a curve between two of its points, among which the nearest one is sought
_ITERATIONS = 8
_CLOSEST = 1e-4  # smallest distance between distinct points of a curve


class SplineCurve:
    """Cubic spline through points in order.

    Parameters
    ----------
    points : shape (points, dimensions)
        The points, in units in which the whole range is about 1.

    Attributes
    ----------
    resolution
        Rough upper bound of the error of a distance due to the interpolation between the points.
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        from scipy.interpolate import CubicSpline  # imported late, because the import is slow
        from scipy.spatial import cKDTree

        lengths = _lengths(points)
        # if points nearly coincide, their rounding would bend the spline
        cells = np.unique((lengths / _CLOSEST).astype(int), return_index=True)[1]
        points = points[cells] if len(cells) > 1 else points[[0, -1]] + [[0.0], [_CLOSEST]]
        lengths = _lengths(points)
        self._spline = CubicSpline(lengths, points)
        self._tangent = self._spline.derivative()
        shares = np.arange(_DENSE) / _DENSE
        samples = (lengths[:-1, None] + shares * np.diff(lengths)[:, None]).ravel()
        self._samples = np.append(samples, lengths[-1])
        self._tree = cKDTree(self._spline(self._samples))
        coarse = CubicSpline(lengths[::2], points[::2]) if len(points) > 4 else self._spline
        middle = (lengths > lengths[1]) & (lengths < lengths[::2][-1])
        off = np.linalg.norm(coarse(lengths[middle]) - points[middle], axis=1)
        self.resolution = float(off.max(initial=0.0)) / 8.0  # third order, as at a graze; elsewhere 16

    def distances(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each place, shape (places, dimensions), from the curve."""
        if not len(places):
            return np.empty(0)
        nearest = self._tree.query(places)[1]
        last = len(self._samples) - 1
        low, high = self._samples[np.maximum(nearest - 1, 0)], self._samples[np.minimum(nearest + 1, last)]
        at = self._samples[nearest]
        for _ in range(_ITERATIONS):
            tangent = self._tangent(at)
            at = at + ((places - self._spline(at)) * tangent).sum(axis=1) / (tangent * tangent).sum(axis=1)
            at = np.clip(at, low, high)
        return np.linalg.norm(places - self._spline(at), axis=1)


def _lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length of the polygon from its start to each of its points."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
