"""Pictures of branches over their parameter: stable and unstable pieces, special points, and unexplained steps."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.patches import Rectangle
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator
from scipy.sparse.csgraph import connected_components

from gapwalk.answers.band_picture import band_series
from gapwalk.bifurcation.branch import Branch, Distance
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.model.measures import full_measure
from gapwalk.model.problems import did_you_mean
from gapwalk.model.words import measure_words, parameter_words, state_words
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.plot import style
from gapwalk.plot.picture import (
    WIDE,
    AnyFigure,
    Finish,
    Inches,
    draws,
    open_window,
    shorten_label,
    stacked,
    write_heading,
    write_legend,
    write_letters,
)
from gapwalk.plot.style import CLUSTER, GREY, SHADE, birth_options, broken, period_options, points, stroke

# Placement of labels next to points, and of close-ups of dense regions, in free places of a picture.

_SIZE = 7.5  # points
_DIRECTIONS = np.deg2rad(np.arange(0, 360, 22.5))
_DISTANCES = np.array([8.0, 13.0, 19.0, 27.0])  # of a label from its symbol, in points
_SYMBOL = 4.0  # half the width of a symbol, in points
_WORST = 18.0  # cost above which a label is omitted, because it would hide too much: the legend explains its symbol

_NEAR = 20.0  # distance of two symbols below which they are close together, in points
_CROWD = 4  # fewest close symbols for a close-up
_GAIN = 1.6  # smallest magnification of a close-up
_SIZES = ((0.56, 0.6), (0.5, 0.55), (0.44, 0.5), (0.38, 0.44), (0.32, 0.38))  # of the close-up, in widths of the axes
_MARGIN = (0.055, 0.075)  # for the numbers left of the close-up and below it


_TICKS = 2.5  # points between two ticks, so that both are seen
_LEAST = 3  # points of such a cluster
_APART = (
    8.0,
    12.0,
    16.5,
)  # points between two symbols, a symbol and a cluster, and two clusters, so that both are seen


class Label(NamedTuple):
    """A text for a point of the picture, in its data coordinates."""

    text: str
    x: float
    y: float


def place_labels(ax: Axes, labels: list[Label], curve: NDArray[np.float64], symbols: NDArray[np.float64]) -> None:
    """Write labels into a picture with final limits and layout."""
    # Shapes: `curve`, `symbols` (points, 2).
    unit = ax.figure.dpi / 72.0  # pixels in a point
    inside = ax.get_window_extent()
    line = _clipped(_dense(ax.transData.transform(curve), 2.0 * unit), inside)
    dots = _clipped(ax.transData.transform(symbols), inside)
    taken = [child.get_window_extent() for child in ax.child_axes]
    boxes = [(box.x0, box.y0, box.x1, box.y1) for box in taken]
    shifts = np.column_stack((np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)))
    for label in labels:
        anchor = ax.transData.transform((label.x, label.y))
        half = np.array([0.33 * points(_SIZE) * len(label.text) + 0.5, 0.5 * points(_SIZE)]) * unit
        distances = np.repeat(_DISTANCES, len(shifts))
        directions = np.tile(shifts, (len(_DISTANCES), 1))
        centers = anchor + directions * (distances[:, None] * unit + half * np.abs(directions) - 0.3 * half)
        low, high = centers - half, centers + half
        costs = _hits(line, low, high, 1.5 * unit) + 4.0 * _hits(dots, low, high, _SYMBOL * unit)
        costs += 0.35 * (distances - _DISTANCES[0])
        for box in boxes:
            costs += 100.0 * ((low < box[2:]) & (high > box[:2])).all(axis=1)
        costs += 100.0 * ((low < inside.p0) | (high > inside.p1)).any(axis=1)
        best = int(np.argmin(costs))
        if costs[best] < _WORST:
            boxes.append((*low[best], *high[best]))
            _write(ax, label, (centers[best] - anchor) / unit, leader=distances[best] > _DISTANCES[1])


def clusters_of(ax: Axes, symbols: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Return the groups of symbols that would lie on one another in a picture with final limits, as their indices."""
    # Symbols closer than they are wide are merged into their middle, again and again, until no two marks touch.
    #
    # Shapes: `symbols` (points, 2).
    places = ax.transData.transform(symbols) * (72.0 / ax.figure.dpi)
    groups = [np.array([number]) for number in range(len(places))]
    merged = True
    while merged:
        merged, kept = False, list[NDArray[np.intp]]()
        middles, sizes = np.empty((len(groups), 2)), np.zeros(len(groups), dtype=int)
        for group in groups:
            middle, count = places[group].mean(axis=0), len(kept)
            large = (sizes[:count] >= _LEAST).astype(int) + int(len(group) >= _LEAST)
            away = np.hypot(*(middles[:count] - middle).T) / np.take(_APART, large)
            if count and away.min() < 1.0:
                nearest, merged = int(np.argmin(away)), True
                kept[nearest] = np.concatenate((kept[nearest], group))
                middles[nearest], sizes[nearest] = places[kept[nearest]].mean(axis=0), len(kept[nearest])
            else:
                middles[count], sizes[count] = middle, len(group)
                kept.append(group)
        groups = kept
    return [group for group in groups if len(group) >= _LEAST]


