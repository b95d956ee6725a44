"""The picture of basins of attraction: the plane of initial states, each cell in the colour of its attractor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from gapwalk.attractor.attractor import AttractorKind
from gapwalk.attractor.basins import Basins
from gapwalk.attractor.sorting import RUNAWAY, UNRESOLVED
from gapwalk.errors import ModelError
from gapwalk.plot.legend import draw_fill_legend
from gapwalk.plot.sheet import NewFigure, new_sheet, open_axes
from gapwalk.plot.size import takes_size
from gapwalk.plot.style import BLACK, GREY, in_style
from gapwalk.plot.words import coordinate_words

SIZE = (6.6, 6.2)
"""Width and height of the picture, in inches."""

# From dark to light and of different hues (Okabe and Ito 2008), so that neighbours differ in grey as well.
_FILLS = ("#0b56a4", "#f3c55b", "#8fcdf1", "#d55e00", "#9adbc3", "#7a3b69", "#f0e442", "#cc79a7", "#00664b", "#c9c9c9")
_UNRESOLVED, _RUNAWAY = "#ffffff", "#3a3a3a"
_MARKERS = "osD^vPX*<>"
_STROBES = ("in the plane", "all", "none")
_IN_PLANE = 1e-6  # distance, relative to the size of the plane, at which a strobe lies in it


@takes_size
def plot_basins(found: Basins, *, ax: Axes | None = None, strobes: str = "in the plane") -> Axes:
    """Draw the basins of attraction in their plane.

    Parameters
    ----------
    found
        The basins.
    ax
        Where to draw; by default in a new figure of pyplot.
    strobes
        Which strobes of the attractors are marked: those that lie ``"in the plane"``, ``"all"`` of them, seen along
        the other components of the state, or ``"none"``.

    Raises
    ------
    ModelError
        For other words.
    """
    if strobes not in _STROBES:
        raise ModelError(f'strobes is {strobes!r}; write "in the plane", "all" or "none"')
    if ax is None:
        ax = open_axes(SIZE)
    (left, right), (bottom, top) = found.window.within
    colors = [_RUNAWAY, _UNRESOLVED, *(fill_of(index) for index in range(len(found.attractors)))]
    ax.imshow(
        found.labels - RUNAWAY,
        cmap=ListedColormap(colors),
        vmin=-0.5,
        vmax=len(colors) - 0.5,
        extent=(left, right, bottom, top),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        zorder=1,
    )
    ax.grid(visible=False)
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    ax.set_xlabel(f"{coordinate_words(found.window.across, found.system.units)} at the start")
    ax.set_ylabel(f"{coordinate_words(found.window.up, found.system.units)} at the start")
    marked = list(_draw_strobes(ax, found, strobes))
    _draw_legend(ax, found, marked)
    return ax


@takes_size
def draw_basins(found: Basins, title: str = "", *, strobes: str = "in the plane", on: NewFigure = new_sheet) -> Figure:
    """The picture of basins, by default without pyplot."""
    figure = on(SIZE)
    with in_style():
        ax = figure.add_subplot()
        ax.set_title(title.replace("$", r"\$"), wrap=True)
        plot_basins(found, ax=ax, strobes=strobes)
    return figure


def fill_of(index: int) -> str:
    """The colour of the basin of an attractor."""
    return _FILLS[index % len(_FILLS)]


def _draw_strobes(ax: Axes, found: Basins, which: str) -> Iterator[int]:
    """Mark strobes of orbits; the attractors of which some are marked."""
    first, second = (found.window.box.names.index(name) for name in (found.window.across, found.window.up))
    for index, attractor in enumerate(found.attractors):
        if attractor.kind is not AttractorKind.PERIODIC or which == "none":
            continue
        states = attractor.strobes if which == "all" else attractor.strobes[_in_plane(found, attractor.strobes)]
        points = states[:, [first, second]]
        if len(points):
            ax.plot(points[:, 0], points[:, 1], zorder=4, clip_on=True, **_marker(index))
            yield index


def _in_plane(found: Basins, states: NDArray[np.float64]) -> NDArray[np.bool_]:
    low, high = np.array(found.window.box.low), np.array(found.window.box.high)
    fixed = low == high
    return (np.abs(states - low)[:, fixed] <= _IN_PLANE * (high - low).max()).all(axis=1)


def _marker(index: int):
    return {
        "linestyle": "none",
        "marker": _MARKERS[index % len(_MARKERS)],
        "markersize": 6.0,
        "markerfacecolor": "white",
        "markeredgecolor": BLACK,
        "markeredgewidth": 1.0,
    }


def _draw_legend(ax: Axes, found: Basins, marked: list[int]) -> None:
    total = found.labels.size
    handles: list[Patch | Line2D] = [
        Patch(facecolor=fill_of(index), edgecolor=GREY, linewidth=0.5, label=f"{name} ({100 * count / total:.1f} %)")
        for index, (name, count) in enumerate(found.cells.items())
    ]
    for label, color, text in ((RUNAWAY, _RUNAWAY, "runs away"), (UNRESOLVED, _UNRESOLVED, "unresolved")):
        count = int(np.sum(found.labels == label))
        if count:
            text = f"{text} ({100 * count / total:.2g} %)"
            handles.append(Patch(facecolor=color, edgecolor=GREY, linewidth=0.5, label=text))
    handles += [Line2D([], [], label=f"orbit of {found.names[index]}", **_marker(index)) for index in marked]
    draw_fill_legend(ax, handles, found.check.text, columns=3)
