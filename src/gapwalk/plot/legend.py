"""The legend: what the lines and symbols of a picture mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gapwalk.continuation.branch import Branch
from gapwalk.plot.style import GREY, LINES, SYMBOLS, birth_options, line_options, period_options, symbol_options


def draw_legend(ax: Axes, branches: Sequence[Branch], *, above: bool = False) -> None:
    """Explain the lines and symbols that occur: below the picture where it is alone in its figure, else inside."""
    lines = [name for name in LINES if any(i.label == name for branch in branches for i in branch.instabilities)]
    kinds = [kind for kind in SYMBOLS if any(branch.special(kind) for branch in branches)]
    handles = [Line2D([], [], label=LINES[name].text, **line_options(name)) for name in lines]
    handles += [Line2D([], [], label=SYMBOLS[kind].text, **symbol_options(kind)) for kind in kinds]
    figure = ax.figure
    if above:
        _draw_above(ax, handles)
    elif isinstance(figure, Figure) and len(figure.axes) == 1 and figure.get_constrained_layout():
        columns = len(handles) if len(handles) < 5 else (len(handles) + 1) // 2
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.8, handlelength=3.0)
    else:
        ax.legend(handles=handles, loc="best", handlelength=3.0)


def draw_period_legend(ax: Axes, periods: Sequence[int], births: bool) -> None:
    """Explain the colours of periods above the picture."""
    handles = [
        Line2D([], [], label=f"period {period}", **period_options(rank, stable=True))
        for rank, period in enumerate(periods)
    ]
    handles += [
        Line2D([], [], label=text, **{**period_options(0, stable), "color": GREY})
        for text, stable in (("stable", True), ("unstable", False))
    ]
    if births:
        handles.append(Line2D([], [], label="a branch begins or ends", **birth_options(0)))
    _draw_above(ax, handles)


def _draw_above(ax: Axes, handles: list[Line2D]) -> None:
    columns = len(handles) if len(handles) < 5 else (len(handles) + 1) // 2
    ax.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.2,
        ncols=columns,
        columnspacing=1.6,
        handlelength=2.6,
    )


def draw_fill_legend(ax: Axes, handles: Sequence[Artist], note: str, columns: int) -> None:
    """Explain the fills of a map of cells, under a small note: below the picture, or inside where others are near."""
    figure = ax.figure
    size: dict[str, Any] = {"columnspacing": 1.5, "handlelength": 1.3, "handleheight": 1.1, "title_fontsize": 7.0}
    if isinstance(figure, Figure) and figure.get_constrained_layout():
        count = min(len(handles), columns)
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=count, title=note, **size)
    else:
        legend = ax.legend(handles=handles, loc="best", title=note, frameon=True, **size)
    legend.get_title().set_color(GREY)
