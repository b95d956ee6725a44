"""The picture of a map: the loci that bound the regimes in the plane of two parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import blended_transform_factory
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.locus import Codim2Point, Locus
from gapwalk.continuation.walk import EndReason
from gapwalk.plot.labels import Label, place_labels
from gapwalk.plot.map_style import (
    CODIM2,
    ISLAND,
    LOCUS_TEXTS,
    LOST,
    SECTION,
    SECTION_TEXT,
    codim2_options,
    locus_options,
)
from gapwalk.plot.sheet import make_layout, new_sheet, open_axes
from gapwalk.plot.size import takes_size
from gapwalk.plot.style import SIZE, in_style
from gapwalk.plot.words import parameter_words
from gapwalk.study.map import Map

_TALL = (SIZE[0], 5.6)  # a plane needs more room than a curve
_ONE = 6.0  # distance, in points, within which two symbols of one kind are one
_COLUMNS = 4  # of the legend, at most


@takes_size
def plot_map(chart: Map, *, ax: Axes | None = None, labels: bool = True, legend: bool = True) -> Axes:
    """Draw all loci of a map in the plane of its two parameters.

    A thin line is a section, on which branches were followed; the islands on it (closed branches) are bars.

    Parameters
    ----------
    chart
        The map.
    ax
        Where to draw; by default in a new figure of pyplot.
    labels
        Whether points of codimension two and sections are named.
    legend
        Whether to explain what is drawn.

    Returns
    -------
    Axes
        The axes that were drawn in.
    """
    ax = open_axes(_TALL) if ax is None else ax
    with in_style():
        ax.set(xlim=chart.within[0], ylim=chart.within[1])
        units = chart.sections[0].branches[0].system.units if chart.branches else None
        ax.set_xlabel(parameter_words(chart.first, units))
        ax.set_ylabel(parameter_words(chart.second, units))
        _draw_sections(ax, chart, labels)
        order, periods = list(LOCUS_TEXTS), _periods(chart)
        for locus in chart.loci:
            options = locus_options(locus.kind, periods.index(locus.period))
            ax.plot(*_curve(locus).T, zorder=3.0 - 0.1 * order.index(locus.kind), **options)
        points = [point for locus in chart.loci for point in locus.codim2_points]
        for point in points:
            ax.plot(*point.values, zorder=5 if CODIM2[point.kind].label else 4, **codim2_options(point.kind))
        for place in _lost(chart):
            ax.plot(*place, zorder=5, **LOST)
        if legend:
            _draw_legend(ax, chart, points)
        make_layout(ax)  # labels are placed in it
        if labels:
            _name(ax, chart, points)
    return ax


def draw_map(chart: Map, title: str = "") -> Figure:
    """The picture of a map as a matplotlib figure, without pyplot."""
    with in_style():
        figure = new_sheet(_TALL)
        ax = figure.add_subplot()
        ax.set_title(title.replace("$", r"\$"), wrap=True)
        plot_map(chart, ax=ax)
    return figure


def _periods(chart: Map) -> list[int]:
    return sorted({locus.period for locus in chart.loci})


def _curve(locus: Locus) -> NDArray[np.float64]:
    values = locus.values
    return np.vstack((values, values[:1])) if locus.is_closed else values


def _draw_sections(ax: Axes, chart: Map, labels: bool) -> None:
    beside = blended_transform_factory(ax.transAxes, ax.transData)
    for section in chart.sections:
        ax.axhline(section.value, zorder=1.5, **SECTION)
        if labels:
            ax.text(1.006, section.value, f"{section.value:.4g}", transform=beside, va="center", **SECTION_TEXT)
    for value, low, high in _islands(chart):
        ax.plot((low, high), (value, value), zorder=3.5, **ISLAND)


def _islands(chart: Map) -> Iterator[tuple[float, float, float]]:
    """Of each closed branch of a section: the value of the section, and the range of the first parameter."""
    for section in chart.sections:
        for branch in section.branches:
            if branch.ends[-1].reason is EndReason.CLOSED:
                yield section.value, float(branch.values.min()), float(branch.values.max())


def _lost(chart: Map) -> list[tuple[float, float]]:
    """Where loci end because the numerics gave up, and not because nothing goes on."""
    return [end.values for locus in chart.loci for end in locus.ends if end.reason.is_failure]


def _draw_legend(ax: Axes, chart: Map, points: list[Codim2Point]) -> None:
    periods = _periods(chart)
    handles = []
    for kind, text in LOCUS_TEXTS.items():
        for rank, period in enumerate(periods):
            if any(locus.period == period for locus in chart.of_kind(kind)):
                name = text if len(periods) == 1 else f"{text}, period {period}"
                handles.append(Line2D([], [], label=name, **locus_options(kind, rank)))
    if next(_islands(chart), None):
        handles.append(Line2D([], [], label="island on a section", **ISLAND))
    shown = dict.fromkeys(style for kind, style in CODIM2.items() if any(point.kind is kind for point in points))
    for style in shown:
        kind = next(kind for kind, each in CODIM2.items() if each is style)
        text = f"{style.text} ({style.label})" if style.label else style.text
        handles.append(Line2D([], [], label=text, **codim2_options(kind)))
    if _lost(chart):
        handles.append(Line2D([], [], label="not followed further", **LOST))
    if chart.sections:
        handles.append(Line2D([], [], label="section", **SECTION))
    figure = ax.figure
    if handles and isinstance(figure, Figure) and len(figure.axes) == 1 and figure.get_constrained_layout():
        columns = math.ceil(len(handles) / math.ceil(len(handles) / _COLUMNS))  # as even as can be
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.6, handlelength=2.8)
    elif handles:
        ax.legend(handles=handles, loc="best", handlelength=2.8)


def _name(ax: Axes, chart: Map, points: list[Codim2Point]) -> None:
    """Write the short names of points of codimension two beside them; loci that meet in one share its name."""
    named: list[Codim2Point] = []
    unit = ax.figure.dpi / 72.0
    for point in (each for each in points if CODIM2[each.kind].label):
        place = ax.transData.transform(point.values)
        known = (ax.transData.transform(other.values) for other in named if other.kind is point.kind)
        if all(np.hypot(*(place - other)) > _ONE * unit for other in known):
            named.append(point)
    if not named:
        return
    gap = np.full((1, 2), np.nan)
    lines = [part for locus in chart.loci if locus.kind is not Kind.GRAZING for part in (_curve(locus), gap)]
    symbols = np.array([point.values for point in points])
    curve = np.vstack(lines or [symbols])
    place_labels(ax, [Label(CODIM2[point.kind].label, *point.values) for point in named], curve, symbols)
