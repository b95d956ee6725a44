"""Picture of what a backbone foretells: the load that balances the losses, over the amplitude of the motion."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from gapwalk.free.island_births import Foretold
from gapwalk.model.words import measure_words, parameter_words
from gapwalk.plot.picture import draws, write_legend
from gapwalk.plot.style import BLACK, BLUE, GREEN, PURPLE, VERMILLION, stroke, symbols

_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE)
_BORN, _JOINS = symbols("o", 6.0, "white", BLACK), symbols("X", 6.0, "white", BLACK)
_SPAN = 30.0  # largest amplitude that is shown, in the largest birth or in the largest of the first harmonic


@draws(Foretold, size=(7.5, 4.6))
def draw_foretold(found: Foretold, ax: Axes, coordinate: str = "", *, title: str = "") -> None:
    """Draw the amplitude of the load over that of the motion, one line for each harmonic, with births."""
    system = found.line.system
    coordinate = coordinate or system.coordinates[0]
    half, place = found.line.half(coordinate), system.coordinates.index(coordinate)
    entries = []
    for number, harmonic in enumerate(found.harmonics):
        column = found.amplitudes[:, number]
        if not np.isfinite(column).any():
            continue
        look = stroke(_COLOURS[number % len(_COLOURS)], 1.8)
        ax.plot(half, np.where(np.isfinite(column), column, np.nan), **look)
        entries.append((f"harmonic {harmonic}", look))
    for birth in found.births:
        look = _JOINS if birth.joins else _BORN
        ax.plot([birth.point.half[place]], [birth.amplitude], zorder=5, **look)
    if any(not birth.joins for birth in found.births):
        entries.append(("an isolated branch is born", _BORN))
    if any(birth.joins for birth in found.births):
        entries.append(("branches join", _JOINS))
    finite = found.amplitudes[np.isfinite(found.amplitudes) & (found.amplitudes > 0.0)]
    births = [birth.amplitude for birth in found.births] or [float(np.median(finite))]
    ax.set_yscale("log")
    ax.set_ylim(max(float(finite.min()), min(births) / _SPAN), _SPAN * max(births))
    ax.set_title(title, loc="left")
    ax.set_xlabel(measure_words(f"half.{coordinate}", system.units))
    ax.set_ylabel(parameter_words(f"{found.load}.amplitude", system.units))
    write_legend(ax, entries, "below")
