"""Sections of motions: a few points for an orbit, curves for a torus, a cloud for chaos."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gapwalk.attractor.section import Section
from gapwalk.plot.style import BLACK, BLUE
from gapwalk.plot.words import signal_words

_FEW = 33  # points from which on they are drawn as dots


def plot_section(found: Section, first: str, second: str, *, ax: Axes, title: bool = True) -> Axes:
    """Draw one signal over another at each point of a section.

    Parameters
    ----------
    found
        The section.
    first, second
        The signals, such as ``"q1"`` and ``"q1'"``.
    ax
        Where to draw.
    title
        Whether to say what the section is taken at.
    """
    x, y = found.signal(first), found.signal(second)
    ax.plot(x, y, linestyle="none", **_marker(len(x)))
    for axis, values in (("x", x), ("y", y)):
        low, high = (float(values.min()), float(values.max())) if len(values) else (-1.0, 1.0)
        pad = 0.12 * (high - low) or 0.1 * max(1.0, abs(high))
        getattr(ax, f"set_{axis}lim")(low - pad, high + pad)
    ax.set_xlabel(signal_words(first, found.system.units))
    ax.set_ylabel(signal_words(second, found.system.units))
    if title:
        ax.set_title(f"section at {found.text}", fontsize="small")
    return ax


def _marker(count: int) -> dict[str, Any]:
    if count < _FEW:
        return {"marker": "o", "markersize": 5.5, "markerfacecolor": BLUE, "markeredgecolor": BLACK}
    size = float(np.clip(60.0 / np.sqrt(count), 0.7, 3.0))
    return {"marker": ".", "markersize": size, "color": BLACK, "markeredgewidth": 0.0}
