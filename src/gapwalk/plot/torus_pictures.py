"""Pictures of tori: families over their parameter with rotation numbers; one torus in section and in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D

from gapwalk.flow.flow import PERIOD
from gapwalk.model.words import full_measure, measure_words, parameter_words, signal_words
from gapwalk.plot.branches import draw_branches, line_entries
from gapwalk.plot.picture import AnyFigure, Finish, Inches, draws, write_heading, write_legend, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILLION, stroke, symbols
from gapwalk.tori.torus import TURN, Torus, at_phases
from gapwalk.tori.torus_family import TorusDiagram, TorusEvent, TorusEventKind, TorusFamily

_STABLE = stroke(BLUE, 1.6, "-", zorder=4)
_UNSTABLE = stroke(BLUE, 1.2, (0, (4, 2)), zorder=4)
_LOCKED = "#f3dfb2"
_PALE = "#7fbce6"
_CURVES = (BLUE, VERMILLION, GREEN, PURPLE, BLACK)
_MARKS = {
    TorusEventKind.FOLD: symbols("D", 5.0, "white", BLUE),
    TorusEventKind.DOUBLING: symbols("s", 5.0, "white", VERMILLION),
    TorusEventKind.CHANGE: symbols("o", 5.0, "white", VERMILLION),
    TorusEventKind.PAIR: symbols("*", 8.0, "white", GREEN),
    TorusEventKind.RESONANCE: symbols("|", 9.0, GREY, GREY),
    TorusEventKind.GRAZING: symbols("v", 5.0, "white", GREY),
}
_CLOSE = 0.35  # share of the range around the tori that is shown beside them
_MOST = 4  # curves that have a panel of their own
_FINE = 400  # points of a curve
_ANGLES = 48  # angles of the excitation in a picture in space, per forcing period


@draws(TorusDiagram, panels=True, size=(8.0, 6.4))
def draw_torus_diagram(
    found: TorusDiagram, figure: AnyFigure, measure: str = "half", *, labels: bool = True, title: str = ""
) -> Finish:
    """Draw the branches with the families of tori above the rotation numbers of the tori."""
    branches = [member.branch for member in found.diagram.members]
    if not branches:  # with a second tone no motion is periodic
        if found.families:
            draw_torus_family(found.families[0], figure, measure, labels=labels, title=title)
        return lambda: None
    measure = full_measure(measure, branches[0].system.coordinates)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0))
    write_heading(figure, title)
    write_letters([upper, lower])
    within = _within(found)
    finish = draw_branches(branches, upper, measure, labels=labels, legend=False, within=within)
    for family in found.families:
        _draw_lines(upper, family, family.measure(measure))
    _make_room(upper, [family.measure(measure) for family in found.families])
    upper.set_xlabel("")
    _draw_rotations(lower, found.families, labels=labels)
    lower.set_xlabel(parameter_words(found.diagram.parameter, branches[0].system.units))
    write_legend(figure, [*line_entries(branches), *_entries(found.families)])
    return finish


def _make_room(ax: Axes, heights: Sequence[np.ndarray]) -> None:
    """Extend the range of the axes, which is that of the branches, to the tori."""
    low, high = ax.get_ylim()
    least, most = (extreme([low, high, *np.concatenate([*heights, [low]])]) for extreme in (min, max))
    room = 0.04 * (most - least)
    ax.set_ylim(least - room * (least < low), most + room * (most > high))


def _within(found: TorusDiagram) -> tuple[float, float] | None:
    """Return the range of the tori with some room; None to show all if they fill most of it or there are none."""
    if not found.families:
        return None
    values = np.concatenate([family.values for family in found.families])
    low, high = float(values.min()), float(values.max())
    room = _CLOSE * (high - low)
    whole = found.diagram.within
    return max(whole[0], low - room), min(whole[1], high + room)


@draws(TorusFamily, panels=True, size=(7.5, 5.6))
def draw_torus_family(
    family: TorusFamily, figure: AnyFigure, measure: str = "half", *, labels: bool = True, title: str = ""
) -> None:
    """Draw a measure and the rotation number of a family of tori over its parameter."""
    system = family.points[0].torus.system
    measure = full_measure(measure, system.coordinates)
    upper, lower = figure.subplots(2, 1, sharex=True)
    write_heading(figure, title)
    write_letters([upper, lower])
    _draw_lines(upper, family, family.measure(measure))
    upper.set_ylabel(measure_words(measure, system.units))
    _draw_rotations(lower, [family], labels=labels)
    lower.set_xlabel(parameter_words(family.parameter, system.units))
    write_legend(figure, _entries([family]))


def _draw_lines(ax: Axes, family: TorusFamily, heights: np.ndarray) -> None:
    """Draw a family, dashed where it is unstable."""
    values = family.values
    stable = np.array([point.torus.stable for point in family.points])
    if len(values) == 1:
        ax.plot(values, heights, **symbols("o", 3.0, BLUE, BLUE))
        return
    for first in range(len(values) - 1):
        pair = slice(first, first + 2)
        ax.plot(values[pair], heights[pair], **(_STABLE if stable[pair].all() else _UNSTABLE))


def _draw_rotations(ax: Axes, families: Sequence[TorusFamily], *, labels: bool) -> None:
    """Draw the rotation numbers of families, with their events; locked ranges are shaded."""
    for family in families:
        _draw_lines(ax, family, family.rotations)
        for event in family.events:
            if event.window is not None:
                ax.axvspan(event.window.low, event.window.high, color=_LOCKED, linewidth=0, zorder=0)
            ax.plot([event.value], [event.rotation], zorder=6, **_MARKS[event.kind])
            if labels and event.ratio is not None:
                ax.annotate(
                    str(event.ratio),
                    (event.value, event.rotation),
                    textcoords="offset points",
                    xytext=(4, 4),
                    fontsize="small",
                )
    ax.set_ylabel("rotation number")
    ax.margins(y=0.12)


def _entries(families: Sequence[TorusFamily]) -> list[tuple[str, Any]]:
    """List what occurs in pictures of families, for a legend."""
    points = [point for family in families for point in family.points]
    events: list[TorusEvent] = [event for family in families for event in family.events]
    kinds = {event.kind for event in events}
    return [
        *([("torus, stable", _STABLE)] if any(point.torus.stable for point in points) else []),
        *([("torus, unstable", _UNSTABLE)] if not all(point.torus.stable for point in points) else []),
        *((kind.value, look) for kind, look in _MARKS.items() if kind in kinds),
        *([("locked to a periodic motion", _LOCKED)] if any(event.window for event in events) else []),
    ]


def _torus_size(torus: Torus, *_: object, **__: object) -> Inches:
    return 3.2 * min(torus.curves, _MOST) + 4.4, 4.2


@draws(Torus, panels=True, size=_torus_size)
def draw_torus(torus: Torus, figure: AnyFigure, coordinate: str = "", *, title: str = "") -> None:
    """Draw each curve of a torus in the stroboscopic section, and the torus in space."""
    names, units = torus.system.coordinates, torus.system.units
    coordinate = coordinate or names[0]
    place = names.index(coordinate)
    rate = torus.system.size + place
    count = min(torus.curves, _MOST)
    grid = figure.add_gridspec(1, count + 1, width_ratios=[*[1.0] * count, 1.4])
    write_heading(figure, title)
    panels = [figure.add_subplot(grid[number]) for number in range(count)]
    for number, (panel, curve) in enumerate(zip(panels, torus.sections, strict=False)):
        closed = at_phases(curve, np.linspace(0.0, TURN, _FINE))
        panel.plot(closed[:, place], closed[:, rate], **stroke(_CURVES[number], 1.4, "-"))
        panel.set_xlabel(signal_words(coordinate, units))
        panel.margins(0.08)
        panel.xaxis.set_major_locator(MaxNLocator(4))
        if count > 1:
            panel.set_title(f"forcing period {number + 1} of {torus.curves}", fontsize="small")
    panels[0].set_ylabel(signal_words(f"{coordinate}'", units))
    write_letters(panels)
    space = figure.add_subplot(grid[count], projection="3d")
    assert isinstance(space, Axes3D)
    _draw_surface(space, torus, place, rate)


def _draw_surface(space: Axes3D, torus: Torus, place: int, rate: int) -> None:
    """Draw the torus as a surface: position and velocity turn about an axis with the angle of the excitation."""
    states = torus.surface(_ANGLES)
    angles = np.linspace(0.0, PERIOD, states.shape[0])[:, None]  # one turn for all m forcing periods
    x, y = states[:, :, place], states[:, :, rate] / torus.system.frequency
    middle, size = x.mean(), float(max(np.ptp(x), np.ptp(y)))
    radius = 1.6 * size + x - middle
    light = LightSource(azdeg=315, altdeg=50)
    space.plot_surface(
        radius * np.cos(angles), radius * np.sin(angles), y,
        color=_PALE, lightsource=light, linewidth=0, rcount=states.shape[0], ccount=states.shape[1],
    )  # fmt: skip
    widths = [float(np.ptp(each)) for each in (radius * np.cos(angles), radius * np.sin(angles), y)]
    space.set_box_aspect(widths, zoom=1.35)
    space.set_axis_off()
    space.view_init(elev=38.0, azim=-60.0)
    space.set_title(
        "once round: " + ("one forcing period" if torus.curves == 1 else f"{torus.curves} forcing periods"),
        fontsize="small",
    )
