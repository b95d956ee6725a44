"""Pictures of branches over their parameter: stable and unstable pieces, special points, and unexplained steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.model.words import full_measure, measure_words, parameter_words
from gapwalk.plot import style
from gapwalk.plot.labels import (
    MANY,
    Label,
    Region,
    apart,
    clusters_of,
    crowded_region,
    draw_closeup,
    draw_clusters,
    place_labels,
)
from gapwalk.plot.picture import Finish, draws
from gapwalk.plot.sheet import WIDE, open_window, shorten_label, write_legend

Curves = Callable[[BranchPoint], NDArray[np.float64]]
"""Function that returns the heights of the curves to draw at a point of a branch, shape (curves,)."""

_SUBSTEPS = 5  # parts into which each step of a branch is divided to draw a smooth curve
_SAME = 1e-9  # arclength below which two points coincide
_MARKERS = (0.015, 0.035)  # position of the first marker along a line, and marker distance, in diagonals of the axes
_PAD = 0.06  # margin above and below, as a fraction of the height
_TICK = 7.0  # length of the tick at a grazing point, in points
_OVERLAID: tuple[tuple[str, Any], ...] = (  # colour and dashes of each system of an overlay
    (style.BLACK, "-"),
    (style.VERMILLION, (0, (4.5, 1.6))),
    (style.BLUE, (0, (1.3, 1.3))),
    (style.GREEN, (0, (6, 1.5, 1.3, 1.5))),
)
_STABLE, _UNSTABLE = 1.7, 0.7  # widths of the lines in an overlay, in points


class Piece(NamedTuple):
    """A piece of a branch with constant stability, cut exactly at special points."""

    label: str  #: The kind of instability, see `Instability.label`.
    x: NDArray[np.float64]  #: shape (points,): Parameter. Neighbouring pieces share the point between them.
    y: NDArray[np.float64]  #: shape (points,) or (points, curves): One measure, or several.


def pieces_of(branch: Branch, measure: str) -> list[Piece]:
    """Cut a branch into pieces, in the order in which it was computed."""
    return [piece._replace(y=piece.y[:, 0]) for piece in cut(branch, lambda point: np.array([point.measure(measure)]))]


def cut(branch: Branch, curves: Curves) -> list[Piece]:
    """Cut a branch into pieces, with curves whose heights a function of the points returns."""
    states = zip(branch.points, branch.instabilities, strict=True)
    nodes = [(point.arclength, point, state.label, False) for point, state in states]
    nodes += [(each.point.arclength, each.point, each.after.label, True) for each in branch.special_points]
    nodes.sort(key=lambda node: node[0])
    s = np.array([arclength for arclength, *_ in nodes])
    values = np.array([(point.value, *curves(point)) for _, point, *_ in nodes])
    # A node begins its piece: a special point has the label of the piece after it.
    starts = [i for i in range(len(nodes)) if i == 0 or nodes[i][2] != nodes[i - 1][2]]
    pieces = []
    for start, end in zip(starts, [*starts[1:], len(nodes) - 1], strict=True):
        if end > start or len(nodes) == 1:
            special = [i for i in range(start, end + 1) if nodes[i][3] or i in (start, end)]
            special = special if len(special) > 1 else [start, end]
            line = np.concatenate([smooth_line(s[a : b + 1], values[a : b + 1]) for a, b in pairwise(special)])
            pieces.append(Piece(nodes[start][2], line[:, 0], line[:, 1:]))
    return pieces


def smooth_line(s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate points between two special points smoothly; at a special point the curve may have a corner."""
    distinct = (s - s[0] > _SAME) & (s[-1] - s > _SAME) & np.append(True, np.diff(s) > _SAME)
    distinct[[0, -1]] = True
    s, values = s[distinct], values[distinct]
    if len(s) < 3:
        return values
    fine = np.interp(np.linspace(0, len(s) - 1, _SUBSTEPS * (len(s) - 1) + 1), np.arange(len(s)), s)
    line = Akima1DInterpolator(s, values, method="makima")(fine)
    line[::_SUBSTEPS] = values  # exactly, so that pieces meet in one point
    return line