def apart(ax: Axes, places: NDArray[np.float64]) -> list[int]:
    """Return the indices of ticks that can be told apart in a picture with final limits, in their order."""
    # Shapes: `places` (points, 2).
    spots = ax.transData.transform(places) * (72.0 / ax.figure.dpi)
    kept: list[int] = []
    for number, place in enumerate(spots):
        if not kept or np.hypot(*(spots[kept] - place).T).min() >= _TICKS:
            kept.append(number)
    return kept


def draw_clusters(ax: Axes, symbols: NDArray[np.float64], clusters: Sequence[NDArray[np.intp]]) -> NDArray[np.float64]:
    """Draw a mark with a number in place of each cluster; return the places of the marks, shape (clusters, 2)."""
    middles = [ax.transData.transform(symbols[cluster]).mean(axis=0) for cluster in clusters]
    places = ax.transData.inverted().transform(np.reshape(middles, (-1, 2)))
    ax.plot(*places.T, zorder=5.5, **CLUSTER.options())
    for place, cluster in zip(places, clusters, strict=True):
        text = str(len(cluster))
        size = points(_SIZE * (0.9 if len(text) < 3 else 0.68))
        ax.annotate(text, tuple(place), ha="center", va="center_baseline", fontsize=size, zorder=5.6)
    return places


def _write(ax: Axes, label: Label, shift: NDArray[np.float64], leader: bool) -> None:
    line = {"arrowstyle": "-", "lw": 0.5, "color": GREY, "shrinkA": 0, "shrinkB": 2.5}
    ax.annotate(
        label.text,
        (label.x, label.y),
        xytext=(float(shift[0]), float(shift[1])),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=points(_SIZE),
        zorder=6,
        arrowprops=line if leader else None,
    )


def _hits(points: NDArray[np.float64], low, high, margin: float) -> NDArray[np.float64]:
    """Count the points in each box, with a margin."""
    x, y = points[:, 0], points[:, 1]
    hit = (x > low[:, :1] - margin) & (x < high[:, :1] + margin)
    hit &= (y > low[:, 1:] - margin) & (y < high[:, 1:] + margin)
    return np.count_nonzero(hit, axis=1).astype(float)


