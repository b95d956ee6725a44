"""The picture of a comparison: two results over one another, and below how far apart they are."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gapwalk.bifurcation.branch import Branch, Kind
from gapwalk.plot.pieces import pieces_of
from gapwalk.plot.sheet import new_sheet, sheet_bytes
from gapwalk.plot.style import BLACK, BLUE, GREY, SIZE, SYMBOLS, VERMILLION, in_style
from gapwalk.plot.words import full_measure, measure_words, parameter_words
from gapwalk.study.comparison import ResultComparison
from gapwalk.study.export import write_whole
from gapwalk.study.result import Result

_PALE = "#8fc3e8"
_FIRST: dict[str, Any] = {"color": _PALE, "linewidth": 4.6, "solid_capstyle": "round", "zorder": 2}
_SECOND: dict[str, Any] = {"color": BLACK, "linewidth": 1.1, "zorder": 3}
_DASHES = (0, (3.2, 1.6))
_ALONE: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 12.0,
    "markerfacecolor": "none",
    "markeredgecolor": VERMILLION,
    "markeredgewidth": 1.1,
    "zorder": 6,
}
_ZERO = 1e-12  # share below which a distance is drawn as this


def save_comparison(
    found: ResultComparison,
    path: str | os.PathLike[str],
    *,
    measure: str | None = None,
    tolerance: float | None = None,
    names: tuple[str, str] = ("the first", "the second"),
) -> None:
    """Draw a comparison into a file, PNG or SVG by its ending; parameters as `plot_comparison`.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    form = os.fspath(path).rpartition(".")[2]
    figure = plot_comparison(found, measure, tolerance=tolerance, names=names)
    write_whole(path, sheet_bytes(figure, form))


def plot_comparison(
    found: ResultComparison,
    measure: str | None = None,
    *,
    tolerance: float | None = None,
    names: tuple[str, str] = ("the first", "the second"),
) -> Figure:
    """Draw two results over one another, and below them their distance over the parameter.

    Parameters
    ----------
    found
        The comparison.
    measure
        What is drawn of branches, as in `plot_branch`; by default what the first study says. Maps show their loci.
    tolerance
        Drawn as a line in the lower panel.
    names
        What to call the results.
    """
    results = found.results
    is_map, units = results[0].map is not None, results[0].system.units
    full = full_measure(measure or results[0].walked.measure, results[0].system.coordinates)
    with in_style():
        figure = new_sheet((SIZE[0], 6.4))
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.4))
        above.set_title(results[0].title.replace("$", r"\$"), wrap=True)
        for result, options, is_second in ((results[0], _FIRST, False), (results[1], _SECOND, True)):
            if is_map:
                _draw_loci(above, result, options)
            else:
                _draw_branches(above, result, full, options, dashed=is_second)
        if not is_map:
            _ring_lone_branches(above, found, full)
        above.set_ylabel(parameter_words(found.parameters[-1], units) if is_map else measure_words(full, units))
        _draw_distances(below, found, tolerance)
        below.set_xlabel(parameter_words(found.parameters[0], units))
        below.set_ylabel("share of the ranges")
        _draw_legend(figure, found, names, tolerance)
    return figure


def _draw_branches(ax: Axes, result: Result, measure: str, options: dict[str, Any], *, dashed: bool) -> None:
    for branch in result.branches:
        for piece in pieces_of(branch, measure):
            (line,) = ax.plot(piece.x, piece.y, **options)
            if dashed and piece.label != "stable":
                line.set_linestyle(_DASHES)
        for special in branch.special_points:
            ax.plot(special.value, special.point.measure(measure), **_symbol(special.kind, first=not dashed))


def _draw_loci(ax: Axes, result: Result, options: dict[str, Any]) -> None:
    assert result.map is not None
    for locus in result.map.loci:
        ax.plot(*locus.values.T, **options)


def _symbol(kind: Kind, *, first: bool) -> dict[str, Any]:
    """The symbol of a special point: large and pale of the first result, small and filled of the second."""
    style = SYMBOLS[kind]
    size = style.size + 4.0 if first else style.size - 0.5
    return {
        "linestyle": "none",
        "marker": style.marker,
        "markersize": size,
        "markerfacecolor": "white" if first else style.color,
        "markeredgecolor": BLUE if first else (GREY if kind is Kind.GRAZING else BLACK),
        "markeredgewidth": 1.2 if first else 0.6,
        "zorder": 4 if first else 5,
    }


def _ring_lone_branches(ax: Axes, found: ResultComparison, measure: str) -> None:
    """Ring the special points that one result has alone, and the ends of branches that one has alone."""
    for result, pairs, lone in zip(
        found.results, [[(p.names[k], p.only[k]) for p in found.pairs] for k in (0, 1)], found.only, strict=True
    ):
        branches = dict(zip(result.names, result.branches, strict=True))
        for name, alone in pairs:
            for special in branches[name].special_points if name in branches else ():
                if any(special.value == each.values[0] for each in alone):
                    ax.plot(special.value, special.point.measure(measure), **_ALONE)
        for name in lone:
            _ring_middle(ax, branches[name], measure)


def _ring_middle(ax: Axes, branch: Branch, measure: str) -> None:
    point = branch.points[len(branch.points) // 2]
    ax.plot(point.value, point.measure(measure), **_ALONE)


def _draw_distances(ax: Axes, found: ResultComparison, tolerance: float | None) -> None:
    """The distance of each point from the other result, and of each special point from its partner."""
    for pair in found.pairs:
        places, distances = pair.places[:, 0], np.maximum(pair.distances, _ZERO)
        ax.plot(places, distances, linestyle="none", marker=".", markersize=2.6, color=GREY, zorder=2)
        for shift in pair.shifts:
            kind = _kind_of(shift.label)
            options = _symbol(kind, first=False) if kind else {"marker": "o", "color": GREY, "markersize": 4.0}
            ax.plot(shift.first[0], max(shift.share, _ZERO), **options)
    if tolerance is not None:
        ax.axhline(tolerance, color=VERMILLION, linewidth=1.0, linestyle=(0, (5, 2)), zorder=1)
    ax.set_yscale("log")


def _kind_of(label: str) -> Kind | None:
    word = label.partition(" ")[0]
    return Kind(word) if word in tuple(Kind) else None


def _draw_legend(figure: Figure, found: ResultComparison, names: tuple[str, str], tolerance: float | None) -> None:
    lines = [(names[0], _FIRST), (names[1], _SECOND)]
    handles = [Line2D([], [], label=text, **options) for text, options in lines]
    if found.results[0].map is None:
        handles.append(Line2D([], [], label="unstable in the second", **_SECOND, linestyle=_DASHES))
    words = {shift.label.partition(" ")[0] for pair in found.pairs for shift in pair.shifts}
    handles += [
        Line2D([], [], label=SYMBOLS[kind].text, **_symbol(kind, first=False)) for kind in SYMBOLS if kind in words
    ]
    handles.append(Line2D([], [], label="distance", linestyle="none", marker=".", color=GREY))
    if any(found.only) or any(any(pair.only) for pair in found.pairs):
        handles.append(Line2D([], [], label="in one of them only", **{**_ALONE, "markersize": 8.0}))
    if tolerance is not None:
        handles.append(Line2D([], [], label=f"tolerance {tolerance:g}", color=VERMILLION, linestyle=(0, (5, 2))))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, columnspacing=1.8, handlelength=3.0)
