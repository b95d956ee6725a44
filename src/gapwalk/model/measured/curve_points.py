"""The points of a measured curve in order: sorted, joined where they repeat, and refused where they are two curves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.measured.csv_columns import number_row

Array = NDArray[np.float64]

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
    """Put the points of a curve in order.

    Shapes: `deflection`, `force` (points,).
    """
    x, y = number_row(deflection, "deflections of a curve"), number_row(force, "forces of a curve")
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
    """Refuse a thinned curve if most of its corners are rises and falls, or bends up and down, in turn.

    Points of two branches that were sorted by their deflection, or noise, look like this.
    """
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
