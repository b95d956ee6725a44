"""Pictures of self-excitation: equilibria and the range of the motions over a parameter, and their frequency."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.both_directions import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.free.rest_walk import BORDER, CROSSING, FOLD, HOPF, Rests
from gapwalk.free.self_excitation import SelfExcited
from gapwalk.model.words import parameter_words, signal_words
from gapwalk.plot.branches import cut, draw_branches, line_entries
from gapwalk.plot.picture import AnyFigure, Finish, draws, write_heading, write_legend, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREEN, LINES, VERMILLION, stroke, symbols

_STABLE = stroke(BLUE, 1.4, "-", zorder=3)
_UNSTABLE = stroke(BLUE, 1.0, (0, (2, 1.5)), zorder=3)
_MARKS = {
    HOPF.name: symbols("o", 6.0, "white", VERMILLION),
    FOLD.name: symbols("D", 5.0, "white", BLACK),
    CROSSING.name: symbols("X", 6.0, "white", BLACK),
    BORDER: symbols("|", 9.0, GREEN, GREEN),
}
_STABLE_WORDS, _UNSTABLE_WORDS = "stable equilibrium", "unstable equilibrium"


@draws(Rests, size=(7.5, 4.2))
def draw_rests(line: Rests, ax: Axes, coordinate: str = "", *, title: str = "") -> None:
    """Draw a coordinate of equilibria over the parameter, dashed where they are unstable."""
    coordinate = _coordinate(line, coordinate)
    _draw_line(ax, line, coordinate)
    ax.set_title(title, loc="left")
    ax.set_xlabel(parameter_words(line.parameter, line.system.units))
    ax.set_ylabel(signal_words(coordinate, line.system.units))
    write_legend(ax, _entries([line]), "below")


@draws(SelfExcited, panels=True, size=(7.5, 6.4))
def draw_self_excited(
    found: SelfExcited, figure: AnyFigure, coordinate: str = "", *, labels: bool = True, title: str = ""
) -> Finish | None:
    """Draw equilibria with the largest and smallest values of the motions above the frequency of the motions."""
    coordinate = _coordinate(found.rests[0], coordinate)
    system, finish = found.system, None
    panels = np.atleast_1d(figure.subplots(2 if found.cycles else 1, 1, sharex=True))
    upper = panels[0]
    write_heading(figure, title)
    if found.cycles:
        finish = draw_branches(found.cycles, upper, f"max.{coordinate}", labels=labels, legend=False)
        upper.set_autoscale_on(True)
        for cycle in found.cycles:
            _draw_pieces(upper, cycle, lambda point: np.array([point.measure(f"min.{coordinate}")]))
            _draw_pieces(panels[1], cycle, _frequency)
        panels[1].set_ylabel("frequency of the motion" if system.units is None else _pace_words(found))
        write_letters(panels.tolist())
    for line in found.rests:
        _draw_line(upper, line, coordinate)
    upper.set_xlabel("")
    upper.set_ylabel(signal_words(coordinate, system.units))
    upper.margins(x=0.02, y=0.14)
    upper.autoscale_view()
    panels[-1].set_xlabel(parameter_words(found.parameter, system.units))
    upper.set_autoscale_on(False)
    write_legend(figure, [*(line_entries(found.cycles) if found.cycles else []), *_entries(found.rests)])
    return finish


def _coordinate(line: Rests, coordinate: str) -> str:
    names = line.system.coordinates
    coordinate = coordinate or names[0]
    if coordinate not in names:
        raise ModelError(f"coordinate is {coordinate!r}; it must be one of {', '.join(names)}")
    return coordinate


def _pace_words(found: SelfExcited) -> str:
    return parameter_words(found.system.structure.pace, found.system.units)


def _frequency(point: BranchPoint) -> np.ndarray:
    system = point.orbit.system
    return np.array([system[system.structure.pace]])


def _draw_pieces(ax: Axes, cycle: Branch, curve: Callable[[BranchPoint], np.ndarray]) -> None:
    for piece in cut(cycle, curve):
        ax.plot(piece.x, piece.y[:, 0], zorder=3, **LINES[piece.label].options())


def _draw_line(ax: Axes, line: Rests, coordinate: str) -> None:
    """Draw equilibria, dashed where they are unstable, with their events."""
    values, heights = line.values, line.coordinate(coordinate)
    stable = np.array([point.stable for point in line.points])
    for held, look in ((True, _STABLE), (False, _UNSTABLE)):
        own = stable == held
        drawn = own.copy()
        if not held:  # the step between a stable and an unstable point is drawn as unstable
            drawn[:-1] |= own[1:]
            drawn[1:] |= own[:-1]
        ax.plot(values, np.where(drawn, heights, np.nan), **look)
    place = line.system.coordinates.index(coordinate)
    for event in line.events:
        ax.plot([event.value], [event.point.position[place]], zorder=6, **_MARKS[event.kind])


def _entries(lines: Sequence[Rests]) -> list[tuple[str, dict[str, Any]]]:
    """List what occurs, for a legend."""
    states = {point.stable for line in lines for point in line.points}
    entries = [(_STABLE_WORDS, _STABLE)] * (True in states) + [(_UNSTABLE_WORDS, _UNSTABLE)] * (False in states)
    kinds = {event.kind for line in lines for event in line.events}
    return [*entries, *((kind, look) for kind, look in _MARKS.items() if kind in kinds)]
