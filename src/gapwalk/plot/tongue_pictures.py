"""Pictures of Arnold tongues: the regions of two parameters in which motions lock, with their tips."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gapwalk.model.words import parameter_words
from gapwalk.plot.picture import draws, write_legend
from gapwalk.plot.style import BLACK, BLUE, GREEN, PURPLE, VERMILLION, stroke, symbols
from gapwalk.tori.tongue import Tongue

_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE)
_TIP = symbols("*", 8.0, "white", BLACK)
_PALE = 0.25


@draws(Tongue, several=True, size=(7.5, 4.8))
def draw_tongue(found: Tongue | Sequence[Tongue], ax: Axes, *, labels: bool = True, title: str = "") -> None:
    """Draw both sides of a tongue, or of several, over both parameters, and the regions between them."""
    tongues = [found] if isinstance(found, Tongue) else list(found)
    entries: list[tuple[str, Any]] = []
    for number, tongue in enumerate(tongues):
        color = _COLOURS[number % len(_COLOURS)]
        look = stroke(color, 1.4, "-", zorder=3)
        ax.fill(*_outline(tongue).T, color=color, alpha=_PALE, linewidth=0, zorder=1)
        for side in tongue.sides:
            ax.plot(*side.values.T, **look)
        entries.append((f"folds of period {tongue.period}: locked {tongue.ratio} between them", look))
        if tongue.tip is not None:
            ax.plot(*tongue.tip.values, zorder=5, **_TIP)
        if labels:
            top = tongue.sides[0].values[np.argmax(tongue.sides[0].values[:, 1])]
            ax.annotate(str(tongue.ratio), top, textcoords="offset points", xytext=(-4, 4), ha="right", color=color)
    if any(tongue.tip is not None for tongue in tongues):
        entries.append(("tip", _TIP))
    system = tongues[0].sides[0].points[0].orbit.system
    ax.set_title(title, loc="left")
    ax.set_xlabel(parameter_words(tongues[0].first, system.units))
    ax.set_ylabel(parameter_words(tongues[0].second, system.units))
    ax.margins(0.06)
    write_legend(ax, entries, "below")


def _outline(tongue: Tongue) -> NDArray[np.float64]:
    """Return the points along one side, to the tip if there is one, and back along the other side."""
    one, other = (side.values for side in tongue.sides)
    size = np.ptp(np.concatenate((one, other)), axis=0)
    size[size == 0.0] = 1.0  # a tongue too narrow to be followed has one point on each side
    if tongue.tip is not None:
        tip = np.array(tongue.tip.values)
        one, other = (
            each if _far(each[0], tip, size) > _far(each[-1], tip, size) else each[::-1] for each in (one, other)
        )
        return np.concatenate((one, [tip], other[::-1]))
    if _far(one[-1], other[-1], size) > _far(one[-1], other[0], size):
        other = other[::-1]
    return np.concatenate((one, other[::-1]))


def _far(one: NDArray[np.float64], other: NDArray[np.float64], size: NDArray[np.float64]) -> float:
    return float(np.abs((one - other) / size).max())
