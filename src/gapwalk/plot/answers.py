"""Pictures of answers: the description of a record (see `gapwalk.picture_parts`), in axes or in panels of a figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from inspect import Parameter, Signature
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.model.words import measure_words, parameter_words
from gapwalk.picture_parts import Bar, Description, NamedCurve, Panel, Parts, Picture, Series, Shade
from gapwalk.plot import style
from gapwalk.plot.branches import cut, draw_branches, line_entries, pieces_of, smooth_line
from gapwalk.plot.cells import draw_locus, fill_colors
from gapwalk.plot.picture import AnyFigure, Drawing, Finish, write_answer, write_legend, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILLION, stroke, symbols

# The names are those of the style sheet of the page.
TINTS = {
    "one": "#fbe3c4",  # in grey, the second is clearly darker
    "both": "#f2b98a",
    "one-wild": "#d9a75c",
    "both-wild": "#b5602a",
    "closed": "#e3ebf2",
    "closed-wild": "#a9bccd",
    "open": "#ffffff",
    "open-wild": "#d0d0d0",
    "none": "#3a3a3a",
    "undone": "#f4f4f4",
    "goal": "#fbe3c4",
    "quiet": "#e4f0e2",
}
LOOKS: dict[str, tuple[str, Any, float]] = {
    "main": (BLACK, "-", 1.4),
    "rising": (BLUE, "-", 1.4),
    "falling": (VERMILLION, (0, (4, 2)), 1.4),
    "other": (GREEN, (0, (1, 1)), 1.4),
    "measured": (BLACK, "-", 1.0),
    "after": (BLUE, "-", 1.7),
    "before": (GREY, "-", 1.7),
    "first": (BLUE, "-", 1.8),
    "second": (VERMILLION, "-", 1.8),
    "third": (GREEN, "-", 1.8),
    "fourth": (PURPLE, "-", 1.8),
    "torus": (BLUE, "-", 1.6),
    "torus-unstable": (BLUE, (0, (4, 2)), 1.2),
    "run": (GREY, "-", 1.0),
    "middle": (BLUE, "-", 1.6),
    "most": (BLUE, (0, (4, 2)), 1.2),
    "largest": (VERMILLION, "-", 1.2),
    "stable": (BLACK, "-", 1.2),
    "unstable": (BLACK, (0, (3, 2)), 0.8),
}
MARKS = {"dots": ("o", 2.6), "crosses": ("x", 4.0)}
SYMBOLS: dict[str, Any] = {  # marker, size, face, edge, and width of the edge
    "stars": ("*", 11.0, "#f3c55b", BLACK),
    "turn": ("D", 5.0, "white", BLUE),
    "fold": ("D", 5.0, "white", BLACK),
    "crossing": ("X", 6.0, "white", BLACK),
    "birth": ("o", 6.0, "white", BLACK),
    "hopf": ("o", 6.0, "white", VERMILLION),
    "border": ("|", 9.0, GREEN, GREEN),
    "doubling": ("s", 5.0, "white", VERMILLION),
    "change": ("o", 5.0, "white", VERMILLION),
    "pair": ("*", 8.0, "white", GREEN),
    "resonance": ("|", 9.0, GREY, GREY),
    "grazing": ("v", 5.0, "white", GREY),
    "tip": ("*", 8.0, "white", BLACK),
    **{f"marker-{number}": (marker, 6.0, "white", BLACK, 1.0) for number, marker in enumerate("osD^vPX*<>")},
}
_DASHES = (0, (4, 2))  # of what is unstable
_THIN = 0.57  # width of a line in a panel below, which has dots on it
_CLOSE = 0.12  # share of the range below which the texts of two lines would touch
_OFFSET: Any = {"textcoords": "offset points"}
_LINE = 60  # letters in a line of a reason why nothing is drawn

Entries = dict[str, Any]


def drawing_of_answer(described: Description, *, in_axes: bool) -> Drawing:
    """Return the drawing of a described type of record."""

    def draw(record: Any, place: Any, *, title: str = "", **options: Any) -> Finish:
        picture = described.describe(record, **options)
        parts, entries = picture.parts(), Entries()
        if not in_axes:
            return _draw_panels(picture, parts, place, title)
        finish = _draw_main(picture, parts, place, entries, has_values=False)
        if picture.heading and "panels" not in described.forms:
            place.set_title(picture.heading[0], wrap=True)
        write_legend(place, list(entries.items()), note=picture.note)
        return finish

    place = Parameter("place", Parameter.POSITIONAL_OR_KEYWORD)
    title = [] if in_axes else [Parameter("title", Parameter.KEYWORD_ONLY, default="")]
    draw.__signature__ = Signature([place.replace(name="record"), place, *described.options, *title])  # type: ignore[attr-defined]
    return Drawing(draw, described.size, several=described.several)


def _draw_panels(picture: Picture, parts: Parts, figure: AnyFigure, title: str) -> Finish:
    """Draw a picture with its panels below, and a legend of all."""
    bars = [list(parts.bars)] if parts.bars else []
    shown: dict[str, list[Any]] = {"main": [None], "below": [*parts.below], "charts": [*parts.charts], "bars": bars}
    panels = [each for name in picture.panels for each in shown[name] if getattr(each, "of", "") in ("", picture.of)]
    if not panels:
        raise ModelError(picture.empty)
    heights = [_height(picture, each) for each in panels]
    shares = {*picture.panels} <= {"main", "below"}
    axes = figure.subplots(len(heights), 1, sharex=shares, squeeze=False, height_ratios=heights)[:, 0].tolist()
    write_answer(figure, title, picture.heading)
    if len(axes) > 1:
        write_letters(axes)
    entries, finishes = Entries(), list[Callable[[], None]]()
    for ax, each in zip(axes, panels, strict=True):
        if each is None:
            finishes.append(_draw_main(picture, parts, ax, entries))
        elif isinstance(each, list):
            _draw_bars(ax, each)
        else:
            finishes.append(_draw_panel(picture, parts, ax, each, entries))
    for ax in axes[:-1] if shares else ():
        ax.set_xlabel("")
    write_legend(figure if len(axes) > 1 else axes[0], list(entries.items()), note=picture.note)

    def write() -> None:
        for finish in finishes:
            finish()

    return write


def _height(picture: Picture, panel: Panel | list[Bar] | None) -> float:
    if panel is None:
        return picture.height
    return 0.45 + 0.26 * len(panel) if isinstance(panel, list) else panel.height


def _draw_bars(ax: Axes, bars: Sequence[Bar]) -> None:
    """Draw changes as bars, over the range of their limits."""
    rows, low, high = (
        np.arange(len(bars)),
        np.array([each.low for each in bars]),
        np.array([each.high for each in bars]),
    )
    ax.barh(rows, high - low, left=low, height=0.72, color="#e9e9e9", zorder=1)
    ax.barh(rows, [each.moved for each in bars], height=0.44, color=BLUE, zorder=3)
    ax.axvline(0.0, **stroke(BLACK, 0.8, zorder=4))
    options: dict[str, Any] = {
        "textcoords": "offset points",
        "va": "center",
        "fontsize": style.points(7.5),
        "zorder": 5,
    }
    for row, each in enumerate(bars):
        shift, side = (4.0, "left") if each.moved >= 0.0 else (-4.0, "right")
        ax.annotate(each.text, (each.moved, row), xytext=(shift, 0.0), ha=side, **options)
    widest = float(np.abs([low, high]).max())
    ax.set_yticks(rows, [each.name for each in bars])
    ax.set(xlim=(-1.04 * widest, 1.04 * widest), ylim=(len(bars) - 0.45, -0.55), xlabel="change in %, within limits")


def _draw_panel(picture: Picture, parts: Parts, ax: Axes, panel: Panel, entries: Entries) -> Callable[[], None]:
    if panel.logarithmic:
        ax.set(**{f"{panel.logarithmic}scale": "log"})
    _draw_series(ax, panel.series, entries)
    _draw_over(picture, parts, ax, (panel.over, ""), entries)
    ax.set(ylabel=panel.title, xlabel=panel.across or parameter_words(panel.over, picture.system.units))
    if panel.margin is not None:
        ax.margins(x=panel.margin)
    elif panel.fitted:
        ax.margins(y=0.12)
    else:
        ax.set_ylim(0.0, 1.08 * ax.get_ylim()[1])
    return partial(_write_notes, ax, panel.series, None)


def _draw_main(
    picture: Picture, parts: Parts, ax: Axes, entries: Entries, *, has_values: bool = True
) -> Callable[[], None]:
    """Draw the curves with what lies over them; return the function that writes texts in the final layout."""
    if picture.axes is None:
        raise ModelError(picture.empty)
    across, up = picture.axes
    reach = parts.within if picture.reach is None else picture.reach
    cells = next((each for each in parts.cells if each.of in ("", picture.of)), None)
    words = [text or words_of(name, picture.system) for name, text in zip(picture.axes, picture.words, strict=True)]
    if cells is not None:
        named = [(text, TINTS.get(color, color)) for text, color in cells.entries]
        fill_colors(ax, cells.codes, [color for _, color in named], cells.within, (words[0], words[1]))
        entries.update(named)
    finish = _draw_curves(picture, ax, entries, is_over_cells=cells is not None, within=reach.get(across))
    series = [each for each in (*parts.layers, *parts.paper) if each.axes == picture.axes]
    first = len(ax.lines)
    _draw_series(ax, series, entries)
    if finish is not None:
        _make_room(ax, first, across=across not in reach)
    _draw_over(picture, parts, ax, picture.axes, entries)
    room = 72.0 * ax.bbox.height / ax.figure.dpi
    ax.set(xlabel=words[0], ylabel=picture.words[1] or style.broken(words[1], room))
    if picture.logarithmic:
        ax.set(**{f"{picture.logarithmic}scale": "log"})
    ax.set(**{f"{axis}lim": reach[name] for axis, name in (("x", across), ("y", up)) if name in reach})
    if picture.empty:
        ax.grid(False)
        options = {"ha": "center", "va": "center", "color": GREY, "transform": ax.transAxes}
        ax.text(0.5, 0.5, fill(picture.empty.replace("$", r"\$"), _LINE), **options)

    def write() -> None:
        if finish is not None:
            finish()
        if has_values:
            _write_values(picture, parts, ax)
        _write_notes(ax, series, next((each for each in parts.shades if each.over == up), None))

    return write


def _make_room(ax: Axes, first: int, *, across: bool) -> None:
    """Extend the ranges of axes, which are those of branches, to lines drawn later."""
    for axis in "xy" if across else "y":
        low, high = getattr(ax, f"get_{axis}lim")()
        later = [np.asarray(getattr(line, f"get_{axis}data")(), dtype=float) for line in ax.lines[first:]]
        values = np.concatenate([*later, [low, high]])
        least, most = float(np.nanmin(values)), float(np.nanmax(values))
        room = 0.04 * (most - least)
        ax.set(**{f"{axis}lim": (least - room * (least < low), most + room * (most > high))})


def words_of(name: str, system: Any) -> str:
    """Return the label of an axis for a parameter or a measure."""
    named = name in system.structure.names
    return parameter_words(name, system.units) if named else measure_words(name, system.units)


def _draw_curves(picture: Picture, ax: Axes, entries: Entries, *, is_over_cells: bool, within: Any) -> Finish:
    """Draw the branches and loci."""
    assert picture.axes is not None
    across, up = picture.axes
    branches = [each for each in picture.curves if isinstance(each.curve, Branch)]
    loci = [each for each in picture.curves if each not in branches]
    for each in loci:
        options = stroke(*_look(each.look)) if each.look else style.locus_options(each.curve.kind)
        if is_over_cells:
            options = draw_locus(ax, picture.axes, each.curve)
        else:
            ax.plot(*each.curve.values.T[:: 1 if each.curve.first == across else -1], zorder=3, **options)
        entries.setdefault(each.text, options)
    for each in sorted(branches, key=lambda each: not each.is_earlier):
        if each.points is not None:
            entries[each.text] = stroke(*_look(each.look))
            heights = [point.measure(up) for point in each.points]
            ax.plot([point.value for point in each.points], heights, zorder=4, **entries[each.text])
        elif each.look:
            entries[each.text] = stroke(*_look(each.look))
            _draw_branch(ax, each, up)
    shaped = [each for each in branches if each.look and each.points is None]
    if shaped:
        entries["unstable"] = stroke(BLACK, 0.9, _DASHES)
    for kind in style.in_order(special.kind for each in shaped for special in each.marked):
        look = style.symbol_style(kind)
        entries[look.text] = symbols(look.marker, 6.0, "white", BLACK, 0.6)
    plain = [each.curve for each in branches if not each.look]
    if not plain:
        return None
    finish = draw_branches(plain, ax, up, labels=picture.labels, legend=False, within=within)
    entries.update(line_entries(plain))
    return finish


def _look(name: str) -> tuple[str, float, Any]:
    """Return the colour, the width and the dashes of a look."""
    color, dashes, width = LOOKS.get(name, LOOKS["main"])
    return color, width, dashes


def _draw_branch(ax: Axes, named: NamedCurve, up: str) -> None:
    """Draw a branch in one colour, dashed where it is unstable, with some of its special points."""
    (color, width, dashes), rank = _look(named.look), 0 if named.is_earlier else 1
    for piece in pieces_of(named.curve, up):
        line = (width, dashes) if piece.label == "stable" else (0.9, _DASHES)
        ax.plot(piece.x, piece.y, **stroke(color, *line, zorder=3 + rank))
    for special in named.marked:
        mark = symbols(style.symbol_style(special.kind).marker, 6.0, color, BLACK, 0.6, zorder=6 + rank)
        ax.plot([special.value], [special.point.measure(up)], **mark)


def _draw_series(ax: Axes, series: Sequence[Series], entries: Entries) -> None:
    dotted = {each.look for each in series if each.mark == "dots"}
    for each in series:
        color, width, dashes = _look(each.look)
        x, y = np.asarray(each.x, dtype=float), np.asarray(each.y, dtype=float)
        options: Any = stroke(color, width, dashes)
        if each.along is not None:
            branch, quantity = each.along
            for piece in cut(branch, lambda point, quantity=quantity: np.array([quantity(point)])):
                ax.plot(piece.x, piece.y[:, 0], zorder=3, **style.LINES[piece.label].options())
            continue
        if each.mark == "between":
            ax.fill_between(x, *y, color=color, alpha=0.18, linewidth=0, zorder=1)
            options = stroke(color, 6.0, alpha=0.3)
        elif each.mark == "area":
            ax.fill_between(x, y, color=color, alpha=0.45)
        elif each.mark == "region":
            ax.fill(x, y, color=color, alpha=0.25, linewidth=0, zorder=1)
        elif each.mark == "line":
            if each.corners is not None:
                x, y = _smooth(x, y, np.array(each.corners), is_logarithmic=ax.get_xscale() == "log")
            ax.plot(x, y, zorder=3, **(stroke(color, _THIN * width, dashes) if each.look in dotted else options))
        elif each.mark != "none":
            look: Any = SYMBOLS.get(each.symbol or each.mark) or (*MARKS[each.mark], color, color)
            options = symbols(*look)
            ax.plot(x, y, zorder=4 if each.mark in MARKS else 6, **options)
        if each.text:
            entries.setdefault(each.text, options)


def _smooth(
    x: NDArray[np.float64], y: NDArray[np.float64], corners: NDArray[Any], *, is_logarithmic: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a smooth curve through points, with corners between points whose numbers differ."""
    points = np.column_stack((np.log(x) if is_logarithmic else x, y))
    steps = np.diff(points, axis=0) / (np.ptp(points, axis=0) + np.finfo(float).tiny)
    along = np.append(0.0, np.cumsum(np.hypot(*steps.T)))
    parts = np.split(np.arange(len(points)), np.flatnonzero(np.diff(corners)) + 1)
    curve = np.concatenate([smooth_line(along[part], points[part]) for part in parts])
    return np.exp(curve[:, 0]) if is_logarithmic else curve[:, 0], curve[:, 1]


