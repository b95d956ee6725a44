"""Compare two branches that should be the same: how far apart they run, and whether their special points agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from gapwalk.continuation.branch import Branch, SpecialPoint
from gapwalk.errors import ModelError

_DENSE = 12  # samples of a curve between two of its points, from which the nearest place is looked for
_NEAR = 0.05  # distance, in sizes of the whole picture, beyond which two special points are not the same
_FAR = 1e3
_ITERATIONS = 8
_STEADY = 1e-6  # range of a measure, relative to its size, below which it does not vary
_CLOSEST = 1e-4  # distance, in sizes of the whole picture, between points of a curve that are told apart


@dataclass(frozen=True)
class Match:
    """A special point that both branches have.

    Attributes
    ----------
    first, second
        The point of either branch.
    """

    first: SpecialPoint
    second: SpecialPoint

    @property
    def difference(self) -> float:
        """Of their values of the parameter, second less first."""
        return self.second.value - self.first.value


@dataclass(frozen=True)
class Comparison:
    """What two branches have in common, and what not.

    Lengths are relative: to the range of the parameter, and to the range of each measure.

    Attributes
    ----------
    parameter, measures
        What is compared: each branch is a curve over the parameter, in the space of these measures.
    width
        Range of the parameter that both cover, in its units.
    values, distances : shape (points,)
        For each point of the first branch within that range its parameter, and its distance from the second branch.
    resolution
        Roughly the largest part of a distance that the interpolation between the second branch's points may be.
    matches
        Special points that both have.
    only_first, only_second
        Special points that only one of them has, within the common range.
    """

    parameter: str
    measures: tuple[str, ...]
    width: float
    values: NDArray[np.float64]
    distances: NDArray[np.float64]
    resolution: float
    matches: tuple[Match, ...]
    only_first: tuple[SpecialPoint, ...]
    only_second: tuple[SpecialPoint, ...]

    @property
    def largest(self) -> float:
        """The largest distance along the branch, as a share of the ranges."""
        return float(self.distances.max())

    @property
    def largest_shift(self) -> float:
        """The largest difference of a special point's parameter, in its units; 0 if there are none."""
        return max((abs(match.difference) for match in self.matches), default=0.0)

    def within(self, tolerance: float) -> bool:
        """Whether the branches agree: every distance, and every shift relative to the range, and no point unmatched."""
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
    """Compare two branches of the same system over the same parameter, found by different methods perhaps.

    Parameters
    ----------
    first, second
        The branches. Where only one has points, nothing is compared.
    measures
        Measures (see `Orbit.measure`) that tell motions apart; by default half the peak-to-peak and the mean of each
        coordinate.

    Raises
    ------
    ModelError
        If the branches follow different parameters, or have no range in common.

    Notes
    -----
    Two orbits at equal values of the parameter cannot be compared at a fold. So the distance of each point of the
    first from the second branch as a curve is taken, the curve being the cubic spline through its points and its
    special points.
    """
    if first.parameter != second.parameter:
        raise ModelError(
            f"one branch follows {first.parameter}, the other {second.parameter}; compare branches over one parameter"
        )
    low = max(first.values.min(), second.values.min())
    high = min(first.values.max(), second.values.max())
    if not low < high:
        raise ModelError(f"the branches have no range of {first.parameter} in common")
    names = _names(first, measures)
    ranges = _ranges((first, second), names, float(low), float(high))
    curve = _Curve(_knots(second, names) / ranges)
    inside = [point for point in first.points if low <= point.value <= high]
    places = np.array([[point.value, *(point.measure(name) for name in names)] for point in inside]) / ranges
    matches, only_first, only_second = _match(first, second, names, ranges, (float(low), float(high)))
    return Comparison(
        first.parameter,
        names,
        float(high - low),
        np.array([point.value for point in inside]),
        curve.distances(places),
        curve.resolution,
        matches,
        only_first,
        only_second,
    )


class _Curve:
    """A curve in space through points, shape (points, dimensions)."""

    def __init__(self, points: NDArray[np.float64]) -> None:
        lengths = _lengths(points)
        # points that nearly coincide would bend the spline by their rounding
        cells = np.unique((lengths / _CLOSEST).astype(int), return_index=True)[1]
        points = points[cells]
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
        self.resolution = float(off.max(initial=0.0)) / 8.0  # as where a contact grazes; 16 elsewhere

    def distances(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of each place from the curve."""
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
    """Lengths of the polygon from its beginning to each of its points."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def _names(branch: Branch, measures: str | Sequence[str] | None) -> tuple[str, ...]:
    if measures is None:
        return tuple(f"{kind}.{q}" for q in branch.system.coordinates for kind in ("half", "mean"))
    return (measures,) if isinstance(measures, str) else tuple(measures)


def _knots(branch: Branch, names: tuple[str, ...]) -> NDArray[np.float64]:
    """The points and special points of a branch in their order, shape (points, 1 + measures)."""
    points = [*branch.points, *(special.point for special in branch.special_points)]
    points.sort(key=lambda point: point.arclength)
    return np.array([[point.value, *(point.measure(name) for name in names)] for point in points])


def _ranges(branches: Sequence[Branch], names: tuple[str, ...], low: float, high: float) -> NDArray[np.float64]:
    """The range of the parameter, and of each measure over both branches; the size of one that hardly varies."""
    measured = [np.concatenate([branch.measure(name) for branch in branches]) for name in names]
    ranges = [float(np.ptp(each)) for each in measured]
    sizes = [float(np.abs(each).max()) or 1.0 for each in measured]
    varied = (width if width > _STEADY * size else size for width, size in zip(ranges, sizes, strict=True))
    return np.array([high - low, *varied])


def _match(
    first: Branch, second: Branch, names: tuple[str, ...], ranges: NDArray[np.float64], within: tuple[float, float]
) -> tuple[tuple[Match, ...], tuple[SpecialPoint, ...], tuple[SpecialPoint, ...]]:
    """Pairs of special points of one kind (and contact) that are near each other, and those left over."""
    low, high = within
    ours, theirs = (
        [special for special in branch.special_points if low <= special.value <= high] for branch in (first, second)
    )
    places = [
        np.array([[s.value, *(s.orbit.measure(name) for name in names)] for s in points]).reshape(-1, len(ranges))
        / ranges
        for points in (ours, theirs)
    ]
    apart = np.linalg.norm(places[0][:, None] - places[1][None], axis=2)
    alike = np.array([[(a.kind, a.contact) == (b.kind, b.contact) for b in theirs] for a in ours], dtype=bool)
    apart = np.where(alike.reshape(apart.shape) & (apart <= _NEAR), apart, _FAR)
    pairs = [(i, j) for i, j in zip(*linear_sum_assignment(apart), strict=True) if apart[i, j] < _FAR]
    taken = {i for i, _ in pairs}, {j for _, j in pairs}
    left, right = (
        tuple(special for index, special in enumerate(points) if index not in used)
        for points, used in zip((ours, theirs), taken, strict=True)
    )
    return tuple(Match(ours[i], theirs[j]) for i, j in pairs), left, right
