"""The common style of all pictures: sizes, colours, line styles and symbols.

Settings of matplotlib are in `gapwalk.mplstyle`, the meanings of colours in `gapwalk.meanings`; the rest is here. No
information depends on colour alone: every kind has its own line style and marker, so a grey print can be read as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import as_file, files
from math import inf
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.cbook import normalize_kwargs
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle

from gapwalk.attractors.regimes import Regime
from gapwalk.bifurcation.loci import Codim2
from gapwalk.bifurcation.special_point import Kind
from gapwalk.errors import ModelError
from gapwalk.meanings import AREA_OF_ONE, MEANINGS, REGIMES, color_of, period_color

BLACK, GREY, SHADE = color_of("stable"), color_of("stop"), "#f1eee6"
SEVERAL = tuple(each for each in MEANINGS if each.name in ("first", "second", "third", "fourth"))
"""Colours and dashes of several things of one kind, which the legend names."""
LISTED: tuple[tuple[str, Any], ...] = (
    (BLACK, "-"),
    *((each.color, each.dashes) for each in (*SEVERAL[1:], SEVERAL[0])),
)
"""Colours and dashes of several curves, of which the first is black."""
FIRST, SECOND, THIRD = (each.color for each in SEVERAL[:3])

# ---------------------------------------------------------------------------------------------------------- sizes

SizeName = Literal["screen", "column", "page", "slide"]
"""Names of the sizes."""


@dataclass(frozen=True, slots=True)
class Size:
    """The size of a picture in its final medium."""

    width: float | None = None  #: Width in mm; None: the natural width of the picture.
    scale: float = 1.0  #: Scale of letters, lines and symbols; 1 is 9.5 points for the numbers along the axes.
    tall: float = 1.0  #: Ratio of height to width, relative to that ratio on a screen.
    dpi: int = 200  #: Pixels in an inch, if lines are no vectors.
    title: bool = True  #: False for pictures with a caption, which have no title and no sentences of their own.
    legend: bool = True  #: False for no legend.
    #: What is drawn otherwise: settings of matplotlib by their names (``font.family``), and options of its lines by the
    #: names of what they show (``stable``, ``flip``, ``period 2``).
    style: Mapping[str, Any] = field(default_factory=dict, hash=False)


SIZES: dict[str, Size] = {
    "screen": Size(),
    "column": Size(85.0, 8.0 / 9.5, 1.5, 600, title=False),
    "page": Size(175.0, 8.5 / 9.5, dpi=600, title=False),
    "slide": Size(250.0, 16.0 / 9.5, 0.95),
}
"""A column of a journal and its whole page, both above a caption; and a slide of 13.3 x 7.5 inches below its title."""

CARD = Size(115.0, 8.0 / 9.5, 1.05, title=False, legend=False)
"""The small picture on the card of a notebook."""

_INCH = 25.4  # mm
_ROOMY = 160.0  # mm at the letter size of a screen; labels on wider sheets need not be broken
_LETTER = 5.2  # mean width of a letter of a label, in points
_now: ContextVar[Size] = ContextVar("gapwalk_size", default=SIZES["screen"])


@contextmanager
def sized(size: SizeName | Size | None) -> Iterator[None]:
    """Draw all pictures of a `with` block at one size, as in ``with gw.plot.sized("column"): branch.plot()``.

    Parameters
    ----------
    size
        ``"column"`` (85 mm wide, numbers of 8 points), ``"page"`` (175 mm, 8.5 points), ``"slide"`` (250 mm, 16 points)
        or ``"screen"``; or a `Size`. None changes nothing.

    Yields
    ------
    None
        Nothing.

    Raises
    ------
    ModelError
        For any other name.

    Examples
    --------
    >>> with gw.plot.sized("column"):
    ...     axes = branch.plot("max.x")
    >>> round(float(axes.figure.get_size_inches()[0]) * 25.4)  # mm
    85
    """
    if isinstance(size, str) and size not in SIZES:
        raise ModelError(f'there is no size {size!r}; there are {", ".join(SIZES)}: write size="column"')
    token = _now.set(_now.get() if size is None else SIZES[size] if isinstance(size, str) else size)
    try:
        yield
    finally:
        _now.reset(token)


def present() -> Size:
    """Return the present size."""
    return _now.get()


@contextmanager
def styled(style: Mapping[str, Any] | None) -> Iterator[None]:
    """Draw all pictures of a `with` block with other colours, lines, symbols or fonts.

    Parameters
    ----------
    style
        Settings of matplotlib by name, as in ``{"font.family": "serif", "font.size": 8}``; and options of lines by what
        they show: ``stable``; ``above``, ``below`` or ``pair`` (unstable motions with a multiplier above +1, below -1,
        or a complex pair); a kind of special point or locus (``fold``, ``flip``, ...); ``period 2``. Options of the
        symbol of a special point begin with ``marker``; its ``color`` fills the symbol.

    Yields
    ------
    None
        Nothing.

    Raises
    ------
    ModelError
        For any other name.

    Examples
    --------
    >>> with gw.plot.styled({"stable": {"color": "tab:blue", "ls": ":"}, "font.family": "serif"}):
    ...     axes = branch.plot("max.x")
    >>> axes.lines[0].get_color()
    'tab:blue'
    """
    for name in style or ():
        known = (*LINES, *map(str, Kind.known()), *(codim2.value for codim2 in CODIM2))
        if name not in known and name not in mpl.rcParams and period_of(name) is None:
            raise ModelError(
                f'there is no style {name!r}; write a setting of matplotlib, as in style={{"font.size": 8}}, or one of '
                f'{", ".join(known)}, period 2, as in style={{"stable": {{"color": "tab:blue"}}}}'
            )
    with sized(replace(present(), style={**present().style, **(style or {})})):
        yield


def _other(name: str, is_symbol: bool = False) -> dict[str, Any]:
    """Return the options that are asked for in place of those of what is shown."""
    wanted = normalize_kwargs(dict(present().style.get(name, {})), Line2D)
    if not is_symbol:
        return wanted
    faced = {"markerfacecolor": wanted["color"]} if "color" in wanted else {}
    return faced | {key: value for key, value in wanted.items() if key.startswith("marker") or key == "alpha"}


def points(length: float) -> float:
    """Scale a length in points (of letters, lines or symbols) to the present size."""
    return length * _now.get().scale


def broken(label: str, room: float = inf) -> str:
    """Break the label of a vertical axis into two lines, at a comma or bracket, if the sheet or its room is small."""
    # The room is the height of the axes before their layout, in points.
    size = _now.get()
    is_roomy = size.width is None or size.width / size.scale > _ROOMY
    if is_roomy and points(_LETTER) * len(label) < room:
        return label
    places = [at for mark in (" (", ", ", " over ", " [") if (at := label.find(mark, 5)) > 0]
    return label if not places else f"{label[: min(places)].rstrip()}\n{label[min(places) :].lstrip(', ')}"


def sheet_size(width: float, height: float) -> tuple[float, float]:
    """Scale the width and height of a sheet on a screen, in inches, to the present size."""
    size = _now.get()
    if size.width is None:
        return width * size.scale, height * size.scale
    wide = size.width / _INCH
    return wide, height / width * wide * size.tall


# ------------------------------------------------------------------------------------------- settings of matplotlib


@cache
def _settings() -> Any:
    """Return the settings of the style file, for the size of a screen."""
    with as_file(files("gapwalk.plot") / "gapwalk.mplstyle") as path:
        return {**mpl.rc_params_from_file(path, use_default_template=False)}


def rc() -> dict[str, Any]:
    """Return the settings of matplotlib at the present size, for `in_style`."""
    lengths = ("size", "width", "pad")  # endings of the names of settings in points
    return {
        name: points(value) if name.endswith(lengths) and isinstance(value, float) else value
        for name, value in _settings().items()
    } | {name: value for name, value in present().style.items() if name in mpl.rcParams}


@contextmanager
def in_style() -> Iterator[None]:
    """Draw in gapwalk's style within a `with` block; then restore the user's values of the settings of the style.

    Other settings keep the values that they get in the block, unlike in `matplotlib.rc_context`: the first figure in a
    notebook loads the display backend, which sets `interactive` for all later figures.

    Yields
    ------
    None
        Nothing.

    Examples
    --------
    >>> with gw.plot.in_style():
    ...     axes = branch.plot()
    >>> axes.figure.get_size_inches()
    array([8. , 4.8])
    """
    style: Any = rc()
    before: Any = {name: mpl.rcParams[name] for name in style}
    try:
        mpl.rcParams.update(style)
        yield
    finally:
        mpl.rcParams.update(before)


# ---------------------------------------------------------------------------------------------- lines and symbols


def stroke(color: Any, width: float, dashes: Any = "-", **more: Any) -> dict[str, Any]:
    """Return the options of a matplotlib line without symbols; the width is in points at the size of a screen."""
    return {"color": color, "linestyle": dashes, "linewidth": points(width), **more}


def symbols(
    marker: str, size: float, face: str = "white", edge: str = BLACK, width: float = 0.8, **more: Any
) -> dict[str, Any]:
    """Return the options of a matplotlib line of symbols only; size and width of their edge as in `stroke`."""
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": points(size),
        "markerfacecolor": face,
        "markeredgecolor": edge,
        "markeredgewidth": points(width),
        **more,
    }


def dots(size: float, color: str = BLACK, **more: Any) -> dict[str, Any]:
    """Return the options of a matplotlib line drawn as dots."""
    return symbols(".", size, color, color, 0.0, **more)


@dataclass(frozen=True, slots=True)
class LineStyle:
    """Style of a kind of line."""

    text: str  #: Its name in a legend.
    #: color, line, width: Colour, dashes, and width in points at the size of a screen.
    color: str
    line: Any
    width: float
    marker: str = ""  #: Marker, drawn sparsely, open and small; empty for none.
    name: str = ""  #: Name in `styled`.

    def options(self, width: float = 1.0, **more: Any) -> dict[str, Any]:
        """Return the options of a matplotlib line, wider or thinner by a factor."""
        marker = symbols(self.marker, 3.4, edge=self.color) if self.marker else {}
        look = stroke(self.color, width * self.width, self.line, solid_capstyle="butt", **more)
        return marker | look | _other(self.name)

    @property
    def entry(self) -> tuple[str, dict[str, Any]]:
        """Legend entry: text and options."""
        return self.text, self.options()


@dataclass(frozen=True, slots=True)
class SymbolStyle:
    """Style of a special point, or of a point of codimension two."""

    text: str  #: Its name in a legend.
    label: str  #: Text next to it; empty for none.
    #: marker, color, size: Marker, colour and size of the symbol.
    marker: str
    color: str
    size: float
    #: edge, width: Colour and width of its edge.
    edge: str = BLACK
    width: float = 0.6
    name: str = ""  #: Name in `styled`.

    @property
    def legend(self) -> str:
        """Name in a legend, with the label."""
        return self.text if not self.label or self.label in self.text else f"{self.text} ({self.label})"

    def options(self, scale: float = 1.0, **more: Any) -> dict[str, Any]:
        """Return the options of a matplotlib line for the symbol, larger or smaller by a factor."""
        look = symbols(self.marker, scale * self.size, self.color, self.edge, self.width, **more)
        return look | _other(self.name, is_symbol=True)

    @property
    def entry(self) -> tuple[str, dict[str, Any]]:
        """Legend entry: text and options."""
        return self.legend, self.options()


LINES = {
    each.name: LineStyle(text, each.color, each.dashes, width, each.marker, each.name)
    for text, width, each in (
        ("stable", 1.7, MEANINGS[0]),
        ("unstable, beyond −1", 1.3, MEANINGS[1]),
        ("unstable, beyond +1", 1.5, MEANINGS[2]),
        ("unstable, complex pair", 1.4, MEANINGS[3]),
        ("neutral", 1.4, MEANINGS[6]),
    )
}
"""Line styles by the label of an instability, see `Instability.label`."""

_NAMES = {"blue": "above", "vermillion": "below", "green": "pair", "purple": "cross", "grey": "stop"}


def symbol_style(kind: Kind) -> SymbolStyle:
    """Return the style of special points of a kind, including user-defined events."""
    symbol = kind.symbol
    color = color_of(_NAMES[symbol.color])
    edge = (BLACK, 0.6) if MarkerStyle(symbol.marker).is_filled() else (color, 0.9)  # of a cross there is no face
    text = symbol.label or str(kind)
    return SymbolStyle(text, symbol.letters, symbol.marker, color, symbol.size, *edge, str(kind))


def in_order(kinds: Iterable[Kind]) -> list[Kind]:
    """Sort kinds into the order of legends, each once; user-defined events are last."""
    found = dict.fromkeys(kinds)
    return [*(kind for kind in Kind.known() if kind in found), *(kind for kind in found if kind not in Kind.known())]


UNEXPLAINED = SymbolStyle("not explained", "", "$?$", BLACK, 12.0, BLACK, 0.4)
"""The question mark at an unexplained step of a branch."""

CLUSTER = SymbolStyle("number of points there", "", "o", "white", 11.0, GREY, 0.8)
"""The mark of several special points that would lie on one another, in which their number is written."""

_GRAZES = SymbolStyle("a contact grazes too", "", "o", GREY, 2.6, GREY, 0.8)

CODIM2 = {
    kind: SymbolStyle(text, label, marker, color, size, width=0.8, name=kind.value)
    for kind, text, label, marker, size, color in (
        (Codim2.CUSP, "cusp", "CP", "^", 5.0, "white"),
        (Codim2.FOLD_FLIP, "fold–flip", "FF", "D", 4.4, "white"),
        (Codim2.FOLD_NEIMARK_SACKER, "fold–NS", "FN", "P", 5.8, "white"),
        (Codim2.FLIP_NEIMARK_SACKER, "flip–NS", "PN", "X", 5.8, "white"),
        (Codim2.GENERALISED_FLIP, "generalised flip", "GF", "v", 5.0, "white"),
        (Codim2.RESONANCE_1_1, "1:1 resonance", "1:1", "s", 4.6, "white"),
        (Codim2.RESONANCE_1_2, "1:2 resonance", "1:2", "s", 4.6, "#dddddd"),
        (Codim2.RESONANCE_1_3, "1:3 resonance", "1:3", "p", 5.4, "white"),
        (Codim2.RESONANCE_1_4, "1:4 resonance", "1:4", "h", 5.4, "white"),
        (Codim2.RESONANT_GRAZING, "resonant graze", "RG", "*", 7.0, "white"),
        (Codim2.DEGENERATE_SLIDING, "degenerate sliding", "DS", "8", 5.0, "white"),
        (Codim2.GRAZING_MEETS_FOLD, "graze meets fold", "GFo", "<", 5.0, "white"),
        (Codim2.GRAZING_MEETS_FLIP, "graze meets flip", "GFl", ">", 5.0, "white"),
    )
} | {
    Codim2.GRAZING: _GRAZES,
    Codim2.FOLD_GRAZING: _GRAZES,
    Codim2.FLIP_GRAZING: _GRAZES,
    Codim2.NEIMARK_SACKER_GRAZING: _GRAZES,
    Codim2.DEGENERATE_GRAZING: SymbolStyle("grazing points meet", "", "d", "white", 3.4, width=0.8),
}
"""Symbols of points of codimension two."""

AXIS, GUIDE = LineStyle("", GREY, "-", 0.8), LineStyle("", GREY, (0, (4, 2)), 0.8)
"""Guide lines: zero; breakpoints, and folds of a waterfall."""


def period_options(period: int, rank: int, stable: bool) -> dict[str, Any]:
    """Return the options of a matplotlib line for motions of a period, which has a rank (0: the shortest shown)."""
    width = (1.8, 1.5, 1.2, 1.0, 0.8)[min(rank, 4)]
    dashes = "-" if stable else (0, (3.2, 1.6))
    look = stroke(period_color(period), width if stable else 0.45 * width, dashes, solid_capstyle="butt")
    return look | _other(f"period {period}")


def birth_options(period: int, rank: int) -> dict[str, Any]:
    """Return the options of a matplotlib line for the origins of branches on a branch of that period and rank."""
    size, width = ((4.0, 0.9), (3.0, 0.7), (2.0, 0.5), (1.4, 0.4))[min(rank, 3)]
    return symbols(Kind.FLIP.symbol.marker, size, edge=period_color(period), width=width)


def locus_style(kind: Kind) -> LineStyle:
    """Return the line style of the loci of a kind."""
    style = symbol_style(kind)
    return LineStyle(
        style.text.split(" (")[0], style.color, kind.symbol.dashes or "-", kind.symbol.width, name=str(kind)
    )


def locus_options(kind: Kind, rank: int = 0) -> dict[str, Any]:
    """Return the options of a matplotlib line for a locus; `rank` is that of its period (0: the shortest)."""
    return locus_style(kind).options((1.0, 0.55, 0.38)[min(rank, 2)])


# ------------------------------------------------------------------------------------------------------- regimes

NAMED_PERIODS = 8
"""Number of periods with a colour of their own."""

_REGIMES = {
    regime.text: REGIMES[regime.text]
    for regime in (Regime.QUASI_PERIODIC, Regime.CHAOTIC, Regime.UNDECIDED, Regime.RUNAWAY)
}


def period_of(word: str) -> int | None:
    """Return m of the regime ``period m``; None for other regimes."""
    digits = word.removeprefix("period ")
    return int(digits) if word.startswith("period ") and digits.isdigit() else None


def regime_color(word: str) -> str:
    """Return the colour of a regime, given in words: ``period 3``, ``chaotic``, ..."""
    m = period_of(word)
    if m is None:
        return _REGIMES.get(word, "#4d4d4d")
    return AREA_OF_ONE if m == 1 else period_color(m if m <= NAMED_PERIODS else 11)


def regime_entries(words: set[str]) -> dict[str, str]:
    """Return the legend entries of some regimes, in order: text, and a regime with the same colour."""
    periods = {m: word for word in words if (m := period_of(word)) is not None}
    entries = {periods[m]: periods[m] for m in sorted(periods) if m <= NAMED_PERIODS}
    if periods and max(periods) > NAMED_PERIODS:
        entries[f"period {NAMED_PERIODS + 1} and more"] = periods[max(periods)]
    order = [*_REGIMES, *sorted(words - _REGIMES.keys())]
    return entries | {word: word for word in order if word in words and period_of(word) is None}
