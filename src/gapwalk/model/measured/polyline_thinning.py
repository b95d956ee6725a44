"""Thinning of a measured curve: the fewest of its points whose polyline stays within an error of all of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXACT = 1000
"""Number of points up to which the fewest are found; of more points, the fewest among so many candidates."""

_CHUNK = 64


def thin_polyline(x: Array, y: Array, error: float, most: int) -> NDArray[np.intp] | None:
    """Choose the fewest points, among them the first and the last, whose polyline stays within an error of all.

    It is the shortest path in the graph whose edges are the chords that stay within the error of all points below them
    (Imai and Iri 1988). Of several with as few points, the one with the least sum of squared differences is taken. All
    chords from a point are found in one pass: the slopes that pass all points so far within the error are an interval
    which only shrinks.

    Shapes: `x`, `y` (points,).
    """
    count = len(x)
    candidates = np.arange(count) if count <= EXACT else _candidates(x, y)
    is_candidate = np.zeros(count, dtype=bool)
    is_candidate[candidates] = True
    lengths = np.full(count, np.iinfo(np.int64).max)
    costs = np.full(count, np.inf)
    before = np.full(count, -1)
    lengths[0], costs[0] = 1, 0.0
    sums = _Sums(x, y)
    for start in candidates[:-1]:
        if lengths[start] >= most:  # another chord would be one too many
            continue
        ends = _chord_ends(x, y, int(start), error)
        ends = ends[is_candidate[ends]]
        cost = costs[start] + sums.squares(int(start), ends)
        length = lengths[start] + 1
        better = (length < lengths[ends]) | ((length == lengths[ends]) & (cost < costs[ends]))
        ends, cost = ends[better], cost[better]
        lengths[ends], costs[ends], before[ends] = length, cost, start
    if before[-1] < 0:
        return None
    path = [count - 1]
    while path[-1]:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])


def _chord_ends(x: Array, y: Array, start: int, error: float) -> NDArray[np.intp]:
    """Return the ends of all chords from a point that stay within the error of the points below them."""
    least, greatest = -np.inf, np.inf
    found: list[NDArray[np.intp]] = []
    place, size = start + 1, _CHUNK
    while place < len(x) and least <= greatest:
        run, rise = x[place : place + size] - x[start], y[place : place + size] - y[start]
        # the interval of slopes *before* each point: the end of a chord lies on the chord
        lower = np.maximum.accumulate(np.concatenate(([least], (rise - error) / run)))
        upper = np.minimum.accumulate(np.concatenate(([greatest], (rise + error) / run)))
        slope = rise / run
        found.append(place + np.flatnonzero((lower[:-1] <= slope) & (slope <= upper[:-1])))
        least, greatest = lower[-1], upper[-1]
        place, size = place + size, 2 * size
    return np.concatenate(found)


class _Sums:
    """Sums over points, from which the squared differences of a chord follow at once."""

    def __init__(self, x: Array, y: Array) -> None:
        self._x, self._y = x - np.mean(x), y - np.mean(y)
        terms = (self._x, self._y, self._x * self._x, self._x * self._y, self._y * self._y)
        self._sums = [np.concatenate(([0.0], np.cumsum(term))) for term in terms]

    def squares(self, start: int, ends: NDArray[np.intp]) -> Array:
        """Return the sum of squared differences from the chords of one point to others; only to compare them."""
        x0, y0 = self._x[start], self._y[start]
        slope = (self._y[ends] - y0) / (self._x[ends] - x0)
        x, y, xx, xy, yy = (sums[ends + 1] - sums[start] for sums in self._sums)
        number = ends + 1 - start
        rise = yy - 2 * y0 * y + number * y0 * y0
        mixed = xy - x0 * y - y0 * x + number * x0 * y0
        run = xx - 2 * x0 * x + number * x0 * x0
        return np.maximum(rise - 2 * slope * mixed + slope * slope * run, 0.0)


def _candidates(x: Array, y: Array) -> NDArray[np.intp]:
    """Choose evenly spaced points, and those at which the chord between chosen ones is farthest away.

    The choice does not depend on the error: then a larger error never needs more points.
    """
    count = len(x)
    chosen = np.unique(np.linspace(0, count - 1, EXACT // 2).round().astype(np.intp))
    gaps = [_farthest(x, y, int(a), int(b)) for a, b in pairwise(chosen)]
    added: list[int] = []
    while gaps and len(chosen) + len(added) < EXACT:
        worst = max(range(len(gaps)), key=lambda each: gaps[each][0])
        distance, first, middle, last = gaps.pop(worst)
        if distance <= 0.0:
            break
        added.append(middle)
        gaps += [_farthest(x, y, first, middle), _farthest(x, y, middle, last)]
    return np.unique(np.concatenate((chosen, np.array(added, dtype=np.intp))))


def _farthest(x: Array, y: Array, first: int, last: int) -> tuple[float, int, int, int]:
    """Return the largest distance from a chord to the points below it, its first point, the farthest, and the last."""
    if last - first < 2:
        return -1.0, first, first, last
    inner = slice(first + 1, last)
    slope = (y[last] - y[first]) / (x[last] - x[first])
    distance = np.abs(y[inner] - y[first] - slope * (x[inner] - x[first]))
    worst = int(np.argmax(distance))
    return float(distance[worst]), first, first + 1 + worst, last
