"""Meanings of colours, dashes and markers, which pictures, the explorer's page and the documentation read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

Dashes = Any  # of matplotlib: a text, or an offset and lengths in line widths


class Meaning(NamedTuple):
    """A meaning with its colour on white and on dark paper, and the dash and the marker that belong to it."""

    name: str  #: Name of the colour on the page: ``--name``.
    what: str  #: The meaning, in words.
    color: str  #: On white.
    dark: str = ""  #: On a dark page; empty if the page has none.
    dashes: Dashes = "-"  #: Of its lines.
    marker: str = ""  #: Of its lines, drawn sparsely.


SOLID: Dashes = "-"
DASHED, DOTTED, DASH_DOT = (0, (4.5, 1.6)), (0, (1.3, 1.3)), (0, (6, 1.5, 1.3, 1.5))
LONG, LONG_DOT, LONG_DOTS = (0, (9, 2.2)), (0, (9, 2, 1.4, 2)), (0, (9, 2, 1.4, 2, 1.4, 2))

MEANINGS = (
    Meaning("stable", "stable; the motion itself; what was measured", "#000000", "#f2f2f2"),
    Meaning("below", "a multiplier beyond −1; flips", "#d55e00", "#ff8f3f", DASHED, "^"),
    Meaning("above", "a multiplier beyond +1; folds", "#0072b2", "#5ab4f5", DOTTED, "s"),
    Meaning("pair", "a pair of multipliers beyond 1; Neimark–Sacker points; tori", "#009e73", "#35c79a", DASH_DOT, "o"),
    Meaning("cross", "branch points; where sliding begins or ends", "#cc79a7", "#e6a3c8"),
    Meaning("stop", "grazing and stops; guide lines (thin, with any dash)", "#6f6f6f", "#8d9299"),
    Meaning("neutral", "neutral: neither stable nor unstable", "#6f6f6f", "#8d9299", SOLID, "d"),
    Meaning("first", "the first of several; rising; slipping forwards", "#3aa6d6", "#8fd6f5"),
    Meaning("second", "the second of several; falling; slipping backwards", "#882255", "#e58ab2", LONG),
    Meaning("third", "the third of several", "#17627d", "#4fa8c4", LONG_DOT),
    Meaning("fourth", "the fourth of several", "#4a3350", "#b79fc0", LONG_DOTS),
    Meaning("worst", "rattle: the worst, a limit", "#f3c55b", "#f3c55b"),
    Meaning("paper", "what a publication says", "#8e3b8e", "#dd9be0"),
)
"""Colours of lines and symbols."""

TINTS = (
    Meaning("tint-one", "rattles on one side", "#fdf3d3", "#4d4220"),
    Meaning("tint-both", "rattles on both sides", "#f5d885", "#857018"),
    Meaning("tint-quiet", "nothing rattles", "#e3ebf2", "#22303d"),
    Meaning("tint-goal", "a range that is asked for, or found", "#ece8dc", "#35332c"),
    Meaning("tint-late", "from a fold to the jump behind it", "#ddd6c4", "#47443a"),
    Meaning("tint-closed", "closed: the flanks touch all the time", "#e3ebf2", "#22303d"),
    Meaning("tint-open", "open: they never touch", "#ffffff", "#1e2125"),
    Meaning("tint-one-wild", "rattles on one side, not periodic", "#d3ab3a", "#b08f2a"),
    Meaning("tint-both-wild", "rattles on both sides, not periodic", "#97761a", "#d4ad35"),
    Meaning("tint-closed-wild", "closed, not periodic", "#a9bccd", "#44586b"),
    Meaning("tint-open-wild", "open, not periodic", "#d0d0d0", "#4a4a4a"),
    Meaning("tint-none", "no motion was found", "#3a3a3a"),
    Meaning("tint-undone", "not computed yet", "#f4f4f4"),
)
"""Colours of areas."""

_RAMPS = {  # by the odd part of a period: doublings grow lighter
    3: ("#4b3f9e", "#8d84cf", "#c3bee8"),
    5: ("#7c7a12", "#b3b150"),
    7: ("#36606e", "#86a9b4"),
}
_DOUBLED, _OTHER = ("#000000", "#7f4a1e", "#b5824f", "#d9b98c", "#e9d6bb"), "#9d8f98"
AREA_OF_ONE = "#f6f2e4"
"""Colour of period 1 as an area, which is paper to the other periods; as a line it is black."""

REGIMES = {"quasi-periodic": "#009e73", "chaotic": "#000000", "undecided": "#b5b5b5", "diverges": "#ffffff"}
"""Colours of motions without period, as areas."""

FILLS = (
    *("#17627d", "#bfe3f2", "#882255", "#e3b5cb", "#3aa6d6", "#6b4c57", "#c7b8a3", "#b0567f", "#ece4d0", "#4b5a60"),
)
"""Colours of areas that the legend names: attractors, shares. Neighbours differ in grey, too."""


def color_of(name: str) -> str:
    """Return the colour of a meaning on white."""
    return _COLORS[name]


def period_color(period: int) -> str:
    """Return the colour of a period: a hue for each odd number, lighter with each doubling."""
    doublings = (period & -period).bit_length() - 1
    odd = period >> doublings
    ramp = _DOUBLED if odd == 1 else _RAMPS.get(odd, (_OTHER,))
    return ramp[min(doublings, len(ramp) - 1)]


def page_colors() -> str:
    """Return the colours as variables of a style sheet, on light and on dark paper."""

    def rule(colors: Iterator[tuple[str, str]]) -> str:
        return f":root {{ {' '.join(f'--{name}: {color};' for name, color in colors)} }}"

    light = rule((each.name, each.color) for each in _ALL)
    dark = rule((each.name, each.dark) for each in _ALL if each.dark)
    return f"{light}\n@media (prefers-color-scheme: dark) {{ {dark} }}\n"


_ALL = (*MEANINGS, *TINTS)
_COLORS = {each.name: each.color for each in _ALL}
