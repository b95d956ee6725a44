"""The picture of a family: all members in one panel, and their special points, joined, in another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.locus import Codim2
from gapwalk.errors import ModelError
from gapwalk.plot.map_style import CODIM2, SECTION, codim2_options, locus_options
from gapwalk.plot.pieces import pieces_of
from gapwalk.plot.sheet import new_sheet, open_window
from gapwalk.plot.size import takes_size
from gapwalk.plot.style import BLACK, GREY, LINES, SIZE, SYMBOLS, in_style, symbol_options
from gapwalk.plot.words import full_measure, measure_words, parameter_words
from gapwalk.study.family.joint import Fate, Joint
from gapwalk.study.family.record import Family

AnyFigure = Figure | SubFigure

_TALL = (SIZE[0], 7.6)
# without its light end, which vanishes on white: even in grey, and for any form of colour vision
_COLOURS = LinearSegmentedColormap.from_list("members", mpl.colormaps["viridis"](np.linspace(0.0, 0.88, 128)))
_SMALL = 0.62  # size of the symbols of special points, of which a family has many
_THIN = 0.75  # width of the lines of members, of which there are several
_MOST_TICKS = 12
_COLUMNS = 4
_TURN: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 4.6,
    "markerfacecolor": "white",
    "markeredgecolor": BLACK,
    "markeredgewidth": 0.9,
}
_OUTSIDE: dict[str, Any] = _TURN | {"marker": "s", "markersize": 4.0, "markeredgecolor": GREY}
_GUESS: dict[str, Any] = {"color": GREY, "linestyle": (0, (1.0, 2.2)), "linewidth": 1.0}


@takes_size
def plot_family(
    family: Family, measure: str = "half", *, figure: AnyFigure | None = None, legend: bool = True, title: str = ""
) -> AnyFigure:
    """Draw a family in two panels: a measure of the motions of all members, and where their special points are.

    In the first a colour is a member, and the style of a line tells stability. The second has the value of what differs
    over the same parameter: lines lead from special points of one member to those of the next.

    Parameters
    ----------
    family
        The family.
    measure
        What the first panel shows, as in `plot_branch`.
    figure
        Where to draw; by default in a new figure of pyplot.
    legend
        Whether to explain what is drawn.
    title
        A line above the picture.

    Returns
    -------
    Figure or SubFigure
        The figure that was drawn in.

    Raises
    ------
    ModelError
        If the family has no branches, or there is no such measure.
    """
    if not family.branches:
        raise ModelError("the family has no branches yet, so there is nothing to draw")
    measure = full_measure(measure, family.system.coordinates)
    figure = figure or open_window(_TALL)
    with in_style():
        panels = figure.subplots(2, 1, sharex=True, height_ratios=[1.25, 1.0])
        colours = ScalarMappable(Normalize(min(family.over.axis), max(family.over.axis)), _COLOURS)
        _draw_members(panels[0], family, measure, colours)
        panels[0].set_ylabel(measure_words(measure))
        panels[0].tick_params(labelbottom=True)
        _draw_joints(panels[1], family)
        panels[1].set(xlabel=parameter_words(family.parameter), ylabel=parameter_words(family.over.name))
        panels[1].set_xlim(*family.within)
        panels[1].margins(y=0.05)
        for letter, panel in zip("ab", panels, strict=True):
            panel.text(0.012, 0.975, letter, transform=panel.transAxes, va="top", weight="bold", zorder=7)
        _draw_bar(figure, panels, family, colours)
        if title:
            panels[0].set_title(title.replace("$", r"\$"), wrap=True)
        if legend:
            _draw_legend(figure, family)
    return figure


def draw_family(family: Family, measure: str = "half", title: str = "") -> Figure:
    """The picture of a family as a matplotlib figure, without pyplot."""
    figure = new_sheet(_TALL)
    plot_family(family, measure, figure=figure, title=title)
    return figure


def _draw_members(ax: Axes, family: Family, measure: str, colours: ScalarMappable) -> None:
    ranks = _ranks(family)
    shades = _COLOURS(colours.norm(np.array([member.value for member in family.members])))
    for member, color in zip(family.members, shades, strict=True):
        for branch in member.branches:
            width = _THIN * (1.0 if ranks[branch.period] == 0 else 0.6)
            for piece in pieces_of(branch, measure):
                style = LINES[piece.label]
                ax.plot(piece.x, piece.y, color=color, linestyle=style.line, linewidth=width * style.width, zorder=3)
            for special in branch.special_points:
                if special.kind is not Kind.GRAZING:
                    ax.plot(special.value, special.point.measure(measure), zorder=5, **_small(special.kind))
    ax.margins(y=0.05)


def _draw_joints(ax: Axes, family: Family) -> None:
    ranks = _ranks(family)
    for member in family.members:
        ax.axhline(member.value, zorder=1.5, **SECTION)
        for _, special in member.special_points:
            ax.plot(special.value, member.value, zorder=4, **_small(special.kind))
    for joint in _joints(family):
        if joint.curve:
            options = _GUESS if joint.fate is Fate.NEAR else locus_options(joint.kind, ranks[joint.period])
            ax.plot(*np.array(joint.curve).T, zorder=2.5 if joint.kind is Kind.GRAZING else 3.0, **options)
        for passage in joint.passages:
            if CODIM2[Codim2(passage.kind)].label:
                ax.plot(passage.first, passage.value, zorder=6, **codim2_options(Codim2(passage.kind)))
        if joint.at is not None and _leads_nowhere(joint):
            ax.plot(*(joint.at if joint.fate is Fate.OUTSIDE else joint.curve[-1]), zorder=5, **_OUTSIDE)
        if joint.at is None:
            continue
        if joint.fate is Fate.MET and not _has_symbol(joint.event):
            ax.plot(*joint.at, zorder=5, **_TURN)


def _leads_nowhere(joint: Joint) -> bool:
    """Whether a way leads to a member, but to none of the branches that are known there."""
    return joint.fate is Fate.OUTSIDE or (joint.fate is Fate.MET and joint.end is None)


def _has_symbol(event: str) -> bool:
    """Whether what happens has a symbol of its own."""
    return event in list(Codim2) and bool(CODIM2[Codim2(event)].label)


def _draw_bar(figure: AnyFigure, panels: Any, family: Family, colours: ScalarMappable) -> None:
    """The bar of colours beside both panels, so that they stay of one width."""
    axis = sorted(family.over.axis)
    ticks = axis if len(axis) <= _MOST_TICKS else None
    text = parameter_words(family.over.name)
    bar = figure.colorbar(colours, ax=panels.tolist(), label=text, ticks=ticks, pad=0.015, fraction=0.03, aspect=50)
    bar.ax.minorticks_off()
    if ticks:
        bar.ax.set_yticklabels([f"{value:.4g}" for value in ticks])


def _draw_legend(figure: AnyFigure, family: Family) -> None:
    labels = [
        name for name in LINES if any(each.label == name for branch in family.branches for each in branch.instabilities)
    ]
    handles = [
        Line2D([], [], label=LINES[name].text, color=GREY, linestyle=LINES[name].line, linewidth=LINES[name].width)
        for name in labels
    ]
    ranks = _ranks(family)
    kinds = {(special.kind, special.orbit.period) for branch in family.branches for special in branch.special_points}
    for kind in SYMBOLS:
        for period, rank in ranks.items():
            if (kind, period) in kinds:
                text = SYMBOLS[kind].text + (f", period {period}" if len(ranks) > 1 else "")
                line = locus_options(kind, rank) if kind is not Kind.BRANCH_POINT else {}
                handles.append(Line2D([], [], label=text, **(_small(kind) | line)))
    handles += _event_handles(family)
    columns = math.ceil(len(handles) / math.ceil(len(handles) / _COLUMNS))  # as even as can be
    where = "outside lower center" if isinstance(figure, Figure) and figure.get_constrained_layout() else "lower center"
    figure.legend(handles=handles, loc=where, ncols=columns, columnspacing=1.6, handlelength=2.8)


def _event_handles(family: Family) -> Iterator[Line2D]:
    """What happens between members."""
    joints = list(_joints(family))
    events = {passage.kind for joint in joints for passage in joint.passages}
    events |= {joint.event for joint in joints if joint.fate is Fate.MET}
    for kind, style in CODIM2.items():
        if kind.value in events and style.label:
            yield Line2D([], [], label=f"{style.text} ({style.label})", **codim2_options(kind))
    if any(joint.fate is Fate.MET and not _has_symbol(joint.event) for joint in joints):
        yield Line2D([], [], label="two meet", **_TURN)
    if any(_leads_nowhere(joint) for joint in joints):
        yield Line2D([], [], label="leads to no known branch", **_OUTSIDE)
    if any(joint.fate is Fate.NEAR for joint in joints):
        yield Line2D([], [], label="joined by nearness", **_GUESS)


def _small(kind: Kind) -> dict[str, Any]:
    options = symbol_options(kind)
    return options | {
        "markersize": _SMALL * options["markersize"],
        "markeredgewidth": 0.4 if kind is not Kind.GRAZING else 0.7,
    }


def _ranks(family: Family) -> dict[int, int]:
    """The periods that occur, the shortest first, with their ranks."""
    return {period: rank for rank, period in enumerate(sorted({branch.period for branch in family.branches}))}


def _joints(family: Family) -> Iterator[Joint]:
    for joints in (family.joints or {}).values():
        yield from joints
