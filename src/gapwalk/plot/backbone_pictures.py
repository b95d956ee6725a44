"""Pictures of backbones: amplitude over frequency, with a response beside it, and frequency over energy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.free.backbone_curve import CROSSING, TURN, Backbone
from gapwalk.free.island_births import Backbones
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words, signal_words
from gapwalk.plot.branches import draw_branches, line_entries, smooth_line
from gapwalk.plot.picture import AnyFigure, Finish, draws, write_heading, write_legend, write_letters
from gapwalk.plot.style import BLUE, GREEN, PURPLE, VERMILLION, stroke, symbols

_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE)
_ROOM = 2.5  # height of a picture with a response, in its largest amplitude
_MARKS = {
    TURN.name: symbols("D", 5.0, "white", BLUE),
    CROSSING.name: symbols("X", 6.0, "white", VERMILLION),
}


@draws(Backbone, panels=True, size=(7.5, 5.6))
def draw_backbone(
    line: Backbone,
    figure: AnyFigure,
    measure: str = "half",
    *,
    response: Branch | Sequence[Branch] = (),
    title: str = "",
) -> Finish | None:
    """Draw one backbone; see `draw_backbones`."""
    return draw_backbones(Backbones((line,)), figure, measure, response=response, title=title)


@draws(Backbones, panels=True, size=(7.5, 5.6))
def draw_backbones(
    found: Backbones,
    figure: AnyFigure,
    measure: str = "half",
    *,
    response: Branch | Sequence[Branch] = (),
    title: str = "",
) -> Finish | None:
    """Draw amplitudes over the frequency, and the frequency over the energy if the equations show it."""
    if not found.lines:
        raise ModelError("there is no backbone yet, so there is nothing to draw")
    system = found.lines[0].system
    what, _, coordinate = measure.partition(".")
    coordinate = coordinate or (measure if measure in system.coordinates else system.coordinates[0])
    if what not in ("half", coordinate) or coordinate not in system.coordinates:
        raise ModelError(f"measure is {measure!r}; a picture of backbones shows half of a coordinate, as in half.q1")
    # under a mean load the energy may pass zero, which its logarithmic axis has not
    has_energy = all(np.isfinite(line.energies).all() and line.energies.min() > 0.0 for line in found.lines)
    panels = np.atleast_1d(figure.subplots(2 if has_energy else 1, 1))
    write_heading(figure, title)
    branches = [response] if isinstance(response, Branch) else list(response)
    finish = None
    if branches:
        finish = draw_branches(branches, panels[0], f"half.{coordinate}", legend=False, labels=False)
        panels[0].set_autoscale_on(True)
    pace = _pace_words(system, shared=bool(branches))
    entries: list[tuple[str, Any]] = []
    for number, line in enumerate(found.lines):
        look = stroke(_COLOURS[number % len(_COLOURS)], 1.8, "-", zorder=5)
        entries.append((line.name, look))
        panels[0].plot(*_curve(line, line.values, line.half(coordinate)), **look)
        if has_energy:
            logarithms, values = _curve(line, np.log(line.energies), line.values)
            panels[1].plot(np.exp(logarithms), values, **look)
        place = system.coordinates.index(coordinate)
        for event in line.events:
            panels[0].plot([event.value], [event.point.half[place]], zorder=6, **_MARKS[event.kind])
            if has_energy:
                panels[1].plot([event.point.energy], [event.value], zorder=6, **_MARKS[event.kind])
    kinds = {event.kind for line in found.lines for event in line.events}
    entries += [(kind, look) for kind, look in _MARKS.items() if kind in kinds]
    panels[0].set_xlabel(pace)
    if branches:
        # the response follows a backbone up to its peak, far below the largest free vibrations
        peak = max(point.measure(f"half.{coordinate}") for branch in branches for point in branch.points)
        panels[0].set_ylim(0.0, _ROOM * peak)
    panels[0].set_ylabel(f"amplitude of {signal_words(coordinate, system.units)}")
    if has_energy:
        panels[1].set_xscale("log")
        panels[1].set_xlabel("energy")
        panels[1].set_ylabel(_pace_words(system, shared=True))
        write_letters(panels.tolist())
    write_legend(figure, [*line_entries(branches), *entries])
    return finish


def _pace_words(system: System, *, shared: bool) -> str:
    """Return the label of the axis of frequencies: a free vibration has its own; short if the axis is shared."""
    pace = system.structure.pace
    words = parameter_words(pace, system.units)
    if pace != "frequency":
        return words
    _, bracket, unit = words.partition(" [")
    return f"frequency{'' if shared else ' of the free vibration'}{bracket}{unit}"


def _curve(
    line: Backbone, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two quantities along a backbone, smooth where the contacts stay the same: in between there are corners."""
    points = np.column_stack((x, y))
    steps = np.diff(points, axis=0) / (np.ptp(points, axis=0) + np.finfo(float).tiny)
    along = np.append(0.0, np.cumsum(np.hypot(*steps.T)))
    touches = np.array([point.touches for point in line.points])
    parts = np.split(np.arange(len(points)), np.flatnonzero(np.diff(touches)) + 1)
    curve = np.concatenate([smooth_line(along[part], points[part]) for part in parts])
    return curve[:, 0], curve[:, 1]