def _dense(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Interpolate points at even distances along a line, or along several with rows of nan between them."""
    gaps = np.flatnonzero(np.isnan(points[:, 0]))
    if len(gaps):
        parts = [part[~np.isnan(part[:, 0])] for part in np.split(points, gaps)]
        return np.vstack([_dense(part, spacing) for part in parts if len(part)])
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    even = np.arange(0.0, lengths[-1] + spacing, spacing)
    return np.column_stack([np.interp(even, lengths, points[:, i]) for i in (0, 1)])


def _clipped(points: NDArray[np.float64], box) -> NDArray[np.float64]:
    return points[((points > box.p0 - 50) & (points < box.p1 + 50)).all(axis=1)]


class Region(NamedTuple):
    """A part of a picture, in data coordinates."""

    left: float
    right: float
    low: float
    high: float

    def holds(self, x: float, y: float) -> bool:
        """Return True if a point lies inside."""
        return self.left <= x <= self.right and self.low <= y <= self.high

    def meets(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
        """Return True if a part of a line lies inside."""
        # Between two points, too: a long segment may cross a narrow region.
        low, high = (np.array([function(each[:-1], each[1:]) for each in (x, y)]) for function in (np.fmin, np.fmax))
        meets = (high[0] >= self.left) & (low[0] <= self.right) & (high[1] >= self.low) & (low[1] <= self.high)
        return bool(meets.any()) or (len(x) == 1 and self.holds(x[0], y[0]))


def crowded_region(ax: Axes, symbols: NDArray[np.float64]) -> Region | None:
    """Find the region with the most symbols close together; None if there are too few."""
    if len(symbols) < _CROWD:
        return None
    pixels = ax.transData.transform(symbols)
    reach = _NEAR * ax.figure.dpi / 72.0
    near = np.hypot(*(pixels[:, None] - pixels[None]).transpose(2, 0, 1)) < reach
    _, groups = connected_components(near, directed=False)  # chains of symbols that are near
    largest = np.flatnonzero(groups == np.argmax(np.bincount(groups)))
    if len(largest) < _CROWD:
        return None
    corner, opposite = pixels[largest].min(axis=0), pixels[largest].max(axis=0)
    size = opposite - corner
    pad = np.maximum(0.14 * size, min(8.0, size.max()))  # not so wide that they lie on one another there too
    if not pad.all():
        return None
    (left, low), (right, high) = ax.transData.inverted().transform([corner - pad, opposite + pad])
    return Region(float(left), float(right), float(low), float(high))


def draw_closeup(ax: Axes, region: Region, curve: NDArray[np.float64]) -> Axes | None:
    """Create empty axes for a region in the largest free place of the picture; None if no place is large enough."""
    # Shapes: `curve` (points, 2).
    inside = ax.transAxes.inverted()
    line = inside.transform(ax.transData.transform(curve))
    (left, low), (right, high) = inside.transform(
        ax.transData.transform([(region.left, region.low), (region.right, region.high)])
    )
    for width, height in _SIZES:
        if min(width / (right - left), height / (high - low)) < _GAIN:
            continue
        place = _free_place(line, width, height)
        if place is not None:
            closeup = ax.inset_axes((*place, width, height), xlim=region[:2], ylim=region[2:])
            closeup.tick_params(labelsize=points(7), length=2.5)
            closeup.set_autoscale_on(False)
            _connect(ax, region, closeup)
            return closeup
    return None


def _connect(ax: Axes, region: Region, closeup: Axes) -> None:
    """Draw a frame around the region, and a line between its nearest corner and that of the close-up."""
    size = (region.right - region.left, region.high - region.low)
    ax.add_patch(Rectangle((region.left, region.low), *size, fill=False, edgecolor=GREY, linewidth=0.6, zorder=4))
    corners = [(x, y) for x in (region.left, region.right) for y in (region.low, region.high)]
    here, there = ax.transData.transform(corners), closeup.get_window_extent().corners()
    distances = np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(int(np.argmin(distances)), distances.shape)
    line = ax.transData.inverted().transform([here[i], there[j]])
    ax.plot(*line.T, **stroke(GREY, 0.6), zorder=1, scalex=False, scaley=False)


def _free_place(line: NDArray[np.float64], width: float, height: float) -> tuple[float, float] | None:
    """Find the lower left corner of a free place, as far up and to the right as possible."""
    for y in np.arange(0.97 - height, 0.05, -0.02):
        for x in np.arange(0.975 - width, 0.05, -0.02):
            hit = (line[:, 0] > x - _MARGIN[0]) & (line[:, 0] < x + width + 0.015)
            hit &= (line[:, 1] > y - _MARGIN[1]) & (line[:, 1] < y + height + 0.02)
            if not hit.any():
                return float(x), float(y)
    return None


Curves = Callable[[BranchPoint], NDArray[np.float64]]
"""Function that returns the heights of the curves to draw at a point of a branch, shape (curves,)."""

_SUBSTEPS = 5  # parts into which each step of a branch is divided to draw a smooth curve
_SAME = 1e-9  # arclength below which two points coincide
_MARKERS = (0.015, 0.035)  # position of the first marker along a line, and marker distance, in diagonals of the axes
_PAD = 0.06  # margin above and below, as a fraction of the height
_TICK = 7.0  # length of the tick at a grazing point, in points
_STABLE, _UNSTABLE = 1.7, 0.7  # widths of the lines in an overlay, in points


class Piece(NamedTuple):
    """A piece of a branch with constant stability, cut exactly at special points."""

    label: str  #: The kind of instability, see `Instability.label`.
    x: NDArray[np.float64]  #: shape (points,): Parameter. Neighbouring pieces share the point between them.
    y: NDArray[np.float64]  #: shape (points,) or (points, curves): One measure, or several.


def pieces_of(branch: Branch, measure: str, away: Distance | None = None) -> list[Piece]:
    """Cut a branch into pieces, in the order in which it was computed."""
    pieces = cut(branch, lambda point: np.array([point.measure(measure)]), away)
    return [piece._replace(y=piece.y[:, 0]) for piece in pieces]


def cut(branch: Branch, curves: Curves, away: Distance | None = None) -> list[Piece]:
    """Cut a branch into pieces, with curves whose heights a function of the points returns.

    Over distances the computed points alone are joined: between them, a root has no smooth curve.
    """
    if not branch.points:
        return []
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
            if away is not None:
                line = values[start : end + 1]
                line = np.column_stack((away(line[:, 0]), line[:, 1:]))
            else:
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
    lines = [np.column_stack((piece.x, piece.y)) for piece in pieces]
    return drawable(np.concatenate(lines)) if lines else np.empty((0, 2))


def drawable(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leave out the points that have no place along the axis; raise a ModelError if none has one."""
    found = points[~np.isnan(points[:, 0])]
    if not len(found):
        raise ModelError('no point lies on this side of the special point: write x = "below ..." or x = "above ..."')
    return found


def over_distance(ax: Axes, away: Distance | None, units: Any, parameter: str) -> None:
    """Make the axis of the parameter one of distances, if wanted."""
    if away is not None:
        words = parameter_words(parameter, units)
        shown = {
            0: f"|{words} − {away.value:.10g}|",
            1: f"{words} − {away.value:.10g}",
            -1: f"{away.value:.10g} − {words}",
        }
        ax.set(xscale="log", xlabel=shown[away.side])


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
        The branches of each system, by the name that the legend shows. All branches must follow the same parameter.
    measure
        As in `draw_branches`.
    ax
        Axes to draw in; by default those of a new figure of pyplot.
    within
        Range of the parameter that is shown; by default that of all branches.

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
            color, dashes = style.LISTED[number % len(style.LISTED)]
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
    x: str = "",
) -> Finish:
    """Draw a branch, or several over the same parameter.

    `x` is instead the distance from a special point or value, on a logarithmic axis: ``"above grazing 1"``, ``"below
    fold 2"``, ``"distance from 0.85"``.
    """
    branches = [branches, *branches.beyond] if isinstance(branches, Branch) else list(branches)
    drawing = BranchDrawing(branches, measure, x)
    closeup = closeup and not x
    settled = drawing.draw(ax, within)
    if legend:
        drawing.legend = (settled, "above" if legend == "above" else "below")
        drawing.write_legend(ax)
    return partial(drawing.finish, ax, labels, closeup)


