"""A record over the computed motion: history, lines, and what is left over the phase (paper, figure 8)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure, SubFigure

from gapwalk.measurement.alignment import Alignment
from gapwalk.motion.flow import PERIOD
from gapwalk.orbit.sensitivity import signal_along
from gapwalk.plot.pair import SECOND, draw_lines
from gapwalk.plot.sheet import new_sheet, open_window
from gapwalk.plot.size import points, takes_size
from gapwalk.plot.style import BLACK, GREY, in_style
from gapwalk.plot.words import pace_words

SIZE = (9.5, 6.0)
_SHOWN = 3  # periods of the orbit in the history
_SMOOTH = 600  # points of the computed history a period of the orbit
_FEW = 120  # samples a period of the orbit up to which they are drawn as dots


@takes_size
def plot_alignment(found: Alignment, title: str | None = None, *, figure: Figure | SubFigure | None = None):
    """Draw a record over the computed motion.

    Parameters
    ----------
    found
        As from `gapwalk.align`, or the alignments of a fit.
    title
        Stands above rms error and correlation.
    figure
        Where to draw; by default a new figure of pyplot.
    """
    if figure is None:
        figure = open_window(SIZE)
    with in_style():
        _draw(figure, found, title)
    return figure


def draw_alignment(found: Alignment, title: str | None = None) -> Figure:
    """The same as a figure without pyplot."""
    with in_style():
        figure = new_sheet(SIZE)
        _draw(figure, found, title)
    return figure


def _draw(figure: Figure | SubFigure, found: Alignment, title: str | None) -> None:
    axes = figure.subplot_mosaic(
        [["history", "history"], ["lines", "rest"]],  # type: ignore[list-item]
        height_ratios=[1.15, 1.0],  # type: ignore[arg-type]
    )
    _draw_history(axes["history"], found)
    draw_lines(axes["lines"], found.agreement.lines, found.signal.name, found.orbit.system.turns)
    _draw_rest(axes["rest"], found)
    agreed = _words(found)
    figure.suptitle(agreed if title is None else f"{title}\n{agreed}", x=0.01, ha="left", fontsize=points(10.5))


def _draw_history(ax, found: Alignment) -> None:
    """The first periods of the record, and the computed motion at the same phases."""
    length = PERIOD * found.orbit.period
    begin = found.theta[0]
    shown = found.theta <= begin + min(_SHOWN, found.periods) * length
    theta = found.theta[shown]
    dots = np.count_nonzero(shown) <= _FEW * _SHOWN
    measured = {"linestyle": "none", "marker": "o", "markersize": 2.4} if dots else {"linewidth": 1.0}
    ax.plot(theta / PERIOD, found.measured[shown], color=BLACK, label=_name(found.record.name), **measured)
    fine = np.linspace(theta[0], theta[-1], _SMOOTH * min(_SHOWN, found.periods))
    whole = signal_along(found.orbit, found.signal, length * np.arange(_SMOOTH) / _SMOOTH)
    computed = signal_along(found.orbit, found.signal, fine) - whole.mean()
    ax.plot(fine / PERIOD, computed, label=f"computed at {pace_words(found.orbit.system)}", **SECOND)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.16 * (high - low))  # room for the legend
    ax.legend(loc="upper right", ncols=2)
    ax.set_xlim(theta[0] / PERIOD, theta[-1] / PERIOD)
    ax.set_xlabel("forcing periods")
    ax.set_ylabel(found.signal.name)


def _draw_rest(ax, found: Alignment) -> None:
    """What is left, over the phase in the period of the orbit: noise has no form, a fault of the model has."""
    phase = (found.theta / PERIOD) % found.orbit.period
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    ax.plot(phase, found.measured - found.computed, linestyle="none", marker=".", markersize=2.0, color=BLACK)
    ax.set_xlim(0.0, found.orbit.period)
    ax.set_xlabel("phase in the motion, forcing periods")
    ax.set_ylabel("measured minus computed")


def _words(found: Alignment) -> str:
    agreed = found.agreement
    return f"rms error {agreed.rms:.4g} ({agreed.relative:.2%} of the record's), correlation {agreed.correlation:.5f}"


def _name(name: str) -> str:
    return f"record ({name})".replace("$", r"\$")
