"""Two histories in one picture, and the lines of two spectra side by side: black the first, red the second."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from gapwalk.attractor.agreement import LinePair
from gapwalk.motion.flow import PERIOD
from gapwalk.plot.style import BLACK, VERMILLION
from gapwalk.plot.words import order_words

FIRST: dict[str, Any] = {"color": BLACK, "linewidth": 1.2, "solid_joinstyle": "round"}
SECOND: dict[str, Any] = {"color": VERMILLION, "linewidth": 1.2, "linestyle": (0, (4, 1.5))}

_DEPTH = 1e-3  # smallest line that is shown, relative to the largest
_APART, _WIDEST = 0.007, 0.16  # half the distance of two lines of one order: of the picture; at most, of two orders
_LEAST = 5.0  # the lowest order up to which the picture reaches


def draw_histories(
    ax: Axes, theta: NDArray[np.float64], histories: ArrayLike, names: tuple[str, str], signal: str
) -> None:
    """Draw two histories of a signal over time in forcing periods."""
    first, second = np.asarray(histories)
    ax.plot(theta / PERIOD, first, label=names[0], **FIRST)
    ax.plot(theta / PERIOD, second, label=names[1], **SECOND)
    ax.set_xlim(float(theta[0]) / PERIOD, float(theta[-1]) / PERIOD)
    ax.set_xlabel("forcing periods")
    ax.set_ylabel(signal)


def draw_lines(ax: Axes, lines: Sequence[LinePair], signal: str, turns: int | None) -> None:
    """Draw the amplitudes of two line spectra side by side over their orders; `turns` is that of `System.turns`."""
    orders, first, second, _ = np.array(lines).T
    amplitudes = np.array([first, second], dtype=float)
    largest = float(amplitudes.max(initial=0.0)) or 1.0
    floor = _DEPTH * largest
    notable = np.flatnonzero(amplitudes.max(axis=0) > 3.0 * floor)
    last = int(notable[-1]) if len(notable) else 0
    shown = slice(0, max(last + 1, int(np.searchsorted(orders, _LEAST, side="right"))))
    top = float(orders[shown][-1]) + 0.6 * max(1.0, float(orders[0]))
    gap = min(_APART * top, _WIDEST * float(orders[0]))
    for shift, heights, style, marker in (
        (-gap, amplitudes[0, shown], FIRST, "o"),
        (gap, amplitudes[1, shown], SECOND, "s"),
    ):
        tops = np.maximum(heights, floor)
        ax.vlines(orders[shown] + shift, floor, tops, color=style["color"], linewidth=1.1)
        face = style["color"] if marker == "o" else "white"
        options = {"marker": marker, "markersize": 3.2, "markerfacecolor": face, "color": style["color"]}
        ax.plot(orders[shown] + shift, tops, linestyle="none", **options)
    ax.set_yscale("log")
    ax.set_ylim(floor, 2.5 * largest)
    ax.set_xlim(0.0, top)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel(order_words(turns))
    ax.set_ylabel(f"amplitude of {signal}")