def _draw_bands(ax: Axes, branches: Sequence[Branch], measure: str) -> list[tuple[str, dict[str, Any]]]:
    """Draw the settled motions of branches; return the entries of a legend."""
    entries = []
    for each in band_series(branches, measure):
        if is_wide := each.mark == "between":
            ax.fill_between(each.x, *np.asarray(each.y), color=style.GREY, alpha=0.18, linewidth=0, zorder=1)
        else:
            ax.plot(each.x, each.y, zorder=2.4, **stroke(style.GREY, 1.0))
        if each.text:
            entries.append((each.text, stroke(style.GREY, 6.0, alpha=0.3) if is_wide else stroke(style.GREY, 1.0)))
    return entries


class BranchDrawing:
    """Lines and symbols of some branches, for the whole picture and for a close-up, and the legend of what is drawn."""

    def __init__(self, branches: Sequence[Branch], measure: str, x: str = "") -> None:
        self.branches = branches
        self.away = away = Distance.of(branches, x) if x else None
        self.measure = measure = full_measure(measure, branches[0].system.coordinates)
        self.pieces = [piece for branch in branches for piece in pieces_of(branch, measure, away)]
        self.curve = curve_of(self.pieces)
        self.special_points = [
            (special.kind, place, special.point.measure(measure))
            for branch in branches
            for special in branch.special_points
            if not np.isnan(place := special.value if away is None else float(away(special.value)))
        ]
        self.unexplained = [
            place
            for branch in branches
            for place in unexplained_places(branch, lambda point: np.array([point.measure(measure)]))
            if away is None
        ]
        self.legend: tuple[Sequence[tuple[str, Any]], Literal["above", "below"]] | None = None
        self._drawn: set[str] = set()  # texts of the legend of the symbols that were drawn in the final layout

    def draw(self, ax: Axes, within: tuple[float, float] | None) -> list[tuple[str, dict[str, Any]]]:
        """Draw the lines and set the limits; return the entries of a legend of settled motions."""
        self.draw_lines(ax)
        settled = _draw_bands(ax, self.branches, self.measure) if self.away is None else []
        name_axes(ax, self.branches[0], self.measure)
        over_distance(ax, self.away, self.branches[0].system.units, self.branches[0].parameter)
        ax.margins(x=0.02, y=0.06)
        ax.autoscale_view()
        if within:
            ax.set(xlim=within, ylim=extent_of(self.curve, *within))
        ax.set_autoscale_on(False)  # labels are placed for these limits
        return settled

    def entries(self, ax: Axes) -> list[tuple[str, dict[str, Any]]]:
        """List the lines and symbols within the axes, for a legend; before the final layout as they will be."""
        inside = Region(*sorted(ax.get_xlim()), *sorted(ax.get_ylim()))
        labels = {piece.label for piece in self.pieces if inside.meets(piece.x, piece.y)}
        shown, _, clusters = self._shown(ax)
        symbols = self._drawn or self._symbols(ax, shown, clusters)
        looks = [*map(style.symbol_style, style.in_order(kind for kind, _, _ in self.special_points))]
        return [
            *(look.entry for name, look in style.LINES.items() if name in labels),
            *(look.entry for look in (*looks, CLUSTER, style.UNEXPLAINED) if look.legend in symbols),
        ]

    def write_legend(self, ax: Axes, foreseen: Collection[str] = ()) -> None:
        """Write the legend, which `finish` writes again if other symbols were drawn than foreseen."""
        if self.legend is not None:
            settled, where = self.legend
            write_legend(ax, [*self.entries(ax), *settled], where, instead=foreseen)

    def _shown(
        self, ax: Axes, without: Region | None = None
    ) -> tuple[list[tuple[Kind, float, float]], NDArray[np.float64], list[NDArray[np.intp]]]:
        """Return points within axes that do not lie on one another, places of all with names, and clusters."""
        inside = Region(*sorted(ax.get_xlim()), *sorted(ax.get_ylim()))
        shown = [each for each in self.special_points if inside.holds(*each[1:])]
        shown = [each for each in shown if without is None or not without.holds(*each[1:])]
        # Ticks at grazing points hide nothing: they are left out only where they are too close to be told apart.
        ticks = [each for each in shown if each[0] is Kind.GRAZING]
        named = [each for each in shown if each[0] is not Kind.GRAZING]
        places = np.array([(x, y) for _, x, y in named]).reshape(-1, 2)
        clusters = clusters_of(ax, places)
        hidden = {int(number) for cluster in clusters for number in cluster}
        kept = [each for number, each in enumerate(named) if number not in hidden]
        spots = np.array([(x, y) for _, x, y in ticks]).reshape(-1, 2)
        return [*kept, *(ticks[number] for number in apart(ax, spots))], places, clusters

    def _symbols(self, ax: Axes, shown: Sequence[tuple[Kind, float, float]], clusters: Sequence[Any]) -> set[str]:
        """Return the texts of the legend of the symbols in axes."""
        inside = Region(*sorted(ax.get_xlim()), *sorted(ax.get_ylim()))
        unexplained = [style.UNEXPLAINED.legend] if any(inside.holds(*place) for place in self.unexplained) else []
        return {
            *(style.symbol_style(kind).legend for kind, _, _ in shown),
            *[CLUSTER.legend] * bool(clusters),
            *unexplained,
        }

    def draw_lines(self, ax: Axes) -> None:
        """Draw the pieces of the branches."""
        for piece in self.pieces:
            marked = bool(style.LINES[piece.label].marker)
            options = style.LINES[piece.label].options(markevery=_MARKERS if marked else None)
            ax.plot(piece.x, piece.y, zorder=2.5 if marked else 3, **options)

    def finish(self, ax: Axes, labels: bool, closeup: bool) -> None:
        """Draw the special points, and a close-up where they are dense, once the layout of the axes is final."""
        shorten_label(ax)
        foreseen = self.entries(ax)
        marked = np.array([(x, y) for kind, x, y in self.special_points if kind is not Kind.GRAZING])
        crowd = crowded_region(ax, marked) if closeup else None
        enlarged = draw_closeup(ax, crowd, self.curve) if crowd else None
        self._draw_special_points(ax, labels, without=crowd if enlarged else None)
        if enlarged:
            self.draw_lines(enlarged)
            self._draw_special_points(enlarged, labels)
        if [text for text, _ in self.entries(ax)] != [text for text, _ in foreseen]:
            self.write_legend(ax, [text for text, _ in foreseen])

    def _draw_special_points(self, ax: Axes, labels: bool, without: Region | None = None) -> None:
        """Draw the symbols and their labels outside a given region; those that would lie on one another as a number."""
        shown, places, clusters = self._shown(ax, without)
        middles = draw_clusters(ax, places, clusters)
        self._drawn |= self._symbols(ax, shown, clusters)
        kinds = style.in_order(kind for kind, _, _ in shown)
        for kind in kinds:
            spots = np.array([(x, y) for each, x, y in shown if each is kind])
            if kind is Kind.GRAZING:
                _draw_ticks(ax, spots, self.curve)
            else:
                ax.plot(*spots.T, zorder=5, **style.symbol_style(kind).options())
        draw_unexplained(ax, self.unexplained)
        texts = [
            Label(style.symbol_style(kind).label, x, y)
            for kind, x, y in sorted(shown, key=lambda each: kinds.index(each[0]))
            if style.symbol_style(kind).label
        ]
        if labels and texts:
            marks = np.array([(x, y) for _, x, y in shown] + middles.tolist())
            place_labels(ax, texts, self.curve, marks)


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