def _draw_over(picture: Picture, parts: Parts, ax: Axes, axes: tuple[str, str], entries: Entries) -> None:
    """Draw shades and lines over the whole width or height of a panel."""
    for each in parts.shades:
        if each.of in ("", picture.of) and each.over in axes:
            span = ax.axvspan if each.over == axes[0] else ax.axhspan
            span(each.low, each.high, color=TINTS[each.tint], linewidth=0, zorder=0)
            entries.setdefault(each.text, TINTS[each.tint])
    for each in parts.lines:
        if each.of in ("", picture.of) and each.over in axes:
            line = ax.axvline if each.over == axes[0] else ax.axhline
            line(each.at, **stroke(GREY, 0.8, "-" if each.exact else ":", zorder=1))


def _write_values(picture: Picture, parts: Parts, ax: Axes) -> None:
    """Write the texts of upright lines above a panel, where they do not touch each other."""
    (low, high), last = ax.get_xlim(), -math.inf
    for each in parts.lines:
        is_named = each.text and picture.axes and each.over == picture.axes[0] and each.of in ("", picture.of)
        if is_named and (each.at - last) / (high - low) >= _CLOSE:
            last = each.at
            text = "\n".join(filter(None, (each.text, each.kind)))
            options: Any = {
                "xycoords": ("data", "axes fraction"),
                "annotation_clip": False,
                "fontsize": style.points(7.5),
            }
            ax.annotate(text, (each.at, 1.0), xytext=(0.0, 3.0), ha="center", va="bottom", **_OFFSET, **options)


def _write_notes(ax: Axes, series: Sequence[Series], shade: Shade | None) -> None:
    """Write the texts of points next to them: above or below, on the side of a shade; without one, above right."""
    for each in series:
        for note, x, y in zip(each.notes, np.asarray(each.x), np.asarray(each.y), strict=bool(each.notes)):
            place: Any = {"xytext": (4.0, 4.0)}
            if shade is not None:
                is_up = (shade.low >= y) is not bool(ax.yaxis_inverted())  # of matplotlib, it may be NumPy's
                shift, side = (9.0, "bottom") if is_up else (-9.0, "top")
                place = {"xytext": (0.0, shift), "ha": "center", "va": side}
            color = _look(each.look)[0]
            ax.annotate(note, (x, y), fontsize="small", color=color, **_OFFSET, **place)
