"""A branch over its parameter: stable and unstable parts, and its special points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray

from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
from gapwalk.plot.closeup import Region, crowded_region, draw_closeup
from gapwalk.plot.labels import Label, place_labels
from gapwalk.plot.legend import draw_legend
from gapwalk.plot.pieces import Piece, padded, pieces_of
from gapwalk.plot.sheet import open_axes, when_laid_out
from gapwalk.plot.size import broken, points, takes_size
from gapwalk.plot.style import (
    BLACK,
    BLUE,
    GREEN,
    LINES,
    PURPLE,
    SIZE,
    SYMBOLS,
    VERMILLION,
    in_style,
    line_options,
    symbol_options,
    unexplained_options,
)
from gapwalk.plot.words import full_measure, measure_words, parameter_words

_MARKERS = (0.015, 0.035)  # first and distance of the markers along a line, in diagonals of the axes
_TICK = 7.0  # length of the tick at a grazing point, in points
_OVERLAID: tuple[tuple[str, Any], ...] = (  # colour and dashes of each system of an overlay
    (BLACK, "-"),
    (VERMILLION, (0, (4.5, 1.6))),
    (BLUE, (0, (1.3, 1.3))),
    (GREEN, (0, (6, 1.5, 1.3, 1.5))),
    (PURPLE, (0, (9, 2))),
)
_STABLE, _UNSTABLE = 1.7, 0.7  # widths of their lines, in points


@takes_size
def plot_branch(branch: Branch, measure: str = "half", *, ax: Axes | None = None, **options: Any) -> Axes:
    """Draw a branch over its parameter.

    Parameters
    ----------
    branch
        The branch.
    measure
        What is drawn: a measure (``"max.q1"``), a coordinate (``"q1"``: half its peak to peak) or ``"half"`` (that of
        the first coordinate).
    ax
        Where to draw; by default in a new figure of pyplot.
    **options
        `labels`, `legend` and `closeup` of `plot_branches`.

    Returns
    -------
    Axes
        The axes that were drawn in.
    """
    return plot_branches([branch], measure, ax=ax, **options)


@takes_size
def plot_branches(
    branches: Sequence[Branch],
    measure: str = "half",
    *,
    ax: Axes | None = None,
    labels: bool = True,
    legend: bool | Literal["above"] = True,
    closeup: bool = False,
    within: tuple[float, float] | None = None,
) -> Axes:
    """Draw branches over the same parameter in one picture.

    Parameters
    ----------
    branches, measure, ax
        As in `plot_branch`.
    labels
        Whether the special points have their short names beside them.
    legend
        Whether to explain what is drawn; ``"above"``: above the axes.
    closeup
        Whether to enlarge, where there is room, the place where special points crowd.
    within
        Range of the parameter that is shown; by default all of it.
    """
    ax = open_axes(SIZE) if ax is None else ax
    measure = full_measure(measure, branches[0].system.coordinates)
    drawing = _Drawing(branches, measure)
    with in_style():
        drawing.draw_lines(ax)
        _name_axes(ax, branches[0], measure)
        ax.margins(x=0.02, y=0.06)
        ax.autoscale_view()
        if within:
            ax.set(xlim=within, ylim=drawing.extent(*within))
        ax.set_autoscale_on(False)  # what follows is placed for these limits
        if legend:
            draw_legend(ax, branches, above=legend == "above")
        when_laid_out(lambda: drawing.finish(ax, labels, closeup), ax)
    return ax


@takes_size
def plot_overlay(
    branches: Mapping[str, Sequence[Branch]],
    measure: str = "half",
    *,
    ax: Axes | None = None,
    within: tuple[float, float] | None = None,
) -> Axes:
    """Draw branches of several systems over one another, each system by a line of its own; unstable parts are thin.

    Parameters
    ----------
    branches
        The branches of each system, by the name that the legend gives it. They run over the same parameter.
    measure, ax
        As in `plot_branch`.
    within
        Range of the parameter that is shown; by default all of it.

    Returns
    -------
    Axes
        The axes that were drawn in.

    Examples
    --------
    >>> gw.plot.plot_overlay({"light": [light], "heavy": [heavy]}, "half.q1", within=(0.5, 0.8))
    """
    ax = open_axes(SIZE) if ax is None else ax
    first = next(iter(branches.values()))[0]
    measure = full_measure(measure, first.system.coordinates)
    handles, heights = [], []
    with in_style():
        for place, (name, each) in enumerate(branches.items()):
            color, dashes = _OVERLAID[place % len(_OVERLAID)]
            for piece in (piece for branch in each for piece in pieces_of(branch, measure)):
                width = points(_STABLE if piece.label == "stable" else _UNSTABLE)
                ax.plot(piece.x, piece.y, color=color, linestyle=dashes, linewidth=width)
                heights.append(piece.y if within is None else piece.y[(piece.x >= within[0]) & (piece.x <= within[1])])
            handles.append(Line2D([], [], label=name, color=color, linestyle=dashes, linewidth=points(_STABLE)))
        handles.append(Line2D([], [], label="thin: unstable", color=BLACK, linewidth=points(_UNSTABLE)))
        if within:
            ax.set(xlim=within, ylim=padded(np.concatenate(heights)))
        _name_axes(ax, first, measure)
        ax.legend(handles=handles, loc="best")
    return ax


def _name_axes(ax: Axes, branch: Branch, measure: str) -> None:
    units = branch.system.units
    ax.set_xlabel(parameter_words(branch.parameter, units))
    ax.set_ylabel(broken(measure_words(measure, units)))


class _Drawing:
    """What is drawn of some branches, in the whole picture and in a close-up alike."""

    def __init__(self, branches: Sequence[Branch], measure: str) -> None:
        self.pieces = [piece for branch in branches for piece in pieces_of(branch, measure)]
        self.unexplained = [place for branch in branches for place in unexplained_places(branch, measure)]
        self.curve = np.concatenate([np.column_stack((piece.x, piece.y)) for piece in self.pieces])
        self.special_points = [
            (special, special.value, special.point.measure(measure))
            for branch in branches
            for special in branch.special_points
        ]

    @property
    def places(self) -> NDArray[np.float64]:
        """Where the special points lie that have a symbol, shape (points, 2)."""
        return np.array([(x, y) for special, x, y in self.special_points if special.kind is not Kind.GRAZING])

    def extent(self, left: float, right: float) -> tuple[float, float]:
        """The least and the greatest measure within a range of the parameter, with a margin."""
        return padded(self.curve[(self.curve[:, 0] >= left) & (self.curve[:, 0] <= right), 1])

    def draw_lines(self, ax: Axes) -> None:
        for piece in self.pieces:
            _draw_piece(ax, piece)

    def finish(self, ax: Axes, labels: bool, closeup: bool) -> None:
        """Draw the special points, and a close-up where they crowd, into axes whose place is final."""
        crowd = crowded_region(ax, self.places) if closeup else None
        enlarged = draw_closeup(ax, crowd, self.curve) if crowd else None
        self.draw_special_points(ax, labels, without=crowd if enlarged else None)
        if enlarged:
            self.draw_lines(enlarged)
            self.draw_special_points(enlarged, labels)

    def draw_special_points(self, ax: Axes, labels: bool, without: Region | None = None) -> None:
        """Draw the symbols, and labels but for those in a region."""
        for kind in SYMBOLS:
            places = np.array([(x, y) for special, x, y in self.special_points if special.kind is kind])
            if not len(places):
                continue
            if kind is Kind.GRAZING:
                _draw_ticks(ax, places, self.curve)
            else:
                ax.plot(*places.T, zorder=5, **symbol_options(kind))
        if self.unexplained:
            ax.plot(*np.array(self.unexplained).T, zorder=6, **unexplained_options())
        if labels:
            inside = Region(*ax.get_xlim(), *ax.get_ylim())
            texts = [
                Label(SYMBOLS[special.kind].label, x, y)
                for special, x, y in self.special_points
                if _is_labelled(special) and inside.holds(x, y) and not (without and without.holds(x, y))
            ]
            everything = np.array([(x, y) for _, x, y in self.special_points])
            if texts:
                place_labels(ax, texts, self.curve, everything)


def unexplained_places(branch: Branch, measure: str) -> list[tuple[float, float]]:
    """Where something was missed on a branch: the middle of each of its unexplained steps."""
    if not branch.unexplained:
        return []
    values, sizes = branch.values, branch.measure(measure)
    places = []
    for each in branch.unexplained:
        step = int(np.argmin(np.abs(values[:-1] - each.first) + np.abs(values[1:] - each.last)))
        places.append((0.5 * (each.first + each.last), 0.5 * float(sizes[step] + sizes[step + 1])))
    return places


def _is_labelled(special: SpecialPoint) -> bool:
    return bool(SYMBOLS[special.kind].label)


def _draw_piece(ax: Axes, piece: Piece) -> None:
    marked = bool(LINES[piece.label].marker)
    order = 2.5 if marked else 3
    ax.plot(piece.x, piece.y, zorder=order, markevery=_MARKERS if marked else None, **line_options(piece.label))


def _draw_ticks(ax: Axes, places: NDArray[np.float64], curve: NDArray[np.float64]) -> None:
    """Short ticks across the curve, all as one: each has a direction of its own."""
    pixels = ax.transData.transform(curve)
    ticks = []
    for place in ax.transData.transform(places):
        here = int(np.argmin(np.hypot(*(pixels - place).T)))
        along = pixels[min(here + 1, len(pixels) - 1)] - pixels[max(here - 1, 0)]
        across = np.array([-along[1], along[0]]) / (float(np.hypot(*along)) or 1.0)
        ticks.append(Path([-0.5 * across, 0.5 * across]))
    style = symbol_options(Kind.GRAZING)
    ax.add_collection(
        PathCollection(
            ticks,
            sizes=[_TICK**2],
            offsets=places,
            offset_transform=ax.transData,
            transform=IdentityTransform(),
            edgecolors=style["markeredgecolor"],
            linewidths=style["markeredgewidth"],
            zorder=4,
        ),
        autolim=False,
    )