# Pictures of diagrams: a measure of all motions, or their stroboscopic states.
#
# In the stroboscopic picture a motion of period m gives m curves, its states one forcing period apart.

Range = tuple[float, float]

_NAMED = 16  # most names in a picture
_MANY, _MOST = 8, 0.8  # fewest branch origins for a close-up, and the fraction of all origins that it must contain
_PART = 0.45  # largest fraction of the whole range for a close-up


class Birth(NamedTuple):
    """A special point at which other branches begin or end: parameter, point, and the period of its branch."""

    value: float
    point: BranchPoint
    period: int


def births_of(diagram: Diagram) -> Iterator[Birth]:
    """Yield the special points of a diagram at which other branches begin or end."""
    for member in diagram.members:
        for index, special in enumerate(member.branch.special_points):
            if diagram.attached(member.name, index):
                yield Birth(special.value, special.point, member.period)


def crowded_range(values: Sequence[float], within: Range) -> Range | None:
    """Return the range of the parameter in which most branches begin, if it is only a part of the whole range."""
    births = np.sort(values)
    count = math.ceil(_MOST * len(births))
    if count < _MANY:
        return None
    widths = births[count - 1 :] - births[: len(births) - count + 1]
    first = int(np.argmin(widths))
    low, high = within
    pad = _PAD * widths[first]
    left, right = max(low, births[first] - pad), min(high, births[first + count - 1] + pad)
    return (float(left), float(right)) if right - left < _PART * (high - low) else None


