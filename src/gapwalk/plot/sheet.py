"""Sheets and windows for pictures, their headings and legends, and their files."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.textpath import TextToPath

from gapwalk.plot.style import DPI, GREY, in_style, points, rc, sheet_size

AnyFigure = Figure | SubFigure

Inches = tuple[float, float]
"""Width and height in inches on a screen; see `gapwalk.plot.style.sized` for other sizes."""

WIDE: Inches = (8.0, 4.8)
"""The size of a picture of one panel."""

_PACKED = 3  # compression level, of 9: without opacity files are as small as at 6, in two thirds of the time
_BESIDE = 1.2  # spaces next to the line of each entry of a legend, in sizes of its letters
NARROW = 4.0  # inches of a sheet up to which the lines and the spaces of a legend are short
_OVER = 1.2  # height of a label, as a factor of its panel's, from which it meets that of the next one
_FILL_COLUMNS = 6  # most columns of a legend of fills


def stacked(panels: int) -> Inches:
    """Return the size of a picture of several panels, one above the other."""
    return WIDE[0], 4.3 * panels


def new_sheet(size: Inches = WIDE) -> Figure:
    """Create a figure without pyplot, which is freed when it has been written.

    Parameters
    ----------
    size
        Width and height in inches on a screen.

    Returns
    -------
    Figure
        A figure of matplotlib.

    Examples
    --------
    >>> gw.plot.new_sheet((6.0, 3.0)).get_size_inches()
    array([6., 3.])
    """
    with in_style():
        figure = Figure(figsize=sheet_size(*size), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # the same renderer measures texts for the layout and draws them
    return figure


def open_window(size: Inches = WIDE) -> Figure:
    """Open a figure of pyplot: it is shown in a window, or below the cell of a notebook.

    It must be opened outside of `in_style`, because the first one loads the display backend, which changes settings.
    """
    import matplotlib.pyplot as plt  # imported late: it selects the display backend, which takes long

    return plt.figure(figsize=sheet_size(*size), layout="constrained")


def close_window(figure: Figure) -> None:
    """Close a window again, if the figure has one."""
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close(figure)


def lay_out(figure: Figure, *, keep: bool = False) -> None:
    """Compute the layout of a figure, so that labels placed afterwards stay in place."""
    engine = figure.get_layout_engine()
    with in_style():
        if engine is not None:
            engine.execute(figure)
        elif keep:
            figure.draw_without_rendering()
    for ax in figure.axes:
        shorten_label(ax)
    if engine is not None and not keep:
        figure.set_layout_engine(None)


def write_heading(figure: AnyFigure, title: str) -> None:
    """Write a title above a whole picture, at the left."""
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=rc()["axes.titlesize"], wrap=True)


def write_answer(figure: AnyFigure, title: str, sentences: Sequence[str]) -> None:
    """Write a title above a whole picture, and the answer that the picture shows below the title."""
    write_heading(figure, "\n".join(filter(None, (title, *(each.replace("$", r"\$") for each in sentences)))))


def write_letters(panels: Sequence[Axes]) -> None:
    """Write a, b, c into the corners of panels."""
    for letter, panel in zip("abcdef", panels, strict=False):
        panel.text(0.012, 0.975, letter, transform=panel.transAxes, va="top", weight="bold", zorder=7)


def write_legend(
    place: Axes | AnyFigure,
    entries: Sequence[tuple[str, Any]],
    where: Literal["below", "above", "inside"] = "below",
    note: str = "",
) -> None:
    """Write a legend of lines, symbols and fills."""
    handles: list[Artist] = [
        Patch(facecolor=options, edgecolor=GREY, linewidth=0.5, label=text)
        if isinstance(options, str)
        else Line2D([], [], label=text, **options)
        for text, options in entries
    ]
    if not handles:
        return
    fills = any(isinstance(handle, Patch) for handle in handles)
    figure: Any = place.figure if isinstance(place, Axes) else place
    narrow = is_narrow(figure)
    size: dict[str, Any] = {"columnspacing": 0.9 if narrow else 1.6}
    size["handlelength"] = 1.3 if fills else 2.3 if narrow else 2.9
    if note:
        size |= {"title": note, "title_fontsize": points(7.0)}
    alone = isinstance(figure, Figure) and figure.get_constrained_layout() and (fills or len(figure.axes) == 1)
    if where == "above" and isinstance(place, Axes):
        corner = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        legend = place.legend(handles=handles, ncols=_columns(figure, handles, size), **corner, **size)
    elif not isinstance(place, Axes) or (alone and where == "below"):
        below = "outside lower center" if figure.figure.get_constrained_layout() else "lower center"
        legend = figure.legend(handles=handles, loc=below, ncols=_columns(figure, handles, size, fills), **size)
    else:
        legend = place.legend(handles=handles, loc="best", frameon=fills, **size)
    legend.get_title().set_color(GREY)


def _columns(figure: AnyFigure, handles: Sequence[Artist], spaces: Mapping[str, float], fills: bool = False) -> int:
    """Return the number of columns of a legend: one row or two, or as many columns as fit the width of the sheet."""
    count, size = len(handles), float(rc()["legend.fontsize"])
    wanted = min(count, _FILL_COLUMNS) if fills else -(-count // (1 if count < 5 else 2))
    font = FontProperties(size=size)
    texts = [TextToPath().get_text_width_height_descent(str(each.get_label()), font, False)[0] for each in handles]
    unit = figure.figure.dpi_scale_trans.transform((1.0 / 72.0, 0.0))[0]
    widths = unit * (np.array(texts) + (spaces["handlelength"] + spaces["columnspacing"] + _BESIDE) * size)
    room = figure.bbox.width

    def fits(columns: int) -> bool:
        return sum(map(max, np.array_split(widths, columns))) < room

    most = next((n for n in range(wanted, 1, -1) if fits(n)), 1)
    even = -(-count // -(-count // most))  # as many rows, but none with a single entry
    return even if fits(even) else most


def is_narrow(figure: AnyFigure) -> bool:
    """Return True if a picture is as narrow as a column of a journal."""
    return figure.figure.get_figwidth() < NARROW


def shorten_label(ax: Axes) -> None:
    """Leave out what stands in brackets in the label of a vertical axis that does not fit, after the layout.

    It is cut off at an edge of the picture, or reaches into the next panel.
    """
    if not ax.get_ylabel() or ax.name == "3d":
        return
    box, figure = ax.yaxis.label.get_window_extent(), ax.figure.figure
    is_high = len(figure.axes) > 1 and box.height > _OVER * ax.get_window_extent().height
    if box.y0 < 0.0 or box.y1 > figure.bbox.height or is_high:
        ax.set_ylabel(re.sub(r"\s+\([^)]*\)", "", ax.get_ylabel()))


def sheet_bytes(figure: Figure, form: str) -> bytes:
    """Render a figure as the content of a file: ``png``, ``svg`` (reproducible byte for byte) or ``pdf``."""
    lay_out(figure)
    with in_style():
        if form == "png":
            return png_bytes(figure)
        content = io.BytesIO()
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}[form]
        figure.savefig(content, format=form, dpi=DPI, metadata=metadata)
        return content.getvalue()


def png_bytes(figure: Figure, dpi: int = DPI) -> bytes:
    """Render a PNG as `savefig` does but without opacity: paper is white, and compression is twice as fast."""
    from PIL import Image  # imported late: it is installed with matplotlib

    content = io.BytesIO()
    figure.set_dpi(dpi)
    canvas = figure.canvas if isinstance(figure.canvas, FigureCanvasAgg) else FigureCanvasAgg(figure)
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(content, format="png", dpi=(dpi, dpi), compress_level=_PACKED)
    return content.getvalue()
