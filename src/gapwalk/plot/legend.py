"""The legend: what the lines and symbols of a picture mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from gapwalk.bifurcation.branch import Branch
from gapwalk.orbit.floquet import Instability
from gapwalk.plot.size import points
from gapwalk.plot.style import (
    GREY,
    LINES,
    SYMBOLS,
    birth_options,
    line_options,
    period_options,
    rc,
    symbol_options,
    unexplained_options,
)

_BESIDE = 9.0  # letters as wide as the line and the space beside each text


def draw_legend(ax: Axes, branches: Sequence[Branch], *, above: bool = False) -> None:
    """Explain the lines and symbols that occur: below the picture where it is alone in its figure, else inside."""
    counts = [count for branch in branches for count in (*branch.instabilities, *_between(branch))]
    lines = [name for name in LINES if any(count.label == name for count in counts)]
    kinds = [kind for kind in SYMBOLS if any(branch.special(kind) for branch in branches)]
    handles = [Line2D([], [], label=LINES[name].text, **line_options(name)) for name in lines]
    handles += [Line2D([], [], label=SYMBOLS[kind].text, **symbol_options(kind)) for kind in kinds]
    if any(branch.unexplained for branch in branches):
        handles.append(Line2D([], [], label="not explained", **unexplained_options()))
    figure = ax.figure
    if above:
        _draw_above(ax, handles)
    elif isinstance(figure, Figure) and len(figure.axes) == 1 and figure.get_constrained_layout():
        columns = _columns(figure, handles)
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.8, handlelength=3.0)
    else:
        ax.legend(handles=handles, loc="best", handlelength=3.0)


def _between(branch: Branch) -> list[Instability]:
    """The unstable multipliers between special points, where there may be no point of the walk."""
    return [special.after for special in branch.special_points]


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
    columns = _columns(ax.figure.figure, handles)
    ax.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.2,
        ncols=columns,
        columnspacing=1.6,
        handlelength=2.6,
    )


def _columns(figure: Figure | SubFigure | None, handles: Sequence[Artist], rows: int = 0) -> int:
    """How many columns an explanation has: in one row or two, or as many as the width of the sheet takes."""
    count = len(handles)
    wanted = -(-count // (rows or (1 if count < 5 else 2)))
    if figure is None:
        return wanted
    letter = figure.dpi_scale_trans.transform((1.0 / 72.0, 0.0))[0] * 0.5 * rc()["legend.fontsize"]
    widths = [letter * (len(str(handle.get_label())) + _BESIDE) for handle in handles]
    room = figure.bbox.width
    return next((n for n in range(wanted, 1, -1) if _width(widths, n) < room), 1)


def _width(widths: Sequence[float], columns: int) -> float:
    """Of entries in this many columns, filled one after the other."""
    rows = -(-len(widths) // columns)
    return sum(max(widths[i : i + rows]) for i in range(0, len(widths), rows))


def draw_fill_legend(ax: Axes, handles: Sequence[Artist], note: str, columns: int) -> None:
    """Explain the fills of a map of cells, under a small note: below the picture, or inside where others are near."""
    figure = ax.figure
    size: dict[str, Any] = {
        "columnspacing": 1.5,
        "handlelength": 1.3,
        "handleheight": 1.1,
        "title_fontsize": points(7.0),
    }
    if isinstance(figure, Figure) and figure.get_constrained_layout():
        count = min(columns, _columns(figure, handles, rows=1))
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=count, title=note, **size)
    else:
        legend = ax.legend(handles=handles, loc="best", title=note, frameon=True, **size)
    legend.get_title().set_color(GREY)
