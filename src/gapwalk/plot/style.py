"""The one style of all pictures: what a line, a marker and a colour mean.

The colours are those of Okabe and Ito (2008), which people with any form of colour vision tell apart. Nothing is said
by colour alone: every kind has a line style and a marker of its own, so a grey print can be read as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl

from gapwalk.bifurcation.branch import Kind
from gapwalk.plot.size import points

BLACK, GREY, SHADE = "#000000", "#6f6f6f", "#f1eee6"
BLUE, GREEN, VERMILLION, PURPLE = "#0072B2", "#009E73", "#D55E00", "#CC79A7"

SIZE = (8.0, 4.8)
"""Width and height of a picture, in inches."""


def diagram_size(panels: int) -> tuple[float, float]:
    """The same of a picture of two or three panels, one above the other."""
    return SIZE[0], 4.3 * panels


DPI = 200

RC: Any = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 10.5,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "savefig.dpi": DPI,
    "svg.hashsalt": "gapwalk",  # the same result gives the same file
    "svg.fonttype": "none",  # text stays text: it can be searched, and set in another font
    "pdf.fonttype": 42,
}
"""The style at the size of a screen; see `rc`."""

_LENGTHS = ("size", "width", "pad")  # ends of the names of what is measured in points


def rc() -> Any:
    """The style at the present size (see `gapwalk.plot.size`), for `in_style`."""
    bare = {**_POINTS, **RC}
    return {
        name: points(value) if name.endswith(_LENGTHS) and isinstance(value, float) else value
        for name, value in bare.items()
    }


@contextmanager
def in_style() -> Iterator[None]:
    """Draw in the style; afterwards its settings are again those of the user.

    No other setting is put back, as `matplotlib.rc_context` does it: the first figure in a notebook loads what shows
    figures there, and this sets `interactive` for the figures to come. So a window is opened before the style is set.
    """
    style = rc()
    before = {name: mpl.rcParams[name] for name in style}
    try:
        mpl.rcParams.update(style)
        yield
    finally:
        mpl.rcParams.update(before)


_POINTS = {
    f"{axis}tick.{which}.{what}": length
    for axis in "xy"
    for which, what, length in (("major", "size", 3.5), ("major", "pad", 3.5))
}


@dataclass(frozen=True, slots=True)
class LineStyle:
    """How a part of a branch is drawn.

    Parameters
    ----------
    text
        What the legend calls it.
    color, line, width
        Of the line.
    marker
        Sparse, open and small; empty for none.
    """

    text: str
    color: str
    line: Any
    width: float
    marker: str = ""


@dataclass(frozen=True, slots=True)
class SymbolStyle:
    """How a special point is drawn.

    Parameters
    ----------
    text
        What the legend calls it.
    label
        What stands beside it; empty for nothing.
    marker, color, size
        Of the symbol; it is filled and has a black edge.
    """

    text: str
    label: str
    marker: str
    color: str
    size: float


LINES = {
    "stable": LineStyle("stable", BLACK, "-", 1.7),
    "below": LineStyle("unstable, beyond −1", VERMILLION, (0, (4.5, 1.6)), 1.3, "^"),
    "above": LineStyle("unstable, beyond +1", BLUE, (0, (1.3, 1.3)), 1.5, "s"),
    "pair": LineStyle("unstable, complex pair", GREEN, (0, (6, 1.5, 1.3, 1.5)), 1.4, "o"),
}
"""By the label of an instability, see `Instability.label`."""

SYMBOLS = {
    Kind.FOLD: SymbolStyle("fold (LP)", "LP", "o", BLUE, 4.8),
    Kind.FLIP: SymbolStyle("flip (PD)", "PD", "D", VERMILLION, 4.3),
    Kind.NEIMARK_SACKER: SymbolStyle("Neimark–Sacker (NS)", "NS", "*", GREEN, 8.0),
    Kind.BRANCH_POINT: SymbolStyle("branch point (BP)", "BP", "P", PURPLE, 6.5),
    Kind.GRAZING: SymbolStyle("grazing", "", "|", GREY, 7.0),
}


PERIODS = ("#000000", "#0b56a4", "#d55e00", "#56b4e9", "#e69f00", "#cc79a7")
"""Colours of the shortest period, of twice that, and so on: told apart by any eye, and ever lighter in grey."""

_WIDTHS = (1.8, 1.4, 1.1, 0.9, 0.7)
_DASHES = (0, (3.2, 1.6))


def period_options(rank: int, stable: bool) -> dict[str, Any]:
    """Options of a matplotlib line for motions of the shortest period (rank 0), the next (1), and so on."""
    width = _WIDTHS[min(rank, len(_WIDTHS) - 1)]
    return {
        "color": PERIODS[min(rank, len(PERIODS) - 1)],
        "linestyle": "-" if stable else _DASHES,
        "linewidth": points(width if stable else 0.45 * width),
        "solid_capstyle": "butt",
    }


def birth_options(rank: int) -> dict[str, Any]:
    """Options of a matplotlib line for the symbol where branches are born on one of the period of that rank."""
    return {
        "linestyle": "none",
        "marker": SYMBOLS[Kind.FLIP].marker,
        "markersize": points((4.0, 3.0, 2.0, 1.4)[min(rank, 3)]),
        "markerfacecolor": "white",
        "markeredgecolor": PERIODS[min(rank, len(PERIODS) - 1)],
        "markeredgewidth": points((0.9, 0.7, 0.5, 0.4)[min(rank, 3)]),
    }


def line_options(label: str) -> dict[str, Any]:
    """Options of a matplotlib line for a kind of instability."""
    style = LINES[label]
    return {
        "color": style.color,
        "linestyle": style.line,
        "linewidth": points(style.width),
        "marker": style.marker or None,
        "markersize": points(3.4),
        "markerfacecolor": "white",
        "markeredgewidth": points(0.8),
        "solid_capstyle": "butt",
    }


def unexplained_options() -> dict[str, Any]:
    """Options of a matplotlib line for the question marks where something was missed."""
    return {
        "linestyle": "none",
        "marker": "$?$",
        "markersize": points(12.0),
        "markerfacecolor": VERMILLION,
        "markeredgecolor": VERMILLION,
        "markeredgewidth": points(0.4),
    }


def symbol_options(kind: Kind) -> dict[str, Any]:
    """Options of a matplotlib line for the symbol of a special point."""
    style = SYMBOLS[kind]
    return {
        "linestyle": "none",
        "marker": style.marker,
        "markersize": points(style.size),
        "markerfacecolor": style.color,
        "markeredgecolor": style.color if kind is Kind.GRAZING else BLACK,
        "markeredgewidth": points(0.9 if kind is Kind.GRAZING else 0.6),
    }
