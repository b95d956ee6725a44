"""Placement of labels next to points, and of close-ups of dense regions, in free places of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from gapwalk.plot.style import CLUSTER, GREY, points, stroke

_SIZE = 7.5  # points
_DIRECTIONS = np.deg2rad(np.arange(0, 360, 22.5))
_DISTANCES = np.array([8.0, 13.0, 19.0, 27.0])  # of a label from its symbol, in points
_SYMBOL = 4.0  # half the width of a symbol, in points
_WORST = 18.0  # cost above which a label is omitted, because it would hide too much: the legend explains its symbol

_NEAR = 20.0  # distance of two symbols below which they are close together, in points
_CROWD = 4  # fewest close symbols for a close-up
_GAIN = 1.6  # smallest magnification of a close-up
_SIZES = ((0.56, 0.6), (0.5, 0.55), (0.44, 0.5), (0.38, 0.44), (0.32, 0.38))  # of the close-up, in widths of the axes
_MARGIN = (0.055, 0.075)  # for the numbers left of the close-up and below it


MANY = 40
"""Special points of a picture beyond which those that would lie on one another become one mark with their number."""

_TICKS = 2.5  # points between two ticks, so that both are seen
_LEAST = 3  # points of such a cluster
_APART = (
    8.0,
    12.0,
    16.5,
)  # points between two symbols, a symbol and a cluster, and two clusters, so that both are seen


class Label(NamedTuple):
    """A text for a point of the picture, in its data coordinates."""

    text: str
    x: float
    y: float


def place_labels(ax: Axes, labels: list[Label], curve: NDArray[np.float64], symbols: NDArray[np.float64]) -> None:
    """Write labels into a picture with final limits and layout.

    Shapes: `curve`, `symbols` (points, 2).
    """
    unit = ax.figure.dpi / 72.0  # pixels in a point
    inside = ax.get_window_extent()
    line = _clipped(_dense(ax.transData.transform(curve), 2.0 * unit), inside)
    dots = _clipped(ax.transData.transform(symbols), inside)
    taken = [child.get_window_extent() for child in ax.child_axes]
    boxes = [(box.x0, box.y0, box.x1, box.y1) for box in taken]
    shifts = np.column_stack((np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)))
    for label in labels:
        anchor = ax.transData.transform((label.x, label.y))
        half = np.array([0.33 * points(_SIZE) * len(label.text) + 0.5, 0.5 * points(_SIZE)]) * unit
        distances = np.repeat(_DISTANCES, len(shifts))
        directions = np.tile(shifts, (len(_DISTANCES), 1))
        centers = anchor + directions * (distances[:, None] * unit + half * np.abs(directions) - 0.3 * half)
        low, high = centers - half, centers + half
        costs = _hits(line, low, high, 1.5 * unit) + 4.0 * _hits(dots, low, high, _SYMBOL * unit)
        costs += 0.35 * (distances - _DISTANCES[0])
        for box in boxes:
            costs += 100.0 * ((low < box[2:]) & (high > box[:2])).all(axis=1)
        costs += 100.0 * ((low < inside.p0) | (high > inside.p1)).any(axis=1)
        best = int(np.argmin(costs))
        if costs[best] < _WORST:
            boxes.append((*low[best], *high[best]))
            _write(ax, label, (centers[best] - anchor) / unit, leader=distances[best] > _DISTANCES[1])


def clusters_of(ax: Axes, symbols: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Return the groups of symbols that would lie on one another in a picture with final limits, as their indices.

    Symbols closer than they are wide are merged into their middle, again and again, until no two marks touch.

    Shapes: `symbols` (points, 2).
    """
    places = ax.transData.transform(symbols) * (72.0 / ax.figure.dpi)
    groups = [np.array([number]) for number in range(len(places))]
    merged = True
    while merged:
        merged, kept = False, list[NDArray[np.intp]]()
        middles, sizes = np.empty((len(groups), 2)), np.zeros(len(groups), dtype=int)
        for group in groups:
            middle, count = places[group].mean(axis=0), len(kept)
            large = (sizes[:count] >= _LEAST).astype(int) + int(len(group) >= _LEAST)
            away = np.hypot(*(middles[:count] - middle).T) / np.take(_APART, large)
            if count and away.min() < 1.0:
                nearest, merged = int(np.argmin(away)), True
                kept[nearest] = np.concatenate((kept[nearest], group))
                middles[nearest], sizes[nearest] = places[kept[nearest]].mean(axis=0), len(kept[nearest])
            else:
                middles[count], sizes[count] = middle, len(group)
                kept.append(group)
        groups = kept
    return [group for group in groups if len(group) >= _LEAST]


def apart(ax: Axes, places: NDArray[np.float64]) -> list[int]:
    """Return the indices of ticks that can be told apart in a picture with final limits, in their order.

    Shapes: `places` (points, 2).
    """
    spots = ax.transData.transform(places) * (72.0 / ax.figure.dpi)
    kept: list[int] = []
    for number, place in enumerate(spots):
        if not kept or np.hypot(*(spots[kept] - place).T).min() >= _TICKS:
            kept.append(number)
    return kept


