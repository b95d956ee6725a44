"""A diagram in two panels: a measure of the motions of the shortest period, and stroboscopic states of all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import ModelError
from gapwalk.plot.branch import plot_branches
from gapwalk.plot.legend import draw_period_legend
from gapwalk.plot.sheet import open_window, when_laid_out
from gapwalk.plot.size import broken, takes_size
from gapwalk.plot.strobes import Strobes
from gapwalk.plot.style import SHADE, diagram_size, in_style
from gapwalk.plot.words import full_measure, parameter_words, state_words

AnyFigure = Figure | SubFigure


@takes_size
def plot_diagram(
    diagram: Diagram,
    measure: str = "half",
    *,
    figure: AnyFigure | None = None,
    labels: bool = True,
    legend: bool = True,
    closeup: tuple[float, float] | Literal[False] | None = None,
) -> AnyFigure:
    """Draw a diagram in two panels over its parameter, and a third one for a close-up.

    The first shows a measure of the motions of the shortest period; the second the states of all motions, seen once
    every forcing period: a motion of period m is m curves.

    Parameters
    ----------
    diagram
        The diagram.
    measure
        What the first panel shows, as in `plot_branch`; the others show the same coordinate.
    figure
        Where to draw; by default in a new figure of pyplot, of a size that suits the panels.
    labels
        Whether special points and branches have their names beside them.
    legend
        Whether to explain what is drawn.
    closeup
        Range of the parameter that a third panel enlarges; by default where most branches are born, if that is a small
        part of the whole. False: no third panel.

    Returns
    -------
    Figure or SubFigure
        The figure that was drawn in.

    Raises
    ------
    ModelError
        If the diagram has no branches, or there is no such measure.
    """
    options: Any = {"labels": labels, "legend": legend, "closeup": closeup}
    return draw_diagram(diagram, measure, lambda panels: figure or open_window(diagram_size(panels)), **options)


def draw_diagram(
    diagram: Diagram,
    measure: str,
    make: Callable[[int], AnyFigure],
    *,
    labels: bool = True,
    legend: bool = True,
    closeup: tuple[float, float] | Literal[False] | None = None,
) -> AnyFigure:
    """Draw as `plot_diagram` does, into a figure that is made when the number of its panels is known."""
    if not diagram.limbs:
        raise ModelError("the diagram has no branches yet, so there is nothing to draw")
    system = diagram.branches[0].system
    coordinates = system.coordinates
    measure = full_measure(measure, coordinates)
    signal = measure.partition(".")[2]
    shortest = min(limb.period for limb in diagram.limbs)
    first = [limb.branch for limb in diagram.limbs if limb.period == shortest]
    strobes = Strobes(diagram, signal if signal in coordinates else coordinates[0])
    crowd = strobes.crowd() if closeup is None else closeup or None
    count = 3 if crowd else 2
    figure = make(count)
    with in_style():
        panels = figure.subplots(count, 1, height_ratios=[1.0] + [1.25] * (2 if crowd else 1))
        for letter, panel in zip("abc", panels, strict=False):
            panel.text(0.012, 0.975, letter, transform=panel.transAxes, va="top", weight="bold", zorder=7)
            panel.set_xlabel(parameter_words(diagram.parameter, system.units))
        for panel in panels[1:]:
            strobes.draw(panel)
            panel.set_ylabel(broken(state_words(strobes.coordinate, system.units)))
        _set_limits(panels, strobes, crowd)
        if legend:
            draw_period_legend(panels[1], strobes.periods, bool(strobes.births))
        plot_branches(first, measure, ax=panels[0], labels=labels, legend="above" if legend else False, closeup=True)
        if labels:
            when_laid_out(lambda: strobes.draw_names(panels[1], without=crowd))
            for panel in panels[2:]:
                when_laid_out(partial(strobes.draw_names, panel))
    return figure


def _set_limits(panels: Sequence[Axes], strobes: Strobes, crowd: tuple[float, float] | None) -> None:
    """Make panels a and b cover the same range, and c that of the close-up, which is shaded in b."""
    panels[1].margins(x=0.02, y=0.06)
    panels[1].autoscale_view()
    panels[0].sharex(panels[1])
    if crowd:
        panels[1].axvspan(*crowd, color=SHADE, linewidth=0, zorder=0.5)
        panels[2].set(xlim=crowd, ylim=strobes.extent(*crowd))
        panels[2].set_title("the shaded range of b", fontsize="small")
    for panel in panels[1:]:
        panel.set_autoscale_on(False)
