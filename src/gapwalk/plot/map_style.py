"""What lines and symbols mean in the picture of a map; colours as in `gapwalk.plot.style`."""

from __future__ import annotations

from typing import Any, NamedTuple

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.locus import Codim2
from gapwalk.plot.size import points
from gapwalk.plot.style import BLACK, BLUE, GREEN, GREY, VERMILLION

LOCUS_TEXTS = {
    Kind.FOLD: "fold",
    Kind.FLIP: "flip",
    Kind.NEIMARK_SACKER: "Neimark–Sacker",
    Kind.GRAZING: "grazing",
}
"""What the legend calls the loci, in the order in which they are drawn, the last ones first."""

_LINES: dict[Kind, tuple[str, Any, float]] = {
    Kind.FOLD: (BLUE, "-", 1.7),
    Kind.FLIP: (VERMILLION, (0, (4.5, 1.4)), 1.6),
    Kind.NEIMARK_SACKER: (GREEN, (0, (6, 1.3, 1.2, 1.3)), 1.6),
    Kind.GRAZING: (GREY, (0, (1.2, 1.6)), 1.0),
}
_THINNER = (1.0, 0.55, 0.38)  # width of the lines of the shortest period, of the next one, and of all others


class Codim2Style(NamedTuple):
    """How a point of codimension two is drawn.

    Attributes
    ----------
    text
        What the legend calls it.
    label
        What stands beside it; empty for nothing.
    marker, size, fill
        Of the symbol.
    """

    text: str
    label: str
    marker: str
    size: float = 5.0
    fill: str = "white"


_GRAZES = Codim2Style("a contact grazes too", "", "o", 2.6, GREY)
_TOUCH = Codim2Style("grazing points meet", "", "d", 3.4)

CODIM2 = {
    Codim2.CUSP: Codim2Style("cusp", "CP", "^"),
    Codim2.FOLD_FLIP: Codim2Style("fold–flip", "FF", "D", 4.4),
    Codim2.FOLD_NEIMARK_SACKER: Codim2Style("fold–NS", "FN", "P", 5.8),
    Codim2.FLIP_NEIMARK_SACKER: Codim2Style("flip–NS", "PN", "X", 5.8),
    Codim2.GENERALISED_FLIP: Codim2Style("generalised flip", "GF", "v"),
    Codim2.RESONANCE_1_1: Codim2Style("1:1 resonance", "1:1", "s", 4.6),
    Codim2.RESONANCE_1_2: Codim2Style("1:2 resonance", "1:2", "s", 4.6, "#dddddd"),
    Codim2.RESONANCE_1_3: Codim2Style("1:3 resonance", "1:3", "p", 5.4),
    Codim2.RESONANCE_1_4: Codim2Style("1:4 resonance", "1:4", "h", 5.4),
    Codim2.GRAZING: _GRAZES,
    Codim2.FOLD_GRAZING: _GRAZES,
    Codim2.FLIP_GRAZING: _GRAZES,
    Codim2.NEIMARK_SACKER_GRAZING: _GRAZES,
    Codim2.DEGENERATE_GRAZING: _TOUCH,
}


def locus_options(kind: Kind, rank: int) -> dict[str, Any]:
    """Options of a matplotlib line for a locus of motions of the shortest period (rank 0), the next (1), and so on."""
    color, line, width = _LINES[kind]
    return {
        "color": color,
        "linestyle": line,
        "linewidth": points(width * _THINNER[min(rank, len(_THINNER) - 1)]),
        "solid_capstyle": "butt",
    }


def codim2_options(kind: Codim2) -> dict[str, Any]:
    """Options of a matplotlib line for the symbol of a point of codimension two."""
    style = CODIM2[kind]
    return {
        "linestyle": "none",
        "marker": style.marker,
        "markersize": points(style.size),
        "markerfacecolor": style.fill,
        "markeredgecolor": GREY if style.fill == GREY else BLACK,
        "markeredgewidth": 0.8,
    }


SECTION: dict[str, Any] = {"color": "#b9b1a0", "linestyle": "-", "linewidth": 0.7}
"""Options of the line of a section."""

SECTION_TEXT: dict[str, Any] = {"color": "#8a8270", "fontsize": "x-small", "clip_on": False}
"""Options of the value beside it."""

ISLAND: dict[str, Any] = {
    "color": BLACK,
    "linestyle": "-",
    "linewidth": 2.0,
    "marker": "|",
    "markersize": 9.0,
    "markeredgewidth": 1.3,
}
"""Options of the line from one end of an island on a section to the other."""

LOST: dict[str, Any] = {
    "color": BLACK,
    "linestyle": "none",
    "marker": "x",
    "markersize": 5.0,
    "markeredgewidth": 1.2,
}
"""Options of the symbol at the end of a locus at which the numerics gave up."""
