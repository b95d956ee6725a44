"""Where pictures are drawn: on sheets that are written to files, and in windows that a person sees."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gapwalk.plot.size import sheet_size
from gapwalk.plot.style import DPI, in_style, rc

_PACKED = 3  # of 9: as small as at 6, for a picture without opacity, in two thirds of the time

Size = tuple[float, float]
"""Width and height in inches, as on a screen; see `gapwalk.plot.size` for others."""

NewFigure = Callable[[Size], Figure]
"""Either of `new_sheet` and `open_window`."""

_postponed: ContextVar[list[Callable[[], None]] | None] = ContextVar("gapwalk_postponed", default=None)


@contextmanager
def figure(width: float, height: float, title: str = "") -> Iterator[Figure]:
    """Make a figure of several panels in the style of all pictures, to be written by `save_picture`.

    The functions of `gapwalk.plot` draw into its axes and subfigures, and so may matplotlib. The layout is made once,
    at the end of the block. Only then are the labels of special points and branches placed: until then the panels
    change their sizes, and a label that was clear of the curves would come to lie on them.

    Parameters
    ----------
    width, height
        Size in inches on a screen; `sized` makes it that of a column, a page or a slide.
    title
        Title above all panels; it is wrapped.

    Yields
    ------
    Figure
        A figure of matplotlib without pyplot: no window shows it, and nothing is left of it when it has been written.

    Examples
    --------
    >>> with gw.plot.figure(8.0, 8.6, "Two mean loads") as figure:
    ...     upper, lower = figure.subplots(2)
    ...     gw.plot.plot_branch(light, "half.q1", ax=upper)
    ...     gw.plot.plot_branch(heavy, "half.q1", ax=lower)
    >>> gw.plot.save_picture(figure, "loads.png")
    """
    sheet = new_sheet((width, height))
    token = _postponed.set([])
    try:
        with in_style():
            if title:
                sheet.suptitle(title, x=0.01, ha="left", fontsize=rc()["axes.titlesize"], wrap=True)
            yield sheet
            lay_out(sheet)
            for draw in _postponed.get() or ():
                draw()
    finally:
        _postponed.reset(token)


def when_laid_out(draw: Callable[[], None], ax: Axes | None = None) -> None:
    """Call `draw` when the layout is final: now, or at the end of the block of `figure`.

    If it is called now, the layout around `ax` is made before; without `ax` the caller has made it.
    """
    postponed = _postponed.get()
    if postponed is not None:
        postponed.append(draw)
        return
    if ax is not None:
        make_layout(ax)
    draw()


def new_sheet(size: Size) -> Figure:
    """A figure without pyplot: nothing is left of it when it has been written."""
    with in_style():
        figure = Figure(figsize=sheet_size(*size), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # what measures texts for the layout draws them, too
    return figure


def open_window(size: Size) -> Figure:
    """A figure of pyplot: it is shown in a window, or in a notebook below its cell.

    It is opened outside of `in_style`: the first one loads what shows figures, with settings of its own.
    """
    import matplotlib.pyplot as plt  # only here: it chooses how to show windows, which costs time

    return plt.figure(figsize=sheet_size(*size), layout="constrained")


def open_axes(size: Size) -> Axes:
    """The same with axes that fill it."""
    figure = open_window(size)
    with in_style():
        return figure.add_subplot()


def make_layout(ax: Axes) -> None:
    """Bring the picture of some axes into its layout, so that what is placed by hand stays in its place.

    Where matplotlib has an engine for it, nothing is drawn for that.
    """
    figure = ax.get_figure(root=True)
    assert figure is not None
    engine = figure.get_layout_engine()
    with in_style():
        if engine is None:
            figure.draw_without_rendering()
        else:
            engine.execute(figure)


def lay_out(figure: Figure) -> None:
    """Make the layout once and for all: with its engine each file would make it anew, and draw everything twice."""
    engine = figure.get_layout_engine()
    if engine is not None:
        with in_style():
            engine.execute(figure)
        figure.set_layout_engine(None)


def sheet_bytes(figure: Figure, form: str) -> bytes:
    """A figure as the content of a file: ``png``, ``svg`` (the same figure gives the same bytes) or ``pdf``."""
    lay_out(figure)
    with in_style():
        return _png_bytes(figure) if form == "png" else _drawing_bytes(figure, form)


def _drawing_bytes(figure: Figure, form: str) -> bytes:
    content = io.BytesIO()
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}[form]
    figure.savefig(content, format=form, dpi=DPI, metadata=metadata)
    return content.getvalue()


def _png_bytes(figure: Figure) -> bytes:
    """What `savefig` writes, but for the opacity: paper is white, and without it a picture is packed twice as fast."""
    from PIL import Image  # only now: it is part of matplotlib

    content = io.BytesIO()
    figure.set_dpi(DPI)
    canvas = figure.canvas if isinstance(figure.canvas, FigureCanvasAgg) else FigureCanvasAgg(figure)
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(content, format="png", dpi=(DPI, DPI), compress_level=_PACKED)
    return content.getvalue()
