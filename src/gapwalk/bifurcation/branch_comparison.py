"""Comparison of two branches that should agree: the distance between them, and their special points.

The distance of points from a branch is measured from a smooth curve through its points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.notebook import Shown

_DENSE = 12  # samples of a curve between two of its points, among which the nearest one is sought
_ITERATIONS = 8
_CLOSEST = 1e-4  # smallest distance between distinct points of a curve
_NEAR = 0.05  # distance, with both ranges scaled to 1, beyond which two special points are not the same
_FAR = 1e3
_STEADY = 1e-6  # range of a measure, relative to the size of its signal, below which it does not vary
_NOTHING = 1e-12  # size of a signal, relative to the largest, below which it is rounding


@dataclass(frozen=True)
class Match:
    """Special point that both branches have."""

    #: first, second: The point of the first and of the second branch.
    first: SpecialPoint
    second: SpecialPoint

    @property
    def difference(self) -> float:
        """Difference of the parameter values, second minus first."""
        return self.second.value - self.first.value


@dataclass(frozen=True, eq=False)
class Comparison(Shown):
    """Agreement and differences of two branches.

    Lengths are relative to the range of the parameter and to the range of each measure.
    """

    #: parameter, measures: Quantities that are compared: each branch is a curve over the parameter, in the space of
    #: these measures.
    parameter: str
    measures: tuple[str, ...]
    width: float  #: Range of the parameter, in its units.
    #: values, distances: shape (points,): For each point of the first branch within that range: its parameter, and its
    #: distance from the second branch.
    values: NDArray[np.float64]
    distances: NDArray[np.float64]
    #: Rough upper bound of the error of a distance due to interpolation between the points of the second branch.
    resolution: float
    matches: tuple[Match, ...]  #: Special points that both have.
    #: only_first, only_second: Special points that only one of them has, within the common range.
    only_first: tuple[SpecialPoint, ...]
    only_second: tuple[SpecialPoint, ...]

    @property
    def largest(self) -> float:
        """Largest distance along the branch, as a share of the ranges."""
        return float(self.distances.max(initial=0.0))

    @property
    def largest_shift(self) -> float:
        """Largest difference of a special point's parameter, in its units; 0 if there are no matches."""
        return max((abs(match.difference) for match in self.matches), default=0.0)

    def within(self, tolerance: float) -> bool:
        """Return True if the branches agree: no distance or relative shift above the tolerance, no point unmatched."""
        unmatched = self.only_first or self.only_second
        return not unmatched and max(self.largest, self.largest_shift / self.width) <= tolerance

    def __str__(self) -> str:
        worst = float(self.values[np.argmax(self.distances)])
        lines = [
            f"largest distance {self.largest:.3g} of the ranges, at {self.parameter} = {worst:.8g} "
            f"(interpolation may add {self.resolution:.1g})"
        ]
        for match in self.matches:
            contact = f" {match.first.contact}" if match.first.contact else ""
            name = f"{match.first.kind.value}{contact}"
            lines.append(f"{name} at {match.first.value:.10g} and {match.second.value:.10g}: {match.difference:+.3g}")
        for which, points in (("first", self.only_first), ("second", self.only_second)):
            lines += [f"only in the {which}: {point!r}" for point in points]
        return "\n".join(lines)


def compare(first: Branch, second: Branch, measures: str | Sequence[str] | None = None) -> Comparison:
    """Compare two branches of the same system over the same parameter, possibly computed by different methods.

    Parameters
    ----------
    first, second
        The branches, which are compared over their common range of the parameter.
    measures
        Measures (see `Orbit.measure`) that distinguish the motions; by default mean and root mean square of each
        coordinate. Largest and smallest values are less suitable, because they have corners along a branch.

    Returns
    -------
    Comparison
        Distances between the branches along the first one, and the special points that both have.

    Raises
    ------
    ModelError
        If the branches follow different parameters, or have no range in common.

    Notes
    -----
    At a fold, orbits at equal values of the parameter cannot be compared. Therefore distances are measured from each
    point of the first branch to a curve: the cubic spline through points and special points of the second branch.

    Examples
    --------
    >>> again = gw.follow(orbit, "frequency", 1.6, walk=gw.WalkOptions(largest_step=0.01))
    >>> gw.compare(branch, again).within(1e-3)
    True
    """
    if first.parameter != second.parameter:
        raise ModelError(
            f"one branch follows {first.parameter}, the other {second.parameter}; compare branches over one parameter"
        )
    low, high = common_range(first, second)
    if not low < high:
        raise ModelError(f"the branches have no range of {first.parameter} in common")
    names = measures_of(first, measures)
    return compare_in(first, second, names, np.append(high - low, measure_ranges((first, second), names)))


