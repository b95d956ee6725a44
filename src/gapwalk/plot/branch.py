"""A branch over its parameter: stable and unstable parts, and its special points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.plot.closeup import Region, crowded_region, draw_closeup
from gapwalk.plot.labels import Label, place_labels
from gapwalk.plot.legend import draw_legend
from gapwalk.plot.pieces import Piece, pieces_of
from gapwalk.plot.sheet import make_layout, open_axes
from gapwalk.plot.size import broken, takes_size
from gapwalk.plot.style import LINES, SIZE, SYMBOLS, in_style, line_options, symbol_options, unexplained_options
from gapwalk.plot.words import full_measure, measure_words, parameter_words

_MARKERS = (0.015, 0.035)  # first and distance of the markers along a line, in diagonals of the axes
_PAD = 0.06  # margin above and below, as a share of the height
_TICK = 7.0  # length of the tick at a grazing point, in points


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
    with in_style():
        finish = begin_branches(branches, measure, ax, labels=labels, legend=legend, closeup=closeup, within=within)
        make_layout(ax)
        finish()
    return ax


def begin_branches(
    branches: Sequence[Branch],
    measure: str,
    ax: Axes,
    *,
    labels: bool = True,
    legend: bool | Literal["above"] = True,
    closeup: bool = False,
    within: tuple[float, float] | None = None,
) -> Callable[[], None]:
    """Draw all that has a share in the layout; what it returns draws the rest, when the layout is final.

    So a picture of several panels is laid out once. Parameters as in `plot_branches`.
    """
    first = branches[0]
    measure = full_measure(measure, first.system.coordinates)
    drawing = _Drawing(branches, measure)
    drawing.draw_lines(ax)
    ax.set_xlabel(parameter_words(first.parameter, first.system.units))
    ax.set_ylabel(broken(measure_words(measure, first.system.units)))
    ax.margins(x=0.02, y=0.06)
    ax.autoscale_view()
    if within:
        ax.set(xlim=within, ylim=drawing.extent(*within))
    ax.set_autoscale_on(False)  # what follows is placed for these limits
    if legend:
        draw_legend(ax, branches, above=legend == "above")
    return partial(drawing.finish, ax, labels, closeup)


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
        inside = self.curve[(self.curve[:, 0] >= left) & (self.curve[:, 0] <= right), 1]
        low, high = (float(inside.min()), float(inside.max())) if len(inside) else (0.0, 1.0)
        pad = _PAD * ((high - low) or 1.0)
        return low - pad, high + pad

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