def _closeup(diagram: Diagram, closeup: Range | Literal[False] | None, stable: bool) -> Range | None:
    if closeup is None:
        return None if stable else crowded_range([birth.value for birth in births_of(diagram)], diagram.within)
    return closeup or None


def _size(
    diagram: Diagram,
    closeup: Range | Literal[False] | None = None,
    strobes: bool = False,
    stable: bool = False,
    x: str = "",
    **_: object,
) -> Inches:
    return stacked((2 if _closeup(diagram, False if x else closeup, stable) else 1) + strobes)


@draws(Diagram, panels=True, size=_size)
def draw_diagram(
    diagram: Diagram,
    figure: AnyFigure,
    measure: str = "half",
    *,
    labels: bool = True,
    legend: bool = True,
    closeup: Range | Literal[False] | None = None,
    strobes: bool = False,
    instabilities: bool = False,
    stable: bool = False,
    up_to: int | None = None,
    x: str = "",
    title: str = "",
) -> Finish:
    """Draw a measure of all motions of a diagram in the colours of their periods, and a close-up if they are crowded.

    With `strobes`, the last panel shows their states once every forcing period: a motion of period m gives m curves.
    With `instabilities`, unstable motions have the line of their kind. With `stable`, only stable motions are drawn;
    `up_to` is the longest period. `x` is as in `draw_branches`.
    """
    diagram = _part_of(diagram, up_to)
    measure = full_measure(measure, diagram.branches[0].system.coordinates)
    crowd = _closeup(diagram, False if x else closeup, stable)
    main = Motions(diagram, measure, stable, x)
    drawn = [main, *[main] * bool(crowd), *[Motions(diagram, measure.partition(".")[2], stable, x)] * strobes]
    panels = figure.subplots(len(drawn), 1, squeeze=False)[:, 0].tolist()
    write_heading(figure, title)
    if len(panels) > 1:
        write_letters(panels)
    for place, (panel, each) in enumerate(zip(panels, drawn, strict=True)):
        within = crowd if crowd and place == 1 else None
        each.draw(panel, instabilities, within)
        if within:
            panels[0].axvspan(*within, color=SHADE, linewidth=0, zorder=0.5)
            panel.set_title("the shaded range of a", fontsize="small")
        panel.set_autoscale_on(False)
    if legend:
        main.write_legend(panels[0], instabilities, names=labels)
    return partial(_finish, drawn, panels, crowd) if labels else None


