"""The waterfall as a colour map: amplitude of each order along a branch."""

from __future__ import annotations

from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from gapwalk.attractor.waterfall import Waterfall
from gapwalk.plot.sheet import open_axes
from gapwalk.plot.size import takes_size
from gapwalk.plot.style import GREY, SIZE, in_style
from gapwalk.plot.words import order_words, parameter_words

_DEPTH = 1e-3  # smallest amplitude that has a colour, relative to the largest
_TICKS = 8
_COLOURS = "viridis_r"  # even in grey, and for any form of colour vision


@takes_size
def plot_waterfall(found: Waterfall, *, ax: Axes | None = None, depth: float = _DEPTH) -> Axes:
    """Draw the amplitudes of all orders along a branch as colours, on a logarithmic scale.

    Where the branch turns round, a dashed line stands, and the parameter goes back: the axis is the way along it.

    Parameters
    ----------
    found
        The waterfall.
    ax
        Where to draw; by default a new figure of pyplot.
    depth
        Smallest amplitude that has a colour, relative to the largest.
    """
    if ax is None:
        ax = open_axes(SIZE)
    with in_style():
        places, turns = _way(found.values)
        heights = found.amplitudes[:, 1:]
        largest = float(heights.max()) or 1.0
        spacing = float(found.orders[1]) if len(found.orders) > 1 else 1.0
        edges = np.append(found.orders[1:] - 0.5 * spacing, found.orders[-1] + 0.5 * spacing)
        mesh = ax.pcolormesh(
            _edges(places),
            edges,
            np.maximum(heights.T, 0.1 * depth * largest),
            norm=LogNorm(depth * largest, largest),
            cmap=mpl.colormaps[_COLOURS].with_extremes(under="white"),
            rasterized=True,
        )
        for turn in turns:
            ax.axvline(float(places[turn]), color=GREY, linewidth=0.8, linestyle=(0, (4, 2)))
        _mark(ax, found.values, places, turns)
        ax.grid(visible=False)
        ax.set_xlabel(parameter_words(found.parameter) + (", along the branch" if len(turns) else ""))
        ax.set_ylabel(order_words(found.turns))
        ax.figure.colorbar(mesh, ax=ax, label=f"amplitude of {found.signal}", pad=0.02, extend="min")
    return ax


def _way(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Place of each orbit on the way along the branch, and the orbits at which the parameter turns round."""
    steps = np.diff(values)
    places = np.concatenate(([0.0], np.cumsum(np.maximum(np.abs(steps), 1e-12))))
    turns = 1 + np.flatnonzero(steps[:-1] * steps[1:] < 0.0)
    return places, turns


def _edges(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Borders of the columns: half way between the orbits."""
    if len(places) == 1:
        return np.array([places[0] - 0.5, places[0] + 0.5])
    return np.concatenate((places[:1], 0.5 * (places[:-1] + places[1:]), places[-1:]))


def _mark(ax: Axes, values: NDArray[np.float64], places: NDArray[np.float64], turns: NDArray[np.intp]) -> None:
    """Ticks with the parameter's values: round ones between the turns."""
    ends = [0, *turns.tolist(), len(values) - 1]
    low, high = float(values.min()), float(values.max())
    rounds = MaxNLocator(_TICKS).tick_values(low, high)
    marks: list[tuple[float, str]] = []
    for first, last in pairwise(ends):
        part = slice(first, last + 1)
        order = np.argsort(values[part])
        inside = [v for v in rounds if values[part].min() <= v <= values[part].max()]
        at = np.interp(inside, values[part][order], places[part][order])
        marks += [(float(x), f"{v:.6g}") for x, v in zip(at, inside, strict=True)]
    marks.sort()
    apart = (places[-1] - places[0]) / 20 if len(places) > 1 else 1.0
    kept: list[tuple[float, str]] = []
    for mark in marks:
        if not kept or mark[0] - kept[-1][0] > apart:
            kept.append(mark)
    ax.set_xticks([x for x, _ in kept], [text for _, text in kept])
