"""The picture of a sweep: section points over the parameter, and the bands of regimes as coloured strips."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gapwalk.errors import ModelError
from gapwalk.plot.regime_colors import legend_words, regime_color
from gapwalk.plot.sheet import make_layout, new_sheet, open_window
from gapwalk.plot.size import points, takes_size
from gapwalk.plot.style import BLACK, BLUE, VERMILLION, in_style
from gapwalk.plot.words import parameter_words, state_words
from gapwalk.study.sweep.options import Way
from gapwalk.study.sweep.record import Sweep
from gapwalk.study.sweep.regime import Band

AnyFigure = Figure | SubFigure

SIZE = (8.0, 5.4)
"""Width and height of the picture, in inches."""

_WAYS = {Way.UP: ("up", BLUE), Way.DOWN: ("down", VERMILLION), Way.AFRESH: ("afresh", BLACK)}
_STRIP = 0.16  # height of a strip, in inches
_MOST_STRIPS = 12
_SPARSE = 6e4  # points up to which each is drawn boldly; more of them are fainter, so that crowds show their shape
_NAME = 5.0  # width of a letter in a strip, in points


@takes_size
def plot_sweep(
    sweep: Sweep,
    coordinate: str | None = None,
    *,
    figure: AnyFigure | None = None,
    title: str = "",
    legend: bool = True,
) -> AnyFigure:
    """Draw the section points of a sweep over its parameter, with a strip of regimes for each lane above them.

    The points are drawn as an image, so that a picture of a hundred thousand of them stays small as SVG or PDF too.

    Parameters
    ----------
    sweep
        The sweep.
    coordinate
        A coordinate, or with a dash its velocity (``q1'``); by default the first one.
    figure
        Where to draw; by default in a new figure of pyplot.
    title
        A line above the picture.
    legend
        Whether to explain what is drawn.

    Returns
    -------
    Figure or SubFigure
        The figure that was drawn in.

    Raises
    ------
    ModelError
        If there is no such coordinate, or nothing to draw yet.
    """
    place = sweep.place(coordinate)
    if not np.isfinite(sweep.sections[..., place]).any():
        raise ModelError("the sweep has no section points yet, so there is nothing to draw")
    names = [*sweep.system.coordinates, *(f"{name}'" for name in sweep.system.coordinates)]
    units = sweep.system.units
    figure = figure or open_window(SIZE)
    with in_style():
        shown = _shown_lanes(sweep)
        above = len(shown) * _STRIP
        strips, ax = figure.subplots(2, 1, sharex=True, height_ratios=[above, SIZE[1] - above])
        _draw_points(ax, sweep, names[place])
        ax.set(xlabel=parameter_words(sweep.parameter, units), ylabel=state_words(names[place], units))
        ax.set_xlim(sweep.values[0], sweep.values[-1])
        _draw_strips(strips, sweep, shown)
        if title:
            strips.set_title(title.replace("$", r"\$"), wrap=True)
        if legend:
            _draw_legend(figure, sweep, shown)
    return figure


def draw_sweep(sweep: Sweep, coordinate: str | None = None, title: str = "") -> Figure:
    """The picture as a matplotlib figure, without pyplot; errors as `plot_sweep`."""
    figure = new_sheet(SIZE)
    plot_sweep(sweep, coordinate, figure=figure, title=title)
    return figure


def _draw_points(ax: Axes, sweep: Sweep, coordinate: str) -> None:
    lanes = _draw_order(sweep)
    count = max(1, sum(len(sweep.section(coordinate, lane)[0]) for lane in lanes))
    for lane in lanes:
        x, y = sweep.section(coordinate, lane)
        ax.plot(
            x,
            y,
            linestyle="none",
            marker=".",
            markersize=1.1,
            markeredgewidth=0,
            color=_WAYS[sweep.lanes[lane].way][1],
            alpha=float(np.clip(np.sqrt(_SPARSE / count), 0.15, 0.8)),
            rasterized=True,
            zorder=2,
        )


def _draw_order(sweep: Sweep) -> list[int]:
    """The lanes one way after the other, up over down."""
    return sorted(range(len(sweep.lanes)), key=lambda lane: -sweep.lanes[lane].way.number)


def _shown_lanes(sweep: Sweep) -> list[int]:
    """The lanes that get a strip: the first starts of each way, where all would be too many."""
    ways = {lane.way for lane in sweep.lanes}
    most = max(1, _MOST_STRIPS // len(ways))
    return [index for index, lane in enumerate(sweep.lanes) if lane.start <= most]


def _draw_strips(ax: Axes, sweep: Sweep, shown: Sequence[int]) -> None:
    for row, lane in enumerate(shown):
        for band in sweep.bands(lane):
            ax.barh(
                row,
                band.high - band.low,
                left=band.low,
                height=0.84,
                color=regime_color(band.regime),
                linewidth=0,
                rasterized=False,
            )
        ax.barh(
            row,
            sweep.values[-1] - sweep.values[0],
            left=sweep.values[0],
            height=0.84,
            fill=False,
            edgecolor="#8a8a8a",
            linewidth=0.5,
        )
    texts = [_lane_words(sweep, lane, whole=len(shown) == len(sweep.lanes)) for lane in shown]
    ax.set_yticks(range(len(shown)), texts, fontsize=points(8))
    ax.set_ylim(len(shown) - 0.5, -0.5)
    ax.tick_params(axis="both", length=0)
    ax.tick_params(axis="x", labelbottom=False)
    ax.grid(visible=False)
    for spine in ax.spines.values():
        spine.set_visible(False)
    _write_periods(ax, sweep, shown)


def _lane_words(sweep: Sweep, lane: int, *, whole: bool) -> str:
    """The name of a strip; where not all lanes have one, it says how many starts there are."""
    way, start = _WAYS[sweep.lanes[lane].way][0], sweep.lanes[lane].start
    count = max(each.start for each in sweep.lanes)
    if count == 1:
        return way
    return f"{way} {start}" if whole else f"{way} {start} of {count}"


def _write_periods(ax: Axes, sweep: Sweep, shown: Sequence[int]) -> None:
    """Write into each band that is wide enough what it is: nothing is said by colour alone."""
    make_layout(ax)  # it tells which bands are wide enough
    width = ax.get_window_extent().width / ax.figure.dpi * 72.0
    span = sweep.values[-1] - sweep.values[0]
    for row, lane in enumerate(shown):
        for band in sweep.bands(lane):
            text = _short(band)
            if (band.high - band.low) / span * width > _NAME * len(text) + 2.0:
                ax.text(
                    0.5 * (band.low + band.high),
                    row,
                    text,
                    ha="center",
                    va="center_baseline",
                    fontsize=points(6.5),
                    color="white" if _is_dark(regime_color(band.regime)) else BLACK,
                )


def _short(band: Band) -> str:
    return f"P{band.regime.removeprefix('period ')}" if band.regime.startswith("period ") else band.regime


def _is_dark(colour: str) -> bool:
    red, green, blue = to_rgb(colour)
    return 0.3 * red + 0.59 * green + 0.11 * blue < 0.5


def _draw_legend(figure: AnyFigure, sweep: Sweep, shown: Sequence[int]) -> None:
    ways = list(dict.fromkeys(lane.way for lane in sweep.lanes))
    handles: list[Any] = [
        Line2D([], [], linestyle="none", marker="o", markersize=4, color=_WAYS[way][1], label=_label(way, ways))
        for way in ways
    ]
    regimes = {band.regime for lane in shown for band in sweep.bands(lane)}
    entries = legend_words(regimes)
    handles += [
        Patch(facecolor=regime_color(regime), edgecolor="#8a8a8a", linewidth=0.5, label=text)
        for text, regime in entries.items()
    ]
    columns = len(handles) if len(handles) < 8 else (len(handles) + 1) // 2
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.4, handlelength=1.4)


def _label(way: Way, ways: Sequence[Way]) -> str:
    return f"{_WAYS[way][0]} (beneath)" if way.number > min(each.number for each in ways) else _WAYS[way][0]
