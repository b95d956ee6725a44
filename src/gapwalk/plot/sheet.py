"""Where pictures are drawn: on sheets that are written to files, and in windows that a person sees."""

from __future__ import annotations

import io
from collections.abc import Callable

import matplotlib as mpl
from matplotlib.figure import Figure

from gapwalk.plot.size import sheet_size
from gapwalk.plot.style import DPI, rc

Size = tuple[float, float]
"""Width and height in inches, as on a screen; see `gapwalk.plot.size` for others."""

NewFigure = Callable[[Size], Figure]
"""Either of the two below."""


def new_sheet(size: Size) -> Figure:
    """A figure without pyplot: nothing is left of it when it has been written."""
    with mpl.rc_context(rc()):
        return Figure(figsize=sheet_size(*size), dpi=DPI, layout="constrained")


def open_window(size: Size) -> Figure:
    """A figure of pyplot: it is shown in a window, or in a notebook below its cell."""
    import matplotlib.pyplot as plt  # only here: it chooses how to show windows, which costs time

    with mpl.rc_context(rc()):
        return plt.figure(figsize=sheet_size(*size), layout="constrained")


def lay_out(figure: Figure) -> None:
    """Make the layout once and for all: with its engine each file would make it anew, and draw everything twice."""
    engine = figure.get_layout_engine()
    if engine is not None:
        with mpl.rc_context(rc()):
            engine.execute(figure)
        figure.set_layout_engine(None)


def sheet_bytes(figure: Figure, form: str) -> bytes:
    """A figure as the content of a file: ``png``, ``svg`` (the same figure gives the same bytes) or ``pdf``."""
    content = io.BytesIO()
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(form)
    lay_out(figure)
    with mpl.rc_context(rc()):
        figure.savefig(content, format=form, dpi=DPI, metadata=metadata)
    return content.getvalue()
