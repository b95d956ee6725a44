"""A close-up in a free corner of a picture, of the place where special points crowd."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from gapwalk.plot.size import points
from gapwalk.plot.style import GREY

_NEAR = 20.0  # distance of two symbols that crowd, in points
_CROWD = 4  # symbols from which a crowd is worth a close-up
_GAIN = 1.6  # the least magnification that is
_SIZES = ((0.56, 0.6), (0.5, 0.55), (0.44, 0.5), (0.38, 0.44), (0.32, 0.38))  # of the close-up, in widths of the axes
_MARGIN = (0.055, 0.075)  # for its numbers, left of it and below it


class Region(NamedTuple):
    """A part of a picture, in data coordinates."""

    left: float
    right: float
    low: float
    high: float

    def holds(self, x: float, y: float) -> bool:
        """Whether a point lies inside."""
        return self.left <= x <= self.right and self.low <= y <= self.high


def crowded_region(ax: Axes, symbols: NDArray[np.float64]) -> Region | None:
    """Where most symbols crowd, or None if they do not."""
    if len(symbols) < _CROWD:
        return None
    pixels = ax.transData.transform(symbols)
    reach = _NEAR * ax.figure.dpi / 72.0
    near = np.hypot(*(pixels[:, None] - pixels[None]).transpose(2, 0, 1)) < reach
    groups = _groups(near)
    largest = max(groups, key=len)
    if len(largest) < _CROWD:
        return None
    corner, opposite = pixels[largest].min(axis=0), pixels[largest].max(axis=0)
    pad = np.maximum(0.14 * (opposite - corner), 8.0)
    (left, low), (right, high) = ax.transData.inverted().transform([corner - pad, opposite + pad])
    return Region(float(left), float(right), float(low), float(high))


def draw_closeup(ax: Axes, region: Region, curve: NDArray[np.float64]) -> Axes | None:
    """Empty axes for a region in the largest free place of the picture; None if there is none large enough.

    Parameters
    ----------
    ax
        The axes of the whole picture.
    region
        What will be drawn in the new ones.
    curve : shape (points, 2)
        What must not be covered, in data coordinates.
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
    """A frame round the region, and a line from it to the close-up between the corners that are nearest."""
    size = (region.right - region.left, region.high - region.low)
    ax.add_patch(Rectangle((region.left, region.low), *size, fill=False, edgecolor=GREY, linewidth=0.6, zorder=4))
    corners = [(x, y) for x in (region.left, region.right) for y in (region.low, region.high)]
    here, there = ax.transData.transform(corners), closeup.get_window_extent().corners()
    distances = np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(int(np.argmin(distances)), distances.shape)
    line = ax.transData.inverted().transform([here[i], there[j]])
    ax.plot(*line.T, color=GREY, linewidth=0.6, zorder=1, scalex=False, scaley=False)


def _free_place(line: NDArray[np.float64], width: float, height: float) -> tuple[float, float] | None:
    """Lower left corner of a free place, as far up and to the right as possible."""
    for y in np.arange(0.97 - height, 0.05, -0.02):
        for x in np.arange(0.975 - width, 0.05, -0.02):
            hit = (line[:, 0] > x - _MARGIN[0]) & (line[:, 0] < x + width + 0.015)
            hit &= (line[:, 1] > y - _MARGIN[1]) & (line[:, 1] < y + height + 0.02)
            if not hit.any():
                return float(x), float(y)
    return None


def _groups(near: NDArray[np.bool_]) -> list[list[int]]:
    """Groups of points that hang together by being near."""
    left, groups = set(range(len(near))), []
    while left:
        group, fresh = [], [left.pop()]
        while fresh:
            group.append(fresh.pop())
            joined = {int(i) for i in np.flatnonzero(near[group[-1]])} & left
            left -= joined
            fresh += joined
        groups.append(group)
    return groups
