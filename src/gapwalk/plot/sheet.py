"""Where pictures are drawn: on sheets that are written to files, and in windows that a person sees."""

from __future__ import annotations

import io
from collections.abc import Callable

import matplotlib as mpl
from matplotlib.figure import Figure

from gapwalk.plot.style import DPI, RC

Size = tuple[float, float]
"""Width and height in inches."""

NewFigure = Callable[[Size], Figure]
"""Either of the two below."""


def new_sheet(size: Size) -> Figure:
    """A figure without pyplot: nothing is left of it when it has been written."""
    with mpl.rc_context(RC):
        return Figure(figsize=size, dpi=DPI, layout="constrained")


def open_window(size: Size) -> Figure:
    """A figure of pyplot: it is shown in a window, or in a notebook below its cell."""
    import matplotlib.pyplot as plt  # only here: it chooses how to show windows, which costs time

    with mpl.rc_context(RC):
        return plt.figure(figsize=size, layout="constrained")


def lay_out(figure: Figure) -> None:
    """Make the layout once and for all: with its engine each file would make it anew, and draw everything twice."""
    engine = figure.get_layout_engine()
    if engine is not None:
        with mpl.rc_context(RC):
            engine.execute(figure)
        figure.set_layout_engine(None)


def sheet_bytes(figure: Figure, form: str) -> bytes:
    """A figure as the content of a file of this form, ``png`` or ``svg``; the same figure gives the same bytes."""
    content = io.BytesIO()
    metadata = {"Date": None} if form == "svg" else None
    lay_out(figure)
    with mpl.rc_context(RC):
        figure.savefig(content, format=form, dpi=DPI, metadata=metadata)
    return content.getvalue()