def common_range(first: Branch, second: Branch) -> tuple[float, float]:
    """Return the range of the parameter common to two branches, with exchanged limits (low > high) if there is none."""
    (a, b), (c, d) = value_range(first), value_range(second)
    return max(a, c), min(b, d)


def value_range(branch: Branch) -> tuple[float, float]:
    """Return the range of the parameter over a branch, folds included."""
    values = [*branch.values.tolist(), *(special.value for special in branch.special_points)]
    return min(values), max(values)


def measures_of(branch: Branch, measures: str | Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the measures by which branches are compared; by default those of `compare`."""
    if measures is None:
        return tuple(f"{kind}.{q}" for q in branch.system.coordinates for kind in ("mean", "rms"))
    return (measures,) if isinstance(measures, str) else tuple(measures)


def compare_in(first: Branch, second: Branch, names: tuple[str, ...], ranges: NDArray[np.float64]) -> Comparison:
    """Compare two branches with lengths relative to given ranges, of the parameter and of each measure."""
    low, high = common_range(first, second)
    curve = SplineCurve(_knots(second, names) / ranges)
    inside = [point for point in first.points if low <= point.value <= high]
    values = [[point.value, *(point.measure(name) for name in names)] for point in inside]
    places = np.array(values).reshape(-1, len(ranges)) / ranges
    ours, theirs = first.special_points, second.special_points
    at = [
        np.array([[s.value, *(s.orbit.measure(name) for name in names)] for s in each]).reshape(-1, len(ranges))
        / ranges
        for each in (ours, theirs)
    ]
    labels = [[(special.kind, special.contact) for special in each] for each in (ours, theirs)]
    pairs = match_places(at[0] / ranges, labels[0], at[1] / ranges, labels[1])
    alone = (
        tuple(s for index, s in enumerate(each) if index not in used and low <= s.value <= high)
        for each, used in ((ours, {i for i, _ in pairs}), (theirs, {j for _, j in pairs}))
    )
    return Comparison(
        first.parameter,
        names,
        float(ranges[0]),
        np.array([point.value for point in inside]),
        curve.distances(places),
        curve.resolution,
        tuple(Match(ours[i], theirs[j]) for i, j in pairs),
        *alone,
    )


class SplineCurve:
    """Cubic spline through points in order.

    Shapes: `points` (points, dimensions).

    Attributes
    ----------
    resolution
        Rough upper bound of the error of a distance due to the interpolation between the points.
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        from scipy.interpolate import CubicSpline  # imported late, because the import is slow
        from scipy.spatial import cKDTree

        self._points = cKDTree(points)
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
        return np.minimum(np.linalg.norm(places - self._spline(at), axis=1), self._points.query(places)[0])


def _lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length of the polygon from its start to each of its points."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def _knots(branch: Branch, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the points and special points of a branch in order, shape (points, 1 + measures)."""
    points = [*branch.points, *(special.point for special in branch.special_points)]
    points.sort(key=lambda point: point.arclength)
    return np.array([[point.value, *(point.measure(name) for name in names)] for point in points])


def match_places(
    first: NDArray[np.float64],
    first_labels: Sequence[object],
    second: NDArray[np.float64],
    second_labels: Sequence[object],
) -> list[tuple[int, int]]:
    """Return pairs of nearby places with equal labels, such that the sum of their distances is smallest."""
    # Places have shape (places, dimensions), in units in which the whole range is about 1.
    from scipy.optimize import linear_sum_assignment  # imported late, because the import is slow

    apart = np.linalg.norm(first[:, None] - second[None], axis=2)
    alike = np.array([[a == b for b in second_labels] for a in first_labels], dtype=bool).reshape(apart.shape)
    apart = np.where(alike & (apart <= _NEAR), apart, _FAR)
    return [(int(i), int(j)) for i, j in zip(*linear_sum_assignment(apart), strict=True) if apart[i, j] < _FAR]


def measure_ranges(branches: Sequence[Branch], names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the range of each measure over some branches; for a measure that hardly varies, the size of its signal."""
    # So the mean of a symmetric motion, which is pure rounding, is measured relative to the motion, and a signal that
    # is itself pure rounding relative to the other signals.
    measured = [np.concatenate([branch.measure(name) for branch in branches]) for name in names]
    signals = [name.partition(".")[2] for name in names]
    own = [float(np.abs(each).max()) for each in measured]
    sizes = [max(size for size, other in zip(own, signals, strict=True) if other == signal) for signal in signals]
    largest = max(sizes, default=0.0) or 1.0
    sizes = [size if size > _NOTHING * largest else largest for size in sizes]
    ranges = [float(np.ptp(each)) for each in measured]
    return np.array([width if width > _STEADY * size else size for width, size in zip(ranges, sizes, strict=True)])
