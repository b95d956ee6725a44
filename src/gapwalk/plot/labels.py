"""Places for small labels beside points of a picture, clear of the curve, of the symbols and of one another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gapwalk.plot.size import points
from gapwalk.plot.style import GREY

_SIZE = 7.5  # points
_DIRECTIONS = np.deg2rad(np.arange(0, 360, 22.5))
_DISTANCES = np.array([8.0, 13.0, 19.0, 27.0])  # from the symbol, in points
_SYMBOL = 4.0  # half the width of a symbol, in points
_WORST = 18.0  # a label that would hide more than this is left out: the legend explains the symbol too


class Label(NamedTuple):
    """A text for a point of the picture, in its data coordinates."""

    text: str
    x: float
    y: float


def place_labels(ax: Axes, labels: list[Label], curve: NDArray[np.float64], symbols: NDArray[np.float64]) -> None:
    """Write labels into a picture whose limits and layout are final.

    Parameters
    ----------
    ax
        The axes.
    labels
        What to write, and beside which points.
    curve, symbols : shape (points, 2)
        What should stay visible, in data coordinates; rows of nan break the curve.
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
    """How many points lie in each box."""
    x, y = points[:, 0], points[:, 1]
    hit = (x > low[:, :1] - margin) & (x < high[:, :1] + margin)
    hit &= (y > low[:, 1:] - margin) & (y < high[:, 1:] + margin)
    return np.count_nonzero(hit, axis=1).astype(float)


def _dense(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Points at even distances along a line through `points`, or along several with rows of nan between them."""
    gaps = np.flatnonzero(np.isnan(points[:, 0]))
    if len(gaps):
        parts = [part[~np.isnan(part[:, 0])] for part in np.split(points, gaps)]
        return np.vstack([_dense(part, spacing) for part in parts if len(part)])
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    even = np.arange(0.0, lengths[-1] + spacing, spacing)
    return np.column_stack([np.interp(even, lengths, points[:, i]) for i in (0, 1)])


def _clipped(points: NDArray[np.float64], box) -> NDArray[np.float64]:
    return points[((points > box.p0 - 50) & (points < box.p1 + 50)).all(axis=1)]