def _part_of(diagram: Diagram, up_to: int | None) -> Diagram:
    """Return a diagram up to a period; raise a ModelError if nothing is left of it."""
    members = tuple(each for each in diagram.members if up_to is None or each.period <= up_to)
    if not members:
        longest = f" of period {up_to} or shorter" * (up_to is not None)
        raise ModelError(f"the diagram has no branches{longest} yet, so there is nothing to draw")
    return replace(diagram, members=members)


def _finish(drawn: Sequence[Motions], panels: Sequence[Axes], crowd: Range | None) -> None:
    for place, (each, panel) in enumerate(zip(drawn, panels, strict=True)):
        shorten_label(panel)
        each.draw_names(panel, without=crowd if place == 0 else None)


@draws(Diagram)
def draw_strobes(
    diagram: Diagram,
    ax: Axes,
    measure: str = "",
    *,
    labels: bool = True,
    legend: bool = True,
    within: Range | None = None,
    instabilities: bool = False,
    stable: bool = False,
    up_to: int | None = None,
    x: str = "",
) -> Finish:
    """Draw one panel of a diagram: the states of all motions once per forcing period, or a measure of them.

    The options are those of `draw_diagram`.
    """
    diagram = _part_of(diagram, up_to)
    coordinates = diagram.branches[0].system.coordinates
    if measure and measure not in coordinates:
        if "." not in full_measure(measure, coordinates):
            raise ModelError(f"there is no coordinate {measure!r}; {did_you_mean(measure, coordinates)}")
        if not stable:
            return draw_branches(diagram.branches, ax, measure, labels=labels, legend=legend, within=within, x=x)
    motions = Motions(diagram, measure or coordinates[0], stable, x)
    motions.draw(ax, instabilities, within or (None if x else diagram.within), margin=0.0 if within else 0.02)
    if legend:
        motions.write_legend(ax, instabilities, names=labels)
    return partial(motions.draw_names, ax) if labels else None


