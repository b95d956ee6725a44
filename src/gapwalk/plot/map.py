"""The picture of a map: the loci that bound the regimes in the plane of two parameters."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gapwalk.bifurcation.locus import Codim2, Codim2Point, Locus
from gapwalk.continuation.branch import Kind
from gapwalk.plot.labels import Label, place_labels
from gapwalk.plot.style import BLACK, BLUE, DPI, GREEN, GREY, RC, SIZE, VERMILLION
from gapwalk.plot.words import parameter_words
from gapwalk.study.map import Map

_LINES: dict[Kind, dict[str, Any]] = {
    Kind.FOLD: {"color": BLUE, "linestyle": "-", "linewidth": 1.6},
    Kind.FLIP: {"color": VERMILLION, "linestyle": (0, (4.5, 1.4)), "linewidth": 1.5},
    Kind.NEIMARK_SACKER: {"color": GREEN, "linestyle": (0, (6, 1.3, 1.2, 1.3)), "linewidth": 1.5},
    Kind.GRAZING: {"color": GREY, "linestyle": (0, (1.2, 1.2)), "linewidth": 1.0},
}
_TEXTS = {
    Kind.FOLD: "fold",
    Kind.FLIP: "flip",
    Kind.NEIMARK_SACKER: "Neimark–Sacker",
    Kind.GRAZING: "grazing",
}
_SYMBOLS = {
    Codim2.CUSP: ("cusp", "^", "CP"),
    Codim2.FOLD_FLIP: ("fold-flip", "D", "FF"),
    Codim2.RESONANCE_1_1: ("1:1 resonance", "s", "1:1"),
    Codim2.RESONANCE_1_2: ("1:2 resonance", "s", "1:2"),
    Codim2.RESONANCE_1_3: ("1:3 resonance", "s", "1:3"),
    Codim2.RESONANCE_1_4: ("1:4 resonance", "s", "1:4"),
}


def plot_map(chart: Map, *, ax: Axes | None = None, labels: bool = True) -> Axes:
    """Draw all loci of a map in the plane of its two parameters.

    Parameters
    ----------
    chart
        The map.
    ax
        Where to draw; by default a new figure (without pyplot).
    labels
        Whether points of codimension two are named.
    """
    if ax is None:
        with mpl.rc_context(RC):
            ax = Figure(figsize=SIZE, dpi=DPI, layout="constrained").add_subplot()
    for locus in sorted(chart.loci, key=lambda each: list(_LINES).index(each.kind), reverse=True):
        values = _closed(locus)
        ax.plot(values[:, 0], values[:, 1], zorder=2 + (locus.kind is not Kind.GRAZING), **_LINES[locus.kind])
    named = [point for locus in chart.loci for point in locus.codim2_points if point.kind in _SYMBOLS]
    for point in named:
        ax.plot(*point.values, zorder=5, **_symbol(point))
    (low, high), (bottom, top) = chart.within
    ax.set_xlim(low, high)
    ax.set_ylim(bottom, top)
    ax.set_xlabel(parameter_words(chart.first))
    ax.set_ylabel(parameter_words(chart.second))
    _draw_legend(ax, chart, named)
    if labels:
        _name(ax, chart, named)
    return ax


def draw_map(chart: Map, title: str = "") -> Figure:
    """The picture of a map as a matplotlib figure, without pyplot."""
    with mpl.rc_context(RC):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        ax = figure.add_subplot()
        ax.set_title(title.replace("$", r"\$"), wrap=True)
        plot_map(chart, ax=ax)
    return figure


def _closed(locus: Locus) -> np.ndarray:
    values = locus.values
    return np.vstack((values, values[:1])) if locus.is_closed else values


def _symbol(point: Codim2Point) -> dict[str, Any]:
    _, marker, _ = _SYMBOLS[point.kind]
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": 5.0,
        "markerfacecolor": "white",
        "markeredgecolor": BLACK,
        "markeredgewidth": 0.9,
    }


def _draw_legend(ax: Axes, chart: Map, named: list[Codim2Point]) -> None:
    kinds = [kind for kind in _LINES if chart.of_kind(kind)]
    handles = [Line2D([], [], label=_TEXTS[kind], **_LINES[kind]) for kind in kinds]
    seen = [kind for kind in _SYMBOLS if any(point.kind is kind for point in named)]
    for kind in seen:
        point = next(each for each in named if each.kind is kind)
        handles.append(Line2D([], [], label=f"{_SYMBOLS[kind][0]} ({_SYMBOLS[kind][2]})", **_symbol(point)))
    figure = ax.figure
    if handles and isinstance(figure, Figure) and len(figure.axes) == 1 and figure.get_constrained_layout():
        columns = len(handles) if len(handles) < 6 else (len(handles) + 1) // 2
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.8, handlelength=3.0)
    elif handles:
        ax.legend(handles=handles, loc="best", handlelength=3.0)


def _name(ax: Axes, chart: Map, named: list[Codim2Point]) -> None:
    if not named:
        return
    if isinstance(ax.figure, Figure):
        ax.figure.draw_without_rendering()  # labels are placed in the final layout
    gap = np.full((1, 2), np.nan)
    curve = np.vstack([part for locus in chart.loci for part in (_closed(locus), gap)])
    symbols = np.array([point.values for point in named])
    place_labels(ax, [Label(_SYMBOLS[point.kind][2], *point.values) for point in named], curve, symbols)
