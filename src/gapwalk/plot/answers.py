"""Pictures of answers: the description of a record (see `gapwalk.picture_parts`), in axes or in panels of a figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from inspect import Parameter, Signature
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from gapwalk import meanings
from gapwalk.answers.order_map import DEPTH, OrderMap, order_map
from gapwalk.answers.run_up import JumpDelay, RunUp
from gapwalk.answers.scan import FAILS, HOLDS, UNKNOWN, Scan
from gapwalk.answers.scan_claims import said
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.answers.tolerance import BINS, Tolerance, reach
from gapwalk.attractors.spectrum import turns_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import Kind
from gapwalk.errors import ModelError
from gapwalk.meanings import color_of
from gapwalk.model.system import System
from gapwalk.model.words import measure_words, parameter_symbol, parameter_words, signal_words
from gapwalk.picture_parts import Bar, Description, NamedCurve, Panel, Parts, Picture, Series, Shade
from gapwalk.plot import style
from gapwalk.plot.branches import BranchDrawing, cut, draw_branches, pieces_of, smooth_line
from gapwalk.plot.cells import draw_locus, fill_colors
from gapwalk.plot.motions import fill_waterfall
from gapwalk.plot.picture import (
    AnyFigure,
    Drawing,
    Finish,
    Inches,
    draws,
    show_whole_symbols,
    write_answer,
    write_heading,
    write_legend,
    write_letters,
)
from gapwalk.plot.style import BLACK, FIRST, GREY, SECOND, SEVERAL, THIRD, dots, stroke, symbols

# The names are those of the style sheet of the page.
TINTS = {each.name.removeprefix("tint-"): each.color for each in meanings.TINTS}
TORUS = color_of("pair")
LOOKS: dict[str, tuple[str, Any, float]] = {
    "main": (BLACK, "-", 1.4),
    "measured": (BLACK, "-", 1.0),
    "after": (BLACK, "-", 1.7),
    "before": (GREY, "-", 1.7),
    "rising": (FIRST, "-", 1.4),
    "falling": (SECOND, SEVERAL[1].dashes, 1.4),
    "other": (THIRD, "-", 1.4),
    **{each.name: (each.color, "-", 1.8) for each in SEVERAL},
    "torus": (TORUS, "-", 1.6),
    "torus-unstable": (TORUS, (0, (4, 2)), 1.2),
    "run": (GREY, "-", 1.0),
    "middle": (FIRST, "-", 1.6),
    "most": (THIRD, "-", 1.2),
    "largest": (SECOND, "-", 1.2),
    "stable": (BLACK, "-", 1.4),
    "unstable": (BLACK, (0, (3, 2)), 0.8),
}
MARKS = {"dots": ("o", 2.6), "crosses": ("x", 4.0)}
SYMBOLS: dict[str, Any] = {  # marker, size, face, edge, and width of the edge
    "stars": ("*", 11.0, color_of("worst"), BLACK),
    "turn": ("o", 5.0, "white", color_of("above")),
    "fold": ("o", 5.0, "white", color_of("above")),
    "crossing": ("P", 6.0, "white", color_of("cross")),
    "birth": ("P", 6.0, "white", color_of("cross")),
    "hopf": ("*", 8.0, "white", TORUS),
    "border": ("|", 9.0, GREY, GREY),
    "doubling": ("D", 4.6, "white", color_of("below")),
    "change": ("^", 5.0, "white", TORUS),
    "pair": ("*", 8.0, "white", TORUS),
    "resonance": ("|", 9.0, GREY, GREY),
    "grazing": ("|", 9.0, GREY, GREY),
    "tip": ("*", 8.0, "white", BLACK),
    **{f"marker-{number}": (marker, 6.0, "white", BLACK, 1.0) for number, marker in enumerate("osD^vPX*<>")},
}
_DASHES = (0, (4, 2))  # of what is unstable
_THIN = 0.57  # width of a line in a panel below, which has dots on it
_WIDE_LETTER = 0.66  # width of a letter and what is between, as a share of its size: texts of lines do not touch
_OFFSET: Any = {"textcoords": "offset points"}
_RIGHT = 0.92  # share of the range beyond which a text is left of its point
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
    entries, finishes = Entries(), [write_letters(axes)] if len(axes) > 1 else []
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
        for finish in reversed(finishes):  # letters last
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
    ax.barh(rows, [each.moved for each in bars], height=0.44, color=FIRST, zorder=3)
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
    title = style.broken(panel.title, 72.0 * ax.bbox.height / ax.figure.dpi)
    ax.set(ylabel=title, xlabel=panel.across or parameter_words(panel.over, picture.system.units))
    if panel.margin is not None:
        ax.margins(x=panel.margin)
    elif panel.fitted:
        ax.margins(y=0.12)
    else:
        ax.set_ylim(0.0, 1.08 * ax.get_ylim()[1])

    def write() -> None:
        show_whole_symbols(ax)
        _write_notes(ax, panel.series, None)

    return write


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
        show_whole_symbols(ax)
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
    if not all(point.stable for each in shaped for point in each.curve.points):
        entries["unstable"] = stroke(BLACK, 0.9, _DASHES)
    for kind in style.in_order(special.kind for each in shaped for special in each.marked):
        look = style.symbol_style(kind)
        entries[look.text] = symbols(look.marker, 6.0, "white", BLACK, 0.6)
    plain = [each.curve for each in branches if not each.look]
    if not plain:
        return None
    drawing = BranchDrawing(plain, up)
    drawing.draw(ax, within)
    entries.update(drawing.entries(ax))
    return partial(drawing.finish, ax, picture.labels, closeup=False)


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
            is_upright = each.over == axes[0]
            look: Any = {"color": TINTS[each.tint], "linewidth": 0, "zorder": 0}
            if (studied := parts.within.get(axes[is_upright])) is None:
                (ax.axvspan if is_upright else ax.axhspan)(each.low, each.high, **look)
            else:  # beyond that range nothing is known
                (ax.fill_betweenx if is_upright else ax.fill_between)(studied, each.low, each.high, **look)
            entries.setdefault(each.text, TINTS[each.tint])
    for each in parts.lines:
        if each.of in ("", picture.of) and each.over in axes:
            line = ax.axvline if each.over == axes[0] else ax.axhline
            line(each.at, **stroke(GREY, 0.8, "-" if each.exact else ":", zorder=1))


def _write_values(picture: Picture, parts: Parts, ax: Axes) -> None:
    """Write the texts of upright lines above a panel, where they do not touch each other."""
    (low, high), taken = ax.get_xlim(), list[tuple[float, float]]()
    size, width = style.points(7.5), 72.0 * ax.bbox.width / ax.figure.dpi
    for each in sorted(parts.lines, key=lambda line: not line.exact):  # those that are exact have the room first
        is_named = each.text and picture.axes and each.over == picture.axes[0] and each.of in ("", picture.of)
        lines = [text for text in (each.text, each.kind) if text]
        middle, half = width * (each.at - low) / (high - low), _WIDE_LETTER * size * max(map(len, lines), default=0) / 2
        if is_named and all(middle + half < left or right < middle - half for left, right in taken):
            taken.append((middle - half, middle + half))
            at: Any = {"xycoords": ("data", "axes fraction"), "annotation_clip": False, "fontsize": size, **_OFFSET}
            ax.annotate("\n".join(lines), (each.at, 1.0), xytext=(0.0, 3.0), ha="center", va="bottom", **at)


def _write_notes(ax: Axes, series: Sequence[Series], shade: Shade | None) -> None:
    """Write the texts of points next to them: above or below, on the side of a shade; without one, above right."""
    for each in series:
        for note, x, y in zip(each.notes, np.asarray(each.x), np.asarray(each.y), strict=bool(each.notes)):
            place: Any = {"xytext": (4.0, 4.0)}
            if shade is not None:
                is_up = bool(shade.low + shade.high > 2.0 * y) is not bool(ax.yaxis_inverted())
                shift, side = (9.0, "bottom") if is_up else (-9.0, "top")
                place = {"xytext": (0.0, shift), "ha": "center", "va": side}
            color = _look(each.look)[0]
            if shade is None and x > ax.get_xlim()[0] + _RIGHT * np.ptp(
                ax.get_xlim()
            ):  # else it would cross the border
                place = {**place, "ha": "right", "xytext": (0.0, place["xytext"][1])}
            ax.annotate(note, (x, y), fontsize="small", color=color, **_OFFSET, **place)


# Pictures of run-ups: the time history over the speed with the response below, and largest forces over the rate.

_BELOW = 80.0  # dB below the highest level that cuts show
_DELAY = color_of("tint-late")
_CUTS: Any = (*((each.color, 1.3, each.dashes) for each in SEVERAL), (BLACK, 1.0))  # the loudest orders
_OTHERS: Any = (GREY, 0.4)
_LEVELS: Any = (("#b3b3b3", 3.2), (color_of("tint-one-wild"), 1.6))  # overall, below all others, and rattle
_FINE_HISTORY = 40_000  # points of a history up to which all are drawn


def _run_up_size(
    run: RunUp, signal: str = "", *, branch: Branch | None = None, orders: float = 0.0, **_: object
) -> Inches:
    return 8.0, 4.4 + 3.4 * (branch is not None) + 3.0 * (orders > 0.0)


@draws(RunUp, panels=True, size=_run_up_size)
def draw_run_up(
    run: RunUp,
    figure: AnyFigure,
    signal: str = "",
    *,
    branch: Branch | None = None,
    orders: float = 0.0,
    window: int = 8,
    title: str = "",
) -> Finish:
    """Draw a signal of a run-up over the speed; below it the response that a slow sweep meets, and an order map."""
    signal = signal or run.loudest
    delays: tuple[JumpDelay, ...] = ()
    if branch is not None and run.course.is_one_way:
        delays = run.delays(branch, run.coordinate_of(signal))
    write_answer(figure, title, [*run.sentences, *(each.words(run.system) for each in delays)])
    heights = [1.0, *[0.95] * (branch is not None), *[0.85, 0.7] * (orders > 0.0)]
    panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0].tolist()
    finishes = [write_letters(panels)] if len(panels) > 1 else []
    draw_history_over_speed(run, panels[0], signal)
    finish = None if branch is None else _lay_over(run, panels[1], branch, run.coordinate_of(signal), delays)
    if orders > 0.0:
        _draw_map(order_map(run, signal, orders, turns=window), panels[-2], panels[-1])
        for ax in panels[-2:] if run.course.is_invertible else ():
            _match_speeds(run, ax, float(run.waterfall(signal, orders, turns_of(run.system, window)).values[0]))

    def write() -> None:
        for each in (finish, *finishes):
            if each is not None:
                each()

    return write


def _match_speeds(run: RunUp, ax: Axes, first: float) -> None:
    """Give a panel of a map, which counts its speeds from the first one, the range of the run-up."""
    low, high = float(run.speed.min()), float(run.speed.max())
    sign = 1.0 if run.speed[-1] > run.speed[0] else -1.0
    ticks = [tick for tick in MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high) if low <= tick <= high]
    ax.set_xticks([sign * (tick - first) for tick in ticks], [f"{tick:g}" for tick in ticks])
    ax.set_xlim(sign * (low - first), sign * (high - first))


@draws(OrderMap, panels=True, size=(8.0, 6.4))
def draw_order_map(found: OrderMap, figure: AnyFigure, *, hertz: bool = False, title: str = "") -> None:
    """Draw an order map; below it the cuts through it, the overall level and that of rattle, over the same values."""
    write_heading(figure, title)
    above, below = figure.subplots(2, 1, height_ratios=[1.0, 0.75])
    _draw_map(found, above, below, in_hertz=hertz)
    write_letters([above, below])


def _draw_map(found: OrderMap, above: Axes, below: Axes, *, in_hertz: bool = False) -> None:
    """Draw a map in dB, and its cuts and levels."""
    spectra = found.spectra
    mesh = fill_waterfall(spectra, above, levels=(found.levels, DEPTH), in_hertz=in_hertz)
    above.figure.colorbar(mesh, ax=above, label=f"level [{found.unit}]", pad=0.01, extend="min")
    if not in_hertz:
        above.set_ylabel("multiples of Ω" if spectra.turns is None else "order")  # the room is small
    above.set_title(f"{spectra.signal}: {spectra.window}", fontsize="small", loc="left")
    ticks, words = above.get_xticks(), [each.get_text() for each in above.get_xticklabels()]
    places = np.concatenate(([0.0], np.cumsum(np.maximum(np.abs(np.diff(spectra.values)), 1e-12))))
    entries = []
    rms = [(f"order {order:g}" if spectra.turns else f"{order:g} Ω", spectra.cut(order)) for order in found.cuts]
    loudest = sorted(range(len(rms)), key=lambda place: -float(np.nanmax(rms[place][1])))[: len(_CUTS)]
    named = iter(_CUTS)
    looks = [next(named) if place in loudest else _OTHERS for place in range(len(rms))]
    levels = [(text, found.levels(sizes)) for text, sizes in rms]
    levels += [(text.partition(", root")[0], found.levels(sizes * np.sqrt(2.0))) for text, sizes in found.lines()]
    top = max(float(np.max(sizes[np.isfinite(sizes)], initial=-np.inf)) for _, sizes in levels)
    for (text, sizes), look in zip(levels, [*looks, *_LEVELS], strict=False):
        if (sizes > top - _BELOW).any():
            options = stroke(*look)
            below.plot(places, np.where(np.isfinite(sizes), sizes, np.nan), **options, zorder=2 + (look in _CUTS))
            entries += [(text, options)] * (look is not _OTHERS)
    if _OTHERS in looks:
        entries.append((f"{looks.count(_OTHERS)} more", stroke(*_OTHERS)))
    if in_hertz and spectra.units:  # the cuts through the map are lines there
        for order in found.cuts:
            above.plot(places, order * spectra.pitch, **stroke(GREY, 0.6, (0, (1, 2))))
    below.set_xticks(ticks, words)
    below.set_xlim(above.get_xlim())
    if np.isfinite(top):  # what is quieter than the map shows is cut off; above is room for the letter
        below.set_ylim(max(below.get_ylim()[0], top - _BELOW), top + 0.12 * _BELOW)
    room = 72.0 * below.bbox.height / below.figure.dpi
    below.set(ylabel=style.broken(f"level [{found.unit}]", room), xlabel=above.get_xlabel())
    above.set_xlabel("")
    write_legend(below, entries, "above")


def _force(system: System) -> str:
    return "torque" if system.units else "force"


def _lay_over(run: RunUp, ax: Axes, branch: Branch, coordinate: str, delays: Sequence[JumpDelay]) -> Finish:
    """Draw the response, half the range of each period of the run-up over it, and the delays of jumps shaded."""
    drawing = BranchDrawing([branch, *branch.beyond], f"half.{coordinate}")
    drawing.draw(ax, None)
    speed, half = run.half(coordinate)
    ax.set_autoscale_on(True)
    ax.plot(speed, half, zorder=6, **dots(4.5, FIRST))
    ax.autoscale_view()
    ax.set_autoscale_on(False)
    late = [each for each in delays if np.isfinite(each.jump)]
    for delay in late:
        ax.axvspan(*sorted((delay.fold, delay.jump)), color=_DELAY, linewidth=0, zorder=0)
    if run.course.is_invertible:
        ax.set_xlim(run.speed.min(), run.speed.max())
        ax.margins(x=0.01)
    entries: list[tuple[str, Any]] = [("run-up, each period", dots(4.5, FIRST)), *drawing.entries(ax)]
    entries += [("from the fold to the jump", _DELAY)] * bool(late)
    write_legend(ax, entries, "above")
    return partial(drawing.finish, ax, labels=False, closeup=False)


_LONG_LABEL = 22  # letters above which the unit of an axis is on a line of its own


def draw_history_over_speed(run: RunUp, ax: Axes, signal: str) -> None:
    """Draw one signal over the speed, or over time where the speed does not change in one direction."""
    values, units = run.signal(signal), run.system.units
    over_speed = run.course.is_invertible
    every = max(1, len(values) // _FINE_HISTORY)
    x = run.speed if over_speed else run.time
    ax.plot(x[::every], values[::every], **stroke(GREY, 0.5), zorder=2)
    entries = [("motion", stroke(GREY, 0.8))]
    if over_speed:
        speed, low, high = run.envelope(signal)
        for side in (low, high):
            ax.plot(speed, side, **stroke(FIRST, 1.3), zorder=4)
        entries += [("extremes of each period", stroke(FIRST, 1.3))]
    peaks = [peak for peak in run.peaks if peak.force]
    for peak in peaks:
        ax.axvline(peak.speed if over_speed else peak.time, **stroke(SECOND, 0.8), zorder=1)
    entries += [(f"largest contact {_force(run.system)}", stroke(SECOND, 0.8))] * bool(peaks)
    ax.set_xlabel(parameter_words(run.system.structure.pace, units) if over_speed else "time" + " [s]" * bool(units))
    words = signal_words(signal, units)
    ax.set_ylabel("\n[".join(words.rsplit(" [", 1)) if len(words) > _LONG_LABEL else words)
    ax.margins(x=0.01)
    if over_speed:
        ax.set_xlim(run.speed.min(), run.speed.max())
    write_legend(ax, entries, "above")


# Picture of tolerances: the response, the distributions of its special points, and what matters for each.

_REST, _MOST = "#dedede", 8
_WIDE = 0.82  # height of a distribution, as a share of its row
_NARROW = 0.05  # share of the range below which the widest distribution is a needle
_SHOWN = 0.003, 0.997  # quantiles between which a distribution is drawn at least


@draws(Tolerance, panels=True, size=lambda found, *_, **__: (8.0, 5.4 + 0.5 * len(found.points)))
def draw_tolerance(found: Tolerance, figure: AnyFigure, measure: str = "", *, title: str | None = None) -> Finish:
    """Draw the nominal response, below it the distribution of each special point, and bars of Sobol indices."""
    rows = max(1, len(found.points))
    halves: Any = figure.subfigures(2, 1, height_ratios=[3.6, 1.6 + 0.5 * rows])
    top, bottom = halves
    ax = top.subplots()
    low, high = reach(found)
    measure = measure or shown_measure(found.branch.system, found)
    finish = draw_branches(found.branch, ax, measure, legend="above", within=(low, high))
    left, right = bottom.subplots(1, 2, sharey=True, width_ratios=[2.2, 1.0])
    is_narrow = _is_narrow(found, high - low)
    _draw_distributions(left, found, None if is_narrow else (low, high))
    _draw_indices(right, bottom, found)
    if found.band is not None:
        for panel in (ax,) if is_narrow else (ax, left):
            panel.axvspan(*found.band, color=style.SHADE, zorder=0)
    text = f"{int(found.known.sum()):,} samples of {len(found.names)} parameters"
    if found.band is not None and found.known.any():
        symbol = parameter_symbol(found.parameter, found.branch.system.units)
        between = f"{found.band[0]:g} and {found.band[1]:g}"
        text += f": a fold between {symbol} = {between} in {found.chance(*found.band)}"
    write_answer(figure, title or "", [text])
    return finish


def _is_narrow(found: Tolerance, width: float) -> bool:
    """Return True if the distributions are needles in the range of the picture."""
    low, high = found.quantiles(0.05, 0.95)
    return bool(np.nanmax(high - low, initial=0.0) < _NARROW * width)


def _draw_distributions(ax: Axes, found: Tolerance, within: tuple[float, float] | None) -> None:
    """Draw a row for each point: its distribution, its median and the middle 90 % of it."""
    # Without a range, each distribution is drawn about the nominal value, which is written beside it.
    origins = np.array([0.0 if within else special.value for special in found.points])
    quantiles = found.quantiles(0.05, 0.5, 0.95) - origins
    values = found.values[found.known] - origins
    for row, special in enumerate(found.points):
        column = values[:, row][~np.isnan(values[:, row])]
        look = style.symbol_style(special.kind)
        color = style.GREY if special.kind is Kind.GRAZING else look.color
        if len(column) > 1:
            heights, edges = np.histogram(column, bins=min(BINS, max(5, int(np.sqrt(len(column))))))
            top = row + 0.4 - _WIDE * heights / heights.max()
            ax.stairs(top, edges, baseline=row + 0.4, fill=True, color=color, alpha=0.45, zorder=2)
            low, middle, high = quantiles[:, row]
            ax.plot([low, high], [row + 0.4] * 2, color=style.BLACK, linewidth=style.points(1.6), zorder=3)
            ax.plot([middle], [row + 0.4], "|", color=style.BLACK, markersize=style.points(8), zorder=3)
        ax.plot(
            [special.value - origins[row]], [row + 0.4], "o", color=style.BLACK, markersize=style.points(3), zorder=4
        )
    texts = [f"{each.kind}{f' {each.contact}' if each.contact else ''}" for each in found.points]
    if within is None:
        texts = [f"{text}  {each.value:.5g}" for text, each in zip(texts, found.points, strict=True)]
    for row, chance in enumerate(found.exists if found.known.any() else ()):
        if chance.count < chance.samples:
            texts[row] += f"\nin {100.0 * chance.value:.3g} %"
    ax.set_yticks(range(len(texts)), texts)
    words = parameter_words(found.parameter, found.branch.system.units)
    if within is None:
        farthest = float(np.nanmax(np.abs(found.quantiles(*_SHOWN) - origins), initial=0.0))
        ax.set(xlim=(-1.05 * farthest, 1.05 * farthest), xlabel=f"shift of {words}")
    else:
        ax.set(xlim=within, xlabel=words)
    ax.set_ylim(len(texts) - 0.5, -0.6)
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.set_title("distribution; bar: middle 90 %, dot: nominal", fontsize=style.points(8.5))


def _draw_indices(ax: Axes, figure: AnyFigure, found: Tolerance) -> None:
    """Draw first-order Sobol indices as stacked bars; what is left is grey."""
    first = np.array([np.nan_to_num(each.first) for each in found.influences]).reshape(-1, len(found.names))
    order = np.argsort(-first.sum(axis=0), kind="stable")[:_MOST].tolist()
    rows, left = np.arange(len(first)), np.zeros(len(first))
    entries = []
    for color, k in zip(meanings.FILLS, order, strict=False):
        options = {"color": color, "edgecolor": style.BLACK, "linewidth": style.points(0.4)}
        ax.barh(rows, first[:, k], 0.6, left=left, **options)
        entries.append((found.names[k], color))
        left = left + first[:, k]
    ax.barh(rows, np.maximum(0.0, 1.0 - left), 0.6, left=left, color=_REST, zorder=1)
    entries.append(("interactions and rest", _REST))
    ax.set(xlim=(0.0, 1.0), xlabel="share of the variance")
    ax.set_title("what matters (Sobol)", fontsize=style.points(8.5))
    ax.tick_params(axis="y", labelleft=False)
    write_legend(figure, entries)


# Picture of a scan: the best variations with what each claim comes to, and how many others fulfil as many.

_ROWS = 12  # variations that are drawn
_COLORS = {HOLDS: color_of("third"), FAILS: "#e9e8e2", UNKNOWN: "#ffffff"}
_WORDS = {HOLDS: "holds", FAILS: "no", UNKNOWN: "unknown"}
_INKS = {HOLDS: "#ffffff", FAILS: "#6a6a66", UNKNOWN: "#6a6a66"}
_TRIED, _RANDOM = meanings.FILLS[:2]
_WIDEST = 46  # letters of a variation in one line


def _rows(found: Scan) -> list[int]:
    return [0, *(index for index in found.best[:_ROWS] if found.scores[index] > 0)]


@draws(Scan, panels=True, size=lambda found, **_: (9.0, 2.6 + 0.34 * (len(_rows(found)) + len(found.claims))))
def draw_scan(found: Scan, figure: AnyFigure, *, title: str | None = None) -> Finish | None:
    """Draw a table of the best variations and claims, and beside it the shares of variations by number of claims."""
    claims = [f"claim {number}: {said(claim)}" for number, claim in enumerate(found.claims, start=1)]
    write_answer(figure, title or "", [found.sentence, *claims])
    panels: Any = figure.subplots(1, 2, width_ratios=[2.0, 1.0])
    _draw_table(panels[0], found)
    _draw_shares(panels[1], found)
    return None


def _draw_table(ax: Axes, found: Scan) -> None:
    rows, count = _rows(found), len(found.claims)
    for place, index in enumerate(rows):
        for claim, verdict in enumerate(found.holds[index].tolist()):
            ax.add_patch(_cell(claim, place, _COLORS[verdict]))
            ax.text(claim, place, _WORDS[verdict], ha="center", va="center", color=_INKS[verdict], fontsize="small")
    ax.set_xlim(-0.5, count - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xticks(range(count), [f"claim {number}" for number in range(1, count + 1)])
    ax.set_yticks(range(len(rows)), [_short(found.words(index)) for index in rows], fontsize="small")
    ax.tick_params(length=0, top=False, right=False)
    ax.tick_params(axis="x", labeltop=True, labelbottom=False)
    ax.spines[:].set_visible(False)
    ax.grid(visible=False)


def _cell(x: float, y: float, color: str):
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.47, y - 0.44), 0.94, 0.88, facecolor=color, edgecolor=GREY, linewidth=0.4)


def _short(words: str) -> str:
    """Break a long description after a comma."""
    if len(words) <= _WIDEST or ", " not in words:
        return words
    head, _, tail = words.partition(", ")
    return f"{head},\n{tail}"


def _draw_shares(ax: Axes, found: Scan) -> None:
    """Draw the share of variations by the number of claims that they fulfil: of those tried, and of random ones."""
    scores = np.arange(len(found.claims) + 1)
    groups = [("tried", found.variations.tried, _TRIED), ("random neighbours", found.variations.neighbours, _RANDOM)]
    height = 0.38
    for place, (name, which, color) in enumerate(groups):
        own = found.scores[which & (found.holds != UNKNOWN).any(axis=1)]
        if not len(own):
            continue
        shares = np.array([(own == score).mean() for score in scores])
        where = scores + (place - 0.5) * height
        ax.barh(where, shares, height, color=color, label=f"{name}: {len(own):,}")
        for y, score, share in zip(where, scores, shares, strict=True):
            ax.annotate(
                f"{int((own == score).sum())}",
                (share, y),
                textcoords="offset points",
                xytext=(3, 0),
                va="center",
                fontsize="small",
            )
    ax.set_xlim(0.0, 1.18)
    ax.set_yticks(scores)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("share of variations")
    ax.set_ylabel("claims that hold")
    ax.legend(loc="lower right", bbox_to_anchor=(1.02, 1.0), fontsize="small", frameon=False)