class Motions:
    """Curves of a measure of the motions of a diagram, or of a coordinate once every forcing period, by periods."""

    def __init__(self, diagram: Diagram, measure: str, stable: bool = False, x: str = "") -> None:
        self.system = diagram.branches[0].system
        self.away = away = Distance.of(diagram.branches, x) if x else None
        self.diagram, self.measure, self.stable = diagram, measure, stable
        self.is_strobed = measure in self.system.coordinates
        self.periods = sorted({member.period for member in diagram.members})
        self.pieces: list[tuple[DiagramBranch, list[Piece]]] = [
            (member, [each for each in cut(member.branch, self._heights, away) if each.label == "stable" or not stable])
            for member in diagram.members
        ]
        births = [] if stable else births_of(diagram)
        placed = (each if away is None else each._replace(value=float(away(each.value))) for each in births)
        self.births = [each for each in placed if not np.isnan(each.value)]

    def draw(self, ax: Axes, instabilities: bool = False, within: Range | None = None, margin: float = 0.0) -> None:
        """Draw all curves (short periods over long ones), origins of branches, and unexplained steps."""
        for rank, period in reversed(list(enumerate(self.periods))):
            curves: dict[str, list[tuple[NDArray[np.float64], NDArray[np.float64]]]] = {}
            for piece in (piece for member, pieces in self.pieces if member.period == period for piece in pieces):
                look = piece.label if instabilities or piece.label == "stable" else ""
                curves.setdefault(look, []).extend((piece.x, y) for y in piece.y.T)
            for look, each in curves.items():
                is_stable = look == "stable"
                options = self._unstable(look) if look and not is_stable else period_options(period, rank, is_stable)
                if self.stable:  # however short, a piece is seen
                    options["solid_capstyle"] = "round"
                ax.plot(*joined(each), zorder=(4 if is_stable else 3) - 0.1 * rank, **options)
            births = [birth for birth in self.births if birth.period == period]
            if births:
                heights = [self._heights(birth.point) for birth in births]
                values = np.repeat([birth.value for birth in births], [len(each) for each in heights])
                ax.plot(values, np.concatenate(heights), zorder=5 - 0.1 * rank, **birth_options(period, rank))
        for member in () if self.stable or self.away else self.diagram.members:
            draw_unexplained(ax, unexplained_places(member.branch, self._heights))
        units, words = self.system.units, state_words if self.is_strobed else measure_words
        ax.set(xlabel=parameter_words(self.diagram.parameter, units), ylabel=broken(words(self.measure, units)))
        over_distance(ax, self.away, units, self.diagram.parameter)
        places = drawable(self.curve)[:, 0]
        left, right = within or (self.diagram.within if self.away is None else (places.min(), places.max()))
        pad = margin * (right - left) if within else 0.02 * (right - left)
        limits = (left - pad, right + pad) if self.away is None else (left, right)
        ax.set(xlim=limits, ylim=extent_of(self.curve, left, right))
        ax.set_autoscale_on(False)

    @staticmethod
    def _unstable(label: str) -> dict[str, Any]:
        """Return the line of a kind of instability, without markers, since states crowd."""
        look = style.LINES[label]
        return stroke(look.color, 0.7 * look.width, look.line, solid_capstyle="butt")

    def write_legend(self, ax: Axes, instabilities: bool = False, *, names: bool = False) -> None:
        """Write a legend above the axes of what lies within them: periods, stability, and origins of branches."""
        inside = Region(*ax.get_xlim(), *ax.get_ylim())
        drawn = {
            (member.period, piece.label)
            for member, pieces in self.pieces
            for piece in pieces
            if any(inside.meets(piece.x, y) for y in piece.y.T)
        }
        labels = {label for _, label in drawn}
        entries = [
            (f"period {period}", period_options(period, rank, stable=True))
            for rank, period in enumerate(self.periods)
            if any(each == period for each, _ in drawn)
        ]
        if instabilities:
            kinds = [label for label in style.LINES if label in labels - {"stable"}]
            entries += [(style.LINES[label].text, self._unstable(label)) for label in kinds]
        elif not self.stable:
            for text, stable in (("stable", True), ("unstable", False)):
                if ("stable" in labels) if stable else labels - {"stable"}:
                    entries.append((text, period_options(1, 0, stable) | {"color": GREY}))
        if any(inside.holds(birth.value, y) for birth in self.births for y in self._heights(birth.point)):
            entries.append(("a branch begins or ends", birth_options(1, 0)))
        note = "P2-1: first branch of period 2" if names and self._named() else ""
        write_legend(ax, entries + unexplained_entries(self.diagram.branches), "above", note)

    def _named(self) -> list[DiagramBranch]:
        """Return the branches that have names: those of the two shortest periods, if they are not too many."""
        counts = Counter(member.period for member in self.diagram.members)
        periods = [period for period in self.periods[:2] if counts[period] > 1 or period != self.periods[0]]
        named = [member for member in self.diagram.members if member.period in periods]
        return named if len(named) <= _NAMED else []

    def draw_names(self, ax: Axes, without: Range | None = None) -> None:
        """Write names next to the branches of the two shortest periods, outside of a given range of the parameter."""
        named = self._named()
        labels = [
            label
            for member, pieces in self.pieces
            if member in named and pieces and (label := self._label(member, pieces, ax.get_xlim(), without))
        ]
        if labels:
            place_labels(ax, labels, self.curve, np.empty((0, 2)))

    @cached_property
    def curve(self) -> NDArray[np.float64]:
        """All curves joined, with rows of nan between them, shape (points, 2)."""
        curves = [(piece.x, y) for _, pieces in self.pieces for piece in pieces for y in piece.y.T]
        return np.column_stack(joined(curves))

    def _label(
        self, member: DiagramBranch, pieces: Sequence[Piece], shown: Range, without: Range | None
    ) -> Label | None:
        """Return the name of a branch at its point farthest from the other curves; None if that is not shown."""
        x, y = (np.concatenate(parts) for parts in zip(*((piece.x, piece.y[:, 0]) for piece in pieces), strict=True))
        inside = (x >= shown[0]) & (x <= shown[1])
        if without:
            inside &= (x < without[0]) | (x > without[1])
        if not inside.any():
            return None
        middle = float(np.nanmedian(self.curve[:, 1]))
        best = int(np.argmax(np.where(inside, np.abs(y - middle), -1.0)))
        return Label(member.name, float(x[best]), float(y[best]))

    def _heights(self, point: BranchPoint) -> NDArray[np.float64]:
        if self.is_strobed:
            return stroboscopic(point.orbit)[:, self.system.coordinates.index(self.measure)]
        return np.array([point.measure(self.measure)])
