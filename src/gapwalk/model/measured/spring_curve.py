"""A measured spring: a piecewise polynomial force through points of a measured curve, in pieces between corners.

The force is measured from the piece that contains the deflection 0 outwards, so that no piece is the difference of
large numbers: corners at positive deflections act to the right, those at negative ones to the left. Points that are
the same on both sides of 0 make a curve that is exactly so: its corners are pairs of opposite numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.bounds import check
from gapwalk.model.measured.measured_table import finite_row

# Thinning of a measured curve: the fewest of its points whose polyline stays within an error of all of them.

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


# The points of a measured curve in order: sorted, joined where they repeat, and refused where they are two curves.

MAX_STEPS = 4
"""Largest number of steps of a curve."""

_RUNS = 4  # changes of direction of a loop: from rest to one end, to the other, and back
_SAME = 1e-12  # a share of the largest number
_NEAR = 1e-9  # a share of the range of the deflection
_SMALLEST = 1e-30
# Rises and falls in turn, and bends up and down in turn, of which noise or two branches are suspected; and the least
# bend that counts: the distance of a corner from the chord of its neighbours, as a share of the largest force.
_LEAST_TURNS, _LEAST_SWAPS, _BEND = 5, 7, 2e-3


@dataclass(frozen=True, eq=False)
class CurvePoints:
    """The points of a single-valued curve, and its steps."""

    x: Array  #: shape (points,): Deflections, increasing.
    #: left, right: shape (points,): The forces at which the curve arrives and leaves; they differ at a step.
    left: Array
    right: Array
    scale: float  #: The largest force.

    @property
    def steps(self) -> NDArray[np.intp]:
        """Indices of the points at which the curve has a step."""
        return np.flatnonzero(self.left != self.right)

    @property
    def is_odd(self) -> bool:
        """True if the curve is exactly the same on both sides of the deflection 0."""
        return np.array_equal(self.x, -self.x[::-1]) and np.array_equal(self.left, -self.right[::-1])

    def without_rounding(self) -> CurvePoints:
        """Return an odd curve if it is odd but for rounding of the numbers in a file, as in most data sheets."""
        x, left, right = self.x, self.left, self.right
        bend = np.max(np.abs(left + right[::-1]))
        if np.max(np.abs(x + x[::-1])) > _SAME * x[-1] or bend > _SAME * self.scale:
            return self
        return CurvePoints(0.5 * (x - x[::-1]), 0.5 * (left - right[::-1]), 0.5 * (right - left[::-1]), self.scale)

    def right_half(self) -> CurvePoints:
        """Return an odd curve from the deflection 0 on, where its force is 0 unless it has a step there."""
        keep = self.x > 0.0
        centre = self.right[self.x == 0.0] if np.any(self.x == 0.0) else np.zeros(1)
        return CurvePoints(
            np.concatenate(([0.0], self.x[keep])),
            np.concatenate((centre, self.left[keep])),
            np.concatenate((centre, self.right[keep])),
            self.scale,
        )

    @property
    def sections(self) -> list[tuple[Array, Array]]:
        """Deflections and forces between the steps."""
        ends = [0, *self.steps.tolist(), len(self.x) - 1]
        found = []
        for first, last in pairwise(ends):
            force = self.right[first : last + 1].copy()
            force[-1] = self.left[last]
            found.append((self.x[first : last + 1], force))
        return found


def curve_points(deflection: object, force: object, error: float) -> CurvePoints:
    """Put the points of a curve in order; both rows have the shape (points,)."""
    x, y = finite_row(deflection, "deflections of a curve"), finite_row(force, "forces of a curve")
    if len(x) != len(y):
        raise ModelError(f"there are {len(x)} deflections, but {len(y)} forces; a point of a curve has one of each")
    scale = float(np.max(np.abs(y), initial=0.0))
    width = float(np.max(x) / 2.0 - np.min(x) / 2.0) if len(x) else 0.0  # half of it, which is always a number
    if not width > 0.0:
        raise ModelError("a curve needs points at two different deflections at least")
    if not scale > 0.0:
        raise ModelError("the force is zero at all points; leave the curve out")
    if not all(_SMALLEST < number < 1.0 / _SMALLEST for number in (width, scale, np.max(np.abs(x)))):
        raise ModelError("its numbers are too large or too small; write them in other units")
    matter = error * scale
    runs = _runs(x)
    if len(runs) > 1:
        _check_branches(x, y, runs, matter)
    elif x[0] > x[-1]:  # measured backwards: so are its steps
        x, y = x[::-1], y[::-1]
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    new = np.diff(x, prepend=-np.inf) > _NEAR * width
    x = x[new][np.cumsum(new) - 1]  # deflections that differ by rounding only are one
    places, first, counts = np.unique(x, return_index=True, return_counts=True)
    left, right = y[first].copy(), y[first + counts - 1].copy()
    steps = 0
    for at in np.flatnonzero(counts > 1):
        here = y[first[at] : first[at] + counts[at]]
        if np.ptp(here) <= matter:
            left[at] = right[at] = np.mean(here)
        elif counts[at] == 2 and len(runs) == 1:
            steps += 1
        else:
            raise ModelError(
                f"there are {counts[at]} points at the deflection {places[at]:g}, with forces from {here.min():g} to "
                f"{here.max():g}; give their mean, or two points for a step (a preload)"
            )
    if steps > MAX_STEPS:
        raise ModelError(
            f"at {steps} deflections there are two points with different forces; two points are a step (a preload), of "
            f"which there may be {MAX_STEPS}. If they are repeated measurements, give their mean, or write an error "
            "that is larger than their difference"
        )
    if left[0] != right[0] or left[-1] != right[-1]:
        end = places[0] if left[0] != right[0] else places[-1]
        raise ModelError(
            f"the curve has a step at its end, at the deflection {end:g}; a step needs a point on each side of it, as "
            "in -1,0 then 0,0 then 0,5 then 1,9"
        )
    return CurvePoints(places, left, right, scale).without_rounding()


def check_zigzag(x: Array, force: Array, scale: float) -> None:
    """Refuse a thinned curve of which most corners go up and down in turn, as those of noise or of two branches."""
    corners = len(force) - 2
    rises = np.diff(force)
    turns = _changes(rises[rises != 0.0])
    chord = force[:-2] + (force[2:] - force[:-2]) * ((x[1:-1] - x[:-2]) / (x[2:] - x[:-2]))
    bends = force[1:-1] - chord
    swaps = _changes(bends[np.abs(bends) > _BEND * scale])
    if (turns >= _LEAST_TURNS and 2 * turns > corners) or (swaps >= _LEAST_SWAPS and 2 * swaps > corners):
        how = f"rises and falls {turns}" if turns >= _LEAST_TURNS else f"bends up and down {swaps}"
        raise ModelError(
            f"the force {how} times in turn: these seem to be two branches (loading and unloading) that were sorted "
            "together, or noise; give the mean curve, or write an error that is larger than the noise"
        )


def _changes(numbers: Array) -> int:
    """Count the changes of the sign."""
    return int(np.count_nonzero(np.sign(numbers[1:]) != np.sign(numbers[:-1])))


def _runs(x: Array) -> list[slice]:
    """Divide the points, in their order, into runs in which the deflection does not change its direction."""
    begin, direction, runs = 0, 0.0, []
    for place in np.flatnonzero(np.diff(x)) + 1:
        turn = np.sign(x[place] - x[place - 1])
        if direction and turn != direction:
            runs.append(slice(begin, int(place)))
            begin = int(place) - 1  # the point of return belongs to both
        direction = turn
    return [*runs, slice(begin, len(x))]


def _check_branches(x: Array, y: Array, runs: list[slice], matter: float) -> None:
    """Refuse a curve whose deflection goes back and forth, unless the forces of all its runs agree."""
    if len(runs) > _RUNS:
        raise ModelError(
            f"the deflection changes its direction {len(runs) - 1} times; sort the lines by deflection, and if the "
            "curve was measured back and forth, give the mean curve"
        )
    worst, at = 0.0, 0.0
    for one in runs:
        for other in runs:
            xs, ys = _increasing(x[other], y[other])
            inside = (x[one] >= xs[0]) & (x[one] <= xs[-1])
            if one is other or not inside.any():
                continue
            difference = np.abs(y[one][inside] - np.interp(x[one][inside], xs, ys))
            difference = np.maximum(difference - _chord_error(xs, ys, x[one][inside]), 0.0)
            if difference.max() > worst:
                worst, at = float(difference.max()), float(x[one][inside][np.argmax(difference)])
    if worst > matter:
        raise ModelError(
            f"this curve has two branches (loading and unloading), which differ by {worst:g} at the deflection {at:g}: "
            "give the mean curve; hysteresis is friction, which a curve cannot hold. If its lines are only out of "
            "order, sort them by deflection"
        )


def _chord_error(x: Array, y: Array, at: Array) -> Array:
    """Estimate how far a curve is from the chord of two of its points: as its points are from those of neighbours."""
    bend = np.zeros(len(x))
    if len(x) > 2:
        chord = y[:-2] + (y[2:] - y[:-2]) * ((x[1:-1] - x[:-2]) / np.maximum(x[2:] - x[:-2], np.finfo(float).tiny))
        bend[1:-1] = np.abs(y[1:-1] - chord)
    right = np.clip(np.searchsorted(x, at), 1, len(x) - 1)
    return np.maximum(bend[right - 1], bend[right])


def _increasing(x: Array, y: Array) -> tuple[Array, Array]:
    return (x, y) if x[0] <= x[-1] else (x[::-1], y[::-1])


Polynomial = tuple[float, float, float, float]
"""Coefficients of 1, d, d**2 and d**3."""

MAX_CORNERS = 50
"""Largest number of corners of a curve."""
ERROR = 1e-3
"""Default of the largest error of thinning, as a share of the largest force."""

_ROUNDING = 1e-14  # as a share of the largest force; smaller differences are none
_LOST = 1e-10  # as a share of the largest force: what rounding may change
_TRIALS = 5  # of an error that needs few enough corners


@dataclass(frozen=True, slots=True)
class Corner:
    """A place where the polynomial of a curve changes.

    With ``d = x - position``, the force changes by ``step + slope * d + quadratic * d**2 + cubic * d**3`` where
    ``side * d > 0``.
    """

    position: float  #: Deflection of the corner.
    side: int  #: +1 if the change acts to its right, -1 if it acts to its left.
    step: float = 0.0  #: Change of the force at the corner itself, from within outwards.
    #: slope, quadratic, cubic: Changes of the coefficients.
    slope: float = 0.0
    quadratic: float = 0.0
    cubic: float = 0.0

    @property
    def change(self) -> Polynomial:
        """The change of the force as a polynomial of ``x - position``."""
        return self.step, self.slope, self.quadratic, self.cubic


@dataclass(frozen=True)
class Curve:
    """The force of a spring over its deflection, a piecewise polynomial."""

    kind: str  #: ``"linear"`` or ``"cubic"``.
    #: Coefficients of 1, x, x**2 and x**3 of the piece that contains the deflection 0. If 0 is a corner, it is the
    #: piece to the left of it.
    base: Polynomial
    #: The corners, by increasing position: those at negative positions act to the left, the others to the right.
    corners: tuple[Corner, ...]
    #: first, last: Smallest and largest measured deflection. Beyond them the force continues along a line.
    first: float
    last: float
    thinning_error: float  #: Largest difference from the measured points, as a share of the largest measured force.
    points: int  #: Number of measured points.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        places = [each.position for each in self.corners]
        numbers = [*self.base, self.first, self.last, self.thinning_error, *places]
        numbers += [number for each in self.corners for number in each.change]
        if not np.isfinite(numbers).all() or not self.first < self.last:
            raise ValueError("a curve needs finite numbers, and deflections that increase")
        if sorted({*places}) != places or any(each.side != (-1 if each.position < 0.0 else 1) for each in self.corners):
            raise ValueError("the corners of a curve increase, and act away from the deflection 0")

    @property
    def words(self) -> str:
        """Describe the pieces of the curve in one line."""
        steps = [each for each in self.corners if each.step]
        of_steps = f", {len(steps)} of them with a step" if steps else ""
        return (
            f"{self.kind}, {len(self.corners)} corners{of_steps}, within {100.0 * self.thinning_error:.2g} % of the "
            f"largest force at {self.points:,} points"
        )

    def force(self, deflection: ArrayLike) -> Any:
        """Return the force at deflections, real or complex; at a step that on the inner side, towards 0."""
        return self._sum(deflection, _value)

    def slope(self, deflection: ArrayLike) -> Any:
        """Return the derivative of the force by the deflection; at a corner, that on the inner side."""
        return self._sum(deflection, _slope)

    def covers(self, deflection: ArrayLike) -> bool:
        """Return True if all deflections are within the measured ones."""
        x = np.asarray(deflection)
        return bool(np.all((x >= self.first) & (x <= self.last)))

    def _sum(self, deflection: ArrayLike, part: Any) -> Any:
        x = np.asarray(deflection)
        total = part(self.base, x)
        for corner in sorted(self.corners, key=lambda each: abs(each.position)):  # opposite sums are exactly so
            depth = x - corner.position
            total = total + np.where(corner.side * depth.real > 0.0, part(corner.change, depth), 0.0)
        return total[()]


def spring_curve(
    deflection: ArrayLike, force: ArrayLike, kind: Literal["linear", "cubic"] = "linear", error: float = ERROR
) -> Curve:
    """Make the curve of a spring from measured points.

    Parameters
    ----------
    deflection, force : shape (points,)
        The points, in any units. Two points with the same deflection and different forces are a step (a preload), in
        the order of the file.
    kind
        ``"linear"`` for straight lines between points. ``"cubic"`` for a smooth curve that rises and falls only where
        its points do (Fritsch and Butland 1984, as in `scipy.interpolate.PchipInterpolator`); it continues beyond its
        ends along lines.
    error
        The largest difference from the points, as a share of the largest force. The straight lines are the fewest that
        stay within it.

    Returns
    -------
    Curve
        The curve.

    Raises
    ------
    ModelError
        If the points are no curve (see `curve_points`), need more than 50 corners (the message gives the error to
        write), or are so close to each other that the sum over the corners would lose digits.

    Examples
    --------
    A clearance of 2 on both sides:

    >>> curve = gw.laws.spring_curve([-4, -2, 2, 4], [-10, 0, 0, 10])
    >>> curve.force([-3.0, 1.0, 5.0])
    array([-5.,  0., 15.])
    >>> [(each.position, each.slope) for each in curve.corners]
    [(-2.0, 5.0), (2.0, 5.0)]
    """
    if kind not in ("linear", "cubic"):
        raise ModelError(f'kind is {kind!r}; a curve is "linear" or "cubic"')
    check("error", error, Annotated[float, Ge(0), Le(0.5)])
    data = curve_points(deflection, force, error)
    base, corners = (_lines if kind == "linear" else _cubics)(data, error)
    if data.is_odd:
        base, corners = _exactly_odd(base, corners)
    first, last = float(data.x[0]), float(data.x[-1])
    curve = Curve(kind, base, corners, first, last, 0.0, np.size(deflection))
    difference = np.abs(curve.force(data.x) - np.where(data.x < 0.0, data.right, data.left))
    kept = np.searchsorted(data.x, [first, *(each.position for each in corners), last]).clip(max=len(data.x) - 1)
    if (lost := float(np.max(difference[kept]))) > _LOST * data.scale:  # where the pieces go through the points
        close = int(np.argmin(np.diff(data.x[np.unique(kept)])))
        a, b = data.x[np.unique(kept)][close : close + 2]
        raise ModelError(
            f"rounding changes the force by {lost:.1g}, since some points are very close to each other, as at {a:.10g} "
            f"and {b:.10g}; give their mean, or a larger error, so that one is left out"
        )
    return replace(curve, thinning_error=float(np.max(difference)) / data.scale)


Piece = tuple[float, Polynomial]
"""A place, and the coefficients of a polynomial about it."""
Break = tuple[float, int]
"""A place between two pieces, and the first of its coefficients that may change: 0 at a step, 2 in a smooth curve."""


def _lines(data: CurvePoints, error: float) -> tuple[Polynomial, tuple[Corner, ...]]:
    """Return the fewest straight lines: the one at the deflection 0, and the corners."""
    chosen = _fewest(data, error)
    if chosen is None:
        raise _too_many(lambda trial: _fewest(data, trial) is not None, error)
    breaks: list[Break] = []
    pieces: list[Piece] = []
    for x, y in chosen:
        check_zigzag(x, y, data.scale)
        slopes = np.diff(y) / np.diff(x)
        pieces += [(float(a), (float(b), float(slope), 0.0, 0.0)) for a, b, slope in zip(x, y, slopes, strict=False)]
        breaks += [*((float(place), 1) for place in x[1:-1]), (float(x[-1]), 0)]  # between sections is a step
    return _from_within(breaks[:-1], pieces)


def _fewest(data: CurvePoints, error: float) -> list[tuple[Array, Array]] | None:
    """Return the points to keep of each section; None if there are too many corners."""
    if data.is_odd:
        return _fewest_of_odd(data, error)
    return _thinned(data.sections, max(error, _ROUNDING) * data.scale, MAX_CORNERS - len(data.steps))


def _thinned(sections: Sequence[tuple[Array, Array]], distance: float, left: int) -> list[tuple[Array, Array]] | None:
    """Return the points to keep of each section; None if there are more corners than are left."""
    found: list[tuple[Array, Array]] = []
    for x, y in sections:
        kept = thin_polyline(x, y, distance, left + 2)
        if kept is None:
            return None
        found.append((x[kept], y[kept]))
        left -= len(kept) - 2
    return found


def _fewest_of_odd(data: CurvePoints, error: float) -> list[tuple[Array, Array]] | None:
    """Return the points to keep of a curve that is the same on both sides of 0: opposite ones on both.

    A line over 0 then passes through the origin. So the origin is the first point of one half, and not kept.
    """
    half = data.right_half()
    left = (MAX_CORNERS - (half.right[0] != 0.0)) // 2 - len(half.steps)
    found = _thinned(half.sections, max(error, _ROUNDING) * data.scale, left)
    if found is None:
        return None
    opposite = [(-x[::-1], -y[::-1]) for x, y in reversed(found)]
    if half.right[0] != 0.0:
        return opposite + found
    (x, y), (before_x, before_y) = found[0], opposite[-1]
    centre = np.concatenate((before_x[:-1], x[1:])), np.concatenate((before_y[:-1], y[1:]))
    return [*opposite[:-1], centre, *found[1:]]


def _too_many(suffices: Any, error: float) -> ModelError:
    """Make the error for too many corners, with an error that suffices: a share written with two digits."""
    low, high = math.log(max(error, 1e-9)), 0.0
    for _ in range(_TRIALS + round(-math.log10(max(error, 1e-9)))):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if suffices(math.exp(middle)) else (middle, high)
    return _refusal(math.exp(high), error)


def _refusal(needed: float, error: float) -> ModelError:
    digits = 1 - math.floor(math.log10(needed))
    written = math.ceil(needed * 10**digits) / 10**digits
    reason = f"within {error:g} of the largest force the curve needs more than {MAX_CORNERS} corners"
    if written > 0.5:
        return ModelError(f"{reason}, and within half of it too; these points are noise, and no curve")
    return ModelError(f"{reason}; write error = {written:g}, or smooth its noise")


def _cubics(data: CurvePoints, error: float) -> tuple[Polynomial, tuple[Corner, ...]]:
    """Return a monotone cubic with the lines beyond its ends: the piece at the deflection 0, and the corners."""
    if len(data.steps):
        raise ModelError(
            f"the curve has a step at the deflection {data.x[data.steps[0]]:g} (two points with different forces), but "
            'a cubic curve is smooth; write kind = "linear", or leave out one of the two points'
        )
    x, y = data.x, data.left
    allowed = max(error, _ROUNDING) * data.scale
    kept, reached = _insert(x, y, allowed, odd=data.is_odd)
    if reached > allowed:
        raise _refusal(reached / data.scale, error)
    kept = _without_needless(x, y, kept, allowed, odd=data.is_odd)
    check_zigzag(x[kept], y[kept], data.scale)
    smooth = _monotone(x[kept], y[kept])
    slopes = smooth.derivative()(x[kept])
    pieces = [(float(x[0]), (float(y[0]), float(slopes[0]), 0.0, 0.0))]
    for place, (cubic, quadratic, slope, value) in zip(x[kept][:-1], smooth.c.T, strict=True):
        pieces.append((float(place), (float(value), float(slope), float(quadratic), float(cubic))))
    pieces.append((float(x[-1]), (float(y[-1]), float(slopes[-1]), 0.0, 0.0)))
    return _from_within([(float(place), 2) for place in x[kept]], pieces)


def _monotone(x: Array, y: Array) -> Any:
    from scipy.interpolate import PchipInterpolator  # only where curves are used

    return PchipInterpolator(x, y)


def _insert(x: Array, y: Array, allowed: float, *, odd: bool) -> tuple[list[int], float]:
    """Keep points until the cubic is within the allowed difference: each time the one that is farthest from it."""
    kept, reached = {0, len(x) - 1}, math.inf
    while True:
        places = sorted(kept)
        difference = np.abs(_monotone(x[places], y[places])(x) - y)
        difference[places] = 0.0
        worst = int(np.argmax(difference))
        reached = min(reached, float(difference[worst]))
        more = kept | {worst, len(x) - 1 - worst if odd else worst}
        if reached <= allowed or len(more) > MAX_CORNERS:
            return places, reached
        kept = more


def _without_needless(x: Array, y: Array, kept: list[int], allowed: float, *, odd: bool) -> list[int]:
    """Leave out each point (each pair of opposite ones) without which the cubic is within the difference too."""
    for place in kept[1:-1]:
        left_out = {place, len(x) - 1 - place if odd else place}
        fewer = [each for each in kept if each not in left_out]
        if np.max(np.abs(_monotone(x[fewer], y[fewer])(x) - y)) <= allowed:
            kept = fewer
    return kept


def _from_within(breaks: Sequence[Break], pieces: Sequence[Piece]) -> tuple[Polynomial, tuple[Corner, ...]]:
    """Write pieces as the one that contains 0, and the changes from it outwards."""
    middle = sum(place < 0.0 for place, _ in breaks)
    corners = []
    for index, (place, first) in enumerate(breaks):
        side = -1 if index < middle else 1
        left, right = (_about(place, piece) for piece in pieces[index : index + 2])
        # what does not change differs by rounding only
        change = [
            side * (b - a) + 0.0 if power >= first else 0.0
            for power, (a, b) in enumerate(zip(left, right, strict=True))
        ]
        corners.append(Corner(place, side, *change))
    return _about(0.0, pieces[middle]), tuple(corners)


def _exactly_odd(base: Polynomial, corners: Sequence[Corner]) -> tuple[Polynomial, tuple[Corner, ...]]:
    """Replace the corners on the left by the opposites of those on the right; so no rounding breaks the symmetry."""
    right = [each for each in corners if each.position > 0.0]
    left = [
        Corner(-each.position, -1, 0.0 - each.step, each.slope, 0.0 - each.quadratic, each.cubic)
        for each in reversed(right)
    ]
    centre = [Corner(0.0, 1, each.step, 0.0, each.quadratic) for each in corners if each.position == 0.0]
    step, quadratic = (centre[0].step, centre[0].quadratic) if centre else (0.0, 0.0)
    return (0.0 - 0.5 * step, base[1], 0.0 - 0.5 * quadratic, base[3]), (*left, *centre, *right)


def _about(place: float, piece: Piece) -> Polynomial:
    """Return the coefficients of a polynomial about another place."""
    origin, (value, slope, quadratic, cubic) = piece
    d = place - origin
    return (
        value + d * (slope + d * (quadratic + d * cubic)),
        slope + d * (2.0 * quadratic + d * 3.0 * cubic),
        quadratic + 3.0 * d * cubic,
        cubic,
    )


def _value(c: Polynomial, d: Any) -> Any:
    return c[0] + d * (c[1] + d * (c[2] + d * c[3]))


def _slope(c: Polynomial, d: Any) -> Any:
    return c[1] + d * (2.0 * c[2] + d * (3.0 * c[3]))
