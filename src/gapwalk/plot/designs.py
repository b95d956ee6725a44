"""Picture of a design: the response before and after with the bands of the goals, and bars of the changes."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gapwalk.answers.design import Design
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.branch import Branch
from gapwalk.model.words import full_measure, parameter_symbol
from gapwalk.plot.branches import name_axes, pieces_of
from gapwalk.plot.picture import AnyFigure, Inches, draws, write_answer, write_legend, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREY, VERMILLION, in_order, points, stroke, symbol_style, symbols

_BAND = "#fbe3c4"
_LIMIT = "#e9e9e9"
_SIZE: Inches = (8.0, 7.2)
_DASHES = (0, (4, 2))


@draws(Design, panels=True, size=_SIZE)
def draw_design(found: Design, figure: AnyFigure, measure: str = "", *, title: str = "") -> None:
    """Draw the responses before and after with the bands of the goals shaded, and the changes as bars."""
    count = len(found.changes)
    panels = figure.subplots(2, 1, height_ratios=[2.6, 0.45 + 0.26 * count])
    write_answer(figure, title, [found.sentence])
    write_letters(panels)
    draw_responses(found, panels[0], measure)
    draw_changes(found, panels[1])
    write_legend(figure, _entries(found))


@draws(Design)
def draw_responses(found: Design, ax: Axes, measure: str = "") -> None:
    """Draw the responses before and after in one panel."""
    measure = full_measure(measure or shown_measure(found.system, found), found.system.coordinates)
    for low, high in _bands(found):
        ax.axvspan(low, high, color=_BAND, linewidth=0, zorder=0)
        for value in (low, high):
            ax.axvline(value, **stroke(VERMILLION, 0.7, zorder=1))
    kinds = {getattr(goal, "kind", None) for goal in found.goals}
    for branch, color, rank in _branches(found):
        for piece in pieces_of(branch, measure):
            stable = piece.label == "stable"
            line = stroke(color, 1.7 if stable else 0.9, "-" if stable else _DASHES, zorder=3 + rank)
            ax.plot(piece.x, piece.y, **line)
        for special in branch.special_points:
            if special.kind in kinds:
                style = symbol_style(special.kind)
                mark = symbols(style.marker, 6.0, color, BLACK, 0.6, zorder=6 + rank)
                ax.plot([special.value], [special.point.measure(measure)], **mark)
    name_axes(ax, found.response, measure)
    ax.set_xlim(*sorted(found.within))


def draw_changes(found: Design, ax: Axes) -> None:
    """Draw the change of each parameter in percent as a bar, over the range of its limits."""
    units, changes = found.system.units, found.changes
    rows = np.arange(len(changes))
    sizes = np.array([each.before or 0.5 * (each.high - each.low) for each in changes])
    parts = 100.0 * np.array([(each.low - each.before, each.high - each.before) for each in changes]) / sizes[:, None]
    parts.sort(axis=1)  # that of a negative number grows to the left
    moved = 100.0 * np.array([each.after - each.before for each in changes]) / sizes
    ax.barh(rows, parts[:, 1] - parts[:, 0], left=parts[:, 0], height=0.72, color=_LIMIT, zorder=1)
    ax.barh(rows, moved, height=0.44, color=BLUE, zorder=3)
    ax.axvline(0.0, **stroke(BLACK, 0.8, zorder=4))
    widest = float(np.abs(parts).max())
    for row, each, part in zip(rows.tolist(), changes, moved.tolist(), strict=True):
        text = f"{each.before:.4g} → {each.after:.4g}  ({part:+.2f} %)"
        shift, side = (4.0, "left") if part >= 0.0 else (-4.0, "right")
        ax.annotate(
            text,
            (part, row),
            xytext=(shift, 0.0),
            textcoords="offset points",
            ha=side,
            va="center",
            fontsize=points(7.5),
            zorder=5,
        )
    ax.set_yticks(rows, [parameter_symbol(each.name, units) for each in changes])
    ax.set(xlim=(-1.04 * widest, 1.04 * widest), ylim=(len(changes) - 0.45, -0.55), xlabel="change in %, within limits")


def _branches(found: Design) -> list[tuple[Branch, str, int]]:
    new = [(branch, BLUE, 1) for branch in (found.response, *found.isolated)]
    return [(found.response_before, GREY, 0), *new]


def _bands(found: Design) -> list[tuple[float, float]]:
    return list(dict.fromkeys(goal.band for goal in found.goals if goal.band))


def _entries(found: Design) -> list[tuple[str, Any]]:
    entries: list[tuple[str, Any]] = [
        ("before", stroke(GREY, 1.7)),
        ("after", stroke(BLUE, 1.7)),
        ("unstable", stroke(BLACK, 0.9, _DASHES)),
    ]
    kinds = {getattr(goal, "kind", None) for goal in found.goals}
    seen = {each.kind for branch, *_ in _branches(found) for each in branch.special_points if each.kind in kinds}
    for kind in in_order(seen):
        entries.append((symbol_style(kind).text, symbols(symbol_style(kind).marker, 6.0, "white", BLACK, 0.6)))
    if _bands(found):
        words = [goal.words for goal in found.judged]
        entries.append((words[0] if len(words) == 1 else "bands of the goals", _BAND))
    if found.isolated:
        entries.append(("isolated branches are drawn like the response after", stroke(BLUE, 1.7)))
    return entries