def joined(
    curves: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Join curves of one style into one with nan between them: a thousand lines draw a hundred times slower."""
    breaks = np.cumsum([len(x) for x, _ in curves])
    x, y = (np.insert(np.concatenate(parts), breaks, np.nan) for parts in zip(*curves, strict=True))
    return x, y


def curve_of(pieces: Sequence[Piece]) -> NDArray[np.float64]:
    """Return the points of pieces with one measure, one after the other, shape (points, 2)."""
    return np.concatenate([np.column_stack((piece.x, piece.y)) for piece in pieces])


def extent_of(curve: NDArray[np.float64], left: float, right: float) -> tuple[float, float]:
    """Return the smallest and the largest height of a curve within a range of the parameter, with a margin."""
    inside = curve[(curve[:, 0] >= left) & (curve[:, 0] <= right), 1]
    low, high = (float(inside.min()), float(inside.max())) if len(inside) else (0.0, 1.0)
    pad = _PAD * ((high - low) or 1.0)
    return low - pad, high + pad


def name_axes(ax: Axes, branch: Branch, measure: str) -> None:
    """Write the parameter of a branch and a measure next to the axes."""
    ax.set_xlabel(parameter_words(branch.parameter, branch.system.units))
    room = 72.0 * ax.bbox.height / ax.figure.dpi
    ax.set_ylabel(style.broken(measure_words(measure, branch.system.units), room))


def unexplained_places(branch: Branch, curves: Curves) -> list[tuple[float, float]]:
    """Return places where a special point was missed: the middle of each unexplained step, on each curve."""
    if not branch.unexplained:
        return []
    values, places = branch.values, []
    for each in branch.unexplained:
        step = int(np.argmin(np.abs(values[:-1] - each.first) + np.abs(values[1:] - each.last)))
        heights = 0.5 * (curves(branch.points[step]) + curves(branch.points[step + 1]))
        places += [(0.5 * (each.first + each.last), float(height)) for height in heights]
    return places


def draw_unexplained(ax: Axes, places: Sequence[tuple[float, float]], clip_on: bool = True) -> None:
    """Draw question marks at missed special points; without clipping they are complete at the border of the axes."""
    if places:
        ax.plot(*np.array(places).T, zorder=6, **style.UNEXPLAINED.options(clip_on=clip_on))


def unexplained_entries(branches: Sequence[Branch]) -> list[tuple[str, dict[str, Any]]]:
    """Return the legend entry of the question marks, if there are any."""
    return [style.UNEXPLAINED.entry] if any(branch.unexplained for branch in branches) else []


def overlay(
    branches: Mapping[str, Sequence[Branch]],
    measure: str = "half",
    *,
    ax: Axes | None = None,
    within: tuple[float, float] | None = None,
) -> Axes:
    """Draw branches of several systems in one picture, each system in its own line style; unstable parts are thin.

    Parameters
    ----------
    branches
        The branches of each system by its name in the legend. All have the same parameter.
    measure
        As in `draw_branches`.
    ax
        Axes to draw in; by default those of a new figure of pyplot.
    within
        Range of the parameter that is shown; by default all of it.

    Returns
    -------
    Axes
        The axes of the picture.

    Examples
    --------
    >>> stiffer = gw.follow(gw.find_orbit(system.at({"stop.stiffness": 40.0})), "frequency", 1.6)
    >>> axes = gw.plot.overlay({"20": [branch], "40": [stiffer]}, "max.x", within=(1.1, 1.5))
    >>> len(axes.lines) > 1
    True
    """
    first = next(iter(branches.values()))[0]
    measure = full_measure(measure, first.system.coordinates)
    window = open_window(WIDE) if ax is None else None
    with style.in_style():
        place = window.add_subplot() if window is not None else ax
        assert place is not None
        entries, pieces = [], []
        for number, (name, each) in enumerate(branches.items()):
            color, dashes = _OVERLAID[number % len(_OVERLAID)]
            styles = [style.LineStyle("", color, dashes, width).options() for width in (_STABLE, _UNSTABLE)]
            for piece in (piece for branch in each for piece in pieces_of(branch, measure)):
                place.plot(piece.x, piece.y, **styles[piece.label != "stable"])
                pieces.append(piece)
            entries.append((name, styles[0]))
        entries.append(("thin: unstable", style.LineStyle("", style.BLACK, "-", _UNSTABLE).options()))
        if within:
            place.set(xlim=within, ylim=extent_of(curve_of(pieces), *within))
        name_axes(place, first, measure)
        write_legend(place, entries, "inside")
    return place


@draws(Branch, alone={"closeup": True}, several=True)
def draw_branches(
    branches: Branch | Sequence[Branch],
    ax: Axes,
    measure: str = "half",
    *,
    labels: bool = True,
    legend: bool | Literal["above"] = True,
    closeup: bool = False,
    within: tuple[float, float] | None = None,
) -> Finish:
    """Draw a branch, or several over the same parameter."""
    branches = [branches] if isinstance(branches, Branch) else list(branches)
    first = branches[0]
    measure = full_measure(measure, first.system.coordinates)
    drawing = _Drawing(branches, measure)
    drawing.draw_lines(ax)
    name_axes(ax, first, measure)
    ax.margins(x=0.02, y=0.06)
    ax.autoscale_view()
    if within:
        ax.set(xlim=within, ylim=extent_of(drawing.curve, *within))
    ax.set_autoscale_on(False)  # labels are placed for these limits
    if legend:
        write_legend(ax, line_entries(branches), "above" if legend == "above" else "below")
    return partial(drawing.finish, ax, labels, closeup)


def line_entries(branches: Sequence[Branch]) -> list[tuple[str, dict[str, Any]]]:
    """List lines and symbols that occur, for a legend; a piece between special points may contain no point."""
    counts = {count.label for branch in branches for count in branch.instabilities}
    counts |= {special.after.label for branch in branches for special in branch.special_points}
    entries = [look.entry for name, look in style.LINES.items() if name in counts]
    kinds = {special.kind for branch in branches for special in branch.special_points}
    entries += [style.symbol_style(kind).entry for kind in style.in_order(kinds)]
    many = sum(len(branch.special_points) for branch in branches) > MANY
    return [*entries, *([style.CLUSTER.entry] if many else []), *unexplained_entries(branches)]


class _Drawing:
    """Lines and symbols of some branches, for the whole picture and for a close-up."""

    def __init__(self, branches: Sequence[Branch], measure: str) -> None:
        self.pieces = [piece for branch in branches for piece in pieces_of(branch, measure)]
        self.curve = curve_of(self.pieces)
        self.special_points = [
            (special.kind, special.value, special.point.measure(measure))
            for branch in branches
            for special in branch.special_points
        ]
        self.unexplained = [
            place
            for branch in branches
            for place in unexplained_places(branch, lambda point: np.array([point.measure(measure)]))
        ]

    def draw_lines(self, ax: Axes) -> None:
        for piece in self.pieces:
            marked = bool(style.LINES[piece.label].marker)
            options = style.LINES[piece.label].options(markevery=_MARKERS if marked else None)
            ax.plot(piece.x, piece.y, zorder=2.5 if marked else 3, **options)

    def finish(self, ax: Axes, labels: bool, closeup: bool) -> None:
        """Draw the special points, and a close-up where they are dense, once the layout of the axes is final."""
        shorten_label(ax)
        marked = np.array([(x, y) for kind, x, y in self.special_points if kind is not Kind.GRAZING])
        crowd = crowded_region(ax, marked) if closeup else None
        enlarged = draw_closeup(ax, crowd, self.curve) if crowd else None
        self.draw_special_points(ax, labels, without=crowd if enlarged else None)
        if enlarged:
            self.draw_lines(enlarged)
            self.draw_special_points(enlarged, labels)

    def draw_special_points(self, ax: Axes, labels: bool, without: Region | None = None) -> None:
        """Draw the symbols, and the labels outside a given region; of very many, clusters with their number."""
        inside = Region(*ax.get_xlim(), *ax.get_ylim())
        shown = [each for each in self.special_points if inside.holds(*each[1:])]
        middles = np.empty((0, 2))
        if len(shown) > MANY:
            shown, middles = _gathered(ax, shown)
        kinds = style.in_order(kind for kind, _, _ in shown)
        for kind in kinds:
            places = np.array([(x, y) for each, x, y in shown if each is kind])
            if kind is Kind.GRAZING:
                _draw_ticks(ax, places, self.curve)
            else:
                ax.plot(*places.T, zorder=5, **style.symbol_style(kind).options())
        draw_unexplained(ax, self.unexplained)
        texts = [
            Label(style.symbol_style(kind).label, x, y)
            for kind, x, y in sorted(shown, key=lambda each: kinds.index(each[0]))
            if style.symbol_style(kind).label and not (without and without.holds(x, y))
        ]
        if labels and texts:
            marks = np.array([(x, y) for _, x, y in shown] + middles.tolist())
            place_labels(ax, texts, self.curve, marks)


def _gathered(
    ax: Axes, shown: Sequence[tuple[Kind, float, float]]
) -> tuple[list[tuple[Kind, float, float]], NDArray[np.float64]]:
    """Draw marks with numbers in place of points that would lie on one another; return the others, and the marks.

    Ticks at grazing points hide nothing: they are left out only where they are too close to be told apart.
    """
    ticks = [each for each in shown if each[0] is Kind.GRAZING]
    named = [each for each in shown if each[0] is not Kind.GRAZING]
    symbols = np.array([(x, y) for _, x, y in named]).reshape(-1, 2)
    clusters = clusters_of(ax, symbols)
    middles = draw_clusters(ax, symbols, clusters)
    hidden = {int(number) for cluster in clusters for number in cluster}
    kept = [each for number, each in enumerate(named) if number not in hidden]
    places = np.array([(x, y) for _, x, y in ticks]).reshape(-1, 2)
    return [*kept, *(ticks[number] for number in apart(ax, places))], middles


def _draw_ticks(ax: Axes, places: NDArray[np.float64], curve: NDArray[np.float64]) -> None:
    """Draw short ticks across the curve in one collection, each perpendicular to the curve."""
    pixels = ax.transData.transform(curve)
    ticks = []
    for place in ax.transData.transform(places):
        here = int(np.argmin(np.hypot(*(pixels - place).T)))
        along = pixels[min(here + 1, len(pixels) - 1)] - pixels[max(here - 1, 0)]
        across = np.array([-along[1], along[0]]) / (float(np.hypot(*along)) or 1.0)
        ticks.append(Path([-0.5 * across, 0.5 * across]))
    look = style.symbol_style(Kind.GRAZING).options()
    ax.add_collection(
        PathCollection(
            ticks,
            sizes=[_TICK**2],
            offsets=places,
            offset_transform=ax.transData,
            transform=IdentityTransform(),
            edgecolors=look["markeredgecolor"],
            linewidths=look["markeredgewidth"],
            zorder=4,
        ),
        autolim=False,
    )
