"""The figures of the paper: panels as the paper arranges them, in the style of all pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from gapwalk.bifurcation.branch import Branch
from gapwalk.paper.figure import Figure, Panel, View
from gapwalk.paper.loops import LOOPS
from gapwalk.plot.branch import begin_branches
from gapwalk.plot.hysteresis import plot_hysteresis
from gapwalk.plot.legend import draw_period_legend
from gapwalk.plot.paper_motions import WHOLE
from gapwalk.plot.pieces import pieces_of
from gapwalk.plot.sheet import lay_out, new_sheet
from gapwalk.plot.strobes import Strobes
from gapwalk.plot.style import BLACK, BLUE, GREEN, VERMILLION, in_style, rc
from gapwalk.plot.words import measure_words, parameter_words, state_words
from gapwalk.study.result import Result

MEASURE = "half.q1"
_WIDTH = {1: 8.0, 2: 7.2}  # of a panel in inches, by the number of columns
_HEIGHT = 4.3
_ABOVE = 31.0  # of a title above its panel in points: the legend stands between them
_LEGEND_INSIDE = (View.OVERLAY, View.HYSTERESIS)
_OVERLAY = ((BLACK, "-"), (VERMILLION, (0, (4.5, 1.6))), (BLUE, (0, (1.3, 1.3))))

Finish = Callable[[], None] | None
"""Draws what has no share in the layout, when that is final; None if there is nothing."""


def draw_paper_figure(figure: Figure, results: Mapping[str, Result], title: str | None = None) -> Picture:
    """Draw a figure of the paper.

    Parameters
    ----------
    figure
        The figure.
    results
        The results of its jobs, by their keys.
    title
        By default its number and its caption.
    """
    title = f"Figure {figure.name}. {figure.caption}" if title is None else title
    whole = WHOLE.get(figure.panels[0].view)
    picture = whole(figure, results, title) if whole else _draw_panels(figure, results, title)
    lay_out(picture)
    return picture


def _draw_panels(figure: Figure, results: Mapping[str, Result], title: str) -> Picture:
    columns = figure.columns
    rows = -(-len(figure.panels) // columns)
    with in_style():
        picture = new_sheet((_WIDTH[columns] * columns, _HEIGHT * rows))
        picture.suptitle(title, x=0.01, ha="left", fontsize=rc()["axes.titlesize"], wrap=True)
        axes = picture.subplots(rows, columns, squeeze=False)
        for ax, panel in zip(axes.flat, figure.panels, strict=False):
            pad = None if panel.view in _LEGEND_INSIDE else _ABOVE
            ax.set_title(f"{panel.letter}  {panel.title}".strip(), fontsize="small", weight="bold", pad=pad)
        shown = {key: _Shown(results[key]) for key in figure.jobs}
        finish: list[Finish] = [
            _DRAWERS[panel.view](ax, panel, [shown[figure.key(key)] for key in panel.jobs])
            for ax, panel in zip(axes.flat, figure.panels, strict=False)
        ]
        lay_out(picture)  # names are placed for the final layout, so after everything else
        for draw_the_rest in filter(None, finish):
            draw_the_rest()
    return picture


@dataclass(frozen=True)
class _Shown:
    """A result, of which several panels of a figure may show the same."""

    result: Result

    @cached_property
    def shortest(self) -> list[Branch]:
        """The branches of the shortest period."""
        branches = self.result.branches
        shortest = min(branch.period for branch in branches)
        return [branch for branch in branches if branch.period == shortest]

    @cached_property
    def strobes(self) -> Strobes:
        """All motions, once every forcing period."""
        assert self.result.diagram is not None
        return Strobes(self.result.diagram, "q1")


def _draw_response(ax: Axes, panel: Panel, shown: list[_Shown]) -> Finish:
    branches = shown[0].shortest
    return begin_branches(branches, MEASURE, ax, legend="above", closeup=panel.within is None, within=panel.within)


def _draw_balance(ax: Axes, panel: Panel, shown: list[_Shown]) -> Finish:
    """The response by shooting, and points by harmonic balance on it, spread evenly along the branch."""
    shot, balanced = shown
    finish = begin_branches(shot.shortest, MEASURE, ax, labels=False, legend="above", within=panel.within)
    other = balanced.result.branches[0]
    style = {"linestyle": "none", "marker": "o", "markersize": 4.2, "markerfacecolor": "none", "markeredgecolor": GREEN}
    ax.plot(other.values, other.measure(MEASURE), markevery=0.03, zorder=6, **style)
    # A legend beside the one above the axes, which has to stay the legend of the axes: the layout leaves room for it.
    ax.add_artist(Legend(ax, [Line2D([], [], **style)], ["harmonic balance"], loc="upper right"))
    return finish


def _draw_loops(ax: Axes, panel: Panel, shown: list[_Shown]) -> Finish:
    """All motions once every forcing period; what it returns writes the names of the branches."""
    strobes = shown[0].strobes
    diagram = strobes.diagram
    strobes.draw(ax)
    ax.set_xlabel(parameter_words(diagram.parameter))
    ax.set_ylabel(state_words("q1"))
    left, right = panel.within or diagram.within
    pad = 0.0 if panel.within else 0.02 * (right - left)
    ax.set(xlim=(left - pad, right + pad), ylim=strobes.extent(left, right))
    ax.set_autoscale_on(False)
    longest = max(limb.period for limb in diagram.limbs if _meets(limb.branch, left, right))
    draw_period_legend(ax, [period for period in strobes.periods if period <= longest], bool(strobes.births))
    return partial(strobes.draw_names, ax)


def _meets(branch: Branch, left: float, right: float) -> bool:
    """Whether a branch has points within a range of the parameter."""
    return bool(((branch.values >= left) & (branch.values <= right)).any())


def _draw_overlay(ax: Axes, panel: Panel, shown: list[_Shown]) -> Finish:
    """Branches of period 1, a line for each result; where they are unstable, the line is thin."""
    handles, heights = [], []
    for name, each, (color, dashes) in zip(panel.names, shown, _OVERLAY, strict=False):
        style = {"color": color, "linestyle": dashes}
        for branch in each.shortest:
            for piece in pieces_of(branch, MEASURE):
                ax.plot(piece.x, piece.y, linewidth=1.7 if piece.label == "stable" else 0.7, **style)
                inside = _inside(piece.x, panel.within)
                heights += list(piece.y[inside])
        handles.append(Line2D([], [], label=name, linewidth=1.7, **style))
    handles.append(Line2D([], [], label="thin: unstable", linewidth=0.7, color=BLACK))
    if panel.within:
        low, high = min(heights), max(heights)
        pad = 0.06 * (high - low)
        ax.set(xlim=panel.within, ylim=(low - pad, high + pad))
    ax.set_xlabel(parameter_words(shown[0].result.walked.parameter))
    ax.set_ylabel(measure_words(MEASURE))
    ax.legend(handles=handles, loc="best")
    return None


def _draw_hysteresis(ax: Axes, panel: Panel, shown: list[_Shown]) -> Finish:
    """Loops of contact force over deflection, in closed form."""
    plot_hysteresis([LOOPS[name] for name in panel.names], panel.names, ax=ax)
    return None


def _inside(x, within: tuple[float, float] | None):
    return slice(None) if within is None else (x >= within[0]) & (x <= within[1])


_DRAWERS: dict[View, Callable[[Axes, Panel, list[_Shown]], Finish]] = {
    View.RESPONSE: _draw_response,
    View.BALANCE: _draw_balance,
    View.LOOPS: _draw_loops,
    View.OVERLAY: _draw_overlay,
    View.HYSTERESIS: _draw_hysteresis,
}