def draw_clusters(ax: Axes, symbols: NDArray[np.float64], clusters: Sequence[NDArray[np.intp]]) -> NDArray[np.float64]:
    """Draw a mark with a number in place of each cluster; return the places of the marks, shape (clusters, 2)."""
    middles = [ax.transData.transform(symbols[cluster]).mean(axis=0) for cluster in clusters]
    places = ax.transData.inverted().transform(np.reshape(middles, (-1, 2)))
    ax.plot(*places.T, zorder=5.5, **CLUSTER.options())
    for place, cluster in zip(places, clusters, strict=True):
        text = str(len(cluster))
        size = points(_SIZE * (0.9 if len(text) < 3 else 0.68))
        ax.annotate(text, tuple(place), ha="center", va="center_baseline", fontsize=size, zorder=5.6)
    return places


def _write(ax: Axes, label: Label, shift: NDArray[np.float64], leader: bool) -> None:
    line = {"arrowstyle": "-", "lw": 0.5, "color": GREY, "shrinkA": 0, "shrinkB": 2.5}
    ax.annotate(
        label.text,
        (label.x, label.y),
        xytext=(float(shift[0]), float(shift[1])),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=points(_SIZE),
        zorder=6,
        arrowprops=line if leader else None,
    )


def _hits(points: NDArray[np.float64], low, high, margin: float) -> NDArray[np.float64]:
    """Count the points in each box, with a margin."""
    x, y = points[:, 0], points[:, 1]
    hit = (x > low[:, :1] - margin) & (x < high[:, :1] + margin)
    hit &= (y > low[:, 1:] - margin) & (y < high[:, 1:] + margin)
    return np.count_nonzero(hit, axis=1).astype(float)


def _dense(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Interpolate points at even distances along a line, or along several with rows of nan between them."""
    gaps = np.flatnonzero(np.isnan(points[:, 0]))
    if len(gaps):
        parts = [part[~np.isnan(part[:, 0])] for part in np.split(points, gaps)]
        return np.vstack([_dense(part, spacing) for part in parts if len(part)])
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    even = np.arange(0.0, lengths[-1] + spacing, spacing)
    return np.column_stack([np.interp(even, lengths, points[:, i]) for i in (0, 1)])


def _clipped(points: NDArray[np.float64], box) -> NDArray[np.float64]:
    return points[((points > box.p0 - 50) & (points < box.p1 + 50)).all(axis=1)]


class Region(NamedTuple):
    """A part of a picture, in data coordinates."""

    left: float
    right: float
    low: float
    high: float

    def holds(self, x: float, y: float) -> bool:
        """Return True if a point lies inside."""
        return self.left <= x <= self.right and self.low <= y <= self.high


def crowded_region(ax: Axes, symbols: NDArray[np.float64]) -> Region | None:
    """Find the region with the most symbols close together; None if there are too few."""
    if len(symbols) < _CROWD:
        return None
    pixels = ax.transData.transform(symbols)
    reach = _NEAR * ax.figure.dpi / 72.0
    near = np.hypot(*(pixels[:, None] - pixels[None]).transpose(2, 0, 1)) < reach
    _, groups = connected_components(near, directed=False)  # chains of symbols that are near
    largest = np.flatnonzero(groups == np.argmax(np.bincount(groups)))
    if len(largest) < _CROWD:
        return None
    corner, opposite = pixels[largest].min(axis=0), pixels[largest].max(axis=0)
    pad = np.maximum(0.14 * (opposite - corner), 8.0)
    (left, low), (right, high) = ax.transData.inverted().transform([corner - pad, opposite + pad])
    return Region(float(left), float(right), float(low), float(high))


def draw_closeup(ax: Axes, region: Region, curve: NDArray[np.float64]) -> Axes | None:
    """Create empty axes for a region in the largest free place of the picture; None if no place is large enough.

    Shapes: `curve` (points, 2).
    """
    inside = ax.transAxes.inverted()
    line = inside.transform(ax.transData.transform(curve))
    (left, low), (right, high) = inside.transform(
        ax.transData.transform([(region.left, region.low), (region.right, region.high)])
    )
    for width, height in _SIZES:
        if min(width / (right - left), height / (high - low)) < _GAIN:
            continue
        place = _free_place(line, width, height)
        if place is not None:
            closeup = ax.inset_axes((*place, width, height), xlim=region[:2], ylim=region[2:])
            closeup.tick_params(labelsize=points(7), length=2.5)
            closeup.set_autoscale_on(False)
            _connect(ax, region, closeup)
            return closeup
    return None


def _connect(ax: Axes, region: Region, closeup: Axes) -> None:
    """Draw a frame around the region, and a line between its nearest corner and that of the close-up."""
    size = (region.right - region.left, region.high - region.low)
    ax.add_patch(Rectangle((region.left, region.low), *size, fill=False, edgecolor=GREY, linewidth=0.6, zorder=4))
    corners = [(x, y) for x in (region.left, region.right) for y in (region.low, region.high)]
    here, there = ax.transData.transform(corners), closeup.get_window_extent().corners()
    distances = np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(int(np.argmin(distances)), distances.shape)
    line = ax.transData.inverted().transform([here[i], there[j]])
    ax.plot(*line.T, **stroke(GREY, 0.6), zorder=1, scalex=False, scaley=False)


def _free_place(line: NDArray[np.float64], width: float, height: float) -> tuple[float, float] | None:
    """Find the lower left corner of a free place, as far up and to the right as possible."""
    for y in np.arange(0.97 - height, 0.05, -0.02):
        for x in np.arange(0.975 - width, 0.05, -0.02):
            hit = (line[:, 0] > x - _MARGIN[0]) & (line[:, 0] < x + width + 0.015)
            hit &= (line[:, 1] > y - _MARGIN[1]) & (line[:, 1] < y + height + 0.02)
            if not hit.any():
                return float(x), float(y)
    return None
