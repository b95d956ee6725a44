"""The picture of a system: its machine, forces of its contacts, what varies over the angle, and its loads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, MultipleLocator
from numpy.typing import NDArray

from gapwalk.flow.characteristics import AngleCurve, Characteristics, ForceCurve, characteristics_of
from gapwalk.model.system import System, check_system
from gapwalk.model.units import Units
from gapwalk.model.words import pace_words, parameter_words, signal_words
from gapwalk.plot.machine.elements import LETTER, Scene, draw_scene, svg_of
from gapwalk.plot.machine.layout import scene_of
from gapwalk.plot.picture import WIDE, AnyFigure, Inches, draws, open_window, write_heading, write_legend
from gapwalk.plot.style import (
    AXIS,
    BLACK,
    GREY,
    GUIDE,
    LISTED,
    SECOND,
    SHADE,
    in_style,
    points,
    sheet_size,
    stroke,
    symbols,
)

_PANELS = 12  # most panels of forces
_CURVES = 5  # most curves in a panel over the angle
_LETTER = 8.5  # points of the letters of the machine
_POINTS = 72.0  # in an inch
_FEW = 6  # breakpoints up to which each has a guide line

Points = Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Measured deflections and forces by the name of a contact."""


def _size(system: System, **_: object) -> Inches:
    panels, machine = _panels(characteristics_of(system)), _machine_height(system)
    rows = -(-len(panels) // _columns(len(panels))) if panels else 0
    rest = (0.6 + (3.0 if len(panels) > 1 else 3.9) * rows) if panels else 0.6
    return WIDE[0], rest + machine


def _machine_height(system: System) -> float:
    """Return the height of the machine, in inches of a screen."""
    scene, _, scale = _machine(system)
    return scene.height * scale / _POINTS / sheet_size(WIDE[0], 1.0)[1]


def _machine(system: System) -> tuple[Scene, float, float]:
    """Return the drawing of the machine, the width for it at the present size of pictures, and points in a pixel."""
    scale = points(_LETTER) / LETTER
    width = 0.96 * sheet_size(*WIDE)[0] * _POINTS / scale
    return scene_of(system, width), width, scale


def _columns(panels: int) -> int:
    return 1 if panels == 1 else 2 if panels != 3 and panels < 7 else 3 if panels > 6 else 2


def _panels(found: Characteristics) -> list[ForceCurve | AngleCurve]:
    loads = [] if found.loads is None else [found.loads]
    return [*found.forces[:_PANELS], *found.variations, *loads]


def draw_machine(system: System, *, ax: Axes | None = None, width: float = 660.0) -> Axes:
    """Draw the machine of a system: its bodies, springs, dampers, gears, gaps and loads, and how they connect.

    Parameters
    ----------
    system
        The system, made from a drive train, from matrices, or in relative coordinates.
    ax
        Axes to draw in, whose frame is removed; by default those of a new figure of pyplot, as large as the drawing.
    width
        Largest width of the drawing in pixels (letters are 11 pixels high); longer chains continue in further rows.

    Returns
    -------
    Axes
        The axes of the drawing; their data coordinates are pixels.

    Raises
    ------
    ModelError
        If `system` is no system.

    Examples
    --------
    >>> axes = gw.plot.draw_machine(driveline)
    >>> axes.figure.savefig("machine.pdf")
    """
    check_system(system, "gw.plot.draw_machine(system)")
    scene, scale = scene_of(system, width), points(_LETTER) / LETTER
    if ax is None:
        unit = scale / _POINTS / sheet_size(1.0, 1.0)[0]  # inches of a screen in a pixel
        ax = open_window((scene.width * unit, scene.height * unit)).add_subplot()
    with in_style():
        draw_scene(ax, scene, scene.width, scale)
    return ax


def machine_svg(system: System, width: float = 660.0) -> str:
    """Return the drawing of the machine of a system as the text of an SVG file, on white paper.

    Parameters
    ----------
    system
        The system.
    width
        Largest width of the drawing in pixels; longer chains continue in further rows.

    Returns
    -------
    str
        The text. Parts of the drawing have titles, which a browser shows under the pointer and a screen reader reads.

    Raises
    ------
    ModelError
        If `system` is no system.

    Examples
    --------
    >>> gw.plot.machine_svg(driveline)[:4]
    '<svg'
    """
    check_system(system, "gw.plot.machine_svg(system)")
    return svg_of(scene_of(system, width))


@draws(System, panels=True, size=_size, shows="forces and loads")
def draw_system(system: System, figure: AnyFigure, points: Points | None = None, *, title: str = "") -> None:
    """Draw what is in a system: the machine, the force of each contact at rest, what varies over the angle, loads."""
    found = characteristics_of(system)
    panels = _panels(found)
    write_heading(figure, title)
    machine = _machine(system)
    if not panels:
        draw_scene(figure.add_subplot(), *machine)
        return
    whole, height = _size(system)[1], _machine_height(system)
    above, below = figure.subfigures(2, 1, height_ratios=(height, whole - height), squeeze=False)[:, 0]
    _draw_panels(system, below, found, panels, points or {})
    draw_scene(above.add_subplot(), *machine)


def _draw_panels(
    system: System, figure: AnyFigure, found: Characteristics, panels: Sequence[ForceCurve | AngleCurve], points: Points
) -> None:
    """Draw forces over deflections and numbers over the angle."""
    columns = _columns(len(panels))
    axes = figure.subplots(-(-len(panels) // columns), columns, squeeze=False).ravel()
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    for ax, panel in zip(axes, panels, strict=False):
        if isinstance(panel, ForceCurve):
            _draw_force(ax, panel, system, points, columns)
        else:
            _draw_angle(ax, panel, system, columns)
    notes = [f"{name} = {law}" for name, law in found.others]
    notes += [f"{curve.name}" for curve in found.forces[_PANELS:]]
    if notes:
        figure.supxlabel(f"not drawn: {'; '.join(notes)}", x=0.01, ha="left", **_small(GREY), wrap=True)


def _small(color: str = BLACK) -> dict[str, Any]:
    return {"fontsize": points(8.0), "color": color}


def _draw_force(ax: Axes, curve: ForceCurve, system: System, measured: Points, columns: int) -> None:
    units, entries = system.units, []
    scale, unit = units.signal(".speed") if units and curve.over_slip else (1.0, "")
    curve = replace(curve, x=scale * curve.x, breakpoints=tuple(scale * each for each in curve.breakpoints))
    own = [measured[name] for name in curve.names if name in measured]
    if own:
        curve = _within(curve, own[0][0])
    if curve.band is not None:
        ax.fill_between(curve.x, *curve.band, color=SHADE, linewidth=0.0, zorder=1)
        for edge in curve.band:
            ax.plot(curve.x, edge, **stroke(GREY, 0.6), zorder=2)
    for x, force in own[:1]:
        size = float(np.clip(40.0 / math.sqrt(len(x)), 1.2, 4.0))
        ax.plot(x, force, **symbols("o", size, SECOND, SECOND, 0.0, zorder=2.5))
    line = stroke(BLACK, 1.4, solid_joinstyle="round")
    ax.plot(curve.x, curve.force, **line, zorder=3)
    levels = [level for level in curve.breakpoints if curve.x[0] <= level <= curve.x[-1]]
    corners = symbols("o", 4.2, "white", BLACK, 0.9)
    if levels:
        ax.plot(levels, np.interp(levels, curve.x, curve.force), **corners, zorder=4)
    if len(levels) <= _FEW:
        for level in levels:
            ax.axvline(level, **GUIDE.options(zorder=1))
    ax.axhline(0.0, **AXIS.options(zorder=1))
    ax.set_xlim(float(curve.x[0]), float(curve.x[-1]))
    ax.xaxis.set_major_locator(MaxNLocator((9, 5, 4)[columns - 1]))
    what = "slip" if curve.over_slip else "rate" if curve.over_rate else "deflection"
    where = " at deflection 0" if curve.over_rate and curve.is_at_zero else ""
    unit = unit or (units and units.state("'" if curve.over_rate else ""))
    ax.set_xlabel(f"{what} of {curve.name}{where}" + (f" [{unit}]" if unit else ""))
    ax.set_ylabel("torque [N m]" if units else "force")
    at = f"; o at {pace_words(system)}" * curve.over_slip
    _title(ax, f"{curve.name}: {curve.law}{at}" + "; shaded: over the angle" * (curve.band is not None), columns)
    if own:
        entries.append(("measured points", symbols("o", 3.0, SECOND, SECOND, 0.0)))
        entries.append(("stages", line))
    if levels and own:
        entries.append(("beginning of a stage", corners))
    if entries:
        _legend(ax, entries)


def _within(curve: ForceCurve, measured: NDArray[np.float64]) -> ForceCurve:
    """Return the part of a curve that was measured, with a margin."""
    margin = 0.04 * float(np.ptp(measured))
    shown = (curve.x > measured.min() - margin) & (curve.x < measured.max() + margin)
    band = None if curve.band is None else (curve.band[0][shown], curve.band[1][shown])
    return replace(curve, x=curve.x[shown], force=curve.force[shown], band=band)


def _legend(ax: Axes, entries: list[tuple[str, Any]]) -> None:
    """Write a legend inside, on white, so that guide lines do not cross its text."""
    write_legend(ax, entries, "inside")
    legend = ax.get_legend()
    if legend is not None:
        legend.set_frame_on(True)
        legend.get_frame().set(facecolor="white", edgecolor="none", alpha=0.85)


def _title(ax: Axes, text: str, columns: int) -> None:
    """Write a title above a panel, cut off where the next panel begins."""
    most = (96, 58, 36)[columns - 1]
    ax.set_title((text if len(text) <= most else f"{text[: most - 4]} ...").replace("$", r"\$"), **_small())


def _draw_angle(ax: Axes, curve: AngleCurve, system: System, columns: int) -> None:
    units, entries = system.units, []
    order = np.argsort(-np.ptp(curve.values, axis=1), kind="stable")
    shown = sorted(order[:_CURVES].tolist())
    factor = float(units.turns) if units and units.turns else 1.0
    angle = np.degrees(curve.theta) / factor
    for (color, dashes), place in zip(LISTED, shown, strict=False):
        line = stroke(color, 1.3, dashes)
        ax.plot(angle, curve.values[place], **line)
        entries.append((curve.names[place], line))
        ax.axhline(float(curve.means[place]), **stroke(color, 0.6, (0, (4, 2)), zorder=1))
    ax.set_xlim(float(angle[0]), float(angle[-1]))
    if curve.repeats == 1 and factor in (1.0, 2.0):
        ax.xaxis.set_major_locator(MultipleLocator(90.0 / factor))
    ax.margins(y=0.12)
    if len(entries) > 1:  # room for the legend
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.1 * (1 + len(entries)) * (high - low))
    again = "" if curve.repeats == 1 else f"; repeats every {angle[-1]:.4g} deg"
    whose = "angle of the excitation" if factor == 1.0 and not (units and units.turns) else "angle of the shaft"
    ax.set_xlabel(f"{whose} [deg]")
    ax.set_ylabel(_number_words(curve, units))
    rest = len(curve.names) - len(shown)
    name = "loads" if curve.parameter == "load" else parameter_words(curve.parameter).split(" [")[0]
    growing = any(load.depends_on_frequency for load in system.structure.driving)
    at = f" at {pace_words(system)}" if curve.parameter == "load" and growing else ""
    _title(ax, f"{name}{at}{again}{f' (and {rest} more)' * (rest > 0)}", columns)
    if len(entries) > 1:
        _legend(ax, entries)


def _number_words(curve: AngleCurve, units: Units | None) -> str:
    if curve.parameter == "load":
        on = f" on {curve.names[0]}" if len(curve.names) == 1 else ""
        return f"torque{on} [N m]" if units else f"load{on}"
    if curve.is_relative:
        return f"{curve.parameter}, relative to its mean"
    if not curve.means.any():
        return f"displacement in {signal_words(curve.names[0], units)}"
    return parameter_words(curve.names[0] if len(curve.names) == 1 else curve.parameter, units)
